//! Subroutines in files of their own: `o<pocket> call` where the program has no `o<pocket> sub`.
//!
//! The text of each file is appended to the program, so that what was loaded is one text: it has
//! one hash, is recorded whole, and can be replayed without the files. Knows which files are
//! wanted, not where they are.

use crate::findings::Findings;
use crate::flow::FlowMap;
use crate::limits::{APPENDED, LIBRARY_FILES_MAX, PROGRAM_BYTES_MAX};
use cnc_msgs::profile::Profile;
use std::collections::BTreeSet;

/// Appends the files of all subroutines that the program, or a file that was appended, calls and
/// does not define.
///
/// `read` gives the text of a file by the name of its subroutine: small letters, digits, `_` and
/// `-`. A call of another name, or one that it has no text for, is left as it is; the loader
/// reports it when the program comes to it.
pub fn with_subroutines(
    text: Vec<u8>,
    profile: &Profile,
    mut read: impl FnMut(&str) -> Option<Vec<u8>>,
) -> Vec<u8> {
    let mut text = text;
    if !crate::dialect::of(profile.language.dialect).lexer.parameters {
        return text;
    }
    let mut asked: BTreeSet<String> = BTreeSet::new();
    let mut has_files = false;
    loop {
        // One after the other: a file may define what the next one would have been read for.
        let map = FlowMap::of(&text, false, &mut Findings::default());
        let missing =
            map.undefined_calls().find(|name| is_file_name(name) && !asked.contains(*name));
        let Some(name) = missing.map(str::to_owned) else { return text };
        if asked.len() < LIBRARY_FILES_MAX
            && let Some(file) = read(&name)
            && text.len() + file.len() < PROGRAM_BYTES_MAX
        {
            // What ends a text ends a file as well.
            let file = file.strip_suffix(b"\x1A").unwrap_or(&file);
            if !has_files && text.last() == Some(&b'\x1A') {
                text.pop();
            }
            if text.last().is_some_and(|&last| last != b'\n') {
                text.push(b'\n');
            }
            // The program ends here: what stands in a file outside its subroutine is not run.
            let end = if has_files { String::new() } else { format!("{APPENDED}\n") };
            has_files = true;
            text.extend_from_slice(format!("{end}(file {name}.ngc)\n").as_bytes());
            text.extend_from_slice(file.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(file));
        }
        asked.insert(name);
    }
}

/// Whether a subroutine of this name may have a file. No name leads out of a folder.
fn is_file_name(name: &str) -> bool {
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
            let file = files.iter().find(|(of, _)| *of == name)?;
            Some(file.1.as_bytes().to_vec())
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
            format!("{main}\n{APPENDED}\n(file pocket.ngc)\n{pocket}(file hole.ngc)\n{hole}")
        );
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
    fn a_file_is_not_read_for_what_another_file_defines() {
        let both = "o<a> sub\no<a> endsub\no<b> sub\no<b> endsub\n";
        let main = "o<a> call\no<b> call\nM2\n";
        let files = [("a", both), ("b", "o<b> sub\no<b> endsub\n")];
        assert_eq!(assemble(main, &files), format!("{main}{APPENDED}\n(file a.ngc)\n{both}"));
        let ended = format!("{}\x1A", main.trim_end());
        assert_eq!(assemble(&ended, &files), format!("{main}{APPENDED}\n(file a.ngc)\n{both}"));
    }

    #[test]
    fn a_name_that_is_no_file_name_is_not_asked_for() {
        for call in ["o<../../etc/passwd> call", "o<a/b> call", "o<a.b> call", "o[#1] call"] {
            assert_eq!(assemble(call, &[("a", "x")]), call);
        }
        assert_eq!(assemble("o<none> call", &[]), "o<none> call");
    }
}
