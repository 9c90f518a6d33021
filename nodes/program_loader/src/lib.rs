//! Reads the text of a part program into a programmed contour.
//!
//! ```text
//! bytes --line--> lexer --Block--> interpreter --events--> ProgrammedContour
//!                    \__ dialect: what a word means __/
//! ```
//!
//! The loader knows the languages of controls: how words are written, what they mean, in which
//! order a block is executed, where the tool is. Tool tables and the geometry of compensation are
//! the planner's. All findings of a program are collected, each with its place.
//!
//! Where RS-274 leaves a choice, the loader decides: F is in the units of its own block (grbl).
//! The radii of an arc may differ as LinuxCNC allows, but never by more than grbl allows. `G80`
//! may be in a block with G0 to G3. `G41 D0` is the tool in the spindle (LinuxCNC). G61, G64 and
//! G97 are accepted and have no effect, because a driver plans its own path.
//! M48, M49 and M100 to M199 go to the machine unchanged.

mod block;
mod bounds;
mod dialect;
mod expression;
mod findings;
mod flow;
mod interpreter;
mod lexer;
mod line;
mod number;
mod parameters;
mod rules;
mod values;

pub mod canonical;
pub mod limits;
#[cfg(feature = "node")]
pub mod node;
pub mod render;
pub mod subroutines;
pub mod upload;

pub use bounds::Bounds;

use block::Block;
use cnc_msgs::contour::{Action, ContourEventKind, ProgrammedContour, Source};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::Position;
use cnc_msgs::profile::Profile;
use findings::Findings;
use flow::{Cursor, Flow, FlowMap, Next, World};
use interpreter::{After, Interpreter, code_in_tenths};
use limits::FlowLimits;
use line::Line;
use parameters::{CannotSet, Parameters};
use rules::Rules;
use std::collections::{BTreeMap, BTreeSet};
use values::Values;

/// How a program is loaded.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LoadOptions {
    /// Where the tool is before the first block, in the work frame, mm.
    pub start: Position,
    /// Whether blocks that begin with `/` are skipped.
    pub block_delete: bool,
    /// The text is one block of manual data input: exactly one block, and no program end.
    pub is_single_block: bool,
    /// How long subroutines and loops may take.
    pub flow: FlowLimits,
}

/// A program after reading.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Loaded {
    /// The contour; without events if any finding is an error.
    pub contour: ProgrammedContour,
    /// All findings in the order of the program.
    pub findings: Vec<Finding>,
    /// Number of lines of the text.
    pub line_count: u32,
    /// The box around all motion; `None` without motion or with an error.
    pub bounds: Option<Bounds>,
}

impl Loaded {
    /// Whether the program has no errors, so that the planner may have it.
    pub fn is_accepted(&self) -> bool {
        !self.findings.iter().any(Finding::is_error)
    }

    /// Rejects a program that selects any tool other than these. An empty list allows all; T0,
    /// no tool in the spindle, is always allowed.
    pub fn allow_tools(&mut self, expected: &[u32]) {
        if expected.is_empty() {
            return;
        }
        let allowed: BTreeSet<u32> = expected.iter().copied().chain([0]).collect();
        let mut others = BTreeMap::new();
        for event in &self.contour.events {
            if let ContourEventKind::Action(
                Action::SelectTool { tool } | Action::ChangeTool { tool },
            ) = event.kind
                && !allowed.contains(&tool)
            {
                others.entry(tool).or_insert(event.source);
            }
        }
        if others.is_empty() {
            return;
        }
        let mut others: Vec<_> = others.into_iter().collect();
        others.sort_by_key(|(_, source)| (source.line, source.column));
        let listed = listed(expected);
        let rest = others.split_off(others.len().min(limits::UNEXPECTED_TOOLS_MAX)).len();
        self.findings.extend(others.into_iter().map(|(tool, source)| {
            let message = format!("T{tool} is not one of the tools that are expected: {listed}");
            Finding::error(Code::UnknownTool, source, message).help(
                "load the program that belongs to this job, or add the tool to expected_tools",
            )
        }));
        // Findings without a place stay at the end.
        let place = |found: &Finding| (found.source.line.wrapping_sub(1), found.source.column);
        self.findings.sort_by_key(place);
        if rest > 0 {
            let message = format!("{rest} more tools are not expected");
            self.findings.push(Finding::error(Code::Limit, Source::default(), message));
        }
        self.contour.events = Vec::new();
        self.bounds = None;
    }
}

