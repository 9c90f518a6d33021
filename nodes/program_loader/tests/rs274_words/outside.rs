//! What was found beside LinuxCNC's interpreter, and in programs that other controls' posts write.

use super::*;
use cnc_msgs::contour::{Action, ContourEvent, ContourEventKind, Motion, MotionClass};
use cnc_msgs::finding::Finding;

/// The help of the first error.
fn help(text: &str) -> String {
    let loaded = read(text);
    let first = loaded.findings.iter().find(|it| it.is_error()).expect("an error");
    first.help.clone()
}

#[test]
fn a_step_in_a_cycle_that_has_none_is_refused() {
    for number in [81, 82, 85, 89] {
        let text = format!("F100 G0 X0 Y0 Z5\nG{number} X1 Z-1 R1 P1 Q2\nM2");
        let text = if matches!(number, 82 | 89) { text } else { text.replace(" P1", "") };
        let message = format!("G{number} goes down in one step: nothing uses Q2");
        check_bad(&[(&text, &[("Q2", &message)])]);
    }
    // A step stays in force, and another cycle in between does not need it.
    let text = "F100 G0 X0 Y0 Z5\nG83 X0 Z-2 R1 Q1.5\nX1 Q2\nM2";
    assert!(read(text).is_accepted());
    assert!(!read("F100 G0 X0 Y0 Z5\nG81 X1 Z-1 R1\nX2 Q2\nM2").is_accepted());
}

#[test]
fn whole_numbers_bear_the_noise_of_a_computation() {
    check(&[
        ("T[0.1*3*10]\nM2", "T3; M2", &[]),
        ("M64 P[0.7/0.1]\nM2", "M64 P6.999999999999999; M2", &[]),
    ]);
    let drill = "F100 G0 X0 Y0 Z5\nG91 G81 X0.1 Z-3 R-3 L[0.7/0.1]\nM2";
    assert_eq!(read(drill).contour.events.len(), 1 + 7 * 4 + 1);
    assert!(read("G21 F100\nG0 X0 Y0\nG2 X10 Y0 I5 P[0.1*3*10]\nM2").is_accepted());
    check_bad(&[(
        "#1=7.5\nT[#1]\nM2",
        &[("T[#1]", "T[#1] (7.5) is not a whole number of at most eight digits")],
    )]);
}

#[test]
fn what_has_no_effect_is_reported_once_with_its_first_place_and_how_often_it_stands_there() {
    let warnings = |text: &str, block_delete: bool| -> Vec<String> {
        let options = LoadOptions { block_delete, ..LoadOptions::default() };
        let loaded = load(text.as_bytes(), &profile("rs274"), &options);
        assert!(loaded.is_accepted(), "{:?}", loaded.findings);
        let shown = |it: &Finding| {
            let message = it.message.split(':').next().unwrap_or_default();
            format!("{}+{} {message}", it.source.line, it.source.column)
        };
        loaded.findings.iter().map(shown).collect()
    };
    let path = "G17 G64 P0.1\nG61\no1 repeat [3]\nG064 G0 X1\no1 endrepeat\nG61.1\nM2";
    assert_eq!(
        warnings(path, false),
        [
            "1+5 G64 has no effect (4 times in this program)",
            "2+1 G61 has no effect",
            "6+1 G61.1 has no effect"
        ]
    );
    let optional = "/ G0 X1\n  /N2 G0 X2\nG0 X3\nM2";
    assert_eq!(warnings(optional, false), ["1+1 / has no effect (2 times in this program)"]);
    assert_eq!(warnings(optional, true), ["1+1 this line has no effect (2 times in this program)"]);
    assert_eq!(
        warnings("G10 L0\nG10 L0\nM2", false),
        ["1+5 L0 has no effect (2 times in this program)"]
    );
    let lathe =
        "o1 sub\nG0 X0 Z0 F5\nG1 Z-5 F9 S7\nX9\no1 endsub\nF100 G18 G0 X10 Z1\nG71 Q1 I1\nM2";
    assert_eq!(
        warnings(lathe, false),
        ["2+10 F has no effect (2 times in this program)", "3+11 S has no effect"]
    );
    // G98 holds anyway; G99 is for cycles, and for whoever reads it.
    for (text, expected) in [
        ("G98\nG0 X1\nM2", &[][..]),
        ("G0 X1\nG99\nG0 X2\nG99\nM2", &["2+1 G99 has no effect (2 times in this program)"]),
        ("G99\nF100 G0 X0 Y0 Z5\nG81 X1 Y1 Z-1 R1\nM2", &[]),
        ("G99\n#1=#<_retract_r_plane>\nM2", &[]),
        // What follows is read while the run waits.
        (
            "G99\nG0 Z5\nG38.2 Z-9 F50\nG0 Z[#5063+5]\nG81 X1 Y1 Z-1 R1 F100\nM2",
            &["4+1 what follows needs the result of a probe or of M66"],
        ),
        ("M66 P0 L0 Q5\nM66 P1 Q3\nM2", &["1+11 Q has no effect (2 times in this program)"]),
        ("M66 E1 Q3\nM2", &["1+8 Q has no effect"]),
        ("M66 P0 L0\nM66 P0 L0 Q0\nM66 P0 L3 Q5\nM2", &[]),
    ] {
        assert_eq!(warnings(text, false), expected, "{text}");
    }
    // One that is refused has other troubles, and what holds anyway is none.
    let loaded = read("G64\nG0 X\nM2");
    assert!(loaded.findings.iter().all(|it| it.is_error()), "{:?}", loaded.findings);
    assert!(warnings("G17 G40 G49 G80 G90 G94 G97 G98\nM2", false).is_empty());
}

