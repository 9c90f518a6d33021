//! The ROS side of the driver dies, hangs or is stopped while the machine moves: the line is
//! served, and the next face continues where the last one was. The motion process uses no
//! DDS, and can be stopped from its own computer without any.

use super::cable::Cable;
use super::cell::{Cell, Plan, Serpentine};
use super::machine::{kill_at_once, messages, until};
use super::support::TIMEOUT;
use cnc_msgs::interface::{Message, Service};
use cnc_msgs::wire::action_msgs::msg::GoalStatus;
use cnc_msgs::wire::cnc_msgs::action::RunProgramResult;
use cnc_msgs::wire::cnc_msgs::msg::{MachineState, Recording};
use cnc_msgs::wire::unique_identifier_msgs::msg::UUID;
use rustix::process::{Pid, Signal, kill_process};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// What befalls a face.
#[derive(Debug, Clone, Copy)]
enum Blow {
    Killed,
    /// It is stopped (SIGSTOP), and not continued.
    Stopped,
    /// It is stopped and continued; its DDS layer may not receive anything from then on.
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
                std::thread::sleep(Duration::from_millis(200));
                send(Signal::CONT);
            }
            Self::Aborts => send(Signal::ABORT),
        }
    }
}

/// Strikes the face in the midst of a run, and expects that nothing is lost.
fn check(blow: Blow, cable: Cable) {
    let plan = Plan { time_factor: 1, program: Serpentine::LONG_LINES, cable, ..Plan::default() };
    let cell = Cell::new(&plan);
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    let face = cell.machine.face().expect("a face");
    let driver = cell.machine.node("axis_driver");
    blow.strike(face);
    let next = match blow {
        // It hears as before.
        Blow::StoppedAndContinued => face,
        _ => until("another face", || cell.machine.face().filter(|next| *next != face)),
    };
    // A button finds the new face, and the machine obeys.
    cell.commander.press_again("feed_hold").expect("the driver holds");
    let held = cell.commander.until_mode("HOLD");
    assert!(!held.program_id.is_empty() && held.line > 0, "{held:?}");
    cell.until_controller("Hold:0");
    let resumed = until("a machine at rest", || cell.commander.press("resume").ok());
    assert!(resumed.contains("resume"), "{resumed}");
    cell.commander.until_mode("RUN");
    assert!(!cell.sent_since(moment).contains("\\x18"), "{}", cell.sent_since(moment));
    cell.commander.cancel();
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_CANCELED, "{result:?}");
    assert_eq!(cell.machine.node("axis_driver"), driver, "the motion process is the same");
    assert_eq!(cell.machine.face(), Some(next), "no other face came");
    let bag = cell.machine.until_bags(1).remove(0);
    let states = messages::<MachineState>(&bag);
    let last = states.last().expect("states were recorded");
    assert_eq!(last.state, MachineState::STATE_IDLE, "{last:?}");
    // A node does not hear itself, so that the recorder's own word on it is in the bag's metadata alone.
    assert!(messages::<Recording>(&bag).is_empty(), "the recorder hears itself");
    let bag = bag.display().to_string();
    cell.machine.kerf(&["bag", "info", &bag]).expect(0).says(&["complete:    yes"]);
    cell.machine.kerf(&["replay", &bag]).expect(0);
    cell.runs_again();
}

/// The descriptors of a process, as the system shows them.
fn descriptors(process: Pid) -> Vec<String> {
    let folder = format!("/proc/{}/fd", process.as_raw_nonzero());
    let entries = std::fs::read_dir(folder).expect("our process").flatten();
    let links = entries.filter_map(|entry| std::fs::read_link(entry.path()).ok());
    links.map(|link| link.to_string_lossy().into_owned()).collect()
}

