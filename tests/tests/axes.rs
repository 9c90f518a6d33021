//! A, B, C, U, V and W from the words of a program to the axes of a board, and back in its reports.

use axis_driver::driver::{Command, JogFrame, JogRequest, OffsetRequest, RunOutcome, RunRequest};
use cnc_msgs::contour::{Action, ContourEventKind};
use cnc_msgs::convert::machine_state_to_wire;
use cnc_msgs::further::{FurtherAxes, FurtherMode, FurtherMove};
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::tool_table::ToolTable;
use kerf_tests::line::Line;
use kerf_tests::planned;
use program_loader::{LoadOptions, load};
use std::sync::Arc;
use virtual_controller::{Build, Firmware, Settings};

/// What a program means, planned and proved.
#[track_caller]
fn path(program: &str) -> CompensatedPath {
    planned(program).unwrap_or_else(|findings| panic!("{program}: {findings:#?}"))
}

/// A board with these axes, whose work zero is where it stands.
fn board(firmware: Firmware, axes: &str) -> Line {
    let settings = Settings::small_router_of(firmware).with_axes(axes.parse().expect("axes"));
    let start_in_machine = Some([-300.0, -200.0, -50.0]);
    let mut line = Line::connected(Build { start_in_machine, ..Build::new(settings) });
    line.zero_here();
    line
}

/// The board's own count of the axes after Z.
fn further(line: &Line) -> [f64; 3] {
    let [.., a, b, c] = line.all_axes();
    [a, b, c]
}

/// What was sent of a program, without status requests, comments of the driver and answers.
fn sent(line: &mut Line, program: &str) -> Vec<String> {
    let then = line.now;
    let result = line.run(path(program));
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{program}: {result:?}");
    line.said_since(then).lines().map(str::to_owned).collect()
}

const FOUR_AXES: &str = "G21 G90 G54
G0 X0 Y0 A0
G1 X10 A90 F300
G1 A180 F1800
X20 Y5 F300
G91 G1 X-5 A-30
G90 G0 A0
M2
";

#[test]
fn a_program_of_four_axes_reaches_the_board_word_for_word() {
    for firmware in [Firmware::GrblHal, Firmware::FluidNc, Firmware::Grbl] {
        let mut line = board(firmware, "XYZA");
        let lines = sent(&mut line, FOUR_AXES);
        let cut: Vec<&str> = lines
            .iter()
            .map(|line| line.trim_start_matches(|c: char| c == 'N' || c.is_ascii_digit()))
            .filter(|line| line.contains('A') || line.starts_with('X'))
            .collect();
        assert_eq!(
            cut,
            ["G0X0Y0A0", "G1X10A90G93F30", "A180G94F1800", "X20Y5F300", "X15A150G93F60", "G0A0"],
            "{firmware}"
        );
        let at = line.axes();
        assert!((at[0] + 285.0).abs() < 0.01 && (at[1] + 195.0).abs() < 0.01, "{at:?}");
        assert_eq!(further(&line), [0.0; 3], "{firmware}");
    }
}

#[test]
fn the_feed_of_a_move_that_turns_is_along_x_y_and_z_whatever_the_board_counts() {
    // 10 mm at 300 mm/min are 2 s, and 3600 degrees at 3600 degrees/min a minute.
    for (program, seconds) in [
        ("G0 X0 A0\nG1 X10 A45 F300\nM2", 2.0),
        ("G0 A0\nG1 A3600 F3600\nM2", 60.0),
        ("G0 X0 A0\nG93 G1 X10 A45 F6\nM2", 10.0),
    ] {
        for firmware in [Firmware::GrblHal, Firmware::FluidNc] {
            let mut line = board(firmware, "XYZA");
            let begun = line.now;
            let result = line.run(path(program));
            assert_eq!(result.outcome, RunOutcome::Succeeded, "{program}: {result:?}");
            let took = (line.now - begun).as_secs_f64();
            // Connected and told; ramps, the last report and the end of the program.
            assert!((seconds..seconds + 2.5).contains(&took), "{program}: {took} s");
        }
    }
}

#[test]
fn six_axes_go_where_the_words_say_and_are_reported() {
    let mut line = board(Firmware::GrblHal, "XYZABC");
    let program = "G21 G90\nG0 A10 B-20 C30\nG1 X5 A11 B-21 C31 F200\nG92 A0\nG1 A1 F500\nM2\n";
    let result = line.run(path(program));
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
    line.wait(1.0);
    let [a, b, c] = further(&line);
    assert!((a - 12.0).abs() < 0.01 && (b + 21.0).abs() < 0.01 && (c - 31.0).abs() < 0.01);
    let state = line.state();
    let places = state.further();
    assert_eq!(places.machine.letters(), "ABC");
    let near = |axes: &FurtherAxes, axis, value: f64| {
        axes.get(axis).is_some_and(|is| (is - value).abs() < 0.01)
    };
    assert!(near(&places.machine, 0, 12.0) && near(&places.work, 1, -21.0));
    let message = machine_state_to_wire(Default::default(), &state);
    assert_eq!((message.further_axes, message.further_machine_position.len()), (0b111, 3));
    assert!((message.further_work_position[2] - 31f64.to_radians()).abs() < 1e-3);
}

