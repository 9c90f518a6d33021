//! What goes out to consumers that may be slow or gone.

use crate::driver::Output;
use crate::journal::Entry;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError};
use std::time::Duration;

/// Outputs that wait for a slow consumer, at most.
const WAITING_MAX: usize = 1024;
/// Entries that are handed out together, at most.
const TOGETHER_MAX: usize = 64;
/// How long an entry waits for others.
const TOGETHER_WITHIN: Duration = Duration::from_millis(10);

/// An output of the driver and the time of the input that caused it, since
/// [`super::Serial::epoch`]. Bytes to the controller are in the journal only.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    pub at: Duration,
    pub output: Output,
}

/// What was given up because nobody took it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dropped {
    pub events: u64,
    pub entries: u64,
}

#[derive(Debug, Default)]
pub(super) struct Counters {
    events: AtomicU64,
    entries: AtomicU64,
    /// When the last report came, ns since the epoch, plus one; 0 for never.
    last_report: AtomicU64,
    /// How often the thread that owns the driver has come round.
    turns: AtomicU64,
}

impl Counters {
    /// The thread that owns the driver has come round once more.
    pub(super) fn turn(&self) {
        self.turns.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn turns(&self) -> u64 {
        self.turns.load(Ordering::Relaxed)
    }

    pub(super) fn last_report_at(&self) -> Option<Duration> {
        self.last_report.load(Ordering::Relaxed).checked_sub(1).map(Duration::from_nanos)
    }

    pub(super) fn read(&self) -> Dropped {
        Dropped {
            events: self.events.load(Ordering::Relaxed),
            entries: self.entries.load(Ordering::Relaxed),
        }
    }
}

#[derive(Debug)]
pub(super) struct Outbox {
    events: SyncSender<Event>,
    journal: SyncSender<Entry>,
    counters: Arc<Counters>,
    waiting: VecDeque<Event>,
    /// Entries that are not handed out yet, and when they are at the latest.
    entries: Vec<Entry>,
    due: Option<Duration>,
}

impl Outbox {
    pub(super) fn new(
        events: SyncSender<Event>,
        journal: SyncSender<Entry>,
        counters: Arc<Counters>,
    ) -> Self {
        let (waiting, entries) = (VecDeque::new(), Vec::new());
        Self { events, journal, counters, waiting, entries, due: None }
    }

    /// Events come after the entries that led to them.
    pub(super) fn push(&mut self, event: Event) {
        self.hand_out();
        self.waiting.push_back(event);
        if self.waiting.len() > WAITING_MAX {
            // The oldest telemetry goes first; the last state is still to come or there.
            let is_telemetry = |event: &Event| {
                use Output::{Log, Progress, State};
                matches!(event.output, State(_) | Progress { .. } | Log { .. })
            };
            let oldest = self.waiting.iter().position(is_telemetry).unwrap_or(0);
            self.waiting.remove(oldest);
            self.counters.events.fetch_add(1, Ordering::Relaxed);
        }
        self.flush();
    }

    pub(super) fn flush(&mut self) {
        while let Some(event) = self.waiting.pop_front() {
            match self.events.try_send(event) {
                Ok(()) => {}
                Err(TrySendError::Full(event)) => {
                    self.waiting.push_front(event);
                    return;
                }
                Err(TrySendError::Disconnected(_)) => {
                    self.counters.events.fetch_add(1, Ordering::Relaxed);
                }
            }
        }
    }

    /// The thread that owns the driver has come round once more.
    pub(super) fn turn(&self) {
        self.counters.turn();
    }

    pub(super) fn is_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// When the last report came; a report that changes nothing is no event.
    pub(super) fn set_last_report(&self, at: Option<Duration>) {
        // 584 years fit.
        let ns = at.map_or(0, |at| u64::try_from(at.as_nanos()).unwrap_or(u64::MAX - 1) + 1);
        self.counters.last_report.store(ns, Ordering::Relaxed);
    }

    /// Keeps an entry for a moment. Each that is handed out alone wakes whoever records, while
    /// the next answer of the controller waits for a processor.
    pub(super) fn record(&mut self, now: Duration, entry: Entry) {
        self.entries.push(entry);
        self.due.get_or_insert(now + TOGETHER_WITHIN);
        if self.entries.len() >= TOGETHER_MAX {
            self.hand_out();
        }
    }

    /// When entries are to be handed out.
    pub(super) fn due(&self) -> Option<Duration> {
        self.due
    }

    /// Entries carry numbers: who misses one can see it.
    pub(super) fn hand_out(&mut self) {
        self.due = None;
        for entry in self.entries.drain(..) {
            if self.journal.try_send(entry).is_err() {
                self.counters.entries.fetch_add(1, Ordering::Relaxed);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::driver::{LogLevel, Refusal};
    use crate::journal::Journal;
    use std::sync::mpsc::sync_channel;

    #[test]
    fn a_consumer_that_sleeps_loses_telemetry_and_no_reply() {
        let (events, consumer) = sync_channel(4);
        let (journal, _) = sync_channel(1);
        let counters = Arc::new(Counters::default());
        let mut outbox = Outbox::new(events, journal, counters.clone());
        let at = Duration::ZERO;
        let refusal = Refusal { error_code: 1, message: String::new() };
        for id in 0..10 {
            let reply = Output::Reply { id, result: Err(refusal.clone()) };
            outbox.push(Event { at, output: reply });
            for _ in 0..1000 {
                let log = Output::Log { level: LogLevel::Info, message: String::new() };
                outbox.push(Event { at, output: log });
            }
        }
        let mut replies = 0;
        loop {
            outbox.flush();
            let mut got = 0;
            while let Ok(event) = consumer.try_recv() {
                got += 1;
                replies += u64::from(matches!(event.output, Output::Reply { .. }));
            }
            if got == 0 {
                break;
            }
        }
        assert_eq!(replies, 10);
        assert_eq!(counters.read().events, 10_010 - 4 - WAITING_MAX as u64);
    }

    #[test]
    fn entries_are_handed_out_together_and_before_the_events_they_led_to() {
        let (events, _received) = sync_channel(4);
        let (journal, recorder) = sync_channel(256);
        let mut outbox = Outbox::new(events, journal, Arc::default());
        let handed_out = || recorder.try_iter().count();
        let mut entries = Journal::default();
        let mut record = |outbox: &mut Outbox, ms| {
            let now = Duration::from_millis(ms);
            outbox.record(now, entries.transmitted(now, b"?"));
        };
        record(&mut outbox, 5);
        record(&mut outbox, 9);
        assert_eq!((handed_out(), outbox.due()), (0, Some(Duration::from_millis(15))));
        let log = Output::Log { level: LogLevel::Info, message: String::new() };
        outbox.push(Event { at: Duration::ZERO, output: log });
        assert_eq!((handed_out(), outbox.due()), (2, None));
        (0..TOGETHER_MAX).for_each(|_| record(&mut outbox, 20));
        assert_eq!((handed_out(), outbox.due()), (TOGETHER_MAX, None));
    }
}
