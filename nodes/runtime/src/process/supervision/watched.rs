//! Starts a child process, watches it and restarts it.

use super::SUPERVISOR;
use super::mailbox::Mailbox;
use super::restart_policy::{Limits, RestartPolicy};
use std::fmt;
use std::io;
use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};

/// A child that is restarted whenever it ends or falls silent.
///
/// The owner calls [`Self::poll`] every 50 to 200 ms; nothing here blocks. Dropping this kills
/// the child. A child that uses `die_with_parent` must be started and polled on a thread
/// that lives as long as the child should.
pub struct Watched {
    /// Makes a new command for each start.
    make: Box<dyn FnMut() -> io::Result<Command> + Send>,
    mailbox: Mailbox,
    limits: Limits,
    policy: RestartPolicy,
    state: ChildState,
}

enum ChildState {
    Running {
        child: Child,
        /// It was silent and has been killed; its end is awaited.
        is_killed: bool,
    },
    Pausing {
        until: Instant,
    },
}

/// What happened to a child, for the log.
#[derive(Debug)]
pub enum Change {
    /// It has sent `READY=1`.
    Ready,
    /// It was silent for so long and has been killed; [`Change::Ended`] follows.
    Silent(Duration),
    /// It ended, and is restarted after the pause.
    Ended { status: ExitStatus, pause: Duration },
    /// It was restarted.
    Started,
    /// It could not be restarted; the next attempt comes after the pause.
    NotStarted { error: io::Error, pause: Duration },
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let again = |f: &mut fmt::Formatter<'_>, pause: &Duration| match pause.is_zero() {
            true => write!(f, "restarting it now"),
            false => write!(f, "restarting it in {:.2} s", pause.as_secs_f64()),
        };
        match self {
            Self::Ready => write!(f, "is ready"),
            Self::Silent(time) => {
                write!(f, "gave no sign of life for {:.1} s; killing it", time.as_secs_f64())
            }
            Self::Ended { status, pause } => {
                write!(f, "ended ({status}); ")?;
                again(f, pause)
            }
            Self::Started => write!(f, "was restarted"),
            Self::NotStarted { error, pause } => {
                write!(f, "cannot be restarted ({error}); ")?;
                again(f, pause)
            }
        }
    }
}

impl Watched {
    /// Starts a child. `make` makes its command; the variables of the protocol are added here.
    ///
    /// # Errors
    /// The socket cannot be made, or the command cannot be started.
    pub fn start(
        limits: Limits,
        mut make: impl FnMut() -> io::Result<Command> + Send + 'static,
    ) -> io::Result<Self> {
        let mailbox = Mailbox::new()?;
        let child = spawn(&mut make, &mailbox, limits)?;
        Ok(Self {
            make: Box::new(make),
            mailbox,
            limits,
            policy: RestartPolicy::new(limits, Instant::now()),
            state: ChildState::Running { child, is_killed: false },
        })
    }

    /// What happened since the last call; at most one thing a call.
    pub fn poll(&mut self) -> Option<Change> {
        let now = Instant::now();
        match &mut self.state {
            ChildState::Running { child, is_killed } => {
                let becomes_ready = self.policy.take_notices(self.mailbox.read(), now);
                if let Ok(Some(status)) = child.try_wait() {
                    let pause = self.policy.pause(now);
                    self.state = ChildState::Pausing { until: now + pause };
                    return Some(Change::Ended { status, pause });
                }
                if becomes_ready {
                    return Some(Change::Ready);
                }
                let silence = self.policy.silent_for().filter(|_| !*is_killed)?;
                *is_killed = true;
                // A child that cannot be killed has ended; the next call reaps it.
                let _ = child.kill();
                Some(Change::Silent(silence))
            }
            ChildState::Pausing { until } if now < *until => None,
            ChildState::Pausing { .. } => {
                // Messages of the previous child.
                self.mailbox.read();
                Some(match spawn(&mut self.make, &self.mailbox, self.limits) {
                    Ok(child) => {
                        self.policy.started(Instant::now());
                        self.state = ChildState::Running { child, is_killed: false };
                        Change::Started
                    }
                    Err(error) => {
                        self.policy.started(now);
                        let pause = self.policy.pause(now).max(self.limits.pause_min);
                        self.state = ChildState::Pausing { until: now + pause };
                        Change::NotStarted { error, pause }
                    }
                })
            }
        }
    }

