//! Which line comes next: subroutines, loops, conditions, M98 and M99.
//!
//! Knows places in the text and what is running; blocks and their words are the lexer's and the
//! interpreter's. A program without O words never comes here.

mod map;
mod programs;
mod running;
mod scene;
mod statement;

use crate::block::Programs;
use crate::findings::Findings;
use crate::limits::FlowLimits;
use crate::line::Line;
use crate::parameters::ARGUMENTS;
use crate::subroutines::{file_starts, is_file_name, unread_file};
use cnc_msgs::calls::Calls;
use cnc_msgs::finding::{Code, Finding};
use map::line_at;
pub(crate) use map::shown;
pub(crate) use map::{Cursor, FlowMap};
pub(crate) use programs::no_program;
use running::{Call, Frame, Loop};
pub(crate) use scene::World;
use scene::{Scene, Stopped};
use statement::Keyword;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

/// How many bytes of lines take as long to read as a byte of a message takes to write.
const MESSAGE_WEIGHT: u64 = 3;
/// Lines between two looks at the clock.
const TIMED_LINES: u64 = 64;

/// What comes after a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Next {
    /// The line after it.
    Line,
    /// The rest of this line is a block.
    Block,
    Jump(Cursor),
    /// Nothing: an error has been reported.
    Stop,
}

/// Where the program is among its subroutines and loops.
#[derive(Debug)]
pub(crate) struct Flow<'t> {
    text: &'t [u8],
    map: FlowMap,
    /// How programs are called by their number, where that is no O word.
    programs: Option<&'static Programs>,
    limits: FlowLimits,
    /// Lines of the text: a program that executes no more has no loops.
    lines: u64,
    /// The end of the time, on the clock of the limits.
    until: Option<Duration>,
    /// The main program, then each subroutine that is running.
    frames: Vec<Frame>,
    executed: u64,
    executed_bytes: u64,
    /// What is running now, and what has been.
    calls: Calls,
    /// By the statement that a subroutine begins with.
    names: BTreeMap<usize, Arc<str>>,
    /// The program that M98 has jumped to.
    entering: Option<usize>,
    reported: BTreeSet<(u32, u16, Code, bool)>,
}

impl<'t> Flow<'t> {
    pub(crate) fn new(
        text: &'t [u8],
        map: FlowMap,
        programs: Option<&'static Programs>,
        limits: FlowLimits,
    ) -> Self {
        let lines = memchr::memchr_iter(b'\n', text).count() as u64;
        Self {
            text,
            map,
            programs,
            limits: FlowLimits {
                // A long program that ends has executed each of its lines.
                blocks_max: limits.blocks_max.saturating_add(lines),
                bytes_max: limits.bytes_max.saturating_add(text.len() as u64),
                depth_max: programs.map_or(usize::MAX, |it| it.depth_max).min(limits.depth_max),
                ..limits
            },
            lines,
            until: limits.time.map(|limit| (limit.clock)().saturating_add(limit.most)),
            frames: vec![Frame::default()],
            executed: 0,
            executed_bytes: 0,
            calls: Calls::default(),
            names: BTreeMap::new(),
            entering: None,
            reported: BTreeSet::new(),
        }
    }

    /// Subroutines that are running.
    pub(crate) fn depth(&self) -> usize {
        self.frames.len() - 1
    }

    /// Whether a program or a subroutine begins in this line.
    pub(crate) fn begins_at(&self, line: u32) -> bool {
        let entries = &self.map.entries;
        let found = entries.binary_search_by_key(&line, |entry| entry.at.line);
        found.is_ok_and(|at| matches!(entries[at].keyword, Keyword::Number | Keyword::Sub))
    }

    /// Counts a line; returns whether it may be executed. The `work` so far counts as well: a cycle
    /// makes many moves of one line.
    pub(crate) fn count(&mut self, line: Line<'_>, work: u64, findings: &mut Findings) -> bool {
        self.executed += 1;
        self.executed_bytes += line.text.len() as u64;
        let FlowLimits { blocks_max, bytes_max, .. } = self.limits;
        let message = match () {
            () if self.executed.max(work) > blocks_max => {
                format!("more than {blocks_max} blocks have been executed")
            }
            () if self.executed_bytes > bytes_max => {
                format!("more than {bytes_max} bytes of blocks have been executed")
            }
            () if self.executed > self.lines
                && self.executed.is_multiple_of(TIMED_LINES)
                && self.is_late() =>
            {
                let most = self.limits.time.map_or(0.0, |limit| limit.most.as_secs_f64());
                format!(
                    "its loops and subroutines have been executed for more than {most} s, and {} blocks",
                    self.executed
                )
            }
            () => return true,
        };
        let finding = Finding::error(Code::Limit, line.source(None, 0, usize::MAX), message);
        findings
            .push(finding.help("does this loop ever end? split a program that is really so long"));
        false
    }

