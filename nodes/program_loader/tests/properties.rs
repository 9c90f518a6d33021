//! Properties that hold for every program.

mod common;

use cnc_msgs::contour::{ContourEvent, ContourEventKind, ProgrammedContour};
use cnc_msgs::geometry::Shape;
use common::profile;
use program_loader::limits::FlowLimits;
use program_loader::{LoadOptions, Loaded, limits, load, render};
use proptest::prelude::*;
use proptest::sample::select;
use settings::Control;

fn load_as(control: &str, text: &[u8]) -> Loaded {
    // Loops without an end are found sooner.
    let flow = FlowLimits { blocks_max: 10_000, depth_max: 20, ..FlowLimits::default() };
    load(text, &profile(control), &LoadOptions { flow, ..LoadOptions::default() })
}

/// Every finding has a place in the text, and can be drawn.
fn check_places(text: &[u8], loaded: &Loaded) {
    let shown = String::from_utf8_lossy(text);
    let lines: Vec<&str> = shown.split('\n').collect();
    assert!(loaded.findings.len() <= limits::DIAGNOSTICS_MAX + 1);
    for found in &loaded.findings {
        let source = found.source;
        if source.line == 0 {
            continue;
        }
        assert!(source.line <= loaded.line_count.max(1), "{found:?}");
        let length = lines[source.line as usize - 1].chars().count();
        let end = usize::from(source.column) + usize::from(source.length);
        assert!(source.column >= 1 && end <= length + 1, "{found:?} in {length}");
        assert!(!found.message.is_empty() && !found.help.is_empty(), "{found:?}");
    }
    let drawn = render::render("junk", &shown, &loaded.findings, false);
    assert_eq!(drawn.is_empty(), loaded.findings.is_empty());
}

fn check_numbers(contour: &ProgrammedContour) {
    for event in &contour.events {
        if let ContourEventKind::Motion(motion) = event.kind {
            assert!(motion.end.iter().all(|value| value.is_finite()), "{event:?}");
            if let Shape::Arc(arc) = motion.shape {
                assert!(arc.center.iter().all(|value| value.is_finite()), "{event:?}");
            }
        }
    }
}

/// Random text made of the parts of programs.
fn nearly_a_program() -> impl Strategy<Value = String> {
    let word = prop_oneof![
        "[GMXYZIJKRFSTDHNPQLAO/@%]-?[0-9]{1,3}(\\.[0-9]{0,3})? ?",
        "G(0|1|2|3|4|17|18|19|20|21|28|30|40|41|42|43|49|53|54|55|80|90|91|90\\.1|91\\.1|41\\.1) ?",
        "G(450|451|455|456|81|92|70|71) ?",
        "[XYZIJK]-?[0-9]{1,3} ?",
        "(F100|S100|D1|D0|H1|P2|R10|M3|M6|M8|M30|T1) ?",
        "(MoveLinear|MoveCw|MoveRapid|Home|CutterCompensationSetAxes|Dwell|Foo)\\(?\\[?[XYZ1-9]?,? ?[XY]?",
        "\\]?,? ?\\[?[0-9XY$]?,? ?[0-9]?\\]?\\)? ?",
        "(G38|G39|G43 P1|G44 X Y|//|/\\*|\\*/|T010203) ?",
        "(o1|o2|o<a>|O100|o\\[#1\\]) ?(sub|endsub|call|return|if|elseif|else|endif|while|endwhile|do|repeat|endrepeat|break|continue)? ?(\\[#?[0-9]\\])?\n?",
        "(#[1-9]|#<a>|#<_b>|##1|#5420)(=|[XYZ +*/])",
        "[XYZRQPL=]?-?\\[([0-9#(]{1,3}( ?(\\+|-|\\*\\*|/|MOD|EQ|AND|LT) ?)?){1,3}\\]",
        "(SIN|SQRT|ACOS|LN|EXISTS|ATAN)\\[[#0-9<a>-]{1,4}\\](/\\[[0-9]\\])? ?",
        "(G(73|81|82|83|84|85|86|88|89|98|99) |R2 |Q1 |L2 |P1 |G(10|52|92|92\\.1|93|94|95|7|8) ?|M(98|99|60) ?)",
        "[\\(\\);\\[\\]#$=<> \tXG\r\u{fc}.+-]",
    ];
    proptest::collection::vec(prop_oneof![9 => word, 3 => Just("\n".to_owned())], 0..120)
        .prop_map(|words| words.concat())
}

