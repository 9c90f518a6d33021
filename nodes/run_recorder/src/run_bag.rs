//! The bag of one run: a directory, and the thread that writes it.
//!
//! Feeding never waits for the disk: messages that find no room are lost,
//! counted, and make the bag incomplete. The thread closes a chunk at least
//! once a second, so that a process that dies loses no more. Errors of the
//! disk are told by [`RunBag::status`], and what was flushed before them stays
//! readable. What to record, and when, is for the shell.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::bag_reader::{RESULT_RECORD, RUN_RECORD};
use crate::bag_writer::{
    BagAttachment, BagWriteError, BagWriter, ChannelIndex, ChannelSpec, check_spec,
};
use crate::files::{BagDirectory, write_metadata_file};
use crate::metadata::metadata_yaml;
use crate::recover::result_record;
pub use crate::write_queue::QueueLimits;
use crate::write_queue::{Batch, Command, WriteQueue};

/// How a run is recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunBagOptions {
    /// Where bags go; made if it is not there.
    pub directory: PathBuf,
    /// Name of the bag's directory in it, which must not be there yet.
    pub name: String,
    /// What the run is: run id, program id and checksum, firmware. Written as
    /// `cnc_run` at the start and as `custom_data` of metadata.yaml.
    pub run: BTreeMap<String, String>,
    /// How much may wait for the disk.
    pub limits: QueueLimits,
    /// Longest time between two closed chunks while messages come.
    pub flush_interval: Duration,
    /// Whether each flush goes through to the disk, against loss of power.
    pub syncs_each_flush: bool,
}

impl RunBagOptions {
    /// Half a second between flushes, each to the disk.
    pub fn new(directory: impl Into<PathBuf>, name: impl Into<String>) -> Self {
        Self {
            directory: directory.into(),
            name: name.into(),
            run: BTreeMap::new(),
            limits: QueueLimits::default(),
            flush_interval: Duration::from_millis(500),
            syncs_each_flush: true,
        }
    }
}

/// Why a run cannot be recorded.
#[derive(Debug, thiserror::Error)]
pub enum RunBagError {
    #[error("bag {path} is there already; bags are never overwritten")]
    Exists { path: String },
    #[error("bag {path} cannot be made: {cause}")]
    Create { path: String, cause: io::Error },
    #[error(transparent)]
    Channel(#[from] BagWriteError),
    #[error("the bag is closed or its disk failed; nothing more can be recorded to it")]
    Closed,
    #[error("a bag holds at most 65535 topics")]
    TooManyTopics,
}

/// How a recording stands.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RecordingStatus {
    /// The bag's directory.
    pub path: PathBuf,
    /// Messages in the file or its open chunk.
    pub messages_written: u64,
    /// Messages lost because the disk was too slow, full or broken.
    pub messages_lost: u64,
    /// The same by topic, those alone that lost any.
    pub lost_by_topic: BTreeMap<String, u64>,
    /// Size of the file so far.
    pub bytes_written: u64,
    /// Bytes that wait for the write thread.
    pub bytes_waiting: usize,
    /// The first error of the disk; nothing is written after it.
    pub error: Option<String>,
    /// The file is closed, with index, footer and metadata.yaml.
    pub is_finished: bool,
    /// Nothing is known to be missing.
    pub complete: bool,
    /// Why not.
    pub reasons: Vec<String>,
}

/// A bag that is being recorded. Dropping it finishes it too, but tells nobody how that went.
pub struct RunBag {
    shared: Arc<Shared>,
    known: Mutex<Known>,
}

impl fmt::Debug for RunBag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RunBag").field("path", &self.shared.path).finish_non_exhaustive()
    }
}

/// What has been announced, so that mistakes show where they are made.
#[derive(Default)]
struct Known {
    topics: BTreeSet<String>,
    definitions: BTreeMap<String, String>,
}

struct Shared {
    path: PathBuf,
    queue: WriteQueue,
    messages_written: AtomicU64,
    bytes_written: Arc<AtomicU64>,
    end: Mutex<End>,
    ended: Condvar,
}

#[derive(Default)]
struct End {
    topics: Vec<String>,
    noted: Vec<String>,
    error: Option<String>,
    is_over: bool,
    is_finished: bool,
}

