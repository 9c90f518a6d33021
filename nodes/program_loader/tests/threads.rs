//! G33 and G76 of RS-274: motions that keep pace with the spindle, and the passes of a thread.

mod common;

use cnc_msgs::finding::Code;
use common::profile;
use program_loader::canonical::event_text;
use program_loader::{LoadOptions, Loaded, load};

fn read(program: &str) -> Loaded {
    load(program.as_bytes(), &profile("rs274"), &LoadOptions::default())
}

/// What the block after the beginning does.
#[track_caller]
fn events(begin: &str, block: &str) -> Vec<String> {
    let before = read(&format!("{begin}M2\n")).contour.events.len() - 1;
    let loaded = read(&format!("{begin}{block}\nM2\n"));
    assert!(loaded.is_accepted(), "{block}: {:#?}", loaded.findings);
    let all = &loaded.contour.events[before..];
    all[..all.len() - 1].iter().map(event_text).collect()
}

const BEGIN: &str = "G21 G90 S400 M3\nG0 X10 Y0 Z5\n";

#[test]
fn g33_has_the_feed_of_its_pitch_and_speed() {
    for (begin, block, wanted) in [
        (BEGIN, "G33 Z-20 K1.5", ["G33 K1.5", "line X10 Y0 Z-20 F600 named Z"]),
        (BEGIN, "G33 X12 Z-20 K2", ["G33 K2", "line X12 Y0 Z-20 F800 named XZ"]),
        // In inches, and X as a diameter.
        (
            "G20 G90 S100 M4\nG0 X1 Y0 Z1\n",
            "G33 Z0 K.1",
            ["G33 K2.54", "line X25.4 Y0 Z0 F254 named Z"],
        ),
        (
            "G21 G90 G7 S100 M3\nG0 X20 Y0 Z5\n",
            "G33 X22 Z0 K1",
            ["G33 K1", "line X11 Y0 Z0 F100 named XZ"],
        ),
        // The first spindle is the only one.
        (BEGIN, "G33 $0 Z-20 K1", ["G33 K1", "line X10 Y0 Z-20 F400 named Z"]),
        // Whatever F means.
        ("G21 G93 S100 M3\nG0 X0 Y0 Z5\n", "G33 Z0 K1", ["G33 K1", "line X0 Y0 Z0 F100 named Z"]),
    ] {
        assert_eq!(events(begin, block), wanted, "{block}");
    }
}

#[test]
fn the_feed_before_a_thread_is_in_force_after_it() {
    let begin = "G21 G90 S400 M3\nG0 X10 Y0 Z5\nG1 X9 F250\nG33 Z-20 K1.5\n";
    assert_eq!(events(begin, "G1 X8"), ["line X8 Y0 Z-20 F250 named X"]);
}

#[test]
fn g76_is_a_pass_of_g33_for_each_depth() {
    // Crest at X9, 0.4 and then 0.8 and 1 below it; without an angle all passes have the same ends.
    let words = "G76 P2 Z-10 I-1 J0.4 K1";
    assert_eq!(
        events(BEGIN, words),
        [
            "rapid X10.6 Y0 Z5 named X",
            "rapid X8.6 Y0 Z5 named X",
            "G33 K2",
            "line X8.6 Y0 Z-10 F800 named Z",
            "rapid X10.6 Y0 Z-10 named X",
            "rapid X10.2 Y0 Z5 named XZ",
            "rapid X8.2 Y0 Z5 named X",
            "G33 K2",
            "line X8.2 Y0 Z-10 F800 named Z",
            "rapid X10.2 Y0 Z-10 named X",
            "rapid X10 Y0 Z5 named XZ",
            "rapid X8 Y0 Z5 named X",
            "G33 K2",
            "line X8 Y0 Z-10 F800 named Z",
            "rapid X10 Y0 Z-10 named X",
            // Where the block says.
            "rapid X10 Y0 Z-10 named Z",
        ]
    );
    let passes = |block: &str| events(BEGIN, block).iter().filter(|it| *it == "G33 K2").count();
    // Depths of 0.4, 0.57, 0.69, 0.8, 0.89, 0.98 and 1; H more at the end.
    assert_eq!(passes(&format!("{words} R2")), 7);
    assert_eq!(passes(&format!("{words} H2")), 5);
    // An inside thread goes the other way; at 45 degrees the tool goes as far along Z as in.
    let inside = events(BEGIN, "G76 P2 Z-10 I1 J0.5 K1 Q45");
    assert_eq!(inside[1], "rapid X11.5 Y0 Z4.5 named X");
    assert_eq!(inside[3], "line X11.5 Y0 Z-9.5 F800 named Z");
    assert_eq!(inside[8], "line X12 Y0 Z-10 F800 named Z");
    // The other way, a pass has more of it than the thread is long.
    let other = events(BEGIN, "G76 P2 Z4.5 I1 J0.5 K1 Q-45");
    assert_eq!(other[3], "line X11.5 Y0 Z4 F800 named Z");
}

