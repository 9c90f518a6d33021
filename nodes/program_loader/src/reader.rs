//! Reads a program line by line, and decides which line comes next.
//!
//! Where a program begins and ends is in [`ends`], what waits for a probe in [`stretches`]; O words
//! are [`flow`](crate::flow)'s, blocks the lexer's and the interpreter's.

mod calculations;
mod deleted;
mod ends;
mod parts;
mod remarks;
mod stretches;

pub(crate) use parts::Parts;

use crate::LoadOptions;
use crate::block::Block;
use crate::dialect::{Dialect, GWord, OffsetWord};
use crate::expression::Parameter;
use crate::findings::{Findings, Mark};
use crate::flow::{Cursor, Flow, Next, World, no_profile, no_program};
use crate::interpreter::{After, Interpreter, code_in_tenths};
use crate::lexer;
use crate::limits;
use crate::line::{Line, without_carriage_returns};
use crate::no_effect::NoEffects;
use crate::parameter_file::Stored;
use crate::parameters::{CannotSet, Parameters};
use crate::pieces::{Piece, Pieces};
use crate::rules::Rules;
use crate::subroutines::unread_file;
use crate::values::Values;
use cnc_msgs::calls::Calls;
use cnc_msgs::contour::Source;
use cnc_msgs::finding::{Code, Finding};

/// Which part of the text is being read.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Section {
    /// No block yet.
    Before,
    /// Between the first block, or `%`, and the end.
    Within,
    /// After the end, which is in this line.
    After { end_line: u32, is_reported: bool },
}

/// Reads one program.
pub(crate) struct Reader<'r> {
    /// The whole text; empty where it comes in pieces.
    held: &'r [u8],
    rules: &'r Rules<'r>,
    options: &'r LoadOptions,
    interpreter: Interpreter<'r>,
    findings: Findings,
    block: Block,
    section: Section,
    has_blocks: bool,
    /// The last line of a program without an end, where something is appended to it.
    last_line_without_end: Option<u32>,
    /// Of the text so far.
    ends_with_line_feed: bool,
    parameters: Parameters,
    /// It has been said that no log file is written.
    has_reported_log: bool,
    /// Nothing where the program has no O words.
    flow: Option<Flow<'r>>,
    /// The line that needs the result of a probe which is still to come.
    awaits: Option<Source>,
    deleted: NoEffects,
}

/// What a program has come to.
pub(crate) struct Read<'r> {
    pub(crate) interpreter: Interpreter<'r>,
    /// At the end.
    pub(crate) parameters: Parameters,
    pub(crate) findings: Findings,
    /// That the findings and events were made in.
    pub(crate) calls: Calls,
    /// The line that needs the result of a probe which is still to come: nothing was read from there on.
    pub(crate) awaits: Option<Source>,
    /// Lines that begin with `/`.
    pub(crate) deleted: NoEffects,
}

/// How a line ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outcome {
    Line,
    Jump(Cursor),
    Stop,
}

impl<'r> Reader<'r> {
    pub(crate) fn new(
        held: &'r [u8],
        rules: &'r Rules<'r>,
        options: &'r LoadOptions,
        interpreter: Interpreter<'r>,
        flow: Option<Flow<'r>>,
        findings: Findings,
    ) -> Self {
        Self {
            held,
            rules,
            options,
            interpreter,
            findings,
            block: Block::default(),
            section: Section::Before,
            has_blocks: false,
            last_line_without_end: None,
            ends_with_line_feed: false,
            parameters: Parameters::default(),
            has_reported_log: false,
            flow,
            awaits: None,
            deleted: NoEffects::default(),
        }
    }

    /// Gives parameters the values of a parameter file.
    pub(crate) fn store(&mut self, values: &[Stored]) {
        self.parameters.store(values);
    }

