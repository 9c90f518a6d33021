//! The write queue of a bag.
//!
//! Bounded in messages and bytes. Writing to it never blocks: a message that does not fit
//! is lost and counted, and leaves a gap in its channel's sequence numbers.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::bag_writer::{BagAttachment, ChannelIndex, ChannelSpec};

/// Commands that the write thread takes at once; few, so that room is free again soon.
const BATCH: usize = 256;
/// Bytes of a waiting message besides its data, about.
const OVERHEAD: usize = 64;

/// The limits of the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QueueLimits {
    /// Messages.
    pub messages: usize,
    /// Bytes of messages, some overhead included.
    pub bytes: usize,
}

impl Default for QueueLimits {
    /// About 6 s at 10 000 messages/s.
    fn default() -> Self {
        Self { messages: 65_536, bytes: 64 * 1024 * 1024 }
    }
}

/// Something to write.
#[derive(Debug)]
pub(crate) enum WriteCommand {
    Channel(ChannelSpec),
    Message {
        channel: ChannelIndex,
        /// Messages of the channel lost before this one.
        lost_before: u32,
        log_time_ns: u64,
        publish_time_ns: u64,
        data: Vec<u8>,
    },
    Attachment(BagAttachment),
    Metadata(String, BTreeMap<String, String>),
    /// Everything before this has to be written, and the status has to show it.
    Begun,
}

impl WriteCommand {
    fn size(&self) -> usize {
        OVERHEAD
            + match self {
                Self::Message { data, .. } => data.len(),
                Self::Attachment(attachment) => attachment.data.len(),
                Self::Channel(spec) => spec.schema_text.len(),
                Self::Metadata(..) | Self::Begun => 0,
            }
    }
}

#[derive(Debug, Default)]
struct QueueState {
    commands: VecDeque<WriteCommand>,
    /// Bytes that wait or are being written.
    bytes: usize,
    messages: usize,
    /// Not yet passed on with a later message of the channel.
    gaps: BTreeMap<ChannelIndex, u32>,
    lost: BTreeMap<ChannelIndex, u64>,
    /// Sent, but never received.
    missed: BTreeMap<ChannelIndex, u64>,
    is_closed: bool,
}

/// A batch for the write thread.
#[derive(Debug, Default)]
pub(crate) struct WriteBatch {
    pub(crate) commands: Vec<WriteCommand>,
    /// The queue is closed and empty.
    pub(crate) is_last: bool,
    bytes: usize,
    messages: usize,
}

/// The queue of one bag.
#[derive(Debug, Default)]
pub(crate) struct WriteQueue {
    limits: QueueLimits,
    state: Mutex<QueueState>,
    filled: Condvar,
}

impl WriteQueue {
    pub(crate) fn new(limits: QueueLimits) -> Self {
        Self { limits, ..Self::default() }
    }

    /// Puts a message in; `false` if it did not fit and is lost.
    pub(crate) fn put_message(
        &self,
        channel: ChannelIndex,
        log_time_ns: u64,
        publish_time_ns: u64,
        data: Vec<u8>,
    ) -> bool {
        let mut state = self.state();
        let size = OVERHEAD + data.len();
        let has_room = !state.is_closed
            && state.messages < self.limits.messages
            && state.bytes.saturating_add(size) <= self.limits.bytes;
        if !has_room {
            *state.gaps.entry(channel).or_default() += 1;
            *state.lost.entry(channel).or_default() += 1;
            return false;
        }
        let lost_before = state.gaps.remove(&channel).unwrap_or(0);
        // The thread waits only if the queue is empty; other wake-ups would only cost time here.
        let is_awaited = state.commands.is_empty();
        state.messages += 1;
        state.bytes += size;
        state.commands.push_back(WriteCommand::Message {
            channel,
            lost_before,
            log_time_ns,
            publish_time_ns,
            data,
        });
        drop(state);
        if is_awaited {
            self.filled.notify_one();
        }
        true
    }

    /// Queues a command that must not be lost, ignoring the limits. `false` once closed.
    pub(crate) fn put(&self, command: WriteCommand) -> bool {
        let mut state = self.state();
        if state.is_closed {
            return false;
        }
        state.bytes += command.size();
        state.commands.push_back(command);
        drop(state);
        self.filled.notify_one();
        true
    }

    /// Takes some commands; waits at most `wait` for the first.
    pub(crate) fn take(&self, wait: Duration) -> WriteBatch {
        let state = self.state();
        let (mut state, _) = self
            .filled
            .wait_timeout_while(state, wait, |state| state.commands.is_empty() && !state.is_closed)
            .unwrap_or_else(PoisonError::into_inner);
        let count = state.commands.len().min(BATCH);
        let commands: Vec<_> = state.commands.drain(..count).collect();
        let is_message = |command: &&WriteCommand| matches!(command, WriteCommand::Message { .. });
        WriteBatch {
            is_last: state.is_closed && state.commands.is_empty(),
            bytes: commands.iter().map(WriteCommand::size).sum(),
            messages: commands.iter().filter(is_message).count(),
            commands,
        }
    }

    /// Frees the room of a batch that is written.
    pub(crate) fn done(&self, batch: &WriteBatch) {
        let mut state = self.state();
        state.bytes -= batch.bytes;
        state.messages -= batch.messages;
    }

    /// Counts messages as lost that were taken but could not be written.
    pub(crate) fn lose(&self, channel: ChannelIndex, count: u64) {
        *self.state().lost.entry(channel).or_default() += count;
    }

    /// Counts messages that were sent but not received, before the next one that is.
    pub(crate) fn miss(&self, channel: ChannelIndex, count: u32) {
        let mut state = self.state();
        let gap = state.gaps.entry(channel).or_default();
        *gap = gap.saturating_add(count);
        *state.missed.entry(channel).or_default() += u64::from(count);
    }

    /// Messages that were not received, by channel.
    pub(crate) fn missed(&self) -> BTreeMap<ChannelIndex, u64> {
        self.state().missed.clone()
    }

    /// Closes the queue; waiting commands are still written.
    pub(crate) fn close(&self) {
        self.state().is_closed = true;
        self.filled.notify_all();
    }

    /// Messages lost, by channel.
    pub(crate) fn lost(&self) -> BTreeMap<ChannelIndex, u64> {
        self.state().lost.clone()
    }

    /// Whether the queue is less than half full, or closed.
    pub(crate) fn has_room(&self) -> bool {
        let state = self.state();
        let is_under = |count: usize, most: usize| count <= most / 2;
        state.is_closed
            || is_under(state.bytes, self.limits.bytes)
                && is_under(state.messages, self.limits.messages)
    }

    /// Bytes that wait.
    pub(crate) fn waiting_bytes(&self) -> usize {
        self.state().bytes
    }

    fn state(&self) -> MutexGuard<'_, QueueState> {
        // A panic cannot leave a change half done.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