impl RunBag {
    /// Makes the bag's directory and starts its write thread.
    pub fn create(options: RunBagOptions) -> Result<Self, RunBagError> {
        let path = options.directory.join(&options.name);
        let made = BagDirectory::create(&options.directory, &options.name).map_err(|cause| {
            let path = path.display().to_string();
            match cause.kind() {
                io::ErrorKind::AlreadyExists => RunBagError::Exists { path },
                _ => RunBagError::Create { path, cause },
            }
        })?;
        let io_error = |cause| RunBagError::Create { path: path.display().to_string(), cause };
        let for_sync = made.file.try_clone().map_err(io_error)?;
        let outlet = Outlet {
            sink: Box::new(BufWriter::new(made.file)),
            sync: Box::new(move || for_sync.sync_data()),
            directory: made.directory,
            file_name: made.file_name,
        };
        Self::start(options, outlet)
    }

    fn start(options: RunBagOptions, outlet: Outlet) -> Result<Self, RunBagError> {
        let shared = Arc::new(Shared {
            path: outlet.directory.clone(),
            queue: WriteQueue::new(options.limits),
            messages_written: AtomicU64::new(0),
            bytes_written: Arc::default(),
            end: Mutex::default(),
            ended: Condvar::new(),
        });
        let for_thread = shared.clone();
        thread::Builder::new()
            .name("bag_writer".to_owned())
            .spawn(move || run(&for_thread, &options, outlet))
            .map_err(|cause| RunBagError::Create {
                path: shared.path.display().to_string(),
                cause,
            })?;
        Ok(Self { shared, known: Mutex::default() })
    }

    /// The bag's directory.
    pub fn path(&self) -> &Path {
        &self.shared.path
    }

    /// Adds a topic.
    pub fn add_channel(&self, spec: &ChannelSpec) -> Result<ChannelIndex, RunBagError> {
        check_spec(spec)?;
        let mut known = lock(&self.known);
        if known.topics.contains(&spec.topic) {
            return Err(BagWriteError::TopicTwice(spec.topic.clone()).into());
        }
        if let Some(text) = known.definitions.get(&spec.type_name)
            && *text != spec.schema_text
        {
            return Err(BagWriteError::TypeTwice(spec.type_name.clone()).into());
        }
        let index = match u16::try_from(known.topics.len()) {
            Ok(index) if index < u16::MAX => ChannelIndex(index),
            _ => return Err(RunBagError::TooManyTopics),
        };
        // Still under the lock, so that the writer counts channels in the same order.
        if !self.shared.queue.put(Command::Channel(spec.clone())) {
            return Err(RunBagError::Closed);
        }
        known.topics.insert(spec.topic.clone());
        known.definitions.insert(spec.type_name.clone(), spec.schema_text.clone());
        lock(&self.shared.end).topics.push(spec.topic.clone());
        Ok(index)
    }

    /// Hands over one message: CDR with its four bytes of encapsulation, times
    /// in nanoseconds since the epoch. Never waits; `false` if it is lost.
    pub fn write(
        &self,
        channel: ChannelIndex,
        log_time_ns: u64,
        publish_time_ns: u64,
        data: Vec<u8>,
    ) -> bool {
        let queue = &self.shared.queue;
        queue.put_message(channel, log_time_ns, publish_time_ns, data)
    }

    /// Puts a file into the bag: the program, the parameters, the tool table.
    pub fn attach(&self, attachment: BagAttachment) -> Result<(), RunBagError> {
        self.put(Command::Attachment(attachment))
    }

    /// Puts a record of keys and values into the bag.
    pub fn write_metadata(
        &self,
        name: &str,
        values: BTreeMap<String, String>,
    ) -> Result<(), RunBagError> {
        self.put(Command::Metadata(name.to_owned(), values))
    }

    /// Notes that something is missing that only the caller knows of, and why.
    pub fn note_incomplete(&self, reason: impl Into<String>) {
        let reason = reason.into();
        let mut end = lock(&self.shared.end);
        if !end.noted.contains(&reason) {
            end.noted.push(reason);
        }
    }

    /// How the recording stands.
    pub fn status(&self) -> RecordingStatus {
        self.shared.status()
    }

    /// Writes what waits, closes the file and writes metadata.yaml.
    ///
    /// Waits at most `deadline`; the thread goes on by itself if that is over before.
    pub fn finish(self, deadline: Duration) -> RecordingStatus {
        self.shared.queue.close();
        let end = lock(&self.shared.end);
        let (end, _) = self
            .shared
            .ended
            .wait_timeout_while(end, deadline, |end| !end.is_over)
            .unwrap_or_else(PoisonError::into_inner);
        let is_over = end.is_over;
        drop(end);
        let mut status = self.shared.status();
        if !is_over {
            status.complete = false;
            let reason = format!("the bag was not closed within {} s", deadline.as_secs_f64());
            status.reasons.push(reason);
        }
        status
    }