    /// Reads and executes the program; see [`load_in_parts`](crate::load_in_parts). One with a flow comes in one piece.
    pub(crate) fn read(mut self, pieces: &mut dyn Pieces, mut parts: Parts<'_>) -> Read<'r> {
        let mut cursor = Cursor { offset: 0, line: 1 };
        let mut last_line = 0;
        'text: while let Some(Piece { text, left }) = pieces.next() {
            self.ends_with_line_feed =
                text.last().map_or(self.ends_with_line_feed, |&it| it == b'\n');
            'jump: loop {
                let from = cursor.offset;
                let ends = memchr::memchr_iter(b'\n', &text[from..]).map(|end| from + end);
                for end in ends.chain((left == 0).then_some(text.len())) {
                    last_line = cursor.line;
                    let whole = &text[cursor.offset.min(end)..end];
                    let call = self.flow.as_ref().map_or(0, Flow::row);
                    let content = without_carriage_returns(whole);
                    let line = Line { number: cursor.line, text: content, call };
                    match self.line(line, cursor) {
                        // It is read again with the rows.
                        Outcome::Line | Outcome::Jump(_) if self.interpreter.misses_tools() => {
                            break 'text;
                        }
                        Outcome::Line if self.interpreter.event_count() >= parts.least => {
                            // Near the end it is not worth while; with loops nobody knows how near it is. A text in
                            // pieces has more events than are held.
                            let after = left + text.len().saturating_sub(end) as u64;
                            let is_held = self.flow.is_none() && parts.most == usize::MAX;
                            if !is_held || after > parts.least as u64 {
                                self.give(&mut parts, line);
                            }
                        }
                        Outcome::Line => {}
                        Outcome::Jump(to) => {
                            cursor = to;
                            continue 'jump;
                        }
                        Outcome::Stop => break 'text,
                    }
                    cursor = Cursor { offset: end + 1, line: cursor.line + 1 };
                }
                break;
            }
            cursor.offset = 0;
        }
        self.findings.begin_block();
        if self.awaits.is_some() || self.interpreter.misses_tools() {
            // Its end is still to be read.
        } else if self.options.is_single_block && !self.block.ends_reading {
            self.refuse_unless_single(last_line);
        } else if !self.block.ends_reading {
            self.check_end(last_line);
        }
        let calls = self.flow.map(Flow::into_calls).unwrap_or_default();
        let Self { interpreter, parameters, findings, awaits, deleted, .. } = self;
        Read { interpreter, parameters, findings, calls, awaits, deleted }
    }

    /// Reads and executes one line.
    #[inline]
    fn line(&mut self, line: Line<'_>, at: Cursor) -> Outcome {
        self.findings.begin_block();
        let is_after = matches!(self.section, Section::After { .. });
        if let Some(flow) = &mut self.flow {
            if is_after && flow.begins_at(line.number) {
                return Outcome::Stop;
            }
            let work = self.interpreter.work();
            if !is_after && !flow.count(line, work, &mut self.findings) {
                return self.stop(line);
            }
        }
        if line.text.len() > limits::LINE_BYTES_MAX {
            self.too_long(line);
            self.has_blocks = true;
            return match self.flow {
                // It may come again and again.
                Some(_) => self.stop(line),
                None => Outcome::Line,
            };
        }
        if let Some(outcome) = self.percent_in_call(line) {
            return outcome;
        }
        if self.percent(line) || self.is_deleted(line) {
            return Outcome::Line;
        }
        if let Section::After { .. } = self.section {
            return match self.is_reported_after_end(line) {
                true => Outcome::Stop,
                false => Outcome::Line,
            };
        }
        if self.flow.is_some() {
            return self.line_in_flow(line, at);
        }
        match self.block(line) {
            After::Block => Outcome::Line,
            After::End if self.block.ends_reading => Outcome::Stop,
            After::End => {
                self.section = Section::After { end_line: line.number, is_reported: false };
                Outcome::Line
            }
            After::Probe => Outcome::Stop,
            after => self.no_program(line, after),
        }
    }

    /// Reads and executes one block.
    #[inline]
    fn block(&mut self, line: Line<'_>) -> After {
        let values = Values {
            parameters: &self.parameters,
            interpreter: &self.interpreter,
            line: line.number,
            is_single_block: self.options.is_single_block,
        };
        let rules = &self.rules.dialect.lexer;
        let before = self.place();
        lexer::read(line, rules, &mut self.block, &mut self.findings, &values);
        if self.block.ends_reading {
            return After::End;
        }
        if self.interpreter.needs_stretch() && !self.stretch(line, before) {
            return After::Probe;
        }
        if !self.block.assignments.is_empty() {
            self.has_blocks = true;
            self.section = Section::Within;
            self.assign(line);
        }
        if let Some(remark) = self.block.remark.take() {
            let before = self.place();
            self.remark(line, remark);
            if self.interpreter.needs_stretch() {
                if !self.stretch(line, before) {
                    return After::Probe;
                }
                self.findings.back_to(before.0);
                self.remark(line, remark);
            }
        }
        if self.block.words.is_empty() && !self.block.is_damaged {
            return After::Block;
        }
        self.has_blocks = true;
        self.section = Section::Within;
        if self.options.is_single_block {
            self.refuse_lasting(line);
        }
        let place = self.place();
        let state = self.interpreter.before_stretch();
        let after = self.interpreter.execute(line, &self.block, &mut self.findings);
        match state {
            Some(state) if self.interpreter.needs_stretch() => {
                self.execute_in_stretch(line, (before.0, place), state, after)
            }
            _ => after,
        }
    }

    /// How many findings and events there are.
    #[inline]
    fn place(&self) -> (Mark, usize) {
        (self.findings.mark(), self.interpreter.event_count())
    }

    /// Reports what acts on later blocks only, in a block by hand.
    #[cold]
    fn refuse_lasting(&mut self, line: Line<'_>) {
        let Dialect { g, m, .. } = self.rules.dialect;
        // A tool, or how a work system is rotated.
        let sets_for_later = self.block.words.iter().any(|word| match word.letter {
            b'L' => [1.0, 10.0].contains(&word.value),
            letter => letter == b'R',
        });
        for word in &self.block.words {
            let calls = self.rules.dialect.lexer.programs.and_then(|it| it.call);
            let lasts = calls.is_some_and(|(letter, _)| letter == word.letter)
                || code_in_tenths(word.value).is_some_and(|tenths| match word.letter {
                    b'G' => match g(tenths) {
                        GWord::Offset(OffsetWord::Set) => sets_for_later,
                        word => word.only_acts_later(),
                    },
                    b'M' => m(tenths / 10).only_acts_later(),
                    _ => false,
                });
            if lasts {
                let (start, end) = (usize::from(word.start), usize::from(word.end));
                let source = line.source(self.block.number, start, end);
                let message =
                    format!("{} acts on the blocks after it only", line.quote(start, end));
                let help = "a block by hand keeps nothing for the next one; use it in a program";
                self.findings.push(Finding::error(Code::Unsupported, source, message).help(help));
                self.block.is_damaged = true;
            }
        }
    }

    /// A line of a program with O words: what comes next is not always the line after it.
    fn line_in_flow(&mut self, line: Line<'_>, at: Cursor) -> Outcome {
        let first_finding = self.findings.count();
        let outcome = match self.step(line, at) {
            Next::Line | Next::Block => Outcome::Line,
            Next::Jump(to) => {
                let depth = self.flow.as_ref().map_or(0, Flow::depth);
                let source = line.source(None, 0, line.text.trim_ascii_end().len());
                self.interpreter.follow_profile(depth, &mut self.findings);
                self.interpreter.set_depth(depth, source, &mut self.findings);
                Outcome::Jump(to)
            }
            Next::Stop => self.stop(line),
        };
        if self.findings.count() > first_finding
            && let Some(flow) = &mut self.flow
        {
            flow.drop_repeated(&mut self.findings, first_finding);
        }
        outcome
    }

    /// Nothing: it has been reported why, and what follows was never to be reached.
    fn stop(&mut self, line: Line<'_>) -> Outcome {
        self.section = Section::After { end_line: line.number, is_reported: true };
        Outcome::Stop
    }

    fn step(&mut self, line: Line<'_>, at: Cursor) -> Next {
        let before = self.place();
        let Some(flow) = &mut self.flow else { return Next::Line };
        let mut world = World {
            parameters: &mut self.parameters,
            interpreter: &self.interpreter,
            findings: &mut self.findings,
        };
        let next = flow.step(line, at.offset, &mut world);
        if self.interpreter.needs_stretch() && !self.stretch(line, before) {
            return Next::Stop;
        }
        match next {
            Next::Block => {}
            next => {
                self.has_blocks = true;
                if self.section == Section::Before {
                    self.section = Section::Within;
                }
                return next;
            }
        }
        let after = self.block(line);
        let Some(flow) = &mut self.flow else { return Next::Line };
        match after {
            After::Block => Next::Line,
            After::Probe => Next::Stop,
            After::End
                if self.rules.dialect.lexer.programs.is_some()
                    && flow.depth() > 0
                    && !self.block.ends_reading =>
            {
                self.end_in_call(line)
            }
            After::End => {
                let is_reported = self.block.ends_reading;
                self.section = Section::After { end_line: line.number, is_reported };
                Next::Line
            }
            After::Call { program, times } => {
                let mut world = World {
                    parameters: &mut self.parameters,
                    interpreter: &self.interpreter,
                    findings: &mut self.findings,
                };
                flow.call_program(at, line, program, times, &mut world)
            }
            After::Profile(number) => {
                let mut world = World {
                    parameters: &mut self.parameters,
                    interpreter: &self.interpreter,
                    findings: &mut self.findings,
                };
                flow.call_profile(at, line, number, &mut world)
            }
            After::EndOfProgram => match flow.end_program() {
                Some(next) => next,
                None => {
                    let running = flow.running();
                    self.refuse_endless(line, running);
                    Next::Stop
                }
            },
        }
    }

    /// Sets the parameters of a block that has been read.
    fn assign(&mut self, line: Line<'_>) {
        if self.rules.dialect.lexer.r_parameters {
            self.check_calculation(line);
        }
        // It keeps its room for the next block.
        let mut assignments = std::mem::take(&mut self.block.assignments);
        for assignment in assignments.drain(..) {
            if self.options.is_single_block {
                let source = line.source(self.block.number, assignment.start, assignment.end);
                let message = "a block by hand keeps no parameter for the next one";
                let help = "set parameters in a program";
                self.findings.push(Finding::error(Code::Unsupported, source, message).help(help));
                continue;
            }
            if let Parameter::Numbered(number) = assignment.parameter
                && !self.rules.dialect.lexer.r_parameters
                && self.interpreter.set_measured(number, assignment.value)
            {
                continue;
            }
            let Err(why) = self.parameters.set(&assignment.parameter, assignment.value) else {
                continue;
            };
            let source = line.source(self.block.number, assignment.start, assignment.end);
            let quote = line.quote(assignment.start, assignment.end);
            let (message, help) = match why {
                CannotSet::NoSuchNumber => (
                    format!("`{quote}`: there is no such parameter"),
                    "numbered parameters are #1 to #5602",
                ),
                CannotSet::ReadOnly => (
                    format!("`{quote}`: this parameter cannot be set, the machine gives its value"),
                    "use another name or number; G10, G28.1 and G92 set offsets",
                ),
            };
            self.findings.push(Finding::error(Code::BadNumber, source, message).help(help));
            self.block.is_damaged = true;
        }
        self.block.assignments = assignments;
    }

    /// M98 or M99 in a program without program numbers.
    #[cold]
    fn no_program(&mut self, line: Line<'_>, after: After) -> Outcome {
        let programs = self.rules.dialect.lexer.programs;
        if let After::Call { program, .. } = after {
            let unread = unread_file(self.held, &program.to_string());
            let (message, help) = unread.unwrap_or_else(|| match programs {
                Some(programs) => programs.missing(program),
                None => no_program(program),
            });
            let source = line.source(self.block.number, self.block.start, self.block.end);
            self.findings.push(Finding::error(Code::Syntax, source, message).help(help));
        } else if let After::Profile(number) = after {
            self.findings.push(no_profile(line, number));
        } else {
            self.refuse_endless(line, None);
        }
        self.section = Section::After { end_line: line.number, is_reported: true };
        Outcome::Stop
    }

    /// M99 in the main program: LinuxCNC would begin it again without an end.
    #[cold]
    fn refuse_endless(&mut self, line: Line<'_>, running: Option<String>) {
        let (message, help) = match (running, self.rules.dialect.lexer.programs) {
            (None, Some(programs)) => (
                format!("{} ends a program that has been called, and none has been", programs.end),
                "end the main program with M2 or M30",
            ),
            (None, None) => (
                "M99 in the main program begins it again, without an end".to_owned(),
                "end the program with M2 or M30, and run it again",
            ),
            (Some(running), _) => {
                (format!("M99 does not end {running}"), "end a subroutine with endsub or return")
            }
        };
        let source = line.source(self.block.number, self.block.start, self.block.end);
        self.findings.push(Finding::error(Code::Unsupported, source, message).help(help));
    }
}