/// Checks that two contours are equal but for rounding: kinds, places, positions.
fn same(one: &ProgrammedContour, other: &ProgrammedContour) -> Result<(), TestCaseError> {
    prop_assert_eq!(one.events.len(), other.events.len());
    for (one, other) in one.events.iter().zip(&other.events) {
        let (ContourEventKind::Motion(a), ContourEventKind::Motion(b)) = (one.kind, other.kind)
        else {
            prop_assert_eq!(one.kind, other.kind);
            continue;
        };
        prop_assert_eq!(a.class, b.class);
        prop_assert_eq!(a.axes, b.axes);
        prop_assert!((a.feed_mm_per_min - b.feed_mm_per_min).abs() < 1e-6);
        let near = |p: [f64; 3], q: [f64; 3]| (0..3).all(|axis| (p[axis] - q[axis]).abs() < 1e-6);
        prop_assert!(near(a.end, b.end), "{:?} {:?}", a, b);
        match (a.shape, b.shape) {
            (Shape::Line, Shape::Line) => {}
            (Shape::Arc(a), Shape::Arc(b)) => {
                prop_assert!(near(a.center, b.center));
                prop_assert_eq!((a.plane, a.clockwise, a.turns), (b.plane, b.clockwise, b.turns));
            }
            shapes => prop_assert!(false, "{:?}", shapes),
        }
    }
    Ok(())
}

/// One move: kind, target in thousandths of a millimetre.
type ProgrammedMove = (u8, [i32; 3]);

fn steps() -> impl Strategy<Value = Vec<ProgrammedMove>> {
    proptest::collection::vec((0_u8..4, proptest::array::uniform3(-90_000..90_000_i32)), 1..40)
}

