//! The driver dies in the middle of a run and is started again; a board that starts anew
//! when its port is opened.

use super::cable::Cable;
use super::cell::{Cell, Plan, Serpentine, never_idle};
use super::machine::{kill_at_once, until};
use cnc_msgs::wire::cnc_msgs::msg::MachineState;
use cnc_msgs::wire::diagnostic_msgs::msg::DiagnosticStatus;

fn the_driver_dies_in_a_run(cable: Cable) {
    let plan = Plan { time_factor: 1, program: Serpentine::LONG_LINES, cable, ..Plan::default() };
    let cell = Cell::new(&plan);
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    kill_at_once(cell.machine.node("axis_driver"));
    let held = cell.commander.until_mode("HOLD");
    assert!(held.reason.contains("DRIVER_RESTARTED"), "{held:?}");
    // It knows nothing of the program any more, and does not say that it does.
    assert!(held.program_id.is_empty() && held.line == 0 && !held.is_homed, "{held:?}");
    cell.commander.until_health(DiagnosticStatus::WARN, "DRIVER_RESTARTED");
    cell.until_controller("Hold:0");
    let lost = cell.commander.result(run).expect_err("the goal belongs to an earlier life");
    assert!(lost.contains("restarted"), "{lost}");
    cell.refuses_to_run("DRIVER_RESTARTED");
    cell.commander.press("resume").expect_err("the driver does not know what would continue");
    cell.commander.press("unlock").expect_err("it is not locked");
    assert_eq!(cell.sent_after_hold(moment), "", "a hold and nothing else");
    never_idle(&cell.commander.states_since(moment.states));
    cell.commander.press("soft_reset").expect("the operator takes it over");
    let idle = cell.until_ready();
    assert!(!idle.is_homed, "{idle:?}");
    assert_eq!(cell.sent_after_hold(moment), "\\x18$I\\n$$\\n$G\\n$#\\n");
    cell.runs_again();
}

#[test]
fn a_driver_that_is_started_again_in_a_run_holds_and_does_nothing_else() {
    for cable in Cable::BOTH {
        the_driver_dies_in_a_run(cable);
    }
}

#[test]
fn a_restarted_driver_resets_a_machine_at_rest_once() {
    let cell = Cell::new(&Plan::default());
    let moment = cell.moment();
    kill_at_once(cell.machine.node("axis_driver"));
    until("a driver that has asked all", || {
        cell.sent_since(moment).ends_with("$#\\n").then_some(())
    });
    assert_eq!(cell.sent_since(moment), "\\x18$I\\n$$\\n$G\\n$#\\n");
    // It is connected before it is activated.
    let is_ready =
        |state: &MachineState| state.state == MachineState::STATE_IDLE && state.reason.is_empty();
    let idle = cell.until_after(cell.moment(), "a new life", is_ready);
    assert!(!idle.is_homed, "{idle:?}");
}

/// A board whose boot loader runs whenever DTR rises.
#[test]
fn a_board_that_is_reset_by_its_port_is_reported_unhomed_and_is_reset_only_once() {
    let plan = Plan {
        controller: &["--homing"],
        ros: &["-p", "axis_driver:dtr:=set", "-p", "axis_driver:rts:=clear"],
        resets_when_opened: true,
        cable: Cable::Terminal,
        ..Plan::default()
    };
    let cell = Cell::new(&plan);
    let locked = cell.commander.until_mode("ALARM");
    assert!(!locked.is_homed, "{locked:?}");
    let log = cell.machine.log();
    assert!(log.contains("restarted when its port was opened"), "{log}");
    assert!(log.contains("not homed"), "{log}");
    cell.refuses_to_run("ALARM");
    // Nothing has homed or unlocked it.
    assert_eq!(cell.wire.sent_since(0), "\\x18$I\\n$$\\n$G\\n$#\\n");
    assert!(!cell.wire.hangs_up(), "HUPCL is cleared");
    assert!(cell.commander.home().success);
    assert!(cell.until_ready().is_homed);
    // The next one who opens the port does not reset it.
    let moment = cell.moment();
    let openings = cell.wire.openings();
    kill_at_once(cell.machine.node("axis_driver"));
    cell.until_sent(moment, "$#\\n");
    assert!(cell.wire.openings() > openings);
    let is_idle = |state: &MachineState| state.state == MachineState::STATE_IDLE;
    let idle = cell.until_after(cell.moment(), "a new life", is_idle);
    // The driver's own reset has kept the place, but it has not seen the homing.
    assert!(!idle.is_homed, "{idle:?}");
    assert_eq!(cell.sent_since(moment), "\\x18$I\\n$$\\n$G\\n$#\\n");
    assert!(!cell.machine.log()[log.len()..].contains("restarted when its port was opened"));
}