/// `T1, T2`, and how many more.
fn listed(tools: &[u32]) -> String {
    let shown: Vec<_> =
        tools.iter().take(limits::UNEXPECTED_TOOLS_MAX).map(|tool| format!("T{tool}")).collect();
    match tools.len() - shown.len() {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}

/// Reads a part program in the dialect of a control.
///
/// Never fails: errors are in the findings. The text should be UTF-8 or ASCII; other bytes are
/// accepted in comments only. Time and memory are linear in the length of the text.
pub fn load(text: &[u8], profile: &Profile, options: &LoadOptions) -> Loaded {
    let (rules, wrong_words) = Rules::of(profile);
    let mut findings = Findings::default();
    for wrong in wrong_words {
        findings.begin_block();
        findings.push(wrong);
    }
    let text = text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text);
    // 0x1A: DOS ended texts with it.
    let text = text.strip_suffix(b"\x1A").unwrap_or(text);
    let text = if options.is_single_block { text.trim_ascii_end() } else { text };
    let line_feeds = memchr::memchr_iter(b'\n', text).count();
    let lines = line_feeds + usize::from(text.last().is_some_and(|&last| last != b'\n'));
    let line_count = u32::try_from(lines).unwrap_or(u32::MAX);

    if let Some(refusal) = refuse_whole(text, line_count) {
        findings.push(refusal);
        let contour = ProgrammedContour { start: options.start, ..ProgrammedContour::default() };
        return Loaded { contour, findings: findings.finish(), line_count, bounds: None };
    }
    let flow = match rules.dialect.lexer.parameters && !options.is_single_block {
        true => FlowMap::of(text, options.block_delete, &mut findings),
        false => FlowMap::default(),
    };
    if findings.has_error() {
        let contour = ProgrammedContour { start: options.start, ..ProgrammedContour::default() };
        return Loaded { contour, findings: findings.finish(), line_count, bounds: None };
    }
    let interpreter = Interpreter::new(&rules, options.start, lines.min(text.len() / 4));
    let mut reader = Reader {
        rules: &rules,
        options,
        interpreter,
        findings,
        block: Block::default(),
        section: Section::Before,
        parameters: Parameters::default(),
        flow: (!flow.entries.is_empty()).then(|| Flow::new(text, flow, options.flow)),
    };
    reader.read(text);
    let findings = reader.findings.finish();
    let (mut contour, mut bounds) = reader.interpreter.finish();
    if findings.iter().any(Finding::is_error) {
        contour.events = Vec::new();
        bounds = None;
    }
    Loaded { contour, findings, line_count, bounds }
}

/// Checks for which a program is rejected before its lines are read.
fn refuse_whole(text: &[u8], line_count: u32) -> Option<Finding> {
    let nowhere = Source::default();
    if text.len() > limits::PROGRAM_BYTES_MAX {
        let message = format!(
            "the program has {} bytes; at most {} are accepted",
            text.len(),
            limits::PROGRAM_BYTES_MAX
        );
        return Some(Finding::error(Code::Limit, nowhere, message).help("split the program"));
    }
    if line_count > limits::LINES_MAX {
        let message = format!(
            "the program has {line_count} lines; at most {} are accepted",
            limits::LINES_MAX
        );
        return Some(Finding::error(Code::Limit, nowhere, message).help("split the program"));
    }
    if text.starts_with(b"\xFF\xFE") || text.starts_with(b"\xFE\xFF") {
        let message = "the program is UTF-16 text";
        let help = "save it as plain text (ASCII or UTF-8)";
        return Some(Finding::error(Code::Syntax, nowhere, message).help(help));
    }
    None
}

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

