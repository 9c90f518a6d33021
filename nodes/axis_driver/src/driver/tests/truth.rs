//! What is said when the wire goes at the worst moment.

use super::bench::{Bench, straight, with_event};
use super::*;
use cnc_msgs::contour::SpindleMode;

#[test]
fn a_reset_in_a_run_that_is_cut_off_is_not_called_done() {
    let mut bench = Bench::running(straight(60));
    bench.firmware.is_dead = true;
    bench.command(7, Command::SoftReset);
    bench.handle(Input::PortClosed { reason: "unplugged".into() });
    let (_, reply) = bench.replies.iter().find(|(id, _)| *id == 7).expect("an answer");
    assert_eq!(reply.as_ref().expect_err("a refusal").error_code, error_code::LINK_LOST);
}

#[test]
fn a_controller_that_does_not_come_back_from_a_reset_is_not_called_idle() {
    let mut bench = Bench::connected();
    bench.firmware.is_dead = true;
    bench.command(7, Command::SoftReset);
    bench.until("an answer", |bench| !bench.replies.is_empty());
    assert_eq!(refusal(bench.replies[0].1.clone()).0, error_code::NO_ANSWER);
    bench.wait(5_000);
    assert_eq!(bench.mode(), Mode::Unknown);
}

#[test]
fn answers_are_counted_after_an_alarm_at_the_start() {
    let mut bench = Bench::new(DriverConfig::default());
    bench.handle(Input::PortOpened);
    bench.until("questions", |bench| bench.sent.ends_with(b"$I\n"));
    bench.firmware.raw(b"ALARM:11\r\n");
    bench.until("idle", |bench| bench.mode() == Mode::Idle);
    bench.start(straight(60));
    bench.until("a few lines are cut", |bench| bench.state().line >= 3);
    for _ in 0..40 {
        bench.firmware.raw(b"ok\r\n");
    }
    assert_ended(&bench.result(), RunOutcome::Aborted, error_code::PROTOCOL);
}

#[test]
fn a_machine_that_still_moves_when_the_link_is_back_is_held() {
    let mut bench = Bench::running(straight(400));
    bench.firmware.is_dead = true;
    assert_ended(&bench.result(), RunOutcome::Aborted, error_code::LINK_LOST);
    bench.firmware.is_dead = false;
    bench.until("a hold", |bench| bench.mode() == Mode::Hold);
}

#[test]
fn a_resume_while_the_machine_slows_down_is_not_called_done() {
    let mut bench = Bench::running(straight(60));
    bench.ask(Command::FeedHold).unwrap();
    let x = bench.state().machine_position.unwrap()[0];
    let report = format!("<Hold:1|MPos:{x:.3},0.000,0.000|FS:10,0>\r\n");
    bench.handle(Input::Received(report.into_bytes()));
    let (code, message) = refusal(bench.ask(Command::Resume));
    assert_eq!(code, error_code::BUSY, "{message}");
    bench.until("a hold", |bench| bench.driver.context.machine.is_held());
    bench.ask(Command::Resume).unwrap();
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
}

#[test]
fn a_hold_before_the_first_line_is_answered_lasts_until_it_is_resumed() {
    let mut bench = Bench::connected();
    bench.start(straight(5));
    bench.until("the first words", |bench| bench.sent.ends_with(b"G54\n"));
    bench.ask(Command::FeedHold).unwrap();
    bench.wait(6_000);
    assert_eq!(bench.finished, None);
    assert_eq!(bench.mode(), Mode::Hold);
    bench.ask(Command::Resume).unwrap();
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
}

#[test]
fn a_shutdown_while_homing_waits_for_the_controller_to_start_anew() {
    let mut bench = Bench::connected();
    bench.command(7, Command::Home);
    bench.command(8, Command::Shutdown);
    assert!(!bench.is_ready_to_close);
    bench.until("ready to close", |bench| bench.is_ready_to_close);
}

#[test]
fn a_setting_that_is_no_number_is_not_taken() {
    let mut bench = Bench::new(DriverConfig::default());
    bench.firmware.settings = "$13=0\r\n$22=1\r\n$110=nan\r\n$120=inf\r\n";
    bench.handle(Input::PortOpened);
    bench.until("idle", |bench| bench.mode() == Mode::Idle);
    let checkpoint = bench.driver.checkpoint().expect("at rest");
    assert!(Driver::from_checkpoint(checkpoint.as_bytes()).is_ok(), "{checkpoint}");
}

#[test]
fn a_start_in_the_middle_is_looked_at_in_the_work_system_of_that_place() {
    let mut bench = Bench::connected();
    bench.start(straight(5));
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
    // X50 of the machine is X0 of G55, and line 6 begins at X50 of G55.
    bench.firmware.second_zero = [50.0, 0.0, 0.0];
    let path = with_event(straight(9), 0, Action::WorkOffset { system: 2 });
    let path = with_event(path, 0, Action::Spindle(SpindleMode::Clockwise));
    let executed = bench.firmware.executed.len();
    bench.finished = None;
    bench.run_program(path.clone(), 6, false);
    assert_ended(&bench.result(), RunOutcome::Aborted, error_code::START_POSITION);
    let preamble = "G21G90G94G17G40G49G54";
    assert_eq!(bench.firmware.executed[executed..], [preamble, "G55", "G4P0.01"]);
    bench.firmware.second_zero = [0.0; 3];
    let executed = bench.firmware.executed.len();
    bench.finished = None;
    bench.run_program(path, 6, false);
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
    assert_eq!(
        bench.firmware.executed[executed..executed + 5],
        [preamble, "G55", "G4P0.01", "M3", "G1X60F600"]
    );
}

#[test]
fn a_lost_answer_before_a_spindle_word_and_a_word_that_goes_alone_ends_the_run() {
    let mut bench = Bench::connected();
    bench.command(7, Command::Home);
    bench.until("homed", |bench| bench.state().is_homed && bench.mode() == Mode::Idle);
    bench.start(with_event(
        with_event(straight(40), 30, Action::Spindle(SpindleMode::Off)),
        30,
        Action::Reference { axes: AxisSet::NONE.with(2), second: false },
    ));
    bench.until("a few lines are cut", |bench| bench.state().line >= 3);
    bench.firmware.answer_with = Some("[MSG:lost]");
    assert_ended(&bench.result(), RunOutcome::Aborted, error_code::PROTOCOL);
}

#[test]
fn a_hold_that_is_still_looked_for_is_part_of_a_checkpoint() {
    let mut bench = Bench::connected();
    bench.firmware.never_stands = true;
    bench.firmware.holds_ignored = 99;
    bench.ask(Command::FeedHold).unwrap();
    // Refused, but a place where a record can begin.
    bench.ask(Command::ConfirmToolChange { objection: None }).unwrap_err();
    bench.wait(2_000);
    assert!(bench.sent_count(b'!') > 2);
}
