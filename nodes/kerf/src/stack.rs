//! Runs the nodes as child processes: starts, supervises and stops them in order.
//!
//! Each child is this same binary as `kerf node NAME`. [`Stack::supervise`] restarts a child that
//! ends or stops responding, with growing pauses and without a limit; the other children keep
//! running. A child that was shut down, by its lifecycle or by a signal, is not restarted. Children
//! exit by themselves when this process dies: their standard input is a pipe that only this process
//! holds.

use crate::exit::Failure;
use runtime::supervision::{Change, Limits, Watched, wake_with_parent};
use rustix::process::{Pid, Signal, kill_process};
use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::Duration;
use tokio::time::{Instant, sleep};

/// How long a child may take to exit before it is killed: longer than the driver needs to stop the
/// machine in any state of its ROS side.
const STOP_TIME_MAX: Duration = Duration::from_secs(40);
/// How often the children are checked.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// The virtual controller is a board, not a node: it sends no heartbeat.
const SILENT_NODE: &str = "virtual_controller";

/// A supervised child process.
#[derive(Debug)]
struct Node {
    name: &'static str,
    watched: Watched,
    /// Whether it has served once: then its arguments are valid.
    was_ready: bool,
}

/// All children, in the order in which they are stopped.
#[derive(Debug)]
pub(crate) struct Stack {
    binary: PathBuf,
    nodes: Vec<Node>,
    isolation: Option<Isolation>,
}

/// Environment and log of children that are isolated from other nodes.
#[derive(Debug)]
struct Isolation {
    variables: BTreeMap<String, String>,
    log: File,
}

impl Stack {
    /// No children yet.
    pub(crate) fn new() -> io::Result<Self> {
        Ok(Self { binary: std::env::current_exe()?, nodes: Vec::new(), isolation: None })
    }

    /// An empty stack for children that get only these variables, and write to a log file.
    pub(crate) fn isolated(variables: BTreeMap<String, String>, log: File) -> io::Result<Self> {
        Ok(Self { isolation: Some(Isolation { variables, log }), ..Self::new()? })
    }

    /// Starts `kerf node NAME ARGS...`. The first one started is the first one stopped.
    pub(crate) fn start(&mut self, name: &'static str, args: &[String]) -> io::Result<()> {
        let (binary, args) = (self.binary.clone(), args.to_vec());
        let isolation = match &self.isolation {
            Some(Isolation { variables, log }) => Some((variables.clone(), log.try_clone()?)),
            None => None,
        };
        let make = move || {
            let mut command = Command::new(&binary);
            if let Some((variables, log)) = &isolation {
                command.env_clear().envs(variables).stderr(log.try_clone()?);
            }
            command
                .args(["node", "--leave-with-parent", name])
                .args(&args)
                .stdin(Stdio::piped())
                // Nodes log to standard error; standard output belongs to this command.
                .stdout(Stdio::null())
                // Ctrl-C in a terminal goes to the whole process group. Only this command shall get
                // it; it stops the nodes in their order.
                .process_group(0);
            Ok(command)
        };
        let watched = Watched::start(limits(name), make)?;
        self.nodes.push(Node { name, watched, was_ready: false });
        Ok(())
    }

    /// The first child that has ended, with its status.
    pub(crate) fn ended(&mut self) -> Option<(&'static str, ExitStatus)> {
        self.nodes.iter_mut().find_map(|node| {
            let status = node.watched.child()?.try_wait().ok().flatten()?;
            Some((node.name, status))
        })
    }

    /// Waits until a child has made a file.
    ///
    /// # Errors
    /// A child has ended before; or there is no such file after 5 s.
    pub(crate) async fn wait_for_file(&mut self, path: &Path) -> Result<(), Failure> {
        for _ in 0..100 {
            if path.exists() {
                return Ok(());
            }
            if let Some((name, status)) = self.ended() {
                return Err(Failure::usage(format_args!("{name} ended with {status} (see above)")));
            }
            sleep(LOOK_EVERY).await;
        }
        Err(Failure::usage(format_args!("{} did not appear within 5 s", path.display())))
    }

