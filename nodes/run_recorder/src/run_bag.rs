//! The bag of one run: a directory, and the thread that writes it.
//!
//! Writing to the queue never waits for the disk: messages that do not fit are lost,
//! counted, and make the bag incomplete. The thread closes a chunk at least
//! once a second, so that a process that dies loses no more. [`RunBag::status`] reports
//! errors of the disk; messages that were flushed before stay readable. The node decides
//! what to record, and when.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Condvar, Mutex, PoisonError, mpsc};
use std::thread;
use std::time::Duration;

use crate::bag_writer::{BagAttachment, BagWriteError, ChannelIndex, ChannelSpec, check_spec};
use crate::files::BagDirectory;
use crate::parts::Outlet;
pub use crate::split::SplitLimits;
pub use crate::write_queue::QueueLimits;
use crate::write_queue::{WriteCommand, WriteQueue};
use crate::write_thread::{BusySince, SharedState, lock, run};

/// How long a disk may take to make a directory and a file.
const CREATE_WITHIN: Duration = Duration::from_secs(1);

/// How a run is recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunBagOptions {
    /// The directory of bags; made if it does not exist.
    pub directory: PathBuf,
    /// Name of the bag's directory in it, which must not exist yet.
    pub name: String,
    /// The identity of the run: run id, program id and checksum, firmware. Written as
    /// `cnc_run` at the start and as `custom_data` of metadata.yaml.
    pub run: BTreeMap<String, String>,
    /// The limits of the write queue.
    pub limits: QueueLimits,
    /// Longest time between two closed chunks while messages come.
    pub flush_interval: Duration,
    /// Whether each flush is synced to the disk, in case of a power failure.
    pub syncs_each_flush: bool,
    /// When the bag is split into another file.
    pub split: SplitLimits,
}

impl RunBagOptions {
    /// Half a second between flushes, each synced to the disk; one file.
    pub fn new(directory: impl Into<PathBuf>, name: impl Into<String>) -> Self {
        Self {
            directory: directory.into(),
            name: name.into(),
            run: BTreeMap::new(),
            limits: QueueLimits::default(),
            flush_interval: Duration::from_millis(500),
            syncs_each_flush: true,
            split: SplitLimits::default(),
        }
    }

    /// The bag's directory, to be shown.
    pub(crate) fn path(&self) -> String {
        self.directory.join(&self.name).display().to_string()
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

/// The status of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RecordingStatus {
    /// The bag's directory.
    pub path: PathBuf,
    /// Messages in the file or its open chunk.
    pub messages_written: u64,
    /// Messages lost because the disk was too slow, full or broken.
    pub messages_lost: u64,
    /// The same by topic; only topics that lost any.
    pub lost_by_topic: BTreeMap<String, u64>,
    /// Messages that were sent but did not arrive, by topic; only topics that miss any.
    pub missed_by_topic: BTreeMap<String, u64>,
    /// Size of the file so far.
    pub bytes_written: u64,
    /// Bytes that wait for the write thread.
    pub bytes_waiting: usize,
    /// The first error of the disk; nothing is written after it.
    pub error: Option<String>,
    /// Everything from before [`RunBag::begin`] is in the file.
    pub has_begun: bool,
    /// The disk has accepted nothing for some seconds, although data is waiting.
    pub is_stalled: bool,
    /// The file is closed, with index, footer and metadata.yaml.
    pub is_finished: bool,
    /// Nothing is known to be missing.
    pub complete: bool,
    /// Why not.
    pub reasons: Vec<String>,
}

/// A bag that is being recorded. Dropping it finishes it too, but reports no errors.
pub struct RunBag {
    shared: Arc<SharedState>,
    known: Mutex<Known>,
}

impl fmt::Debug for RunBag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RunBag").field("path", &self.shared.path).finish_non_exhaustive()
    }
}

/// The topics so far, so that a mistake is an error in the call that makes it.
#[derive(Default)]
struct Known {
    topics: BTreeSet<String>,
    definitions: BTreeMap<String, String>,
}

/// The directory of a bag and its first file.
fn outlet(directory: &Path, name: &str) -> io::Result<Outlet> {
    let made = BagDirectory::create(directory, name)?;
    let first = made.part(0)?;
    let directory = made.directory.clone();
    Ok(Outlet { directory, first, next: Box::new(move |part| made.part(part)) })
}

