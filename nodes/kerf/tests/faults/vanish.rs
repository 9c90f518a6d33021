//! The line goes away in the middle of a line of the program, and comes back.

use super::cable::Cable;
use super::cell::{Cell, Moment, Plan, Serpentine, never_idle};
use super::wire::Trouble;
use cnc_msgs::wire::cnc_msgs::action::RunProgramResult;
use cnc_msgs::wire::cnc_msgs::msg::MachineState;

/// Pulls the cable in a line of the program; returns when, and what was reported.
#[track_caller]
fn vanishes_in_mid_line(cell: &Cell) -> (Moment, RunProgramResult) {
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    cell.wire.trouble(Trouble::Unplug { after: 2 });
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_ABORTED, "{result:?}");
    assert_eq!(result.error_code, RunProgramResult::LINK_LOST, "{result:?}");
    assert!(result.message.contains("motion may continue"), "{result:?}");
    // The last report; what is cut meanwhile is not known.
    cell.is_at_line(result.last_line);
    let state = cell.commander.until("a port that is gone", |state| state.motion_possible);
    is_unknown(&state);
    assert_eq!(state.line, result.last_line, "{state:?}");
    cell.refuses_to_run("LINK_LOST");
    for button in ["resume", "unlock", "soft_reset"] {
        cell.commander.press(button).expect_err("there is no line");
    }
    never_idle(&cell.commander.states_since(moment.states));
    (moment, result)
}

#[track_caller]
fn is_unknown(state: &MachineState) {
    assert_eq!(state.state, MachineState::STATE_UNKNOWN, "{state:?}");
    assert!(state.reason.contains("LINK_LOST"), "{state:?}");
    assert!(state.motion_possible && !state.position_known && !state.is_homed, "{state:?}");
}

#[test]
fn a_machine_that_still_moves_when_its_line_is_back_is_held_and_not_reset() {
    let plan = Plan { time_factor: 1, program: Serpentine::LONG_LINES, ..Plan::default() };
    let cell = Cell::new(&plan);
    let (moment, result) = vanishes_in_mid_line(&cell);
    assert_eq!(cell.wire.device(), None);
    let back = cell.moment();
    cell.wire.plug_in();
    let held = cell.commander.until_mode("HOLD");
    assert!(!held.is_homed && !held.motion_possible, "{held:?}");
    assert!(held.reason.contains("soft_reset"), "{held:?}");
    // It is the same life of the driver.
    assert!(!held.reason.contains("DRIVER_RESTARTED"), "{held:?}");
    assert_eq!(held.line, result.last_line, "{held:?}");
    cell.refuses_to_run("soft_reset");
    cell.commander.press("resume").expect_err("the driver does not know what would continue");
    assert_eq!(cell.sent_after_hold(back), "", "a hold and nothing else");
    never_idle(&cell.commander.states_since(moment.states));
    // The half line that was left in the controller goes with the reset.
    cell.commander.press("soft_reset").expect("the operator has looked");
    let idle = cell.until_ready();
    assert!(!idle.is_homed && !idle.motion_possible, "{idle:?}");
    cell.runs_again();
}

#[test]
fn a_machine_at_rest_when_its_line_is_back_waits_for_the_operator() {
    let cell = Cell::new(&Plan::default());
    let (moment, result) = vanishes_in_mid_line(&cell);
    // What was buffered is cut to its end; half a line is left.
    cell.until_controller("Idle");
    let back = cell.moment();
    cell.wire.plug_in();
    let stands = cell.commander.until("a report", |state| state.position_known);
    assert_eq!(stands.state, MachineState::STATE_IDLE, "{stands:?}");
    assert!(!stands.is_homed && !stands.motion_possible, "{stands:?}");
    let stands = cell.commander.until("a reason", |state| state.reason.contains("soft_reset"));
    assert!(stands.reason.contains("LINK_LOST"), "{stands:?}");
    assert_eq!(stands.line, result.last_line, "{stands:?}");
    cell.refuses_to_run("soft_reset");
    // It is queried again after one reset, which drops the half line.
    assert_eq!(cell.sent_since(back), "\\x18$I\\n$$\\n$G\\n$#\\n");
    let mut unknown = cell.commander.states_since(moment.states);
    unknown.retain(|state| !state.position_known);
    never_idle(&unknown);
    cell.commander.press("soft_reset").expect("the operator has looked");
    cell.until_ready();
    cell.runs_again();
}

#[test]
fn another_controller_with_the_same_name_is_queried_again() {
    let mut cell = Cell::new(&Plan::default());
    let before = cell.wire.device().expect("it is plugged in");
    vanishes_in_mid_line(&cell);
    let back = cell.moment();
    cell.replace_controller(&["--line-numbers"]);
    let after = cell.wire.device().expect("it is plugged in");
    // Another device at the same link; in a network another board at the same address.
    assert_eq!(before == after, Cable::wanted() == Cable::Tcp);
    let stands = cell.commander.until("a machine that waits", |state| {
        state.state == MachineState::STATE_IDLE && state.reason.contains("soft_reset")
    });
    assert!(!stands.is_homed && stands.machine_position.x == 0.0, "{stands:?}");
    assert_eq!(cell.sent_since(back), "\\x18$I\\n$$\\n$G\\n$#\\n");
    cell.refuses_to_run("soft_reset");
    cell.commander.press("soft_reset").expect("the operator has looked");
    cell.until_ready();
    cell.runs_again();
}
