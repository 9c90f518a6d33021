//! Programs against a machine of 600 × 400 × 100 mm whose G54 lies at X-500 Y-300 Z-60.

mod unknown;

use super::*;
use crate::driver::Offset;
use crate::firmware::Firmware;
use crate::machine_limits::tests::{settings, with_axes};
use cnc_msgs::contour::{Action, Source, SpindleMode};
use cnc_msgs::finding::Code;
use cnc_msgs::further::{FurtherAxes, FurtherMode, FurtherMove};
use cnc_msgs::geometry::{Arc, AxisSet, Plane, Shape};
use cnc_msgs::keep_out::{Frame, KeepOutBox};
use cnc_msgs::path::{PathElement, PathEvent, Role};
use cnc_msgs::text::Words;

/// A path as a list of blocks; line numbers count them.
#[derive(Default)]
struct Program(CompensatedPath);

impl Program {
    fn source(&self) -> Source {
        let line = self.0.elements.len() + self.0.events.len() + 1;
        Source { line: line as u32, ..Source::default() }
    }

    fn go(mut self, axes: &str, end: [f64; 3], feed: Option<f64>, shape: Shape) -> Self {
        let (axes, source) = (AxisSet::from_letters(axes).expect("axes"), self.source());
        let (side, role) = (None, Role::None);
        let element = PathElement { shape, end, feed_mm_per_min: feed, role, side, axes, source };
        self.0.elements.push(element);
        self
    }

    fn rapid(self, axes: &str, end: [f64; 3]) -> Self {
        self.go(axes, end, None, Shape::Line)
    }

    fn cut(self, end: [f64; 3]) -> Self {
        self.go("", end, Some(600.0), Shape::Line)
    }

    fn arc(self, end: [f64; 3], center: [f64; 3], clockwise: bool, turns: u16) -> Self {
        let arc = Arc { center, plane: Plane::Xy, clockwise, turns };
        self.go("XY", end, Some(600.0), Shape::Arc(arc))
    }

    fn act(mut self, action: Action) -> Self {
        let (at_element, source) = (self.0.elements.len(), self.source());
        self.0.events.push(PathEvent { at_element, action, source });
        self
    }
}

fn machine(changes: &[(u16, f64)]) -> MachineLimits {
    let mut settings = settings(Firmware::Grbl, "V", changes);
    let stored = |name: &str, position| Offset { name: name.into(), position, ..Offset::default() };
    settings.offsets = vec![
        stored("G54", [-500.0, -300.0, -60.0]),
        stored("G55", [-200.0, -300.0, -60.0]),
        stored("G28", [-5.0, -5.0, -1.0]),
        stored("G92", [0.0; 3]),
        stored("TLO", [0.0; 3]),
    ];
    MachineLimits::of(&settings).expect("a machine")
}

fn judge(limits: &MachineLimits, program: &Program, keep_out: &KeepOut) -> EnvelopeReport {
    judge_with(limits, program, keep_out, None, |_| {})
}

