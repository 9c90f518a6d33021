//! Programs that are called by their number: M98 and M99, L words and M17.
//!
//! Knows where they begin and which are running; the interpreter reads the words that call them.

use super::map::{Cursor, Entry, FlowMap, shown};
use super::running::{self, Call, Frame};
use super::statement::Keyword;
use super::{Flow, Next, World, next_line};
use crate::block::Programs;
use crate::findings::Findings;
use crate::limits::NUMBER_DIGITS;
use crate::line::Line;
use crate::subroutines::{file_starts, unread_file};
use cnc_msgs::finding::{Code, Finding};
use std::collections::BTreeSet;

impl FlowMap {
    /// Whether the number of any program begins a line of a text.
    pub(crate) fn has_program(text: &[u8], programs: &Programs) -> bool {
        numbers(text, programs).next().is_some()
    }

    /// Finds all programs of a text in a language without O words, and those in files that follow it.
    ///
    /// The number of the main program is not among them: nothing but comments stands before it.
    pub(crate) fn of_programs(text: &[u8], programs: &Programs, findings: &mut Findings) -> Self {
        let mut map = Self::default();
        let mut seen = Cursor { offset: 0, line: 1 };
        // The number of the file that is being read, and where it ends.
        let mut file = (u32::MAX, 0);
        let mut twice = BTreeSet::new();
        for Beginning { offset, number, file_end } in beginnings(text, programs) {
            let lines = memchr::memchr_iter(b'\n', &text[seen.offset..offset]).count();
            let at = Cursor { offset, line: seen.line + lines as u32 };
            seen = at;
            if file_end.is_none()
                && offset < file.1
                && number == file.0
                && let Some(of_file) = map.entries.last_mut()
                && is_blank(&text[of_file.next.offset..offset])
            {
                // The program in the file says its number, too.
                let has_block = text[offset..].trim_ascii_start().first() != Some(&b'%');
                of_file.next = if has_block { at } else { next_line(text, at) };
                continue;
            }
            if let Some(end) = file_end {
                file = (number, end);
            }
            let name: Box<str> = number.to_string().into();
            if let Some(&first) = map.programs.get(&name) {
                if !twice.insert(number) {
                    continue;
                }
                let first = map.entries[first].at.line;
                let letter = programs.letter;
                let line = super::map::line_at(text, at);
                let message = format!("{letter}{number} is in line {first} already");
                let source = line.source(None, 0, usize::MAX);
                findings.begin_block();
                findings.push(
                    Finding::error(Code::Syntax, source, message)
                        .help("give each program a number of its own"),
                );
                continue;
            }
            map.programs.insert(name.clone(), map.entries.len());
            let next = match file_end {
                Some(_) => after_tape_marks(text, next_line(text, at)),
                None => next_line(text, at),
            };
            map.entries.push(Entry {
                at,
                next,
                keyword: Keyword::Number,
                name,
                partner: usize::MAX,
            });
        }
        map
    }
}

/// The first line from here on that is neither empty nor a `%` alone.
fn after_tape_marks(text: &[u8], mut at: Cursor) -> Cursor {
    while at.offset < text.len() {
        let next = next_line(text, at);
        let line = text[at.offset..next.offset].trim_ascii();
        if !line.is_empty() && line != b"%" {
            break;
        }
        at = next;
    }
    at
}

/// Where a program begins.
struct Beginning {
    /// Of its line.
    offset: usize,
    number: u32,
    /// Where its file ends, if it is one.
    file_end: Option<usize>,
}

/// In the order of the text, after the number of the main program.
fn beginnings(text: &[u8], programs: &Programs) -> Vec<Beginning> {
    let files = file_starts(text).into_iter().filter_map(|(offset, name, end)| {
        Some(Beginning { offset, number: name.parse().ok()?, file_end: Some(end) })
    });
    let mut found: Vec<Beginning> = files.chain(numbers(text, programs)).collect();
    found.sort_by_key(|beginning| beginning.offset);
    if found.first().is_some_and(|first| is_blank(&text[..first.offset])) {
        let first = found.remove(0);
        // It may say its number twice: `%O1001`, then `O1001`.
        let is_again = |next: &Beginning| {
            next.number == first.number && is_blank_after(&text[first.offset..next.offset])
        };
        if found.first().is_some_and(is_again) {
            found.remove(0);
        }
    }
    found
}

/// All numbers of programs at the beginning of a line.
fn numbers(text: &[u8], programs: &Programs) -> impl Iterator<Item = Beginning> {
    programs.begins.iter().flat_map(move |begins| {
        let first = begins.as_bytes()[0];
        memchr::memchr2_iter(first, first.to_ascii_lowercase(), text).filter_map(move |at| {
            let before = text[..at].trim_suffix_blanks();
            if before.last().is_some_and(|byte| *byte != b'\n') {
                return None;
            }
            let number = number_after(&text[at..], begins)?;
            Some(Beginning { offset: before.len(), number, file_end: None })
        })
    })
}

/// Whether nothing but comments follows the first line of a text.
fn is_blank_after(text: &[u8]) -> bool {
    memchr::memchr(b'\n', text).is_some_and(|end| is_blank(&text[end..]))
}