    /// The child, while one runs.
    pub fn child(&mut self) -> Option<&mut Child> {
        match &mut self.state {
            ChildState::Running { child, .. } => Some(child),
            ChildState::Pausing { .. } => None,
        }
    }

    /// Whether the child has reported that it serves.
    pub fn is_ready(&self) -> bool {
        matches!(self.state, ChildState::Running { is_killed: false, .. }) && self.policy.is_ready()
    }
}

fn spawn(
    make: &mut dyn FnMut() -> io::Result<Command>,
    mailbox: &Mailbox,
    limits: Limits,
) -> io::Result<Child> {
    make()?
        .env("NOTIFY_SOCKET", mailbox.path())
        .env("WATCHDOG_USEC", limits.silence_max.as_micros().to_string())
        .env(SUPERVISOR, std::process::id().to_string())
        .env_remove("WATCHDOG_PID")
        .spawn()
}

impl Drop for Watched {
    fn drop(&mut self) {
        if let Some(child) = self.child() {
            // It may have ended already.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

impl fmt::Debug for Watched {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Watched").field("policy", &self.policy).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::process::{Pid, Signal, kill_process};

    const PATIENCE: Duration = Duration::from_secs(60);

    fn shell(script: &'static str) -> impl FnMut() -> io::Result<Command> + Send {
        move || {
            let mut command = Command::new("sh");
            command.args(["-c", script]);
            Ok(command)
        }
    }

    fn next(watched: &mut Watched) -> Change {
        let end = Instant::now() + PATIENCE;
        while Instant::now() < end {
            if let Some(change) = watched.poll() {
                return change;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        panic!("nothing happened within {} s", PATIENCE.as_secs());
    }

    #[test]
    fn a_child_that_ends_is_started_again() {
        let mut watched = Watched::start(Limits::default(), shell("exit 70")).expect("a child");
        let Change::Ended { status, pause } = next(&mut watched) else { panic!("it ends") };
        assert_eq!((status.code(), pause), (Some(70), Duration::ZERO));
        assert!(matches!(next(&mut watched), Change::Started));
        let Change::Ended { pause, .. } = next(&mut watched) else { panic!("it ends") };
        assert_eq!(pause, Limits::default().pause_min);
    }

    #[test]
    fn a_child_that_is_stopped_is_killed_and_started_again() {
        let limits = Limits { start_max: Duration::from_millis(300), ..Limits::default() };
        let mut watched = Watched::start(limits, shell("exec sleep 600")).expect("a child");
        let first = watched.child().expect("it runs").id();
        let pid = Pid::from_raw(i32::try_from(first).expect("small")).expect("not 0");
        kill_process(pid, Signal::STOP).expect("our child");
        assert!(matches!(next(&mut watched), Change::Silent(_)));
        let Change::Ended { status, .. } = next(&mut watched) else { panic!("it was killed") };
        assert_eq!(status.to_string(), "signal: 9 (SIGKILL)");
        assert!(matches!(next(&mut watched), Change::Started));
        assert_ne!(watched.child().expect("it runs").id(), first);
    }

    #[test]
    fn a_child_that_cannot_be_started_again_is_tried_for_ever() {
        let mut count = 0;
        let make = move || {
            count += 1;
            match count {
                1 | 4.. => shell("exit 1")(),
                _ => Err(io::Error::other("no memory")),
            }
        };
        let mut watched = Watched::start(Limits::default(), make).expect("a child");
        assert!(matches!(next(&mut watched), Change::Ended { .. }));
        assert!(matches!(next(&mut watched), Change::NotStarted { .. }));
        let change = next(&mut watched);
        assert_eq!(change.to_string(), "cannot be restarted (no memory); restarting it in 0.50 s");
        assert!(matches!(next(&mut watched), Change::Started));
    }
}
