//! The ROS side as a child process: started, watched, started again.

use super::connection::{Pulse, serve};
use super::hub::Hub;
use crate::driver::Command as DriverCommand;
use rustix::process::{Pid, Signal, kill_process};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Says to this executable that it is the face, and that its standard input is the connection.
pub(crate) const FACE_VARIABLE: &str = "KERF_AXIS_DRIVER_FACE";
/// What the face is called in a list of processes.
const FACE_NAME: &str = "axis_driver-ros";
/// Ticks on time without a sign of life after which a face hangs: one second.
const SILENT_TICKS_MAX: u32 = 20;
/// The same while it starts: half a minute.
const STARTING_TICKS_MAX: u32 = 600;
/// Ticks within which a process ends that has closed its connection.
const ENDING_TICKS_MAX: u32 = 20;
/// The pause before a face is started again; doubled while they live shortly.
const PAUSE: Duration = Duration::from_millis(50);
const PAUSE_MAX: Duration = Duration::from_secs(5);
/// A face that lived for so long was in order.
const LIVED: Duration = Duration::from_secs(10);

/// Whether the driver is to end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ended {
    No,
    /// With this exit status.
    AsAsked(u8),
}

/// The face, whichever process it is.
#[derive(Debug)]
pub(super) struct Face {
    words: Vec<String>,
    running: Option<Running>,
    start_at: Instant,
    pause: Duration,
    /// A face has been at work since this process began.
    was_ready: bool,
    /// The driver knows that there is none.
    is_missed: bool,
}

#[derive(Debug)]
struct Running {
    process: Child,
    pulse: Arc<Pulse>,
    started: Instant,
    is_ready: bool,
    messages: u64,
    silent_ticks: u32,
    ending_ticks: u32,
    /// It hung, and this process has killed it.
    is_killed: bool,
}

impl Face {
    /// `words` make the executable this node.
    pub(super) fn new(words: Vec<String>) -> Self {
        Self {
            words,
            running: None,
            start_at: Instant::now(),
            pause: PAUSE,
            was_ready: false,
            is_missed: false,
        }
    }

    /// Whether it has been at work since this process began.
    pub(super) fn was_ready(&self) -> bool {
        self.was_ready
    }

    /// Asks it to end.
    pub(super) fn terminate(&self) {
        if let Some(running) = &self.running {
            send(&running.process, Signal::TERM);
        }
    }

    /// Ends it at once.
    pub(super) fn kill(&mut self) {
        if let Some(mut running) = self.running.take() {
            // It may have ended by itself in this very moment.
            let _ = running.process.kill();
            let _ = running.process.wait();
        }
    }

    /// Looks after it; called every tick.
    pub(super) fn look(&mut self, hub: &Arc<Hub>, is_on_time: bool, is_stopping: bool) -> Ended {
        let Some(running) = &mut self.running else {
            if is_stopping {
                return Ended::AsAsked(0);
            }
            if Instant::now() >= self.start_at {
                self.start(hub);
            }
            return Ended::No;
        };
        if let Ok(Some(status)) = running.process.try_wait() {
            return self.on_end(hub, status, is_stopping);
        }
        let messages = running.pulse.messages.load(Ordering::Relaxed);
        if std::mem::replace(&mut running.messages, messages) != messages {
            running.silent_ticks = 0;
        } else if is_on_time {
            running.silent_ticks += 1;
        }
        if !running.is_ready && running.pulse.is_ready.load(Ordering::Relaxed) {
            running.is_ready = true;
            if std::mem::replace(&mut self.is_missed, false) {
                tracing::info!("the ROS side is at work again");
                hub.order(&DriverCommand::RosFace { is_there: true });
            }
            self.was_ready = true;
        }
        let patience = if running.is_ready { SILENT_TICKS_MAX } else { STARTING_TICKS_MAX };
        running.ending_ticks += u32::from(running.pulse.is_over.load(Ordering::Relaxed));
        let is_cut_off = running.ending_ticks >= ENDING_TICKS_MAX;
        let is_needed = !is_stopping || !hub.is_closed();
        if is_needed && (running.silent_ticks >= patience || is_cut_off) {
            // Before a word is said about it; what it ends with is seen in the next tick.
            let _ = running.process.kill();
            running.is_killed = true;
            tracing::error!(
                "the ROS side (process {}) does not respond and is killed; the serial line stays \
                 connected",
                running.process.id()
            );
        }
        Ended::No
    }