#[test]
fn straight_axes_are_sent_where_the_board_has_them() {
    let mut line = board(Firmware::GrblHal, "XYZUA");
    let lines = sent(&mut line, "G20 G90\nG0 U1 A10\nG1 U2 F10\nG1 U1 A0 F10\nM2\n");
    let cut: Vec<&String> = lines.iter().filter(|line| line.contains('U')).collect();
    // Inches, and degrees as they are; one inch at 10 inch/min are 6 s.
    assert!(cut[0].ends_with("G0A10U25.4"), "{cut:?}");
    assert!(cut[1].ends_with("G1U50.8F254"), "{cut:?}");
    assert!(cut[2].ends_with("A0U25.4G93F10"), "{cut:?}");
    assert!((further(&line)[0] - 25.4).abs() < 0.01, "{:?}", further(&line));
}

#[test]
fn offsets_of_rotary_axes_are_stored_by_the_board() {
    let mut line = board(Firmware::GrblHal, "XYZA");
    let program = "G21 G90\nG10 L2 P1 A30\nG0 A10\nG10 L20 P1 A0\nG0 A5\nG53 G0 A7\nG0 A1\nM2\n";
    let lines = sent(&mut line, program);
    for wanted in ["G10L2P1A30", "G10L20P1A0", "G53G0A7"] {
        assert!(lines.iter().any(|line| line.ends_with(wanted)), "{wanted}: {lines:?}");
    }
    // The zero is at 30, then at 40.
    assert!((further(&line)[0] - 41.0).abs() < 0.01, "{:?}", further(&line));
}

#[test]
fn an_axis_goes_to_its_stored_place_with_z() {
    for firmware in [Firmware::GrblHal, Firmware::FluidNc, Firmware::Grbl] {
        let mut line = board(firmware, "XYZA");
        let program = "G21 G90\nG0 Z2 A10\nG28.1\nG0 Z-5 A40\nG91 G28 Z0 A0\nG90\nM2\n";
        let lines = sent(&mut line, program);
        let wanted = "G91G28Z0A0";
        assert!(lines.iter().any(|line| line.ends_with(wanted)), "{firmware}: {lines:?}");
        assert!((further(&line)[0] - 10.0).abs() < 0.01, "{firmware}: {:?}", further(&line));
        assert!((line.axes()[2] + 48.0).abs() < 0.01, "{firmware}: {:?}", line.axes());
    }
}

#[test]
fn a_board_without_the_axis_refuses_before_it_moves_and_names_the_line() {
    let mut line = board(Firmware::GrblHal, "XYZ");
    let then = line.now;
    let request = |program: &str, check_only| {
        Command::RunProgram(RunRequest {
            program_id: "part".into(),
            revision: 1,
            path: Arc::new(path(program)),
            start_line: 0,
            in_span: Default::default(),
            occurrence: Default::default(),
            check_only,
            tool_diameters_mm: Default::default(),
        })
    };
    let refused = match line.ask(request(FOUR_AXES, false)) {
        Err(refusal) => refusal.message,
        Ok(_) => {
            let result = line.result();
            assert_eq!(result.outcome, RunOutcome::Aborted, "{result:?}");
            result.message
        }
    };
    let wanted = "line 2: the program moves A, and this controller has no axis A: its axes are X Y Z; \
                  delete these words, or run the program on a machine with A";
    assert!(refused.contains(wanted), "{refused}");
    assert!(!line.said_since(then).contains('X'), "{}", line.said_since(then));
    let checked = line.ask(request(FOUR_AXES, true)).expect_err("a refusal");
    assert!(checked.message.contains(wanted), "{checked:?}");
    // It has an A, and no B.
    let mut line = board(Firmware::FluidNc, "XYZA");
    let refused = line.ask(request("G0 A0 B5\nM2\n", true)).expect_err("a refusal");
    assert!(refused.message.contains("line 1: the program moves B"), "{refused:?}");
}

#[test]
fn an_axis_that_stays_at_zero_is_left_out_for_a_board_without_it() {
    let mut line = board(Firmware::Grbl, "XYZ");
    let lines = sent(&mut line, "G21 G90\nG0 X1 A0\nG1 X2 A0 F100\nA0\nM2\n");
    assert!(lines.iter().all(|line| !line.contains('A')), "{lines:?}");
    assert!((line.axes()[0] + 298.0).abs() < 0.01, "{:?}", line.axes());
}

