//! The bag of one run: a directory, and the thread that writes it.
//!
//! Feeding never waits for the disk: messages that find no room are lost,
//! counted, and make the bag incomplete. The thread closes a chunk at least
//! once a second, so that a process that dies loses no more. Errors of the
//! disk are told by [`RunBag::status`], and what was flushed before them stays
//! readable. What to record, and when, is for the shell.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use crate::bag_writer::{BagAttachment, BagWriteError, ChannelIndex, ChannelSpec, check_spec};
use crate::files::BagDirectory;
pub use crate::write_queue::QueueLimits;
use crate::write_queue::{Command, WriteQueue};
use crate::write_thread::{Outlet, Shared, lock, run};

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
    /// What was there before [`RunBag::begin`] is in the file.
    pub has_begun: bool,
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

#[cfg(test)]
mod tests;
