//! A whole machine of real processes, for one test, that leaves no processes or files.

use super::support::{Folder, Ran, TIMEOUT, TOOLS, kerf, number, run};
use cnc_msgs::cdr;
use cnc_msgs::interface::Message;
use cnc_msgs::wire::cnc_msgs::msg::{ControllerTraffic, TrafficEntry};
use run_recorder::files::open_bag;
use rustix::process::{Pid, Signal, kill_process, kill_process_group};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Machines that live at the same time: two cores carry no more.
const MACHINES_MAX: u32 = 2;
static RUNNING: Mutex<u32> = Mutex::new(0);
static LEFT: Condvar = Condvar::new();

/// Asks so seldom that a controller on a busy host is not taken for silent: three questions
/// without an answer are.
pub(crate) const SLOW_POLLING: [&str; 2] = ["-p", "axis_driver:poll_interval_ms:=500"];

/// The right to run a machine.
#[derive(Debug)]
pub(crate) struct Turn;

impl Turn {
    pub(crate) fn wait() -> Self {
        let running = RUNNING.lock().unwrap_or_else(PoisonError::into_inner);
        let mut running = LEFT
            .wait_while(running, |running| *running >= MACHINES_MAX)
            .unwrap_or_else(PoisonError::into_inner);
        *running += 1;
        Self
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        *RUNNING.lock().unwrap_or_else(PoisonError::into_inner) -= 1;
        LEFT.notify_one();
    }
}

/// A domain that no other test of this process has, and hardly one of another.
pub(crate) fn domain() -> String {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    (40 + (std::process::id() * 11 + number) % 56).to_string()
}

