//! Jogs, probes, offsets, overrides: the driver against the virtual controller.

mod overrides;
mod probe;
mod program_overrides;

use axis_driver::codes::error_code;
use axis_driver::driver::{
    Command, DriverConfig, JogFrame, JogRequest, OffsetRequest, Overrides, ProbeRequest, RunOutcome,
};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::machine::Mode;
use kerf_tests::line::Line;
use virtual_controller::{Build, Firmware, Settings};

const X: AxisSet = AxisSet::from_bits(0b001);

const Z: AxisSet = AxisSet::from_bits(0b100);

fn build() -> Build {
    let start_in_machine = Some([-300.0, -200.0, -50.0]);
    Build { start_in_machine, ..Build::new(Settings::small_router()) }
}

fn jog(target: f64) -> Command {
    let target = [target, 0.0, 0.0];
    Command::Jog(JogRequest {
        further: FurtherAxes::NONE,
        frame: JogFrame::Relative,
        axes: X,
        target,
        feed_mm_per_min: 1_000.0,
    })
}

fn probe(distance: f64, may_miss: bool) -> Command {
    let distance = [0.0, 0.0, distance];
    let (axes, feed_mm_per_min, away) = (Z, 100.0, false);
    let further = FurtherAxes::NONE;
    Command::Probe(ProbeRequest { axes, distance, feed_mm_per_min, away, may_miss, further })
}

fn set_offset(system: u8, axes: AxisSet, position: [f64; 3], is_origin: bool) -> Command {
    let further = FurtherAxes::NONE;
    Command::SetWorkOffset(OffsetRequest { system, axes, position, is_origin, further })
}

fn near(a: [f64; 3], b: [f64; 3]) -> bool {
    (0..3).all(|axis| (a[axis] - b[axis]).abs() < 0.02)
}

#[test]
fn a_jog_reaches_its_target_in_every_frame() {
    let mut line = Line::connected(build());
    let offset = set_offset(1, X, [7.0, 0.0, 0.0], false);
    line.ask(offset).unwrap();
    for (frame, to, wanted) in [
        (JogFrame::Relative, 12.5, -287.5),
        // Its place was called 7.
        (JogFrame::Work, 7.0, -300.0),
        (JogFrame::Machine, -310.0, -310.0),
    ] {
        let target = [to, 0.0, 0.0];
        let request = JogRequest {
            further: FurtherAxes::NONE,
            frame,
            axes: X,
            target,
            feed_mm_per_min: 2_000.0,
        };
        line.ask(Command::Jog(request)).unwrap();
        assert_eq!(line.mode(), Mode::Jog);
        let result = line.move_result();
        assert_eq!((result.outcome, result.error_code), (RunOutcome::Succeeded, 0), "{result:?}");
        let at = result.machine_position.unwrap();
        assert!(near(at, [wanted, -200.0, -50.0]), "{frame:?}: {at:?}");
        assert_eq!(line.mode(), Mode::Idle);
    }
}

#[test]
fn a_jog_that_is_canceled_stops_and_keeps_the_position() {
    let mut line = Line::connected(build());
    let id = line.begin(jog(200.0));
    line.wait(1.0);
    line.ask(Command::CancelRun { run: Some(id) }).unwrap();
    let result = line.move_result();
    assert_eq!((result.outcome, result.error_code), (RunOutcome::Canceled, error_code::CANCELED));
    let at = result.machine_position.unwrap();
    assert!(at[0] > -299.0 && at[0] < -250.0, "{at:?}");
    // It is over, and so is the cancel: the next jog is a whole one.
    line.ask(jog(5.0)).unwrap();
    let after = line.move_result().machine_position.unwrap();
    assert!(near(after, [at[0] + 5.0, -200.0, -50.0]), "{after:?}");
}

#[test]
fn a_cancel_before_the_answer_leaves_no_jog() {
    let mut line = Line::connected(build());
    let id = line.begin(jog(200.0));
    line.begin(Command::CancelRun { run: Some(id) });
    assert!(!line.said_since(line.now).contains('\u{85}'), "the line is not answered yet");
    let result = line.move_result();
    assert_eq!(result.outcome, RunOutcome::Canceled);
    let at = line.state().machine_position.unwrap();
    line.wait(2.0);
    assert_eq!(line.state().machine_position.unwrap(), at);
}

#[test]
fn a_jog_that_is_held_is_not_called_done() {
    let mut line = Line::connected(build());
    line.ask(jog(200.0)).unwrap();
    line.wait(1.0);
    line.ask(Command::FeedHold).unwrap();
    let result = line.move_result();
    assert_eq!(result.error_code, error_code::STOPPED_SHORT);
    assert!(result.message.contains("and not at X-100.000"), "{}", result.message);
}

