//! The thread that owns the driver.

use super::inbox::{Batch, Inbox, InboxCommand, Opened, WriterFailed};
use super::outbox::{Event, Outbox};
use super::{Reopen, SerialConfig};
use crate::driver::{Command, Driver, Input, Output};
use crate::journal::Journal;
use crate::transport::{self, Transport};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The longest sleep; nothing depends on it.
const SLEEP_MAX: Duration = Duration::from_secs(1);
/// How often a consumer that was slow is tried again.
const SLOW_CONSUMER: Duration = Duration::from_millis(20);

pub(super) struct Owner {
    config: SerialConfig,
    inbox: Arc<Inbox>,
    outbox: Outbox,
    epoch: Instant,
    driver: Driver,
    journal: Journal,
    port: Option<Box<dyn Transport>>,
    port_number: u64,
    last_reason: String,
    /// Whether a thread is opening a cable: a host that does not answer takes its time.
    is_opening: bool,
    /// Open again then.
    reopen_at: Option<Duration>,
    /// After this pause, the next time that a cable cannot be opened or has ended without a byte.
    next_pause: Option<Duration>,
    wants_open: bool,
}

impl Owner {
    pub(super) fn new(
        config: SerialConfig,
        inbox: Arc<Inbox>,
        outbox: Outbox,
        epoch: Instant,
    ) -> Self {
        let driver = Driver::new(config.driver.clone());
        Self {
            config,
            inbox,
            outbox,
            epoch,
            driver,
            journal: Journal::default(),
            port: None,
            port_number: 0,
            last_reason: String::new(),
            is_opening: false,
            reopen_at: None,
            next_pause: None,
            wants_open: false,
        }
    }

    pub(super) fn run(mut self) {
        loop {
            self.outbox.turn();
            let has_bytes = self.wait();
            let Batch { controls, opened, failed, is_stopped } = self.inbox.take();
            for control in controls {
                self.on_control(control);
            }
            if let Some(opened) = opened.filter(|_| !is_stopped) {
                self.on_opened(opened);
            }
            if let Some(failed) = failed.filter(|failed| failed.port == self.port_number)
                && self.port.is_some()
            {
                self.lose_port(&failed.reason);
            }
            self.serve_port(has_bytes);
            if is_stopped {
                self.port = None;
                self.outbox.hand_out();
                self.outbox.flush();
                return;
            }
            let now = self.epoch.elapsed();
            if self.reopen_at.is_some_and(|at| now >= at) {
                self.open();
            }
            if self.driver.next_deadline().is_some_and(|deadline| now >= deadline) {
                self.handle(Input::Timer);
            }
            if self.outbox.due().is_some_and(|due| now >= due) {
                self.outbox.hand_out();
            }
            self.outbox.flush();
        }
    }

    /// Reads and writes what the port has and takes.
    fn serve_port(&mut self, is_ready: bool) {
        let Some(port) = &mut self.port else { return };
        let is_ready = is_ready || port.has_unread();
        let flushed = if port.has_unwritten() { port.flush() } else { Ok(()) };
        let read = if is_ready { port.read() } else { Ok(Vec::new()) };
        let mut lost = flushed.err();
        match read {
            Ok(bytes) if bytes.is_empty() => {}
            Ok(bytes) => {
                self.next_pause = None;
                self.handle(Input::Received(bytes));
            }
            Err(reason) => lost = lost.or(Some(reason)),
        }
        // What was handed on may have been answered in vain.
        if let Some(reason) = lost
            && self.port.is_some()
        {
            self.lose_port(&reason);
        }
    }

    /// Waits for bytes, for the inbox or for the time; whether the port has something to say.
    ///
    /// The thread that owns the driver reads by itself: an answer that has to wake one thread
    /// to be read and another to be understood waits for a processor twice.
    fn wait(&self) -> bool {
        let mut fds = vec![PollFd::from_borrowed_fd(self.inbox.bell(), PollFlags::IN)];
        fds.extend(self.port.as_ref().map(|port| {
            let writes = if port.has_unwritten() { PollFlags::OUT } else { PollFlags::empty() };
            PollFd::from_borrowed_fd(port.as_fd(), PollFlags::IN | writes)
        }));
        let timeout = Timespec::try_from(self.patience()).ok();
        match poll(&mut fds, timeout.as_ref()) {
            Ok(_) => fds.get(1).is_some_and(|port| !port.revents().is_empty()),
            // A signal, or the process was stopped and continued.
            Err(_) => false,
        }
    }

    fn patience(&self) -> Duration {
        if self.port.as_ref().is_some_and(|port| port.has_unread()) {
            return Duration::ZERO;
        }
        let now = self.epoch.elapsed();
        let deadlines = [self.driver.next_deadline(), self.reopen_at, self.outbox.due()];
        let next = deadlines.into_iter().flatten().min();
        let next = next.map_or(SLEEP_MAX, |deadline| deadline.saturating_sub(now));
        let most = if self.outbox.is_waiting() { SLOW_CONSUMER } else { SLEEP_MAX };
        next.min(most)
    }

