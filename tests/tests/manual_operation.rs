//! Jogs, probes, offsets, overrides: the driver against the virtual controller.

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
fn a_probe_reports_where_it_touched_in_both_frames() {
    let mut line = Line::connected(Build { probe_surface_z_mm: Some(-62.0), ..build() });
    let offset = set_offset(1, Z, [0.0, 0.0, 10.0], false);
    line.ask(offset).unwrap();
    line.ask(probe(-20.0, false)).unwrap();
    let result = line.move_result();
    assert_eq!((result.outcome, result.found), (RunOutcome::Succeeded, true), "{result:?}");
    assert!(near(result.machine_position.unwrap(), [-300.0, -200.0, -62.0]), "{result:?}");
    assert!((result.work_position.unwrap()[2] - -2.0).abs() < 0.02, "{result:?}");
}

#[test]
fn a_probe_that_finds_nothing_is_an_alarm_or_a_result() {
    let mut line = Line::connected(Build { probe_surface_z_mm: Some(-90.0), ..build() });
    line.ask(probe(-5.0, true)).unwrap();
    let result = line.move_result();
    assert_eq!((result.outcome, result.found), (RunOutcome::Succeeded, false), "{result:?}");
    assert_eq!(result.machine_position, None);
    line.ask(probe(-5.0, false)).unwrap();
    let result = line.move_result();
    assert_eq!(
        (result.outcome, result.error_code),
        (RunOutcome::Aborted, error_code::PROBE_FAILED)
    );
    assert!(result.message.contains("touched nothing"), "{}", result.message);
    line.until("alarm", |line| line.mode() == Mode::Alarm);
    // Nothing unlocks by itself.
    line.wait(5.0);
    assert_eq!(line.mode(), Mode::Alarm);
    assert_eq!(line.ask(jog(1.0)).unwrap_err().error_code, error_code::NEEDS_RESET);
}

