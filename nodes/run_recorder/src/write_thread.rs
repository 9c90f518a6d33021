//! The thread that writes the bag of a run.
//!
//! Takes messages from [`crate::write_queue`], closes chunks in time, and counts the
//! messages that a failing disk loses. [`crate::run_bag`] is its interface.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::bag_writer::{BagWriteError, ChannelIndex};
use crate::closing::Closing;
use crate::files::write_metadata_file;
use crate::metadata::metadata_yaml_of_files;
use crate::parts::{Finished, Outlet, Parts};
use crate::run_bag::{RecordingStatus, RunBagOptions};
use crate::write_queue::{WriteBatch, WriteCommand, WriteQueue};

/// How long one message, flush or sync may take before the status reports a stall.
const STALL: Duration = Duration::from_secs(2);

/// Shared by the thread and [`crate::run_bag::RunBag`].
pub(crate) struct SharedState {
    pub(crate) path: PathBuf,
    pub(crate) queue: WriteQueue,
    pub(crate) messages_written: AtomicU64,
    pub(crate) bytes_written: Arc<AtomicU64>,
    pub(crate) busy: BusySince,
    pub(crate) end: Mutex<ThreadEnd>,
    pub(crate) ended: Condvar,
}

/// Since when the thread waits for one disk operation.
#[derive(Default)]
pub(crate) struct BusySince(Mutex<Option<Instant>>);

impl BusySince {
    fn begin(&self) {
        *lock(&self.0) = Some(Instant::now());
    }

    fn end(&self) {
        *lock(&self.0) = None;
    }

    /// How long the disk has stalled, if that is long.
    fn stalled(&self) -> Option<Duration> {
        let since = *lock(&self.0);
        since.map(|since| since.elapsed()).filter(|&elapsed| elapsed >= STALL)
    }
}

/// The state of the thread.
#[derive(Default)]
pub(crate) struct ThreadEnd {
    pub(crate) topics: Vec<String>,
    pub(crate) noted: Vec<String>,
    pub(crate) error: Option<String>,
    pub(crate) has_begun: bool,
    pub(crate) is_over: bool,
    pub(crate) is_finished: bool,
}

impl SharedState {
    pub(crate) fn status(&self) -> RecordingStatus {
        let lost = self.queue.lost();
        let end = lock(&self.end);
        let lost_by_topic = end.by_topic(&lost);
        let mut reasons = end.noted.clone();
        reasons.extend(end.error.clone());
        reasons.extend(lost_by_topic.iter().map(|(topic, count)| match end.error {
            // It returns the reason.
            Some(_) => format!("{count} messages of {topic} are lost"),
            None => format!(
                "{count} messages of {topic} were lost: they came faster than they could be written"
            ),
        }));
        let stalled = self.busy.stalled();
        reasons.extend(
            stalled.map(|time| format!("the disk has taken nothing for {} s", time.as_secs())),
        );
        RecordingStatus {
            path: self.path.clone(),
            messages_written: self.messages_written.load(Ordering::Relaxed),
            messages_lost: lost.values().sum(),
            lost_by_topic,
            missed_by_topic: end.by_topic(&self.queue.missed()),
            bytes_written: self.bytes_written.load(Ordering::Relaxed),
            bytes_waiting: self.queue.waiting_bytes(),
            error: end.error.clone(),
            has_begun: end.has_begun,
            is_stalled: stalled.is_some(),
            is_finished: end.is_finished,
            complete: reasons.is_empty(),
            reasons,
        }
    }
}

impl ThreadEnd {
    /// Counts by the names of their topics.
    fn by_topic(&self, counts: &BTreeMap<ChannelIndex, u64>) -> BTreeMap<String, u64> {
        let named = |(channel, count): (&ChannelIndex, &u64)| {
            let topic = self.topics.get(usize::from(channel.0)).cloned();
            (topic.unwrap_or_else(|| format!("channel {}", channel.0)), *count)
        };
        counts.iter().map(named).collect()
    }
}

/// The write thread.
pub(crate) fn run(shared: &SharedState, options: &RunBagOptions, outlet: Outlet) {
    let _over = Over(shared);
    match write_bag(shared, options, outlet) {
        Ok(()) => lock(&shared.end).is_finished = true,
        Err(error) => {
            lock(&shared.end).error.get_or_insert(error.to_string());
            // Nothing more is written; waiting and later messages are counted as lost.
            shared.queue.close();
            loop {
                let batch = shared.queue.take(Duration::ZERO);
                batch.commands.iter().for_each(|command| lose(shared, command));
                shared.queue.done(&batch);
                if batch.is_last {
                    break;
                }
            }
        }
    }
}

/// Wakes the waiting callers when the thread ends, even if it panics.
struct Over<'a>(&'a SharedState);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.busy.end();
        let mut end = lock(&self.0.end);
        if thread::panicking() {
            end.error.get_or_insert("the write thread failed".to_owned());
        }
        end.is_over = true;
        drop(end);
        self.0.queue.close();
        self.0.ended.notify_all();
    }
}

