//! Others change the state of the nodes, in a run and without one: what the machine is
//! sent, and which node refuses what.

use super::cell::{Cell, Plan};
use super::machine::until;
use cnc_msgs::wire::cnc_msgs::action::RunProgramResult;
use cnc_msgs::wire::cnc_msgs::msg::MachineState;
use cnc_msgs::wire::cnc_msgs::srv::{LoadProgram, LoadProgramRequest, LoadProgramResponse};
use cnc_msgs::wire::diagnostic_msgs::msg::DiagnosticStatus;
use cnc_msgs::wire::lifecycle_msgs::msg::Transition;
use cnc_msgs::wire::lifecycle_msgs::srv::{ChangeState, ChangeStateRequest, GetState};
use runtime::Client;
use std::time::Duration;

/// A step may take as long as bringing a machine to a stop.
const STEP_WITHIN: Duration = Duration::from_secs(60);

/// The lifecycle of one node of the cell, from outside.
struct Manager<'a> {
    cell: &'a Cell,
    change: Client<ChangeState>,
    get: Client<GetState>,
}

impl<'a> Manager<'a> {
    fn of(cell: &'a Cell, node: &str) -> Self {
        let handle = cell.commander.node();
        // Endpoints need the executor.
        cell.commander.wait(async {
            let change = handle.client(&format!("{node}/change_state")).expect("a client");
            let get = handle.client(&format!("{node}/get_state")).expect("a client");
            Self { cell, change, get }
        })
    }

    /// Asks for a transition by its label, as `ros2 lifecycle set` may.
    fn set(&self, label: &str) -> bool {
        let transition = Transition { id: 0, label: label.into() };
        let call = self.change.call_within(ChangeStateRequest { transition }, STEP_WITHIN);
        self.cell.commander.wait(call).expect("an answer").success
    }

    fn state(&self) -> String {
        let call = self.get.call_within(Default::default(), STEP_WITHIN);
        self.cell.commander.wait(call).expect("an answer").current_state.label
    }
}

#[test]
fn deactivating_the_driver_in_a_run_holds_first_and_then_refuses() {
    let cell = Cell::new(&Plan::default());
    let driver = Manager::of(&cell, "axis_driver");
    assert_eq!(driver.state(), "active");
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    assert!(driver.set("deactivate"));
    // It is answered when the machine is at rest and the goal has ended.
    assert_eq!(driver.state(), "inactive");
    let sent = cell.sent_since(moment);
    let after_hold = cell.sent_after_hold(moment);
    let reset = after_hold.find("\\x18").unwrap_or_else(|| panic!("no reset in {sent:?}"));
    assert!(!after_hold[..reset].contains(['X', 'Y', '~']), "no line after the hold: {sent:?}");
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_ABORTED, "{result:?}");
    assert_eq!(result.error_code, RunProgramResult::NOT_ACTIVE, "{result:?}");
    assert!(result.message.contains("the driver was deactivated"), "{result:?}");
    cell.is_at_line(result.last_line);

    // State and telemetry flow on, and say so.
    let stands = cell.commander.until("a machine at rest", |state| {
        state.state == MachineState::STATE_IDLE && state.reason.starts_with("INACTIVE")
    });
    assert!(stands.position_known, "{stands:?}");
    cell.commander.until_part_health("lifecycle", DiagnosticStatus::WARN, "inactive");
    let inactive = cell.moment();
    cell.refuses_to_run("axis_driver is inactive");
    let why = cell.commander.press("resume").expect_err("nothing moves");
    assert!(why.contains("not active"), "{why}");
    assert!(!driver.set("deactivate"), "it is inactive already");
    assert_eq!(cell.sent_since(inactive), "", "an inactive driver only asks");
    cell.commander.press("feed_hold").expect("a hold is written in every state with a port");
    cell.until_sent(inactive, "!");
    cell.commander.press("soft_reset").expect("so is a reset");

    assert!(driver.set("activate"));
    cell.runs_again();
}

#[test]
fn a_driver_that_is_cleaned_up_lets_go_of_its_port_and_takes_it_again() {
    let cell = Cell::new(&Plan::default());
    let driver = Manager::of(&cell, "axis_driver");
    assert!(!driver.set("cleanup"), "an active driver is deactivated first");
    assert!(driver.set("deactivate") && driver.set("cleanup"));
    assert_eq!(driver.state(), "unconfigured");
    let closed = cell.commander.until_mode("DISCONNECTED");
    assert!(closed.reason.contains("closed as asked"), "{closed:?}");
    let why = cell.commander.press("feed_hold").expect_err("there is no port");
    assert!(why.contains("closed as asked"), "{why}");
    cell.refuses_to_run("axis_driver is unconfigured");
    let moment = cell.moment();
    assert!(driver.set("configure"));
    // It answers when the controller has identified itself.
    assert!(cell.sent_since(moment).contains("$I\\n$$\\n"), "{}", cell.sent_since(moment));
    assert_eq!(driver.state(), "inactive");
    assert!(driver.set("activate"));
    cell.runs_again();
}

#[test]
fn a_driver_that_is_shut_down_stops_the_machine_and_stays_away() {
    let cell = Cell::new(&Plan::default());
    let driver = Manager::of(&cell, "axis_driver");
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    assert!(driver.set("shutdown"));
    let result = cell.result(run);
    assert_eq!(result.error_code, RunProgramResult::SHUTDOWN, "{result:?}");
    assert!(cell.sent_after_hold(moment).contains("\\x18"), "{}", cell.sent_since(moment));
    let words = "axis_driver was shut down and is not restarted";
    until(words, || cell.machine.log().contains(words).then_some(()));
}

#[test]
fn a_loader_and_a_planner_that_are_inactive_say_so() {
    let cell = Cell::new(&Plan::default());
    let loader = Manager::of(&cell, "program_loader");
    let load = cell.commander.wait(async {
        cell.commander.node().client::<LoadProgram>("load_program").expect("a client")
    });
    let loads = || -> LoadProgramResponse {
        let request =
            LoadProgramRequest { text: "G21\nM30\n".into(), ..LoadProgramRequest::default() };
        cell.commander.wait(load.call_within(request, STEP_WITHIN)).expect("an answer")
    };
    assert!(loader.set("deactivate"));
    let refused = loads();
    assert_eq!(refused.error_code, LoadProgramResponse::NOT_ACTIVE, "{refused:?}");
    assert!(refused.message.contains("program_loader is inactive"), "{refused:?}");
    assert!(loader.set("activate"));

    let planner = Manager::of(&cell, "compensation_planner");
    assert!(planner.set("deactivate"));
    assert!(loads().success);
    // What is loaded is not planned, so it is not run.
    cell.refuses_to_run("loaded and planned");
    assert!(planner.set("activate"));
    cell.machine.folder.file("short.ngc", "G21 G90\nG1 X-99 F1200\nM30\n");
    cell.machine.kerf(&["run", "short.ngc"]).expect(0);
}

#[test]
fn a_recorder_that_is_inactive_records_nothing_and_a_driver_that_needs_it_refuses() {
    let ros = ["-p", "axis_driver:require_recording:=true"];
    let cell = Cell::new(&Plan { ros: &ros, ..Plan::default() });
    let recorder = Manager::of(&cell, "run_recorder");
    assert!(recorder.set("deactivate"));
    let run = cell.commander.run().expect("it is taken, and waits for its record");
    let result = cell.result(run);
    assert_eq!(result.error_code, RunProgramResult::NOT_RECORDING, "{result:?}");
    assert!(result.message.contains("run_recorder is inactive"), "{result:?}");
    assert!(recorder.set("activate"));
    cell.runs_again();
}
