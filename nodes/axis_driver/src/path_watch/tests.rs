//! What fits and what does not, without a controller.

use super::*;

fn board() -> Board {
    Board {
        planner_blocks: Some(15),
        arc_tolerance_mm: 0.002,
        steps_per_mm: [Some(250.0); 3],
        further_steps: [0.01; 6],
        units: ReportUnits::Millimetres,
        rates: Rates([5_000.0; 3]),
        speeds: [0.0, 24_000.0],
    }
}

const ZERO: Position = [-100.0, -50.0, -10.0];

/// G54 is at [`ZERO`], where the tool stands; G55 is 10 mm farther along X.
fn watch() -> PathWatch {
    let mut systems = [None; 9];
    systems[0] = Some(ZERO);
    systems[1] = Some([-90.0, -50.0, -10.0]);
    let frame = Frame {
        systems,
        in_force: Some(ZERO),
        system: Some(1),
        tool_length_mm: Some(0.0),
        ..Frame::default()
    };
    let mut watch = PathWatch::new(board(), frame, Some(ZERO), FurtherAxes::NONE);
    send(&mut watch, &["G21G90G94G17G40G49G54"]);
    watch.on_answer();
    watch
}

fn send(watch: &mut PathWatch, lines: &[&str]) {
    for text in lines {
        let source_line = watch.lines_sent as u32;
        watch.on_sent(text, Culprit { source_line, ..Culprit::default() });
    }
}

/// A report of a place in the frame of G54.
fn at(place: Position) -> Seen {
    let position = Some([0, 1, 2].map(|axis| place[axis] + ZERO[axis]));
    Seen { position, feed_override: 1.0, ..Seen::default() }
}

#[test]
fn the_tool_is_on_what_was_sent_and_never_goes_back() {
    let mut watch = watch();
    send(&mut watch, &["G1X10F600", "Y10", "G2X20Y20I10", "G0Z5", "X0Y0"]);
    let arc = |degrees: f64| {
        let angle = f64::to_radians(180.0 - degrees);
        [20.0 + 10.0 * angle.cos(), 10.0 + 10.0 * angle.sin(), 0.0]
    };
    for place in [
        [0.0; 3],
        [4.0, 0.0, 0.0],
        [10.0, 3.0, 0.0],
        arc(30.0),
        [20.0, 20.0, 2.0],
        [20.0, 20.0, 2.5],
    ] {
        assert_eq!(watch.judge(&at(place)), None, "{place:?}");
    }
    let mut back = watch.clone();
    let deviation = back.judge(&at(arc(30.0))).expect("it was past that");
    assert_eq!(deviation.culprit().source_line, 5);
    for off in [[20.0, 20.2, 3.0], [21.0, 20.0, 2.0], [10.0, 11.0, 5.0]] {
        assert!(watch.clone().judge(&at(off)).is_some(), "{off:?}");
    }
    assert_eq!(watch.judge(&at([10.0, 10.0, 5.0])), None);
}

#[test]
fn the_text_names_line_place_and_distance() {
    let mut watch = watch();
    send(&mut watch, &["G1X10F600"]);
    let deviation = watch.judge(&at([4.0, 0.5, 0.0])).expect("it is off");
    assert_eq!(
        deviation.to_string(),
        "at line 1 the tool is 0.500 mm off the path: at X-96.000 Y-49.500 Z-10.000 in the \
         machine frame, where X-96.000 Y-50.000 Z-10.000 is the nearest place of the path"
    );
}

