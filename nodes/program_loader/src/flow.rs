//! Which line comes next: subroutines, loops, conditions, M98 and M99.
//!
//! Knows places in the text and what is running; blocks and their words are the lexer's and the
//! interpreter's. A program without O words never comes here.

mod map;
mod scene;
mod statement;

use crate::findings::Findings;
use crate::limits::FlowLimits;
use crate::line::Line;
use crate::parameters::ARGUMENTS;
use cnc_msgs::finding::{Code, Finding};
pub(crate) use map::{Cursor, FlowMap};
use map::{line_at, shown};
pub(crate) use scene::World;
use scene::{Scene, Stopped};
use statement::Keyword;
use std::collections::BTreeSet;
use std::fmt::Write;

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
    limits: FlowLimits,
    /// The main program, then each subroutine that is running.
    frames: Vec<Frame>,
    executed: u64,
    /// The program that M98 has jumped to.
    entering: Option<usize>,
    reported: BTreeSet<(u32, u16, Code, bool)>,
}

/// The main program or a subroutine.
#[derive(Debug, Default)]
struct Frame {
    loops: Vec<Loop>,
    /// Nothing for the main program.
    call: Option<Call>,
}

#[derive(Debug)]
struct Call {
    /// The statement that the subroutine begins with.
    entry: usize,
    return_to: Cursor,
    /// The line of the call.
    line: u32,
    /// Of a subroutine with arguments: `#1` to `#30` before it.
    saved: Option<Box<[f64; ARGUMENTS]>>,
    /// Calls after this one (M98 L), and which this one is.
    repeats: u32,
    pass: u32,
}

#[derive(Debug)]
struct Loop {
    /// The statement that the loop begins with.
    entry: usize,
    /// From 1.
    pass: u64,
    /// Of a `repeat`: passes after this one.
    rest: u64,
}

impl<'t> Flow<'t> {
    pub(crate) fn new(text: &'t [u8], map: FlowMap, limits: FlowLimits) -> Self {
        Self {
            text,
            map,
            limits,
            frames: vec![Frame::default()],
            executed: 0,
            entering: None,
            reported: BTreeSet::new(),
        }
    }

    /// Subroutines that are running.
    pub(crate) fn depth(&self) -> usize {
        self.frames.len() - 1
    }

    /// Whether programs of their own may follow the end of the main program.
    pub(crate) fn has_programs(&self) -> bool {
        !self.map.programs.is_empty() || !self.map.subs.is_empty()
    }

    /// Counts a line; returns whether it may be executed. `events` so far count as well: a cycle
    /// makes many of one line.
    pub(crate) fn count(&mut self, line: Line<'_>, events: usize, findings: &mut Findings) -> bool {
        self.executed += 1;
        if self.executed.max(events as u64) <= self.limits.blocks_max {
            return true;
        }
        let message = format!("more than {} blocks have been executed", self.limits.blocks_max);
        let finding = Finding::error(Code::Limit, line.source(None, 0, usize::MAX), message);
        findings
            .push(finding.help("does this loop ever end? split a program that is really so long"));
        false
    }

    /// Says of findings from this index on where in the flow they are; drops repeated ones.
    pub(crate) fn place(&mut self, findings: &mut Findings, from: usize) {
        let trace = self.trace();
        findings.revise(from, |finding| {
            let source = finding.source;
            // A warning does not hide an error at the same place.
            let place = (source.line, source.column, finding.code, finding.is_error());
            if !self.reported.insert(place) {
                return false;
            }
            finding.message += &trace;
            true
        });
    }

    /// ` (in O<pocket>, called in line 40, pass 3 of the loop in line 12)`; empty in the main program
    /// outside all loops.
    fn trace(&self) -> String {
        let mut parts = Vec::new();
        for frame in self.frames.iter().rev() {
            for running in frame.loops.iter().rev() {
                let line = self.map.entries[running.entry].at.line;
                parts.push(format!("pass {} of the loop in line {line}", running.pass));
            }
            if let Some(call) = &frame.call {
                let name = shown(&self.map.entries[call.entry].name);
                let mut part = format!("in O{name}, called in line {}", call.line);
                if call.pass > 1 {
                    let _ = write!(part, " for the {}. time", call.pass);
                }
                parts.push(part);
            }
        }
        const SHOWN: usize = 6;
        let more = parts.len().saturating_sub(SHOWN);
        parts.truncate(SHOWN);
        if more > 0 {
            parts.push(format!("and {more} more"));
        }
        if parts.is_empty() { String::new() } else { format!(" ({})", parts.join(", ")) }
    }

