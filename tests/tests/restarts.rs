//! Unannounced restarts of the controller: what state of the machine the driver reports then.

use axis_driver::codes::error_code;
use axis_driver::driver::{Command, DriverConfig, JogFrame, JogRequest, OffsetRequest, RunOutcome};
use cnc_msgs::contour::{Action, Source};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::machine::Mode;
use cnc_msgs::path::{CompensatedPath, PathEvent};
use kerf_tests::line::{Line, straight};
use std::time::Duration;
use virtual_controller::{Build, Firmware, Settings};

const X: AxisSet = AxisSet::from_bits(0b001);

fn settings(firmware: Firmware, lines: &[&str]) -> Settings {
    let mut settings = Settings::small_router_of(firmware);
    lines.iter().for_each(|line| settings.set_line(line).unwrap());
    settings
}

/// Homed, with the work zero within the travel, and the tool away from the machine's zero.
fn homed(firmware: Firmware) -> Line {
    let build = Build::new(settings(firmware, &["$22=1"]));
    let mut line = Line::new(DriverConfig::default(), build, &[]);
    line.until("connected", |line| matches!(line.mode(), Mode::Alarm | Mode::Idle));
    line.ask(Command::Home).unwrap();
    let position = [-500.0, -300.0, -40.0];
    let (axes, is_origin) = (AxisSet::ALL, true);
    line.ask(Command::SetWorkOffset(OffsetRequest {
        further: FurtherAxes::NONE,
        system: 1,
        axes,
        position,
        is_origin,
    }))
    .unwrap();
    line.ask(jog(JogFrame::Machine, -500.0)).unwrap();
    line.move_result();
    assert!(line.state().is_homed);
    line
}

/// Without switches, away from zero.
fn without_homing(lines: &[&str]) -> Line {
    let start_in_machine = Some([-300.0, -200.0, -50.0]);
    let settings = settings(Firmware::Grbl, lines);
    let mut line = Line::connected(Build { start_in_machine, ..Build::new(settings) });
    line.wait(1.0);
    line
}

fn jog(frame: JogFrame, x: f64) -> Command {
    Command::Jog(JogRequest {
        further: FurtherAxes::NONE,
        frame,
        axes: X,
        target: [x, 0.0, 0.0],
        feed_mm_per_min: 3_000.0,
    })
}

/// The supply fails for a moment, and the start message is lost or damaged, with all that
/// a firmware says besides where `is_mute`.
fn restart(line: &mut Line, spoils: &[&str]) {
    spoils.iter().for_each(|spoil| line.inject(spoil));
    line.inject("reset");
}

/// A hold has been sent since then, and the tool is at rest.
#[track_caller]
fn assert_held(line: &mut Line, then: Duration) {
    assert!(line.said_since(then).contains('!'), "{:?}", line.said_since(then));
    let stands = line.axes();
    line.wait(2.0);
    assert_eq!(line.axes(), stands);
}

const LOST: &[&str] = &["mute:Grbl"];
const DAMAGED: &[&str] = &["garble:Grbl"];
/// Nothing but the state in the reports is left.
const MUTE: &[&str] = &["mute:Grbl", "mute:unlock"];

/// It looks like a machine that was never homed, and does not move in its machine frame.
#[track_caller]
fn has_no_zero(line: &mut Line) {
    assert!(!line.state().is_homed);
    line.ask(Command::Unlock).unwrap();
    line.wait(1.0);
    assert_eq!((line.mode(), line.state().is_homed), (Mode::Idle, false));
    let refusal = line.ask(jog(JogFrame::Machine, -300.0)).unwrap_err();
    assert_eq!(refusal.error_code, error_code::NOT_HOMED, "{refusal}");
    assert!(refusal.message.contains("home first"), "{refusal}");
    let action = Action::MachineMove {
        target: [-300.0, 0.0, 0.0],
        axes: X,
        rapid: true,
        feed_mm_per_min: 0.0,
    };
    let source = Source { line: 4, ..Source::default() };
    let events = vec![PathEvent { at_element: 0, action, source }];
    let path = CompensatedPath { events, assumed_axes: AxisSet::NONE, ..straight(3, 1.0) };
    let request = |path: &CompensatedPath| {
        Command::RunProgram(axis_driver::driver::RunRequest {
            program_id: "part".into(),
            revision: 1,
            path: std::sync::Arc::new(path.clone()),
            start_line: 0,
            occurrence: 0,
            in_span: Default::default(),
            check_only: false,
            tool_diameters_mm: Default::default(),
        })
    };
    let refusal = line.ask(request(&path)).unwrap_err();
    assert_eq!(refusal.error_code, error_code::NOT_HOMED, "{refusal}");
    assert!(refusal.message.starts_with("G53 in line 4"), "{refusal}");
    assert_eq!(line.axes(), [0.0; 3], "it went from a false zero");
    // What it can do without a zero it does.
    line.ask(jog(JogFrame::Relative, -5.0)).unwrap();
    assert_eq!(line.move_result().outcome, RunOutcome::Succeeded);
    line.ask(Command::Home).unwrap();
    assert!(line.state().is_homed);
    line.ask(jog(JogFrame::Machine, -300.0)).unwrap();
    assert_eq!(line.move_result().outcome, RunOutcome::Succeeded);
}

