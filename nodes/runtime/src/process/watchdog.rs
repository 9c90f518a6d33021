//! The thread that checks whether the middleware still serves this process, and how much memory it takes.
//!
//! What is checked is the middleware's own; what follows is the same for all of them.

use super::supervision::{DEAF, Notifier, TOO_LARGE};
use super::{lock, panic_guard};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::sync::watch;

/// How long a command may take to notice that it is deaf, in checks: one that hangs in the middleware
/// never does.
const UNHEARD_CHECKS_MAX: u32 = 20;
/// The exit status of a command that no node answers.
const NO_ANSWER: u8 = 3;
/// The time between two checks.
pub(crate) const CHECK_PERIOD: Duration = Duration::from_millis(250);

/// That the process receives nothing any more.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Deafness {
    pub(crate) reason: String,
    /// Somebody in the process acts on it.
    pub(crate) is_heard: bool,
}

/// What to do when the process is deaf or takes too much memory.
pub(crate) struct EndOfProcess {
    pub(crate) logger: String,
    /// A node exits when it is deaf; a command says so or reconnects, and exits where it does neither.
    pub(crate) when_deaf: bool,
    /// A sentence with the numbers, when the process takes too much.
    pub(crate) exceeded: Box<dyn Fn() -> Option<String> + Send>,
}

/// The watching thread. It ends when this is dropped.
#[derive(Debug)]
pub(crate) struct Watchdog {
    notifier: Arc<Mutex<Notifier>>,
    /// Nothing is sent: the thread ends when this is dropped.
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Watchdog {
    /// Starts a thread of this name. `check` says why the process receives nothing any more; `deaf` gets the first
    /// reason, unless the process exits.
    ///
    /// # Errors
    /// The system has no thread left.
    pub(crate) fn start(
        name: &str,
        deaf: watch::Sender<Option<Deafness>>,
        end: Option<EndOfProcess>,
        check: impl FnMut() -> Result<(), String> + Send + 'static,
    ) -> std::io::Result<Self> {
        let notifier = Arc::new(Mutex::new(Notifier::default()));
        let (stop, stopped) = channel();
        let watching = Arc::clone(&notifier);
        let thread = std::thread::Builder::new()
            .name(name.into())
            .spawn(move || watch_until(&stopped, &watching, &deaf, end.as_ref(), check))?;
        Ok(Self { notifier, stop: Some(stop), thread: Some(thread) })
    }

    /// Reports to the supervisor from now on that the process serves.
    pub(crate) fn report_to(&self, notifier: Notifier) {
        *lock(&self.notifier) = notifier;
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        self.stop.take();
        if let Some(thread) = self.thread.take() {
            // It has reported an error already, if there was one.
            let _ = thread.join();
        }
    }
}

fn watch_until(
    stopped: &Receiver<()>,
    notifier: &Mutex<Notifier>,
    deaf: &watch::Sender<Option<Deafness>>,
    end: Option<&EndOfProcess>,
    mut check: impl FnMut() -> Result<(), String>,
) {
    let mut unheard_checks = 0;
    while let Err(RecvTimeoutError::Timeout) = stopped.recv_timeout(CHECK_PERIOD) {
        if let Some(EndOfProcess { logger, exceeded, .. }) = end
            && let Some(what) = exceeded()
        {
            let text = format!("{what}; it ends with status {TOO_LARGE}");
            panic_guard::exit_now(TOO_LARGE, logger, &text);
        }
        let checked = check();
        // Not in the condition: its lock would be held in what follows.
        let known = deaf.borrow().clone();
        let is_heard = known.as_ref().is_some_and(|deafness| deafness.is_heard);
        let Some(reason) = known.map(|deafness| deafness.reason).or(checked.err()) else {
            lock(notifier).alive();
            continue;
        };
        if let Some(EndOfProcess { logger, when_deaf, .. }) = end {
            unheard_checks += u32::from(!is_heard);
            let status = match when_deaf {
                true => Some(DEAF),
                false => (unheard_checks > UNHEARD_CHECKS_MAX).then_some(NO_ANSWER),
            };
            if let Some(status) = status {
                let text = format!(
                    "{reason}; this process receives nothing any more and ends with status {status}"
                );
                panic_guard::exit_now(status, logger, &text);
            }
        }
        deaf.send_if_modified(|known| {
            let is_new = known.is_none();
            known.get_or_insert(Deafness { reason, is_heard: false });
            is_new
        });
    }
}