    fn on_end(&mut self, hub: &Hub, status: ExitStatus, is_stopping: bool) -> Ended {
        let Some(running) = self.running.take() else { return Ended::No };
        let code = exit_code(status, is_stopping && running.is_killed);
        // Its lifecycle or a signal asked it to end, or it cannot begin at all.
        if is_stopping || status.success() || !self.was_ready {
            return Ended::AsAsked(code);
        }
        if !self.is_missed {
            self.is_missed = true;
            hub.order(&DriverCommand::RosFace { is_there: false });
        }
        if running.started.elapsed() >= LIVED {
            self.pause = PAUSE;
        }
        tracing::error!(
            "the ROS side ended ({status}) and is started again; the serial line stays connected"
        );
        self.start_at = Instant::now() + self.pause;
        self.pause = (self.pause * 2).min(PAUSE_MAX);
        Ended::No
    }

    fn start(&mut self, hub: &Arc<Hub>) {
        match self.spawn(hub) {
            Ok(running) => self.running = Some(running),
            Err(error) => {
                tracing::error!("the ROS side cannot be started: {error}");
                self.start_at = Instant::now() + self.pause;
                self.pause = (self.pause * 2).min(PAUSE_MAX);
            }
        }
    }

    fn spawn(&self, hub: &Arc<Hub>) -> std::io::Result<Running> {
        let (ours, theirs) = UnixStream::pair()?;
        // Before there is a process that nobody would wait for.
        let pulse = serve(hub, ours, !self.was_ready)?;
        // The file that this process was started from, even if another has come in its place.
        let process = Command::new("/proc/self/exe")
            .arg0(FACE_NAME)
            .args(&self.words)
            .env(FACE_VARIABLE, "1")
            // The supervisor hears this process; the face has its pulse.
            .env_remove("NOTIFY_SOCKET")
            .stdin(Stdio::from(OwnedFd::from(theirs)))
            .stdout(Stdio::null())
            // Ctrl-C and Ctrl-Z in a terminal are for this process.
            .process_group(0)
            .spawn()?;
        Ok(Running {
            process,
            pulse,
            started: Instant::now(),
            is_ready: false,
            messages: 0,
            silent_ticks: 0,
            ending_ticks: 0,
            is_killed: false,
        })
    }
}

impl Drop for Face {
    fn drop(&mut self) {
        self.kill();
    }
}

/// What the driver ends with when its face has ended so. One that was killed because it hung
/// spoils no stop that was asked for: this process brings the machine to a stop without it.
fn exit_code(status: ExitStatus, is_killed_in_a_stop: bool) -> u8 {
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    code.unwrap_or(if is_killed_in_a_stop { 0 } else { 1 })
}

fn send(process: &Child, signal: Signal) {
    if let Some(pid) = i32::try_from(process.id()).ok().and_then(Pid::from_raw) {
        // It may have ended by itself in this very moment.
        let _ = kill_process(pid, signal);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt;

    #[test]
    fn a_face_that_was_killed_in_a_stop_that_was_asked_for_does_not_make_it_a_failure() {
        let ended = |code| ExitStatus::from_raw(code << 8);
        let killed = ExitStatus::from_raw(9);
        assert_eq!(exit_code(killed, true), 0);
        assert_eq!(exit_code(killed, false), 1, "by somebody else");
        assert_eq!([exit_code(ended(0), false), exit_code(ended(101), true)], [0, 101]);
    }
}