#[test]
fn a_restart_in_idle_whose_banner_is_lost_or_damaged_ends_homed() {
    for spoils in [&[], LOST, DAMAGED, MUTE] {
        let mut line = homed(Firmware::Grbl);
        restart(&mut line, spoils);
        line.until("alarm", |line| line.mode() == Mode::Alarm);
        has_no_zero(&mut line);
    }
}

#[test]
fn a_restart_in_a_run_whose_banner_is_lost_or_damaged_ends_homed_and_the_run() {
    for spoils in [&[], LOST, DAMAGED, MUTE] {
        let mut line = homed(Firmware::Grbl);
        line.start(straight(60, 2.0), 0);
        line.until("it cuts", |line| line.state().line >= 5);
        restart(&mut line, spoils);
        let result = line.result();
        assert_eq!(result.error_code, error_code::RESTARTED, "{spoils:?}: {result:?}");
        assert!(result.message.contains("home"), "{result:?}");
        line.until("alarm", |line| line.mode() == Mode::Alarm);
        has_no_zero(&mut line);
    }
}

#[test]
fn a_restart_in_a_jog_whose_banner_is_lost_ends_homed_and_the_jog() {
    for spoils in [&[], LOST, DAMAGED, MUTE] {
        let mut line = homed(Firmware::Grbl);
        line.ask(jog(JogFrame::Machine, -50.0)).unwrap();
        line.wait(1.0);
        restart(&mut line, spoils);
        let result = line.move_result();
        assert_eq!(result.error_code, error_code::RESTARTED, "{spoils:?}: {result:?}");
        line.until("alarm", |line| line.mode() == Mode::Alarm);
        has_no_zero(&mut line);
    }
}

#[test]
fn a_reset_of_ours_whose_banner_is_damaged_is_answered_and_keeps_what_is_known() {
    let mut line = homed(Firmware::Grbl);
    line.inject("garble:Grbl");
    line.ask(Command::SoftReset).unwrap();
    line.wait(1.0);
    assert_eq!((line.mode(), line.state().is_homed), (Mode::Idle, true));
    // In the stop of a run.
    line.start(straight(60, 2.0), 0);
    line.until("it cuts", |line| line.state().line >= 5);
    line.inject("garble:Grbl");
    line.ask(Command::CancelRun { run: None }).unwrap();
    assert_eq!(line.result().outcome, RunOutcome::Canceled);
    line.wait(1.0);
    assert_eq!((line.mode(), line.state().is_homed), (Mode::Idle, true));
}

#[test]
fn a_machine_without_homing_that_falls_to_zero_waits_for_the_operator() {
    for spoils in [&[], LOST, DAMAGED] {
        let mut line = without_homing(&[]);
        restart(&mut line, spoils);
        line.until("it is noticed", |line| line.state().needs_reset);
        let reason = line.state().reason;
        assert!(reason.contains("RESTARTED") && reason.contains("zero"), "{spoils:?}: {reason}");
        let refusal = line.ask(jog(JogFrame::Work, -100.0)).unwrap_err();
        assert_eq!(refusal.error_code, error_code::NEEDS_RESET);
        line.ask(Command::SoftReset).unwrap();
        line.ask(jog(JogFrame::Machine, -10.0)).unwrap();
        assert_eq!(line.move_result().outcome, RunOutcome::Succeeded);
    }
}

#[test]
fn a_reset_that_keeps_the_position_is_no_lost_zero() {
    let mut line = without_homing(&[]);
    line.ask(Command::SoftReset).unwrap();
    line.wait(1.0);
    assert_eq!((line.mode(), line.state().needs_reset), (Mode::Idle, false));
}

