//! What the state says of the machine, of what the controller reports: positions, feeds, doors.

use axis_driver::codes::error_code;
use axis_driver::driver::{
    CheckTravel, Command, DriverConfig, Input, JogFrame, JogRequest, RunOutcome,
};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::machine::Mode;
use kerf_tests::line::{Line, straight};
use virtual_controller::{Build, Firmware, Settings};

const X: AxisSet = AxisSet::from_bits(0b001);
const START: [f64; 3] = [-300.0, -200.0, -50.0];

fn build(firmware: Firmware, lines: &[&str]) -> Build {
    let mut settings = Settings::small_router_of(firmware);
    lines.iter().for_each(|line| settings.set_line(line).unwrap());
    Build { start_in_machine: Some(START), ..Build::new(settings) }
}

fn jog(x: f64) -> Command {
    let target = [x, 0.0, 0.0];
    Command::Jog(JogRequest {
        further: FurtherAxes::NONE,
        frame: JogFrame::Relative,
        axes: X,
        target,
        feed_mm_per_min: 3_000.0,
    })
}

#[test]
fn a_damaged_digit_of_a_machine_at_rest_is_never_its_position() {
    for (firmware, mask, field) in [
        (Firmware::Grbl, "$10=1", "MPos"),
        (Firmware::Grbl, "$10=0", "WPos"),
        (Firmware::Grbl, "$10=1", "WCO"),
        (Firmware::Grbl, "$10=0", "WCO"),
        (Firmware::GrblHal, "$10=511", "MPos"),
        (Firmware::GrblHal, "$10=0", "WPos"),
    ] {
        let mut line = Line::connected(build(firmware, &[mask]));
        line.ask(Command::SetWorkOffset(axis_driver::driver::OffsetRequest {
            further: FurtherAxes::NONE,
            system: 1,
            axes: AxisSet::ALL,
            position: [1.0, 2.0, 3.0],
            is_origin: false,
        }))
        .unwrap();
        line.wait(3.0);
        let then = line.now;
        // Each time another byte and another bit.
        for _ in 0..500 {
            line.inject(&format!("garble:{field}"));
            line.wait(2.5);
        }
        for (at, state) in line.states.iter().filter(|(at, _)| *at >= then) {
            let text = format!("{firmware} {mask} {field} at {at:?}");
            assert!(
                state.machine_position.is_none_or(|place| near(place, START)),
                "{text}: {state:?}"
            );
            let work = [1.0, 2.0, 3.0];
            assert!(state.work_position.is_none_or(|place| near(place, work)), "{text}: {state:?}");
        }
        assert!(line.state().machine_position.is_some(), "{firmware} {mask} {field}");
    }
}

fn near(a: [f64; 3], b: [f64; 3]) -> bool {
    (0..3).all(|axis| (a[axis] - b[axis]).abs() < 0.0015)
}

