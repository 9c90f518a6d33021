//! What words mean, one rule at a time: a fragment and its events.

mod common;

use common::profile;
use program_loader::{LoadOptions, Loaded, canonical, load};

fn load_as(control: &str, text: &str) -> Loaded {
    load(text.as_bytes(), &profile(control), &LoadOptions::default())
}

/// The events of a program, without places; the program must be accepted.
#[track_caller]
fn check(control: &str, text: &str, expected: &[&str]) {
    let loaded = load_as(control, text);
    assert!(loaded.is_accepted(), "{text:?}: {:?}", loaded.findings);
    let events: Vec<String> = loaded.contour.events.iter().map(canonical::event_text).collect();
    assert_eq!(events, expected, "{text:?}");
}

/// The codes of a program's findings, with the word that each points at.
#[track_caller]
fn check_bad(control: &str, text: &str, expected: &[(&str, &str)]) {
    let loaded = load_as(control, text);
    let lines: Vec<&str> = text.lines().collect();
    let found: Vec<(&str, &str)> = loaded
        .findings
        .iter()
        .filter(|found| found.is_error())
        .map(|found| {
            let start = usize::from(found.source.column) - 1;
            let end = start + usize::from(found.source.length);
            (found.code.name(), &lines[found.source.line as usize - 1][start..end])
        })
        .collect();
    assert_eq!(found, expected, "{text:?}");
}

#[test]
fn a_tool_that_is_not_expected_refuses_the_program() {
    let text = "T2 M6\nG0 X1\nT5 M6\nG0 X2\nT1 M6\nT5 M6\nT0 M6\nM30";
    for (expected, refused) in [
        (&[][..], &[][..]),
        (&[1, 2, 5], &[]),
        (&[5, 2, 1, 9], &[]),
        (&[2, 1], &[(3, "T5 is not one of the tools that are expected: T2, T1")]),
        (
            &[2],
            &[
                (3, "T5 is not one of the tools that are expected: T2"),
                (5, "T1 is not one of the tools that are expected: T2"),
            ],
        ),
    ] {
        let mut loaded = load_as("rs274", text);
        loaded.allow_tools(expected);
        let found: Vec<(u32, &str)> =
            loaded.findings.iter().map(|it| (it.source.line, it.message.as_str())).collect();
        assert_eq!(found, refused, "{expected:?}");
        assert_eq!(loaded.is_accepted(), refused.is_empty());
        assert_eq!(loaded.contour.events.is_empty(), !refused.is_empty());
    }
    // However many there are, the message has a limited length.
    let many: String = (1..500).map(|tool| format!("T{tool}\n")).collect();
    let mut many = load_as("rs274", &(many + "M30"));
    many.allow_tools(&(600..700).collect::<Vec<_>>());
    let messages: Vec<&str> = many.findings.iter().map(|it| it.message.as_str()).collect();
    assert_eq!(messages.len(), 21);
    assert!(
        messages[0].starts_with("T1 is not") && messages[0].ends_with("T619 and 80 more"),
        "{messages:?}"
    );
    assert_eq!(messages[20], "479 more tools are not expected");
    // A program with other errors keeps them, and gets no further finding.
    let mut broken = load_as("rs274", "T5 M6\nG99.7\nM30");
    let before = broken.clone();
    broken.allow_tools(&[1]);
    assert_eq!(broken, before);
}

#[test]
fn a_block_is_executed_in_the_order_of_rs274_not_as_written() {
    check(
        "rs274",
        "M30 X1 G0 M8 M3 S500 T2 M6 G54 G43 H2 G18 F100",
        &[
            "S500",
            "T2",
            "M6 T2",
            "M3",
            "M8",
            "plane zx",
            "G43 H2",
            "G54",
            "rapid X1 Y0 Z0 named X",
            "M30",
        ],
    );
}

#[test]
fn words_of_one_block_may_be_in_any_order() {
    let orders = ["G1 X1 Y2 F100", "F100 Y2 X1 G1", "X1 F100 G1 Y2", "g01f100x1y2"];
    for text in orders {
        check("rs274", text, &["line X1 Y2 Z0 F100 named XY"]);
    }
}

