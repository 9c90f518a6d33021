//! grbl 1.1, grblHAL and FluidNC: the same driver, distinguished by their output.

use axis_driver::codes::error_code;
use axis_driver::driver::{
    Command, DriverConfig, JogFrame, JogRequest, OnPathDeviation, Overrides, ProbeRequest,
    RunOutcome,
};
use axis_driver::firmware;
use cnc_msgs::contour::{Action, CoolantMode, SpindleMode};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{Arc, AxisSet, Plane, Shape};
use cnc_msgs::machine::Mode;
use cnc_msgs::path::CompensatedPath;
use kerf_tests::line::{Line, events, short_segments, straight};
use virtual_controller::{Build, Firmware, Settings};

const START: [f64; 3] = [-300.0, -200.0, -50.0];

fn build(firmware: Firmware) -> Build {
    let start_in_machine = Some(START);
    Build { start_in_machine, ..Build::new(Settings::small_router_of(firmware)) }
}

fn connected(firmware: Firmware) -> Line {
    Line::connected(build(firmware))
}

/// A program of everything: lines, arcs in three planes, a full circle, a helix, spindle,
/// coolant, dwell, work systems.
fn everything() -> CompensatedPath {
    let mut path = straight(9, 2.0);
    let arc = |center, plane, turns| Shape::Arc(Arc { center, plane, clockwise: false, turns });
    let shapes = [
        (2, arc([5.0, 0.0, 0.0], Plane::Xy, 0), [6.0, 0.0, 0.0]),
        (3, arc([6.0, 5.0, 0.0], Plane::Xy, 1), [6.0, 0.0, 0.0]),
        (4, arc([6.0, 5.0, 0.0], Plane::Xy, 2), [6.0, 0.0, -3.0]),
        (5, arc([6.0, 0.0, -5.0], Plane::Zx, 0), [6.0, 0.0, -7.0]),
        (6, arc([6.0, 2.0, -7.0], Plane::Yz, 0), [6.0, 4.0, -7.0]),
    ];
    for (index, shape, end) in shapes {
        (path.elements[index].shape, path.elements[index].end) = (shape, end);
    }
    for element in &mut path.elements[7..] {
        element.end[1] = 4.0;
        element.end[2] = -7.0;
    }
    path.events = events(&[
        (0, Action::SpindleSpeed { rpm: 5_000.0 }),
        (0, Action::Spindle(SpindleMode::CounterClockwise)),
        (1, Action::Coolant(CoolantMode::Flood)),
        (3, Action::Dwell { seconds: 0.3 }),
        (5, Action::ExactStop),
        (9, Action::Coolant(CoolantMode::Off)),
        (9, Action::Spindle(SpindleMode::Off)),
        (9, Action::ProgramEnd { rewind: true }),
    ]);
    path
}

#[test]
fn each_family_is_recognised_by_its_output() {
    for (firmware, family, planner_blocks, receive_bytes, window) in [
        (Firmware::Grbl, firmware::Firmware::Grbl, 15, 128, 127),
        (Firmware::GrblHal, firmware::Firmware::GrblHal, 100, 1024, 230),
        // It reports no sizes: the driver assumes what every board has.
        (Firmware::FluidNc, firmware::Firmware::FluidNc, 15, 128, 127),
    ] {
        let line = connected(firmware);
        let settings = line.settings.clone().unwrap();
        assert_eq!(settings.firmware, family);
        assert_eq!(
            (settings.planner_blocks, settings.receive_bytes, settings.window),
            (planner_blocks, receive_bytes, window),
            "{firmware:?}"
        );
    }
}

#[test]
fn a_board_with_a_small_buffer_is_believed_and_never_over_filled() {
    let build = Build { receive_buffer_bytes: Some(254), ..build(Firmware::GrblHal) };
    let config = DriverConfig { hold_latency_ms_max: 1_000, ..DriverConfig::default() };
    let mut line = Line::new(config, build, &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    assert!(line.driver.window() <= 253, "{}", line.driver.window());
    assert_eq!(line.run(short_segments(3_000, 0.4)).outcome, RunOutcome::Succeeded);
    assert_eq!(line.controller.device().controller().overrun_bytes(), 0);
}

#[test]
fn a_program_of_everything_runs_on_every_family() {
    for firmware in Firmware::ALL {
        let mut line = connected(firmware);
        line.zero_here();
        line.start(everything(), 0);
        line.until("it turns", |line| line.state().spindle == Some(SpindleMode::CounterClockwise));
        line.until("it is wet", |line| line.state().flood);
        let result = line.result();
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware:?}: {result:?}");
        line.wait(5.0);
        let state = line.state();
        assert_eq!((state.mode, state.flood), (Mode::Idle, false), "{firmware:?}");
        assert_eq!(state.spindle, Some(SpindleMode::Off), "{firmware:?}");
        let at = state.work_position.unwrap();
        assert!((at[0] - 18.0).abs() < 0.01 && (at[1] - 4.0).abs() < 0.01, "{firmware:?}: {at:?}");
        assert_eq!(line.controller.device().controller().overrun_bytes(), 0);
    }
}

