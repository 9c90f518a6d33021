//! Runs a controller on a pseudo-terminal or a network port until it is stopped: one thread, one poll.

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags, pidfd_open};

use super::listen::Listen;
use super::port::{Cable, Port};
use super::report;
use super::stop::Stop;
use crate::paced::{LineTiming, PacedLine};
use crate::{Build, Controller, Fault, FaultAction, FaultInjector};

/// Bytes in transit to the controller before the peer has to wait, as in a tty queue.
pub(super) const BACKLOG_BYTES_MAX: usize = 4096;
/// Bytes to a peer that does not read before further ones are lost, as on a real line.
pub(super) const UNREAD_BYTES_MAX: usize = 16 * 1024;

/// How long a bootloader waits before it starts the firmware.
const BOOTLOADER: Duration = Duration::from_millis(1500);

/// What to run.
#[derive(Debug, Clone)]
pub struct ServeOptions {
    /// The controller.
    pub build: Build,
    /// The line and the clock.
    pub timing: LineTiming,
    /// Faults.
    pub faults: Vec<Fault>,
    /// Seed of the random faults.
    pub seed: u64,
    /// A symbolic link to the slave, made at the start and removed at the end.
    pub link: Option<PathBuf>,
    /// Read fault actions from standard input, one a line, and stop when it is closed.
    pub watches_stdin: bool,
    /// Stop when this process ends.
    pub parent_pid: Option<i32>,
    /// Does the board reset when the port is opened, as Arduino boards do?
    pub resets_on_open: bool,
    /// A network port in place of a pseudo-terminal.
    pub listen: Option<Listen>,
    /// How long a session on that port outlives its client, as on boards that notice no lost one.
    pub keeps_session: Duration,
    /// Path of the JSON file with the counts, written at the end.
    pub report: Option<PathBuf>,
}

impl ServeOptions {
    /// A controller without faults at 115 200 Bd in real time.
    pub fn new(build: Build) -> Self {
        Self {
            build,
            timing: LineTiming::default(),
            faults: Vec::new(),
            seed: 1,
            link: None,
            watches_stdin: false,
            parent_pid: None,
            resets_on_open: false,
            listen: None,
            keeps_session: Duration::ZERO,
            report: None,
        }
    }
}

