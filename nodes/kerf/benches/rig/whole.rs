//! A whole machine of real processes, and a node of this process that commands it.

use super::machine::{Machine, domain};
use super::support::kerf;
use cnc_msgs::wire::cnc_msgs::action::{RunProgram, RunProgramGoal};
use runtime::action::{ActionClient, GoalHandle};
use runtime::configuration::Configuration;
use runtime::{Handle, Session};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// How long a node may take to be found.
pub(crate) const READY_WITHIN: Duration = Duration::from_secs(60);

/// `kerf up` on a port, and a client.
pub(crate) struct Whole {
    executor: tokio::runtime::Runtime,
    session: Option<Session>,
    domain: String,
    pub(crate) machine: Machine,
}

impl Whole {
    /// Starts the nodes with the driver on this port, and waits until the machine is idle.
    pub(crate) fn start(name: &str, port: &Path) -> Self {
        let domain = domain();
        let port = format!("axis_driver:port:={}", port.display());
        let machine = Machine::start(&domain, name, &[], &["-p", &port], None);
        machine.until_state("IDLE");
        let executor = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .expect("threads");
        let words = ["--ros-args", "-r", &format!("__ns:={}", machine.namespace)].map(String::from);
        let variables = BTreeMap::from([("ROS_DOMAIN_ID".to_owned(), domain.clone())]);
        let configuration = Configuration::read("bench", Vec::new(), &words, &variables)
            .expect("a domain and a namespace");
        let inside = executor.enter();
        let session = Session::start(configuration).expect("a node of our own");
        drop(inside);
        Self { executor, session: Some(session), domain, machine }
    }

    /// The node of this process.
    pub(crate) fn node(&self) -> &Handle {
        self.session.as_ref().expect("it is taken at the end only").handle()
    }

    /// Runs a future here.
    pub(crate) fn wait<T>(&self, work: impl Future<Output = T>) -> T {
        self.executor.block_on(work)
    }

    /// Makes `kerf` or a program of this crate a node of this machine.
    pub(crate) fn command(&self, mut command: Command, args: &[&str]) -> Command {
        command
            .env("ROS_DOMAIN_ID", &self.domain)
            .current_dir(self.machine.folder.path())
            .args(args)
            .args(["--ros-args", "-r", &format!("__ns:={}", self.machine.namespace)]);
        command
    }

    /// Loads a program and waits for its plan.
    pub(crate) fn load(&self, program: &str) {
        let path = self.machine.folder.file("bench.ngc", program);
        let path = path.to_str().expect("a path of ours is UTF-8");
        let status = self.command(kerf(), &["load", path]).status().expect("kerf can be run");
        assert!(status.success(), "the program is refused: {}", self.machine.log());
    }

    /// Starts a run of it.
    pub(crate) fn run(&self) -> GoalHandle<RunProgram> {
        let inside = self.executor.enter();
        let client: ActionClient<RunProgram> =
            self.node().action_client("run_program").expect("a client");
        drop(inside);
        self.wait(async {
            assert!(client.wait_for_server(READY_WITHIN).await, "no server for run_program");
            client.send_goal(RunProgramGoal::default()).await.expect("the run is accepted")
        })
    }
}

impl Drop for Whole {
    fn drop(&mut self) {
        if let Some(session) = self.session.take() {
            self.executor.block_on(session.stop());
        }
    }
}

/// The end of the spiral after this many segments of this length, in thousandths of a millimetre:
/// circles of 40 mm about (-40, 0) that begin in the origin.
pub(crate) fn spiral(index: usize, length_mm: f64) -> [i64; 2] {
    let (sin, cos) = (index as f64 * length_mm / 40.0).sin_cos();
    [40.0 * cos - 40.0, 40.0 * sin].map(|mm| (mm * 1e3).round() as i64)
}

/// A program of this many short lines, as posted for a free-form surface.
pub(crate) fn spiral_program(lines: usize, length_mm: f64, feed_mm_per_min: f64) -> String {
    let mut text = format!("G21 G17 G90 G94 G40\nG0 X0 Y0\nG1 F{feed_mm_per_min:.0}\n");
    for index in 1..=lines {
        let [x, y] = spiral(index, length_mm).map(|point| point as f64 / 1e3);
        let _ = writeln!(text, "X{x:.3} Y{y:.3}");
    }
    text.push_str("M2\n");
    text
}
