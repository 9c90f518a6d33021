//! Subroutines in files of their own: `o<pocket> call` where the program has no `o<pocket> sub`, and
//! `M98 P10` where it has no program of that number.
//!
//! The text of each file is appended to the program, so that what was loaded is one text: it has
//! one hash, is recorded whole, and can be replayed without the files. Knows which files are
//! wanted, not where they are.

use crate::block::{Block, LexerRules, Word};
use crate::expression::{Lookup, Trouble, whole};
use crate::findings::Findings;
use crate::flow::{FlowMap, shown};
use crate::lexer;
use crate::limits::{APPENDED, LIBRARY_FILES_MAX, LINE_BYTES_MAX, PROGRAM_BYTES_MAX};
use crate::line::Line;
use cnc_msgs::profile::Profile;
use intake::text::one_line;
use std::collections::BTreeSet;

/// Appends the files of all subroutines that the program, or a file that was appended, calls and
/// does not define.
///
/// `read` gives the text of a file: `pocket.ngc` of `o<pocket> call`, `10.nc` of `M98 P10`; small
/// letters, digits, `_` and `-`. Or it says why a file that is there cannot be read; nothing where there is none. A call of
/// another name, or one that it has no text for, is left as it is; the loader reports it when the program comes to it.
pub fn with_subroutines(
    text: Vec<u8>,
    profile: &Profile,
    mut read: impl FnMut(&str) -> Result<Vec<u8>, Option<String>>,
) -> Vec<u8> {
    let mut text = text;
    let rules = &crate::dialect::of(profile.language.dialect).lexer;
    let ending = match rules.programs {
        Some(programs) => programs.ending,
        None if rules.parameters => "ngc",
        None => return text,
    };
    let mut asked: BTreeSet<String> = BTreeSet::new();
    let mut has_files = false;
    let mut called = CalledPrograms::default();
    loop {
        // One after the other: a file may define what the next one would have been read for.
        let missing = called.undefined(&text, rules);
        let Some(name) =
            missing.into_iter().find(|name| is_file_name(name) && !asked.contains(name))
        else {
            return text;
        };
        let file_name = format!("{name}.{ending}");
        if asked.len() < LIBRARY_FILES_MAX
            && let Some(file) = read(&file_name).or_else(unread).ok()
            && text.len() + file.len() < PROGRAM_BYTES_MAX
        {
            // What ends a text ends a file as well.
            let file = crate::without_filler(&file);
            if !has_files {
                let length = crate::without_filler(&text).len();
                text.truncate(length);
            }
            if text.last().is_some_and(|&last| last != b'\n') {
                text.push(b'\n');
            }
            // The program ends here: what stands in a file outside its subroutine is not run.
            let end = if has_files { String::new() } else { format!("{APPENDED}\n") };
            has_files = true;
            let file = file.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(file);
            let lines = file.split_inclusive(|byte| *byte == b'\n').count();
            text.extend_from_slice(format!("{end}(file {file_name}, {lines} lines)\n").as_bytes());
            text.extend_from_slice(file);
        }
        asked.insert(name);
    }
}

/// What stands for a file that is there and cannot be read.
const UNREAD: &str = ";not read: ";

/// A text that says why a file cannot be read, if there is one.
fn unread(why: Option<String>) -> Result<Vec<u8>, ()> {
    let why = why.ok_or(())?;
    Ok(format!("{UNREAD}{}\n", one_line(&why)).into_bytes())
}

/// What is wrong with a file that is there and was not read, and what to do. `name`: without ending.
pub(crate) fn unread_file(text: &[u8], name: &str) -> Option<(String, String)> {
    let files = all_file_starts(text);
    let &(start, _, end) = files.iter().find(|(_, file, _)| file == name)?;
    let lines = String::from_utf8_lossy(&text[start..end]);
    let why = lines.lines().nth(1)?.strip_prefix(UNREAD)?;
    let help = "correct that, and load the program again";
    Some((format!("the file of subroutine {} was not read: {why}", shown(name)), help.to_owned()))
}