#[test]
fn feed_is_in_the_units_of_its_own_block() {
    check("rs274", "G21\nG20 G1 X1 F10", &["line X25.4 Y0 Z0 F254 named X"]);
    check("rs274", "G20 F10\nG21 G1 X1", &["line X1 Y0 Z0 F254 named X"]);
}

#[test]
fn motion_words_are_modal_until_g80() {
    check(
        "rs274",
        "G1 F1 X1\nX2\nG0\nX3\nG80 G0 X4",
        &[
            "line X1 Y0 Z0 F1 named X",
            "line X2 Y0 Z0 F1 named X",
            "rapid X3 Y0 Z0 named X",
            "rapid X4 Y0 Z0 named X",
        ],
    );
    check_bad("rs274", "G0 X1\nG80\nX2\nX3", &[("missing_word", "X2")]);
}

#[test]
fn centers_are_relative_unless_g90_1() {
    let circle = "arc cw xy X0 Y0 Z0 center X5 Y0 turns 1 F1 named XY";
    check("rs274", "G90 F1 G2 X0 Y0 I5", &[circle]);
    check("rs274", "G90.1 F1 G2 I5 J0", &[circle]);
    check("rs274", "G91 F1 G2 I5", &[circle]);
}

#[test]
fn p_counts_the_turns_of_an_arc() {
    check("rs274", "G3 F1 X10 I5 P1", &["arc ccw xy X10 Y0 Z0 center X5 Y0 F1 named XY"]);
    check("rs274", "G3 F1 X10 I5 P3", &["arc ccw xy X10 Y0 Z0 center X5 Y0 turns 2 F1 named XY"]);
    check("rs274", "G3 F1 I5 Z-3 P3", &["arc ccw xy X0 Y0 Z-3 center X5 Y0 turns 3 F1 named XYZ"]);
}

#[test]
fn block_delete_skips_blocks_that_begin_with_a_slash() {
    let text = "G0 X1\n /N2 G77 X2\nX3";
    let options = LoadOptions { block_delete: true, ..LoadOptions::default() };
    let loaded = load(text.as_bytes(), &profile("rs274"), &options);
    assert!(loaded.is_accepted());
    assert_eq!(loaded.contour.events.len(), 2);
    check_bad("rs274", text, &[("unknown_word", "G77")]);
}

#[test]
fn the_place_of_an_event_is_its_block_without_blanks_and_trailing_comments() {
    let loaded = load_as("rs274", "\n  (a \u{fc}) N7 G0 (b) X1  (c) ; d\n");
    let source = loaded.contour.events[0].source;
    assert_eq!((source.line, source.block, source.column, source.length), (2, Some(7), 9, 12));
}

#[test]
fn axes_that_were_never_named_are_assumed_when_a_motion_relies_on_them() {
    for (text, assumed) in [
        ("G0 X1 Y1\nG2 F1 X2 Y2 R5", ""),
        ("G0 X1\nX2", ""),
        ("G0 X1\nG2 F1 X2 Y2 R5", "Y"),
        ("G91 G0 Z1", "Z"),
        ("G2 F1 X2 Y2 R5", "XY"),
        ("G41 D1 G1 F1 X10 Y10\nG40 X0", "XY"),
        ("G0 X1 Y1\nG91 G28 Z0", ""),
    ] {
        let loaded = load_as("rs274", text);
        assert!(loaded.is_accepted(), "{text:?}: {:?}", loaded.findings);
        assert_eq!(loaded.contour.assumed_axes.letters(), assumed, "{text:?}");
    }
}

#[test]
fn a_motion_leaves_an_unknown_axis_at_its_last_known_value() {
    let loaded = load_as("rs274", "G0 X1 Y2 Z3\nG53 G0 Z0\nG0 X5");
    let last = canonical::event_text(&loaded.contour.events[2]);
    assert_eq!(last, "rapid X5 Y2 Z3 named X");
}

#[test]
fn a_change_of_frame_makes_axes_unknown_until_they_are_named() {
    for before in ["G28", "G55", "G30 X0 Y0", "G53 G0 X0 Y0"] {
        let text = format!("G0 X0 Y0 Z0 F100\n{before}\nG1 X1\nG2 X3 Y0 I1");
        check_bad("rs274", &text, &[("axes", "G2 X3 Y0 I1")]);
        let text = format!("G0 X0 Y0 Z0 F100\n{before}\nG1 X1\nY0\nG2 X3 Y0 I1");
        assert!(load_as("rs274", &text).is_accepted(), "{text}");
    }
    let loaded = load_as("rs274", "G0 X0 Y0 Z0 F100\nG54 G49\nG91 G1 Z1");
    assert!(loaded.is_accepted(), "what is in force already changes nothing");
}

