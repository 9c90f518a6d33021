//! The nodes as child processes: started, watched, stopped in order.
//!
//! Each child is this same binary as `kerf node NAME`. A child that ends or falls silent is
//! started again by [`Stack::supervise`], with growing pauses and without an end; it never takes
//! the others with it. One that was asked to stop, by its lifecycle or by a signal, stays away.
//! Children leave by themselves when this process dies: their standard input
//! is a pipe that nobody else holds.

use runtime::supervision::{Change, Limits, Watched, wake_with_parent};
use rustix::process::{Pid, Signal, kill_process};
use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Command, ExitStatus, Stdio};
use std::time::Duration;
use tokio::time::{Instant, sleep};

/// How long a child may take to leave before it is killed: longer than the driver needs to bring
/// the machine to a stop, whatever its ROS face does.
const STOP_TIME_MAX: Duration = Duration::from_secs(40);
/// How often the children are looked at.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// The virtual controller is a board, not a node: it reports to nobody.
const SILENT_NODE: &str = "virtual_controller";

/// A child process that is watched.
#[derive(Debug)]
struct Node {
    name: &'static str,
    watched: Watched,
    /// It served once: what it was started with is right.
    was_ready: bool,
}

/// All children, in the order in which they are stopped.
#[derive(Debug)]
pub(crate) struct Stack {
    binary: PathBuf,
    nodes: Vec<Node>,
    isolation: Option<Isolation>,
}

/// What children have of their own that are to have nothing to do with anybody else.
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

    /// The same, for children that know these variables alone, and speak into a file.
    pub(crate) fn isolated(variables: BTreeMap<String, String>, log: File) -> io::Result<Self> {
        Ok(Self { isolation: Some(Isolation { variables, log }), ..Self::new()? })
    }

    /// Starts `kerf node NAME ARGS...`. What is started first is stopped first.
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
                // Nodes speak on standard error; standard output is this command's own.
                .stdout(Stdio::null())
                // Ctrl-C in a terminal goes to a whole group: here it is for this
                // command, which stops the nodes in their order.
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

    /// Starts children again as they end or fall silent.
    ///
    /// Ends, with the reason, when a child refuses its own arguments before it ever served: it
    /// would do so again. Ends without one when every child was asked to stop.
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
                        // It was told to stop, and not by a failure.
                        eprintln!("kerf: {name} was shut down and stays away");
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

    /// Asks every child to leave, one after the other, and kills what does not.
    ///
    /// Returns the children that had to be killed or left with an error.
    pub(crate) async fn stop(&mut self) -> Vec<String> {
        let mut troubles = Vec::new();
        for Node { name, watched, .. } in &mut self.nodes {
            // It may be about to be started again; then it is not.
            let Some(child) = watched.child() else { continue };
            let pid = Pid::from_child(child);
            // It may have left by itself in this very moment. One that is stopped hears nothing
            // before it goes on.
            let _ = kill_process(pid, Signal::TERM);
            let _ = kill_process(pid, Signal::CONT);
            let end = Instant::now() + STOP_TIME_MAX;
            let trouble = loop {
                match child.try_wait() {
                    Ok(Some(status)) if status.success() => break None,
                    Ok(Some(status)) => break Some(format!("{name} left with {status}")),
                    Err(error) => break Some(format!("{name}: {error}")),
                    Ok(None) if Instant::now() < end => sleep(LOOK_EVERY).await,
                    Ok(None) => {
                        let _ = child.kill();
                        break Some(format!(
                            "{name} did not leave within {} s and was killed",
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

/// What is put up with from a child.
fn limits(name: &str) -> Limits {
    match name {
        SILENT_NODE => {
            Limits { start_max: Duration::MAX, silence_max: Duration::MAX, ..Limits::default() }
        }
        _ => Limits::default(),
    }
}

/// Waits until a child has made a file.
pub(crate) async fn wait_for_file(path: &std::path::Path) -> Result<(), crate::exit::Failure> {
    for _ in 0..100 {
        if path.exists() {
            return Ok(());
        }
        sleep(Duration::from_millis(50)).await;
    }
    Err(crate::exit::Failure::usage(format_args!("{} was not made within 5 s", path.display())))
}

/// Removes the link of a controller that was killed before it could.
pub(crate) fn remove_dead_link(path: &std::path::Path) {
    if path.is_symlink() {
        // Nobody is left who would miss it.
        let _ = std::fs::remove_file(path);
    }
}

/// Lets this process leave, as on SIGTERM, when the one that started it dies.
///
/// Reads standard input, which the parent holds open, on a thread of its own.
pub(crate) fn leave_with_parent() -> io::Result<()> {
    // One that is stopped when its parent dies goes on, and finds the pipe closed.
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