#[test]
fn a_jog_out_of_the_travel_is_refused_with_the_reason() {
    let mut settings = Settings::small_router();
    for setting in ["$22=1", "$20=1"] {
        settings.set_line(setting).unwrap();
    }
    let start_in_machine = Some([-300.0, -200.0, -50.0]);
    let mut line =
        Line::new(DriverConfig::default(), Build { start_in_machine, ..Build::new(settings) }, &[]);
    line.until("alarm", |line| line.mode() == Mode::Alarm);
    assert_eq!(line.ask(jog(1.0)).unwrap_err().error_code, error_code::ALARM);
    line.ask(Command::Home).unwrap();
    line.ask(jog(900.0)).unwrap();
    let result = line.move_result();
    assert_eq!(result.error_code, error_code::CONTROLLER_ERROR);
    assert!(result.message.contains("travel"), "{}", result.message);
    assert_eq!(line.mode(), Mode::Idle);
}

#[test]
fn numbers_out_of_range_move_nothing() {
    let mut line = Line::connected(build());
    let then = line.now;
    let feed = |feed_mm_per_min| {
        let target = [1.0, 0.0, 0.0];
        Command::Jog(JogRequest {
            further: FurtherAxes::NONE,
            frame: JogFrame::Relative,
            axes: X,
            target,
            feed_mm_per_min,
        })
    };
    let axes = |axes| {
        let (target, feed_mm_per_min) = ([1.0, 0.0, 0.0], 100.0);
        Command::Jog(JogRequest {
            further: FurtherAxes::NONE,
            frame: JogFrame::Relative,
            axes,
            target,
            feed_mm_per_min,
        })
    };
    let offset = |system, is_origin| {
        let position = [0.0; 3];
        set_offset(system, X, position, is_origin)
    };
    for command in [
        feed(0.0),
        feed(-5.0),
        feed(f64::NAN),
        feed(1e9),
        jog(f64::NAN),
        jog(1e7),
        jog(f64::INFINITY),
        axes(AxisSet::NONE),
        probe(f64::NAN, false),
        offset(0, false),
        offset(7, false),
        offset(92, true),
        Command::SetOverrides(Overrides::default()),
        Command::SetOverrides(Overrides { feed: Some(9), ..Overrides::default() }),
        Command::SetOverrides(Overrides { spindle: Some(201), ..Overrides::default() }),
        Command::SetOverrides(Overrides { rapid: Some(75), ..Overrides::default() }),
    ] {
        let refusal = line.ask(command.clone()).expect_err("a refusal");
        assert_eq!(refusal.error_code, error_code::INVALID_REQUEST, "{command:?}: {refusal}");
    }
    assert_eq!(line.said_since(then), "");
}

#[test]
fn offsets_are_kept_by_the_controller_and_reported_with_its_settings() {
    let mut line = Line::connected(build());
    let position = [-100.0, -50.0, -20.0];
    let offset = set_offset(3, AxisSet::ALL, position, true);
    line.ask(offset).unwrap();
    let settings = line.settings.clone().unwrap();
    let g56 = settings.offsets.iter().find(|offset| offset.name == "G56").unwrap();
    assert_eq!(g56.position, position);
    assert!(settings.settings.contains(&(13, "0".into())), "{:?}", settings.settings);
    assert_eq!((settings.planner_blocks, settings.receive_bytes, settings.window), (15, 128, 127));
    let shift = set_offset(92, X, [3.0, 0.0, 0.0], false);
    line.ask(shift).unwrap();
    line.wait(1.0);
    assert!((line.state().work_position.unwrap()[0] - 3.0).abs() < 0.02);
}

/// Asks for overrides and waits for the answer; gives the seconds it took.
#[track_caller]
#[test]
fn a_door_hold_stops_and_continues_with_a_resume() {
    let mut line = Line::connected(build());
    let path = kerf_tests::line::straight(40, 5.0);
    line.start(path, 0);
    line.until("it cuts", |line| line.state().line >= 5);
    line.ask(Command::DoorHold).unwrap();
    line.until("door", |line| line.mode() == Mode::Door);
    line.wait(10.0);
    assert_eq!(line.mode(), Mode::Door);
    assert!(line.finished.is_none());
    line.ask(Command::Resume).unwrap();
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
}

