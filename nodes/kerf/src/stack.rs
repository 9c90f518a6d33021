//! The nodes as child processes: started, watched, stopped in order.
//!
//! Each child is this same binary as `kerf node NAME`. A child that dies is
//! started again by [`Stack::supervise`]; it never takes the others with it. One that
//! was told to stop, by its lifecycle or by a signal, stays away.
//! Children leave by themselves when this process dies: their standard input
//! is a pipe that nobody else holds.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::PathBuf;
use std::process::{ExitStatus, Stdio};
use std::time::Duration;
use tokio::process::{Child, ChildStdin, Command};
use tokio::time::{Instant, sleep, timeout};

/// How long a child may take to leave before it is killed.
const STOP_TIME_MAX: Duration = Duration::from_secs(35);
/// A child that lived shorter than this is started again only after a pause.
const RESTART_PAUSE: Duration = Duration::from_secs(2);

/// A child process and how to start it again.
#[derive(Debug)]
struct Node {
    name: &'static str,
    args: Vec<String>,
    process: Child,
    /// The child leaves when this is closed; waiting for it would close it if it had it.
    _lifeline: ChildStdin,
    started: Instant,
}

/// All children, in the order in which they are stopped.
#[derive(Debug)]
pub(crate) struct Stack {
    binary: PathBuf,
    nodes: Vec<Node>,
    apart: Option<Apart>,
}

/// What children have of their own that are to have nothing to do with anybody else.
#[derive(Debug)]
struct Apart {
    variables: BTreeMap<String, String>,
    log: File,
}

impl Stack {
    /// No children yet.
    pub(crate) fn new() -> io::Result<Self> {
        Ok(Self { binary: std::env::current_exe()?, nodes: Vec::new(), apart: None })
    }

    /// The same, for children that know these variables alone, and speak into a file.
    pub(crate) fn apart(variables: BTreeMap<String, String>, log: File) -> io::Result<Self> {
        Ok(Self { apart: Some(Apart { variables, log }), ..Self::new()? })
    }

    /// Starts `kerf node NAME ARGS...`. What is started first is stopped first.
    pub(crate) fn start(&mut self, name: &'static str, args: &[String]) -> io::Result<()> {
        let node = self.spawn(name, args)?;
        self.nodes.push(node);
        Ok(())
    }

    fn spawn(&self, name: &'static str, args: &[String]) -> io::Result<Node> {
        let mut command = Command::new(&self.binary);
        if let Some(Apart { variables, log }) = &self.apart {
            command.env_clear().envs(variables).stderr(log.try_clone()?);
        }
        let mut process = command
            .args(["node", "--leave-with-parent", name])
            .args(args)
            .stdin(Stdio::piped())
            // Nodes speak on standard error; standard output is this command's own.
            .stdout(Stdio::null())
            // Ctrl-C in a terminal goes to a whole group: here it is for this
            // command, which stops the nodes in their order.
            .process_group(0)
            .kill_on_drop(true)
            .spawn()?;
        let lifeline = process.stdin.take().expect("standard input was asked for as a pipe");
        let started = Instant::now();
        Ok(Node { name, args: args.to_vec(), process, _lifeline: lifeline, started })
    }

    /// The first child that has ended, with its status.
    pub(crate) fn ended(&mut self) -> Option<(&'static str, ExitStatus)> {
        self.nodes.iter_mut().find_map(|node| {
            let status = node.process.try_wait().ok().flatten()?;
            Some((node.name, status))
        })
    }

    /// Starts children again as they die.
    ///
    /// Ends, with the reason, when a child refuses its own arguments (it would
    /// do so again), or cannot be started.
    pub(crate) async fn supervise(&mut self) -> String {
        loop {
            sleep(Duration::from_millis(200)).await;
            for index in 0..self.nodes.len() {
                let Ok(Some(status)) = self.nodes[index].process.try_wait() else { continue };
                let Node { name, ref args, started, .. } = self.nodes[index];
                if status.code() == Some(crate::exit::Status::Usage as i32) {
                    return format!("{name} cannot run as it was told to (see above)");
                }
                if status.success() {
                    // It was told to stop, and not by a failure.
                    eprintln!("kerf: {name} was shut down and stays away");
                    self.nodes.remove(index);
                    break;
                }
                eprintln!("kerf: {name} ended ({status}) and is started again");
                if started.elapsed() < RESTART_PAUSE {
                    sleep(RESTART_PAUSE).await;
                }
                match self.spawn(name, &args.clone()) {
                    Ok(node) => self.nodes[index] = node,
                    Err(error) => return format!("{name} cannot be started again: {error}"),
                }
            }
        }
    }

    /// Asks every child to leave, one after the other, and kills what does not.
    ///
    /// Returns the children that had to be killed or left with an error.
    pub(crate) async fn stop(&mut self) -> Vec<String> {
        let mut troubles = Vec::new();
        for node in &mut self.nodes {
            let id = node.process.id().and_then(|id| i32::try_from(id).ok());
            if let Some(pid) = id.and_then(rustix::process::Pid::from_raw) {
                // It may have left by itself in this very moment.
                let _ = rustix::process::kill_process(pid, rustix::process::Signal::TERM);
            }
            match timeout(STOP_TIME_MAX, node.process.wait()).await {
                Ok(Ok(status)) if status.success() => {}
                Ok(Ok(status)) => troubles.push(format!("{} left with {status}", node.name)),
                Ok(Err(error)) => troubles.push(format!("{}: {error}", node.name)),
                Err(_) => {
                    let _ = node.process.kill().await;
                    troubles.push(format!(
                        "{} did not leave within {} s and was killed",
                        node.name,
                        STOP_TIME_MAX.as_secs()
                    ));
                }
            }
        }
        self.nodes.clear();
        troubles
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
    std::thread::Builder::new().name("parent-watch".into()).spawn(|| {
        let mut sink = io::sink();
        let _ = io::copy(&mut io::stdin(), &mut sink);
        let _ =
            rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::TERM);
    })?;
    Ok(())
}
