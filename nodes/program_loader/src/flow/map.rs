//! All O words of a text, before it is run: which belong together, and where each subroutine is.
//!
//! Labels of loops and conditions belong to the subroutine that they stand in (LinuxCNC), so the
//! same number may be used in each. Statements must enclose each other.

use super::statement::{self, Keyword, Name, Statement};
use crate::findings::Findings;
use crate::line::{Line, without_carriage_returns};
use cnc_msgs::finding::{Code, Finding};
use std::collections::BTreeMap;

/// The beginning of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Cursor {
    /// In bytes of the text.
    pub(crate) offset: usize,
    /// Number of the line, from 1.
    pub(crate) line: u32,
}

/// Loops and conditions inside each other: more than any program needs.
const NESTED_MAX: usize = 1000;

/// One statement of the text.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    pub(crate) at: Cursor,
    pub(crate) next: Cursor,
    pub(crate) keyword: Keyword,
    /// Empty if it is computed.
    pub(crate) name: Box<str>,
    /// By keyword: the end of a `sub`, `while`, `do` or `repeat`, and the beginning of an end; the
    /// next branch of a condition; the loop of `break` and `continue`.
    pub(crate) partner: usize,
}

/// The statements of a text.
#[derive(Debug, Default)]
pub(crate) struct FlowMap {
    /// In the order of the text.
    pub(crate) entries: Vec<Entry>,
    pub(crate) subs: BTreeMap<Box<str>, usize>,
    /// Lines with a program number.
    pub(crate) programs: BTreeMap<Box<str>, usize>,
}

impl FlowMap {
    /// Finds all statements; those that are wrong are reported.
    ///
    /// With `block_delete`, those of lines that begin with `/` do not count.
    pub(crate) fn of(text: &[u8], block_delete: bool, findings: &mut Findings) -> Self {
        let mut map = Self::default();
        let mut open = Vec::new();
        let mut seen = Cursor { offset: 0, line: 1 };
        for found in memchr::memchr2_iter(b'O', b'o', text) {
            let Some(offset) = beginning_of_line(text, found) else { continue };
            if offset < seen.offset || map.entries.last().is_some_and(|it| it.at.offset == offset) {
                continue;
            }
            let line =
                seen.line + memchr::memchr_iter(b'\n', &text[seen.offset..offset]).count() as u32;
            let at = Cursor { offset, line };
            seen = at;
            let length = memchr::memchr(b'\n', &text[offset..]);
            let whole = &text[offset..length.map_or(text.len(), |length| offset + length)];
            let content = without_carriage_returns(whole);
            let line = Line { number: line, text: content, call: 0 };
            // After a last line without an end nothing is left, and no other line.
            let next = Cursor {
                offset: length.map_or(text.len(), |length| offset + length + 1),
                line: at.line + u32::from(length.is_some()),
            };
            findings.begin_block();
            match statement::read(line.text) {
                None => {}
                Some(Ok(statement)) if statement.is_optional && block_delete => {}
                Some(Ok(statement)) => map.add(line, &statement, at, next, &mut open, findings),
                Some(Err(bad)) => {
                    let source = line.source(None, bad.start, bad.end);
                    findings.push(Finding::error(Code::Syntax, source, bad.message).help(bad.help));
                }
            }
        }
        for index in open {
            let entry = &map.entries[index];
            let source = line_at(text, entry.at).source(None, 0, usize::MAX);
            let word = entry.keyword.word();
            let message = format!("{word} O{} is not closed", shown(&entry.name));
            let help = format!("write o{} {} after it", shown(&entry.name), closing(entry.keyword));
            findings.begin_block();
            findings.push(Finding::error(Code::Syntax, source, message).help(help));
        }
        map
    }

    /// The names of subroutines that are called and not defined.
    pub(crate) fn undefined_calls(&self) -> impl Iterator<Item = &str> {
        let calls = self.entries.iter().filter(|entry| entry.keyword == Keyword::Call);
        calls.map(|entry| &*entry.name).filter(|name| {
            !name.is_empty() && !self.subs.contains_key(*name) && !self.programs.contains_key(*name)
        })
    }