/// The inodes of all network sockets of this host.
fn network_sockets() -> Vec<String> {
    ["udp", "udp6", "tcp", "tcp6", "raw", "raw6", "packet"]
        .iter()
        .filter_map(|protocol| std::fs::read_to_string(format!("/proc/self/net/{protocol}")).ok())
        .flat_map(|table| {
            let rows =
                table.lines().skip(1).map(|row| row.split_whitespace().nth(9).map(String::from));
            rows.flatten().map(|inode| format!("socket:[{inode}]")).collect::<Vec<_>>()
        })
        .collect()
}

#[test]
fn the_process_that_owns_the_line_has_no_socket_of_the_network_and_no_dds_thread() {
    let cell = Cell::new(&Plan { cable: Cable::Terminal, ..Plan::default() });
    let (motion, face) = (cell.machine.node("axis_driver"), cell.machine.face().expect("a face"));
    let network = network_sockets();
    let of =
        |process| descriptors(process).into_iter().filter(|link| network.contains(link)).count();
    assert_eq!(of(motion), 0, "the motion process");
    assert!(of(face) > 0, "the check can fail: the face uses DDS");
    let line = cell.wire.device().expect("the line");
    let has_line = |process| descriptors(process).contains(&line.display().to_string());
    assert!(has_line(motion) && !has_line(face), "only one of them has the line");
}

#[test]
fn a_machine_is_stopped_without_ros_on_its_own_computer() {
    let plan = Plan { time_factor: 1, program: Serpentine::LONG_LINES, ..Plan::default() };
    let cell = Cell::new(&plan);
    let run = cell.run_into_the_midst();
    // All of ROS on the side of the driver hangs: each face is stopped as soon as it is there.
    let faces = Stopper::begin(&cell);
    let (began, held) = (Instant::now(), cell.machine.kerf_meanwhile(&["hold"]));
    cell.until_controller("Hold:0");
    // With the start of the command, on a busy computer; ROS alone is given 2.5 s elsewhere.
    let standing = began.elapsed();
    assert!(standing < Duration::from_secs(2), "the machine was at rest after {standing:.2?}");
    let held = held.join().expect("it only runs a command").expect(0);
    assert!(held.err.contains("local socket"), "{}", held.err);
    let status = cell.machine.kerf(&["status"]).expect(0);
    assert!(status.out.starts_with("HOLD"), "{}", status.out);
    cell.machine.kerf(&["abort"]).expect(0);
    cell.until_controller("Idle");
    cell.machine.kerf(&["reset"]).expect(0);
    faces.end();
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_CANCELED, "{result:?}");
}

#[test]
fn a_motion_process_that_is_stopped_is_never_said_to_run() {
    let plan = Plan { time_factor: 1, program: Serpentine::LONG_LINES, ..Plan::default() };
    let cell = Cell::new(&plan);
    let run = cell.run_into_the_midst();
    let motion = cell.machine.node("axis_driver");
    kill_process(motion, Signal::STOP).expect("it is there");
    let unknown = cell.commander.until_mode("UNKNOWN");
    assert!(unknown.reason.starts_with("MOTION_LOST") && unknown.motion_possible, "{unknown:?}");
    assert!(!unknown.position_known, "{unknown:?}");
    kill_process(motion, Signal::CONT).expect("it is there");
    cell.commander.until("what is known again", |state| !state.reason.starts_with("MOTION_LOST"));
    cell.commander.cancel();
    drop(cell.commander.result(run));
}

/// The service for the result of a run, called as a client library does: once.
struct GetResult;

#[derive(Debug, Clone)]
struct GetResultRequest {
    goal_id: UUID,
}

#[derive(Debug, Clone)]
struct GetResultResponse {
    status: i8,
    result: RunProgramResult,
}

cnc_msgs::cdr_struct!(GetResultRequest { goal_id });
cnc_msgs::cdr_struct!(GetResultResponse { status, result });

impl Message for GetResultRequest {
    const TYPE_NAME: &'static str = "";
}

impl Message for GetResultResponse {
    const TYPE_NAME: &'static str = "";
}

