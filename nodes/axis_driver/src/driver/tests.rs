//! Scenarios against a scripted controller. When a bench is dropped, its journal is
//! played again and must give the same bytes and outputs.

mod anything;
mod bench;
mod blocks;
mod deactivate;
mod replan;
mod truth;
mod wire;

use super::*;
use crate::codes::error_code;
use bench::{Bench, straight, with_event};
use cnc_msgs::contour::Action;
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::machine::Mode;

fn refusal(result: Result<String, Refusal>) -> (u16, String) {
    let refusal = result.expect_err("a refusal");
    (refusal.error_code, refusal.message)
}

fn assert_ended(result: &RunResult, outcome: RunOutcome, code: u16) {
    assert_eq!((result.outcome, result.error_code), (outcome, code), "{}", result.message);
}

#[test]
fn a_run_sends_every_line_and_is_done_when_the_machine_stands() {
    let mut bench = Bench::connected();
    bench.start(with_event(straight(60), 60, Action::ProgramEnd { rewind: true }));
    let result = bench.result();
    assert_ended(&result, RunOutcome::Succeeded, 0);
    assert_eq!(result.last_line, 60);
    let executed = &bench.firmware.executed;
    assert_eq!(executed[0], "G21G90G94G17G40G49G54");
    assert_eq!(executed[1], "G1X10F600");
    assert_eq!(executed[2], "X20");
    assert_eq!(executed[60..], ["X600", "M30", "G4P0.01"]);
    assert_eq!(bench.mode(), Mode::Idle);
    assert!(bench.firmware.most_held <= 127);
    assert!(matches!(bench.replies[0], (100, Ok(_))));
}

#[test]
fn the_state_names_the_line_that_is_cut_not_the_line_that_was_sent() {
    let mut bench = Bench::connected();
    bench.start(straight(60));
    for _ in 0..400 {
        bench.step();
        let state = bench.state();
        if let (Mode::Run, Some([x, ..])) = (state.mode, state.work_position) {
            let cut = (x / 10.0).round() as u32;
            assert!(state.line == cut || state.line == cut + 1 || cut == 0, "{state:?}");
        }
    }
    assert!(bench.lines_cut.windows(2).all(|pair| pair[0] <= pair[1]));
    assert!(bench.lines_cut.len() > 15, "{:?}", bench.lines_cut);
}

#[test]
fn cancel_holds_waits_for_standstill_and_resets() {
    let mut bench = Bench::running(straight(100));
    bench.ask(Command::CancelRun { run: None }).unwrap();
    let result = bench.result();
    assert_ended(&result, RunOutcome::Canceled, error_code::CANCELED);
    assert!((3..20).contains(&result.last_line), "{}", result.last_line);
    let stop: Vec<u8> = bench.sent.iter().copied().filter(|b| [b'!', 0x18].contains(b)).collect();
    assert_eq!(stop, [0x18, b'!', 0x18]);
    bench.until("idle", |bench| bench.mode() == Mode::Idle);
    assert_eq!(bench.state().alarm_code, 0, "the position was kept");
}

#[test]
fn a_hold_that_was_lost_on_the_wire_is_sent_again() {
    let mut bench = Bench::running(straight(100));
    bench.firmware.holds_ignored = 2;
    bench.ask(Command::CancelRun { run: None }).unwrap();
    assert_ended(&bench.result(), RunOutcome::Canceled, error_code::CANCELED);
    assert_eq!(bench.sent_count(b'!'), 3);
}

#[test]
fn feed_hold_is_written_at_once_and_nothing_resumes_by_itself() {
    let mut bench = Bench::running(straight(40));
    bench.ask(Command::FeedHold).unwrap();
    assert_eq!(bench.sent.last(), Some(&b'!'));
    bench.until("a hold", |bench| bench.mode() == Mode::Hold);
    let line = bench.state().line;
    bench.wait(10_000);
    assert_eq!((bench.mode(), bench.sent_count(b'~')), (Mode::Hold, 0));
    assert_eq!((bench.state().line, bench.state().reason.as_str()), (line, "FEED_HOLD"));
    bench.ask(Command::Resume).unwrap();
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
    assert_eq!(refusal(bench.ask(Command::Resume)).0, error_code::NOTHING_TO_DO);
}