    fn on_control(&mut self, control: InboxCommand) {
        match control {
            InboxCommand::Open => {
                self.wants_open = true;
                self.last_reason.clear();
                if self.port.is_none() {
                    self.next_pause = None;
                    self.open();
                }
            }
            InboxCommand::Close => {
                let was_wanted = std::mem::take(&mut self.wants_open);
                self.reopen_at = None;
                // A port that was tried in vain is not tried any more.
                if self.port.take().is_some() || was_wanted {
                    self.report_closed("closed as asked".into());
                }
            }
            InboxCommand::Command { id, command } => self.handle(Input::Command { id, command }),
        }
    }

    /// Has the cable opened by a thread of its own, unless one is at it: the driver has its turn
    /// meanwhile.
    fn open(&mut self) {
        self.reopen_at = None;
        if std::mem::replace(&mut self.is_opening, true) {
            return;
        }
        self.port_number += 1;
        let (inbox, port, config) =
            (Arc::clone(&self.inbox), self.port_number, self.config.clone());
        let opener = std::thread::Builder::new().name("axis-driver-open".into()).spawn(move || {
            let failures = Arc::clone(&inbox);
            let on_failure = move |reason| failures.push_failure(WriterFailed { port, reason });
            let open = AssertUnwindSafe(|| transport::open(&config, Box::new(on_failure)));
            let result = catch_unwind(open).unwrap_or_else(|_| {
                Err(format!("cannot open {}: the thread that opens it has panicked", config.path))
            });
            inbox.push_opened(Opened { port, result });
        });
        if let Err(error) = opener {
            let result = Err(format!("cannot start axis-driver-open: {error}"));
            self.on_opened(Opened { port, result });
        }
    }

    fn on_opened(&mut self, opened: Opened) {
        self.is_opening = false;
        if !self.wants_open {
            // It was closed meanwhile.
            return;
        }
        debug_assert_eq!(opened.port, self.port_number);
        match opened.result {
            Ok(port) => {
                self.port = Some(port);
                self.last_reason.clear();
                self.handle(Input::PortOpened);
            }
            Err(reason) => {
                self.schedule_reopen();
                self.report_closed(reason);
            }
        }
    }

    fn lose_port(&mut self, reason: &str) {
        if let Some(mut port) = self.port.take() {
            port.abandon();
        }
        self.schedule_reopen();
        self.report_closed(format!("{}: {reason}", self.config.path));
    }

    fn schedule_reopen(&mut self) {
        let Reopen::Backoff { first, most } = self.config.reopen else { return };
        if !self.wants_open {
            return;
        }
        let pause = self.next_pause.unwrap_or(first);
        self.reopen_at = Some(self.epoch.elapsed() + pause);
        self.next_pause = Some((pause * 2).min(most));
    }

    /// Reports each reason to the driver once.
    fn report_closed(&mut self, reason: String) {
        if self.last_reason != reason {
            self.last_reason.clone_from(&reason);
            self.handle(Input::PortClosed { reason });
        }
    }

    fn handle(&mut self, input: Input) {
        let now = self.epoch.elapsed();
        if let Input::Command { command: Command::RunProgram(_), .. } = &input
            && let Some(checkpoint) = self.driver.checkpoint()
        {
            // Whoever records the run can begin here.
            let entry = self.journal.checkpoint(now, checkpoint);
            self.outbox.record(now, entry);
        }
        let is_command = matches!(input, Input::Command { .. });
        // What is written goes first: who records it or shows it wakes up after that.
        let mut entries = vec![self.journal.input(now, &input)];
        let mut events = Vec::new();
        self.driver.handle(now, input);
        self.outbox.set_last_report(self.driver.last_report_at());
        let mut failure = None;
        let mut is_over = false;
        while let Some(output) = self.driver.poll_output() {
            match output {
                Output::Transmit(bytes) => {
                    entries.push(self.journal.transmitted(now, &bytes));
                    let port = self.port.as_mut();
                    if let Some(Err(reason)) = port.map(|port| port.write(bytes)) {
                        failure = Some(reason);
                    }
                }
                output => {
                    is_over |= output == Output::ReadyToClose;
                    events.push(Event { at: now, output });
                }
            }
        }
        entries.into_iter().for_each(|entry| self.outbox.record(now, entry));
        if is_command {
            self.outbox.hand_out();
        }
        events.into_iter().for_each(|event| self.outbox.push(event));
        if let Some(reason) = failure {
            self.lose_port(&reason);
        } else if is_over {
            self.wants_open = false;
            self.reopen_at = None;
            if self.port.take().is_some() {
                self.report_closed("closed: the driver was shut down".into());
            }
        }
    }
}