/// The same from a place in the machine frame, and with what else is known.
fn judge_with(
    limits: &MachineLimits,
    program: &Program,
    keep_out: &KeepOut,
    start_in_machine: Option<Position>,
    known: impl Fn(&mut Workplace<'_>),
) -> EnvelopeReport {
    let tools = [(1, 6.0), (2, 0.2)].into();
    let mut workplace = Workplace {
        keep_out,
        tool_diameters_mm: &tools,
        start_in_machine,
        spindle_tool: None,
        is_judged_again: false,
    };
    known(&mut workplace);
    let mut envelope = Envelope::new(limits, &program.0, Beginning::default(), workplace);
    // In slices, as the driver does it.
    (0..=program.0.elements.len()).for_each(|end| envelope.advance_to(&program.0, end));
    envelope.report()
}

/// Codes with lines, and what the first message has in it.
#[track_caller]
fn check(report: &EnvelopeReport, expected: &[(Code, u32, &str)]) {
    let found: Vec<_> = report.findings.iter().map(|it| (it.code, it.source.line)).collect();
    let wanted: Vec<_> = expected.iter().map(|(code, line, _)| (*code, *line)).collect();
    assert_eq!(found, wanted, "{report:#?}");
    for (finding, (_, _, part)) in report.findings.iter().zip(expected) {
        let text = format!("{}; {}", finding.message, finding.help);
        assert!(text.contains(part), "{text}");
    }
}

/// Over the zero of G54, machine frame.
const ABOVE: Option<Position> = Some([-500.0, -300.0, 0.0]);
const UP: [f64; 3] = [0.0, 0.0, 10.0];

fn begun() -> Program {
    Program::default().rapid("Z", UP).rapid("XY", [0.0, 0.0, 10.0])
}

#[test]
fn a_program_is_judged_by_its_travel_with_place_numbers_and_remedy() {
    let full_circle = |radius: f64| {
        begun().cut([radius, 0.0, 10.0]).arc([radius, 0.0, 10.0], [0.0, 0.0, 10.0], false, 1)
    };
    let second = |shift: f64| begun().act(Action::WorkOffset { system: 2 }).cut([shift, 0.0, 10.0]);
    let length = |length_mm: f64| {
        Program::default()
            .act(Action::ToolLength { offset: Some(1), length_mm, second: None })
            .rapid("Z", [0.0, 0.0, 10.0])
    };
    let machine_move = |z: f64| {
        let (target, axes) = ([0.0, 0.0, z], AxisSet::NONE.with(2));
        Program::default().act(Action::MachineMove {
            target,
            axes,
            rapid: true,
            feed_mm_per_min: 0.0,
        })
    };
    for (program, expected) in [
        (begun().cut([500.0, 300.0, 10.0]), &[][..]),
        (begun().cut([500.0, 300.0, 60.0]), &[]),
        // Stored positions and steps are no finer.
        (begun().cut([500.009, 300.0, 60.0]), &[]),
        (
            begun().cut([500.02, 0.0, 10.0]).cut([512.5, 0.0, 10.0]).cut([0.0, 0.0, 10.0]),
            &[(
                Code::Travel,
                3,
                "goes to X0.020 in the machine frame (X500.020 in G54), 0.020 mm beyond the travel \
                 from X-600.000 to X0.000; 2 blocks do so, line 4 the farthest, by 12.500 mm; move \
                 the work zero of G54 by at least 12.500 mm towards X-",
            )],
        ),
        (begun().cut([-101.0, 0.0, 10.0]), &[(Code::Travel, 3, "X-601.000 in the machine frame")]),
        (begun().cut([0.0, 0.0, -41.0]), &[(Code::Travel, 3, "towards Z+")]),
        // Its ends are well within; what it passes is not.
        (full_circle(99.999), &[]),
        (full_circle(100.5), &[(Code::Travel, 4, "X-600.500"), (Code::Travel, 4, "Y-400.500")]),
        (
            // Where Z is does not matter.
            Program::default().rapid("XY", [100.5, 0.0, 0.0]).arc(
                [100.5, 0.0, 0.0],
                [0.0; 3],
                false,
                1,
            ),
            &[(Code::Travel, 2, "X-600.500"), (Code::Travel, 2, "Y-400.500")],
        ),
        (second(200.0), &[]),
        (second(200.5), &[(Code::Travel, 4, "(X200.500 in G55)")]),
        (length(50.0), &[]),
        (length(50.5), &[(Code::Travel, 2, "Z0.500 in the machine frame (Z10.000 in G54)")]),
        (machine_move(0.0), &[]),
        (machine_move(0.1), &[(Code::Travel, 1, "Z0.100 in the machine frame (G53)")]),
        (begun().act(Action::Reference { axes: AxisSet::NONE, second: false }), &[]),
        // Longer than the travel wherever it is put.
        (
            begun().cut([-100.0, 0.0, 10.0]).cut([501.0, 0.0, 10.0]),
            &[(
                Code::Travel,
                4,
                "needs 601.000 mm in X, from line 3 to line 4; the machine has 600.000 mm ($130), \
                 1.000 mm less",
            )],
        ),
    ] {
        check(&judge(&machine(&[]), &program, &KeepOut::default()), expected);
    }
}

#[test]
fn without_a_machine_zero_the_length_alone_is_judged_and_that_is_said() {
    let far = begun().cut([590.0, 0.0, 10.0]);
    let long = begun().cut([601.0, 0.0, 10.0]);
    for limits in [machine(&[(20, 0.0), (22, 0.0)]), machine(&[]).not_homed()] {
        let report = judge(&limits, &far, &KeepOut::default());
        check(&report, &[]);
        assert!(report.not_judged[0].contains("only its length was compared"), "{report:?}");
        check(&judge(&limits, &long, &KeepOut::default()), &[(Code::Travel, 3, "601.000 mm in X")]);
    }
    // What stays where the program left it is not part of what is not judged.
    let report = judge(&machine(&[]), &far, &KeepOut::default());
    assert!(report.not_judged.is_empty(), "{report:?}");
}

#[test]
fn what_is_not_reported_is_named_and_not_judged() {
    let mut limits = machine(&[(131, 0.0)]);
    limits.offsets.systems[2] = None;
    let program = begun().act(Action::WorkOffset { system: 3 }).cut([9_000.0, 9_000.0, 10.0]);
    let report = judge(&limits, &program, &KeepOut::default());
    check(&report, &[]);
    assert!(report.not_judged.iter().any(|it| it.contains("$131 is 0")), "{report:?}");
    assert!(report.not_judged.iter().any(|it| it.contains("moves in G56")), "{report:?}");
}

#[test]
fn a_run_from_the_middle_is_judged_from_there() {
    let program = begun().cut([600.0, 0.0, 10.0]).cut([0.0, 0.0, 10.0]).cut([10.0, 0.0, 10.0]);
    let (none, tools) = (KeepOut::default(), BTreeMap::new());
    let workplace = Workplace {
        keep_out: &none,
        tool_diameters_mm: &tools,
        start_in_machine: None,
        spindle_tool: None,
        is_judged_again: false,
    };
    for (first, count) in [(0, 1), (2, 1), (3, 0)] {
        let beginning = Beginning::with_element(&program.0, first);
        let mut envelope = Envelope::new(&machine(&[]), &program.0, beginning, workplace);
        envelope.advance_to(&program.0, program.0.elements.len());
        assert_eq!(envelope.report().findings.len(), count, "from {first}");
    }
}

#[test]
fn the_way_to_a_beginning_in_the_middle_is_judged() {
    // The last element is the fifth; G53 may stand before it, in line 5.
    let action = Action::MachineMove {
        target: [0.0, 0.0, 40.0],
        axes: AxisSet::NONE.with(2),
        rapid: true,
        feed_mm_per_min: 0.0,
    };
    let cut = || begun().cut([100.0, 0.0, 10.0]).cut([100.0, 0.0, 5.0]);
    let plain = cut().rapid("Z", [100.0, 0.0, 10.0]);
    let with_g53 = cut().act(action).rapid("Z", [100.0, 0.0, 10.0]);
    // Machine frame: X-430 to -410, and up to Z-20, between where the tool stands and X-400.
    let between = clamp(Frame::Machine, [-430.0, -310.0, -100.0], [-410.0, -290.0, -20.0]);
    let below = clamp(Frame::Machine, [-405.0, -310.0, -100.0], [-395.0, -290.0, -50.0]);
    let tools = BTreeMap::new();
    let judged = |program: &Program, keep_out: &KeepOut, event, approach| {
        let start_in_machine = Some([-450.0, -300.0, -60.0]);
        let (spindle_tool, is_judged_again) = (None, false);
        let workplace = Workplace {
            keep_out,
            tool_diameters_mm: &tools,
            start_in_machine,
            spindle_tool,
            is_judged_again,
        };
        let beginning = Beginning { element: 4, event, approach };
        let mut envelope = Envelope::new(&machine(&[]), &program.0, beginning, workplace);
        envelope.advance_to(&program.0, program.0.elements.len());
        envelope.report()
    };
    let approached = |keep_out: &KeepOut, approach| judged(&plain, keep_out, 0, Some(approach));
    let none = KeepOut::default();
    let axes = AxisSet::ALL;
    let further = FurtherAxes::NONE;
    let from = |height_mm| Approach { height_mm, axes, further };
    // The event before the beginning is run, or left out.
    let out = "Z40.000 in the machine frame (G53)";
    check(&judged(&with_g53, &none, 0, None), &[(Code::Travel, 5, out)]);
    check(&judged(&with_g53, &none, 1, None), &[]);
    check(&approached(&none, from(-5.0)), &[]);
    let out = "Z5.000 in the machine frame (the way to the beginning)";
    check(&approached(&none, from(5.0)), &[(Code::Travel, 5, out)]);
    check(&approached(&between, from(-5.0)), &[]);
    check(&approached(&between, from(-25.0)), &[(Code::KeepOut, 5, "left clamp")]);
    // The way down, and then the line itself.
    let both = [(Code::KeepOut, 5, "on the approach to it, "), (Code::KeepOut, 5, "the axis of")];
    check(&approached(&below, from(-5.0)), &both);
    // The line of the program is not to blame.
    for (report, help) in [
        (approached(&below, from(-5.0)), "raise approach_z_mm"),
        (approached(&none, from(5.0)), "approach_z_mm within the travel"),
    ] {
        let finding = &report.findings[0];
        assert!(finding.message.starts_with("on the approach to it, "), "{finding:?}");
        assert!(finding.help.contains(help), "{finding:?}");
    }
    // After G53 the path does not say Z: the tool stays at the height.
    let over = Approach { axes: axes.without(AxisSet::NONE.with(2)), ..from(-5.0) };
    check(&judged(&with_g53, &none, 1, Some(over)), &[]);
}

fn clamp(frame: Frame, min_mm: Position, max_mm: Position) -> KeepOut {
    KeepOut { keep_out: [("left clamp".to_owned(), KeepOutBox { frame, min_mm, max_mm })].into() }
}

#[test]
fn a_tool_that_touches_a_clamp_is_refused_and_one_that_passes_is_not() {
    let in_work = clamp(Frame::Work(1), [20.0, -10.0, -20.0], [40.0, 10.0, 15.0]);
    let in_machine = clamp(Frame::Machine, [-480.0, -310.0, -80.0], [-460.0, -290.0, -45.0]);
    let tool =
        |tool| Program::default().act(Action::ChangeTool { tool }).rapid("Z", [0.0, 0.0, 10.0]);
    let at = |tool_number, y: f64, z: f64| {
        tool(tool_number).rapid("XYZ", [0.0, y, z]).cut([100.0, y, z])
    };
    for (program, expected) in [
        (
            at(1, 0.0, 10.0),
            &[(Code::KeepOut, 4, "T1 (radius 3.000 mm) touches the keep-out \"left clamp\"")][..],
        ),
        (at(1, 0.0, 16.0), &[]),
        (at(1, 0.0, 15.0), &[(Code::KeepOut, 4, "0.000 mm below the top")]),
        (at(1, 13.1, 0.0), &[]),
        (
            at(1, 12.0, 0.0),
            &[(Code::KeepOut, 4, "keep 1.000 mm more distance, or lift the tip above Z-45.000")],
        ),
        (at(2, 12.0, 0.0), &[]),
        (at(2, 10.05, 0.0), &[(Code::KeepOut, 4, "T2 (radius 0.100 mm)")]),
        // Over it, and down beyond it.
        (tool(1).rapid("XYZ", [0.0, 0.0, 20.0]).cut([50.0, 0.0, 20.0]).cut([50.0, 0.0, 0.0]), &[]),
        (
            tool(1).rapid("XYZ", [0.0, 0.0, 20.0]).cut([42.0, 0.0, 20.0]).cut([42.0, 0.0, 0.0]),
            &[(Code::KeepOut, 5, "2.000 mm from the side")],
        ),
        // Around it: a circle that never comes nearer than the radius, and one that does.
        (
            tool(1).rapid("XYZ", [56.0, 0.0, 0.0]).arc([56.0, 0.0, 0.0], [30.0, 0.0, 0.0], true, 1),
            &[],
        ),
        (
            tool(1).rapid("XYZ", [46.0, 0.0, 0.0]).arc([46.0, 0.0, 0.0], [30.0, 0.0, 0.0], true, 1),
            &[(Code::KeepOut, 4, "from the side")],
        ),
        // The zero moves, the clamp does not.
        (
            tool(1)
                .act(Action::SetWorkOffset {
                    system: 1,
                    axes: AxisSet::NONE.with(1),
                    origin: [0.0, -200.0, 0.0],
                    by_position: false,
                })
                .rapid("XYZ", [0.0, 0.0, 0.0])
                .cut([100.0, 0.0, 0.0]),
            &[],
        ),
    ] {
        for keep_out in [&in_work, &in_machine] {
            // Where it begins is not known; what may be on that way is a warning.
            let mut report = judge(&machine(&[]), &program, keep_out);
            report.findings.retain(Finding::is_error);
            check(&report, expected);
        }
    }
    // A machine place needs a machine zero, a place on the work does not.
    let (program, unhomed) = (at(1, 0.0, 10.0), machine(&[(20, 0.0), (22, 0.0)]));
    let report = judge_with(&unhomed, &program, &in_work, ABOVE, |_| {});
    check(&report, &[(Code::KeepOut, 4, "touches")]);
    let report = judge_with(&unhomed, &program, &in_machine, ABOVE, |_| {});
    check(&report, &[]);
    assert!(
        report.not_judged.iter().any(|it| it.contains("keep-out \"left clamp\"")),
        "{report:?}"
    );
}

#[test]
fn a_tool_length_moves_the_axes_and_not_the_tip() {
    let keep_out = clamp(Frame::Work(1), [20.0, -10.0, -20.0], [40.0, 10.0, 5.0]);
    let with_length = |z: f64| {
        Program::default()
            .act(Action::ToolLength { offset: Some(1), length_mm: 40.0, second: None })
            .rapid("XYZ", [0.0, 0.0, z])
            .cut([100.0, 0.0, z])
    };
    let judge = |z| judge_with(&machine(&[]), &with_length(z), &keep_out, ABOVE, |_| {});
    check(&judge(6.0), &[]);
    check(&judge(4.0), &[(Code::KeepOut, 3, "Z4.000 in G54")]);
}

#[test]
fn settings_that_change_the_program_are_warnings_with_their_line() {
    let spindle = |rpm| {
        begun().act(Action::SpindleSpeed { rpm }).act(Action::Spindle(SpindleMode::Clockwise))
    };
    let fast = |end: [f64; 3]| begun().go("", end, Some(4_000.0), Shape::Line).cut(UP);
    let laser = |mode| {
        let start = begun().act(Action::Spindle(mode));
        (1..=5).fold(start, |program, pixel: u32| {
            let at = f64::from(pixel);
            program.act(Action::SpindleSpeed { rpm: 100.0 * at }).cut([at, 0.0, 10.0])
        })
    };
    let milling = Program::default()
        .act(Action::ChangeTool { tool: 1 })
        .act(Action::SpindleSpeed { rpm: 5_000.0 })
        .act(Action::Spindle(SpindleMode::Clockwise));
    let setting = Code::MachineSetting;
    for (changes, program, expected) in [
        (&[][..], spindle(24_000.0), &[][..]),
        (&[], spindle(25_000.0), &[(setting, 3, "it turns at 24000 rev/min ($30)")]),
        (&[(31, 8_000.0)], spindle(8_000.0), &[]),
        (&[(31, 8_000.0)], spindle(0.0), &[]),
        (&[(31, 8_000.0)], spindle(900.0), &[(setting, 3, "it turns at 8000 rev/min ($31)")]),
        (&[], fast([100.0, 0.0, 10.0]), &[]),
        (&[], fast([0.0, 0.0, 20.0]), &[(setting, 3, "moves at 2000 mm/min here")]),
        (&[(32, 1.0)], laser(SpindleMode::CounterClockwise), &[]),
        (&[], laser(SpindleMode::CounterClockwise), &[(setting, 3, "not in laser mode ($32=0)")]),
        (&[(32, 1.0)], milling, &[(setting, 3, "T1 is a cutter of 6.000 mm")]),
    ] {
        let report = judge(&machine(changes), &program, &KeepOut::default());
        check(&report, expected);
        assert!(report.findings.iter().all(|it| !it.is_error()));
    }
}

#[test]
fn a_thread_needs_an_encoder_and_axes_that_keep_pace() {
    let threading = |from: [f64; 3], to: [f64; 3], feed, pitch_mm| {
        let thread = begun().rapid("XYZ", from).act(Action::SpindleSync { pitch_mm });
        let source = thread.0.events.last().expect("the thread").source;
        let mut thread = thread.go("", to, Some(feed), Shape::Line);
        thread.0.elements.last_mut().expect("its motion").source = source;
        thread
    };
    let along_z = |feed| threading([10.0, 10.0, 10.0], [10.0, 10.0, 0.0], feed, 1.0);
    let along_x = |feed| threading([10.0, 10.0, 10.0], [40.0, 10.0, 10.0], feed, 1.0);
    let of = |firmware, spindle_sync, changes: &[(u16, f64)]| {
        let mut settings = settings(firmware, "", changes);
        let position = [-500.0, -300.0, -60.0];
        settings.offsets = vec![Offset { name: "G54".into(), position, ..Offset::default() }];
        MachineLimits { spindle_sync, ..MachineLimits::of(&settings).expect("a machine") }
    };
    let setting = Code::MachineSetting;
    let with = || of(Firmware::GrblHal, Some(true), &[]);
    for (machine, program, expected) in [
        (with(), along_z(1800.0), None),
        (
            with(),
            along_z(1801.0),
            Some("1801 mm/min at this spindle speed, and this controller takes at most 1800"),
        ),
        // The limit of Z counts along X too, unless that of X is lower.
        (with(), along_x(1801.0), Some("(90 % of $112)")),
        (
            of(Firmware::GrblHal, Some(true), &[(110, 1000.0)]),
            along_x(950.0),
            Some("(90 % of $110)"),
        ),
        (with(), along_z(24.0), Some("waits for two turns of the spindle")),
        (with(), along_z(25.0), None),
        (of(Firmware::GrblHal, Some(false), &[]), along_z(600.0), Some("this controller has none")),
        (of(Firmware::GrblHal, None, &[]), along_z(1801.0), Some("(90 % of $112)")),
        (of(Firmware::GrblHal, None, &[]), along_z(600.0), None),
    ] {
        let report = judge(&machine, &program, &KeepOut::default());
        let expected: Vec<_> = expected.map(|text| (setting, 4, text)).into_iter().collect();
        check(&report, &expected);
        assert!(report.findings.iter().all(Finding::is_error));
        let asks = report.not_judged.iter().filter(|it| it.contains("encoder, which line 4 needs"));
        assert_eq!(asks.count(), usize::from(machine.spindle_sync.is_none()), "{report:?}");
    }
    // A lathe never names Y. Without offsets only Z is judged, and that is said.
    let mut lathe =
        Program::default().rapid("XZ", [20.0, 0.0, 5.0]).act(Action::SpindleSync { pitch_mm: 2.0 });
    let source = lathe.0.events.last().expect("the thread").source;
    lathe = lathe.go("X", [40.0, 0.0, 5.0], Some(2000.0), Shape::Line);
    lathe.0.elements.last_mut().expect("its motion").source = source;
    let slow = of(Firmware::GrblHal, Some(true), &[(110, 1000.0), (112, 3000.0)]);
    let report = judge(&slow, &lathe, &KeepOut::default());
    check(&report, &[(setting, 2, "at most 900 mm/min there (90 % of $110)")]);
    let nowhere = MachineLimits { offsets: StoredOffsets::default(), ..slow };
    let cone = threading([10.0, 10.0, 10.0], [40.0, 10.0, 0.0], 2000.0, 2.0);
    let report = judge(&nowhere, &cone, &KeepOut::default());
    check(&report, &[]);
    assert!(
        report.not_judged.iter().any(|it| it.contains("keep pace with the thread of line 4")),
        "{report:?}"
    );
    // A file cannot give it to a firmware that knows no G33.
    for (firmware, wanted) in [
        (Firmware::Grbl, Some(false)),
        (Firmware::FluidNc, Some(false)),
        (Firmware::GrblHal, Some(true)),
    ] {
        let settings = crate::driver::ControllerSettings {
            spindle_sync: Some(true),
            ..settings(firmware, "", &[])
        };
        assert_eq!(MachineLimits::of(&settings).expect("a machine").spindle_sync, wanted);
    }
}

#[test]
fn an_axis_that_the_board_lacks_is_an_error_at_the_line_that_moves_it() {
    let turn = |a: f64| {
        let axes = FurtherAxes::NONE.with(0, a);
        let action = Action::Further(FurtherMove { axes, mode: FurtherMode::Rapid });
        Program::default().rapid("X", [10.0, 0.0, 0.0]).act(action)
    };
    let of = |axes: &str| {
        let settings = crate::driver::ControllerSettings {
            axes: axes.to_owned(),
            ..settings(Firmware::GrblHal, "", &[])
        };
        MachineLimits::of(&settings).expect("a machine")
    };
    let lacks = "the program moves A, and this controller has no axis A: its axes are";
    for (axes, a, expected) in [
        ("", 90.0, Some("X Y Z")),
        ("XYZB", 90.0, Some("X Y Z B")),
        ("XYZA", 90.0, None),
        // It stays where every program begins.
        ("", 0.0, None),
    ] {
        let report = judge(&of(axes), &turn(a), &KeepOut::default());
        let found = report.findings.iter().find(|it| it.message.starts_with(lacks));
        let advice = "delete these words, or run the program on a machine with A";
        let text = expected.map(|letters| format!("{lacks} {letters}; {advice}"));
        assert_eq!(found.map(|it| it.message.clone()), text, "{axes} A{a}");
        assert!(found.is_none_or(|it| it.is_error() && it.source.line == 2), "{found:?}");
    }
}

#[test]
fn outputs_and_inputs_are_those_of_the_board() {
    let word = |number: f64, words: &str| {
        let words = Words::new(words).expect("short");
        let action = Action::Auxiliary { letter: 'M', number, words };
        Program::default().rapid("X", [10.0, 0.0, 0.0]).act(action)
    };
    let of = |firmware, ports: Option<[u8; 4]>| {
        let settings = crate::driver::ControllerSettings {
            ports: ports.map(Into::into),
            ..settings(firmware, "", &[])
        };
        MachineLimits::of(&settings).expect("a machine")
    };
    for (machine, program, expected) in [
        (of(Firmware::GrblHal, Some([1, 2, 0, 0])), word(64.0, "P1"), None),
        (
            of(Firmware::GrblHal, Some([1, 2, 0, 0])),
            word(64.0, "P2"),
            Some("M64 P2 needs digital output 2, and this controller has 2 of them"),
        ),
        (
            of(Firmware::GrblHal, Some([1, 2, 0, 0])),
            word(66.0, "L0 P1"),
            Some("M66 L0 P1 needs digital input 1"),
        ),
        (of(Firmware::GrblHal, None), word(64.0, "P200"), None),
        // A file cannot give them to a firmware that has none.
        (
            of(Firmware::Grbl, Some([9; 4])),
            word(68.0, "E0 Q1"),
            Some("M68 E0 Q1 needs analog output 0"),
        ),
        (
            of(Firmware::GrblHal, Some([9; 4])),
            word(19.0, "R90"),
            Some("M19 R90 is not done: no firmware that Kerf knows turns its spindle to an angle"),
        ),
        // That of another control is no word for a port.
        (of(Firmware::GrblHal, Some([9; 4])), word(64.0, ""), Some("this controller has no M64")),
    ] {
        let report = judge(&machine, &program, &KeepOut::default());
        let expected: Vec<_> =
            expected.map(|text| (Code::MachineSetting, 2, text)).into_iter().collect();
        check(&report, &expected);
        let asks = report.not_judged.iter().filter(|it| it.contains("has no aux_io"));
        assert_eq!(asks.count(), usize::from(machine.ports.is_none()), "{report:?}");
    }
}

/// A grblHAL with A and U whose zero of G54 is at A-90; homing takes in A as these masks say.
fn turning_machine(masks: &[(u16, f64)]) -> MachineLimits {
    let mut settings = with_axes(settings(Firmware::GrblHal, "", masks), "XYZAU");
    let further = FurtherAxes::NONE.with(0, -90.0).with(3, -10.0);
    let zero = FurtherAxes::NONE.with(0, 0.0).with(3, 0.0);
    let position = [-500.0, -300.0, -60.0];
    settings.offsets = vec![
        Offset { name: "G54".into(), position, further },
        Offset { name: "G92".into(), position: [0.0; 3], further: zero },
    ];
    MachineLimits::of(&settings).expect("a machine")
}

#[test]
fn further_axes_are_judged_by_their_travel_where_it_is_known() {
    let go = |mode, axes| Action::Further(FurtherMove { axes, mode });
    let a = |value| FurtherAxes::NONE.with(0, value);
    let u = |value| FurtherAxes::NONE.with(3, value);
    let none = KeepOut::default();
    let homed = [(44, 4.0), (45, 3.0), (46, 24.0)];
    let rapid = FurtherMode::Rapid;
    let report = judge(&turning_machine(&homed), &begun().act(go(rapid, a(80.0))), &none);
    check(&report, &[]);
    assert!(report.not_judged.is_empty(), "{:?}", report.not_judged);
    // Beyond at both ends, alone and along.
    let program = begun()
        .act(go(rapid, a(100.0)))
        .act(go(FurtherMode::Along, a(-280.0)))
        .rapid("X", [50.0, 0.0, 10.0]);
    check(
        &judge(&turning_machine(&homed), &program, &none),
        &[(
            Code::Travel,
            3,
            "the program needs 380.000 degrees in A, from line 4 to line 3; the machine has \
                 360.000 degrees ($133), 20.000 degrees less",
        )],
    );
    let program = begun().act(go(rapid, a(100.0)));
    check(
        &judge(&turning_machine(&homed), &program, &none),
        &[(
            Code::Travel,
            3,
            "the move goes to A10.000 in the machine frame (A100.000 in G54), 10.000 degrees \
             beyond the travel from A-360.000 to A0.000",
        )],
    );
    // An axis that is not homed: an angle means nothing, a length has to fit all the same.
    let not_homed = [(44, 4.0), (45, 3.0)];
    let program =
        begun().act(go(rapid, a(9_000.0))).act(go(rapid, u(0.0))).act(go(rapid, u(400.0)));
    let report = judge(&turning_machine(&not_homed), &program, &none);
    check(
        &report,
        &[(
            Code::Travel,
            5,
            "the program needs 400.000 mm in U, from line 4 to line 5; the machine has 360.000 mm \
             ($134), 40.000 mm less",
        )],
    );
    assert_eq!(report.not_judged.len(), 2, "{:?}", report.not_judged);
    assert!(report.not_judged[0].starts_with("where A lies in its travel: no setting says"));
    // An axis of which nothing is said, and one in a system whose place is not known.
    let program = begun().act(Action::WorkOffset { system: 2 }).act(go(rapid, a(1.0)));
    let report = judge(&turning_machine(&homed), &program, &none);
    check(&report, &[]);
    assert!(report.not_judged.iter().any(|it| it.starts_with("moves of A in G55")), "{report:?}");
}

#[test]
fn a_feed_that_a_further_axis_cannot_follow_is_a_warning() {
    let go =
        |mode, value| Action::Further(FurtherMove { axes: FurtherAxes::NONE.with(0, value), mode });
    let limits = turning_machine(&[(44, 15.0)]);
    let none = KeepOut::default();
    let start = || begun().act(go(FurtherMode::Rapid, 0.0));
    // A turns by 60 degrees while X, Y and Z go 10 mm: at 3600 degrees/min a sixtieth of a minute.
    let along = |feed: f64| {
        start().act(go(FurtherMode::Along, 60.0)).go(
            "X",
            [10.0, 0.0, 10.0],
            Some(feed),
            Shape::Line,
        )
    };
    check(&judge(&limits, &along(590.0), &none), &[]);
    check(
        &judge(&limits, &along(610.0), &none),
        &[(
            Code::MachineSetting,
            5,
            "F610 is faster than the axes: the controller moves at 600 mm/min here ($113 of A)",
        )],
    );
    let alone = |feed| start().act(go(FurtherMode::Feed(feed), 60.0));
    check(&judge(&limits, &alone(3_600.0), &none), &[]);
    check(
        &judge(&limits, &alone(3_700.0), &none),
        &[(
            Code::MachineSetting,
            4,
            "F3700 is faster than the axes: the controller moves at 3600 degrees/min here ($113 of A)",
        )],
    );
}
