//! The ROS face of the driver dies, hangs or is stopped while the machine moves: the line is
//! served on, and the next face goes on where the last one was.

use super::cell::{Cell, Plan, Serpentine};
use super::machine::{kill_at_once, messages, until};
use cnc_msgs::wire::cnc_msgs::action::RunProgramResult;
use cnc_msgs::wire::cnc_msgs::msg::{MachineState, Recording};
use rustix::process::{Pid, Signal, kill_process};

/// What befalls a face.
#[derive(Debug, Clone, Copy)]
enum Blow {
    Killed,
    /// It is stopped, and nobody lets it go on.
    Stopped,
    /// It is stopped and goes on; its DDS layer may be deaf from then on.
    StoppedAndContinued,
    Aborts,
}

impl Blow {
    fn strike(self, face: Pid) {
        let send = |signal| kill_process(face, signal).expect("the face is there");
        match self {
            Self::Killed => kill_at_once(face),
            Self::Stopped => send(Signal::STOP),
            Self::StoppedAndContinued => {
                send(Signal::STOP);
                std::thread::sleep(std::time::Duration::from_millis(200));
                send(Signal::CONT);
            }
            Self::Aborts => send(Signal::ABORT),
        }
    }
}

/// Strikes the face in the midst of a run, and expects that nothing is lost.
fn check(blow: Blow) {
    let plan = Plan { time_factor: 1, program: Serpentine::LONG_LINES, ..Plan::default() };
    let cell = Cell::new(&plan);
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    let face = cell.machine.face().expect("a face");
    let driver = cell.machine.node("axis_driver");
    blow.strike(face);
    let next = until("another face", || cell.machine.face().filter(|next| *next != face));
    // A button finds the new face, and the machine obeys.
    cell.commander.press_again("feed_hold").expect("the driver holds");
    let held = cell.commander.until_mode("HOLD");
    assert!(!held.program_id.is_empty() && held.line > 0, "{held:?}");
    cell.commander.press("resume").expect("and goes on");
    cell.commander.until_mode("RUN");
    assert!(!cell.told_since(moment).contains("\\x18"), "{}", cell.told_since(moment));
    cell.commander.cancel();
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_CANCELED, "{result:?}");
    assert_eq!(cell.machine.node("axis_driver"), driver, "the motion process is the same");
    assert_eq!(cell.machine.face(), Some(next), "one other face was enough");
    let bag = cell.machine.until_bags(1).remove(0);
    let states = messages::<MachineState>(&bag);
    let last = states.last().expect("states were recorded");
    assert_eq!(last.state, MachineState::STATE_IDLE, "{last:?}");
    let is_whole = messages::<Recording>(&bag).iter().all(|told| told.complete);
    assert!(is_whole, "the record misses something");
    cell.machine.kerf(&["replay", &bag.display().to_string()]).expect(0);
    cell.runs_again();
}

#[test]
fn a_face_that_is_killed_in_a_run_is_replaced_and_the_goal_ends_under_its_id() {
    check(Blow::Killed);
}

#[test]
fn a_face_that_is_stopped_in_a_run_is_replaced_and_the_goal_ends_under_its_id() {
    check(Blow::Stopped);
}

#[test]
fn a_face_that_is_stopped_and_continued_is_replaced_if_it_is_deaf() {
    check(Blow::StoppedAndContinued);
}

#[test]
fn a_face_that_aborts_in_a_run_is_replaced_and_the_goal_ends_under_its_id() {
    check(Blow::Aborts);
}