#[test]
fn a_machine_without_homing_that_falls_to_zero_in_a_run_is_stopped_there() {
    for spoils in [&[], LOST, DAMAGED] {
        let mut line = without_homing(&[]);
        let mut path = straight(60, 2.0);
        path.assumed_axes = AxisSet::NONE;
        path.elements.iter_mut().for_each(|element| element.end[0] -= 300.0);
        line.start(path, 0);
        line.until("it cuts", |line| line.state().line >= 5);
        restart(&mut line, spoils);
        let result = line.result();
        assert_eq!(result.error_code, error_code::RESTARTED, "{spoils:?}: {result:?}");
        line.wait(2.0);
        assert!(line.state().needs_reset, "{:?}", line.state());
        assert!(line.axes()[0].abs() < 20.0, "it went on from a false zero to {:?}", line.axes());
    }
}

#[test]
fn buffers_that_are_suddenly_empty_are_a_restart() {
    // So near to zero that the position says nothing.
    let mut line = Line::connected(Build::new(settings(Firmware::Grbl, &["$10=3"])));
    line.wait(1.0);
    let mut path = straight(200, 0.001);
    path.elements.iter_mut().for_each(|element| element.feed_mm_per_min = Some(1.0));
    line.start(path, 0);
    line.until("it cuts", |line| line.state().line >= 3);
    // No line is torn.
    let is_quiet = |line: &Line| {
        let last = line.written.iter().rev().find(|(_, bytes)| bytes.contains(&b'\n'));
        last.is_some_and(|(at, _)| line.now - *at > std::time::Duration::from_millis(10))
    };
    line.until("no line is in transit", is_quiet);
    let then = line.now;
    restart(&mut line, LOST);
    let result = line.result();
    assert_eq!(result.error_code, error_code::RESTARTED, "{result:?}");
    assert!(result.message.contains("buffers are empty"), "{result:?}");
    assert!((line.now - then).as_secs_f64() < 1.0, "{:?}", line.now - then);
}

#[test]
fn words_that_fall_back_are_a_restart() {
    let mut line = homed(Firmware::GrblHal);
    line.start(straight(60, 2.0), 0);
    line.until("it cuts", |line| line.state().line >= 5);
    line.inject("push:[GC:G1 G54 G17 G21 G90 G94 G49 G98 G50 M5 M9 T0 F1200 S0]");
    line.wait(0.1);
    assert!(line.state().is_homed && line.finished.is_none());
    let then = line.now;
    line.inject("push:[GC:G0 G54 G17 G21 G90 G94 G49 G98 G50 M5 M9 T0 F0 S0]");
    let result = line.result();
    assert_eq!(result.error_code, error_code::RESTARTED, "{result:?}");
    let state = line.state();
    assert!(!state.is_homed && state.needs_reset, "{state:?}");
    // The controller was well, and only the line about it was not: it no longer cuts.
    assert_held(&mut line, then);
}

#[test]
fn a_program_that_homes_is_no_restart() {
    for firmware in Firmware::ALL {
        let mut line = homed(firmware);
        line.ask(jog(JogFrame::Machine, -300.0)).unwrap();
        line.move_result();
        line.wait(1.0);
        let source = Source { line: 2, ..Source::default() };
        let home = PathEvent { at_element: 1, action: Action::Home { axes: AxisSet::ALL }, source };
        let mut path = CompensatedPath { assumed_axes: AxisSet::NONE, ..straight(3, 10.0) };
        path.elements.iter_mut().for_each(|element| element.axes = AxisSet::ALL);
        path.events.push(home);
        line.start(path, 0);
        let result = line.result();
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware}: {result:?}");
        assert!(line.state().is_homed, "{firmware}");
    }
}

#[test]
fn what_still_moves_when_a_restart_has_been_looked_into_is_held() {
    let mut line = without_homing(&[]);
    let target = [-200.0, 0.0, 0.0];
    let frame = JogFrame::Relative;
    line.ask(Command::Jog(JogRequest {
        further: FurtherAxes::NONE,
        frame,
        axes: X,
        target,
        feed_mm_per_min: 600.0,
    }))
    .unwrap();
    line.wait(1.0);
    let then = line.now;
    line.inject("push:Grbl 1.1h ['$' for help]");
    assert_eq!(line.move_result().error_code, error_code::RESTARTED);
    line.wait(2.0);
    let state = line.state();
    assert!(state.needs_reset && state.reason.starts_with("RESTARTED"), "{state:?}");
    assert_held(&mut line, then);
}

#[test]
fn a_dwell_with_many_lines_after_it_is_not_a_restart() {
    for firmware in Firmware::ALL {
        let mut line = Line::connected(Build::new(settings(firmware, &["$10=3"])));
        line.wait(1.0);
        let mut path = straight(12, 1.0);
        let source = Source { line: 2, ..Source::default() };
        let action = Action::Dwell { seconds: 1.0 };
        path.events.push(PathEvent { at_element: 2, action, source });
        let result = line.run(path);
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware}: {result:?}");
    }
}
