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

#[test]
fn words_for_the_machine_are_passed_on_with_their_values() {
    check(&[
        ("M62 P1 G0 X1\nM2", "M62 P1; rapid X1 Y0 Z0 named X; M2", &[]),
        ("M66 P0 L3 Q2.5\nM67 E1 Q-0.5\nM2", "M66 L3 P0 Q2.5; M67 E1 Q-0.5; M2", &[]),
        (
            "M19 R45 Q1\nM50 P0\nM51\nM53 P0\nM101 P1 Q2.5\nM49\nM2",
            "M19 Q1 R45; M50 P0; M51; M53 P0; M101 P1 Q2.5; M49; M2",
            &[],
        ),
        (
            "M50 P0\nM52\n(DEBUG, %d#<_feed_override>#<_speed_override>#<_adaptive_feed>)\nM2",
            "M50 P0; M52; (MSG, 011); M2",
            &[],
        ),
        ("M70\nM49\nM72\nM2", "M49; M50 P1; M51 P1; M2", &[]),
        ("M61 Q7\n(DEBUG, %d#5400 #<_current_tool>)\nG43\nM2", "(MSG, 7 7); G43 H7; M2", &[]),
        (
            "F100 G0 X0 Y20\nM61 Q3\nG41 G1 Y0\nX9\nG40 Y9\nM2",
            "rapid X0 Y20 Z0 named XY; radius of tool 3; select left; line X0 Y0 Z0 F100 named Y; \
          line X9 Y0 Z0 F100 named X; cancel; line X9 Y9 Z0 F100 named Y; M2",
            &[],
        ),
    ]);
}

#[test]
fn wrong_words_for_the_machine_are_errors_at_their_places() {
    check_bad(&[
        ("M62\nM2", &[("M62", "M62 without P")]),
        ("M64 P1.5\nM2", &[("P1.5", "M64 does not take P1.5")]),
        ("M65 P-1\nM2", &[("P-1", "M65 does not take P-1")]),
        ("M66\nM2", &[("M66", "M66 reads one input")]),
        ("M66 P1 E1\nM2", &[("M66", "M66 reads one input")]),
        ("M66 E1 L3 Q1\nM2", &[("L3", "an analog input is read at once")]),
        ("M66 P1 L3\nM2", &[("M66", "M66 waits without a time")]),
        ("M66 P1 L5 Q1\nM2", &[("L5", "M66 does not take L5")]),
        ("M67 Q1\nM2", &[("M67", "M67 without E")]),
        ("M19 R400\nM2", &[("R400", "M19 does not take R400")]),
        ("M61\nM2", &[("M61", "M61 without Q")]),
        ("M61 Q1.5\nM2", &[("Q1.5", "Q1.5 is not a whole number of at most eight digits")]),
        ("T1 M6 M61 Q1\nM2", &[("M61", "M6 and M61 exclude each other in one block")]),
        ("M62 P[0/0]\nM2", &[("/0", "a division by zero")]),
        (
            "M66 P1 L0\nG0 X#5399\nM2",
            &[("#5399", "#5399 is the result of M66, which is known only while the machine runs")],
        ),
        (
            "F100 G0 X0 Y20\nT1 M6\nG41 G1 Y0\nX5\nM61 Q2\nX9\nG40 Y9\nM2",
            &[("M61", "M61 changes the tool under cutter radius compensation")],
        ),
        ("M48 P1\nM2", &[("P1", "nothing in this block uses P1")]),
    ]);
    let mut loaded = read("M61 Q5\nM2");
    loaded.allow_tools(&[1]);
    assert!(!loaded.is_accepted() && loaded.findings[0].source.line == 1);
}
