//! The thread that writes the bag of a run.
//!
//! Takes what waits in [`crate::write_queue`], closes a chunk in time, and
//! counts what a failing disk took along. [`crate::run_bag`] is its face.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::bag_reader::{RESULT_RECORD, RUN_RECORD};
use crate::bag_writer::{BagWriteError, BagWriter, ChannelIndex};
use crate::files::write_metadata_file;
use crate::metadata::metadata_yaml;
use crate::recover::result_record;
use crate::run_bag::{RecordingStatus, RunBagOptions};
use crate::write_queue::{Batch, Command, WriteQueue};

/// What the thread and [`crate::run_bag::RunBag`] both see.
pub(crate) struct Shared {
    pub(crate) path: PathBuf,
    pub(crate) queue: WriteQueue,
    pub(crate) messages_written: AtomicU64,
    pub(crate) bytes_written: Arc<AtomicU64>,
    pub(crate) end: Mutex<End>,
    pub(crate) ended: Condvar,
}

/// How it stands with the thread.
#[derive(Default)]
pub(crate) struct End {
    pub(crate) topics: Vec<String>,
    pub(crate) noted: Vec<String>,
    pub(crate) error: Option<String>,
    pub(crate) has_begun: bool,
    pub(crate) is_over: bool,
    pub(crate) is_finished: bool,
}

impl Shared {
    pub(crate) fn status(&self) -> RecordingStatus {
        let lost = self.queue.lost();
        let end = lock(&self.end);
        let lost_by_topic: BTreeMap<String, u64> = lost
            .iter()
            .map(|(channel, count)| {
                let topic = end.topics.get(usize::from(channel.0)).cloned();
                (topic.unwrap_or_else(|| format!("channel {}", channel.0)), *count)
            })
            .collect();
        let mut reasons = end.noted.clone();
        reasons.extend(end.error.clone());
        reasons.extend(lost_by_topic.iter().map(|(topic, count)| {
            format!(
                "{count} messages of {topic} were lost: they came faster than they could be written"
            )
        }));
        RecordingStatus {
            path: self.path.clone(),
            messages_written: self.messages_written.load(Ordering::Relaxed),
            messages_lost: lost.values().sum(),
            lost_by_topic,
            bytes_written: self.bytes_written.load(Ordering::Relaxed),
            bytes_waiting: self.queue.waiting_bytes(),
            error: end.error.clone(),
            has_begun: end.has_begun,
            is_finished: end.is_finished,
            complete: reasons.is_empty(),
            reasons,
        }
    }
}

/// Where the bytes go.
pub(crate) struct Outlet {
    pub(crate) sink: Box<dyn Write + Send>,
    pub(crate) sync: Box<dyn Fn() -> io::Result<()> + Send>,
    pub(crate) directory: PathBuf,
    pub(crate) file_name: String,
}