    /// Executes the O word of a line, if it has one.
    pub(crate) fn step(
        &mut self,
        line: Line<'_>,
        offset: usize,
        world: &mut World<'_, '_>,
    ) -> Next {
        let Some(index) = self.map.find(offset) else { return Next::Block };
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
                self.begin_pass(index);
            }
            Keyword::EndWhile => return Ok(Next::Jump(self.map.entries[partner].at)),
            Keyword::Do => self.begin_pass(index),
            Keyword::DoWhile => {
                let holds = scene.truth()?;
                if holds {
                    return Ok(Next::Jump(self.map.entries[partner].at));
                }
                self.loops().pop();
            }
            Keyword::Repeat => {
                let passes = scene.value()?.round();
                if passes < 1.0 {
                    return Ok(Next::Jump(self.map.entries[partner].next));
                }
                self.loops().push(Loop { entry: index, pass: 1, rest: passes as u64 - 1 });
            }
            Keyword::EndRepeat => {
                let begin = self.map.entries[partner].next;
                if let Some(running) = self.loops().last_mut()
                    && running.rest > 0
                {
                    running.rest -= 1;
                    running.pass += 1;
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
            self.executed += 1;
            let entry = &self.map.entries[at];
            let (next, partner, place) = (entry.next, entry.partner, entry.at);
            if entry.keyword != Keyword::ElseIf {
                return Ok(Next::Jump(next));
            }
            let line = line_at(self.text, place);
            let Some(Ok(statement)) = statement::read(line.text) else { return Err(Stopped) };
            let mut branch = Scene { line, statement, world: &mut *scene.world };
            if branch.truth()? {
                return Ok(Next::Jump(next));
            }
            at = partner;
        }
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
                None => (
                    format!("there is no subroutine O{what}"),
                    format!("write o{what} sub ... o{what} endsub into the program"),
                ),
            };
            return Err(scene.refuse(Code::Syntax, message, &help));
        };
        let Scene { line, statement, world } = scene;
        self.enter(*line, statement.start, statement.end, world.findings)?;
        let saved = Some(Box::new(world.parameters.enter(&arguments)));
        world.parameters.set_returned(None);
        let return_to = next_line(self.text, at);
        let call = Call { entry, return_to, line: line.number, saved, repeats: 0, pass: 1 };
        self.frames.push(Frame { loops: Vec::new(), call: Some(call) });
        Ok(Next::Jump(self.map.entries[entry].next))
    }

    /// M98: calls the program of this number, so many times. `at` is the place of the block.
    pub(crate) fn call_program(
        &mut self,
        at: Cursor,
        line: Line<'_>,
        program: u32,
        times: u32,
        world: &mut World<'_, '_>,
    ) -> Next {
        let name = program.to_string();
        let Some(&entry) = self.map.programs.get(name.as_str()) else {
            let (message, help) = match self.map.subs.contains_key(name.as_str()) {
                true => (
                    format!("O{program} is a subroutine, not a program"),
                    format!("call it with o{program} call"),
                ),
                false => (
                    format!("there is no program O{program}"),
                    format!("write O{program} ... M99 after the end of the main program"),
                ),
            };
            let source = line.source(None, 0, usize::MAX);
            world.findings.push(Finding::error(Code::Syntax, source, message).help(help));
            return Next::Stop;
        };
        if times == 0 {
            return Next::Line;
        }
        if self.enter(line, 0, usize::MAX, world.findings).is_err() {
            return Next::Stop;
        }
        let return_to = next_line(self.text, at);
        let repeats = times - 1;
        let call = Call { entry, return_to, line: line.number, saved: None, repeats, pass: 1 };
        self.frames.push(Frame { loops: Vec::new(), call: Some(call) });
        self.entering = Some(entry);
        Next::Jump(self.map.entries[entry].at)
    }

    /// What is running, if it is not the main program: `O100, called in line 5`.
    pub(crate) fn running(&self) -> Option<String> {
        let call = self.frames.last()?.call.as_ref()?;
        let name = shown(&self.map.entries[call.entry].name);
        Some(format!("O{name}, called in line {}", call.line))
    }

    /// M99: the end of a program that M98 called. `None` in the main program, which it would begin
    /// again, and in a subroutine.
    pub(crate) fn end_program(&mut self) -> Option<Next> {
        let frame = self.frames.last_mut()?;
        let call = frame.call.as_mut().filter(|call| call.saved.is_none())?;
        frame.loops.clear();
        if call.repeats > 0 {
            call.repeats -= 1;
            call.pass += 1;
            self.entering = Some(call.entry);
            return Some(Next::Jump(self.map.entries[call.entry].at));
        }
        let return_to = call.return_to;
        self.frames.pop();
        Some(Next::Jump(return_to))
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
    fn begin_pass(&mut self, entry: usize) {
        match self.loops().last_mut().filter(|running| running.entry == entry) {
            Some(running) => running.pass += 1,
            None => self.loops().push(Loop { entry, pass: 1, rest: 0 }),
        }
    }

    /// Leaves the loops inside this one.
    fn unwind(&mut self, entry: usize) {
        while self.loops().last().is_some_and(|running| running.entry != entry) {
            self.loops().pop();
        }
    }
}

/// The line after the one that begins here.
fn next_line(text: &[u8], at: Cursor) -> Cursor {
    let length = memchr::memchr(b'\n', &text[at.offset..]);
    Cursor { offset: length.map_or(text.len(), |length| at.offset + length + 1), line: at.line + 1 }
}