trait TrimBlanks {
    fn trim_suffix_blanks(&self) -> &Self;
}

impl TrimBlanks for [u8] {
    /// Without the blanks at its end.
    fn trim_suffix_blanks(&self) -> &Self {
        let blanks = self.iter().rev().take_while(|byte| matches!(byte, b' ' | b'\t')).count();
        &self[..self.len() - blanks]
    }
}

/// The number after `O` or `%SPF`.
fn number_after(text: &[u8], begins: &str) -> Option<u32> {
    let blanks_of =
        |text: &[u8]| text.iter().take_while(|byte| matches!(byte, b' ' | b'\t')).count();
    // `% O2`
    let (text, begins) = match begins.strip_prefix('%').zip(text.strip_prefix(b"%")) {
        Some((begins, text)) => (&text[blanks_of(text)..], begins),
        None => (text, begins),
    };
    let word = text.get(..begins.len())?;
    if !word.eq_ignore_ascii_case(begins.as_bytes()) {
        return None;
    }
    let rest = &text[begins.len()..];
    let blanks = blanks_of(rest);
    let digits = rest[blanks..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    if !(1..=NUMBER_DIGITS).contains(&digits) {
        return None;
    }
    std::str::from_utf8(&rest[blanks..blanks + digits]).ok()?.parse().ok()
}

/// What is wrong with M98 where neither the text nor a file has the program, and what to do.
pub(crate) fn no_program(number: u32) -> (String, String) {
    let help = format!(
        "write O{number} ... M99 after the end of the main program, or into {number}.ngc in a folder of subroutines \
         (--subroutines)"
    );
    (format!("there is no program O{number}"), help)
}

/// Whether a text has neither blocks nor O words: `%`, comments, empty lines.
fn is_blank(text: &[u8]) -> bool {
    text.split(|byte| *byte == b'\n')
        .all(|line| matches!(line.trim_ascii().first(), None | Some(b'%' | b'(' | b';')))
}

impl Flow<'_> {
    /// A line that a program begins with: it is called here, or the one before it has no end.
    pub(super) fn at_number(
        &mut self,
        index: usize,
        programs: &Programs,
        line: Line<'_>,
        world: &mut World<'_, '_>,
    ) -> Next {
        if self.entering.take() == Some(index) {
            return Next::Block;
        }
        let Programs { letter, end, .. } = programs;
        let name = &self.map.entries[index].name;
        let message = match self.running() {
            Some(running) => format!("program {letter}{name} begins before the end of {running}"),
            None => format!("program {letter}{name} begins before the end of the one before it"),
        };
        let source = line.source(None, 0, line.text.trim_ascii_end().len());
        let help =
            format!("end the program before it: the main program with M30, others with {end}");
        world.findings.push(Finding::error(Code::Syntax, source, message).help(help));
        Next::Stop
    }

    /// M98 or an L word: calls the program of this number, so many times. `at` is the place of the
    /// block.
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
            let unread = unread_file(self.text, &name);
            let (message, help) = match (self.programs, unread) {
                (_, Some(unread)) => unread,
                (Some(programs), None) => programs.missing(program),
                (None, None) if self.map.subs.contains_key(name.as_str()) => (
                    format!("O{program} is a subroutine, not a program"),
                    format!("call it with o{program} call"),
                ),
                (None, None) => no_program(program),
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
        let line = line.number;
        let row = self.begin_call(self.letter(), entry, line);
        let call = Call { entry, return_to, line, row, saved: None, repeats, pass: 1 };
        self.frames.push(Frame { loops: Vec::new(), call: Some(call) });
        self.begin_program(entry)
    }

    /// Goes to where a program begins.
    fn begin_program(&mut self, entry: usize) -> Next {
        let Entry { at, next, .. } = self.map.entries[entry];
        // A block may stand after `O100`. After `%` and in the line before a file is none.
        match self.text[at.offset..].trim_ascii_start().first() {
            Some(b'%' | b'(') => Next::Jump(next),
            _ => {
                self.entering = Some(entry);
                Next::Jump(at)
            }
        }
    }

    fn letter(&self) -> char {
        self.programs.map_or('O', |programs| programs.letter)
    }

    /// What is running, if it is not the main program: `O100, called in line 5`.
    pub(crate) fn running(&self) -> Option<String> {
        let call = self.frames.last()?.call.as_ref()?;
        let name = shown(&self.map.entries[call.entry].name);
        Some(format!("{}{name}, called in line {}", self.letter(), call.line))
    }

    /// The end of a program that has been called. `None` in the main program, which M99 would begin
    /// again, and in a subroutine.
    pub(crate) fn end_program(&mut self) -> Option<Next> {
        let frame = self.frames.last_mut()?;
        let call = frame.call.as_mut().filter(|call| call.saved.is_none())?;
        frame.loops.clear();
        if call.repeats > 0 {
            call.repeats -= 1;
            call.pass += 1;
            call.row = running::again(&mut self.calls, call.row, call.pass);
            let entry = call.entry;
            return Some(self.begin_program(entry));
        }
        let return_to = call.return_to;
        self.frames.pop();
        Some(Next::Jump(return_to))
    }
}
