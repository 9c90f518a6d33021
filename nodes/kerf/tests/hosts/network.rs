//! Network namespaces as hosts, joined by a cable.

use super::support::{TIMEOUT, kerf};
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// The interface of a host that leads out of it.
pub(crate) const PORT: &str = "port";
/// All that is reached through it.
pub(crate) const SUBNET: &str = "SUBNET";
/// The middleware that ROS 2 has without a word about it.
pub(crate) const RMW: &str = "rmw_fastrtps_cpp";

/// A network namespace that lives as long as a process of ours in it.
#[derive(Debug)]
pub(crate) struct Host {
    holder: Child,
    rmw: &'static str,
    /// The other host that its nodes know by address, without multicast.
    peer: Option<&'static str>,
}

/// Says why there is no proof; where there has to be one, that is a failure.
#[allow(clippy::print_stderr, reason = "why nothing was proved")]
fn unproved(why: &str) -> Option<Host> {
    assert!(std::env::var_os("KERF_MUST_PROVE").is_none(), "nothing is proved: {why}");
    eprintln!("nothing is proved: {why}");
    None
}

impl Host {
    /// A host without any connection; `None`, with a word, where the system refuses.
    pub(crate) fn new() -> Option<Self> {
        // Without IPv6, which sends by itself on each interface that comes up.
        let script = "echo 1 > /proc/sys/net/ipv6/conf/all/disable_ipv6 2>/dev/null; \
                      ip link set lo up && echo ready && exec sleep infinity";
        let holder = Command::new("unshare")
            .args(["--net", "sh", "-c", script])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn();
        let mut holder = match holder {
            Ok(holder) => holder,
            Err(error) => {
                return unproved(&format!("unshare cannot be run: {error}"));
            }
        };
        let mut said = String::new();
        let out = holder.stdout.take().expect("piped");
        BufReader::new(out).read_line(&mut said).expect("a pipe can be read");
        if said.trim() == "ready" {
            return Some(Self { holder, rmw: RMW, peer: None });
        }
        let ended = holder.wait_with_output().expect("it has ended");
        let why = String::from_utf8_lossy(&ended.stderr).into_owned();
        unproved(&format!("network namespaces are refused here: {}", why.trim()))
    }

    /// Its nodes speak to each other as this middleware does.
    pub(crate) fn speaking(mut self, rmw: &'static str) -> Self {
        self.rmw = rmw;
        self
    }

    /// Its nodes know this host and, but for it, keep to their own.
    pub(crate) fn knowing(mut self, peer: &'static str) -> Self {
        self.peer = Some(peer);
        self
    }

    /// Lets a command run on this host.
    pub(crate) fn on(&self, command: &Command) -> Command {
        let mut inside = Command::new("nsenter");
        inside.arg(format!("--net=/proc/{}/ns/net", self.holder.id())).arg("--");
        inside.arg(command.get_program()).args(command.get_args());
        for (name, value) in command.get_envs() {
            match value {
                Some(value) => inside.env(name, value),
                None => inside.env_remove(name),
            };
        }
        if let Some(folder) = command.get_current_dir() {
            inside.current_dir(folder);
        }
        inside.stdin(Stdio::null());
        inside
    }

    /// `kerf` on this host, with this discovery range and these arguments.
    pub(crate) fn kerf(&self, range: &str, args: &[&str]) -> Command {
        let mut command = kerf();
        command.env("ROS_AUTOMATIC_DISCOVERY_RANGE", range).args(args);
        if let Some(peer) = self.peer {
            command.env("ROS_AUTOMATIC_DISCOVERY_RANGE", "").env("ROS_STATIC_PEERS", peer);
        }
        if range == SUBNET {
            command.env("RMW_IMPLEMENTATION", self.rmw);
        }
        self.on(&command)
    }

    /// `ip` on this host.
    #[track_caller]
    pub(crate) fn ip(&self, args: &str) -> String {
        self.read("ip", &args.split(' ').collect::<Vec<_>>())
    }

    /// A file below /proc/net of this host.
    #[track_caller]
    pub(crate) fn proc_net(&self, name: &str) -> String {
        self.read("cat", &[&format!("/proc/net/{name}")])
    }

    #[track_caller]
    fn read(&self, program: &str, args: &[&str]) -> String {
        let mut command = Command::new(program);
        let output = self.on(command.args(args)).output().expect("it can be run");
        let why = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{program} {args:?}: {why}");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Packets that have left through [`PORT`].
    #[track_caller]
    pub(crate) fn packets_sent(&self) -> u64 {
        let devices = self.proc_net("dev");
        let line = devices.lines().find_map(|line| line.trim().strip_prefix("port:"));
        let columns: Vec<&str> = line.expect("the port").split_whitespace().collect();
        columns[9].parse().expect("the packets sent")
    }

    /// A cable between two hosts, 10.77.0.1 and 10.77.0.2.
    #[track_caller]
    pub(crate) fn connect(&self, other: &Self) {
        let far = other.holder.id();
        self.ip(&format!("link add {PORT} type veth peer name {PORT} netns {far}"));
        for (host, address) in [(self, "10.77.0.1/24"), (other, "10.77.0.2/24")] {
            host.ip(&format!("addr add {address} dev {PORT}"));
            host.ip(&format!("link set {PORT} up multicast on"));
        }
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        let _ = self.holder.kill();
        let _ = self.holder.wait();
    }
}

/// A process; gone with this value.
#[derive(Debug)]
pub(crate) struct Process(pub(crate) Child);

impl Process {
    /// Starts it with its log in a file.
    pub(crate) fn start(mut command: Command, log: &std::path::Path) -> Self {
        let log = std::fs::File::create(log).expect("a log");
        let second = log.try_clone().expect("a second handle");
        Self(command.stdout(log).stderr(second).spawn().expect("it can be started"))
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Waits until something holds.
#[track_caller]
pub(crate) fn until<T>(what: &str, mut probe: impl FnMut() -> Option<T>) -> T {
    let end = Instant::now() + TIMEOUT;
    loop {
        if let Some(found) = probe() {
            return found;
        }
        assert!(Instant::now() < end, "{what}: not within {} s", TIMEOUT.as_secs());
        std::thread::sleep(Duration::from_millis(100));
    }
}