#[test]
fn where_the_path_comes_by_again_the_line_that_is_under_way_is_named() {
    let named = |watch: &PathWatch, place: Position| {
        let deviation = watch.clone().judge(&at(place)).expect("it is off");
        deviation.culprit().source_line
    };
    let mut rounds = watch();
    for _ in 0..4 {
        send(&mut rounds, &["G1X10F600", "Y10", "X0", "Y0"]);
    }
    // Once round, and on along line 5.
    for [x, y] in [[5.0, 0.0], [10.0, 5.0], [5.0, 10.0], [0.0, 5.0], [5.0, 0.0]] {
        assert_eq!(rounds.judge(&at([x, y, 0.0])), None, "{x} {y}");
    }
    // Off the line, beyond its end, and off the next ones.
    for (x, y, line) in [(6.0, -1.0, 5), (11.0, 0.0, 6), (11.0, 5.0, 6), (5.0, 11.0, 7)] {
        assert_eq!(named(&rounds, [x, y, 0.0]), line, "{x} {y}");
    }
    // To and fro.
    let mut pecks = watch();
    send(&mut pecks, &["G1X40F600", "X0", "X40", "X0"]);
    assert_eq!(pecks.judge(&at([5.0, 0.0, 0.0])), None);
    for (x, y, line) in [(6.0, 1.0, 1), (41.0, 0.0, 2)] {
        assert_eq!(named(&pecks, [x, y, 0.0]), line, "{x} {y}");
    }
}

#[test]
fn one_wrong_report_that_lies_ahead_on_the_path_is_not_held_against_the_next() {
    let mut watch = watch();
    send(&mut watch, &["G1X40F600", "X0", "X40"]);
    for x in [1.0, 12.0, 18.0] {
        assert_eq!(watch.judge(&at([x, 0.0, 0.0])), None, "{x}");
    }
    // It shows 18 and was at 13: what follows fits the way back, and then does not any more.
    for x in [13.0, 14.0, 15.0, 19.0, 30.0, 40.0, 30.0, 5.0] {
        assert_eq!(watch.judge(&at([x, 0.0, 0.0])), None, "{x}");
    }
    // Nor is what one report says of the planner.
    let seen = Seen { blocks_in_use: Some(0), ..at([4.0, 0.0, 0.0]) };
    assert_eq!(watch.judge(&seen), None);
    assert_eq!(watch.judge(&at([3.0, 0.0, 0.0])), None);
    assert!(watch.judge(&at([3.0, 1.0, 0.0])).is_some(), "off all of them");
    assert_eq!(watch.judge(&at([2.0, 0.0, 0.0])), None, "a misfit changes nothing");
}

#[test]
fn after_a_resume_the_offset_is_taken_when_no_line_may_have_changed_it() {
    let mut watch = watch();
    let shown = |offset: Position, x: f64| Seen { work_offset: Some(offset), ..at([x, 0.0, 0.0]) };
    let second = [-90.0, -50.0, -10.0];
    send(&mut watch, &["G1X10F600", "G55", "X10"]);
    watch.forgive();
    // The first one is read still; then G55 is in force.
    assert_eq!(watch.judge(&shown(ZERO, 3.0)), None);
    watch.on_answer();
    watch.on_answer();
    assert_eq!(watch.judge(&shown(second, 12.0)), None);
    assert_eq!(watch.judge(&shown(second, 14.0)), None);
    assert!(watch.judge(&shown(ZERO, 14.0)).is_some());
}

#[test]
fn the_feed_is_judged_where_the_place_is_not_known() {
    let mut watch = watch();
    watch.has_shown(None);
    send(&mut watch, &["G1X100F600"]);
    let fast = Seen { is_by_offset: true, feed_mm_per_min: Some(12_000.0), ..at([1.0, 7.0, 0.0]) };
    assert_eq!(watch.judge(&fast), None);
    assert_eq!(watch.judge(&fast), None);
    assert!(matches!(watch.judge(&fast), Some(Deviation::Feed { .. })));
}

#[test]
fn what_was_not_sent_yet_is_off_the_path() {
    let mut watch = watch();
    assert!(watch.judge(&at([1.0, 0.0, 0.0])).is_some());
    send(&mut watch, &["G1X10F600"]);
    assert_eq!(watch.clone().judge(&at([1.0, 0.0, 0.0])), None);
    assert!(watch.judge(&at([10.5, 0.0, 0.0])).is_some());
}