    /// The statement of the line that begins at this byte.
    pub(crate) fn find(&self, offset: usize) -> Option<usize> {
        self.entries.binary_search_by_key(&offset, |entry| entry.at.offset).ok()
    }

    fn add(
        &mut self,
        line: Line<'_>,
        statement: &Statement<'_>,
        at: Cursor,
        next: Cursor,
        open: &mut Vec<usize>,
        findings: &mut Findings,
    ) {
        let index = self.entries.len();
        let name: Box<str> = match &statement.name {
            Name::Known(name) => name.clone().into(),
            Name::Computed(_) if statement.keyword == Keyword::Call => Box::default(),
            Name::Computed(_) => {
                return report(
                    line,
                    statement,
                    findings,
                    "only a call may compute the name of its subroutine".to_owned(),
                    "write the number out".to_owned(),
                );
            }
        };
        let mut entry = Entry { at, next, keyword: statement.keyword, name, partner: usize::MAX };
        let trouble = self.connect(&mut entry, index, open);
        self.entries.push(entry);
        if let Err((message, help)) = trouble {
            report(line, statement, findings, message, help);
        }
    }

    /// Finds the partner of a new statement.
    fn connect(
        &mut self,
        entry: &mut Entry,
        index: usize,
        open: &mut Vec<usize>,
    ) -> Result<(), (String, String)> {
        if open.len() >= NESTED_MAX {
            return Err((
                format!("more than {NESTED_MAX} O words inside each other"),
                "close some of them first".to_owned(),
            ));
        }
        let name = shown(&entry.name).into_owned();
        let last = open.last().copied();
        let opened = last.map(|last| self.entries[last].keyword);
        let is_last = last.is_some_and(|last| self.entries[last].name == entry.name);
        let word = entry.keyword.word();
        let without = |wanted: &str| {
            let inner = match last.map(|last| &self.entries[last]) {
                Some(inner) => format!(
                    "; O{} {} in line {} is still open",
                    shown(&inner.name),
                    inner.keyword.word(),
                    inner.at.line
                ),
                None => String::new(),
            };
            Err((
                format!("O{name} {word} has no {wanted} before it{inner}"),
                format!("write o{name} {wanted}, or delete o{name} {word}"),
            ))
        };
        match entry.keyword {
            Keyword::Sub => {
                let outer = open.first().map(|&outer| &self.entries[outer]);
                let earlier = self.subs.get(&entry.name).map(|&first| self.entries[first].at.line);
                let outer = outer.map(|outer| (shown(&outer.name), outer.keyword.word()));
                if outer.is_none() {
                    // Its end belongs to it, even if the name is taken.
                    open.push(index);
                }
                let trouble = match (outer, earlier) {
                    (Some((outer, word)), _) => Some((
                        format!("O{name} begins inside O{outer} {word}"),
                        "write each subroutine by itself".to_owned(),
                    )),
                    (None, Some(line)) => Some((
                        format!("O{name} is defined in line {line} already"),
                        "give one of them another name".to_owned(),
                    )),
                    (None, None) => None,
                };
                if let Some(trouble) = trouble {
                    return Err(trouble);
                }
                self.subs.insert(entry.name.clone(), index);
            }
            Keyword::If | Keyword::Repeat | Keyword::Do => open.push(index),
            Keyword::While if is_last && opened == Some(Keyword::Do) => {
                entry.keyword = Keyword::DoWhile;
                self.close(entry, index, open);
            }
            Keyword::While => open.push(index),
            Keyword::EndSub if is_last && opened == Some(Keyword::Sub) => {
                self.close(entry, index, open);
            }
            Keyword::EndSub => return without("sub"),
            Keyword::EndWhile if is_last && opened == Some(Keyword::While) => {
                self.close(entry, index, open);
            }
            Keyword::EndWhile => return without("while"),
            Keyword::EndRepeat if is_last && opened == Some(Keyword::Repeat) => {
                self.close(entry, index, open);
            }
            Keyword::EndRepeat => return without("repeat"),
            Keyword::ElseIf | Keyword::Else
                if is_last && matches!(opened, Some(Keyword::If | Keyword::ElseIf)) =>
            {
                self.close(entry, index, open);
                open.push(index);
            }
            Keyword::ElseIf | Keyword::Else => return without("if"),
            Keyword::EndIf
                if is_last
                    && matches!(opened, Some(Keyword::If | Keyword::ElseIf | Keyword::Else)) =>
            {
                self.close(entry, index, open);
            }
            Keyword::EndIf => return without("if"),
            Keyword::Break | Keyword::Continue => {
                let around = open.iter().rev().find(|&&outer| {
                    let outer = &self.entries[outer];
                    outer.name == entry.name
                        && matches!(outer.keyword, Keyword::While | Keyword::Do | Keyword::Repeat)
                });
                match around {
                    Some(&around) => entry.partner = around,
                    None => {
                        return Err((
                            format!("O{name} {word} is not inside a loop O{name}"),
                            "write the number of the loop around it".to_owned(),
                        ));
                    }
                }
            }
            Keyword::Return => match open.first() {
                Some(&outer) if self.entries[outer].keyword == Keyword::Sub => {}
                _ => {
                    return Err((
                        format!("O{name} return is not inside a subroutine"),
                        "end the main program with M2".to_owned(),
                    ));
                }
            },
            Keyword::Number => {
                if let Some(outer) = open.first().map(|&outer| &self.entries[outer]) {
                    return Err((
                        format!(
                            "program O{name} begins inside O{} {}",
                            shown(&outer.name),
                            outer.keyword.word()
                        ),
                        "write sub, call or another keyword after the number, or delete it"
                            .to_owned(),
                    ));
                }
                if let Some(&first) = self.programs.get(&entry.name) {
                    return Err((
                        format!("O{name} is in line {} already", self.entries[first].at.line),
                        "give each program a number of its own".to_owned(),
                    ));
                }
                self.programs.insert(entry.name.clone(), index);
            }
            Keyword::Call | Keyword::DoWhile => {}
        }
        Ok(())
    }