/// Why a controller could not be run.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// There is no pseudo-terminal.
    #[error("cannot open a pseudo-terminal (is /dev/pts mounted?): {0}")]
    Pty(#[source] io::Error),
    /// The link cannot be made.
    #[error("cannot make the link {path}: {source}")]
    Link {
        /// Path of the link.
        path: PathBuf,
        /// The error.
        source: io::Error,
    },
    /// The network port cannot be opened.
    #[error("cannot listen on {listen}: {source}; choose another port number")]
    Listen {
        /// Where.
        listen: Listen,
        /// The error.
        source: io::Error,
    },
    /// The process to watch cannot be watched.
    #[error("cannot watch process {pid}: {source}")]
    Parent {
        /// Its process id.
        pid: i32,
        /// The error.
        source: io::Error,
    },
    /// The report cannot be written.
    #[error("cannot write the report {path}: {source}")]
    Report {
        /// Path of the report.
        path: PathBuf,
        /// The error.
        source: io::Error,
    },
    /// The pseudo-terminal failed while it was in use.
    #[error("the pseudo-terminal failed: {0}")]
    Io(#[from] io::Error),
}

/// Runs a controller until `stop`, the watched process or standard input ends, or a `close` fault.
///
/// `ready` is called with the path of the slave whenever it can be opened: at the start, and each
/// time the board is back as another device after a `vanish` or `unplug` fault.
pub fn serve(
    options: ServeOptions,
    stop: &Stop,
    mut ready: impl FnMut(&Path) -> io::Result<()>,
) -> Result<(), ServeError> {
    if let Some(path) = &options.report {
        // Check now: a run of an hour must not fail at its end because the folder does not exist.
        report::check(path).map_err(|source| ServeError::Report { path: path.clone(), source })?;
    }
    let port = Port::open(match options.listen {
        None => Cable::Terminal { link: options.link, resets_on_open: options.resets_on_open },
        Some(listen) => Cable::Network {
            listen,
            keeps_session: options.keeps_session,
            greeting: options.build.settings.firmware().traits().greeting,
        },
    })?;
    let parent = options.parent_pid.map(watch).transpose()?;
    let controller = Controller::with_build(options.build);
    let injector = FaultInjector::new(controller, options.faults, options.seed);
    let line = PacedLine::new(injector, options.timing);
    port.path().map_or(Ok(()), |path| ready(&path))?;
    let mut server = Server {
        port,
        pulls: 0,
        line,
        unread: Vec::new(),
        typed: Vec::new(),
        started: Instant::now(),
        parent,
        watches_stdin: options.watches_stdin,
    };
    let outcome = server.run(stop, ready);
    if let Some(path) = options.report {
        let counts = server.line.device().controller().counts();
        report::write(&path, &counts)
            .map_err(|source| ServeError::Report { path: path.clone(), source })?;
    }
    outcome
}

fn watch(pid: i32) -> Result<OwnedFd, ServeError> {
    let failed = |source| ServeError::Parent { pid, source };
    let id = Pid::from_raw(pid)
        .filter(|_| pid > 0)
        .ok_or_else(|| failed(io::Error::from(io::ErrorKind::InvalidInput)))?;
    pidfd_open(id, PidfdFlags::empty()).map_err(|error| failed(error.into()))
}

struct Server {
    port: Port,
    /// How often the cable has been pulled so far.
    pulls: u64,
    line: PacedLine<FaultInjector>,
    /// Bytes that did not fit into the pseudo-terminal.
    unread: Vec<u8>,
    /// The line of standard input that is not complete yet.
    typed: Vec<u8>,
    started: Instant,
    parent: Option<OwnedFd>,
    watches_stdin: bool,
}

impl Server {
    fn run(
        &mut self,
        stop: &Stop,
        mut ready: impl FnMut(&Path) -> io::Result<()>,
    ) -> Result<(), ServeError> {
        let stdin = io::stdin();
        loop {
            let now = self.started.elapsed();
            self.line.advance(now);
            self.line.transmit(now, &mut self.unread);
            self.port.write(&mut self.unread, UNREAD_BYTES_MAX)?;
            if self.line.device().is_closed() {
                return Ok(());
            }
            self.follow_cable(&mut ready)?;
            if self.port.look()? {
                let device_now = self.line.device_time(now);
                self.line.device_mut().reset_board(device_now, BOOTLOADER);
            }

            let mut fds = vec![PollFd::from_borrowed_fd(stop.as_fd(), PollFlags::IN)];
            fds.extend(self.parent.as_ref().map(|fd| PollFd::new(fd, PollFlags::IN)));
            let stdin_at = fds.len();
            if self.watches_stdin {
                fds.push(PollFd::from_borrowed_fd(stdin.as_fd(), PollFlags::IN));
            }
            let reads = self.line.backlog() < BACKLOG_BYTES_MAX;
            let [peer, opens] = self.port.waits_for(reads, !self.unread.is_empty());
            let poll_fd = |(fd, events)| PollFd::from_borrowed_fd(fd, events);
            let (peer_at, has_peer) = (fds.len(), peer.is_some());
            fds.extend(peer.map(poll_fd));
            let opens_at = fds.len();
            fds.extend(opens.map(poll_fd));
            let timeout = self.line.next_event().map(|at| timespec(at.saturating_sub(now)));
            match poll(&mut fds, timeout.as_ref()) {
                Ok(_) | Err(rustix::io::Errno::INTR) => {}
                Err(error) => return Err(io::Error::from(error).into()),
            }
            let is_ready = |at: usize| fds.get(at).is_some_and(|fd| !fd.revents().is_empty());
            let is_over = (0..stdin_at).any(is_ready);
            // An opening of the port comes before the bytes that are sent through it.
            let has_bytes = has_peer && is_ready(peer_at) && !is_ready(opens_at);
            let has_typed = self.watches_stdin && is_ready(stdin_at);
            drop(fds);
            if is_over {
                return Ok(());
            }
            if has_bytes && reads {
                let bytes = self.port.read()?;
                self.line.receive(self.started.elapsed(), &bytes);
            }
            if has_typed && !self.take_typed(&stdin)? {
                return Ok(());
            }
        }
    }

    /// Hangs up when the cable is pulled; opens another device when it is plugged in again.
    fn follow_cable(
        &mut self,
        ready: &mut impl FnMut(&Path) -> io::Result<()>,
    ) -> Result<(), ServeError> {
        let pulls = self.line.device().pulls();
        if pulls != self.pulls {
            self.pulls = pulls;
            self.unread.clear();
            self.port.pull()?;
        }
        if self.line.device().is_plugged() && self.port.plug()? {
            self.port.path().map_or(Ok(()), |path| ready(&path))?;
        }
        Ok(())
    }

    /// Reads fault actions; returns `false` when standard input is closed.
    fn take_typed(&mut self, stdin: &io::Stdin) -> io::Result<bool> {
        let mut buffer = [0; 256];
        let count = match rustix::io::read(stdin, &mut buffer) {
            Ok(count) => count,
            Err(rustix::io::Errno::INTR | rustix::io::Errno::AGAIN) => return Ok(true),
            Err(error) => return Err(error.into()),
        };
        self.typed.extend_from_slice(&buffer[..count]);
        while let Some(end) = self.typed.iter().position(|byte| *byte == b'\n') {
            let line: Vec<u8> = self.typed.drain(..=end).collect();
            let text = String::from_utf8_lossy(&line);
            let now = self.started.elapsed();
            self.line.advance(now);
            let device_now = self.line.device_time(now);
            match text.trim().parse::<FaultAction>() {
                Ok(action) => self.line.device_mut().inject(device_now, action),
                Err(_) if text.trim().is_empty() => {}
                Err(error) => eprint(&error.to_string()),
            }
        }
        self.typed.truncate(buffer.len());
        Ok(count > 0)
    }
}

pub(super) fn timespec(duration: Duration) -> Timespec {
    // A day is long enough, and fits every type.
    let duration = duration.min(Duration::from_secs(86_400));
    Timespec { tv_sec: duration.as_secs() as i64, tv_nsec: i64::from(duration.subsec_nanos()) as _ }
}

pub(super) fn eprint(text: &str) {
    use io::Write;
    // A closed standard error is no reason to stop.
    let _ = writeln!(io::stderr(), "virtual_controller: {text}");
}