/// Calls `make` on a thread of its own, with a timeout. If it finishes later, the result is
/// removed.
fn within<T: Send + 'static>(
    deadline: Duration,
    make: impl FnOnce() -> io::Result<T> + Send + 'static,
    undo: impl FnOnce(T) + Send + 'static,
) -> io::Result<T> {
    let (hand_over, made) = mpsc::sync_channel(0);
    thread::Builder::new().name("bag_maker".to_owned()).spawn(move || {
        if let Err(mpsc::SendError(Ok(late))) = hand_over.send(make()) {
            undo(late);
        }
    })?;
    made.recv_timeout(deadline).unwrap_or_else(|_| {
        let text = format!("the disk has not answered for {deadline:?}");
        Err(io::Error::new(io::ErrorKind::TimedOut, text))
    })
}

impl RunBag {
    /// Makes the bag's directory and starts its write thread. Waits for the disk, for a
    /// second at most.
    pub fn create(options: RunBagOptions) -> Result<Self, RunBagError> {
        let path = options.path();
        let (directory, name) = (options.directory.clone(), options.name.clone());
        let made = within(CREATE_WITHIN, move || outlet(&directory, &name), Outlet::remove);
        let outlet = made.map_err(|cause| match cause.kind() {
            io::ErrorKind::AlreadyExists => RunBagError::Exists { path },
            _ => RunBagError::Create { path, cause },
        })?;
        Self::start(options, outlet)
    }

    fn start(options: RunBagOptions, outlet: Outlet) -> Result<Self, RunBagError> {
        let shared = Arc::new(SharedState {
            path: outlet.directory.clone(),
            queue: WriteQueue::new(options.limits),
            messages_written: AtomicU64::new(0),
            bytes_written: Arc::default(),
            busy: BusySince::default(),
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
        // Under the lock, so that the writer numbers channels in the same order.
        if !self.shared.queue.put(WriteCommand::Channel(spec.clone())) {
            return Err(RunBagError::Closed);
        }
        known.topics.insert(spec.topic.clone());
        known.definitions.insert(spec.type_name.clone(), spec.schema_text.clone());
        lock(&self.shared.end).topics.push(spec.topic.clone());
        Ok(index)
    }

    /// Queues one message: CDR with its four bytes of encapsulation, times
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

    /// Counts messages of a channel that were sent but did not arrive before the next one.
    ///
    /// The bag still counts as complete: the sender decides what is sent again. The missed
    /// messages leave a gap in the channel's numbers, and are counted when the bag is closed.
    pub fn note_missed(&self, channel: ChannelIndex, count: u32) {
        self.shared.queue.miss(channel, count);
    }

    /// Puts a file into the bag: the program, the parameters, the tool table.
    pub fn attach(&self, attachment: BagAttachment) -> Result<(), RunBagError> {
        self.put(WriteCommand::Attachment(attachment))
    }

    /// Puts a record of keys and values into the bag.
    pub fn write_metadata(
        &self,
        name: &str,
        values: BTreeMap<String, String>,
    ) -> Result<(), RunBagError> {
        self.put(WriteCommand::Metadata(name.to_owned(), values))
    }

    /// Requests a flush of all messages; the status shows when it is done, or the error.
    pub fn begin(&self) -> Result<(), RunBagError> {
        self.put(WriteCommand::Begun)
    }

    /// Marks the bag as incomplete for a reason that only the caller knows.
    pub fn note_incomplete(&self, reason: impl Into<String>) {
        let reason = reason.into();
        let mut end = lock(&self.shared.end);
        if !end.noted.contains(&reason) {
            end.noted.push(reason);
        }
    }

    /// Whether the queue is less than half full, or nothing more is written. A caller that can
    /// wait should wait for this.
    pub fn has_room(&self) -> bool {
        self.shared.queue.has_room()
    }

    /// The status of the recording.
    pub fn status(&self) -> RecordingStatus {
        self.shared.status()
    }

    /// Writes the queue, closes the file and writes metadata.yaml.
    ///
    /// Waits at most `deadline`; after that the thread continues by itself.
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
        if !is_over {
            // The thread needs it too, as it may close the bag later.
            let seconds = deadline.as_secs_f64();
            self.note_incomplete(format!("the bag was not closed within {seconds} s"));
        }
        self.shared.status()
    }

    fn put(&self, command: WriteCommand) -> Result<(), RunBagError> {
        let is_in = self.shared.queue.put(command);
        is_in.then_some(()).ok_or(RunBagError::Closed)
    }
}

impl Drop for RunBag {
    fn drop(&mut self) {
        self.shared.queue.close();
    }
}

#[cfg(test)]
mod tests;
