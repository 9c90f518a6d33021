//! Peers that hang or are killed in the midst of a run.

use super::commander::Commander;
use super::machine::{Machine, until};
use super::stranger::{Stranger, resident_mb};
use super::support::TIMEOUT;
use cnc_msgs::wire::cnc_msgs::action::RunProgramResult;
use cnc_msgs::wire::cnc_msgs::msg::{Command as Asked, ControllerTraffic, MachineState};
use cnc_msgs::wire::rcl_interfaces::srv::{ListParameters, ListParametersRequest};
use cnc_msgs::wire::sensor_msgs::msg::JointState;
use runtime::Qos;
use rustix::process::{Pid, Signal, kill_process};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const ROLE: &str = "KERF_TEST_LISTENS";
/// Memory of the driver that a run may leave in use, MB, even if a peer does not acknowledge.
const LEFT_MB: f64 = 64.0;

/// A process that listens to all that the driver says, and asks it.
struct Listener(Child);

impl Listener {
    fn start(machine: &Machine, test: &str) -> Self {
        let process = Command::new(std::env::current_exe().expect("this program"))
            .args([test, "--exact", "--nocapture"])
            .env(ROLE, format!("{} {}", machine.domain, machine.namespace))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn();
        Self(process.expect("a listener"))
    }

    fn pid(&self) -> Pid {
        Pid::from_child(&self.0)
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// What such a process does; never ends in one.
fn listen_if_told_to() {
    let Ok(role) = std::env::var(ROLE) else { return };
    let (domain, namespace) = role.split_once(' ').expect("two words");
    let listener = Stranger::join_as("listener", domain, namespace);
    let client = listener.inside(|node| {
        macro_rules! subscribe {
            ($($kind:ty: $topic:literal),*) => {
                $({
                    let mut messages =
                        node.subscription::<$kind>($topic, Qos::EVENTS).expect($topic);
                    node.spawn($topic, async move {
                        loop {
                            messages.next().await;
                        }
                    });
                })*
            };
        }
        subscribe!(
            MachineState: "machine_state",
            ControllerTraffic: "controller_traffic",
            JointState: "joint_states",
            Asked: "command_log"
        );
        node.client::<ListParameters>("axis_driver/list_parameters").expect("a client")
    });
    loop {
        drop(listener.wait(client.call(ListParametersRequest::default())));
        // What it does is to listen; the processors are for others.
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Twenty moves of 100 mm at 20 mm/s: 100 s of machine time.
fn program() -> String {
    let moves: String = (0..10).map(|_| "G1 X110\nG1 X10\n").collect();
    format!("G21 G90 G94 G17\nG0 X10 Y10\nF1200\n{moves}M30\n")
}

fn a_run_survives(test: &str, fate: Signal) {
    listen_if_told_to();
    let machine = Machine::virtual_one(5);
    let commander = Commander::join(&machine);
    let listener = Listener::start(&machine, test);
    commander.until("a state", |state| state.position_known);
    machine.folder.file("long.ngc", program());
    machine.kerf(&["load", "long.ngc"]).expect(0);
    let run = commander.run().expect("the driver takes the run");
    commander.until("the midst of the run", |state| state.state == MachineState::STATE_RUN);
    // It has been listening for some time.
    std::thread::sleep(Duration::from_secs(1));

    // The ROS side of the driver.
    let driver = machine.face().expect("a ROS side");
    let before = resident_mb(driver);
    let recorder = machine.node("run_recorder");
    for pid in [listener.pid(), recorder] {
        kill_process(pid, fate).expect("it is there");
    }
    let mark = commander.mark();
    // Other peers get the state, and answers.
    for _ in 0..3 {
        commander.press("feed_hold").expect("the machine runs");
        commander.until("a hold", |state| state.state == MachineState::STATE_HOLD);
        commander.press("resume").expect("the machine is held");
        commander.until("the run to continue", |state| state.state == MachineState::STATE_RUN);
    }
    let client = commander
        .wait(async { commander.node().client::<ListParameters>("axis_driver/list_parameters") })
        .expect("a client");
    let begin = Instant::now();
    while !run.is_over() {
        let answer = commander.wait(client.call(ListParametersRequest::default()));
        assert!(answer.is_ok(), "{answer:?}");
        std::thread::sleep(Duration::from_millis(20));
        assert!(begin.elapsed() < 2 * TIMEOUT, "the run does not end: {:?}", commander.state());
    }
    let result = commander.result(run).expect("a result");
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_SUCCEEDED, "{result:?}");
    // Five a second are promised; a busy host may miss some.
    let seconds = begin.elapsed().as_secs_f64();
    let states = commander.states_since(mark).len() as f64;
    assert!(states > seconds, "{states} states in {seconds} s");
    let grown = resident_mb(driver) - before;
    assert!(grown < LEFT_MB, "the driver holds {grown} MB more");
    drop(client);
    // A recorder that hangs is killed by its supervisor, and either is started again.
    until("the recorder again", || machine.log().contains("run_recorder ended").then_some(()));
    assert_eq!(machine.face(), Some(driver), "the driver is the same all the time");
    machine.kerf(&["status"]).expect(0).says(&["IDLE"]);
}

#[test]
fn a_run_continues_while_a_listener_and_the_recorder_hang() {
    let test = "hanging::a_run_continues_while_a_listener_and_the_recorder_hang";
    a_run_survives(test, Signal::STOP);
}

#[test]
fn a_run_continues_when_a_listener_and_the_recorder_are_killed() {
    let test = "hanging::a_run_continues_when_a_listener_and_the_recorder_are_killed";
    a_run_survives(test, Signal::KILL);
}