#[test]
fn the_message_about_an_unknown_axis_names_it_and_the_line_that_lost_it() {
    let loaded = load_as("rs274", "G0 X0 Y0 Z5\nG28 Z0\nG92 Z5");
    let found = &loaded.findings[0];
    assert_eq!(
        found.message,
        "this block starts from where Z is, which is not known since G28 in line 2"
    );
    assert_eq!(found.other.map(|other| other.line), Some(2));
}

#[test]
fn m03_m08_masso_adds_p_to_the_radius_of_the_tool_in_the_spindle() {
    check("masso", "G41", &["radius of the tool in the spindle and 0", "select left"]);
    check("masso", "G42 P5", &["radius of the tool in the spindle and 5", "select right"]);
    check("masso", "G20 G41 P0.5", &["radius of the tool in the spindle and 12.7", "select left"]);
}

#[test]
fn d_is_a_tool_on_rs274_and_zero_or_none_is_the_tool_in_the_spindle() {
    check("rs274", "G41 D7", &["radius of tool 7", "select left"]);
    for text in ["G41", "G41 D0"] {
        check("rs274", text, &["radius of the tool in the spindle", "select left"]);
    }
    check("rs274", "G20 G42.1 D0.5", &["radius diameter 12.7", "select right"]);
}

#[test]
fn l_is_the_tip_direction_of_a_turning_tool_and_its_numbers_go_around_the_other_way() {
    for (word, tip) in [
        ("", ""),
        ("L0", ""),
        ("L1", ", tip 4"),
        ("L2", ", tip 3"),
        ("L3", ", tip 2"),
        ("L4", ", tip 1"),
        ("L5", ", tip 5"),
        ("L6", ", tip 8"),
        ("L7", ", tip 7"),
        ("L8", ", tip 6"),
        ("L9", ", tip 9"),
    ] {
        let radius = format!("radius diameter 1.6{tip}");
        let text = format!("G18 G42.1 D1.6 {word}");
        check("rs274", &text, &["plane zx", &radius, "select right"]);
    }
    check_bad("rs274", "G18 G42.1 D1.6 L10", &[("bad_number", "L10")]);
    check_bad("rs274", "G18 G42.1 D1.6 L2.5", &[("bad_number", "L2.5")]);
    check_bad("rs274", "G18 G42.1 D1.6 L-1", &[("bad_number", "L-1")]);
    for elsewhere in ["G42.1 D1.6 L2", "G19 G42.1 D1.6 L2", "G18 G42 D1 L2"] {
        check_bad("rs274", elsewhere, &[("syntax", "L2")]);
    }
}

#[test]
fn s17_d_is_modal_on_the_840c_and_may_stand_before() {
    check("sinumerik_840c", "D3\nG41", &["G43 H3", "radius of offset 3", "select left"]);
    check("sinumerik_840c", "G41 D07", &["G43 H7", "radius of offset 7", "select left"]);
}

#[test]
fn s22_s29_n06_d0_deselects_or_only_suspends() {
    check(
        "sinumerik_840c",
        "G41 D0\nD2\nG40",
        &["G43 H2", "radius of offset 2", "select left", "cancel"],
    );
    let off = ["radius of offset 1", "select right", "cancel"];
    // D selects the length too (S34), and D0 none.
    let length = ["G43 H1", off[0], off[1], "G49", off[2], "G43 H1"];
    check("sinumerik_840c", "G42 D1\nD0\nD1", &length);
    let again = [&off[..], &off[..2]].concat();
    check("nct", "G42 D1\nD0\nD1", &again);
    check("sinumerik_840c", "D1\nG40\nD0\nD2", &["G43 H1", "G49", "G43 H2"]);
}

#[test]
fn s13_s15_approach_words_go_with_the_selection_and_are_not_modal() {
    check(
        "sinumerik_840c",
        "D1 G41 G456\nG42\nG40 G455",
        &["G43 H1", "radius of offset 1", "select left normal", "select right", "cancel corner"],
    );
}