/// The write thread.
pub(crate) fn run(shared: &Shared, options: &RunBagOptions, outlet: Outlet) {
    let _over = Over(shared);
    match write_bag(shared, options, outlet) {
        Ok(()) => lock(&shared.end).is_finished = true,
        Err(error) => {
            lock(&shared.end).error.get_or_insert(error.to_string());
            // Nothing more goes in; what waits and what comes is counted.
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

/// Tells those who wait that the thread is over, even if it panics.
struct Over<'a>(&'a Shared);

impl Drop for Over<'_> {
    fn drop(&mut self) {
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
    shared: &Shared,
    options: &RunBagOptions,
    outlet: Outlet,
) -> Result<(), BagWriteError> {
    let mut pen = Pen {
        shared,
        writer: BagWriter::new(Counted { sink: outlet.sink, bytes: shared.bytes_written.clone() })?,
        unflushed: BTreeMap::new(),
    };
    let interval = options.flush_interval;
    pen.writer.write_metadata(RUN_RECORD, &options.run)?;
    pen.flush()?;
    let mut oldest_unflushed: Option<Instant> = None;
    loop {
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
            pen.flush()?;
            if options.syncs_each_flush {
                (outlet.sync)()?;
            }
            oldest_unflushed = None;
        }
        if batch.is_last {
            break;
        }
    }
    pen.flush()?;
    let status = shared.status();
    let mut result = result_record(status.complete, &status.reasons);
    result.insert("messages_lost".to_owned(), status.messages_lost.to_string());
    pen.writer.write_metadata(RESULT_RECORD, &result)?;
    let mut custom_data = options.run.clone();
    custom_data.insert("complete".to_owned(), status.complete.to_string());
    let (mut sink, summary) = pen.writer.finish(&outlet.file_name, &custom_data)?;
    sink.flush()?;
    (outlet.sync)()?;
    let text = metadata_yaml(&summary, &outlet.file_name, &custom_data);
    write_metadata_file(&outlet.directory, &text)?;
    Ok(())
}

/// The writer, and what it may still lose.
struct Pen<'a, W: Write> {
    shared: &'a Shared,
    writer: BagWriter<W>,
    /// Messages in the open chunk, by channel; some may be in the file already.
    unflushed: BTreeMap<ChannelIndex, u64>,
}

impl<W: Write> Pen<'_, W> {
    fn batch(&mut self, batch: &Batch) -> Result<(), BagWriteError> {
        for (index, command) in batch.commands.iter().enumerate() {
            // Definitions go out before messages: a damaged chunk must not take them along.
            let next = batch.commands.get(index + 1);
            let ends_definitions = matches!(command, Command::Channel(_))
                && !matches!(next, Some(Command::Channel(_)));
            let written = self
                .command(command)
                .and_then(|()| if ends_definitions { self.flush() } else { Ok(()) });
            if let Err(error) = written {
                self.give_up(&batch.commands[index..]);
                return Err(error);
            }
        }
        let written = self.writer.message_count();
        self.shared.messages_written.store(written, Ordering::Relaxed);
        Ok(())
    }

    fn command(&mut self, command: &Command) -> Result<(), BagWriteError> {
        match command {
            Command::Channel(spec) => self.writer.add_channel(spec).map(|_| ()),
            Command::Message { channel, lost_before, log_time_ns, publish_time_ns, data } => {
                self.writer.skip(*channel, *lost_before)?;
                self.writer.write(*channel, *log_time_ns, *publish_time_ns, data)?;
                *self.unflushed.entry(*channel).or_default() += 1;
                Ok(())
            }
            Command::Attachment(attachment) => self.writer.attach(attachment),
            Command::Metadata(name, values) => self.writer.write_metadata(name, values),
            Command::Begun => {
                self.flush()?;
                lock(&self.shared.end).has_begun = true;
                Ok(())
            }
        }
    }

    fn flush(&mut self) -> Result<(), BagWriteError> {
        let flushed = self.writer.flush();
        if flushed.is_err() {
            self.give_up(&[]);
        }
        self.unflushed.clear();
        flushed
    }

    /// Counts as lost what went down with the open chunk, and what was still in hand.
    fn give_up(&mut self, rest: &[Command]) {
        let mut gone = 0;
        for (channel, count) in std::mem::take(&mut self.unflushed) {
            self.shared.queue.lose(channel, count);
            gone += count;
        }
        let kept = self.writer.message_count().saturating_sub(gone);
        self.shared.messages_written.store(kept, Ordering::Relaxed);
        rest.iter().for_each(|command| lose(self.shared, command));
    }
}

fn lose(shared: &Shared, command: &Command) {
    if let Command::Message { channel, .. } = command {
        shared.queue.lose(*channel, 1);
    }
}

/// Counts the bytes that pass.
struct Counted {
    sink: Box<dyn Write + Send>,
    bytes: Arc<AtomicU64>,
}

impl Write for Counted {
    fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
        let written = self.sink.write(buf)?;
        self.bytes.fetch_add(written as u64, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.sink.flush()
    }
}

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Every change under these locks is complete before anything could panic.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