#[test]
fn what_a_plan_cannot_know_or_do_is_refused_by_name() {
    for (program, words) in [
        ("G91 G0 A5\nM2", "relies on where A is, which no block before it says"),
        ("G0 A5\nG55\nG91 A5\nM2", "relies on where A is, which is not known since G55 in line 2"),
        ("G92 A0\nM2", "relies on where A is"),
        ("G0 A1\nG93 G1 B5 F1\nM2", "relies on where B is"),
        ("G0 X0 Y0\nG2 X10 I5 A5 F100\nM2", "A cannot move in an arc"),
        ("G81 X1 Y1 Z-1 R1 F100 A5\nM2", "A cannot move in a drilling cycle"),
        ("F100 G5.1 X1 Y1 I1 J1 A5\nM2", "A cannot move in a curve"),
        ("A5\nM2", "A is named, but neither G0 nor G1 is in force"),
        ("G91 G28 A0\nM2", "G28 of A is supported with G91, 0 and one of X, Y and Z alone"),
        ("G28 Z0 A0\nM2", "G28 of A is supported with G91"),
        ("G0 A5\nG91 G28 Z0 A0\nG0 A5\nM2", "relies on where A is, which is not known since G28"),
        ("G0 A1\nG28\nM2", "G28 without axes would also move"),
        ("G53 G1 A0 F100\nM2", "how fast A moves by G53 with G1 is not known"),
        ("G43.1 Z1 A5\nM2", "a tool length along A is not supported"),
        ("G0 X0 Y0\nG53 X0\nG1 X5 A5 F100\nM2", "X is, which is not known since G53"),
        ("G0 A2000000\nM2", "A2000000 is beyond 1000000 degrees"),
        ("T1 M6\nG0 X0 Y0\nG41 D1\nG1 X10 F100\nA5\nX20\nG40 Y5\nM2", "A moves while cutter"),
        ("T1 M6\nG0 X0 Y0\nG41 D1\nG1 X10 A5 F100\nX20\nG40 Y5\nM2", "A moves while cutter"),
    ] {
        let findings = planned(program).expect_err(program);
        assert!(findings.iter().any(|it| it.message.contains(words)), "{program}: {findings:#?}");
        assert!(findings.iter().all(|it| !it.help.is_empty()), "{program}: {findings:#?}");
    }
}

#[test]
fn a_path_that_loses_or_changes_an_axis_is_not_proved() {
    let profile = settings::load_profile("rs274").expect("the shipped profile");
    let loaded = load(FOUR_AXES.as_bytes(), &profile, &LoadOptions::default());
    let tools = ToolTable::default();
    let sound = path(FOUR_AXES);
    assert!(!path_audit::audit(&loaded.contour, &sound, &profile, &tools).refuses());
    let turns = |action: &Action| matches!(action, Action::Further(_));
    let number = sound.events.iter().filter(|event| turns(&event.action)).count();
    assert_eq!(number, 5);
    for index in (0..sound.events.len()).filter(|&index| turns(&sound.events[index].action)) {
        let mut lost = sound.clone();
        lost.events.remove(index);
        let mut moved = sound.clone();
        moved.events[index].at_element += 1;
        let mut turned = sound.clone();
        if let Action::Further(FurtherMove { axes, mode }) = sound.events[index].action {
            let axes = axes.map(|_, value| value + 0.001);
            turned.events[index].action = Action::Further(FurtherMove { axes, mode });
        }
        let mut alone = sound.clone();
        if let Action::Further(it) = &mut alone.events[index].action {
            it.mode = match it.mode {
                FurtherMode::Along => FurtherMode::Rapid,
                _ => FurtherMode::Along,
            };
        }
        for (what, path) in [("lost", lost), ("moved", moved), ("turned", turned), ("alone", alone)]
        {
            let audit = path_audit::audit(&loaded.contour, &path, &profile, &tools);
            assert!(audit.refuses(), "event {index} is {what}");
        }
    }
    // Without the axis there would be one event more or less.
    let events = |kind: &ContourEventKind| matches!(kind, ContourEventKind::Action(a) if turns(a));
    assert_eq!(loaded.contour.events.iter().filter(|event| events(&event.kind)).count(), number);
}

fn jog(frame: JogFrame, further: FurtherAxes, feed_mm_per_min: f64) -> JogRequest {
    JogRequest { frame, axes: AxisSet::NONE, target: [0.0; 3], feed_mm_per_min, further }
}

fn zero(system: u8, further: FurtherAxes, is_origin: bool) -> Command {
    let (axes, position) = (AxisSet::NONE, [0.0; 3]);
    Command::SetWorkOffset(OffsetRequest { system, axes, position, is_origin, further })
}