fn write_bag(
    shared: &SharedState,
    options: &RunBagOptions,
    outlet: Outlet,
) -> Result<(), BagWriteError> {
    shared.busy.begin();
    let parts = Parts::begin(options, outlet, shared.bytes_written.clone())?;
    let mut pen = PartsWriter {
        shared,
        parts,
        written: 0,
        written_of: BTreeMap::new(),
        unflushed: BTreeMap::new(),
    };
    let interval = options.flush_interval;
    let mut oldest_unflushed: Option<Instant> = None;
    loop {
        shared.busy.end();
        let wait =
            oldest_unflushed.map_or(interval, |since| interval.saturating_sub(since.elapsed()));
        let batch = shared.queue.take(wait);
        let written = pen.batch(&batch);
        shared.queue.done(&batch);
        written?;
        if !batch.commands.is_empty() {
            oldest_unflushed.get_or_insert_with(Instant::now);
        }
        if oldest_unflushed.is_some_and(|since| since.elapsed() >= interval) {
            shared.busy.begin();
            pen.flush()?;
            if options.syncs_each_flush {
                shared.busy.begin();
                pen.parts.sync()?;
            }
            oldest_unflushed = None;
        }
        if batch.is_last {
            break;
        }
    }
    shared.busy.begin();
    pen.flush()?;
    // The stalled data is in the file now.
    shared.busy.end();
    let status = shared.status();
    let closing = Closing {
        complete: status.complete,
        reasons: status.reasons.join("; "),
        lost: status.messages_lost,
        written: lock(&shared.end).by_topic(&pen.written_of),
        missed: status.missed_by_topic.clone(),
    };
    let mut custom_data = options.run.clone();
    custom_data.insert("complete".to_owned(), status.complete.to_string());
    shared.busy.begin();
    let Finished { files, is_ours } = pen.parts.finish(&closing, &custom_data)?;
    shared.busy.begin();
    write_metadata_file(&shared.path, &metadata_yaml_of_files(&files, &custom_data))?;
    drop(is_ours);
    Ok(())
}

/// The writer, with the counts of messages that it may still lose.
struct PartsWriter<'a> {
    shared: &'a SharedState,
    parts: Parts<'a>,
    /// Messages in all files.
    written: u64,
    /// The same by channel.
    written_of: BTreeMap<ChannelIndex, u64>,
    /// Messages in the open chunk, by channel; some may be in the file already.
    unflushed: BTreeMap<ChannelIndex, u64>,
}

impl PartsWriter<'_> {
    fn batch(&mut self, batch: &WriteBatch) -> Result<(), BagWriteError> {
        for (index, command) in batch.commands.iter().enumerate() {
            // Flushed before messages: damage to messages must not lose definitions.
            self.shared.busy.begin();
            let next = batch.commands.get(index + 1);
            let ends_definitions = matches!(command, WriteCommand::Channel(_))
                && !matches!(next, Some(WriteCommand::Channel(_)));
            let written = self
                .command(command)
                .and_then(|()| if ends_definitions { self.flush() } else { Ok(()) });
            if let Err(error) = written {
                self.give_up(&batch.commands[index..]);
                return Err(error);
            }
        }
        self.shared.messages_written.store(self.written, Ordering::Relaxed);
        Ok(())
    }

    fn command(&mut self, command: &WriteCommand) -> Result<(), BagWriteError> {
        match command {
            WriteCommand::Channel(spec) => self.parts.add_channel(spec),
            WriteCommand::Message { channel, lost_before, log_time_ns, publish_time_ns, data } => {
                if self.parts.is_full() {
                    self.flush()?;
                    self.parts.go_on(*log_time_ns)?;
                }
                self.parts.skip(*channel, *lost_before)?;
                self.parts.write(*channel, *log_time_ns, *publish_time_ns, data)?;
                self.written += 1;
                *self.written_of.entry(*channel).or_default() += 1;
                *self.unflushed.entry(*channel).or_default() += 1;
                Ok(())
            }
            WriteCommand::Attachment(attachment) => self.parts.attach(attachment),
            WriteCommand::Metadata(name, values) => self.parts.write_metadata(name, values),
            WriteCommand::Begun => {
                self.flush()?;
                lock(&self.shared.end).has_begun = true;
                Ok(())
            }
        }
    }

    fn flush(&mut self) -> Result<(), BagWriteError> {
        let flushed = self.parts.flush();
        if flushed.is_err() {
            self.give_up(&[]);
        }
        self.unflushed.clear();
        flushed
    }

    /// Counts the messages of the open chunk and of the current batch as lost.
    fn give_up(&mut self, rest: &[WriteCommand]) {
        let mut gone = 0;
        for (channel, count) in std::mem::take(&mut self.unflushed) {
            self.shared.queue.lose(channel, count);
            gone += count;
        }
        let kept = self.written.saturating_sub(gone);
        self.shared.messages_written.store(kept, Ordering::Relaxed);
        rest.iter().for_each(|command| lose(self.shared, command));
    }
}

fn lose(shared: &SharedState, command: &WriteCommand) {
    if let WriteCommand::Message { channel, .. } = command {
        shared.queue.lose(*channel, 1);
    }
}

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A panic cannot leave a change under these locks half done.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