#[test]
fn old_lines_are_done_when_the_planner_cannot_hold_them() {
    let mut watch = watch();
    let lines: Vec<String> = (1..=40).map(|step| format!("G1X{step}F600")).collect();
    for line in &lines {
        send(&mut watch, &[line]);
        watch.on_answer();
    }
    // 15 blocks and those at the steps may be left.
    assert!(watch.clone().judge(&at([4.0, 0.0, 0.0])).is_some());
    assert_eq!(watch.judge(&at([9.5, 0.0, 0.0])), None);
    let seen = Seen { blocks_in_use: Some(2), ..at([9.6, 0.0, 0.0]) };
    assert!(watch.judge(&seen).is_some(), "reports say how many are left");
}

#[test]
fn frames_move_with_the_lines_that_select_and_set_them() {
    let mut watch = watch();
    send(&mut watch, &["G55", "G1X0Y0F600", "G43.1Z5", "Z0", "G10L2P2X-80Y-50Z-10", "X1"]);
    for place in [[5.0, 0.0, 0.0], [10.0, 0.0, 3.0], [15.0, 0.0, 5.0], [21.0, 0.0, 5.0]] {
        assert_eq!(watch.judge(&at(place)), None, "{place:?}");
    }
    assert_eq!(watch.stored(2), Some([-80.0, -50.0, -10.0]));
    send(&mut watch, &["G10L20P2X100", "G53G0Z0", "G49", "G54", "G1X0Y0Z0"]);
    assert_eq!(watch.stored(2), Some([-179.0, -50.0, -10.0]));
    for place in [[21.0, 0.0, 8.0], [21.0, 0.0, 10.0], [0.0; 3]] {
        assert_eq!(watch.judge(&at(place)), None, "{place:?}");
    }
}

#[test]
fn a_work_offset_that_no_line_selected_is_noticed_before_anything_moves_in_it() {
    let mut watch = watch();
    let shown = |offset: Position| Seen { work_offset: Some(offset), ..at([0.0; 3]) };
    assert_eq!(watch.judge(&shown(ZERO)), None);
    assert!(watch.clone().judge(&shown([-90.0, -50.0, -10.0])).is_some());
    send(&mut watch, &["G55"]);
    assert_eq!(watch.judge(&shown(ZERO)), None);
    assert_eq!(watch.judge(&shown([-90.0, -50.0, -10.0])), None);
    watch.on_answer();
    let deviation = watch.judge(&shown(ZERO)).expect("G54 is still in force");
    assert!(deviation.to_string().contains("work offset X-100.000"), "{deviation}");
}

#[test]
fn a_work_position_is_not_believed_before_its_offset_is_shown() {
    let mut watch = watch();
    send(&mut watch, &["G1X10F600", "G55"]);
    let odd = Seen { is_by_offset: true, ..at([-10.0, 0.0, 0.0]) };
    assert_eq!(watch.judge(&odd), None);
    watch.on_answer();
    watch.on_answer();
    assert_eq!(watch.judge(&odd), None);
    let shown = Seen { work_offset: Some([-90.0, -50.0, -10.0]), ..odd };
    assert!(watch.judge(&shown).is_some());
}

#[test]
fn a_feed_is_too_fast_where_no_line_asks_for_it() {
    let mut watch = watch();
    send(&mut watch, &["G1X100F600"]);
    let moving = |x: f64, feed: f64, percent: f64| Seen {
        feed_mm_per_min: Some(feed),
        feed_override: percent,
        ..at([x, 0.0, 0.0])
    };
    for x in [1.0, 2.0, 3.0, 4.0] {
        assert_eq!(watch.judge(&moving(x, 610.0, 1.0)), None);
    }
    for (x, feed) in [(5.0, 1200.0), (6.0, 1200.0), (7.0, 1200.0), (8.0, 900.0), (9.0, 600.0)] {
        assert_eq!(watch.judge(&moving(x, feed, 2.0)), None, "an override is allowed");
    }
    for x in [10.0, 11.0] {
        assert_eq!(watch.judge(&moving(x, 6_000.0, 1.0)), None);
    }
    let deviation = watch.judge(&moving(12.0, 6_000.0, 1.0)).expect("three in a row");
    assert!(deviation.to_string().contains("6000 mm/min; 1200 mm/min"), "{deviation}");
}

