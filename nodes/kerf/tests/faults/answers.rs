//! A run that is stopped, and answers that do not match: lost, doubled, damaged.

use super::cell::{Cell, Plan, Serpentine, settings};
use super::wire::{Trouble, Writer};
use cnc_msgs::wire::cnc_msgs::action::RunProgramResult;
use cnc_msgs::wire::cnc_msgs::msg::MachineState;

/// Fails unless the machine is held in the reported line, gets nothing
/// more, and is idle when the operator has reset it; returns what was said.
#[track_caller]
fn stops_for_good(cell: &Cell, trouble: Trouble, error_code: u16, says: &str) -> String {
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    cell.wire.trouble(trouble.clone());
    let result = cell.result(run);
    assert!(cell.wire.is_done(), "{trouble:?} has not happened");
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_ABORTED, "{trouble:?}: {result:?}");
    assert_eq!(result.error_code, error_code, "{trouble:?}: {result:?}");
    assert!(result.message.contains(says), "{trouble:?}: {result:?}");
    let held = cell.commander.until_mode("HOLD");
    assert!(held.reason.contains("soft_reset"), "{trouble:?}: {held:?}");
    cell.is_at_line(result.last_line);
    assert_eq!(held.line, result.last_line, "{trouble:?}");
    cell.refuses_to_run("soft_reset");
    assert!(cell.commander.press("resume").is_err(), "{trouble:?}");
    let sent = cell.sent_after_hold(moment);
    assert_eq!(sent, "", "{trouble:?}: nothing but a hold");
    // It may have reached its end before; it is never reported as ready.
    let states = cell.commander.states_since(moment.states);
    let idle =
        states.iter().find(|it| it.state == MachineState::STATE_IDLE && it.reason.is_empty());
    assert!(idle.is_none(), "{trouble:?}: {idle:?}");
    cell.commander.press("soft_reset").expect("the operator resets");
    cell.until_ready();
    result.message
}

const PROTOCOL: u16 = RunProgramResult::PROTOCOL;
const REFUSED: u16 = RunProgramResult::CONTROLLER_ERROR;

#[test]
fn a_cancel_holds_and_resets_when_the_machine_is_at_rest() {
    let cell = Cell::new(&Plan::default());
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    cell.commander.cancel();
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_CANCELED, "{result:?}");
    assert_eq!(result.error_code, RunProgramResult::CANCELED, "{result:?}");
    cell.is_at_line(result.last_line);
    cell.until_ready();
    assert_eq!(cell.sent_after_hold(moment), "\\x18$G\\n$#\\n", "a reset and questions");
    // No step is lost: it was at rest when it was reset.
    let passed = cell.wire.passed_since(moment.wire);
    let reset = passed.iter().position(|it| it.from == Writer::Driver && it.said.contains(&0x18));
    let before = passed[..reset.expect("a reset")].iter().rev();
    let mut reports = before.filter(|it| it.arrived.starts_with(b"<"));
    assert!(reports.next().expect("a report").arrived.starts_with(b"<Hold:0"));
    cell.runs_again();
}

#[test]
fn a_hold_that_does_not_arrive_is_sent_again() {
    let plan = Plan { time_factor: 1, program: Serpentine::LONG_LINES, ..Plan::default() };
    let cell = Cell::new(&plan);
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    cell.wire.trouble(Trouble::LoseByte(b'!'));
    cell.commander.cancel();
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_CANCELED, "{result:?}");
    assert!(cell.sent_since(moment).contains("!!"), "{}", cell.sent_since(moment));
    assert_eq!(cell.sent_after_hold(moment), "\\x18$G\\n$#\\n", "a reset and questions");
    cell.is_at_line(result.last_line);
    cell.runs_again();
}

#[test]
fn an_answer_that_is_lost_ends_the_run_in_a_hold() {
    let cell = Cell::new(&Plan::default());
    stops_for_good(&cell, Trouble::LoseOk, PROTOCOL, "answer");
    cell.runs_again();
}

/// Lines are short, and a line is read before it is answered: nothing shows before the end,
/// whether or not the controller reports its buffers.
#[test]
fn an_answer_too_many_is_never_a_success() {
    for reports in ["$10=1\n", "$10=3\n"] {
        let settings = settings(reports);
        let path = settings.path().to_str().expect("UTF-8");
        let program = Serpentine { passes: 3, ..Serpentine::SHORT_LINES };
        let controller = ["--settings", path];
        let cell = Cell::new(&Plan { program, controller: &controller, ..Plan::default() });
        let run = cell.run_into_the_midst();
        let moment = cell.moment();
        cell.wire.trouble(Trouble::DoubleOk);
        let result = cell.result(run);
        assert_eq!(result.outcome, RunProgramResult::OUTCOME_ABORTED, "{result:?}");
        assert_eq!(result.error_code, PROTOCOL, "{result:?}");
        cell.is_at_line(result.last_line);
        let waits = cell.commander.until("a machine that waits", |state| state.needs_reset);
        assert!(waits.reason.contains("soft_reset"), "{waits:?}");
        cell.refuses_to_run("soft_reset");
        assert_eq!(cell.sent_after_hold(moment), "");
        cell.commander.press("soft_reset").expect("the operator resets");
        cell.until_ready();
        cell.runs_again();
    }
}

#[test]
fn damage_from_the_controller_ends_the_run_in_a_hold() {
    let cell = Cell::new(&Plan::default());
    stops_for_good(&cell, Trouble::HalveOk, PROTOCOL, "damaged");
    stops_for_good(&cell, Trouble::BeheadReport, PROTOCOL, "damaged");
    let bytes = b"\xf0\x9f\x00o\xffk\xfe~\x18!Grbl$X\r\n".to_vec();
    stops_for_good(&cell, Trouble::Say { after: "", bytes }, PROTOCOL, "damaged");
    cell.runs_again();
}

#[test]
fn damage_on_the_way_to_the_controller_ends_the_run_in_a_hold_where_it_is_refused() {
    // Where a pass ends, two lines that become one are a line that the controller takes: far away.
    let program = Serpentine { steps: 300, ..Serpentine::SHORT_LINES };
    let cell = Cell::new(&Plan { program, ..Plan::default() });
    for trouble in [Trouble::LoseLineEnd, Trouble::LoseLetter] {
        let message = stops_for_good(&cell, trouble, REFUSED, "error:");
        cell.names_its_block(&message);
    }
    cell.runs_again();
}