struct Reader<'r> {
    rules: &'r Rules<'r>,
    options: &'r LoadOptions,
    interpreter: Interpreter<'r>,
    findings: Findings,
    block: Block,
    section: Section,
    parameters: Parameters,
    /// Nothing where the program has no O words.
    flow: Option<Flow<'r>>,
}

/// How a line ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outcome {
    Line,
    Jump(Cursor),
    Stop,
}

impl Reader<'_> {
    fn read(&mut self, text: &[u8]) {
        let mut cursor = Cursor { offset: 0, line: 1 };
        let mut has_blocks = false;
        let mut last_line = 0;
        'jump: loop {
            let from = cursor.offset;
            let ends = memchr::memchr_iter(b'\n', &text[from..]).map(|end| from + end);
            for end in ends.chain(std::iter::once(text.len())) {
                last_line = cursor.line;
                let whole = &text[cursor.offset.min(end)..end];
                let line =
                    Line { number: cursor.line, text: whole.strip_suffix(b"\r").unwrap_or(whole) };
                match self.line(line, cursor, &mut has_blocks) {
                    Outcome::Line => {}
                    Outcome::Jump(to) => {
                        cursor = to;
                        continue 'jump;
                    }
                    Outcome::Stop => break 'jump,
                }
                cursor = Cursor { offset: end + 1, line: cursor.line + 1 };
            }
            break;
        }
        self.findings.begin_block();
        if self.block.is_binary {
            return;
        }
        if self.options.is_single_block {
            return self.refuse_unless_single(last_line, has_blocks);
        }
        self.check_end(text, last_line, has_blocks);
    }

    /// Reads and executes one line.
    #[inline]
    fn line(&mut self, line: Line<'_>, at: Cursor, has_blocks: &mut bool) -> Outcome {
        self.findings.begin_block();
        if line.text.len() > limits::LINE_BYTES_MAX {
            self.too_long(line);
            *has_blocks = true;
            return Outcome::Line;
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
            return self.line_in_flow(line, at, has_blocks);
        }
        match self.block(line, has_blocks) {
            After::Block => Outcome::Line,
            After::End if self.block.is_binary => Outcome::Stop,
            After::End => {
                self.section = Section::After { end_line: line.number, is_reported: false };
                Outcome::Line
            }
            after => self.no_program(line, after),
        }
    }

    /// Reads and executes one block.
    #[inline]
    fn block(&mut self, line: Line<'_>, has_blocks: &mut bool) -> After {
        let values = Values {
            parameters: &self.parameters,
            interpreter: &self.interpreter,
            line: line.number,
            is_single_block: self.options.is_single_block,
        };
        let rules = &self.rules.dialect.lexer;
        lexer::read(line, rules, &mut self.block, &mut self.findings, &values);
        if self.block.is_binary {
            return After::End;
        }
        if !self.block.assignments.is_empty() {
            *has_blocks = true;
            self.section = Section::Within;
            self.assign(line);
        }
        if self.block.words.is_empty() && !self.block.is_damaged {
            return After::Block;
        }
        *has_blocks = true;
        self.section = Section::Within;
        if self.options.is_single_block {
            self.refuse_lasting(line);
        }
        self.interpreter.execute(line, &self.block, &mut self.findings)
    }

    /// Reports what acts on later blocks only, in a block by hand.
    #[cold]
    fn refuse_lasting(&mut self, line: Line<'_>) {
        if !self.rules.dialect.lexer.parameters {
            return;
        }
        for word in &self.block.words {
            let lasts = match (word.letter, code_in_tenths(word.value)) {
                (b'G', Some(tenths)) => matches!(tenths, 520 | 920..=923),
                (b'M', Some(tenths)) => matches!(tenths, 700 | 710 | 720 | 730 | 980 | 990),
                _ => false,
            };
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
    fn line_in_flow(&mut self, line: Line<'_>, at: Cursor, has_blocks: &mut bool) -> Outcome {
        let first_finding = self.findings.count();
        let next = self.step(line, at, has_blocks);
        if self.findings.count() > first_finding
            && let Some(flow) = &mut self.flow
        {
            flow.place(&mut self.findings, first_finding);
        }
        match next {
            Next::Line | Next::Block => Outcome::Line,
            Next::Jump(to) => {
                let depth = self.flow.as_ref().map_or(0, Flow::depth);
                let source = line.source(None, 0, line.text.trim_ascii_end().len());
                self.interpreter.set_depth(depth, source, &mut self.findings);
                Outcome::Jump(to)
            }
            Next::Stop => {
                // It has been reported why; what follows was never to be reached.
                self.section = Section::After { end_line: line.number, is_reported: true };
                Outcome::Stop
            }
        }
    }

    fn step(&mut self, line: Line<'_>, at: Cursor, has_blocks: &mut bool) -> Next {
        let Some(flow) = &mut self.flow else { return Next::Line };
        let events = self.interpreter.event_count();
        if !flow.count(line, events, &mut self.findings) {
            return Next::Stop;
        }
        let mut world = World {
            parameters: &mut self.parameters,
            interpreter: &self.interpreter,
            findings: &mut self.findings,
        };
        match flow.step(line, at.offset, &mut world) {
            Next::Block => {}
            next => {
                *has_blocks = true;
                if self.section == Section::Before {
                    self.section = Section::Within;
                }
                return next;
            }
        }
        let after = self.block(line, has_blocks);
        let Some(flow) = &mut self.flow else { return Next::Line };
        match after {
            After::Block => Next::Line,
            After::End => {
                self.section = Section::After {
                    end_line: line.number,
                    is_reported: flow.has_programs() || self.block.is_binary,
                };
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
        for assignment in std::mem::take(&mut self.block.assignments) {
            if self.options.is_single_block {
                let source = line.source(self.block.number, assignment.start, assignment.end);
                let message = "a block by hand keeps no parameter for the next one";
                let help = "set parameters in a program";
                self.findings.push(Finding::error(Code::Unsupported, source, message).help(help));
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
    }

    /// M98 or M99 in a program without program numbers.
    #[cold]
    fn no_program(&mut self, line: Line<'_>, after: After) -> Outcome {
        if after == After::EndOfProgram {
            self.refuse_endless(line, None);
        } else {
            let message = "M98 calls a program that the text does not have";
            let source = line.source(self.block.number, self.block.start, self.block.end);
            self.findings.push(
                Finding::error(Code::Syntax, source, message)
                    .help("write the program after the end of the main program: O100 ... M99"),
            );
        }
        self.section = Section::After { end_line: line.number, is_reported: true };
        Outcome::Stop
    }

    /// M99 in the main program: LinuxCNC would begin it again without an end.
    #[cold]
    fn refuse_endless(&mut self, line: Line<'_>, running: Option<String>) {
        let (message, help) = match running {
            None => (
                "M99 in the main program begins it again, without an end".to_owned(),
                "end the program with M2 or M30, and run it again",
            ),
            Some(running) => {
                (format!("M99 does not end {running}"), "end a subroutine with endsub or return")
            }
        };
        let source = line.source(self.block.number, self.block.start, self.block.end);
        self.findings.push(Finding::error(Code::Unsupported, source, message).help(help));
    }

    /// Reports a program without blocks, or without an end.
    fn check_end(&mut self, text: &[u8], last_line: u32, has_blocks: bool) {
        if let Some(running) = self.flow.as_ref().and_then(Flow::running)
            && !matches!(self.section, Section::After { .. })
        {
            let line = last_line - u32::from(text.last() == Some(&b'\n'));
            let source = Source { line, column: 1, ..Source::default() };
            let message = format!("the text ends within {running}");
            let help = "end a program that M98 calls with M99";
            return self.findings.push(Finding::error(Code::Syntax, source, message).help(help));
        }
        if !has_blocks {
            let message = "the program has no blocks";
            self.findings.push(
                Finding::warning(Code::MissingWord, Source::default(), message)
                    .help("nothing will move; is it the right file?"),
            );
        } else if !matches!(self.section, Section::After { .. }) {
            let is_empty_line = text.last() == Some(&b'\n');
            let line = last_line - u32::from(is_empty_line);
            let source = Source { line, column: 1, ..Source::default() };
            let message = "the program has no end";
            self.findings.push(
                Finding::warning(Code::MissingWord, source, message)
                    .help("is the file complete? programs end with M2 or M30"),
            );
        }
    }

    /// Checks that the text is one block.
    #[cold]
    fn refuse_unless_single(&mut self, lines: u32, has_blocks: bool) {
        let source = Source { line: lines, column: 1, ..Source::default() };
        let message = match (lines, has_blocks) {
            (1, true) => return,
            (1, false) => "there is no block to run".to_owned(),
            (lines, _) => format!("{lines} lines are not a single block"),
        };
        let help = "give one block, without a line end; load a longer text as a program";
        self.findings.push(Finding::error(Code::Syntax, source, message).help(help));
    }

    /// Reads a line that begins with `%`: a tape mark, the name of a program, or the name of an OSP
    /// file.
    #[inline]
    fn percent(&mut self, line: Line<'_>) -> bool {
        let visible = line.text.trim_ascii_start();
        let is_first = self.section == Section::Before;
        if is_first && self.rules.dialect.lexer.names && visible.first() == Some(&b'$') {
            return true;
        }
        if visible.first() != Some(&b'%') {
            return false;
        }
        if !self.rules.dialect.percent_delimits {
            // The name of the program; the name of another program ends this one.
            if !is_first && self.section == Section::Within {
                self.section = Section::After { end_line: line.number, is_reported: false };
            }
            return true;
        }
        let rest = visible[1..].trim_ascii();
        if !rest.is_empty() && !matches!(rest[0], b'(' | b';') {
            let start = line.text.len() - visible.len();
            let source = line.source(None, start, start + visible.trim_ascii_end().len());
            let message = "% must be alone in its line";
            self.findings.push(
                Finding::error(Code::Syntax, source, message)
                    .help("delete what follows it, or put it into a comment ( )"),
            );
        }
        self.section = match self.section {
            Section::Before => Section::Within,
            Section::Within => Section::After {
                end_line: line.number,
                is_reported: self.flow.as_ref().is_some_and(Flow::has_programs),
            },
            after @ Section::After { .. } => after,
        };
        true
    }

    #[inline]
    fn is_deleted(&self, line: Line<'_>) -> bool {
        self.options.block_delete && line.text.trim_ascii_start().first() == Some(&b'/')
    }

    /// Reports once that blocks after the end are not run; returns whether it has been reported.
    #[cold]
    fn is_reported_after_end(&mut self, line: Line<'_>) -> bool {
        let Section::After { end_line, is_reported } = self.section else { return false };
        let visible = line.text.trim_ascii();
        let is_remark = visible.is_empty() || matches!(visible[0], b'(' | b';');
        if !is_remark && !is_reported {
            let start = line.text.len() - line.text.trim_ascii_start().len();
            let source = line.source(None, start, start + visible.len());
            let message = format!("this is after the end of the program in line {end_line}");
            self.findings.push(
                Finding::warning(Code::Syntax, source, message)
                    .help("it is not run; delete it, or delete the end before it"),
            );
            self.section = Section::After { end_line, is_reported: true };
        }
        matches!(self.section, Section::After { is_reported: true, .. })
    }

    #[cold]
    fn too_long(&mut self, line: Line<'_>) {
        let message = format!(
            "the line has {} bytes; at most {} are accepted",
            line.text.len(),
            limits::LINE_BYTES_MAX
        );
        let source = line.source(None, 0, limits::LINE_BYTES_MAX);
        self.findings
            .push(Finding::error(Code::Limit, source, message).help("write one block a line"));
        self.interpreter.lose_line();
        if self.section == Section::Before {
            self.section = Section::Within;
        }
    }
}