#[test]
fn a_thread_is_as_fast_as_its_spindle_may_turn() {
    let mut watch = watch();
    send(&mut watch, &["S600M3"]);
    watch.on_answer();
    send(&mut watch, &["G33X100K1.5"]);
    let moving = |x: f64, feed: f64| Seen { feed_mm_per_min: Some(feed), ..at([x, 0.0, 0.0]) };
    for x in [1.0, 2.0, 3.0, 4.0] {
        assert_eq!(watch.judge(&moving(x, 1_800.0)), None, "200 % of its speed");
    }
    let found: Vec<_> =
        (5..9).filter_map(|x| watch.judge(&moving(f64::from(x), 9_000.0))).collect();
    assert!(!found.is_empty() && found[0].to_string().contains("9000 mm/min"), "{found:?}");
}

#[test]
fn the_words_in_force_are_those_up_to_the_last_answer() {
    let mut watch = watch();
    let units = ReportUnits::Millimetres;
    let words =
        |motion: &str, feed: u32| format!("{motion} G54 G17 G21 G90 G94 M5 M9 T0 F{feed} S0");
    assert_eq!(watch.judge_words(&words("G0", 0), units), None);
    send(&mut watch, &["G1X10F600", "G0X20", "G1X30F900"]);
    watch.on_answer();
    assert_eq!(watch.judge_words(&words("G1", 600), units), None);
    assert!(watch.judge_words(&words("G1", 900), units).is_some());
    watch.on_answer();
    assert_eq!(watch.judge_words(&words("G0", 600), units), None);
    let deviation = watch.judge_words(&words("G1", 600), units).expect("G0 was sent");
    assert_eq!(deviation.to_string(), "at line 2 the controller has G1 in force; G0 was sent");
    watch.forgive();
    assert_eq!(watch.judge_words(&words("G1", 600), units), None);
}

#[test]
fn the_end_is_where_the_last_line_ends() {
    let mut watch = watch();
    send(&mut watch, &["G1X10F600", "Y5"]);
    assert_eq!(watch.judge(&at([4.0, 0.0, 0.0])), None);
    assert!(watch.clone().judge_end(at([10.0, 0.0, 0.0]).position, FurtherAxes::NONE).is_some());
    assert_eq!(watch.judge_end(at([10.0, 5.0, 0.0]).position, FurtherAxes::NONE), None);
    assert!(watch.judge(&at([10.0, 4.0, 0.0])).is_some(), "it stands");
}

#[test]
fn after_a_resume_what_is_under_way_may_be_anywhere_and_what_follows_may_not() {
    let mut watch = watch();
    send(&mut watch, &["G1X10F600"]);
    assert!(watch.judge(&at([4.0, 2.0, 0.0])).is_some());
    watch.forgive();
    assert_eq!(watch.judge(&at([5.0, 2.5, 0.0])), None);
    assert_eq!(watch.judge_end(at([10.0, 5.0, 0.0]).position, FurtherAxes::NONE), None);
    send(&mut watch, &["X20Y5"]);
    let shown = Seen { work_offset: Some(ZERO), ..at([15.0, 5.0, 0.0]) };
    assert_eq!(watch.judge(&shown), None);
    assert!(watch.judge(&at([15.0, 6.0, 0.0])).is_some());
}

#[test]
fn a_line_that_is_not_understood_may_go_anywhere_and_the_next_place_is_known_again() {
    let mut watch = watch();
    send(&mut watch, &["M6T2"]);
    assert_eq!(watch.judge(&at([40.0, 2.0, 9.0])), None);
    watch.on_answer();
    watch.begin_again(None, at([1.0, 1.0, 1.0]).position, FurtherAxes::NONE);
    assert!(watch.judge(&at([2.0, 1.0, 1.0])).is_some());
}