#[test]
fn feed_hold_is_written_in_every_state_with_a_port() {
    let mut bench = Bench::new(DriverConfig::default());
    assert_eq!(refusal(bench.ask(Command::FeedHold)).0, error_code::NOT_CONNECTED);
    bench.firmware.is_dead = true;
    bench.handle(Input::PortOpened);
    bench.ask(Command::FeedHold).unwrap();
    bench.wait(3000);
    bench.ask(Command::FeedHold).unwrap();
    assert!(bench.sent_count(b'!') >= 2);
}

#[test]
fn a_refused_line_stops_the_run_and_names_its_source() {
    let mut bench = Bench::connected();
    bench.firmware.refuse = Some(("X80", 33));
    bench.start(straight(100));
    let result = bench.result();
    assert_ended(&result, RunOutcome::Aborted, error_code::CONTROLLER_ERROR);
    assert!(result.message.contains("line 8: the controller refused \"X80\": error:33 ("));
    assert!(!bench.firmware.executed.iter().any(|line| line == "X600"));
    assert_eq!(bench.sent_count(b'!'), 1);
}

#[test]
fn an_alarm_aborts_and_only_a_reset_and_an_unlock_lead_out() {
    let mut bench = Bench::connected();
    bench.firmware.alarm = Some(("X80", 2));
    bench.start(straight(100));
    let result = bench.result();
    assert_ended(&result, RunOutcome::Aborted, error_code::ALARM);
    assert!(result.message.starts_with("ALARM:2 ("), "{}", result.message);
    bench.wait(5000);
    assert_eq!((bench.mode(), bench.state().alarm_code), (Mode::Alarm, 2));
    assert_eq!(refusal(bench.ask(Command::Unlock)).0, error_code::NEEDS_RESET);
    bench.command(7, Command::SoftReset);
    bench.wait(1000);
    assert_eq!(bench.mode(), Mode::Alarm);
    bench.start(straight(3));
    assert_eq!(refusal(bench.replies.pop().unwrap().1).0, error_code::ALARM);
    bench.command(8, Command::Unlock);
    bench.until("idle", |bench| bench.mode() == Mode::Idle);
    assert!(bench.replies.iter().any(|(id, result)| *id == 8 && result.is_ok()));
}

#[test]
fn homing_makes_the_position_trustworthy_until_it_is_lost() {
    let mut bench = Bench::connected();
    bench.command(5, Command::Home);
    assert_eq!(bench.mode(), Mode::Home);
    bench.until("homed", |bench| bench.state().is_homed);
    bench.until("idle", |bench| bench.mode() == Mode::Idle);
    bench.start(straight(100));
    bench.until("a few lines", |bench| bench.state().line >= 3);
    bench.command(6, Command::SoftReset);
    let result = bench.result();
    assert_ended(&result, RunOutcome::Aborted, error_code::SOFT_RESET);
    assert!(result.message.contains("ALARM:3"), "{}", result.message);
    assert!(bench.replies.iter().any(|(id, result)| *id == 6 && result.is_ok()));
    assert!(!bench.state().is_homed);
    bench.wait(400);
    assert_eq!(bench.mode(), Mode::Alarm);
}

#[test]
fn a_tool_change_waits_for_standstill_and_for_the_operator() {
    let mut bench = Bench::connected();
    bench.start(with_event(straight(40), 20, Action::ChangeTool { tool: 4 }));
    bench.until("a tool change", |bench| bench.mode() == Mode::ToolChange);
    assert!(bench.state().reason.contains("T4"), "{}", bench.state().reason);
    assert_eq!(bench.state().work_position, Some([200.0, 0.0, 0.0]));
    assert_eq!(bench.firmware.executed.last().unwrap(), "G4P0.01");
    bench.wait(5000);
    assert_eq!(bench.mode(), Mode::ToolChange);
    assert_eq!(refusal(bench.ask(Command::Resume)).0, error_code::NOTHING_TO_DO);
    bench.ask(Command::ConfirmToolChange { objection: None }).unwrap();
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
    assert_eq!(bench.firmware.executed.len(), 1 + 40 + 3);
    assert_eq!(
        refusal(bench.ask(Command::ConfirmToolChange { objection: None })).0,
        error_code::NOTHING_TO_DO
    );
}

