//! The controller starts anew in a run, is in alarm, or says nothing any more.

use super::cell::{Cell, Plan, never_idle, settings};
use super::wire::{Trouble, Writer};
use cnc_msgs::wire::cnc_msgs::action::RunProgramResult;
use cnc_msgs::wire::cnc_msgs::msg::MachineState;
use cnc_msgs::wire::diagnostic_msgs::msg::DiagnosticStatus;

/// Lines that the driver may write before it has read what the controller has written: as
/// many short ones as fit into the window, on a host that gives it no processor meanwhile.
const CROSSING_LINES_MAX: usize = 127 / "X-1\n".len();

/// A machine with switches, at home.
fn homed(settings: &[&str]) -> Cell {
    let mut controller = vec!["--homing"];
    controller.extend(settings);
    let cell = Cell::new(&Plan { controller: &controller, ..Plan::default() });
    cell.commander.until_mode("ALARM");
    assert!(cell.commander.home().success);
    assert!(cell.until_ready().is_homed);
    cell
}

#[test]
fn a_controller_that_starts_anew_in_a_run_has_to_be_homed() {
    let cell = homed(&[]);
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    cell.controller.inject("reset");
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_ABORTED, "{result:?}");
    assert_eq!(result.error_code, RunProgramResult::RESTARTED, "{result:?}");
    assert!(result.message.contains("restarted") && result.message.contains("home"), "{result:?}");
    let locked = cell.commander.until_mode("ALARM");
    assert!(!locked.is_homed, "{locked:?}");
    assert_eq!(locked.line, result.last_line, "{locked:?}");
    never_idle(&cell.commander.states_since(moment.states));
    cell.refuses_to_run("ALARM");
    cell.commander.press("resume").expect_err("there is nothing to continue");
    // After the start message only queries, and lines that may have crossed it.
    let passed = cell.wire.passed_since(moment.wire);
    let is_banner = |said: &[u8]| said.starts_with(b"Grbl ");
    let banner = passed.iter().position(|it| it.from == Writer::Controller && is_banner(&it.said));
    let after_banner = moment.wire + banner.expect("a start message");
    let sent = cell.wire.sent_since(after_banner);
    let (crossed, questions) = sent.split_at(sent.find("$I").expect("a question"));
    assert_eq!(questions, "$I\\n$$\\n$G\\n$#\\n");
    let lines = crossed.matches("\\n").count();
    assert!(lines <= CROSSING_LINES_MAX, "{crossed}");
    assert!(cell.commander.home().success);
    assert!(cell.until_ready().is_homed);
    cell.runs_again();
}

/// There is no alarm that would hold it back: it takes whatever place it is at for zero.
#[test]
fn a_controller_without_switches_that_starts_anew_in_a_run_waits_for_the_operator() {
    let cell = Cell::new(&Plan::default());
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    cell.controller.inject("reset");
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_ABORTED, "{result:?}");
    assert_eq!(result.error_code, RunProgramResult::RESTARTED, "{result:?}");
    let waits = cell.commander.until("a machine that waits", |state| state.needs_reset);
    assert!(waits.reason.contains("soft_reset") && !waits.is_homed, "{waits:?}");
    cell.refuses_to_run("soft_reset");
    let sent = cell.sent_since(moment);
    assert!(sent.ends_with("$I\\n$$\\n$G\\n$#\\n") && !sent.contains(['!', '~']), "{sent}");
    cell.commander.press("soft_reset").expect("the operator has looked");
    cell.runs_again();
}

/// Lines in transit when the board restarted are answered after its start message.
#[test]
fn an_answer_that_crosses_with_a_start_message_is_of_an_earlier_life() {
    let cell = homed(&[]);
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    let bytes = b"error:9\r\n".to_vec();
    cell.wire.trouble(Trouble::Say { after: "Grbl ", bytes });
    cell.controller.inject("reset");
    let result = cell.result(run);
    assert_eq!(result.error_code, RunProgramResult::RESTARTED, "{result:?}");
    let locked = cell.commander.until_mode("ALARM");
    assert!(!locked.is_homed && !locked.needs_reset, "{locked:?}");
    never_idle(&cell.commander.states_since(moment.states));
    assert!(cell.commander.home().success);
    cell.runs_again();
}

