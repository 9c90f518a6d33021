//! Boxes and moves of which not everything is known: certain is an error, possible a warning.
//!
//! G54 lies so that the travel goes from X-100 Y-100 Z-40 to X500 Y300 Z60 in it.

use super::*;
use cnc_msgs::contour::Probe;
use cnc_msgs::finding::Severity;

/// From Z-20 up to this, across X20 to X40 about Y0.
fn clamp_to(top: f64) -> KeepOut {
    clamp(Frame::Work(1), [20.0, -10.0, -20.0], [40.0, 10.0, top])
}

fn with_tool() -> Program {
    Program::default().act(Action::ChangeTool { tool: 1 })
}

const ORIGIN: [f64; 3] = [0.0; 3];
const ACROSS: [f64; 3] = [100.0, 0.0, 0.0];

/// Severities with lines, and what the first text has in it.
#[track_caller]
fn expect(report: &EnvelopeReport, expected: &[(Severity, u32, &str)]) {
    let lines: Vec<_> = expected.iter().map(|it| (Code::KeepOut, it.1, it.2)).collect();
    check(report, &lines);
    let found: Vec<_> = report.findings.iter().map(|it| it.severity).collect();
    let wanted: Vec<_> = expected.iter().map(|it| it.0).collect();
    assert_eq!(found, wanted, "{report:#?}");
}

use Severity::{Error, Warning};

#[test]
fn the_first_moves_are_judged_as_far_as_they_say_where_they_go() {
    let first = |axes: &str, end: [f64; 3]| with_tool().rapid(axes, end);
    let length = |length_mm: f64| {
        with_tool().act(Action::ToolLength { offset: Some(1), length_mm, second: None })
    };
    let flat = "where X, Y and Z are before this move is not known: on its way T1 (radius 3.000 mm) \
                may touch the keep-out \"left clamp\"; it does so where its tip is at Z-48.000 in \
                the machine frame (Z12.000 in G54) or lower; put a move in Z alone before it, to \
                above Z-48.000";
    for (keep_out, program, expected) in [
        // As nearly every post begins; the clamp is low.
        (clamp_to(12.0), first("XY", ORIGIN), &[(Warning, 2, flat)][..]),
        // Up first, and the same.
        (clamp_to(12.0), first("Z", [0.0, 0.0, 20.0]).rapid("XY", [0.0, 0.0, 20.0]), &[]),
        // Up, yet not above the clamp.
        (clamp_to(12.0), first("Z", [0.0, 0.0, 5.0]), &[(Warning, 2, "its tip ends at Z-55.000")]),
        // All at once, past the clamp from somewhere.
        (clamp_to(12.0), first("XYZ", [0.0, 0.0, 20.0]), &[(Warning, 2, "left clamp")]),
        // The tip never comes so low, wherever it is.
        (clamp_to(-19.0), length(-25.0).rapid("XY", ORIGIN), &[]),
        (clamp_to(-19.0), length(-15.0).rapid("XY", ORIGIN), &[(Warning, 3, "left clamp")]),
        // Over where the clamp is, and up from there: the tool stands free before it.
        (
            clamp_to(12.0),
            first("XY", [30.0, 0.0, 0.0]).rapid("Z", [30.0, 0.0, 20.0]),
            &[(Warning, 2, "left clamp")],
        ),
        // It is as high as the travel: whatever Z is, the tool runs into it.
        (
            clamp_to(60.0),
            first("XY", ORIGIN).cut(ACROSS),
            &[(Error, 3, "touches the keep-out \"left clamp\", wherever Z was before")],
        ),
        (clamp_to(59.9), first("XY", ORIGIN).cut(ACROSS), &[(Warning, 2, "left clamp")]),
        // A long tool hangs lower.
        (
            clamp_to(40.0),
            length(20.0).rapid("XY", ORIGIN).cut(ACROSS),
            &[(Error, 4, "wherever Z was before")],
        ),
        // A bar across the whole travel stops every way along X.
        (
            clamp(Frame::Work(1), [20.0, -150.0, -20.0], [40.0, 350.0, 60.0]),
            first("X", ORIGIN).rapid("X", ACROSS),
            &[(Error, 3, "wherever Y and Z were before")],
        ),
        // The end is within it, from wherever.
        (clamp_to(60.0), first("XY", [30.0, 0.0, 0.0]), &[(Error, 2, "wherever X, Y and Z were")]),
    ] {
        expect(&judge(&machine(&[]), &program, &keep_out), expected);
    }
    // Where no travel bounds Z, nothing of it is certain.
    let program = first("XY", ORIGIN).cut(ACROSS);
    for limits in [machine(&[(132, 0.0)]), machine(&[]).not_homed()] {
        expect(&judge(&limits, &program, &clamp_to(90.0)), &[(Warning, 2, "left clamp")]);
    }
    // Who knows where the tool is says nothing of it.
    let report = judge_with(&machine(&[]), &program, &clamp_to(12.0), ABOVE, |_| {});
    expect(&report, &[]);
    assert!(report.not_judged.is_empty(), "{report:?}");
}