#[test]
fn what_is_no_thread_says_why() {
    let spindle_off = "G21 G90\nG0 X10 Y0 Z5\n";
    let compensated = "G21 G90 S400 M3 F100\nG0 X10 Y0 Z5\nT1 M6\nG41 D1\nG1 X20\n";
    for (begin, block, code, part) in [
        (BEGIN, "G33 Z-5", Code::MissingWord, "G33 without K"),
        (BEGIN, "G33 Z-5 K0", Code::BadNumber, "the pitch K0 is not at least"),
        (BEGIN, "G33 Z-5 K-1", Code::BadNumber, "the pitch K-1"),
        (BEGIN, "G33 Z-5 K1 F100", Code::ModalConflict, "F in a block with G33"),
        (BEGIN, "G33 K1", Code::MissingWord, "G33 without X, Y or Z"),
        ("G21 G90 S-4 M3\nG0 X10 Y0 Z5\n", "G33 Z-5 K1", Code::BadNumber, "S-4 is negative"),
        (spindle_off, "G33 Z-5 K1\nG33 Z-6 K1", Code::MissingWord, "neither M3 nor M4 is in force"),
        (BEGIN, "G33 Z-5 A5 K1", Code::Axes, "A cannot move in a thread"),
        (BEGIN, "G33.1 Z-5 K1", Code::Unsupported, "G33.1"),
        (BEGIN, "G33 Z-5 K1 $1", Code::Unsupported, "`$1` is not $0"),
        (spindle_off, "G33 Z-5 K1", Code::MissingWord, "neither M3 nor M4 is in force"),
        ("G21 G90 M3\nG0 X10 Y0 Z5\n", "G33 Z-5 K1", Code::MissingWord, "no spindle speed"),
        (spindle_off, "G76 P1 Z-5 I-1 J0.1 K0.2", Code::MissingWord, "G76 needs a spindle"),
        (compensated, "G33 Z-5 K1", Code::ForbiddenUnderCompensation, "since line 4"),
        (compensated, "G76 P1 Z-5 I-1 J0.1 K0.2", Code::ForbiddenUnderCompensation, "since line 4"),
        (BEGIN, "G76 P1 Z-5 I-1 J0.5 K0.2", Code::BadNumber, "K0.2 of G76 is not more than J"),
        (BEGIN, "G76 P1 Z-5 I0 J0.1 K0.2", Code::BadNumber, "I0 of G76 is 0"),
        (BEGIN, "G76 P1 Z-5 I-1 J0 K0.2", Code::BadNumber, "J0 of G76 is not above 0"),
        (BEGIN, "G76 P1 Z-5 J0.1 K0.2", Code::MissingWord, "G76 without I"),
        (BEGIN, "G76 Z-5 I-1 J0.1 K0.2", Code::MissingWord, "G76 without P"),
        (BEGIN, "G76 P1 I-1 J0.1 K0.2", Code::MissingWord, "G76 without Z"),
        (BEGIN, "G76 P1 X9 I-1 J0.1 K0.2", Code::MissingWord, "G76 without Z"),
        (BEGIN, "G76 P1 Z-5 I-1 J0.1 K0.2 R0.5", Code::BadNumber, "R0.5 of G76 is below 1"),
        (
            BEGIN,
            "G76 P1 Z-5 I-1 J0.1 K0.2 Q89",
            Code::BadNumber,
            "Q89 of G76 is more than 80 degrees",
        ),
        (BEGIN, "G76 P1 Z-5 I-1 J0.1 K0.2 H1.5", Code::BadNumber, "H1.5"),
        (BEGIN, "G76 P1 Z-5 I-1 J0.1 K0.2 E1 L2", Code::Unsupported, "angled entry or exit"),
        (BEGIN, "G76 P1 Z-5 I-1 J0.001 K2 R6", Code::Limit, "passes"),
        (BEGIN, "G76 P1 Z5 I-1 J0.1 K0.2", Code::BadNumber, "is 0.000 mm long"),
        (BEGIN, "G76 P1 Z4 I-1 J0.5 K1 Q60", Code::BadNumber, "Q takes 1.732 mm of it"),
        (BEGIN, "G76 P1 Z-9 I1 J800000 K900000 Q70", Code::BadNumber, "is 14.000 mm long"),
        (BEGIN, "G76 P1 Z-9 I900000 J100000 K200000", Code::Limit, "in X"),
        (BEGIN, "G76 P1 Z-5 I-1 J0.1 K2 H2000", Code::Limit, "more than 1000 at it"),
    ] {
        let loaded = read(&format!("{begin}{block}\nM2\n"));
        let [error] = &loaded.findings[..] else { panic!("{block}: {:#?}", loaded.findings) };
        assert_eq!(error.code, code, "{block}: {error:?}");
        assert!(error.is_error() && error.message.contains(part), "{block}: {error:?}");
    }
    // Nobody knows where Z is, or the program only assumes it: the thread is cut.
    for before in ["G28", "G55", "G0 G53 Z0", "G38.2 Z-20 F50"] {
        let threaded = events(&format!("{BEGIN}{before}\n"), "G33 Z5 K1");
        assert_eq!(threaded[1], "line X10 Y0 Z5 F400 named Z", "{before}: {threaded:?}");
    }
    let with_a = events(&format!("{BEGIN}G0 A0\n"), "G33 Z-5 A0 K1");
    assert_eq!(with_a.len(), 2, "{with_a:?}");
    let nothing = read(&format!("{BEGIN}G33 Z5 K1\nM2\n"));
    assert!(nothing.is_accepted() && nothing.findings.len() == 1, "{:#?}", nothing.findings);
}