#[test]
fn a_further_axis_goes_with_its_line() {
    const A: usize = 0;
    let one = |value: f64| FurtherAxes::NONE.with(A, value);
    let mut frame = FurtherFrame { shift: one(0.0), ..FurtherFrame::default() };
    frame.systems[0] = one(-5.0);
    let systems = [Some(ZERO); 9];
    let tool_length_mm = Some(0.0);
    let frame = Frame { systems, tool_length_mm, further: frame, ..Frame::default() };
    let mut watch = PathWatch::new(board(), frame, Some(ZERO), one(-5.0));
    send(&mut watch, &["G21G90G94G17G40G49G54"]);
    watch.on_answer();
    let seen = |x: f64, a: f64| Seen { further: one(a), ..at([x, 0.0, 0.0]) };
    send(&mut watch, &["G1X10A90G93F10", "G0A180", "X0", "X10A0"]);
    for (x, a) in [(0.0, -5.0), (5.0, 40.0), (10.0, 85.0), (10.0, 120.0), (5.0, 175.0), (8.0, 31.0)]
    {
        assert_eq!(watch.judge(&seen(x, a)), None, "X{x} A{a}");
    }
    let deviation = watch.clone().judge(&seen(9.0, 175.0)).expect("A has to turn back");
    assert_eq!(
        deviation.to_string(),
        "at line 4 A is at 175.000 degrees in the machine frame, where the lines that were sent \
         have it between 12.479 and 13.521"
    );
    // It is there, and A is not.
    for _ in 0..4 {
        watch.on_answer();
    }
    let end = at([10.0, 0.0, 0.0]).position;
    let deviation = watch.clone().judge_end(end, one(0.0)).expect("A ends at -5");
    assert!(deviation.to_string().contains("A is at 0.000 degrees"), "{deviation}");
    assert_eq!(watch.judge_end(end, one(-5.0)), None);
    // What the operator goes on with is judged from the next word on.
    send(&mut watch, &["A90"]);
    assert!(watch.clone().judge(&seen(10.0, 200.0)).is_some());
    watch.forgive();
    let shown = Seen { work_offset: Some(ZERO), further_offset: one(-5.0), ..seen(10.0, 200.0) };
    watch.on_answer();
    for _ in 0..2 {
        assert_eq!(watch.judge(&shown), None);
    }
    send(&mut watch, &["X20", "A0"]);
    assert_eq!(watch.judge(&seen(15.0, 200.0)), None);
    for x in 21..60 {
        send(&mut watch, &[&format!("X{x}")]);
        watch.on_answer();
    }
    assert!(watch.judge(&seen(58.5, 200.0)).is_some());
}

#[test]
fn the_zero_of_a_further_axis_is_taken_from_a_report_when_no_line_may_have_changed_it() {
    let one = |value: f64| FurtherAxes::NONE.with(0, value);
    let mut watch = PathWatch::new(board(), Frame::default(), Some(ZERO), one(0.0));
    send(&mut watch, &["G90G54"]);
    let shown = Seen { further: one(0.0), further_offset: one(7.0), ..at([0.0; 3]) };
    watch.judge(&shown);
    send(&mut watch, &["A1"]);
    assert_eq!(watch.sent.further.get(0), None, "G54 has no answer yet");
    watch.on_answer();
    watch.judge(&Seen { further_offset: one(70.0), ..shown });
    watch.judge(&shown);
    send(&mut watch, &["A1"]);
    assert_eq!(watch.sent.further.get(0), None, "one of the two is damaged");
    watch.judge(&shown);
    send(&mut watch, &["A1"]);
    assert_eq!(watch.sent.further.get(0), Some(8.0));
    // A damaged offset is in force after a resume.
    watch.forgive();
    let other = Seen { work_offset: Some(ZERO), further_offset: one(20.0), ..shown };
    for _ in 0..3 {
        watch.on_answer();
        assert_eq!(watch.judge(&other), None);
    }
    send(&mut watch, &["A1"]);
    assert_eq!(watch.sent.further.get(0), Some(21.0));
}

#[test]
fn f_of_a_time_is_no_feed_after_the_words_were_forgotten() {
    let mut watch = watch();
    send(&mut watch, &["G93G1X10A90F50"]);
    watch.forget_words();
    send(&mut watch, &["X20A0F12.5", "G0Z5"]);
    for _ in 0..3 {
        watch.on_answer();
    }
    assert_eq!(watch.sent.said.feed, None);
}