#[test]
fn one_warning_names_all_boxes_of_a_block() {
    let mut keep_out = clamp_to(12.0);
    for (name, top) in [("a", 5.0), ("b", 30.0), ("c", 7.0), ("d", 8.0)] {
        keep_out.keep_out.extend(clamp_to(top).keep_out.into_values().map(|it| (name.into(), it)));
    }
    let report = judge(&machine(&[]), &with_tool().rapid("XY", ORIGIN), &keep_out);
    expect(&report, &[(Warning, 2, "the keep-outs \"a\", \"b\", \"c\" and 2 more; ")]);
    assert!(report.findings[0].help.contains("above Z-30.000"), "{report:#?}");
}

#[test]
fn after_homing_the_axes_are_where_the_firmware_leaves_them() {
    let homed = || with_tool().act(Action::Home { axes: AxisSet::NONE });
    // At X-2 Y-2 Z-2 in the machine frame: X498 Y298 Z58.
    let beside = |top: f64| clamp(Frame::Work(1), [300.0, 250.0, -20.0], [400.0, 320.0, top]);
    let back = || homed().rapid("X", [200.0, 0.0, 0.0]);
    expect(&judge(&machine(&[]), &back(), &beside(57.9)), &[]);
    let report = judge(&machine(&[]), &back(), &beside(58.0));
    expect(&report, &[(Error, 3, "within its sides")]);
    // Homing towards X- (bit 0 of $23) leaves X at the other end.
    let report = judge(&machine(&[(23, 1.0)]), &back(), &beside(58.0));
    expect(&report, &[]);
    // Without the pull-off nobody knows, unless it is judged when the axes are there.
    let mut unsaid = settings(Firmware::Grbl, "V", &[]);
    unsaid.settings.retain(|(number, _)| *number != 27);
    let position = [-500.0, -300.0, -60.0];
    unsaid.offsets = vec![Offset { name: "G54".into(), position, ..Offset::default() }];
    let unsaid = MachineLimits::of(&unsaid).expect("a machine");
    let said = "where X, Y and Z are after homing is not known";
    expect(&judge(&unsaid, &back(), &beside(58.0)), &[(Warning, 3, said)]);
    let later = |it: &mut Workplace<'_>| it.is_judged_again = true;
    let report = judge_with(&unsaid, &back(), &beside(58.0), None, later);
    expect(&report, &[]);
    assert!(report.not_judged.is_empty(), "{report:?}");
    // An end that the program names is judged all the same.
    let into = homed().rapid("XYZ", [350.0, 280.0, 0.0]);
    let report = judge_with(&unsaid, &into, &beside(58.0), None, later);
    expect(&report, &[(Error, 3, "left clamp")]);
}

#[test]
fn after_a_probe_the_tool_is_somewhere_on_its_way() {
    let probe = Probe { away: false, may_miss: false };
    let probed = || {
        with_tool()
            .rapid("Z", [0.0, 0.0, 50.0])
            .rapid("XY", [0.0, 0.0, 50.0])
            .rapid("Z", [0.0, 0.0, 10.0])
            .act(Action::Probe(probe))
            .cut([0.0, 0.0, -20.0])
            .rapid("X", ACROSS)
    };
    // No higher than where it began: Z10.
    let report = judge(&machine(&[]), &probed(), &clamp_to(10.0));
    expect(&report, &[(Error, 7, "wherever Z was before")]);
    for is_judged_again in [false, true] {
        let later = |it: &mut Workplace<'_>| it.is_judged_again = is_judged_again;
        let report = judge_with(&machine(&[]), &probed(), &clamp_to(5.0), None, later);
        expect(&report, &[]);
        let said = report.not_judged.iter().any(|it| it.contains("where the probe ends"));
        assert_eq!(said, !is_judged_again, "{report:?}");
    }
    // It never was so low.
    let report = judge(&machine(&[]), &probed(), &clamp_to(-21.0));
    expect(&report, &[]);
    assert!(report.not_judged.is_empty(), "{report:?}");
}

#[test]
fn a_tool_that_nobody_has_named_is_one_of_the_table() {
    let beside = |y: f64| Program::default().rapid("XY", [0.0, y, 0.0]).cut([100.0, y, 0.0]);
    let said = "which tool is in the spindle is not known: T1 (radius 3.000 mm), the largest of the \
                tool table, would touch the keep-out \"left clamp\"";
    for (y, spindle_tool, expected) in [
        (12.0, None, &[(Warning, 2, said)][..]),
        (13.5, None, &[]),
        (9.0, None, &[(Error, 2, "the axis of the tool touches")]),
        (12.0, Some(1), &[(Error, 2, "T1 (radius 3.000 mm) touches")]),
        (12.0, Some(2), &[]),
        (10.05, Some(2), &[(Error, 2, "T2 (radius 0.100 mm) touches")]),
        // An empty spindle has no radius.
        (10.05, Some(0), &[]),
    ] {
        let known = |it: &mut Workplace<'_>| it.spindle_tool = spindle_tool;
        let start = Some([-500.0, -300.0 + y, -60.0]);
        let report = judge_with(&machine(&[]), &beside(y), &clamp_to(5.0), start, known);
        expect(&report, expected);
        assert!(report.not_judged.is_empty(), "{report:?}");
    }
    // Without a table, and with a tool that it does not have, only the axis is compared.
    let none = BTreeMap::new();
    for (spindle_tool, is_empty, name) in
        [(None, true, "the tool in the spindle"), (Some(9), false, "T9")]
    {
        let mut workplace = Workplace {
            keep_out: &clamp_to(5.0),
            tool_diameters_mm: &[(1, 6.0)].into(),
            start_in_machine: Some([-500.0, -288.0, -60.0]),
            spindle_tool,
            is_judged_again: false,
        };
        if is_empty {
            workplace.tool_diameters_mm = &none;
        }
        let program = beside(12.0);
        let mut envelope =
            Envelope::new(&machine(&[]), &program.0, Beginning::default(), workplace);
        envelope.advance_to(&program.0, program.0.elements.len());
        expect(&envelope.report(), &[]);
        assert!(envelope.not_compared()[0].starts_with(&format!("the diameter of {name} at")));
    }
}