/// Whether a text calls programs by their numbers.
pub(crate) fn calls_programs(text: &[u8], rules: &LexerRules) -> bool {
    let mut called = CalledPrograms::default();
    if rules.programs.is_some() || rules.parameters {
        called.search(text, rules, rules.programs.and_then(|programs| programs.call));
    }
    !called.numbers.is_empty()
}

/// The numbers of the programs that a text calls, found once in what is appended to it as well.
#[derive(Default)]
struct CalledPrograms {
    numbers: BTreeSet<u32>,
    /// Those that the program itself has.
    own: BTreeSet<Box<str>>,
    /// Bytes of the text that have been searched.
    searched: usize,
}

impl CalledPrograms {
    /// The subroutines or programs that a text calls and does not have.
    fn undefined(&mut self, text: &[u8], rules: &LexerRules) -> Vec<String> {
        let mut findings = Findings::default();
        let Some(programs) = rules.programs else {
            let map = FlowMap::of(text, false, &mut findings);
            self.search(text, rules, None);
            let called = self.numbers.iter().map(u32::to_string);
            let programs = called.filter(|number| !map.programs.contains_key(number.as_str()));
            return map.undefined_calls().map(str::to_owned).chain(programs).collect();
        };
        if self.searched == 0 {
            // Of two files that have a program one is not chosen: both are read, which is an error.
            self.own =
                FlowMap::of_programs(text, programs, &mut findings).programs.into_keys().collect();
        }
        self.search(text, rules, programs.call);
        let called = self.numbers.iter().map(u32::to_string);
        called.filter(|number| !self.own.contains(number.as_str())).collect()
    }

    /// Searches what has been appended since. `call`: the letters of a call that is no M98.
    fn search(&mut self, text: &[u8], rules: &LexerRules, call: Option<(u8, u8)>) {
        let text = &text[std::mem::replace(&mut self.searched, text.len())..];
        let mut block = Block::default();
        match call {
            Some((letter, _)) => {
                // `LF` ends many lines.
                let may_call = |line: &&[u8]| {
                    memchr::memchr2_iter(letter, letter.to_ascii_lowercase(), line)
                        .any(|at| !line.get(at + 1).is_some_and(u8::is_ascii_alphabetic))
                };
                for line in text.split(|byte| *byte == b'\n').filter(may_call) {
                    self.read(line, rules, letter, &mut block);
                }
            }
            None => {
                let mut end = 0;
                for at in memchr::memchr2_iter(b'M', b'm', text) {
                    if at >= end && may_be_98(&text[at + 1..]) {
                        let start = memchr::memrchr(b'\n', &text[..at]).map_or(0, |it| it + 1);
                        end = memchr::memchr(b'\n', &text[at..]).map_or(text.len(), |it| at + it);
                        self.read(&text[start..end], rules, b'P', &mut block);
                    }
                }
            }
        }
    }

    /// Takes the numbers that a line calls with this letter, in a block with M98 if it is P.
    fn read(&mut self, line: &[u8], rules: &LexerRules, letter: u8, block: &mut Block) {
        if line.len() > LINE_BYTES_MAX {
            return;
        }
        let line = Line { number: 1, text: line.strip_suffix(b"\r").unwrap_or(line), call: 0 };
        lexer::read(line, rules, block, &mut Findings::default(), &NoValues);
        let is_m98 =
            |word: &Word| word.letter == b'M' && crate::code_in_tenths(word.value) == Some(980);
        if letter == b'P' && !block.words.iter().any(is_m98) {
            return;
        }
        let number = block.words.iter().find(|word| word.letter == letter);
        self.numbers.extend(number.and_then(|word| whole(word.value)));
    }
}

