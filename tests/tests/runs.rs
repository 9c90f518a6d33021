//! Runs from the middle, alarms with their block, line numbers, signs of life: the driver
//! against the virtual controller.

use axis_driver::codes::error_code;
use axis_driver::driver::{
    CheckTravel, Command, DriverConfig, OnCommanderLoss, RunOutcome, RunRequest,
};
use axis_driver::encoder::EncoderConfig;
use cnc_msgs::contour::{Action, Source, SpindleMode};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{AxisSet, Shape};
use cnc_msgs::machine::Mode;
use cnc_msgs::path::{CompensatedPath, PathElement, PathEvent, Role};
use kerf_tests::line::{Line, straight};
use kerf_tests::planned;
use std::sync::Arc;
use virtual_controller::{Build, Firmware, Settings};

fn element(line: u32, end: [f64; 3], role: Role) -> PathElement {
    PathElement {
        side: None,
        shape: Shape::Line,
        end,
        feed_mm_per_min: Some(600.0),
        role,
        axes: AxisSet::NONE,
        source: Source { line, block: Some(line * 10), ..Source::default() },
    }
}

/// A contour that is entered in line 3 and left in line 6, with a spindle and a tool.
fn contour() -> CompensatedPath {
    let event = |at_element, action| PathEvent { at_element, action, source: Source::default() };
    CompensatedPath {
        elements: vec![
            PathElement { axes: AxisSet::ALL, ..element(1, [10.0, 0.0, -2.0], Role::None) },
            element(2, [20.0, 0.0, -2.0], Role::None),
            element(3, [25.0, 5.0, -2.0], Role::LeadOn),
            element(4, [35.0, 5.0, -2.0], Role::Contour),
            element(5, [35.0, 15.0, -2.0], Role::Contour),
            element(6, [30.0, 20.0, -2.0], Role::LeadOff),
            element(7, [0.0, 20.0, -2.0], Role::None),
        ],
        events: vec![
            event(0, Action::SpindleSpeed { rpm: 8_000.0 }),
            event(0, Action::Spindle(SpindleMode::Clockwise)),
        ],
        ..CompensatedPath::default()
    }
}

/// A router that is homed, with its work zero at a place within its travel.
fn homed(config: DriverConfig) -> Line {
    let mut settings = Settings::small_router();
    settings.set_line("$22=1").unwrap();
    let mut line = Line::new(config, Build::new(settings), &[]);
    line.until("locked", |line| line.mode() == Mode::Alarm);
    line.ask(Command::Home).unwrap();
    line.ask(Command::SetWorkOffset(axis_driver::driver::OffsetRequest {
        further: FurtherAxes::NONE,
        system: 1,
        axes: AxisSet::ALL,
        position: [-500.0, -300.0, -40.0],
        is_origin: true,
    }))
    .unwrap();
    line
}

/// To a height above the place where homing leaves the tool.
fn lifting() -> DriverConfig {
    lifting_to(-0.5)
}

fn lifting_to(height: f64) -> DriverConfig {
    let encoder = EncoderConfig { approach_z_mm: Some(height), ..EncoderConfig::default() };
    DriverConfig { encoder, ..DriverConfig::default() }
}

fn request(path: &CompensatedPath, start_line: u32) -> Command {
    Command::RunProgram(RunRequest {
        program_id: "part".into(),
        revision: 1,
        path: Arc::new(path.clone()),
        start_line,
        occurrence: 0,
        in_span: Default::default(),
        check_only: false,
        tool_diameters_mm: Default::default(),
    })
}

#[test]
fn m28_a_start_in_the_middle_lifts_goes_over_and_comes_down_at_feed_rate() {
    let mut line = homed(lifting());
    let then = line.now;
    line.start(contour(), 3);
    line.until("the contour", |line| line.state().line == 4);
    let said = line.said_since(then);
    let order = ["G53G0Z-.5\n", "S8000\n", "M3\n", "G0X20Y0\n", "G1Z-2F600\n", "X25Y5\n"];
    let places: Vec<_> = order.iter().map(|text| said.find(text)).collect();
    assert!(places.iter().all(Option::is_some), "{places:?} in {said:?}");
    assert!(places.is_sorted(), "{places:?} in {said:?}");
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    let at = line.state().work_position.unwrap();
    assert!((at[0] - 0.0).abs() < 0.01 && (at[1] - 20.0).abs() < 0.01, "{at:?}");
}