#[test]
fn a_feed_faster_than_any_machine_is_that_of_the_fastest_and_said_once() {
    check(&[(
        "F9991300\nG1 X1\nF1e9 X2\nF100 X3\nM2".replace("1e9", "1000000000").as_str(),
        "line X1 Y0 Z0 F1000000 named X; line X2 Y0 Z0 F1000000 named X; line X3 Y0 Z0 F100 named X; M2",
        &["F9991300 is faster than any machine: F is at most 1000000 mm/min"],
    )]);
}

#[test]
fn an_offset_of_g52_is_in_force_with_zero_too() {
    let text = "(DEBUG, %d#5210)\nG52 X2\n(DEBUG, %d#5210)\nG52 X0\n(DEBUG, %d#5210)\nG92.2\n(DEBUG, %d#5210)\nM2";
    check(&[(text, "(MSG, 0); (MSG, 1); (MSG, 1); (MSG, 0); M2", &[])]);
}

#[test]
fn a_step_that_fits_leaves_no_cut_of_air() {
    // 0.3 in are not three times 0.1 in.
    let feeds = |text: &str| {
        let loaded = read(text);
        assert!(loaded.is_accepted(), "{:?}", loaded.findings);
        let is_feed = |it: &&ContourEvent| {
            matches!(it.kind, ContourEventKind::Motion(Motion { class: MotionClass::Feed, .. }))
        };
        loaded.contour.events.iter().filter(is_feed).count()
    };
    assert_eq!(feeds("G20 F10 G0 X0 Y0 Z1\nG83 X1 Y1 Z0.2 R0.5 Q0.1\nM2"), 3);
    assert_eq!(feeds("G20 F10 G0 X0 Y0 Z1\nG73 X1 Y1 Z-0.7 R0.5 Q0.15\nM2"), 8);
}

#[test]
fn half_a_pass_is_rounded_to_the_even_number() {
    for (passes, moves) in [("0.5", 0), ("1.5", 2), ("2.5", 2), ("2.6", 3)] {
        let text = format!("G91 G0 X0\no1 repeat [{passes}]\nG0 X1\no1 endrepeat\nM2");
        assert_eq!(read(&text).contour.events.len(), 2 + moves, "{passes}");
    }
}

#[test]
fn an_abort_shows_values() {
    check_bad(&[(
        "#1=5\n(ABORT, no tool %d#1)\nM2",
        &[("(ABORT, no tool %d#1)", "the program ends itself here: no tool 5")],
    )]);
}

#[test]
fn words_of_other_controls_are_answered_with_what_there_is_here() {
    for (text, says) in [
        ("G68 X0 Y0 R30\nM2", "G10 L2 P R"),
        ("F100 G31 Z-5\nM2", "G38.2"),
        ("G54.1 P3\nM2", "G59.3"),
        ("G65 P100\nM2", "call"),
        ("M10\nM2", "M64"),
        ("G5.1 Q1\nM2", "setting of another control"),
        ("G0 X1.5E-5\nM2", "0.00001 instead of 1e-5"),
        ("G53 G90 G40\nM2", "delete G53"),
        ("o1 sub\no1 endsub\no1 call 5\nM2", "[5]"),
        ("o<pocket> call\nM2", "put pocket.ngc into a folder"),
        ("o<../x> call\nM2", "small letters"),
        ("M98 P7\nM2", "7.ngc"),
    ] {
        assert!(help(text).contains(says), "{text}: {}", help(text));
    }
}