#[test]
fn an_angle_that_follows_from_an_offset_is_not_believed_before_that_is_shown() {
    let one = |value: f64| FurtherAxes::NONE.with(0, value);
    let mut further = FurtherFrame { shift: one(0.0), ..FurtherFrame::default() };
    further.systems = [one(0.0); 9];
    let systems = [Some(ZERO); 9];
    let tool_length_mm = Some(0.0);
    let frame = Frame { systems, tool_length_mm, further, ..Frame::default() };
    let mut watch = PathWatch::new(board(), frame, Some(ZERO), one(0.0));
    send(&mut watch, &["G90G54", "G10L2P1A30", "G0A0"]);
    for _ in 0..3 {
        watch.on_answer();
    }
    let seen = |angle| Seen { is_by_offset: true, further: one(angle), ..at([0.0; 3]) };
    let shown =
        |angle, zero| Seen { work_offset: Some(ZERO), further_offset: one(zero), ..seen(angle) };
    let before = watch.judge(&shown(-30.0, 0.0)).expect("the offset from before");
    assert_eq!(
        before.to_string(),
        "before the first line the controller has the work offset A0.000 in force and not A30.000 \
         (machine frame)"
    );
    assert_eq!(watch.judge(&seen(-30.0)), None);
    assert_eq!(watch.judge(&shown(30.0, 30.0)), None);
    assert!(watch.judge(&seen(40.0)).is_some());
}

#[test]
fn an_offset_of_a_further_axis_that_no_line_has_set_is_noticed_before_it_moves_in_it() {
    let one = |value: f64| FurtherAxes::NONE.with(0, value);
    let mut further = FurtherFrame { shift: one(0.0), ..FurtherFrame::default() };
    (further.systems[0], further.systems[1]) = (one(0.0), one(360.0));
    let frame = Frame { further, ..Frame::default() };
    for is_by_offset in [false, true] {
        let mut watch = PathWatch::new(board(), frame.clone(), Some(ZERO), one(0.0));
        let shown = |zero| Seen { is_by_offset, further_offset: one(zero), ..at([0.0; 3]) };
        assert_eq!(watch.judge(&shown(7.0)), None, "no line has said which is in force");
        send(&mut watch, &["G90G54"]);
        watch.on_answer();
        assert_eq!(watch.judge(&shown(0.02)), None, "rounding");
        assert!(watch.clone().judge(&shown(10.0)).is_some());
        // One of the lines that have no answer yet may have set it.
        send(&mut watch, &["G10L2P1A30", "G0A0", "G10L20P1A5", "G55"]);
        for zero in [0.0, 30.0, 25.0, 360.0] {
            assert_eq!(watch.clone().judge(&shown(zero)), None, "{zero}");
        }
        assert!(watch.clone().judge(&shown(10.0)).is_some());
        watch.on_answer();
        assert!(watch.clone().judge(&shown(1.0)).is_some());
        for _ in 0..3 {
            watch.on_answer();
        }
        // A board that counts within a turn.
        assert_eq!(watch.judge(&shown(0.0)), None);
        assert!(watch.clone().judge(&shown(25.0)).is_some());
        // The operator goes on with what is in force, and a changer may have selected another.
        watch.forgive();
        assert_eq!(watch.clone().judge(&shown(25.0)), None);
        watch.begin_again(Some(Frame::default()), Some(ZERO), one(0.0));
        assert_eq!(watch.judge(&shown(25.0)), None);
    }
}

#[test]
fn lines_that_turn_an_axis_are_done_when_the_planner_cannot_hold_them() {
    let one = |value: f64| FurtherAxes::NONE.with(0, value);
    let mut frame = FurtherFrame::default();
    frame.systems[0] = one(0.0);
    let frame = Frame { further: frame, ..Frame::default() };
    let mut watch = PathWatch::new(board(), frame, Some(ZERO), one(0.0));
    send(&mut watch, &["G90G54"]);
    for angle in 0..1000 {
        send(&mut watch, &[&format!("A{angle}")]);
        watch.on_answer();
    }
    assert!(watch.moves.len() < 40, "{}", watch.moves.len());
}