    /// Restarts children that end or stop responding.
    ///
    /// Returns the reason when a child rejects its own arguments before it ever served: a restart
    /// would fail again. Returns `None` when every child was shut down.
    pub(crate) async fn supervise(&mut self) -> Option<String> {
        while !self.nodes.is_empty() {
            sleep(LOOK_EVERY).await;
            let mut left = None;
            for (index, Node { name, watched, was_ready }) in self.nodes.iter_mut().enumerate() {
                let Some(change) = watched.poll() else { continue };
                if let Change::Ended { status, .. } = &change {
                    if status.code() == Some(crate::exit::Status::Usage as i32) && !*was_ready {
                        let text = format!("{name} cannot run with these settings (see above)");
                        return Some(text);
                    }
                    if status.success() {
                        // It was shut down, and did not fail.
                        eprintln!("kerf: {name} was shut down and is not restarted");
                        left = Some(index);
                        break;
                    }
                }
                match change {
                    Change::Ready => *was_ready = true,
                    change => eprintln!("kerf: {name} {change}"),
                }
            }
            if let Some(index) = left {
                self.nodes.remove(index);
            }
        }
        None
    }

    /// Asks every child to exit, one after the other; kills those that do not.
    ///
    /// Returns the children that were killed or exited with an error.
    pub(crate) async fn stop(&mut self) -> Vec<String> {
        let mut troubles = Vec::new();
        for Node { name, watched, .. } in &mut self.nodes {
            // It may be waiting for its restart, which is cancelled now.
            let Some(child) = watched.child() else { continue };
            let pid = Pid::from_child(child);
            // It may have exited by itself at this moment. A stopped process (SIGSTOP) gets no
            // signal until it continues.
            let _ = kill_process(pid, Signal::TERM);
            let _ = kill_process(pid, Signal::CONT);
            let end = Instant::now() + STOP_TIME_MAX;
            let trouble = loop {
                match child.try_wait() {
                    Ok(Some(status)) if status.success() => break None,
                    Ok(Some(status)) => break Some(format!("{name} exited with {status}")),
                    Err(error) => break Some(format!("{name}: {error}")),
                    Ok(None) if Instant::now() < end => sleep(LOOK_EVERY).await,
                    Ok(None) => {
                        let _ = child.kill();
                        break Some(format!(
                            "{name} did not exit within {} s and was killed",
                            STOP_TIME_MAX.as_secs()
                        ));
                    }
                }
            };
            troubles.extend(trouble);
        }
        self.nodes.clear();
        troubles
    }
}

/// The limits of supervision for a child.
fn limits(name: &str) -> Limits {
    match name {
        SILENT_NODE => {
            Limits { start_max: Duration::MAX, silence_max: Duration::MAX, ..Limits::default() }
        }
        _ => Limits::default(),
    }
}

/// Removes the link of a controller that was killed before it could.
pub(crate) fn remove_dead_link(path: &std::path::Path) {
    if path.is_symlink() {
        // A failure here has no effect on anybody.
        let _ = std::fs::remove_file(path);
    }
}

/// Makes this process exit, as on SIGTERM, when its parent dies.
///
/// Reads standard input, which the parent holds open, on its own thread.
pub(crate) fn leave_with_parent() -> io::Result<()> {
    // A process that is stopped (SIGSTOP) when its parent dies finds the pipe closed later.
    wake_with_parent()?;
    std::thread::Builder::new().name("parent-watch".into()).spawn(|| {
        let mut sink = io::sink();
        let _ = io::copy(&mut io::stdin(), &mut sink);
        let _ =
            rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::TERM);
    })?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driver_that_brings_its_machine_to_a_stop_is_not_killed() {
        assert!(axis_driver::motion::ALL_ENDS_WITHIN + Duration::from_secs(1) < STOP_TIME_MAX);
    }
}
