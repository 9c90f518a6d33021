//! The bag of one run: a directory, and the thread that writes it.
//!
//! Feeding never waits for the disk: messages that find no room are lost,
//! counted, and make the bag incomplete. The thread closes a chunk at least
//! once a second, so that a process that dies loses no more. Errors of the
//! disk are told by [`RunBag::status`], and what was flushed before them stays
//! readable. What to record, and when, is for the shell.

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
use crate::write_queue::{Command, WriteQueue};
use crate::write_thread::{Busy, Shared, lock, run};

/// How long a disk may take to make a directory and a file.
const CREATE_WITHIN: Duration = Duration::from_secs(1);

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
    /// When it goes on in another file.
    pub split: SplitLimits,
}

impl RunBagOptions {
    /// Half a second between flushes, each to the disk; one file.
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
    /// Messages that were sent and did not come, by topic, those alone that miss any.
    pub missed_by_topic: BTreeMap<String, u64>,
    /// Size of the file so far.
    pub bytes_written: u64,
    /// Bytes that wait for the write thread.
    pub bytes_waiting: usize,
    /// The first error of the disk; nothing is written after it.
    pub error: Option<String>,
    /// What was there before [`RunBag::begin`] is in the file.
    pub has_begun: bool,
    /// The disk has taken nothing for some seconds, though there is something for it.
    pub is_stalled: bool,
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

/// The directory of a bag and its first file.
fn outlet(directory: &Path, name: &str) -> io::Result<Outlet> {
    let made = BagDirectory::create(directory, name)?;
    let first = made.part(0)?;
    let directory = made.directory.clone();
    Ok(Outlet { directory, first, next: Box::new(move |part| made.part(part)) })
}

/// What `make` makes, on a thread of its own, unless that takes too long; what comes too late
/// is undone.
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
        let shared = Arc::new(Shared {
            path: outlet.directory.clone(),
            queue: WriteQueue::new(options.limits),
            messages_written: AtomicU64::new(0),
            bytes_written: Arc::default(),
            busy: Busy::default(),
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

    /// Notes that messages of a channel were sent and did not come, before the next that does.
    ///
    /// The bag is complete all the same: whoever sends decides what is sent again. They leave a
    /// gap in the channel's numbers, and are counted where the bag is closed.
    pub fn note_missed(&self, channel: ChannelIndex, count: u32) {
        self.shared.queue.miss(channel, count);
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

    /// Has all that was handed over written now; the status tells when it is, or why not.
    pub fn begin(&self) -> Result<(), RunBagError> {
        self.put(Command::Begun)
    }

    /// Notes that something is missing that only the caller knows of, and why.
    pub fn note_incomplete(&self, reason: impl Into<String>) {
        let reason = reason.into();
        let mut end = lock(&self.shared.end);
        if !end.noted.contains(&reason) {
            end.noted.push(reason);
        }
    }

    /// Whether less waits for the disk than half of what may; also when nothing is written
    /// any more. Who can wait does well to wait for it.
    pub fn has_room(&self) -> bool {
        self.shared.queue.has_room()
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
        if !is_over {
            // Also for the thread, which may close the bag later.
            let seconds = deadline.as_secs_f64();
            self.note_incomplete(format!("the bag was not closed within {seconds} s"));
        }
        self.shared.status()
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

#[cfg(test)]
mod tests;
