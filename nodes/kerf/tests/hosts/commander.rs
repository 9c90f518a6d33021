//! A commander on a host of its own: a process of this test program that runs what is loaded,
//! sends heartbeats, reports what it receives, and executes commands.

use super::network::{Host, Process, RMW, SUBNET, until};
use super::support::TIMEOUT;
use cnc_msgs::convert::mode_from_wire;
use cnc_msgs::wire::cnc_msgs::action::{RunProgram, RunProgramGoal};
use cnc_msgs::wire::cnc_msgs::msg::MachineState;
use cnc_msgs::wire::std_msgs::msg::Header;
use cnc_msgs::wire::std_srvs::srv::{Trigger, TriggerRequest};
use runtime::configuration::Configuration;
use runtime::{Handle, Qos, Session};
use std::io::{BufRead, BufReader, Write};
use std::process::{ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::Duration;

const ROLE: &str = "KERF_TEST_COMMANDS";

/// Such a process, and its output so far.
pub(crate) struct Commander {
    process: Process,
    orders: ChildStdin,
    output: Arc<Mutex<Vec<String>>>,
}

impl Commander {
    /// Starts it, and with it the run.
    pub(crate) fn start(host: &Host) -> Self {
        let mut command = Command::new(std::env::current_exe().expect("this program"));
        command.args(["commander::command_if_told_to", "--exact", "--nocapture"]).env(ROLE, "run");
        let mut inside = host.on(&command);
        inside.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut process = inside.spawn().expect("a commander");
        let orders = process.stdin.take().expect("piped");
        let out = BufReader::new(process.stdout.take().expect("piped"));
        let output = Arc::<Mutex<Vec<String>>>::default();
        let lines = Arc::clone(&output);
        std::thread::spawn(move || {
            for line in out.lines().map_while(Result::ok) {
                lines.lock().expect("no panic").push(line);
            }
        });
        Self { process: Process(process), orders, output }
    }

    pub(crate) fn output(&self) -> Vec<String> {
        self.output.lock().expect("no panic").clone()
    }

    /// Lets it press a button.
    pub(crate) fn press(&mut self, button: &str) {
        writeln!(self.orders, "{button}").expect("it lives");
    }

    /// Waits until it has printed this, after so many lines.
    #[track_caller]
    pub(crate) fn until_sent(&self, after: usize, words: &str) -> usize {
        until(&format!("{words:?} in {:?}", self.output()), || {
            let place = self.output().iter().skip(after).position(|line| line.contains(words));
            place.map(|place| after + place)
        })
    }

    pub(crate) fn is_alive(&mut self) -> bool {
        self.process.0.try_wait().expect("our child").is_none()
    }
}

#[test]
fn command_if_told_to() {
    if std::env::var(ROLE).is_err() {
        return;
    }
    let executor = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .expect("threads");
    executor.block_on(async {
        let variables = [("ROS_AUTOMATIC_DISCOVERY_RANGE", SUBNET), ("RMW_IMPLEMENTATION", RMW)];
        let variables = variables.map(|(name, value)| (name.to_owned(), value.to_owned()));
        let configuration =
            Configuration::read("commander", Vec::new(), &[], &variables.into()).expect("valid");
        let session = Session::start(configuration).expect("a node");
        command(session.handle()).await;
        session.stop().await;
    });
}

#[allow(clippy::print_stdout, reason = "what it receives")]
async fn command(node: &Handle) {
    let mut states =
        node.subscription::<MachineState>("machine_state", Qos::LATCHED).expect("states");
    node.spawn("states", async move {
        let mut last = String::new();
        loop {
            let (state, _) = states.next().await;
            let now = format!("state {} {}", mode_from_wire(state.state).name(), state.reason);
            if now != last {
                println!("{now}");
                last = now;
            }
        }
    });
    let beats = node.publisher::<Header>("commander_heartbeat", Qos::DEFAULT).expect("beats");
    node.spawn("beats", async move {
        loop {
            beats.publish(Header::default());
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    });
    let resume = node.client::<Trigger>("resume").expect("a client");
    let (orders, mut given) = tokio::sync::mpsc::channel::<String>(10);
    std::thread::spawn(move || {
        for order in std::io::stdin().lines().map_while(Result::ok) {
            if orders.blocking_send(order).is_err() {
                return;
            }
        }
    });
    node.spawn("orders", async move {
        while let Some(order) = given.recv().await {
            let answer = resume.call_within(TriggerRequest::default(), TIMEOUT).await;
            println!("{order}: {answer:?}");
        }
    });
    let runs = node.action_client::<RunProgram>("run_program").expect("a client");
    let goal = runs.send_goal(RunProgramGoal::default()).await.expect("a run");
    println!("the goal is accepted");
    let result = goal.result(3 * TIMEOUT).await;
    println!("result {result:?}");
}