#[test]
fn an_alarm_in_a_run_locks_the_machine_until_somebody_unlocks_it() {
    let settings = settings("$21=1\n");
    let path = settings.path().to_str().expect("UTF-8");
    let cell = homed(&["--settings", path]);
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    cell.controller.inject("limit:X");
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_ABORTED, "{result:?}");
    assert_eq!(result.error_code, RunProgramResult::ALARM, "{result:?}");
    assert!(result.message.contains("ALARM:1"), "{result:?}");
    // The block that it happened in.
    let line = format!("line {}", result.last_line);
    assert!(result.message.contains(&line), "{line:?} is not in {result:?}");
    cell.names_its_block(&result.message);
    let locked = cell.commander.until_mode("ALARM");
    assert_eq!((locked.alarm_code, locked.line), (1, result.last_line), "{locked:?}");
    assert!(!locked.is_homed, "{locked:?}");
    cell.refuses_to_run("soft_reset");
    cell.commander.until_health(DiagnosticStatus::ERROR, "ALARM:1");
    let end = cell.moment();
    cell.controller.inject("release:X");
    cell.commander.press("unlock").expect_err("it listens to a reset only");
    // The position is not reported any more: the controller does not receive.
    cell.commander.press("soft_reset").expect("the operator resets");
    let locked = cell.commander.until("a lock that can be opened", |state| {
        state.state == MachineState::STATE_ALARM && !state.reason.contains("soft_reset")
    });
    assert!(!locked.is_homed, "{locked:?}");
    assert_eq!(cell.sent_since(end), "\\x18$I\\n$$\\n$G\\n$#\\n");
    cell.commander.press("unlock").expect("the operator unlocks");
    let idle = cell.until_ready();
    assert!(!idle.is_homed, "{idle:?}");
    // Its record says first why it ended, in the words of the goal, and is reproduced with them.
    let bag = cell.machine.until_bags(1).remove(0);
    let bag = bag.to_str().expect("UTF-8");
    let said = format!("result:      aborted (304): {}", result.message);
    let info = cell.machine.kerf(&["bag", "info", bag]).expect(0);
    assert!(info.out.starts_with(&said), "{said:?} is not the beginning of {}", info.out);
    cell.machine.kerf(&["replay", bag]).expect(0).says(&["driver: 0 differences"]);
    cell.machine.kerf(&["bag", "report", bag, "run.html"]).expect(0);
    let page = cell.machine.folder.path().join("run.html");
    let page = std::fs::read_to_string(page).expect("the page");
    assert!(page.contains("The run: aborted (304)"), "the page says it too");
    let mut locked = cell.commander.states_since(moment.states);
    locked.retain(|state| state.state != MachineState::STATE_IDLE || state.is_homed);
    never_idle(&locked);
}

#[test]
fn a_controller_that_goes_silent_is_unknown_and_is_held_when_it_speaks_again() {
    let cell = Cell::new(&Plan::default());
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    cell.wire.mute(true);
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_ABORTED, "{result:?}");
    assert_eq!(result.error_code, RunProgramResult::LINK_LOST, "{result:?}");
    assert!(result.message.contains("motion may continue"), "{result:?}");
    cell.is_at_line(result.last_line);
    let silent = cell.commander.until_mode("UNKNOWN");
    assert!(silent.motion_possible && !silent.position_known, "{silent:?}");
    assert!(silent.reason.contains("LINK_LOST"), "{silent:?}");
    assert_eq!(silent.line, result.last_line, "{silent:?}");
    cell.refuses_to_run("LINK_LOST");
    cell.commander.until_health(DiagnosticStatus::ERROR, "LINK_LOST");
    // It still receives: the hold has arrived.
    cell.until_controller("Hold:0");
    assert_eq!(cell.sent_after_hold(moment), "", "a hold and nothing else");
    cell.wire.mute(false);
    let held = cell.commander.until_mode("HOLD");
    assert!(held.reason.contains("soft_reset") && held.position_known, "{held:?}");
    assert!(!held.motion_possible, "{held:?}");
    cell.commander.press("resume").expect_err("the driver does not know what would continue");
    assert_eq!(cell.sent_after_hold(moment), "", "a hold and nothing else");
    never_idle(&cell.commander.states_since(moment.states));
    cell.commander.press("soft_reset").expect("the operator resets");
    cell.until_ready();

    // For ever.
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    cell.wire.mute(true);
    assert_eq!(cell.result(run).error_code, RunProgramResult::LINK_LOST);
    let refused = cell.commander.press("soft_reset").expect_err("the controller does not answer");
    assert!(refused.contains("no start message"), "{refused}");
    let silent = cell.commander.state();
    assert_eq!(silent.state, MachineState::STATE_UNKNOWN, "{silent:?}");
    assert!(!silent.position_known, "{silent:?}");
    never_idle(&cell.commander.states_since(moment.states));
    cell.wire.mute(false);
    cell.commander.press("soft_reset").expect("it is back");
    cell.until_ready();
    cell.runs_again();
}