#[test]
fn a_digit_that_is_out_of_reach_is_never_a_position_and_a_fast_run_is_never_doubted() {
    for wrong in
        ["<Run|MPos:-100.000,-200.000,-50.000|FS:5000,0>", "<Run|MPos:0.000,0.000,0.000|FS:1,0>"]
    {
        let mut line = Line::connected(build(Firmware::Grbl, &[]));
        line.wait(1.0);
        let mut path = straight(29, 10.0);
        path.elements.iter_mut().for_each(|element| element.feed_mm_per_min = Some(5_000.0));
        line.start(path, 0);
        line.until("it cuts", |line| line.state().line >= 5);
        let then = line.now;
        line.inject(&format!("push:{wrong}"));
        line.wait(0.02);
        let asked = line.written.iter().any(|(at, bytes)| *at >= then && bytes.contains(&b'?'));
        assert!(asked, "it is asked again at once");
        assert_eq!(line.result().outcome, RunOutcome::Succeeded);
        let mut before = START[0];
        for (at, state) in &line.states {
            let Some(place) = state.machine_position else { continue };
            assert!(
                place[0] >= before - 0.01 && (place[1] - START[1]).abs() < 1e-9,
                "{place:?} at {at:?}"
            );
            before = place[0];
        }
    }
    // Nothing is asked for twice where nothing is wrong.
    let (busy_poll_interval_ms, check_travel) = (0, CheckTravel::Off);
    let config = DriverConfig { busy_poll_interval_ms, check_travel, ..DriverConfig::default() };
    let mut line = Line::new(config, build(Firmware::Grbl, &[]), &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    let mut path = straight(40, 10.0);
    path.elements.iter_mut().for_each(|element| element.feed_mm_per_min = Some(5_000.0));
    line.start(path, 0);
    line.until("it cuts", |line| line.state().line >= 2);
    let then = line.now;
    line.until("it is nearly done", |line| line.state().line >= 35);
    let asked = line.written.iter().filter(|(at, bytes)| *at >= then && bytes.contains(&b'?'));
    let wanted = (line.now - then).as_millis() / 200 + 2;
    assert!(asked.count() <= wanted as usize, "more than {wanted} requests");
}

#[test]
fn what_somebody_else_moves_is_believed_when_two_reports_agree() {
    let mut line = Line::connected(build(Firmware::Grbl, &[]));
    line.wait(1.0);
    // A pendant on the same controller.
    let now = line.now;
    line.controller.receive(now, b"$J=G91X-1F3000\n");
    line.wait(1.0);
    assert_eq!(line.state().machine_position.unwrap()[0], START[0] - 1.0);
    assert!(!line.state().needs_reset, "{:?}", line.state());
}

#[test]
fn a_driver_that_comes_back_to_a_machine_in_a_hold_says_where_it_is() {
    for inches in ["$13=0", "$13=1"] {
        let mut line = Line::connected(build(Firmware::Grbl, &[inches]));
        line.start(straight(60, 2.0), 0);
        line.until("it cuts", |line| line.state().line >= 5);
        // The driver is gone, and another takes the port.
        line.driver = axis_driver::driver::Driver::new(DriverConfig::default());
        line.handle(Input::PortOpened);
        line.until("held", |line| line.mode() == Mode::Hold && line.state().needs_reset);
        line.wait(1.0);
        let (said, is) = (line.state().machine_position.expect("a position"), line.axes());
        assert!(
            (0..3).all(|axis| (said[axis] - is[axis]).abs() < 0.01),
            "{inches}: {said:?}, {is:?}"
        );
    }
}

#[test]
fn grblhal_with_the_least_reports_is_as_well_known_as_any() {
    for mask in ["$10=0", "$10=1", "$10=33", "$10=511"] {
        let mut line = Line::connected(build(Firmware::GrblHal, &[mask]));
        line.wait(1.0);
        let state = line.state();
        assert_eq!(state.machine_position, Some(START), "{mask}: {state:?}");
        line.ask(jog(5.0)).unwrap();
        let result = line.move_result();
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{mask}: {result:?}");
        assert!((line.state().machine_position.unwrap()[0] + 295.0).abs() < 0.01, "{mask}");
        // An offset that changes is seen too.
        let offset = axis_driver::driver::OffsetRequest {
            further: FurtherAxes::NONE,
            system: 92,
            axes: X,
            position: [7.0, 0.0, 0.0],
            is_origin: false,
        };
        line.ask(Command::SetWorkOffset(offset)).unwrap();
        line.wait(1.0);
        let state = line.state();
        assert!((state.work_position.unwrap()[0] - 7.0).abs() < 0.01, "{mask}: {state:?}");
        assert!((state.machine_position.unwrap()[0] + 295.0).abs() < 0.01, "{mask}: {state:?}");
        let feed = axis_driver::driver::Overrides { feed: Some(90), ..Default::default() };
        line.ask(Command::SetOverrides(feed)).unwrap();
    }
}

#[test]
fn a_resume_with_an_open_door_is_refused_until_it_is_closed() {
    for firmware in [Firmware::Grbl, Firmware::GrblHal] {
        let mut line = Line::connected(build(firmware, &[]));
        line.start(straight(60, 2.0), 0);
        line.until("it cuts", |line| line.state().line >= 5);
        line.inject("door");
        line.until("door", |line| line.mode() == Mode::Door);
        line.wait(1.0);
        let then = line.now;
        let refusal = line.ask(Command::Resume).unwrap_err();
        assert_eq!(refusal.error_code, error_code::BUSY);
        assert!(refusal.message.contains("close it"), "{firmware}: {refusal}");
        assert!(!line.said_since(then).contains('~'));
        line.inject("close-door");
        line.wait(1.0);
        line.ask(Command::Resume).unwrap();
        assert_eq!(line.result().outcome, RunOutcome::Succeeded, "{firmware}");
    }
}

#[test]
fn an_alarm_leaves_no_feed_of_before() {
    for (firmware, alarm) in [(Firmware::Grbl, 1), (Firmware::Grbl, 3), (Firmware::GrblHal, 1)] {
        let mut line = Line::connected(build(firmware, &[]));
        line.start(straight(60, 2.0), 0);
        line.until("it cuts", |line| line.state().feed_mm_per_min > 100.0);
        line.inject(&format!("alarm:{alarm}"));
        line.until("alarm", |line| line.mode() == Mode::Alarm);
        assert_eq!(line.state().feed_mm_per_min, 0.0, "{firmware} {alarm}");
        line.wait(3.0);
        assert_eq!(line.state().feed_mm_per_min, 0.0, "{firmware} {alarm}");
    }
}

#[test]
fn a_completed_hold_has_no_feed() {
    let mut line = Line::connected(build(Firmware::GrblHal, &[]));
    line.start(straight(60, 2.0), 0);
    line.until("it cuts", |line| line.state().line >= 5);
    line.ask(Command::FeedHold).unwrap();
    line.wait(2.0);
    assert_eq!((line.mode(), line.state().feed_mm_per_min), (Mode::Hold, 0.0));
}

#[test]
fn a_run_that_has_succeeded_is_at_rest_in_every_state_from_then_on() {
    for firmware in Firmware::ALL {
        let mut line = Line::connected(build(firmware, &[]));
        line.start(straight(20, 2.0), 0);
        let result = line.result();
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
        assert_eq!(line.finished_in, Some(Mode::Idle), "{firmware}");
        assert_eq!(line.mode(), Mode::Idle);
        // And the axes do.
        let at = line.axes();
        line.wait(1.0);
        assert_eq!(line.axes(), at);
        // A canceled one too.
        line.start(straight(60, 2.0), 0);
        line.wait(1.0);
        line.ask(Command::CancelRun { run: None }).unwrap();
        assert_eq!(line.result().outcome, RunOutcome::Canceled);
        assert_eq!(line.finished_in, Some(Mode::Idle), "{firmware}: canceled");
    }
}

#[test]
fn inches_that_the_reports_show_stay_if_their_setting_is_not_received() {
    let build = build(Firmware::Grbl, &["$13=1"]);
    let mut line = Line::new(DriverConfig::default(), build, &["mute:$13=@time=0"]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.wait(1.0);
    let place = line.state().machine_position.expect("it is known");
    assert!((0..3).all(|axis| (place[axis] - START[axis]).abs() < 0.01), "{place:?}");
}

#[test]
fn a_work_offset_in_doubt_when_a_run_begins_does_not_hasten_its_reports() {
    let reports = |is_doubted: bool| {
        let mut line = Line::connected(build(Firmware::Grbl, &["$10=1"]));
        line.wait(3.0);
        let asks_fast = |line: &Line| {
            let asked = |(_, bytes): &&(std::time::Duration, Vec<u8>)| bytes.contains(&b'?');
            let mut asked = line.written.iter().rev().filter(asked).map(|(at, _)| *at);
            let last = asked.next().zip(asked.next());
            last.is_some_and(|(last, before)| (last - before).as_millis() < 30)
        };
        while is_doubted && !asks_fast(&line) {
            line.inject("garble:WCO");
            for _ in 0..400 {
                if asks_fast(&line) {
                    break;
                }
                line.step();
            }
        }
        line.start(straight(4, 60.0), 0);
        line.wait(1.0);
        let then = line.now;
        line.wait(4.0);
        let asked = line.written.iter().filter(|(at, bytes)| *at > then && bytes.contains(&b'?'));
        asked.count()
    };
    let (doubted, usual) = (reports(true), reports(false));
    assert!(doubted <= usual + 5, "{doubted} requests, {usual} as usual");
}