    /// Counts the text of a message: numbers in it may be long, and take longer to write than lines to read.
    pub(crate) fn count_text(&mut self, bytes: usize) {
        self.executed_bytes += MESSAGE_WEIGHT * bytes as u64;
    }

    fn is_late(&self) -> bool {
        self.limits.time.zip(self.until).is_some_and(|(limit, until)| (limit.clock)() > until)
    }

    /// Drops findings from this index on that were reported in an earlier pass or call.
    pub(crate) fn drop_repeated(&mut self, findings: &mut Findings, from: usize) {
        findings.revise(from, |finding| {
            let source = finding.source;
            // A warning does not hide an error at the same place.
            let place = (source.line, source.column, finding.code, finding.is_error());
            self.reported.insert(place)
        });
    }

    /// The row of the innermost call or pass that is running; 0 in the main program.
    pub(crate) fn row(&self) -> u32 {
        self.frames.last().map_or(0, Frame::row)
    }

    /// The calls and passes that lines were run in.
    pub(crate) fn into_calls(self) -> Calls {
        self.calls
    }

    /// Begins a call in this line. `letter` is how programs write what is called.
    fn begin_call(&mut self, letter: char, entry: usize, line: u32) -> u32 {
        let around = self.row();
        let name = &self.map.entries[entry].name;
        let name = self.names.entry(entry).or_insert_with(|| running::name(letter, name));
        self.calls.push(around, Some(name.clone()), line, 1)
    }

    /// Executes the O word of a line, if it has one.
    pub(crate) fn step(
        &mut self,
        line: Line<'_>,
        offset: usize,
        world: &mut World<'_, '_>,
    ) -> Next {
        let Some(index) = self.map.find(offset) else { return Next::Block };
        if let Some(programs) = self.programs {
            return self.at_number(index, programs, line, world);
        }
        // All were read when the text was searched for them.
        let Some(Ok(statement)) = statement::read(line.text) else { return Next::Stop };
        match self.execute(index, &mut Scene { line, statement, world }) {
            Ok(next) => next,
            Err(Stopped) => Next::Stop,
        }
    }

    fn execute(&mut self, index: usize, scene: &mut Scene<'_, '_, '_>) -> Result<Next, Stopped> {
        let entry = &self.map.entries[index];
        let (at, partner, keyword) = (entry.at, entry.partner, entry.keyword);
        match keyword {
            Keyword::Number => {
                if self.entering.take() == Some(index) {
                    return Ok(Next::Block);
                }
                if scene.world.interpreter.has_begun() {
                    let name = &entry.name;
                    let message =
                        format!("program O{name} begins before the end of the one before it");
                    let help =
                        "end the program before it with M2, M30 or M99, or delete the number";
                    return Err(scene.refuse(Code::Syntax, message, help));
                }
                return Ok(Next::Block);
            }
            Keyword::Sub | Keyword::Else | Keyword::ElseIf => {
                // A definition is skipped; a branch before this one has been executed.
                return Ok(Next::Jump(self.after_branches(index)));
            }
            Keyword::If => return self.condition(index, scene),
            Keyword::EndIf => {}
            Keyword::While => {
                let is_running = self.top().is_some_and(|running| running.entry == index);
                let holds = scene.truth()?;
                if !holds {
                    if is_running {
                        self.loops().pop();
                    }
                    return Ok(Next::Jump(self.map.entries[partner].next));
                }
                self.next_pass(index);
            }
            Keyword::EndWhile => return Ok(Next::Jump(self.map.entries[partner].at)),
            Keyword::Do => self.next_pass(index),
            Keyword::DoWhile => {
                let holds = scene.truth()?;
                if holds {
                    return Ok(Next::Jump(self.map.entries[partner].at));
                }
                self.loops().pop();
            }
            Keyword::Repeat => {
                let passes = scene.value()?.round_ties_even();
                if passes < 1.0 {
                    return Ok(Next::Jump(self.map.entries[partner].next));
                }
                self.begin_pass(index, passes as u64 - 1);
            }
            Keyword::EndRepeat => {
                let begin = self.map.entries[partner].next;
                if let Some(running) = self.frames.last_mut().and_then(|it| it.loops.last_mut())
                    && running.rest > 0
                {
                    running.rest -= 1;
                    running.next_pass(&mut self.calls);
                    return Ok(Next::Jump(begin));
                }
                self.loops().pop();
            }
            Keyword::Break => {
                self.unwind(partner);
                self.loops().pop();
                let end = self.map.entries[partner].partner;
                return Ok(Next::Jump(self.map.entries[end].next));
            }
            Keyword::Continue => {
                self.unwind(partner);
                let begin = &self.map.entries[partner];
                let to = match begin.keyword {
                    Keyword::While => begin.at,
                    _ => self.map.entries[begin.partner].at,
                };
                return Ok(Next::Jump(to));
            }
            Keyword::Call => return self.call(at, scene),
            Keyword::EndSub | Keyword::Return => {
                return self.end_of_sub(scene);
            }
        }
        scene.nothing_follows().map(|()| Next::Line)
    }

