//! A driver that takes up nothing more: deactivated in whatever it does, and active again.

use super::bench::{Bench, straight};
use super::*;
use cnc_msgs::further::FurtherAxes;

fn stops(bench: &Bench) -> Vec<u8> {
    bench.sent.iter().copied().filter(|byte| [b'!', b'~', 0x18].contains(byte)).collect()
}

/// Waits for the answer to a command.
fn answer(bench: &mut Bench, id: u64) -> Result<String, Refusal> {
    bench.until("an answer", |bench| bench.replies.iter().any(|(of, _)| *of == id));
    bench.replies.iter().find(|(of, _)| *of == id).expect("it was seen").1.clone()
}

#[test]
fn deactivating_in_a_run_holds_waits_for_standstill_and_resets() {
    let mut bench = Bench::running(straight(100));
    let before = stops(&bench).len();
    bench.command(8, Command::Deactivate);
    assert_eq!(bench.sent.last(), Some(&b'!'), "it holds before all else");
    assert!(bench.replies.iter().all(|(id, _)| *id != 8), "it is answered when it stands");
    assert_eq!(answer(&mut bench, 8), Ok("stopped".into()));
    let result = bench.result();
    assert_ended(&result, RunOutcome::Aborted, error_code::NOT_ACTIVE);
    assert_eq!(result.message, "stopped because the driver was deactivated");
    assert!((3..20).contains(&result.last_line), "{}", result.last_line);
    assert_eq!(stops(&bench)[before..], [b'!', 0x18]);
    assert!(!bench.is_ready_to_close, "the port stays open");
    let state = bench.state();
    assert_eq!((state.mode, state.alarm_code), (Mode::Idle, 0), "the position was kept");
    assert!(state.reason.starts_with("INACTIVE: "), "{}", state.reason);
}

#[test]
fn an_inactive_driver_moves_nothing_and_still_holds_and_resets() {
    let mut bench = Bench::connected();
    bench.ask(Command::Deactivate).unwrap();
    let before = bench.sent.len();
    let jog = JogRequest {
        further: FurtherAxes::NONE,
        frame: JogFrame::Relative,
        axes: AxisSet::NONE.with(0),
        target: [5.0, 0.0, 0.0],
        feed_mm_per_min: 100.0,
    };
    for command in [
        Command::Home,
        Command::Jog(jog),
        Command::Unlock,
        Command::Resume,
        Command::Sleep,
        Command::ExecuteMdi {
            path: std::sync::Arc::new(straight(1)),
            tool_diameters_mm: Default::default(),
        },
    ] {
        let (code, message) = refusal(bench.ask(command));
        assert_eq!(
            (code, message.as_str()),
            (error_code::NOT_ACTIVE, crate::driver::deactivate::NOT_ACTIVE)
        );
    }
    for check_only in [false, true] {
        bench.run_program(straight(3), 0, check_only);
        assert_eq!(refusal(bench.replies.pop().unwrap().1).0, error_code::NOT_ACTIVE);
    }
    assert!(bench.sent[before..].iter().all(|byte| *byte == b'?'), "nothing was sent");
    bench.ask(Command::FeedHold).unwrap();
    assert_eq!(bench.sent.last(), Some(&b'!'));
    bench.command(9, Command::SoftReset);
    assert!(answer(&mut bench, 9).is_ok());
    bench.until("idle", |bench| bench.mode() == Mode::Idle);
    bench.ask(Command::Activate).unwrap();
    assert_eq!(bench.state().reason, "");
    bench.start(straight(3));
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
}

#[test]
fn a_machine_that_does_not_stand_leaves_the_driver_active() {
    let mut bench = Bench::running(straight(400));
    bench.firmware.never_stands = true;
    bench.command(8, Command::Deactivate);
    let (code, message) = refusal(answer(&mut bench, 8));
    assert_eq!(code, error_code::LINK_LOST);
    assert!(message.contains("motion may continue"), "{message}");
    assert_ended(&bench.result(), RunOutcome::Aborted, error_code::LINK_LOST);
    assert!(!bench.state().reason.starts_with("INACTIVE"), "{}", bench.state().reason);
}

#[test]
fn a_shutdown_does_not_wait_for_a_deactivation() {
    let mut bench = Bench::running(straight(100));
    bench.command(8, Command::Deactivate);
    assert_eq!(refusal(bench.ask(Command::Activate)).0, error_code::BUSY);
    bench.command(9, Command::Shutdown);
    assert_eq!(refusal(answer(&mut bench, 8)).0, error_code::SHUTDOWN);
    bench.until("ready to close", |bench| bench.is_ready_to_close);
    assert_ended(&bench.result(), RunOutcome::Aborted, error_code::NOT_ACTIVE);
}

#[test]
fn an_inactive_driver_without_a_port_says_so_too() {
    let mut bench = Bench::new(DriverConfig::default());
    bench.ask(Command::Deactivate).unwrap();
    assert_eq!(refusal(bench.ask(Command::Home)).0, error_code::NOT_ACTIVE);
    let (code, _) = refusal(bench.ask(Command::FeedHold));
    assert_eq!(code, error_code::NOT_CONNECTED, "there is nothing to hold");
    bench.handle(Input::PortOpened);
    bench.until("a known machine", |bench| bench.mode() == Mode::Idle);
    assert!(bench.state().reason.starts_with("INACTIVE: "));
}