#[test]
fn further_axes_are_zeroed_and_jogged_in_every_frame() {
    let a = |value| FurtherAxes::NONE.with(0, value);
    for firmware in [Firmware::GrblHal, Firmware::FluidNc, Firmware::Grbl] {
        let mut line = board(firmware, "XYZA");
        for (frame, to, wanted) in [
            (JogFrame::Relative, -30.0, -30.0),
            (JogFrame::Work, 90.0, 90.0),
            (JogFrame::Relative, 0.5, 90.5),
        ] {
            line.ask(Command::Jog(jog(frame, a(to), 1_000.0))).expect("the jog begins");
            let result = line.move_result();
            assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware} {frame:?}: {result:?}");
            assert!((further(&line)[0] - wanted).abs() < 0.01, "{firmware} {frame:?}");
            let reported = result.further.get(0).expect("where A stands");
            assert!((reported - wanted).abs() < 0.01, "{firmware} {frame:?}: {reported}");
        }
        line.ask(zero(1, a(10.0), false)).expect("A is set");
        line.ask(Command::Jog(jog(JogFrame::Work, a(0.0), 1_000.0))).expect("the jog begins");
        assert_eq!(line.move_result().error_code, 0);
        assert!((further(&line)[0] - 80.5).abs() < 0.01, "{firmware}");
        // X, Y and Z are where they were.
        let at = line.axes();
        assert!((at[0] + 300.0).abs() < 1e-6 && (at[2] + 50.0).abs() < 1e-6, "{firmware}: {at:?}");
        line.ask(zero(2, a(45.0), true)).expect("the origin of A is set");
        // The feed is in degrees/min.
        let begun = line.now;
        line.ask(Command::Jog(jog(JogFrame::Relative, a(60.0), 600.0))).expect("the jog begins");
        assert_eq!(line.move_result().error_code, 0);
        let took = (line.now - begun).as_secs_f64();
        assert!((6.0..7.5).contains(&took), "{firmware}: {took} s");
    }
}

#[test]
fn a_jog_of_further_axes_that_boards_understand_differently_moves_nothing() {
    let mut line = board(Firmware::GrblHal, "XYZAU");
    let both = FurtherAxes::NONE.with(0, 1.0).with(3, 1.0);
    let with_x = JogRequest {
        axes: AxisSet::NONE.with(0),
        ..jog(JogFrame::Relative, FurtherAxes::NONE.with(0, 1.0), 100.0)
    };
    let missing = FurtherAxes::NONE.with(2, 1.0);
    let far = FurtherAxes::NONE.with(0, 70_000.0);
    let relative = |further| Command::Jog(jog(JogFrame::Relative, further, 100.0));
    for (command, said) in [
        (relative(both), "boards differ"),
        (Command::Jog(with_x), "boards differ"),
        (relative(missing), "the controller has no axis C: it has X Y Z A U"),
        (relative(far), "A70000 is not between -65536 and 65536 degrees"),
        (relative(FurtherAxes::NONE), "no axis is named"),
        (zero(1, missing, false), "the controller has no axis C"),
    ] {
        let refusal = line.ask(command).expect_err("refused");
        assert!(refusal.message.contains(said), "{refusal:?}");
    }
    assert_eq!(further(&line), [0.0; 3]);
    // A jog that is stopped says where the axis is.
    line.ask(relative(FurtherAxes::NONE.with(0, 300.0))).expect("the jog begins");
    line.wait(2.0);
    line.ask(Command::FeedHold).ok();
    let result = line.move_result();
    assert_eq!(result.error_code, axis_driver::codes::error_code::STOPPED_SHORT, "{result:?}");
    assert!(result.message.contains("and not at A300.000"), "{result:?}");
}

#[test]
fn an_axis_that_stays_where_it_is_may_be_named_in_arcs_and_under_compensation() {
    let program = "G21 G90\nT1 M6\nG0 X0 Y0 Z5 A0\nG2 X10 Y0 I5 J0 A0 F100\nG0 X0 Y-20 A0\n\
                   G41 D1 G1 X0 Y0 A0 F100\nX40 A0\nG40 X60 Y-20 A0\nM2\n";
    let turns =
        path(program).events.iter().filter(|it| matches!(it.action, Action::Further(_))).count();
    assert_eq!(turns, 1, "only the first one says where A is");
    assert!(planned("G21 G90\nG0 X0 Y0 A0\nG2 X10 Y0 I5 J0 A1 F100\nM2\n").is_err());
}

#[test]
fn an_axis_turns_at_its_own_feed_where_the_others_stand_but_for_rounding() {
    let mut line = board(Firmware::GrblHal, "XYZA");
    let lines = sent(&mut line, "G21 G90\nG0 X10 A0\nG1 X[10+0.00000001] A90 F600\nM2\n");
    assert!(lines.iter().any(|it| it.ends_with("G1A90F600")), "{lines:?}");
}