    /// The end of a chain of branches that begins or goes on here, or of a definition.
    fn after_branches(&self, index: usize) -> Cursor {
        let mut at = index;
        loop {
            let entry = &self.map.entries[at];
            match entry.keyword {
                Keyword::If | Keyword::ElseIf | Keyword::Else | Keyword::Sub => at = entry.partner,
                _ => return entry.next,
            }
        }
    }

    /// `if`, and its `elseif`s until one holds.
    fn condition(&mut self, index: usize, scene: &mut Scene<'_, '_, '_>) -> Result<Next, Stopped> {
        if scene.truth()? {
            return Ok(Next::Line);
        }
        let mut at = self.map.entries[index].partner;
        loop {
            let entry = &self.map.entries[at];
            let (next, partner, place) = (entry.next, entry.partner, entry.at);
            if entry.keyword != Keyword::ElseIf {
                return Ok(Next::Jump(next));
            }
            let line = Line { call: scene.line.call, ..line_at(self.text, place) };
            if !self.count(line, 0, scene.world.findings) {
                return Err(Stopped);
            }
            let Some(Ok(statement)) = statement::read(line.text) else { return Err(Stopped) };
            let mut branch = Scene { line, statement, world: &mut *scene.world };
            if branch.truth()? {
                return Ok(Next::Jump(next));
            }
            at = partner;
        }
    }

    /// What is wrong with a call of a subroutine that there is not, and what to do.
    fn no_subroutine(&self, name: &str) -> (String, String) {
        if let Some(unread) = unread_file(self.text, name) {
            return unread;
        }
        let what = shown(name);
        let here = format!("write o{what} sub ... o{what} endsub into the program");
        if file_starts(self.text).iter().any(|(_, file, _)| file == name) {
            let message = format!("{name}.ngc defines no subroutine O{what}");
            return (message, format!("begin it with o{what} sub, and end it with o{what} endsub"));
        }
        let help = match is_file_name(name) {
            true => {
                format!("{here}, or put {name}.ngc into a folder of subroutines (--subroutines)")
            }
            false => format!("{here}; a name with a file has small letters, digits, _ and - alone"),
        };
        (format!("there is no subroutine O{what}"), help)
    }

    fn call(&mut self, at: Cursor, scene: &mut Scene<'_, '_, '_>) -> Result<Next, Stopped> {
        let name = scene.name()?;
        let arguments = scene.arguments()?;
        if arguments.len() > ARGUMENTS {
            let message = format!("{} arguments; a subroutine has {ARGUMENTS}", arguments.len());
            let help = "set parameters from #31 on before the call";
            return Err(scene.refuse(Code::Limit, message, help));
        }
        let Some(&entry) = self.map.subs.get(&name) else {
            let what = shown(&name);
            let (message, help) = match self.map.programs.get(&name) {
                Some(&program) => (
                    format!(
                        "O{what} in line {} is a program, not a subroutine",
                        self.map.entries[program].at.line
                    ),
                    format!("call it with M98 P{name}, or begin it with o{what} sub"),
                ),
                None => self.no_subroutine(&name),
            };
            return Err(scene.refuse(Code::Syntax, message, &help));
        };
        let Scene { line, statement, world } = scene;
        self.enter(*line, statement.start, statement.end, world.findings)?;
        Ok(self.begin_sub(entry, at, line.number, &arguments, world))
    }