/// Whether the digits of M98 follow. Blanks and leading zeros may stand before each: `M9 8`.
fn may_be_98(text: &[u8]) -> bool {
    let mut digits = text.iter().filter(|byte| !matches!(byte, b' ' | b'\t'));
    digits.find(|byte| **byte != b'0') == Some(&b'9') && digits.next() == Some(&b'8')
}

/// Values before the program runs.
struct NoValues;

impl Lookup for NoValues {
    fn numbered(&self, _: u32) -> Option<Result<f64, Trouble>> {
        Some(Ok(f64::NAN))
    }

    fn named(&self, _: &str) -> Option<Result<f64, Trouble>> {
        Some(Ok(f64::NAN))
    }
}

/// Where each appended file begins that was read: the offset of the line before it, its name without ending, and
/// the offset of the first byte after it.
pub(crate) fn file_starts(text: &[u8]) -> Vec<(usize, String, usize)> {
    let mut files = all_file_starts(text);
    files.retain(|&(start, _, end)| {
        !text[after_lines(text, start, 1)..end].starts_with(UNREAD.as_bytes())
    });
    files
}

/// The same, with those that were not read.
fn all_file_starts(text: &[u8]) -> Vec<(usize, String, usize)> {
    let mut starts = Vec::new();
    let appended = memchr::memmem::find_iter(text, APPENDED).find(|&at| {
        let is_begin = at == 0 || text[at - 1] == b'\n';
        is_begin && matches!(text.get(at + APPENDED.len()), None | Some(b'\n' | b'\r'))
    });
    let Some(mut at) = appended.map(|at| after_lines(text, at, 1)) else { return starts };
    while at < text.len() {
        let end = after_lines(text, at, 1);
        let line = std::str::from_utf8(&text[at..end]).unwrap_or_default();
        let Some((name, lines)) = file_after(line.trim_end()) else { break };
        let after = after_lines(text, end, lines);
        let name = name.split_once('.').map_or(name, |(name, _)| name);
        starts.push((at, name.to_owned(), after));
        at = after;
    }
    starts
}

/// The first byte after so many lines.
fn after_lines(text: &[u8], at: usize, lines: u32) -> usize {
    let Some(last) = lines.checked_sub(1) else { return at };
    let mut ends = memchr::memchr_iter(b'\n', &text[at..]);
    ends.nth(last as usize).map_or(text.len(), |end| at + end + 1)
}

/// The files that were appended to a program.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct AppendedFiles<'t> {
    /// The line before each file, how many it has, and its name.
    files: Vec<(u32, u32, &'t str)>,
}

impl<'t> AppendedFiles<'t> {
    /// Finds them in the text of a program. The line before a file says how many lines it has, and the
    /// next one is looked for after them: a comment in a file that looks the same is a comment.
    pub fn of(text: &'t str) -> Self {
        let mut files = Vec::new();
        let mut lines = (1_u32..).zip(text.lines());
        if !text.contains(APPENDED) || !lines.any(|(_, line)| line == APPENDED) {
            return Self::default();
        }
        while let Some((number, line)) = lines.next()
            && let Some((name, count)) = file_after(line)
        {
            files.push((number, count, name));
            if let Some(last) = (count as usize).checked_sub(1) {
                lines.nth(last);
            }
        }
        Self { files }
    }

    /// The file of a line, and the line in it; `None` for a line of the program itself.
    pub fn place(&self, line: u32) -> Option<(&'t str, u32)> {
        let after = self.files.partition_point(|&(before, _, _)| before < line);
        let (before, count, name) = *self.files.get(after.checked_sub(1)?)?;
        (line - before <= count).then_some((name, line - before))
    }

    /// `line 60`, or `line 60 (line 8 of pocket.ngc)`.
    pub fn text(&self, line: u32) -> String {
        match self.place(line) {
            None => format!("line {line}"),
            Some((file, in_file)) => format!("line {line} (line {in_file} of {file})"),
        }
    }
}