/// A program of lines, rapids and half circles, with lengths divided by `unit`.
fn program(steps: &[ProgrammedMove], unit: f64, incremental: bool) -> String {
    let mut text = String::from(if unit == 1.0 { "G21" } else { "G20" });
    text += &format!(" G17 G90\nG0 X0 Y0 Z0 F{:.12}\n", 250.0 / unit);
    text += if incremental { "G91\n" } else { "" };
    let mut at = [0.0_f64; 3];
    for &(kind, target) in steps {
        let target = target.map(|value| f64::from(value) / 1000.0);
        let word: [f64; 3] = std::array::from_fn(|axis| {
            (if incremental { target[axis] - at[axis] } else { target[axis] }) / unit
        });
        let half: [f64; 2] = std::array::from_fn(|axis| (target[axis] - at[axis]) / 2.0 / unit);
        text += &format!("G{kind} X{:.12} Y{:.12}", word[0], word[1]);
        if kind < 2 {
            text += &format!(" Z{:.12}\n", word[2]);
            at[2] = target[2];
        } else if half[0].hypot(half[1]) * unit < 0.1 {
            // No arc of this size: use a line instead.
            let digit = text.rfind('G').expect("the word just written");
            text.replace_range(digit..digit + 2, "G1");
            text.push('\n');
        } else {
            text += &format!(" I{:.12} J{:.12}\n", half[0], half[1]);
        }
        (at[0], at[1]) = (target[0], target[1]);
    }
    text + "M2\n"
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn any_bytes_are_read_or_refused_at_a_place_in_the_text(
        text in proptest::collection::vec(any::<u8>(), 0..600), control in select(Control::ALL.to_vec())
    ) {
        let loaded = load_as(control.name(), &text);
        check_places(&text, &loaded);
        check_numbers(&loaded.contour);
    }

    #[test]
    fn text_like_a_program_is_read_or_rejected_at_a_place_in_the_text(
        text in nearly_a_program(), control in select(Control::ALL.to_vec())
    ) {
        let loaded = load_as(control.name(), text.as_bytes());
        check_places(text.as_bytes(), &loaded);
        check_numbers(&loaded.contour);
        prop_assert!(loaded.is_accepted() || loaded.contour.events.is_empty());
    }

    #[test]
    fn the_same_program_in_inches_is_the_same_contour(steps in steps()) {
        let metric = load_as("rs274", program(&steps, 1.0, false).as_bytes());
        let inch = load_as("rs274", program(&steps, 25.4, false).as_bytes());
        prop_assert!(metric.is_accepted(), "{:?}", metric.findings);
        prop_assert!(inch.is_accepted(), "{:?}", inch.findings);
        same(&metric.contour, &inch.contour)?;
    }

    #[test]
    fn the_same_program_in_increments_is_the_same_contour(steps in steps()) {
        let absolute = load_as("rs274", program(&steps, 1.0, false).as_bytes());
        let increments = load_as("rs274", program(&steps, 1.0, true).as_bytes());
        prop_assert!(absolute.is_accepted(), "{:?}", absolute.findings);
        prop_assert!(increments.is_accepted(), "{:?}", increments.findings);
        same(&absolute.contour, &increments.contour)?;
    }

    #[test]
    fn spelling_does_not_change_the_contour(steps in steps(), numbers in any::<bool>()) {
        let plain = program(&steps, 1.0, false);
        let mut spelt = String::from("\u{feff}%\r\n( comment )\r\n");
        for (index, line) in plain.lines().enumerate() {
            if numbers {
                spelt += &format!("n{} ", 10 * index);
            }
            spelt += &line.to_lowercase().replace(' ', "").replace('x', "  X \t").replace("g1", "g 01");
            spelt += "; (remark\r\n\r\n";
        }
        let one = load_as("rs274", plain.as_bytes());
        let other = load_as("rs274", spelt.as_bytes());
        prop_assert!(other.is_accepted(), "{:?}", other.findings);
        let kinds = |contour: &ProgrammedContour| -> Vec<ContourEventKind> {
            contour.events.iter().map(|event: &ContourEvent| event.kind).collect()
        };
        prop_assert_eq!(kinds(&one.contour), kinds(&other.contour));
    }
}

#[test]
fn a_line_of_ten_megabytes_is_one_error() {
    for line in [vec![b'X'; 10 << 20], b"G1 X1 ".repeat(10 << 17), vec![b'('; 10 << 20]] {
        let loaded = load_as("rs274", &line);
        assert_eq!(loaded.findings.iter().filter(|found| found.is_error()).count(), 1);
        check_places(&line, &loaded);
    }
}

#[test]
fn a_million_wrong_lines_are_a_thousand_findings_and_a_count() {
    let text = b"G777\n".repeat(1_000_000);
    let loaded = load_as("rs274", &text);
    assert_eq!(loaded.line_count, 1_000_000);
    assert_eq!(loaded.findings.len(), limits::DIAGNOSTICS_MAX + 1);
    let note = &loaded.findings[limits::DIAGNOSTICS_MAX];
    assert!(
        note.is_error() && note.message.starts_with("999000 more")
            || note.message.starts_with("999001 more"),
        "{}",
        note.message
    );
}

#[test]
fn utf_16_text_is_named_as_such() {
    let text: Vec<u8> = std::iter::once(0xFEFF_u16)
        .chain("G0 X1\n".encode_utf16())
        .flat_map(u16::to_le_bytes)
        .collect();
    let loaded = load_as("rs274", &text);
    assert_eq!(loaded.findings.len(), 1);
    assert!(loaded.findings[0].message.contains("UTF-16"));
}