    /// Goes to where a subroutine begins, from the line of its call.
    fn begin_sub(
        &mut self,
        entry: usize,
        at: Cursor,
        line: u32,
        arguments: &[f64],
        world: &mut World<'_, '_>,
    ) -> Next {
        let saved = Some(Box::new(world.parameters.enter(arguments)));
        world.parameters.set_returned(None);
        let return_to = next_line(self.text, at);
        let row = self.begin_call('o', entry, line);
        let call = Call { entry, return_to, line, row, saved, repeats: 0, pass: 1 };
        self.frames.push(Frame { loops: Vec::new(), call: Some(call) });
        Next::Jump(self.map.entries[entry].next)
    }

    /// Calls the subroutine with the profile of the lathe cycle in this line.
    pub(crate) fn call_profile(
        &mut self,
        at: Cursor,
        line: Line<'_>,
        number: u32,
        world: &mut World<'_, '_>,
    ) -> Next {
        let Some(&entry) = self.map.subs.get(number.to_string().as_str()) else {
            world.findings.push(no_profile(line, number));
            return Next::Stop;
        };
        match self.enter(line, 0, usize::MAX, world.findings) {
            Ok(()) => self.begin_sub(entry, at, line.number, &[], world),
            Err(Stopped) => Next::Stop,
        }
    }

    /// Checks that there may be one subroutine more.
    fn enter(
        &mut self,
        line: Line<'_>,
        start: usize,
        end: usize,
        findings: &mut Findings,
    ) -> Result<(), Stopped> {
        if self.depth() < self.limits.depth_max {
            return Ok(());
        }
        let message = format!("more than {} subroutines inside each other", self.limits.depth_max);
        let help = "does this subroutine call itself without end?";
        let source = line.source(None, start, end);
        findings.push(Finding::error(Code::Limit, source, message).help(help));
        Err(Stopped)
    }

    fn end_of_sub(&mut self, scene: &mut Scene<'_, '_, '_>) -> Result<Next, Stopped> {
        let returned = scene.optional_value()?;
        let call = self.frames.last_mut().and_then(|frame| frame.call.as_mut());
        let left = call.and_then(|call| Some((call.return_to, call.saved.take()?)));
        let Some((return_to, saved)) = left else {
            let word = scene.statement.keyword.word();
            let message = format!("{word} ends a subroutine, and none has been called with call");
            let help = "a program that M98 calls ends with M99";
            return Err(scene.refuse(Code::Syntax, message, help));
        };
        self.frames.pop();
        scene.world.parameters.leave(&saved);
        scene.world.parameters.set_returned(returned);
        Ok(Next::Jump(return_to))
    }

    /// The loops that are running in this subroutine.
    fn loops(&mut self) -> &mut Vec<Loop> {
        &mut self.frames.last_mut().expect("the main program is never left").loops
    }

    fn top(&self) -> Option<&Loop> {
        self.frames.last()?.loops.last()
    }

    /// Begins the first or the next pass of a loop.
    fn next_pass(&mut self, entry: usize) {
        let running = self.frames.last_mut().and_then(|frame| frame.loops.last_mut());
        match running.filter(|running| running.entry == entry) {
            Some(running) => running.next_pass(&mut self.calls),
            None => self.begin_pass(entry, 0),
        }
    }

    /// Begins the first pass of a loop.
    fn begin_pass(&mut self, entry: usize, rest: u64) {
        let row = self.calls.push(self.row(), None, self.map.entries[entry].at.line, 1);
        self.loops().push(Loop { entry, pass: 1, row, rest });
    }

    /// Leaves the loops inside this one.
    fn unwind(&mut self, entry: usize) {
        while self.loops().last().is_some_and(|running| running.entry != entry) {
            self.loops().pop();
        }
    }
}

/// That the program lacks the subroutine with a profile.
pub(crate) fn no_profile(line: Line<'_>, number: u32) -> Finding {
    let message = format!("there is no subroutine O{number}");
    let help = format!("write o{number} sub ... o{number} endsub into the program");
    Finding::error(Code::Syntax, line.source(None, 0, usize::MAX), message).help(help)
}

/// The line after the one that begins here.
fn next_line(text: &[u8], at: Cursor) -> Cursor {
    let length = memchr::memchr(b'\n', &text[at.offset..]);
    Cursor { offset: length.map_or(text.len(), |length| at.offset + length + 1), line: at.line + 1 }
}