    fn put(&self, command: Command) -> Result<(), RunBagError> {
        let is_in = self.shared.queue.put(command);
        is_in.then_some(()).ok_or(RunBagError::Closed)
    }
}

impl Drop for RunBag {
    fn drop(&mut self) {
        self.shared.queue.close();
    }
}

impl Shared {
    fn status(&self) -> RecordingStatus {
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
            is_finished: end.is_finished,
            complete: reasons.is_empty(),
            reasons,
        }
    }
}

/// Where the bytes go.
struct Outlet {
    sink: Box<dyn Write + Send>,
    sync: Box<dyn Fn() -> io::Result<()> + Send>,
    directory: PathBuf,
    file_name: String,
}

/// The write thread.
fn run(shared: &Shared, options: &RunBagOptions, outlet: Outlet) {
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

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Every change under these locks is complete before anything could panic.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bag_reader::Bag;
    use crate::files::open_bag;
    use crate::qos::QosProfile;
    use std::io::Cursor;

    const LONG: Duration = Duration::from_secs(60);

    fn spec(topic: &str) -> ChannelSpec {
        ChannelSpec {
            topic: topic.into(),
            type_name: "std_msgs/msg/UInt8".into(),
            schema_text: "uint8 data\n".into(),
            type_hash: String::new(),
            qos: vec![QosProfile::reliable(10)],
        }
    }

    /// A bag whose disk fails after `room` bytes, or blocks while `gate` is held.
    fn bag_on(
        directory: &Path,
        room: usize,
        gate: Arc<Mutex<Vec<u8>>>,
        limits: QueueLimits,
    ) -> RunBag {
        struct Disk(usize, Arc<Mutex<Vec<u8>>>);
        impl Write for Disk {
            fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
                let mut content = lock(&self.1);
                let fits = buf.len().min(self.0);
                self.0 -= fits;
                if fits == 0 {
                    return Err(io::ErrorKind::StorageFull.into());
                }
                content.extend(&buf[..fits]);
                Ok(fits)
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let mut options = RunBagOptions::new(directory, "r");
        options.limits = limits;
        options.flush_interval = Duration::from_millis(1);
        let outlet = Outlet {
            sink: Box::new(Disk(room, gate)),
            sync: Box::new(|| Ok(())),
            directory: directory.to_owned(),
            file_name: "r_0.mcap".into(),
        };
        RunBag::start(options, outlet).unwrap()
    }

    #[test]
    fn a_run_is_a_directory_with_a_finished_file_and_metadata() {
        let parent = tempfile::tempdir().unwrap();
        let mut options = RunBagOptions::new(parent.path().join("bags"), "run_1");
        options.run.insert("run_id".into(), "run_1".into());
        let bag = RunBag::create(options.clone()).unwrap();
        let a = bag.add_channel(&spec("/a")).unwrap();
        let b = bag.add_channel(&spec("/b")).unwrap();
        bag.attach(BagAttachment {
            name: "program.mpf".into(),
            media_type: "text/plain".into(),
            log_time_ns: 1,
            data: b"M30".to_vec(),
        })
        .unwrap();
        for i in 0..1000 {
            let channel = if i % 4 == 0 { a } else { b };
            assert!(bag.write(channel, i, i, vec![0, 1, 0, 0, i as u8]));
        }
        let path = bag.path().to_owned();
        let status = bag.finish(LONG);
        assert_eq!((status.complete, status.is_finished), (true, true), "{status:?}");
        assert_eq!(status.messages_written, 1000);
        let size = std::fs::metadata(path.join("run_1_0.mcap")).unwrap().len();
        assert_eq!(status.bytes_written, size);
        assert!(!path.join("metadata.yaml.tmp").exists());

        let mut read = open_bag(&path).unwrap();
        assert_eq!(read.problems(), []);
        assert_eq!(read.messages().count(), 1000);
        assert_eq!(read.channels()[0].message_count, 250);
        assert_eq!(read.attachments()[0].name, "program.mpf");
        assert_eq!(read.metadata_named("cnc_run").unwrap()["run_id"], "run_1");
        assert_eq!(read.metadata_named("cnc_run_result").unwrap()["complete"], "true");

        let error = RunBag::create(options).unwrap_err();
        assert!(matches!(error, RunBagError::Exists { .. }), "{error}");
    }

    #[test]
    fn what_was_written_is_readable_while_the_run_goes_on() {
        let parent = tempfile::tempdir().unwrap();
        let mut options = RunBagOptions::new(parent.path(), "r");
        options.flush_interval = Duration::from_millis(5);
        let bag = RunBag::create(options).unwrap();
        let a = bag.add_channel(&spec("/a")).unwrap();
        assert!(bag.write(a, 1, 1, vec![0, 1, 0, 0, 7]));
        let given_up = Instant::now() + LONG;
        let mut read = 0;
        while read == 0 && Instant::now() < given_up {
            thread::sleep(Duration::from_millis(5));
            if let Ok(mut now) = open_bag(bag.path()) {
                assert!(!now.is_complete());
                read = now.messages().count();
            }
        }
        assert_eq!(read, 1);
        assert!(bag.finish(LONG).complete);
    }

    #[test]
    fn a_slow_disk_loses_messages_but_never_holds_the_feeder() {
        let directory = tempfile::tempdir().unwrap();
        let gate: Arc<Mutex<Vec<u8>>> = Arc::default();
        let held = lock(&gate);
        let limits = QueueLimits { messages: 10, bytes: 1 << 20 };
        let bag = bag_on(directory.path(), usize::MAX, gate.clone(), limits);
        let a = bag.add_channel(&spec("/a")).unwrap();
        let taken = (0..100).filter(|i| bag.write(a, *i, 0, vec![0; 5])).count();
        assert_eq!(taken, 10);
        let status = bag.status();
        assert_eq!(status.messages_lost, 90);
        assert_eq!(status.lost_by_topic["/a"], 90);
        assert!(!status.complete);
        drop(held);
        let status = bag.finish(LONG);
        assert!(status.is_finished && !status.complete, "{status:?}");
        assert_eq!(status.messages_written, 10);
        assert!(status.reasons[0].contains("90 messages of /a"), "{status:?}");
    }

    #[test]
    fn the_queue_is_bounded_in_bytes_too() {
        let directory = tempfile::tempdir().unwrap();
        let gate: Arc<Mutex<Vec<u8>>> = Arc::default();
        let held = lock(&gate);
        let limits = QueueLimits { messages: 1000, bytes: 10_000 };
        let bag = bag_on(directory.path(), usize::MAX, gate.clone(), limits);
        let a = bag.add_channel(&spec("/a")).unwrap();
        let taken = (0..100).filter(|i| bag.write(a, *i, 0, vec![0; 1000])).count();
        assert_eq!(taken, 9);
        assert!(bag.status().bytes_waiting <= 10_000);
        drop(held);
        bag.finish(LONG);
    }

    #[test]
    fn a_full_disk_is_told_and_every_message_accounted_for() {
        let directory = tempfile::tempdir().unwrap();
        let limits = QueueLimits::default();
        let disk: Arc<Mutex<Vec<u8>>> = Arc::default();
        let bag = bag_on(directory.path(), 5000, disk.clone(), limits);
        let a = bag.add_channel(&spec("/a")).unwrap();
        let given_up = Instant::now() + LONG;
        let mut fed = 0;
        while bag.status().error.is_none() && Instant::now() < given_up {
            bag.write(a, fed, 0, vec![0; 100]);
            fed += 1;
        }
        assert!(!bag.write(a, fed, 0, vec![0; 100]));
        fed += 1;
        assert!(matches!(bag.add_channel(&spec("/b")), Err(RunBagError::Closed)));
        let status = bag.finish(LONG);
        assert!(status.error.is_some() && !status.complete && !status.is_finished);
        assert_eq!(status.messages_written + status.messages_lost, fed);
        let bytes = lock(&disk).clone();
        let mut read = Bag::open("r_0.mcap", Cursor::new(bytes)).unwrap();
        assert!(read.messages().count() as u64 >= status.messages_written);
    }

    #[test]
    fn a_gap_that_the_caller_knows_of_makes_the_bag_incomplete() {
        let parent = tempfile::tempdir().unwrap();
        let bag = RunBag::create(RunBagOptions::new(parent.path(), "r")).unwrap();
        bag.note_incomplete("controller_traffic 17 to 20 could not be fetched");
        let path = bag.path().to_owned();
        assert!(!bag.finish(LONG).complete);
        let read = open_bag(&path).unwrap();
        assert!(!read.is_complete());
        let problem = read.problems()[0].to_string();
        assert!(problem.contains("controller_traffic 17 to 20"), "{problem}");
    }
}