#[test]
fn hold_resume_and_cancel_keep_the_position_on_every_family() {
    for firmware in Firmware::ALL {
        let mut line = connected(firmware);
        line.start(straight(60, 5.0), 0);
        line.until("it cuts", |line| line.state().line >= 4);
        line.ask(Command::FeedHold).unwrap();
        line.until("a hold", |line| line.mode() == Mode::Hold);
        while !line.ask_resume() {}
        line.until("it cuts on", |line| line.state().line >= 8);
        line.ask(Command::CancelRun { run: None }).unwrap();
        let result = line.result();
        assert_eq!(result.outcome, RunOutcome::Canceled, "{firmware:?}");
        line.until("a place", |line| line.state().work_position.is_some());
        let at = line.state().work_position.unwrap();
        // Line n goes from 5 (n - 1) to 5 n.
        let along = at[0] / 5.0;
        assert!(
            (along.floor() + 1.0 - f64::from(result.last_line)).abs() < 0.1,
            "{at:?} {result:?}"
        );
        // And the next program runs from here.
        let mut next = straight(3, 1.0);
        next.elements.iter_mut().for_each(|element| element.end[0] += at[0]);
        assert_eq!(line.run(next).outcome, RunOutcome::Succeeded, "{firmware:?}");
    }
}

#[test]
fn a_refused_line_stops_every_family_and_a_reset_makes_it_well() {
    for firmware in Firmware::ALL {
        let mut refused = 0;
        // A byte of the program is damaged in transit: some of them make a line that is refused.
        for byte in 200..260 {
            let fault = format!("rx-corrupt@byte={byte}");
            // A damaged line that is executed is another matter.
            let on_path_deviation = OnPathDeviation::Off;
            let config = DriverConfig { on_path_deviation, ..DriverConfig::default() };
            let mut line = Line::new(config, build(firmware), &[&fault]);
            line.until("idle", |line| line.mode() == Mode::Idle);
            line.start(straight(40, 5.0), 0);
            let result = line.result();
            if result.error_code != error_code::CONTROLLER_ERROR {
                continue;
            }
            refused += 1;
            assert!(result.message.contains("the controller refused"), "{}", result.message);
            let then = line.now;
            line.wait(3.0);
            assert!(line.state().needs_reset, "{firmware:?}: {:?}", line.state());
            assert_eq!(line.mode(), Mode::Hold, "{firmware:?}");
            assert!(!line.said_since(then).contains('\x18'));
            line.ask(Command::SoftReset).unwrap();
            line.until("a place", |line| line.state().work_position.is_some());
            assert_eq!(line.mode(), Mode::Idle, "{firmware:?}");
            let at = line.state().work_position.unwrap();
            let mut next = straight(3, 1.0);
            next.elements.iter_mut().for_each(|element| element.end[0] += at[0]);
            assert_eq!(line.run(next).outcome, RunOutcome::Succeeded, "{firmware:?}");
        }
        assert!(refused > 10, "{firmware:?}: {refused} lines were refused");
    }
}

#[test]
fn jog_probe_home_and_overrides_work_on_every_family() {
    for firmware in Firmware::ALL {
        let mut settings = Settings::small_router_of(firmware);
        settings.set_line("$22=1").unwrap();
        let build = Build {
            start_in_machine: Some(START),
            probe_surface_z_mm: Some(-62.0),
            ..Build::new(settings)
        };
        let mut line = Line::new(DriverConfig::default(), build, &[]);
        line.until("connected", |line| matches!(line.mode(), Mode::Alarm | Mode::Idle));
        line.ask(Command::Home).unwrap();
        assert!(line.state().is_homed, "{firmware:?}");
        assert_eq!(line.mode(), Mode::Idle, "{firmware:?}");
        let jog = |target, feed_mm_per_min| {
            let (frame, axes) = (JogFrame::Machine, AxisSet::ALL);
            Command::Jog(JogRequest {
                further: FurtherAxes::NONE,
                frame,
                axes,
                target,
                feed_mm_per_min,
            })
        };
        line.ask(jog(START, 5_000.0)).unwrap();
        let result = line.move_result();
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware:?}: {result:?}");
        // A jog that is refused leaves nothing sticking.
        line.ask(jog([500.0, 0.0, 0.0], 1.0)).unwrap();
        let id = 999;
        line.handle(axis_driver::driver::Input::Command {
            id,
            command: Command::CancelRun { run: None },
        });
        line.move_result();
        line.ask(jog(START, 5_000.0)).unwrap();
        assert_eq!(line.move_result().outcome, RunOutcome::Succeeded, "{firmware:?}");
        line.ask(Command::SetOverrides(Overrides { feed: Some(57), ..Overrides::default() }))
            .unwrap();
        line.until("the override", |line| line.state().overrides_percent[0] == 57);
        let probe = Command::Probe(ProbeRequest {
            further: FurtherAxes::NONE,
            axes: AxisSet::NONE.with(2),
            distance: [0.0, 0.0, -20.0],
            feed_mm_per_min: 200.0,
            away: false,
            may_miss: false,
        });
        line.ask(probe).unwrap();
        let result = line.move_result();
        assert!(result.found, "{firmware:?}: {result:?}");
        assert!((result.machine_position.unwrap()[2] + 62.0).abs() < 0.02, "{result:?}");
    }
}