#[test]
fn s27_s28_forbidden_words_are_named_with_the_line_that_needs_g40() {
    let loaded = load_as("sinumerik_840c", "F1 D1\nG41 G1 X1 Y1\nG55\nG40 X0\nG55");
    assert_eq!(loaded.findings.iter().filter(|found| found.is_error()).count(), 1);
    let found = &loaded.findings[0];
    assert_eq!((found.source.line, found.other.map(|other| other.line)), (3, Some(2)));
    assert!(found.message.contains("G55") && found.help.contains("G40"), "{found:?}");
}

#[test]
fn h_is_an_auxiliary_function_on_the_840c_and_a_length_on_rs274() {
    check("sinumerik_840c", "H1", &["H1"]);
    check("rs274", "G43 H1", &["G43 H1"]);
    check_bad("rs274", "H1", &[("syntax", "H1")]);
}

#[test]
fn s58_stops_and_m18_come_after_the_motion_of_their_block() {
    check("sinumerik_840c", "G0 X1 M18 M45", &["M45", "rapid X1 Y0 Z0 named X", "M18"]);
    check("rs274", "G0 X1 M0", &["rapid X1 Y0 Z0 named X", "M0"]);
}

#[test]
fn a_profile_whose_words_are_no_words_refuses_everything() {
    let mut profile = profile("rs274");
    profile.forbidden_under_compensation.words.push("home".into());
    let loaded = load(b"M2", &profile, &LoadOptions::default());
    assert!(!loaded.is_accepted());
    assert!(loaded.findings[0].message.contains("`home`"));
}

#[test]
fn a_single_block_needs_no_end_and_is_exactly_one() {
    let options =
        LoadOptions { start: [1.0, 2.0, 3.0], is_single_block: true, ..LoadOptions::default() };
    let read = |text: &str| load(text.as_bytes(), &profile("rs274"), &options);
    let loaded = read("G91 G1 X10 F200\r\n");
    assert!(loaded.findings.is_empty(), "{:?}", loaded.findings);
    let events: Vec<String> = loaded.contour.events.iter().map(canonical::event_text).collect();
    assert_eq!(events.len(), 1);
    assert!(events[0].contains("11"), "{events:?}");
    for (text, part) in [
        ("", "no block to run"),
        ("(a remark)", "no block to run"),
        ("G0 X1\nG0 X2", "2 lines are not a single block"),
    ] {
        let loaded = read(text);
        assert!(!loaded.is_accepted(), "{text:?}");
        assert!(loaded.findings[0].message.contains(part), "{:?}", loaded.findings);
    }
}

#[test]
fn polar_moves_of_the_840c_keep_pole_radius_and_angle() {
    check(
        "sinumerik_840c",
        "G11 X10 Y20 B5 A90 F100\nA180\nG91 A-90 X1\nG90 G10 U10 A0 Z3",
        &[
            "line X10 Y25 Z0 F100 named XY",
            "line X5 Y20 Z0 F100 named XY",
            "line X11 Y25 Z0 F100 named XY",
            "rapid X21 Y20 Z3 named XYZ",
        ],
    );
    check(
        "sinumerik_840c",
        "G18 G11 Z10 X20 B5 A90 F100",
        &["plane zx", "line X25 Y0 Z10 F100 named XZ"],
    );
    check_bad("sinumerik_840c", "G11 B5 A90 F100", &[("missing_word", "G11 B5 A90 F100")]);
    check_bad("sinumerik_840c", "G11 X0 Y0 A90 F100", &[("missing_word", "G11 X0 Y0 A90 F100")]);
    check_bad("sinumerik_840c", "G11 X0 Y0 B-5 A90 F100", &[("bad_number", "B-5")]);
}

#[test]
fn g16_of_the_840c_names_the_axes_of_the_plane() {
    check("sinumerik_840c", "G16 Z X", &["plane zx"]);
    check("sinumerik_840c", "G16 Y Z X", &["plane yz"]);
    check("sinumerik_840c", "G18\nG16 X Y", &["plane zx", "plane xy"]);
    check_bad("sinumerik_840c", "G16 Y X", &[("plane", "G16")]);
    check_bad("sinumerik_840c", "G16", &[("plane", "G16")]);
}
