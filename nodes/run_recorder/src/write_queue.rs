//! What waits to be written, between those who feed a bag and its write thread.
//!
//! Bounded in messages and bytes. Feeding never waits: what does not fit is
//! lost and counted, and leaves a gap in its channel's sequence numbers.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::bag_writer::{BagAttachment, ChannelIndex, ChannelSpec};

/// Commands the write thread takes at once, so that room comes back soon.
const BATCH: usize = 256;
/// What a waiting message takes beside its data, bytes, about.
const OVERHEAD: usize = 64;

/// How much may wait.
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
pub(crate) enum Command {
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
    /// All that came before is to be in the file, and to be told of.
    Begun,
}

impl Command {
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
struct State {
    commands: VecDeque<Command>,
    /// Of all that waits or is being written.
    bytes: usize,
    messages: usize,
    /// Not yet told by a later message of the channel.
    gaps: BTreeMap<ChannelIndex, u32>,
    lost: BTreeMap<ChannelIndex, u64>,
    /// Sent, and never come here.
    missed: BTreeMap<ChannelIndex, u64>,
    is_closed: bool,
}

/// What the write thread took.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    pub(crate) commands: Vec<Command>,
    /// Nothing more will come.
    pub(crate) is_last: bool,
    bytes: usize,
    messages: usize,
}

/// The queue of one bag.
#[derive(Debug, Default)]
pub(crate) struct WriteQueue {
    limits: QueueLimits,
    state: Mutex<State>,
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
        // The thread waits only where there is nothing; waking it for nothing costs the feeder.
        let is_awaited = state.commands.is_empty();
        state.messages += 1;
        state.bytes += size;
        state.commands.push_back(Command::Message {
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

    /// Puts in what must not be lost, whatever the limits. `false` once closed.
    pub(crate) fn put(&self, command: Command) -> bool {
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

    /// Takes some commands, after at most `wait` without any.
    pub(crate) fn take(&self, wait: Duration) -> Batch {
        let state = self.state();
        let (mut state, _) = self
            .filled
            .wait_timeout_while(state, wait, |state| state.commands.is_empty() && !state.is_closed)
            .unwrap_or_else(PoisonError::into_inner);
        let count = state.commands.len().min(BATCH);
        let commands: Vec<_> = state.commands.drain(..count).collect();
        let is_message = |command: &&Command| matches!(command, Command::Message { .. });
        Batch {
            is_last: state.is_closed && state.commands.is_empty(),
            bytes: commands.iter().map(Command::size).sum(),
            messages: commands.iter().filter(is_message).count(),
            commands,
        }
    }

    /// Gives back the room of a batch that is written.
    pub(crate) fn done(&self, batch: &Batch) {
        let mut state = self.state();
        state.bytes -= batch.bytes;
        state.messages -= batch.messages;
    }

    /// Counts messages as lost that were taken but could not be written.
    pub(crate) fn lose(&self, channel: ChannelIndex, count: u64) {
        *self.state().lost.entry(channel).or_default() += count;
    }

    /// Counts messages that were sent and did not come, before the next one that does.
    pub(crate) fn miss(&self, channel: ChannelIndex, count: u32) {
        let mut state = self.state();
        let gap = state.gaps.entry(channel).or_default();
        *gap = gap.saturating_add(count);
        *state.missed.entry(channel).or_default() += u64::from(count);
    }

    /// Messages that did not come, by channel.
    pub(crate) fn missed(&self) -> BTreeMap<ChannelIndex, u64> {
        self.state().missed.clone()
    }

    /// Lets nothing more in; what waits is still written.
    pub(crate) fn close(&self) {
        self.state().is_closed = true;
        self.filled.notify_all();
    }

    /// Messages lost, by channel.
    pub(crate) fn lost(&self) -> BTreeMap<ChannelIndex, u64> {
        self.state().lost.clone()
    }

    /// Whether less than half of what may wait does, or nothing will any more.
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

    fn state(&self) -> MutexGuard<'_, State> {
        // Every change is complete before anything could panic.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
