//! Loader, planner and recorder die in a run: the driver has what it needs.

use super::cable::Cable;
use super::cell::{Cell, Plan, Serpentine};
use super::machine::{kill_at_once, until};
use cnc_msgs::wire::cnc_msgs::action::RunProgramResult;
use cnc_msgs::wire::cnc_msgs::msg::MachineState;

fn nodes_die_in_a_run(cable: Cable) {
    let program = Serpentine { passes: 12, ..Serpentine::SHORT_LINES };
    let cell = Cell::new(&Plan { program, cable, ..Plan::default() });
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    let nodes = ["program_loader", "compensation_planner", "run_recorder"];
    for name in nodes {
        kill_at_once(cell.machine.node(name));
    }
    let died = cell.commander.state();
    assert_eq!(died.state, MachineState::STATE_RUN, "{died:?}");
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_SUCCEEDED, "{result:?}");
    assert!(result.last_line > died.line, "{result:?}");
    assert_eq!(cell.place(), [-100.0, -88.0], "the end of the program");
    let sent = cell.sent_since(moment);
    assert!(!sent.contains(['!', '~']) && !sent.contains("\\x18"), "{sent}");
    assert_eq!(cell.modes_since(moment)[0], "RUN");
    for name in nodes {
        until(name, || cell.machine.log().contains(&format!("{name} ended")).then_some(()));
    }
    // The driver has the path still.
    cell.runs_again();
}

#[test]
fn a_run_continues_to_its_end_when_loader_planner_and_recorder_die() {
    for cable in Cable::BOTH {
        nodes_die_in_a_run(cable);
    }
}