#[test]
fn m28_a_start_under_compensation_is_refused_with_the_nearest_lines() {
    let mut line = homed(lifting());
    let refusal = line.ask(request(&contour(), 5)).unwrap_err();
    assert_eq!(refusal.error_code, error_code::START_LINE);
    assert_eq!(
        refusal.message,
        "line 5 is under cutter compensation: the nearest lines to begin at are 3, where it \
         begins, and 7, where it has ended"
    );
}

#[test]
fn without_a_home_nothing_is_approached() {
    let mut line = Line::new(lifting(), Build::new(Settings::small_router()), &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    let then = line.now;
    let refusal = line.ask(request(&contour(), 3)).unwrap_err();
    assert_eq!(refusal.error_code, error_code::START_POSITION, "{refusal}");
    assert_eq!(line.said_since(then), "");
}

#[test]
fn a_soft_limit_names_the_block_that_was_read_and_a_switch_the_one_that_was_cut() {
    for (setting, fault, wanted) in
        [("$20=1", None, "ALARM:2"), ("$21=1", Some("limit:X@time=14"), "ALARM:1")]
    {
        let mut settings = Settings::small_router();
        for line in ["$22=1", setting] {
            settings.set_line(line).unwrap();
        }
        let faults: Vec<&str> = fault.into_iter().collect();
        let build =
            Build { start_in_machine: Some([-590.0, -200.0, -50.0]), ..Build::new(settings) };
        // The driver would refuse the program.
        let config = DriverConfig { check_travel: CheckTravel::Off, ..DriverConfig::default() };
        let mut line = Line::new(config, build, &faults);
        line.until("locked", |line| line.mode() == Mode::Alarm);
        line.ask(Command::Unlock).unwrap();
        let mut path = straight(30, 10.0);
        path.assumed_axes = AxisSet::NONE;
        for element in &mut path.elements {
            element.end[0] -= 590.0;
            element.source.block = Some(element.source.line * 10);
        }
        if fault.is_none() {
            path.elements[20].end[0] = 50.0;
        }
        line.start(path, 0);
        let result = line.result();
        assert_eq!(result.error_code, error_code::ALARM);
        assert!(result.message.starts_with(wanted), "{}", result.message);
        let place = format!("at line {} (N{})", result.blamed_line, result.blamed_line * 10);
        assert!(result.message.ends_with(&place), "{}", result.message);
        if fault.is_none() {
            assert_eq!(result.blamed_line, 21);
        } else {
            assert_eq!(result.blamed_line, result.last_line);
            assert!(result.last_line > 3, "{result:?}");
        }
        assert!(!line.state().is_homed);
        line.wait(5.0);
        assert_eq!(line.mode(), Mode::Alarm, "nothing unlocks by itself");
    }
}

#[test]
fn a_controller_that_says_its_line_is_believed() {
    let encoder = EncoderConfig { line_numbers: true, ..EncoderConfig::default() };
    let config = DriverConfig { encoder, ..DriverConfig::default() };
    let build = Build { has_line_numbers: true, ..Build::new(Settings::small_router()) };
    let mut line = Line::new(config, build, &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    // Forth and back over the same place: the position alone does not determine the line.
    let mut path = straight(40, 10.0);
    for (index, element) in path.elements.iter_mut().enumerate() {
        element.end[0] = if index % 2 == 0 { 10.0 } else { 0.0 };
    }
    let then = line.now;
    line.start(path, 0);
    let mut seen = Vec::new();
    while line.finished.is_none() {
        line.step();
        let now = line.state().line;
        if seen.last() != Some(&now) {
            seen.push(now);
        }
    }
    assert!(line.said_since(then).contains("N17X10\n"), "{}", line.said_since(then));
    assert!(seen.is_sorted() && seen.len() > 30, "{seen:?}");
    assert_eq!(line.result().last_line, 40);
}

#[test]
fn a_commander_that_stays_away_is_missed_once_and_only_when_it_was_there() {
    for (policy, mode) in [
        (OnCommanderLoss::Continue, Mode::Run),
        (OnCommanderLoss::Hold, Mode::Hold),
        (OnCommanderLoss::HoldThenAbort, Mode::Idle),
    ] {
        let config = DriverConfig { on_commander_loss: policy, ..DriverConfig::default() };
        let mut line = Line::new(config, Build::new(Settings::small_router()), &[]);
        line.until("idle", |line| line.mode() == Mode::Idle);
        line.start(straight(115, 5.0), 0);
        line.wait(3.0);
        assert_eq!(line.mode(), Mode::Run, "no heartbeat was sent");
        for _ in 0..10 {
            line.ask(Command::Heartbeat).unwrap();
            line.wait(0.5);
        }
        assert_eq!(line.mode(), Mode::Run);
        line.wait(3.0);
        assert_eq!(line.mode(), mode, "{policy:?}: {}", line.state().reason);
        match policy {
            OnCommanderLoss::Continue => {}
            OnCommanderLoss::Hold => {
                assert!(line.state().reason.starts_with("COMMANDER_LOST"), "{:?}", line.state());
                // A sign of life resumes nothing.
                line.ask(Command::Heartbeat).unwrap();
                line.wait(0.5);
                assert_eq!(line.mode(), Mode::Hold);
                line.ask(Command::Resume).unwrap();
                line.ask(Command::Heartbeat).unwrap();
            }
            OnCommanderLoss::HoldThenAbort => {
                assert_eq!(line.result().error_code, error_code::COMMANDER_LOST);
                continue;
            }
        }
        while line.finished.is_none() {
            line.wait(0.5);
            line.ask(Command::Heartbeat).unwrap();
        }
        assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    }
}

#[test]
fn with_require_recording_nothing_is_sent_before_the_bag_is_open() {
    let config = DriverConfig { require_recording: true, ..DriverConfig::default() };
    let mut line = Line::new(config, Build::new(Settings::small_router()), &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    let word = |is_whole, reason: &str| Command::Recorder { is_whole, reason: reason.into() };

    let then = line.now;
    line.start(straight(5, 5.0), 0);
    line.wait(2.0);
    assert_eq!(line.said_since(then), "");
    assert!(line.state().reason.starts_with("WAITING_FOR_RECORDER"), "{:?}", line.state());
    let result = line.result();
    assert_eq!(result.error_code, error_code::NOT_RECORDING, "{result:?}");
    assert_eq!(line.said_since(then), "");

    line.start(straight(5, 5.0), 0);
    line.ask(word(false, "No space left on device")).unwrap();
    let result = line.result();
    assert!(result.message.contains("No space left"), "{result:?}");

    line.start(straight(5, 5.0), 0);
    line.ask(word(true, "")).unwrap();
    line.until("it cuts", |line| line.state().line >= 2);
    // It holds, once; the operator decides whether the part is worth more than its record.
    line.ask(word(false, "No space left on device")).unwrap();
    line.until("it is at rest", |line| line.mode() == Mode::Hold);
    let reason = line.state().reason.clone();
    assert!(reason.starts_with("RECORD_NOT_WHOLE") && reason.contains("No space left"), "{reason}");
    line.wait(5.0);
    assert_eq!(line.mode(), Mode::Hold, "nothing resumes by itself");
    line.ask(Command::Resume).unwrap();
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    assert!(line.log.iter().any(|text| text.contains("not complete: No space left")));

    // An MDI block has no bag: it does not wait for one, and another bag does not hold it.
    line.finished = None;
    line.begin(Command::ExecuteMdi {
        path: Arc::new(straight(1, 5.0)),
        tool_diameters_mm: Default::default(),
    });
    line.until("it runs", |line| line.mode() == Mode::Run);
    line.ask(word(false, "No space left on device")).unwrap();
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
}

#[test]
fn without_require_recording_the_part_is_worth_more_than_its_record() {
    let build = Build::new(Settings::small_router());
    let mut line = Line::new(DriverConfig::default(), build, &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    let then = line.now;
    line.start(straight(5, 5.0), 0);
    line.until("it cuts", |line| line.state().line >= 2);
    let reason = "No space left on device".into();
    line.ask(Command::Recorder { is_whole: false, reason }).unwrap();
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    assert!(!line.said_since(then).contains('!'));
    assert!(line.log.iter().any(|text| text.contains("not complete: No space left")));
}

/// Cut at Z-5, a retract in the machine frame, another tool, on in rapid: as posted.
fn with_retract() -> CompensatedPath {
    let mut path = contour();
    path.elements = vec![
        element(1, [0.0, 0.0, -5.0], Role::None),
        element(2, [10.0, 0.0, -5.0], Role::None),
        PathElement {
            feed_mm_per_min: None,
            axes: AxisSet::from_bits(0b011),
            ..element(5, [0.0, 20.0, -5.0], Role::None)
        },
        element(6, [0.0, 20.0, -8.0], Role::None),
    ];
    path.elements[0].axes = AxisSet::ALL;
    let retract = Action::MachineMove {
        target: [0.0, 0.0, -1.0],
        axes: AxisSet::from_bits(0b100),
        rapid: true,
        feed_mm_per_min: 0.0,
    };
    let source = Source { line: 3, ..Source::default() };
    path.events.push(PathEvent { at_element: 2, action: retract, source });
    path
}

#[test]
fn m28_behind_a_retract_the_tool_stays_up_and_is_never_taken_back_into_the_part() {
    let mut line = homed(lifting());
    let then = line.now;
    line.start(with_retract(), 5);
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    let said = line.said_since(then);
    let moves: Vec<&str> = said.lines().filter(|text| text.contains(['X', 'Y', 'Z'])).collect();
    assert_eq!(moves, ["G53G0Z-.5", "G0X10Y0", "G0X0Y20", "G1Z-8F600"]);
    // Without a height there is no place that could be gone to.
    let mut line = homed(DriverConfig::default());
    let refusal = line.ask(request(&with_retract(), 5)).unwrap_err();
    assert_eq!(refusal.error_code, error_code::START_LINE);
    assert!(refusal.message.contains("Z has not been given since G53"), "{refusal}");
}

#[test]
fn m28_before_the_first_motion_the_tool_is_lifted_and_goes_nowhere_else() {
    let mut line = homed(lifting());
    let mut path = with_retract();
    path.elements.iter_mut().for_each(|element| element.source.line += 10);
    let then = line.now;
    line.start(path.clone(), 3);
    line.until("it cuts", |line| line.state().line == 12);
    let said = line.said_since(then);
    let moves: Vec<&str> = said.lines().filter(|text| text.contains(['X', 'Y', 'Z'])).collect();
    assert_eq!(moves[..2], ["G53G0Z-.5", "G1X0Y0Z-5F600"], "{said}");
    // Where no height is given, the message says what the first move is.
    let mut line = homed(DriverConfig::default());
    let check = match request(&path, 3) {
        Command::RunProgram(request) => RunRequest { check_only: true, ..request },
        other => panic!("{other:?}"),
    };
    let said = line.ask(Command::RunProgram(check)).expect("it may begin");
    assert!(said.contains("the first move goes from where the tool stands"), "{said}");
    // The whole program begins as before.
    let mut line = homed(lifting());
    let then = line.now;
    line.start(path, 1);
    line.until("it cuts", |line| line.state().line == 12);
    let said = line.said_since(then);
    let first = said.lines().find(|text| text.contains(['X', 'Y', 'Z']));
    assert_eq!(first, Some("G1X0Y0Z-5F600"), "nothing is lifted");
}

#[test]
fn m28_nothing_is_lifted_downwards() {
    // Homing has left the tool at Z-2.
    for (height, expected) in [(-30.0, "G53G0Z-2"), (-0.5, "G53G0Z-.5")] {
        let mut line = homed(lifting_to(height));
        let then = line.now;
        line.start(contour(), 3);
        line.until("the contour", |line| line.state().line == 4);
        let said = line.said_since(then);
        let up = said.lines().find(|text| text.starts_with("G53"));
        assert_eq!(up, Some(expected), "{height}");
    }
}

#[test]
fn parameters_are_taken_between_runs() {
    let mut line = Line::new(DriverConfig::default(), Build::new(Settings::small_router()), &[]);
    let patient = DriverConfig { commander_timeout_ms: 4_000, ..DriverConfig::default() };
    let change = || Command::SetConfig(Box::new(patient.clone()));
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.start(straight(115, 5.0), 0);
    line.wait(0.5);
    assert_eq!(line.ask(change()).unwrap_err().error_code, error_code::BUSY);
    line.ask(Command::CancelRun { run: None }).unwrap();
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.ask(change()).unwrap();
    line.start(straight(115, 5.0), 0);
    line.ask(Command::Heartbeat).unwrap();
    line.wait(3.5);
    assert_eq!(line.mode(), Mode::Run, "{}", line.state().reason);
    line.wait(1.5);
    assert!(line.state().reason.contains("4000 ms"), "{:?}", line.state());
}

#[test]
fn a_commander_that_has_ended_does_not_stop_the_run_of_its_successor() {
    let mut line = Line::new(DriverConfig::default(), Build::new(Settings::small_router()), &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.ask(Command::Heartbeat).unwrap();
    line.ask(Command::ForgetCommander).unwrap();
    line.start(straight(115, 5.0), 0);
    line.wait(3.0);
    assert_eq!(line.mode(), Mode::Run, "{}", line.state().reason);
    // One that is under way keeps the commander that gave a sign of life.
    line.ask(Command::Heartbeat).unwrap();
    line.ask(Command::ForgetCommander).unwrap();
    line.wait(3.0);
    assert!(line.state().reason.starts_with("COMMANDER_LOST"), "{:?}", line.state());
}

#[test]
fn a_commander_that_dies_before_the_run_has_begun_is_missed_too() {
    let config = DriverConfig { require_recording: true, ..DriverConfig::default() };
    let mut line = Line::new(config, Build::new(Settings::small_router()), &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.ask(Command::Heartbeat).unwrap();
    let then = line.now;
    line.start(straight(5, 5.0), 0);
    assert_eq!(line.result().error_code, error_code::COMMANDER_LOST);
    assert_eq!(line.said_since(then), "");
    // One that went long ago is not missed by another.
    line.ask(Command::Heartbeat).unwrap();
    line.wait(30.0);
    line.start(straight(5, 5.0), 0);
    line.ask(Command::Recorder { is_whole: true, reason: String::new() }).unwrap();
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
}

#[test]
fn a_silence_in_a_run_wants_an_operator_whatever_comes_after_it() {
    let faults = ["silent:3@time=6", "reset@time=9.2"];
    let mut line =
        Line::new(DriverConfig::default(), Build::new(Settings::small_router()), &faults);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.start(straight(590, 1.0), 0);
    assert_eq!(line.result().error_code, error_code::LINK_LOST);
    line.wait(8.0);
    assert!(line.state().needs_reset, "{:?}", line.state());
    let refusal = line.ask(request(&straight(3, 1.0), 0)).unwrap_err();
    assert_eq!(refusal.error_code, error_code::NEEDS_RESET);
    line.ask(Command::SoftReset).unwrap();
    assert_eq!(line.run(straight(3, 1.0)).outcome, RunOutcome::Succeeded);
}

#[test]
fn a_program_in_g59_3_runs_where_the_board_has_it_and_nowhere_else() {
    let program = "G21 G90 G94 G59.3 F1200\nG0 X0 Y0\nG1 X20\nG4 P1\nG10 L2 P9 X-200\nG1 X10\nG4 P1\nG54 G0 X0\nM30\n";
    let path = planned(program).expect("a path");
    for firmware in Firmware::ALL {
        let build = Build {
            start_in_machine: Some([-300.0, -200.0, -50.0]),
            ..Build::new(Settings::small_router_of(firmware))
        };
        let mut line = Line::connected(build);
        line.zero_here();
        let origin = Command::SetWorkOffset(axis_driver::driver::OffsetRequest {
            further: FurtherAxes::NONE,
            system: 9,
            axes: AxisSet::ALL,
            position: [-250.0, -150.0, -40.0],
            is_origin: true,
        });
        let is_there = line.ask(origin);
        if firmware != Firmware::GrblHal {
            let refused = is_there.expect_err("no such system");
            assert!(refused.message.contains("this controller has no G59.3"), "{refused:?}");
            let refused = line.ask(request(&path, 0)).expect_err("no such system").message;
            assert_eq!(
                refused,
                "line 1: this controller has no G59.3: it reports no offset of it ($#)"
            );
            continue;
        }
        is_there.expect("it has nine");
        let result = line.run(path.clone());
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?} {:?}", line.log);
        assert!(!line.has_held(), "the watch has seen nothing wrong");
        let passed = |x: f64| {
            line.states
                .iter()
                .filter_map(|(_, it)| it.machine_position)
                .any(|at| (at[0] - x).abs() < 0.01)
        };
        assert!(passed(-230.0) && passed(-190.0) && passed(-300.0), "{:?}", line.log);
        assert!(line.states.iter().any(|(_, it)| it.work_system == 9));
    }
}