#[test]
fn a_cancel_while_a_tool_is_changed_resets_so_that_coolant_does_not_stay_on() {
    let mut bench = Bench::connected();
    bench.start(with_event(straight(40), 20, Action::ChangeTool { tool: 4 }));
    bench.until("a tool change", |bench| bench.mode() == Mode::ToolChange);
    bench.ask(Command::CancelRun { run: None }).unwrap();
    assert_ended(&bench.result(), RunOutcome::Canceled, error_code::CANCELED);
    assert_eq!(bench.sent_count(0x18), 2);
    bench.until("idle", |bench| bench.mode() == Mode::Idle);
    assert_eq!(bench.state().alarm_code, 0, "the position was kept");
}

#[test]
fn a_program_stop_holds_until_it_is_resumed() {
    let mut bench = Bench::connected();
    bench.start(with_event(straight(10), 5, Action::Stop { optional: false }));
    bench.until("a stop", |bench| bench.mode() == Mode::Hold);
    bench.wait(3000);
    assert_eq!(bench.mode(), Mode::Hold);
    bench.ask(Command::Resume).unwrap();
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
}

#[test]
fn a_path_that_cannot_be_encoded_moves_nothing() {
    let mut bench = Bench::connected();
    let mut path = straight(30);
    path.elements[29].end[0] = 1e9;
    let before = bench.sent.len();
    bench.start(path);
    bench.until("an answer", |bench| !bench.replies.is_empty());
    let (code, message) = refusal(bench.replies[0].1.clone());
    assert_eq!(code, error_code::NOT_ENCODABLE);
    assert!(
        message.starts_with("line 30: X1000000000 is not between -10000 and 10000 mm"),
        "{message}"
    );
    assert!(bench.sent[before..].iter().all(|byte| *byte == b'?'));
    assert_eq!(bench.finished, None);
}

#[test]
fn a_path_that_relies_on_its_start_runs_only_from_there() {
    let mut bench = Bench::connected();
    let mut path = straight(30);
    path.start = [5.0, 2.0, 0.0];
    path.assumed_axes = AxisSet::NONE.with(0);
    let before = bench.sent.len();
    bench.start(path.clone());
    let (code, message) = refusal(bench.replies[0].1.clone());
    assert_eq!(code, error_code::START_POSITION);
    assert_eq!(
        message,
        "the path begins at X5.000 but the tool is at X0.000 in the work frame: move it there first"
    );
    assert!(bench.sent[before..].iter().all(|byte| *byte == b'?'));
    path.start[0] = 0.009;
    bench.start(path);
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
}

#[test]
fn a_start_in_the_middle_needs_the_tool_there_and_repeats_the_words_in_force() {
    let mut bench = Bench::connected();
    let path = with_event(straight(10), 2, Action::SpindleSpeed { rpm: 900.0 });
    bench.run_program(path.clone(), 6, false);
    assert_eq!(refusal(bench.replies.pop().unwrap().1).0, error_code::START_POSITION);
    bench.run_program(path, 99, false);
    assert_eq!(refusal(bench.replies.pop().unwrap().1).0, error_code::START_LINE);
    // The tool gets to X50, where line 6 begins.
    bench.start(straight(5));
    bench.result();
    let executed = bench.firmware.executed.len();
    bench.finished = None;
    let path = with_event(straight(7), 2, Action::SpindleSpeed { rpm: 900.0 });
    bench.run_program(path, 6, false);
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
    assert_eq!(
        bench.firmware.executed[executed..],
        ["G21G90G94G17G40G49G54", "S900", "G1X60F600", "X70", "G4P0.01"]
    );
}