/// The name of the file that follows this line, and how many lines it has: `(file pocket.ngc, 12 lines)`.
fn file_after(line: &str) -> Option<(&str, u32)> {
    let (name, count) = line.strip_prefix("(file ")?.strip_suffix(" lines)")?.split_once(", ")?;
    let is_named = name.split_once('.').is_some_and(|(name, ending)| {
        is_file_name(name) && ["ngc", "nc", "nct", "spf"].contains(&ending)
    });
    Some((name, count.parse().ok()?)).filter(|_| is_named)
}

/// Whether a subroutine of this name may have a file. No name leads out of a folder.
pub(crate) fn is_file_name(name: &str) -> bool {
    let is_letter = |byte: u8| {
        byte.is_ascii_lowercase() || byte.is_ascii_digit() || matches!(byte, b'_' | b'-')
    };
    !name.is_empty() && name.bytes().all(is_letter)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assemble(text: &str, files: &[(&str, &str)]) -> String {
        let profile = settings::load_profile("rs274").expect("a shipped profile");
        let mut asked = Vec::new();
        let text = with_subroutines(text.as_bytes().to_vec(), &profile, |name| {
            asked.push(name.to_owned());
            let file = files.iter().find(|(of, _)| Some(*of) == name.strip_suffix(".ngc"));
            file.map(|file| file.1.as_bytes().to_vec()).ok_or(None)
        });
        let mut once = asked.clone();
        once.dedup();
        assert_eq!(asked, once, "each file is asked for once");
        String::from_utf8(text).expect("text")
    }

    #[test]
    fn files_of_called_subroutines_follow_the_program_and_those_that_they_call() {
        let pocket = "o<pocket> sub\no<hole> call\no<pocket> endsub\nM2\n";
        let hole = "o<hole> sub\nG0 Z1\no<hole> endsub";
        let main = "o<POCKET> call [1]\no<own> call\no<own> sub\no<own> endsub\nM2";
        assert_eq!(
            assemble(main, &[("pocket", pocket), ("hole", hole), ("own", "G0 X0")]),
            format!(
                "{main}\n{APPENDED}\n(file pocket.ngc, 4 lines)\n{pocket}(file hole.ngc, 3 lines)\n{hole}"
            )
        );
    }

    #[test]
    fn m98_reads_a_file_where_the_text_has_no_program_of_the_number() {
        let profile = settings::load_profile("rs274").expect("a shipped profile");
        let file = "O100\nG0 Y1\nM99\n";
        let text = assemble(
            "G0 X1\nM98 P100 L2\nM98 P7\nG0 X9\nM30\nO7\nM99\n",
            &[("100", file), ("7", file)],
        );
        let loaded = crate::load(text.as_bytes(), &profile, &crate::LoadOptions::default());
        assert!(loaded.is_accepted(), "{text}: {:?}", loaded.findings);
        // Two passes of the file between two moves, and the end; O7 is in the text.
        assert_eq!(loaded.contour.events.len(), 5, "{text}");
        assert_eq!(loaded.contour.events[1].source.line, 11);
    }

    #[test]
    fn a_program_without_an_end_is_still_reported_where_files_follow_it() {
        let profile = settings::load_profile("rs274").expect("a shipped profile");
        for (text, line) in [("o<a> call\nG0 X1\n", Some(2)), ("o<a> call\nM2", None)] {
            let text = assemble(text, &[("a", "o<a> sub\nG0 X2\no<a> endsub\nM2\n")]);
            let loaded = crate::load(text.as_bytes(), &profile, &crate::LoadOptions::default());
            let found: Vec<_> =
                loaded.findings.iter().map(|it| (it.message.as_str(), it.source.line)).collect();
            let wanted = line.map(|line| ("the program has no end", line));
            assert_eq!(found, wanted.into_iter().collect::<Vec<_>>(), "{text}");
        }
    }

    #[test]
    fn lines_of_appended_files_are_known_by_file_and_line() {
        let main = "o<a> call\no<b> call\nM2\n(file c.ngc, 1 lines)\n";
        // The first has what looks like the line before another, and so has the second for its end.
        let a = "o<a> sub\n(file c.ngc, 1 lines)\no<a> endsub\n";
        let files = [("a", a), ("b", "o<b> sub\n(file c.ngc)\no<b> endsub")];
        let text = assemble(main, &files) + "\n(values)\n";
        let appended = AppendedFiles::of(&text);
        let places: Vec<_> = (1..=14).map(|line| appended.place(line)).collect();
        let (a, b) = ("a.ngc", "b.ngc");
        assert_eq!(places[..6], [None; 6], "{text}");
        let of_a = [Some((a, 1)), Some((a, 2)), Some((a, 3))];
        let of_b = [Some((b, 1)), Some((b, 2)), Some((b, 3))];
        assert_eq!(places[6..9], of_a, "{text}");
        assert_eq!(places[9], None, "the line before a file is of none");
        assert_eq!(places[10..13], of_b, "{text}");
        assert_eq!(places[13], None, "it has three lines");
        assert_eq!(appended.text(8), "line 8 (line 2 of a.ngc)");
        assert_eq!(AppendedFiles::of(main).text(4), "line 4");
    }

    #[test]
    fn a_file_is_not_read_for_what_another_file_defines() {
        let both = "o<a> sub\no<a> endsub\no<b> sub\no<b> endsub\n";
        let main = "o<a> call\no<b> call\nM2\n";
        let files = [("a", both), ("b", "o<b> sub\no<b> endsub\n")];
        assert_eq!(
            assemble(main, &files),
            format!("{main}{APPENDED}\n(file a.ngc, 4 lines)\n{both}")
        );
        let ended = format!("{}\x1A", main.trim_end());
        assert_eq!(
            assemble(&ended, &files),
            format!("{main}{APPENDED}\n(file a.ngc, 4 lines)\n{both}")
        );
    }

    #[test]
    fn a_file_that_cannot_be_read_is_named_where_it_is_called() {
        let why = "it is a link\nout of here";
        let table = [
            (
                "rs274",
                "o<pocket> call\nM2\n",
                "the file of subroutine <pocket> was not read: it is a link",
            ),
            ("rs274", "M98 P10\nM2\n", "the file of subroutine 10 was not read: it is a link"),
            (
                "rs274",
                "G0 X1\nM98 P10\no1 sub\no1 endsub\nM2\n",
                "the file of subroutine 10 was not read",
            ),
            ("masso", "M98 P10\nM30\n", "the file of subroutine 10 was not read: it is a link"),
        ];
        for (control, text, wanted) in table {
            let profile = settings::load_profile(control).expect("a shipped profile");
            let read = |reason: Option<&str>| {
                let reason = reason.map(str::to_owned);
                let text = with_subroutines(text.into(), &profile, |_| Err(reason.clone()));
                let loaded = crate::load(&text, &profile, &crate::LoadOptions::default());
                (text, loaded.findings.iter().map(|it| it.message.clone()).collect::<Vec<_>>())
            };
            let (_, found) = read(Some(why));
            assert!(found.len() == 1 && found[0].starts_with(wanted), "{control}: {found:?}");
            // Where there is no file, the text stays as it is.
            let (same, found) = read(None);
            assert_eq!(same, text.as_bytes());
            assert!(found[0].starts_with("there is no "), "{control}: {found:?}");
        }
    }

    #[test]
    fn a_name_that_is_no_file_name_is_not_asked_for() {
        for call in ["o<../../etc/passwd> call", "o<a/b> call", "o<a.b> call", "o[#1] call"] {
            assert_eq!(assemble(call, &[("a", "x")]), call);
        }
        assert_eq!(assemble("o<none> call", &[]), "o<none> call");
    }
}
