//! Connecting, and everything that goes wrong on the wire.

use super::bench::{BANNER, Bench, straight};
use super::*;

#[test]
fn a_standing_controller_is_reset_once_and_asked_one_question_at_a_time() {
    let bench = Bench::connected();
    let lines: Vec<u8> = bench.sent.iter().copied().filter(|byte| *byte != b'?').collect();
    assert_eq!(lines, b"\x18$I\n$$\n$G\n$#\n");
    assert!(bench.log.contains("15 planner blocks, at most 127 bytes"), "{}", bench.log);
    assert_eq!(bench.state().work_position, Some([0.0; 3]));
    assert!(!bench.state().is_homed);
}

#[test]
fn without_reset_on_connect_nothing_is_reset() {
    let config = DriverConfig { reset_on_connect: false, ..DriverConfig::default() };
    let mut bench = Bench::new(config);
    bench.handle(Input::PortOpened);
    bench.until("idle", |bench| bench.mode() == Mode::Idle);
    assert_eq!(bench.sent_count(0x18), 0);
}

#[test]
fn a_machine_that_moves_when_the_port_opens_is_held_and_left_to_the_operator() {
    for (is_new_life, wanted) in [(false, "LINK_LOST"), (true, "DRIVER_RESTARTED")] {
        let mut bench = Bench::running(straight(40));
        if is_new_life {
            let mut second = Bench::new(DriverConfig::default());
            second.firmware = std::mem::take(&mut bench.firmware);
            second.now = bench.now;
            bench = second;
        } else {
            bench.handle(Input::PortClosed { reason: "somebody stumbled".into() });
        }
        let resets = bench.sent_count(0x18);
        bench.handle(Input::PortOpened);
        bench.until("a hold", |bench| bench.mode() == Mode::Hold);
        bench.wait(2000);
        assert_eq!((bench.mode(), bench.sent_count(0x18)), (Mode::Hold, resets));
        assert!(bench.state().reason.starts_with(wanted), "{}", bench.state().reason);
        for command in [Command::Resume, Command::Home, Command::Unlock] {
            assert_eq!(refusal(bench.ask(command)).0, error_code::NEEDS_RESET);
        }
        bench.command(7, Command::SoftReset);
        bench.until("idle", |bench| bench.mode() == Mode::Idle);
        assert!(matches!(bench.replies.last(), Some((7, Ok(_)))));
    }
}

#[test]
fn a_port_that_says_nothing_is_named_and_unknown() {
    let mut bench = Bench::new(DriverConfig::default());
    bench.firmware.is_dead = true;
    bench.handle(Input::PortOpened);
    bench.wait(3000);
    let state = bench.state();
    assert_eq!(state.mode, Mode::Unknown);
    assert!(state.reason.starts_with("nothing answered within 2.5 s"), "{}", state.reason);
    bench.start(straight(3));
    assert_eq!(refusal(bench.replies.pop().unwrap().1).0, error_code::NEEDS_RESET);
}

#[test]
fn a_port_that_sends_back_what_it_is_sent_is_named() {
    let mut bench = Bench::new(DriverConfig::default());
    bench.firmware.is_dead = true;
    bench.handle(Input::PortOpened);
    for _ in 0..12 {
        bench.firmware.raw(b"?");
        bench.wait(200);
    }
    bench.wait(600);
    let state = bench.state();
    assert_eq!(state.mode, Mode::Unknown);
    assert!(state.reason.starts_with("what answers is no controller: \"??"), "{}", state.reason);
}

#[test]
fn a_port_that_answers_garbage_is_named_and_unknown() {
    let mut bench = Bench::new(DriverConfig::default());
    bench.firmware.is_dead = true;
    bench.handle(Input::PortOpened);
    for _ in 0..20 {
        bench.firmware.raw(b"\xfe\x01T:23.1 /0.0\r\n");
        bench.wait(200);
    }
    let state = bench.state();
    assert_eq!(state.mode, Mode::Unknown);
    assert!(state.reason.contains("is not a grbl-class controller"), "{}", state.reason);
    assert!(state.reason.contains("check baud rate"), "{}", state.reason);
}

/// What grblHAL sends to each session.
const GREETING: &[u8] = b"\r\nGrblHAL 1.1f ['$' or '$HELP' for help]\r\n";