#[test]
fn a_probe_that_is_canceled_stops_and_is_reset() {
    let mut line = Line::connected(Build { probe_surface_z_mm: Some(-90.0), ..build() });
    let id = line.begin(probe(-30.0, false));
    line.wait(3.0);
    line.ask(Command::CancelRun { run: Some(id) }).unwrap();
    let result = line.move_result();
    assert_eq!(result.outcome, RunOutcome::Canceled, "{result:?}");
    line.until("idle", |line| line.mode() == Mode::Idle);
    let at = line.state().machine_position.unwrap();
    assert!(at[2] < -51.0 && at[2] > -60.0, "{at:?}");
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
fn set(line: &mut Line, wanted: Overrides) -> f64 {
    let then = line.now;
    line.ask(Command::SetOverrides(wanted)).unwrap();
    let percents = line.state().overrides_percent;
    let named = [wanted.feed, wanted.rapid, wanted.spindle].into_iter().zip(percents);
    for (wanted, is) in named {
        assert!(wanted.is_none_or(|wanted| wanted == is), "{percents:?} at the success");
    }
    (line.now - then).as_secs_f64()
}

#[test]
fn an_override_is_called_done_when_a_report_shows_it_and_takes_no_second() {
    for firmware in virtual_controller::Firmware::ALL {
        let settings = Settings::small_router_of(firmware);
        let start_in_machine = Some([-300.0, -200.0, -50.0]);
        let mut line = Line::connected(Build { start_in_machine, ..Build::new(settings) });
        line.start(kerf_tests::line::straight(290, 1.0), 0);
        line.until("it cuts", |line| line.state().line >= 3);
        let feed = |percent| Overrides { feed: Some(percent), ..Overrides::default() };
        for wanted in [
            feed(190),
            Overrides { feed: Some(57), rapid: Some(25), spindle: Some(133) },
            feed(10),
            feed(200),
            Overrides { feed: Some(11), rapid: Some(100), spindle: Some(199) },
            Overrides { feed: Some(100), rapid: Some(50), spindle: Some(10) },
        ] {
            let seconds = set(&mut line, wanted);
            assert!(seconds < 1.0, "{firmware}: {wanted:?} took {seconds} s");
        }
        assert!(line.finished.is_none(), "{firmware}: in the run");
    }
}

#[test]
fn every_feed_override_is_reached_from_idle_within_a_second() {
    let mut line = Line::connected(build());
    line.forget_written();
    for percent in (10..=200).chain((10..=200).rev().step_by(7)).chain([200, 10, 199, 11]) {
        let wanted = Overrides { feed: Some(percent), spindle: Some(210 - percent), rapid: None };
        let seconds = set(&mut line, wanted);
        assert!(seconds < 1.0, "{percent} took {seconds} s");
    }
}

#[test]
fn overrides_are_asked_for_again_when_a_byte_is_lost() {
    for lost in 30..60 {
        let fault = format!("rx-drop@byte={lost}");
        let mut line = Line::new(DriverConfig::default(), build(), &[&fault]);
        line.until("idle", |line| line.mode() == Mode::Idle);
        let wanted = Overrides { feed: Some(83), rapid: Some(25), spindle: Some(121) };
        set(&mut line, wanted);
        set(&mut line, Overrides { feed: Some(100), ..wanted });
    }
}

#[test]
fn an_override_that_does_not_show_is_refused_with_the_numbers() {
    let mut line = homing();
    let wanted = Overrides { feed: Some(57), rapid: Some(25), spindle: None };
    let refusal = line.ask(Command::SetOverrides(wanted)).expect_err("a refusal");
    assert_eq!(line.mode(), Mode::Home);
    assert_eq!(refusal.error_code, error_code::NO_ANSWER);
    for text in ["feed 57 %, rapid 25 %", "feed 100 %, rapid 100 %, spindle 100 % after 3 s"] {
        assert!(refusal.message.contains(text), "{}", refusal.message);
    }
}

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
fn overrides_in_a_row_end_at_the_last_and_never_go_beyond_it() {
    let mut line = Line::connected(build());
    line.start(kerf_tests::line::straight(290, 1.0), 0);
    line.until("it cuts", |line| line.state().line >= 3);
    let feed = |percent| Overrides { feed: Some(percent), ..Overrides::default() };
    let ids =
        [150, 150, 150, 50, 120].map(|percent| line.begin(Command::SetOverrides(feed(percent))));
    let rapid = Overrides { rapid: Some(50), ..Overrides::default() };
    let then = line.now;
    line.ask(Command::SetOverrides(rapid)).unwrap();
    assert_eq!(line.state().overrides_percent, [120, 50, 100]);
    assert!((line.now - then).as_secs_f64() < 1.0, "it took {:?}", line.now - then);
    // Those that a later one replaced are answered too.
    let answers = ids.map(|id| {
        let (_, result) = line.replies.iter().find(|(of, _)| *of == id).expect("an answer");
        result.as_ref().map_err(|refusal| refusal.error_code).is_ok()
    });
    assert_eq!(answers, [false, false, false, false, true]);
    // A reset sets them back, and nothing sets them again.
    let id = line.begin(Command::SetOverrides(feed(200)));
    line.ask(Command::SoftReset).unwrap();
    let (_, result) = line.replies.iter().find(|(of, _)| *of == id).expect("an answer");
    assert!(result.is_err(), "{result:?}");
    let then = line.now;
    line.wait(6.0);
    assert_eq!(line.state().overrides_percent, [100; 3]);
    assert!(!line.said_since(then).contains('\u{91}'));
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

#[test]
fn overrides_that_are_asked_for_again_and_again_time_out_all_the_same() {
    let mut line = homing();
    let wanted = Overrides { feed: Some(50), ..Overrides::default() };
    let first = line.begin(Command::SetOverrides(wanted));
    for _ in 0..7 {
        line.wait(0.5);
        line.begin(Command::SetOverrides(wanted));
    }
    assert_eq!(line.mode(), Mode::Home);
    let answer = line.replies.iter().find(|(id, _)| *id == first);
    let answer = answer.expect("it is answered after three seconds").1.clone();
    assert_eq!(answer.unwrap_err().error_code, error_code::NO_ANSWER);
}

#[test]
fn requests_for_overrides_do_not_pile_up() {
    let mut line = homing();
    let wanted = Overrides { feed: Some(50), ..Overrides::default() };
    for _ in 0..1_000 {
        line.begin(Command::SetOverrides(wanted));
    }
    let refused = line.replies.iter().filter_map(|(_, result)| result.as_ref().err());
    let busy = refused.filter(|refusal| refusal.error_code == error_code::BUSY).count();
    assert!(busy > 900, "{busy} were refused");
}

#[test]
fn an_axis_that_turns_is_probed() {
    for firmware in Firmware::ALL {
        let settings = Settings::small_router_of(firmware);
        let settings = settings.with_axes("XYZA".parse().expect("axes"));
        let start_in_machine = Some([-300.0, -200.0, -50.0]);
        let probe_stop_fourth = Some(72.5);
        let build = Build { start_in_machine, probe_stop_fourth, ..Build::new(settings) };
        let mut line = Line::connected(build);
        let probe = |degrees: f64, away| {
            Command::Probe(ProbeRequest {
                axes: AxisSet::NONE,
                distance: [0.0; 3],
                feed_mm_per_min: 720.0,
                away,
                may_miss: false,
                further: FurtherAxes::NONE.with(0, degrees),
            })
        };
        line.ask(probe(90.0, false)).expect("it begins");
        let result = line.move_result();
        assert!(result.found && result.outcome == RunOutcome::Succeeded, "{firmware}: {result:?}");
        let at = result.further.get(0).expect("where it touched");
        assert!((at - 72.5).abs() < 0.05, "{firmware}: {result:?}");
        // Away from the stop, and towards it where there is none.
        line.ask(probe(-5.0, true)).expect("it begins");
        assert!(line.move_result().found, "{firmware}");
        line.ask(probe(-30.0, false)).expect("it begins");
        let result = line.move_result();
        assert_eq!(result.error_code, error_code::PROBE_FAILED, "{firmware}: {result:?}");
        assert_eq!(result.further, FurtherAxes::NONE);
    }
}

#[test]
fn axes_that_boards_move_differently_are_not_probed_together() {
    let mut line = Line::connected(build());
    let mut ask = |axes, further| {
        let (distance, feed_mm_per_min, away, may_miss) = ([0.0, 0.0, -5.0], 100.0, false, false);
        let request = ProbeRequest { axes, distance, feed_mm_per_min, away, may_miss, further };
        line.ask(Command::Probe(request)).expect_err("it is refused")
    };
    let a = FurtherAxes::NONE.with(0, 10.0);
    for (refusal, said) in [
        (ask(Z, a), "probe X, Y and Z in one move"),
        (ask(AxisSet::NONE, a.with(3, 1.0)), "probe X, Y and Z in one move"),
        (ask(AxisSet::NONE, a), "the controller has no axis A: it has X Y Z"),
    ] {
        assert_eq!(refusal.error_code, error_code::INVALID_REQUEST);
        assert!(refusal.message.contains(said), "{refusal}");
    }
}