#[test]
fn a_check_sends_nothing_and_needs_no_port() {
    let mut bench = Bench::new(DriverConfig::default());
    let mut long = straight(20_000);
    long.elements.iter_mut().for_each(|element| element.end[0] *= 0.01);
    bench.run_program(long, 0, true);
    assert!(bench.finished.is_none(), "a long path is proven in slices");
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
    assert!(bench.sent.is_empty());
    let mut bad = straight(3);
    bad.elements[1].feed_mm_per_min = Some(0.0);
    bench.run_program(bad, 0, true);
    assert_eq!(refusal(bench.replies.pop().unwrap().1).0, error_code::NOT_ENCODABLE);
}

#[test]
fn each_check_says_what_it_could_not_judge() {
    let mut bench = Bench::new(DriverConfig::default());
    for checks in 1..=2 {
        bench.run_program(straight(3), 0, true);
        assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
        let said = bench.log.matches("the travel was not checked").count();
        assert_eq!(said, checks, "{}", bench.log);
    }
}

#[test]
fn a_check_beside_a_run_takes_no_words_from_it() {
    let mut bench = Bench::running(straight(60));
    let count = |bench: &Bench| bench.log.matches("the machine is not homed").count();
    let (of_run, said) = (count(&bench), bench.driver.context.not_checked.clone());
    bench.run_program(straight(3), 0, true);
    bench.wait(100);
    assert_eq!((of_run, count(&bench)), (1, 2), "{}", bench.log);
    assert_eq!(bench.driver.context.not_checked, said, "the run has said it");
}

#[test]
fn a_cancel_stops_the_run_whatever_else_is_being_checked() {
    let mut bench = Bench::running(straight(60));
    let mut long = straight(20_000);
    long.elements.iter_mut().for_each(|element| element.end[0] *= 0.01);
    bench.run_program(long, 0, true);
    bench.ask(Command::CancelRun { run: None }).unwrap();
    assert_ended(&bench.result(), RunOutcome::Canceled, error_code::CANCELED);
}

#[test]
fn a_second_run_is_refused_while_one_is_running() {
    let mut bench = Bench::running(straight(60));
    bench.start(straight(3));
    assert_eq!(refusal(bench.replies.pop().unwrap().1).0, error_code::BUSY);
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
}

#[test]
fn shutdown_brings_a_run_to_a_standstill_first() {
    let mut bench = Bench::running(straight(100));
    bench.command(8, Command::Shutdown);
    assert!(!bench.is_ready_to_close);
    bench.until("ready to close", |bench| bench.is_ready_to_close);
    assert_ended(&bench.result(), RunOutcome::Aborted, error_code::SHUTDOWN);
    assert_eq!(bench.state().alarm_code, 0);
    let mut bench = Bench::connected();
    bench.command(8, Command::Shutdown);
    assert!(bench.is_ready_to_close);
}

#[test]
fn a_controller_that_will_not_stop_is_reported_as_moving() {
    let mut bench = Bench::running(straight(400));
    bench.firmware.never_stands = true;
    bench.ask(Command::CancelRun { run: None }).unwrap();
    let result = bench.result();
    assert_ended(&result, RunOutcome::Aborted, error_code::LINK_LOST);
    assert!(result.message.contains("motion may continue"), "{}", result.message);
}

#[test]
fn a_cancel_that_names_a_run_stops_that_one_alone() {
    let mut bench = Bench::connected();
    let mut long = straight(20_000);
    long.elements.iter_mut().for_each(|element| element.end[0] *= 0.01);
    // Nobody waited for the proof: the run must not begin after all.
    bench.start(long);
    assert!(bench.replies.is_empty());
    bench.ask(Command::CancelRun { run: Some(100) }).unwrap();
    bench.wait(2_000);
    assert_eq!(bench.firmware.executed, [""; 0]);
    bench.start(straight(30));
    bench.until("a few lines are cut", |bench| bench.state().line >= 3);
    let other = bench.ask(Command::CancelRun { run: Some(99) });
    assert_eq!(refusal(other).0, error_code::NOTHING_TO_DO);
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
}