#[test]
fn a_greeting_over_a_network_is_no_restart_and_a_moving_machine_is_held_not_reset() {
    let networked = DriverConfig { is_networked: true, ..DriverConfig::default() };
    let mut first = Bench::running(straight(40));
    let mut second = Bench::new(networked);
    second.firmware = std::mem::take(&mut first.firmware);
    second.now = first.now;
    // It is sent when the session begins, before any question is read.
    second.firmware.raw(GREETING);
    second.firmware.raw(b"[MSG:'$H'|'$X' to unlock]\r\n");
    second.handle(Input::PortOpened);
    second.until("a hold", |bench| bench.mode() == Mode::Hold);
    assert_eq!(second.sent_count(0x18), 0, "it moves");
    assert!(second.state().reason.starts_with("DRIVER_RESTARTED"), "{}", second.state().reason);
    assert!(second.log.contains("the controller greets: GrblHAL 1.1f"), "{}", second.log);
}

#[test]
fn after_a_greeting_over_a_network_a_standing_controller_is_reset_once() {
    let mut bench = Bench::new(DriverConfig { is_networked: true, ..DriverConfig::default() });
    bench.firmware.raw(GREETING);
    bench.handle(Input::PortOpened);
    bench.until("idle", |bench| bench.mode() == Mode::Idle);
    let lines: Vec<u8> = bench.sent.iter().copied().filter(|byte| *byte != b'?').collect();
    assert_eq!(lines, b"\x18$I\n$$\n$G\n$#\n");
    assert!(!bench.log.contains("restarted when its port was opened"), "{}", bench.log);
}

#[test]
fn grbl_behind_a_serial_server_has_restarted_when_it_says_so() {
    let mut bench = Bench::new(DriverConfig { is_networked: true, ..DriverConfig::default() });
    bench.firmware.raw(BANNER.as_bytes());
    bench.handle(Input::PortOpened);
    bench.wait(1000);
    assert!(bench.log.contains("restarted when its port was opened"), "{}", bench.log);
}

#[test]
fn a_network_says_what_to_check_there() {
    let networked = DriverConfig { is_networked: true, ..DriverConfig::default() };
    for (noise, wanted) in [(&b""[..], "that no other client has"), (b"hello\r\n", "check host")] {
        let mut bench = Bench::new(networked.clone());
        bench.firmware.is_dead = true;
        bench.handle(Input::PortOpened);
        bench.firmware.raw(noise);
        bench.wait(3000);
        assert!(bench.state().reason.contains(wanted), "{}", bench.state().reason);
    }
}

#[test]
fn a_network_has_no_baud_rate_that_bounds_what_is_under_way() {
    for (is_networked, wanted) in [(false, "at most 19 bytes"), (true, "at most 127 bytes")] {
        let mut bench =
            Bench::new(DriverConfig { is_networked, baud: 9600, ..DriverConfig::default() });
        bench.handle(Input::PortOpened);
        bench.until("idle", |bench| bench.mode() == Mode::Idle);
        assert!(bench.log.contains(wanted), "{}", bench.log);
    }
}

#[test]
fn inch_reports_are_understood_from_the_first_position_on() {
    let mut bench = Bench::new(DriverConfig::default());
    bench.firmware.settings = "$13=1\r\n$22=0\r\n$130=0\r\n$131=0\r\n$132=0\r\n";
    bench.handle(Input::PortOpened);
    bench.until("idle", |bench| bench.mode() == Mode::Idle);
    bench.start(straight(1));
    bench.until("the end", |bench| bench.finished.is_some());
    bench.wait(400);
    // The scripted controller says 10 and means inches.
    assert_eq!(bench.state().work_position, Some([254.0, 0.0, 0.0]));
    assert!(bench.states.iter().all(|state| state.work_position != Some([10.0, 0.0, 0.0])));
    assert_eq!(refusal(bench.ask(Command::Home)).0, error_code::NO_HOMING);
}

