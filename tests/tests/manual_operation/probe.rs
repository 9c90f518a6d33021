//! Probes: where they touch, and when they do not.

use super::*;

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
