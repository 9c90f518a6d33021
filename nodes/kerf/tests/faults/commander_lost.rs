//! The commander that began a run dies.

use super::cell::{Cell, Moment, Plan};
use super::commander::Commander;
use super::machine::{kill_at_once, until};
use cnc_msgs::wire::cnc_msgs::msg::MachineState;
use cnc_msgs::wire::diagnostic_msgs::msg::DiagnosticStatus;
use cnc_msgs::wire::std_msgs::msg::Header;
use runtime::Qos;
use rustix::process::Pid;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// Says to a process of this test program that it is the commander, and of what.
const ROLE: &str = "KERF_TEST_COMMANDS";

/// A process that begins a run, and beats if it is to; until it is killed.
struct Process(Child);

impl Process {
    fn start(cell: &Cell, test: &str, beats: bool) -> Self {
        let role = format!("{} {} {beats}", cell.machine.domain, cell.machine.namespace);
        let process = Command::new(std::env::current_exe().expect("this program"))
            .args([test, "--exact", "--nocapture"])
            .env(ROLE, role)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn();
        Self(process.expect("a commander"))
    }

    fn kill(&mut self) {
        kill_at_once(Pid::from_child(&self.0));
        self.0.wait().expect("our child");
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// What such a process does; never ends in one.
fn command_if_told_to() {
    let Ok(role) = std::env::var(ROLE) else { return };
    let mut words = role.split(' ');
    let mut word = || words.next().expect("three words");
    let (domain, namespace, beats) = (word(), word(), word() == "true");
    let commander = Commander::join_as("first_commander", domain, namespace);
    let beat = commander.node().publisher::<Header>("commander_heartbeat", Qos::DEFAULT);
    let beat = beat.expect("a publisher");
    let run = commander.run().expect("the driver takes the run");
    std::mem::forget(run);
    loop {
        if beats {
            // What the transport cannot take now it takes the next time.
            let _ = beat.publish(Header::default());
        }
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// A run whose commander has died in the midst of it.
fn orphan(test: &str, beats: bool, policy: &str) -> (Cell, Moment) {
    command_if_told_to();
    let policy = format!("axis_driver:on_commander_loss:={policy}");
    let cell = Cell::new(&Plan { ros: &["-p", &policy], ..Plan::default() });
    let mut first = Process::start(&cell, test, beats);
    cell.until_in_the_midst();
    let moment = cell.moment();
    first.kill();
    (cell, moment)
}

/// Waits until the run has gone on for longer than a commander is waited for.
#[track_caller]
fn goes_on(cell: &Cell, moment: Moment) {
    let line = cell.commander.state().line;
    // 80 lines a second.
    cell.commander.until("the run to continue", |state| state.line > line + 200);
    assert_eq!(cell.modes_since(moment), ["RUN"]);
    let sent = cell.sent_since(moment);
    assert!(!sent.contains(['!', '~']) && !sent.contains("\\x18"), "{sent}");
    cell.commander.cancel();
    cell.until_ready();
}

#[test]
fn a_run_whose_commander_dies_is_held_until_another_resumes_it() {
    let test = "commander_lost::a_run_whose_commander_dies_is_held_until_another_resumes_it";
    let (cell, moment) = orphan(test, true, "hold");
    let held = cell.commander.until_mode("HOLD");
    assert!(held.reason.contains("COMMANDER_LOST"), "{held:?}");
    cell.until_controller("Hold:0");
    cell.commander.until_health(DiagnosticStatus::WARN, "COMMANDER_LOST");
    let held = cell.commander.state();
    assert_eq!(held.state, MachineState::STATE_HOLD, "nothing resumes by itself: {held:?}");
    cell.is_at_line(held.line);
    assert_eq!(cell.sent_after_hold(moment), "");
    cell.refuses_to_run("running");
    cell.commander.press("resume").expect("another commander");
    let resumed = cell.commander.until_mode("RUN");
    assert!(resumed.reason.is_empty(), "{resumed:?}");
    goes_on(&cell, cell.moment());
    cell.runs_again();
}

#[test]
fn a_run_whose_commander_dies_is_ended_where_that_is_wanted() {
    let test = "commander_lost::a_run_whose_commander_dies_is_ended_where_that_is_wanted";
    let (cell, moment) = orphan(test, true, "hold_then_abort");
    let idle = cell.until_ready();
    assert!(cell.modes_since(moment).contains(&"HOLD"), "{:?}", cell.modes_since(moment));
    assert_eq!(cell.sent_after_hold(moment), "\\x18$G\\n$#\\n", "a reset and questions");
    cell.is_at_line(idle.line);
    cell.runs_again();
}

#[test]
fn a_run_whose_commander_dies_continues_if_configured() {
    let test = "commander_lost::a_run_whose_commander_dies_continues_if_configured";
    let (cell, moment) = orphan(test, true, "continue");
    until("the loss to be logged", || cell.machine.log().contains("COMMANDER_LOST").then_some(()));
    goes_on(&cell, moment);
}

#[test]
fn a_commander_that_has_ended_does_not_stop_the_run_of_its_successor() {
    let test = "commander_lost::a_commander_that_has_ended_does_not_stop_the_run_of_its_successor";
    let (cell, _) = orphan(test, true, "hold");
    cell.commander.cancel();
    cell.until_ready();
    let _run = cell.run_into_the_midst();
    goes_on(&cell, cell.moment());
    assert!(!cell.machine.log().contains("COMMANDER_LOST"));
}

#[test]
fn a_run_whose_commander_never_gave_a_sign_of_life_needs_none() {
    let test = "commander_lost::a_run_whose_commander_never_gave_a_sign_of_life_needs_none";
    let (cell, moment) = orphan(test, false, "hold");
    goes_on(&cell, moment);
    assert!(!cell.machine.log().contains("COMMANDER_LOST"));
}
