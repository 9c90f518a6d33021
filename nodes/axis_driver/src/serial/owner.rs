//! The thread that owns the driver.

use super::inbox::{Batch, Control, Inbox, WriterFailed};
use super::outbox::{Event, Outbox};
use super::{Reopen, SerialConfig};
use crate::driver::{Command, Driver, Input, Output};
use crate::journal::Journal;
use crate::transport::{self, Transport};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
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
    /// Open again then, after this pause the next time.
    reopen: Option<(Duration, Duration)>,
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
            reopen: None,
            wants_open: false,
        }
    }

    pub(super) fn run(mut self) {
        loop {
            self.outbox.turn();
            let has_bytes = self.wait();
            let Batch { controls, failed, is_stopped } = self.inbox.take();
            for control in controls {
                self.on_control(control);
            }
            if let Some(failed) = failed.filter(|failed| failed.port == self.port_number)
                && self.port.is_some()
            {
                self.lose_port(&failed.reason);
            }
            if has_bytes && let Some(read) = self.port.as_ref().map(|port| port.read()) {
                match read {
                    Ok(bytes) if bytes.is_empty() => {}
                    Ok(bytes) => self.handle(Input::Received(bytes)),
                    Err(reason) => self.lose_port(&reason),
                }
            }
            if is_stopped {
                self.port = None;
                self.outbox.hand_out();
                self.outbox.flush();
                return;
            }
            let now = self.epoch.elapsed();
            if self.reopen.is_some_and(|(at, _)| now >= at) {
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

    /// Waits for bytes, for the inbox or for the time; whether the port has something to say.
    ///
    /// The thread that owns the driver reads by itself: an answer that has to wake one thread
    /// to be read and another to be understood waits for a processor twice.
    fn wait(&self) -> bool {
        let mut fds = vec![PollFd::from_borrowed_fd(self.inbox.bell(), PollFlags::IN)];
        fds.extend(
            self.port.as_ref().map(|port| PollFd::from_borrowed_fd(port.as_fd(), PollFlags::IN)),
        );
        let timeout = Timespec::try_from(self.patience()).ok();
        match poll(&mut fds, timeout.as_ref()) {
            Ok(_) => fds.get(1).is_some_and(|port| !port.revents().is_empty()),
            // A signal, or the process was stopped and continued.
            Err(_) => false,
        }
    }

    fn patience(&self) -> Duration {
        let now = self.epoch.elapsed();
        let reopen = self.reopen.map(|(at, _)| at);
        let deadlines = [self.driver.next_deadline(), reopen, self.outbox.due()];
        let next = deadlines.into_iter().flatten().min();
        let next = next.map_or(SLEEP_MAX, |deadline| deadline.saturating_sub(now));
        let most = if self.outbox.is_waiting() { SLOW_CONSUMER } else { SLEEP_MAX };
        next.min(most)
    }

    fn on_control(&mut self, control: Control) {
        match control {
            Control::Open => {
                self.wants_open = true;
                self.last_reason.clear();
                if self.port.is_none() {
                    self.reopen = None;
                    self.open();
                }
            }
            Control::Close => {
                let was_wanted = std::mem::take(&mut self.wants_open);
                self.reopen = None;
                // A port that was tried in vain is not tried any more.
                if self.port.take().is_some() || was_wanted {
                    self.report_closed("closed as asked".into());
                }
            }
            Control::Command { id, command } => self.handle(Input::Command { id, command }),
        }
    }

    fn open(&mut self) {
        self.port_number += 1;
        let (inbox, port) = (Arc::clone(&self.inbox), self.port_number);
        let on_failure = move |reason| inbox.push_failure(WriterFailed { port, reason });
        match transport::open(&self.config, Box::new(on_failure)) {
            Ok(port) => {
                self.port = Some(port);
                self.reopen = None;
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
        self.port = None;
        self.schedule_reopen();
        self.report_closed(format!("{}: {reason}", self.config.path));
    }

    fn schedule_reopen(&mut self) {
        let Reopen::Backoff { first, most } = self.config.reopen else {
            self.reopen = None;
            return;
        };
        if !self.wants_open {
            return;
        }
        let pause = self.reopen.map_or(first, |(_, next)| next);
        self.reopen = Some((self.epoch.elapsed() + pause, (pause * 2).min(most)));
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
                    let port = self.port.as_ref();
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
            self.reopen = None;
            if self.port.take().is_some() {
                self.report_closed("closed: the driver was shut down".into());
            }
        }
    }
}