#[test]
fn an_error_of_a_word_brings_no_second_one_for_the_axes_after_it() {
    check_bad(&[("G04 X1.\nM2", &[("G04", "G04 without a time")])]);
}

#[test]
fn a_piece_of_a_curve_counts_as_the_moves_that_take_as_long() {
    let is_accepted = |body: &str| {
        let text = format!("F100 G0 X0 Y0\no1 repeat [100]\n{body}\no1 endrepeat\nM2");
        let mut options = LoadOptions::default();
        options.flow.blocks_max = 2_000;
        let loaded = load(text.as_bytes(), &profile("rs274"), &options);
        let is_bounded = |it: &Finding| it.message.contains("blocks have been executed");
        assert!(loaded.findings.iter().all(is_bounded), "{:?}", loaded.findings);
        loaded.is_accepted()
    };
    assert!(is_accepted("G1 X1\nG1 X0"));
    assert!(is_accepted("G81 X1 Z-1 R1 L4"));
    // Some eight pieces of order 4 in each pass.
    assert!(!is_accepted("G5 X100 Y0 I30 J300 P-30 Q-300\nG0 X0 Y0"));
}

#[test]
fn a_file_of_a_program_is_not_written_and_that_is_said_once() {
    let loaded = read("(PROBEOPEN a.txt)\n(PROBECLOSE)\n(LOGOPEN, b.txt)\nM2");
    let found: Vec<&str> = loaded.findings.iter().map(|it| it.message.as_str()).collect();
    assert!(matches!(found[..], [text] if text.starts_with("no file is written")), "{found:?}");
}

#[test]
fn incremental_moves_go_by_so_much_from_wherever_the_tool_is() {
    let relative = |text: &str| -> String {
        let loaded = read(text);
        assert!(loaded.is_accepted(), "{text}: {:?}", loaded.findings);
        let found = loaded.contour.events.iter().filter_map(|event| match event.kind {
            ContourEventKind::Action(Action::Relative { axes }) => Some(axes.letters()),
            _ => None,
        });
        found.collect::<Vec<_>>().join("; ")
    };
    for (before, by_so_much) in [
        ("G0 Z5", "X"),
        ("G0 X0 Z5\nG53 G0 X0 Z0", "XZ; X"),
        ("G0 X0 Z5\nG28 X1", "X; X"),
        ("G0 X0 Z5\nG55", "XZ; X"),
        ("G0 X0 Z5\nG10 L2 P1 Z7", "Z"),
        ("G0 X0 Z5\nG43 H1", "Z"),
        ("G0 X0 Y0 Z5\nG10 L2 P1 R30 X2 Y3", "XY; XY"),
        ("T1 M6\nG53 G0 Z0", "Z"),
    ] {
        let text = format!("{before}\nG91 G0 X1 Z-1\nG90 Z2\nG91 G1 X3 F100\nG90 G0 X0 Y0\nM2");
        let found = relative(&text);
        let wanted = if before == "G0 Z5" { "" } else { by_so_much };
        assert_eq!(found, wanted, "{before}");
    }
    // A tool length probe that is begun in the machine.
    assert_eq!(relative("F100 G53 G0 X5 Y5 Z-1\nG91 G38.2 Z-50\nG0 Z2\nG90 G0 Z5\nM2"), "Z; Z");
    // Where it ends is no place of the work system.
    let bounds = |text| read(text).bounds.expect("a move");
    let lost = bounds("G0 X0 Z5\nG53 G0 Z0\nG91 G0 X1 Z-90\nM2");
    assert_eq!((lost.min[2], lost.max[0]), (5.0, 1.0));
    // A tool change may leave the tool elsewhere.
    for text in ["G53 G0 Z0\nT1 M6\nG91 G0 Z-1\nM2", "G55\nT1 M6 G91 G0 Z-1\nM2"] {
        assert!(!read(text).is_accepted(), "{text}");
    }
}

#[test]
fn under_g93_a_move_relies_on_where_it_begins() {
    let message = "this block starts from where Z is, which is not known since G53 in line 2";
    check_bad(&[("G0 Z5\nG53 G0 Z0\nG93 G1 Z-5 F2\nM2", &[("G93 G1 Z-5 F2", message)])]);
    let loaded = read("G93 G1 Z-5 F2\nM2");
    assert!(loaded.is_accepted() && loaded.contour.assumed_axes.contains(2));
    assert!(read("G53 G0 Z0\nG91 G93 G1 Z-5 F2\nM2").is_accepted());
}