#[test]
fn homing_that_fails_is_reported_on_every_family() {
    for firmware in Firmware::ALL {
        let mut settings = Settings::small_router_of(firmware);
        settings.set_line("$22=1").unwrap();
        let build = Build { start_in_machine: Some(START), ..Build::new(settings) };
        let mut line = Line::new(DriverConfig::default(), build, &["cut:X@time=0"]);
        line.until("connected", |line| matches!(line.mode(), Mode::Alarm | Mode::Idle));
        let refusal = line.ask(Command::Home).unwrap_err();
        assert!(
            matches!(refusal.error_code, error_code::ALARM | error_code::RESTARTED),
            "{firmware:?}: {refusal:?}"
        );
        assert!(!line.state().is_homed);
        line.wait(10.0);
        assert_eq!(line.mode(), Mode::Alarm, "{firmware:?}: {:?}", line.state());
    }
}

#[test]
fn check_mode_reads_every_line_moves_nothing_and_ends_in_a_reset() {
    for firmware in Firmware::ALL {
        let config = DriverConfig { check_in_controller: true, ..DriverConfig::default() };
        let check = |path: CompensatedPath| {
            Command::RunProgram(axis_driver::driver::RunRequest {
                program_id: "part".into(),
                revision: 1,
                path: std::sync::Arc::new(path),
                start_line: 0,
                occurrence: 0,
                in_span: Default::default(),
                check_only: true,
                tool_diameters_mm: Default::default(),
            })
        };
        let mut line = Line::new(config.clone(), build(firmware), &[]);
        line.until("a place", |line| line.state().work_position.is_some());
        line.zero_here();
        line.ask(check(everything())).unwrap();
        line.until("check mode", |line| line.mode() == Mode::Check);
        let result = line.result();
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware:?}: {result:?}");
        line.until("a place", |line| line.state().work_position.is_some());
        assert_eq!(line.mode(), Mode::Idle, "{firmware:?}");
        assert_eq!(line.state().machine_position, Some(START), "{firmware:?}");
        assert!(line.controller.device().controller().speed_mm_per_min() == 0.0);

        // What the controller refuses is found, and nothing has moved.
        let mut refused = 0;
        for byte in 200..230 {
            let fault = format!("rx-corrupt@byte={byte}");
            let mut line = Line::new(config.clone(), build(firmware), &[&fault]);
            line.until("a place", |line| line.state().work_position.is_some());
            line.ask(check(straight(40, 5.0))).unwrap();
            let result = line.result();
            if result.error_code == error_code::CONTROLLER_ERROR {
                refused += 1;
                line.until("a place", |line| line.state().work_position.is_some());
                assert_eq!((line.mode(), line.state().machine_position), (Mode::Idle, Some(START)));
            }
        }
        assert!(refused > 5, "{firmware:?}: {refused}");
    }
}

#[test]
fn an_answer_too_many_or_too_few_is_never_a_success() {
    for firmware in Firmware::ALL {
        for answer in 7..67 {
            for fault in ["extra-ok", "lose-ok"] {
                let fault = format!("{fault}@line={answer}");
                let mut line = Line::new(DriverConfig::default(), build(firmware), &[&fault]);
                line.until("a place", |line| line.state().work_position.is_some());
                line.start(straight(50, 2.0), 0);
                let result = line.result();
                // The last answers are those of the offsets, the preamble, fifty lines and the dwell.
                let is_of_the_run = line.written.len() > 10 && answer < 5 + 2 + 50 + 1;
                if is_of_the_run {
                    assert_eq!(
                        result.error_code,
                        error_code::PROTOCOL,
                        "{firmware:?} {fault}: {result:?}"
                    );
                    assert!(line.state().needs_reset, "{firmware:?} {fault}");
                }
            }
        }
    }
}
