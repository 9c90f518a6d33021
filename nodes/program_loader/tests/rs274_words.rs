//! Words of LinuxCNC beyond moves and cycles: what they become, and what is wrong with them.

mod common;

use common::profile;
use program_loader::{LoadOptions, Loaded, canonical, load};

fn read(text: &str) -> Loaded {
    load(text.as_bytes(), &profile("rs274"), &LoadOptions::default())
}

/// The events of programs without places, one a line, and the warnings of each.
#[track_caller]
fn check(cases: &[(&str, &str, &[&str])]) {
    for &(text, wanted, warnings) in cases {
        let loaded = read(text);
        assert!(loaded.is_accepted(), "{text}: {:?}", loaded.findings);
        let events: Vec<String> = loaded.contour.events.iter().map(canonical::event_text).collect();
        assert_eq!(events.join("; "), wanted, "{text}");
        let found: Vec<&str> = loaded.findings.iter().map(|it| it.message.as_str()).collect();
        assert_eq!(found, warnings, "{text}");
    }
}

/// The errors of programs with the bytes that each is about.
#[track_caller]
#[allow(dead_code, reason = "tests of the words that are refused")]
fn check_bad(cases: &[(&str, &[(&str, &str)])]) {
    for &(text, wanted) in cases {
        let loaded = read(text);
        let lines: Vec<&str> = text.lines().collect();
        let errors = loaded.findings.iter().filter(|it| it.is_error());
        let found: Vec<(&str, &str)> = errors
            .map(|it| {
                let start = usize::from(it.source.column) - 1;
                let end = start + usize::from(it.source.length);
                (&lines[it.source.line as usize - 1][start..end], it.message.as_str())
            })
            .collect();
        assert_eq!(found, wanted, "{text}");
    }
}

#[test]
fn messages_are_events_in_their_place() {
    check(&[
        (
            "(MSG, hello #1)\n#1=5 (DEBUG, is %d#1)\nG0 X1 (print, x #<_x>)\nM2",
            "(MSG, hello #1); (MSG, is 5); (MSG, x 0.000000); \
             rapid X1 Y0 Z0 named X; M2",
            &[],
        ),
        ("(MSG,)\n(MSG)\n(message)\nM0 (MSG, turn it)\nM2", "(MSG, turn it); M0; M2", &[]),
        (
            "(DEBUG, #5021 and #<no>)\nM2",
            "(MSG, ###### and ######); M2",
            &[
                "#5021 is a position in machine coordinates, which is known only while the machine \
                 runs: the message shows ######",
                "nothing has set the parameter #<no>: the message shows ######",
            ],
        ),
        (
            "(LOGOPEN, ../x)\n(LOG, #1)\n(LOGCLOSE)\nM2",
            "(MSG, 0.000000); M2",
            &["no file is written: what (LOG, ...) writes is a message to the operator"],
        ),
        (
            "#1=2\no1 while [#1 GT 0]\n(DEBUG, %d#1)\n#1=[#1-1]\no1 endwhile\nM2",
            "(MSG, 2); (MSG, 1); M2",
            &[],
        ),
        // More than one event holds.
        (
            "(MSG, the quick brown fox jumps over the lazy dog and over all of its sleepy friends)\nM2",
            "(MSG, the quick brown fox jumps over the lazy dog and over all of); \
             (MSG, its sleepy friends); M2",
            &[],
        ),
        ("; MSG, no\n(MSG , no)\nM2", "M2", &[]),
    ]);
}

#[test]
fn a_program_that_aborts_is_refused_with_its_text() {
    for text in ["(ABORT, no tool)\nM2", "o1 if [1]\nG0 X1 (abort, no tool)\no1 endif\nM2"] {
        let loaded = read(text);
        let first = loaded.findings.first().expect("a finding");
        assert!(first.is_error() && first.message == "the program ends itself here: no tool");
    }
    // Other languages have comments only.
    let text = b"N10 (MSG, hello)\nN20 M30";
    let loaded = load(text, &profile("nct"), &LoadOptions::default());
    assert_eq!((loaded.contour.events.len(), loaded.findings.len()), (1, 0));
}