/// Waits until something holds.
///
/// # Panics
/// It does not within [`TIMEOUT`].
#[track_caller]
pub(crate) fn until<T>(what: &str, mut probe: impl FnMut() -> Option<T>) -> T {
    let end = Instant::now() + TIMEOUT;
    loop {
        if let Some(found) = probe() {
            return found;
        }
        assert!(Instant::now() < end, "{what}: not within {} s", TIMEOUT.as_secs());
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Every process whose command line holds one of these words.
pub(crate) fn processes(marks: &[String]) -> Vec<(Pid, String)> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir("/proc").expect("/proc is there").flatten() {
        let name = entry.file_name();
        let id = name.to_str().and_then(|name| name.parse().ok()).and_then(Pid::from_raw);
        let Some(id) = id else { continue };
        let Ok(line) = std::fs::read(entry.path().join("cmdline")) else { continue };
        let line = String::from_utf8_lossy(&line).replace('\0', " ");
        if line.contains(" node ") && marks.iter().any(|mark| line.contains(mark.as_str())) {
            found.push((id, line));
        }
    }
    found
}

/// `kerf up` in a namespace and a folder of its own.
#[derive(Debug)]
pub(crate) struct Machine {
    up: Child,
    pub(crate) namespace: String,
    pub(crate) domain: String,
    pub(crate) folder: Folder,
    _turn: Option<Turn>,
}

impl Machine {
    /// A machine with the virtual controller, so many times faster than a real one.
    pub(crate) fn virtual_one(time_factor: u32) -> Self {
        Self::virtual_with(time_factor, &SLOW_POLLING)
    }

    /// The same with arguments for its nodes.
    pub(crate) fn virtual_with(time_factor: u32, ros_args: &[&str]) -> Self {
        let time_factor = time_factor.to_string();
        let turn = Turn::wait();
        let args = ["--virtual-controller", "--time-factor", &time_factor];
        let machine = Self::start(&domain(), "mill", &args, ros_args, Some(turn));
        machine.until_state("IDLE");
        machine
    }

    /// A machine with arguments of its own.
    pub(crate) fn start(
        domain: &str,
        name: &str,
        args: &[&str],
        ros_args: &[&str],
        turn: Option<Turn>,
    ) -> Self {
        Self::start_as(domain, name, args, ros_args, turn, |command, _| command)
    }

    /// The same; `surround` changes how it is started, knowing its folder.
    pub(crate) fn start_as(
        domain: &str,
        name: &str,
        args: &[&str],
        ros_args: &[&str],
        turn: Option<Turn>,
        surround: impl FnOnce(Command, &Path) -> Command,
    ) -> Self {
        let folder = Folder::new();
        // Words that no other process on this host has in its command line.
        let namespace = format!("/{name}_{}_{domain}", std::process::id());
        let log = std::fs::File::create(folder.path().join("up.log")).expect("a log");
        let mut command = kerf();
        command
            .env("ROS_DOMAIN_ID", domain)
            .current_dir(folder.path())
            .arg("up")
            .args(args)
            .args(["--ros-args", "-r", &format!("__ns:={namespace}")])
            .args(["-p", "run_recorder:directory:=bags"])
            .args(["-p", &format!("compensation_planner:tool_table:={}", TOOLS)])
            .args(ros_args);
        let mut command = surround(command, folder.path());
        // As a shell does it: Ctrl-C goes to the group.
        command.process_group(0).stdout(log.try_clone().expect("a second handle")).stderr(log);
        let up = command.spawn().expect("kerf up can be started");
        Self { up, namespace, domain: domain.to_owned(), folder, _turn: turn }
    }

    pub(crate) fn command(&self, args: &[&str]) -> Command {
        let mut command = kerf();
        command
            .env("ROS_DOMAIN_ID", &self.domain)
            .current_dir(self.folder.path())
            .args(args)
            .args(["--ros-args", "-r", &format!("__ns:={}", self.namespace)]);
        command
    }

    /// Runs `kerf` for this machine.
    #[track_caller]
    pub(crate) fn kerf(&self, args: &[&str]) -> Ran {
        run(&mut self.command(args))
    }

    /// The same, in the background.
    pub(crate) fn kerf_meanwhile(&self, args: &[&str]) -> JoinHandle<Ran> {
        let mut command = self.command(args);
        std::thread::spawn(move || run(&mut command))
    }

    /// Waits until `kerf status` begins with this word, and returns what it says.
    #[track_caller]
    pub(crate) fn until_state(&self, state: &str) -> String {
        let mut last = String::new();
        let end = Instant::now() + TIMEOUT;
        while Instant::now() < end {
            let ran = self.kerf(&["status"]);
            last = format!("{}{}", ran.out, ran.err);
            if ran.status == 0 && last.starts_with(state) {
                return last;
            }
        }
        panic!("not {state} but {last}; the log: {}", self.log());
    }

    /// What the nodes have said.
    pub(crate) fn log(&self) -> String {
        std::fs::read_to_string(self.folder.path().join("up.log")).unwrap_or_default()
    }

    /// The bags, oldest first.
    pub(crate) fn bags(&self) -> Vec<PathBuf> {
        let Ok(entries) = std::fs::read_dir(self.folder.path().join("bags")) else {
            return Vec::new();
        };
        let mut bags: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        bags.sort();
        bags
    }

    /// Waits until so many bags are closed.
    #[track_caller]
    pub(crate) fn until_bags(&self, count: usize) -> Vec<PathBuf> {
        until(&format!("{count} bags"), || {
            let bags = self.bags();
            let is_closed = |bag: &PathBuf| bag.join("metadata.yaml").exists();
            (bags.len() >= count && bags.iter().all(is_closed)).then_some(bags)
        })
    }

    /// Its nodes, controller included.
    pub(crate) fn nodes(&self) -> Vec<(Pid, String)> {
        let link = self.link().display().to_string();
        processes(&[format!("{} ", self.namespace), format!("{link} ")])
    }

    /// The process of one node.
    #[track_caller]
    pub(crate) fn node(&self, name: &str) -> Pid {
        self.nodes_named(name, false)[0]
    }

    /// The process of the driver's ROS side.
    pub(crate) fn face(&self) -> Option<Pid> {
        self.nodes_named("axis_driver", true).first().copied()
    }

    /// Looks for the face, also from another thread.
    pub(crate) fn face_finder(&self) -> impl Fn() -> Option<Pid> + Send + 'static {
        let mark = format!("{} ", self.namespace);
        move || {
            let faces = processes(std::slice::from_ref(&mark)).into_iter();
            let mut faces = faces.filter(|(_, line)| line.starts_with("axis_driver-ros "));
            faces.next().map(|(id, _)| id)
        }
    }

    fn nodes_named(&self, name: &str, is_face: bool) -> Vec<Pid> {
        let name = format!(" {name} ");
        let nodes = self.nodes().into_iter();
        let is_meant = |(_, line): &(Pid, String)| {
            line.contains(&name) && line.starts_with("axis_driver-ros ") == is_face
        };
        nodes.filter(is_meant).map(|(id, _)| id).collect()
    }

    /// Where `kerf up` puts the port of the virtual controller.
    pub(crate) fn link(&self) -> PathBuf {
        std::env::temp_dir().join(format!("kerf-{}-controller", self.up.id()))
    }

    fn pid(&self) -> Pid {
        Pid::from_child(&self.up)
    }

    /// Ctrl-C in the terminal of `kerf up`; returns its exit status.
    #[track_caller]
    pub(crate) fn interrupt(&mut self) -> i32 {
        kill_process_group(self.pid(), Signal::INT).expect("kerf up is there");
        let status = until("the end of kerf up", || self.up.try_wait().expect("our child"));
        number(status)
    }

    /// `kill -9` of `kerf up` alone.
    pub(crate) fn kill(&mut self) {
        self.up.kill().expect("our child");
        self.up.wait().expect("our child");
    }

    /// Waits until no process and no link is left.
    #[track_caller]
    pub(crate) fn until_gone(&self) {
        until("the end of all nodes", || self.nodes().is_empty().then_some(()));
        assert!(self.link().symlink_metadata().is_err(), "{} is left", self.link().display());
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        let _ = self.up.kill();
        let _ = self.up.wait();
        for (id, _) in self.nodes() {
            // It may be exiting already.
            let _ = kill_process(id, Signal::KILL);
        }
        let _ = std::fs::remove_file(self.link());
        #[allow(clippy::print_stderr, reason = "why a test failed is in the log")]
        if std::thread::panicking() {
            eprintln!("the log of {}:\n{}", self.namespace, self.log());
        }
    }
}

/// Kills a process at once.
pub(crate) fn kill_at_once(id: Pid) {
    kill_process(id, Signal::KILL).expect("the process is there");
}

/// All messages of a type in a bag, in order.
pub(crate) fn messages<M: Message>(bag: &Path) -> Vec<M> {
    let mut bag = open_bag(bag).expect("a bag");
    let messages = bag.messages().map(|message| message.expect("a message"));
    let of_type = messages.filter(|message| message.channel.type_name() == M::TYPE_NAME);
    of_type.map(|message| cdr::decode(&message.data).expect("a message of ours")).collect()
}

/// The bytes that a bag says were sent to the controller, in order.
pub(crate) fn transmitted(bag: &Path) -> Vec<Vec<u8>> {
    let mut entries = std::collections::BTreeMap::new();
    for traffic in messages::<ControllerTraffic>(bag) {
        entries.extend(traffic.entries.into_iter().map(|entry| (entry.sequence, entry)));
    }
    let entries = entries.into_values();
    entries
        .filter(|entry| entry.kind == TrafficEntry::KIND_TRANSMITTED)
        .map(|entry| entry.data)
        .collect()
}