#[test]
fn a_controller_sleeps_and_wakes_with_a_reset() {
    let mut line = Line::connected(build());
    line.ask(Command::Sleep).unwrap();
    line.until("sleep", |line| line.mode() == Mode::Sleep);
    assert_eq!(line.ask(jog(1.0)).unwrap_err().error_code, error_code::BUSY);
    line.ask(Command::SoftReset).unwrap();
    line.until("awake", |line| line.mode() == Mode::Alarm);
}

#[test]
fn a_shutdown_stops_what_is_done_by_hand_first() {
    let mut line = Line::connected(Build { probe_surface_z_mm: Some(-90.0), ..build() });
    for command in [jog(200.0), probe(-30.0, false)] {
        line.begin(command.clone());
        line.wait(0.5);
        let then = line.state().machine_position.unwrap();
        line.ask(Command::Shutdown).unwrap();
        assert_ne!(line.move_result().outcome, RunOutcome::Succeeded, "{command:?}");
        let stopped = line.controller.device().controller().position();
        assert!((0..3).all(|axis| (stopped[axis] - then[axis]).abs() < 15.0), "{stopped:?}");
        line.wait(3.0);
        let at = line.controller.device().controller().position();
        assert!(near(at, stopped), "{command:?}: it went on to {at:?}");
        line.until("a place", |line| line.state().work_position.is_some());
    }
}

#[test]
fn a_request_after_a_refusal_waits_for_its_own_answer() {
    use virtual_controller::Firmware;
    let mut settings = Settings::small_router_of(Firmware::GrblHal);
    for setting in ["$22=1", "$20=1"] {
        settings.set_line(setting).unwrap();
    }
    let start_in_machine = Some([-300.0, -200.0, -50.0]);
    let build = Build { start_in_machine, ..Build::new(settings) };
    let mut line = Line::new(DriverConfig::default(), build, &[]);
    line.until("connected", |line| matches!(line.mode(), Mode::Idle | Mode::Alarm));
    line.ask(Command::Home).unwrap();
    line.ask(jog(900.0)).unwrap();
    let result = line.move_result();
    assert_eq!(result.error_code, error_code::CONTROLLER_ERROR, "{result:?}");
    let then = line.now;
    line.ask(Command::Home).unwrap();
    assert!((line.now - then).as_secs_f64() > 0.5, "homed within {:?}", line.now - then);
    assert!(line.controller.device().controller().speed_mm_per_min() == 0.0);
}

#[test]
fn a_shift_that_a_reset_drops_is_reported() {
    let mut line = Line::connected(build());
    let shift = set_offset(92, AxisSet::ALL, [0.0; 3], false);
    line.ask(shift).unwrap();
    line.start(kerf_tests::line::straight(100, 1.0), 0);
    line.wait(0.5);
    line.ask(Command::CancelRun { run: None }).unwrap();
    assert!(line.finished.is_some() || line.result().outcome == RunOutcome::Canceled);
    line.wait(1.0);
    assert!(line.log.iter().any(|text| text.contains("dropped G92")), "{:?}", line.log);
    let settings = line.settings.clone().unwrap();
    let g92 = settings.offsets.iter().find(|offset| offset.name == "G92").unwrap();
    assert_eq!(g92.position, [0.0; 3]);
}

#[test]
fn a_hold_that_homing_passes_over_is_not_called_done() {
    let mut settings = Settings::small_router();
    settings.set_line("$22=1").unwrap();
    let start_in_machine = Some([-300.0, -200.0, -50.0]);
    let build = Build { start_in_machine, ..Build::new(settings) };
    let mut line = Line::new(DriverConfig::default(), build, &[]);
    line.until("connected", |line| matches!(line.mode(), Mode::Idle | Mode::Alarm));
    line.begin(Command::Home);
    line.wait(1.0);
    let refusal = line.ask(Command::FeedHold).unwrap_err();
    assert_eq!(refusal.error_code, error_code::BUSY);
    assert!(refusal.message.contains("only soft_reset"), "{}", refusal.message);
    let then = line.now;
    line.ask(Command::SoftReset).unwrap();
    assert!(line.said_since(then).contains('\u{18}'));
    assert!(!line.state().is_homed);
}

/// It homes, and takes and reports nothing meanwhile.
fn homing() -> Line {
    let mut settings = Settings::small_router();
    settings.set_line("$22=1").unwrap();
    let start_in_machine = Some([-300.0, -200.0, -50.0]);
    let build = Build { start_in_machine, ..Build::new(settings) };
    let mut line = Line::new(DriverConfig::default(), build, &[]);
    line.until("connected", |line| line.mode() == Mode::Alarm);
    line.begin(Command::Home);
    line.wait(0.5);
    line
}