    fn close(&mut self, entry: &mut Entry, index: usize, open: &mut Vec<usize>) {
        if let Some(opened) = open.pop() {
            entry.partner = opened;
            self.entries[opened].partner = index;
        }
    }
}

/// The line that begins here.
pub(crate) fn line_at(text: &[u8], at: Cursor) -> Line<'_> {
    let rest = &text[at.offset.min(text.len())..];
    let length = memchr::memchr(b'\n', rest).unwrap_or(rest.len());
    let whole = &rest[..length];
    Line { number: at.line, text: whole.strip_suffix(b"\r").unwrap_or(whole), call: 0 }
}

/// A name as programs write it: `100`, `<pocket>`.
pub(crate) fn shown(name: &str) -> std::borrow::Cow<'_, str> {
    match name.bytes().all(|byte| byte.is_ascii_digit()) {
        true => name.into(),
        false => format!("<{name}>").into(),
    }
}

/// The keyword that closes a statement.
fn closing(keyword: Keyword) -> &'static str {
    match keyword {
        Keyword::Sub => "endsub",
        Keyword::Do => "while",
        Keyword::While => "endwhile",
        Keyword::Repeat => "endrepeat",
        _ => "endif",
    }
}

/// The beginning of the line of an O, if only blanks, `/` and an N number stand before it.
fn beginning_of_line(text: &[u8], o: usize) -> Option<usize> {
    let mut at = o;
    while at > 0 {
        match text[at - 1] {
            b'\n' => return Some(at),
            b' ' | b'\t' | b'/' | b'N' | b'n' | b'0'..=b'9' => at -= 1,
            _ => return None,
        }
    }
    Some(0)
}

fn report(
    line: Line<'_>,
    statement: &Statement<'_>,
    findings: &mut Findings,
    message: String,
    help: String,
) {
    let source = line.source(statement.block, statement.start, statement.end);
    findings.push(Finding::error(Code::Syntax, source, message).help(help));
}