#[test]
fn boxes_of_a_work_system_need_nothing_but_programs_in_it() {
    // No stored position is known, nor where the tool is.
    let limits = MachineLimits { offsets: StoredOffsets::default(), ..machine(&[]) };
    let up = || with_tool().rapid("Z", [0.0, 0.0, 20.0]).rapid("XY", [0.0, 0.0, 20.0]);
    let low = |program: Program| program.rapid("Z", ORIGIN).cut(ACROSS);
    let report = judge(&limits, &low(up()), &clamp_to(5.0));
    expect(
        &report,
        &[(Error, 5, "its tip is at X20.000 Y0.000 Z0.000 in G54, within its sides, and 5.000 mm")],
    );
    expect(&judge(&limits, &up().cut([100.0, 0.0, 20.0]), &clamp_to(5.0)), &[]);
    let asks = |report: &EnvelopeReport| {
        report.not_judged.iter().any(|it| it.starts_with("keep-outs on the way to the end of line"))
    };
    // In another system, in the machine frame, and with a zero in it, nobody knows where that is.
    let axes = AxisSet::ALL;
    let zero = Action::SetWorkOffset {
        system: 1,
        axes,
        origin: [-500.0, -300.0, -60.0],
        by_position: false,
    };
    let high = [0.0, 0.0, -1.0];
    let away = Action::MachineMove { target: high, axes, rapid: true, feed_mm_per_min: 0.0 };
    for action in [Action::WorkOffset { system: 2 }, zero, away] {
        let report = judge(&limits, &up().act(action).cut([100.0, 0.0, 0.0]), &clamp_to(5.0));
        expect(&report, &[]);
        assert!(asks(&report), "{action:?} {report:?}");
    }
    // A zero that is set where the tool stands is known, since its place is.
    let zero =
        Action::SetWorkOffset { system: 1, axes, origin: [50.0, 0.0, 20.0], by_position: true };
    let report = judge(&limits, &up().act(zero).cut([80.0, 0.0, 0.0]), &clamp_to(5.0));
    expect(&report, &[(Error, 5, "in G54, within its sides")]);
    // A box in the machine frame needs no stored position.
    let in_machine = clamp(Frame::Machine, [-480.0, -310.0, -80.0], [-460.0, -290.0, -5.0]);
    let report = judge(&limits, &up().act(away).cut(ACROSS), &in_machine);
    expect(&report, &[]);
    assert!(asks(&report), "{report:?}");
}

#[test]
fn with_other_kinematics_boxes_are_judged_and_travel_is_not() {
    let in_machine = clamp(Frame::Machine, [-480.0, -310.0, -80.0], [-460.0, -290.0, -45.0]);
    let program = begun().cut([0.0, 0.0, 0.0]).cut([9_000.0, 0.0, 0.0]);
    let of = |firmware, name: &str| {
        let mut settings = settings(firmware, "", &[]);
        let position = [-500.0, -300.0, -60.0];
        settings.offsets = vec![Offset { name: "G54".into(), position, ..Offset::default() }];
        MachineLimits::of(&settings).expect("a machine").with_other_kinematics(name)
    };
    for (firmware, name, bows) in [
        (Firmware::GrblHal, "Delta", false),
        (Firmware::GrblHal, "Polar", true),
        (Firmware::FluidNc, "WallPlotter", false),
    ] {
        let known = |it: &mut Workplace<'_>| it.spindle_tool = Some(1);
        let report = judge_with(&of(firmware, name), &program, &in_machine, ABOVE, known);
        expect(&report, &[(Error, 4, "touches the keep-out")]);
        let said = |text: &str| report.not_judged.iter().any(|it| it.contains(text));
        assert!(said(&format!("the travel: with {name} kinematics it is no box")), "{report:?}");
        assert_eq!(said("they bow"), bows, "{report:?}");
        // Before homing a place in the machine frame means nothing.
        let report =
            judge_with(&of(firmware, name).not_homed(), &program, &in_machine, ABOVE, known);
        expect(&report, &[]);
    }
}