#[test]
fn a_banner_in_a_run_aborts_it_and_the_machine_is_not_homed() {
    let mut bench = Bench::running(straight(100));
    bench.firmware.restart();
    let result = bench.result();
    // Reset while moving is an alarm first, as the firmware has it.
    assert_ended(&result, RunOutcome::Aborted, error_code::ALARM);
    let mut bench = Bench::running(straight(100));
    bench.firmware.raw(BANNER.as_bytes());
    let result = bench.result();
    assert_ended(&result, RunOutcome::Aborted, error_code::RESTARTED);
    assert!(!bench.state().is_homed);
    let sent = bench.sent.len();
    bench.wait(3000);
    assert!(!bench.sent[sent..].contains(&b'X'), "nothing of the program is sent any more");
}

#[test]
fn damage_on_the_wire_stops_the_run() {
    for answer in ["o", "okok", "k", "<Idle|MPos:0.0"] {
        let mut bench = Bench::running(straight(100));
        bench.firmware.answer_with = Some(answer);
        let result = bench.result();
        assert_ended(&result, RunOutcome::Aborted, error_code::PROTOCOL);
        // The count is the operator's to settle.
        bench.until("a hold", |bench| bench.mode() == Mode::Hold);
        let resets = bench.sent_count(0x18);
        bench.wait(3000);
        assert_eq!((bench.mode(), bench.sent_count(0x18)), (Mode::Hold, resets));
        assert!(bench.state().reason.ends_with("soft_reset to go on"), "{}", bench.state().reason);
        assert_eq!(refusal(bench.ask(Command::Resume)).0, error_code::NEEDS_RESET);
        bench.command(7, Command::SoftReset);
        bench.until("idle", |bench| bench.mode() == Mode::Idle);
    }
}

#[test]
fn a_lost_answer_is_found_when_the_machine_has_nothing_left_to_do() {
    let mut bench = Bench::running(straight(30));
    bench.firmware.answer_with = Some("[MSG:this was an ok]");
    let result = bench.result();
    assert_ended(&result, RunOutcome::Aborted, error_code::PROTOCOL);
}

#[test]
fn a_controller_that_falls_silent_is_unknown_and_may_be_moving() {
    let mut bench = Bench::running(straight(100));
    bench.firmware.is_dead = true;
    let result = bench.result();
    assert_ended(&result, RunOutcome::Aborted, error_code::LINK_LOST);
    assert!(result.message.contains("motion may continue"));
    let state = bench.state();
    assert_eq!((state.mode, state.work_position), (Mode::Unknown, None));
    assert!(state.reason.starts_with("LINK_LOST"), "{}", state.reason);
    // It comes back, still holding lines; that is not a reason to go on.
    bench.firmware.is_dead = false;
    bench.wait(2000);
    assert_ne!(bench.mode(), Mode::Unknown);
    bench.start(straight(3));
    assert_eq!(refusal(bench.replies.pop().unwrap().1).0, error_code::NEEDS_RESET);
}

#[test]
fn an_unplugged_port_aborts_and_is_unknown_while_it_may_be_moving() {
    let mut bench = Bench::running(straight(100));
    bench.handle(Input::PortClosed { reason: "/dev/ttyUSB0 is gone".into() });
    let result = bench.result();
    assert_ended(&result, RunOutcome::Aborted, error_code::LINK_LOST);
    assert!(result.message.contains("/dev/ttyUSB0 is gone; motion may continue"));
    assert_eq!(bench.mode(), Mode::Unknown);
    let sent = bench.sent.len();
    bench.wait(5000);
    assert_eq!(bench.sent.len(), sent);
    // It is back and idle, and nobody has looked at it yet.
    bench.handle(Input::PortOpened);
    bench.until("idle", |bench| bench.mode() == Mode::Idle);
    assert!(bench.state().reason.starts_with("LINK_LOST"), "{}", bench.state().reason);
    bench.start(straight(3));
    assert_eq!(refusal(bench.replies.pop().unwrap().1).0, error_code::NEEDS_RESET);
    bench.command(7, Command::SoftReset);
    bench.until("idle", |bench| bench.mode() == Mode::Idle && bench.state().reason.is_empty());
    // A port that went while nothing moved is just not there.
    let mut bench = Bench::connected();
    bench.handle(Input::PortClosed { reason: "unplugged".into() });
    assert_eq!((bench.mode(), bench.state().reason.as_str()), (Mode::Disconnected, "unplugged"));
}