impl Service for GetResult {
    type Request = GetResultRequest;
    type Response = GetResultResponse;
    const TYPE_NAME: &'static str = "cnc_msgs/action/RunProgram_GetResult";
}

#[test]
fn a_client_that_asked_for_the_result_once_is_answered_by_the_next_face() {
    let plan = Plan { time_factor: 1, program: Serpentine::LONG_LINES, ..Plan::default() };
    let cell = Cell::new(&plan);
    let node = cell.commander.node();
    let results =
        cell.commander.wait(async { node.client::<GetResult>("run_program/_action/get_result") });
    let results = results.expect("a client");
    let goal = cell.commander.begin_run().expect("the driver takes the run");
    let goal_id = UUID { uuid: goal.id().0 };
    cell.until_in_the_midst();
    let face = cell.machine.face().expect("a face");
    let (response, ()) = cell.commander.wait(async {
        let asked = results.call_within(GetResultRequest { goal_id }, 3 * TIMEOUT);
        let struck = async {
            // The face has received the request before it dies.
            tokio::time::sleep(Duration::from_secs(1)).await;
            kill_at_once(face);
            let other = || cell.machine.face().filter(|next| *next != face);
            while other().is_none() {
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
            assert!(goal.cancel().await.is_ok(), "the next face knows the goal");
        };
        tokio::join!(asked, struck)
    });
    let response = response.expect("an answer from a face that was never asked");
    assert_eq!(response.status, GoalStatus::STATUS_CANCELED);
    let outcome = response.result.outcome;
    assert_eq!(outcome, RunProgramResult::OUTCOME_CANCELED, "{:?}", response.result);
}

#[test]
fn a_state_from_before_a_face_is_not_stamped_as_if_it_were_new() {
    let cell = Cell::new(&Plan::default());
    cell.wire.mute(true);
    let silent = cell.commander.until_mode("UNKNOWN");
    assert!(silent.link_age > 0.0, "{silent:?}");
    let face = cell.machine.face().expect("a face");
    let (killed_at, moment) = (SystemTime::now(), cell.moment());
    kill_at_once(face);
    let states = until("states of the next face", || {
        let states = cell.commander.states_since(moment.states);
        (states.len() >= 5).then_some(states)
    });
    for state in states {
        let stamp = Duration::new(state.header.stamp.sec as u64, state.header.stamp.nanosec);
        assert!(UNIX_EPOCH + stamp <= killed_at, "the controller has said nothing: {state:?}");
    }
}

/// Stops each face of a driver as soon as it is there.
struct Stopper {
    is_over: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Stopper {
    fn begin(cell: &Cell) -> Self {
        let is_over = Arc::<AtomicBool>::default();
        let (over, find) = (Arc::clone(&is_over), cell.machine.face_finder());
        let thread = std::thread::spawn(move || {
            while !over.load(Ordering::Relaxed) {
                if let Some(face) = find() {
                    // It may be another by now.
                    let _ = kill_process(face, Signal::STOP);
                }
                std::thread::sleep(Duration::from_millis(20));
            }
        });
        Self { is_over, thread }
    }

    fn end(self) {
        self.is_over.store(true, Ordering::Relaxed);
        self.thread.join().expect("it only sends signals");
    }
}

#[test]
fn a_face_that_is_killed_in_a_run_is_replaced_and_the_goal_ends_under_its_id() {
    for cable in Cable::BOTH {
        check(Blow::Killed, cable);
    }
}

#[test]
fn a_face_that_is_stopped_in_a_run_is_replaced_and_the_goal_ends_under_its_id() {
    check(Blow::Stopped, Cable::wanted());
}

#[test]
fn a_face_that_is_stopped_and_continued_in_a_run_goes_on() {
    check(Blow::StoppedAndContinued, Cable::wanted());
}

#[test]
fn a_face_that_aborts_in_a_run_is_replaced_and_the_goal_ends_under_its_id() {
    check(Blow::Aborts, Cable::wanted());
}
