//! When a bag is split into another file, and what that file repeats.
//!
//! Pure. A part begins with [`PART_RECORD`]; everything between it and
//! `cnc_run` is repeated from the parts before, so that a part can be read alone.
//! A reader of all parts leaves it out. `parts` opens and closes the files.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use crate::bag_writer::{ChannelIndex, ChannelSpec};

/// The metadata record that every file of a split bag begins with: `part`, from 0 on.
pub const PART_RECORD: &str = "cnc_run_part";
/// Key of the part's number in [`PART_RECORD`].
pub const PART_KEY: &str = "part";
/// Messages of one topic that are repeated, at most.
const REPEATED_MAX: usize = 64;

/// When a bag is split into another file; zero is never.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SplitLimits {
    /// Bytes of a file, without its index and perhaps one more message.
    pub size: u64,
    /// How long a file is written to.
    pub duration: Duration,
}

impl SplitLimits {
    /// Whether a bag is ever split.
    pub fn is_on(&self) -> bool {
        self.size > 0 || !self.duration.is_zero()
    }

    /// Whether the next message belongs to another file, by what this one holds.
    ///
    /// `size` counts the open chunk as if it did not compress. A file without
    /// a message of its own takes the next in any case.
    pub fn is_due(&self, messages: u64, size: u64, age: Duration) -> bool {
        messages > 0
            && (self.size > 0 && size >= self.size
                || !self.duration.is_zero() && age >= self.duration)
    }
}

/// The name of a bag's file.
pub fn part_file_name(bag: &str, part: usize) -> String {
    format!("{bag}_{part}.mcap")
}

/// A message that is repeated.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Repeated {
    pub channel: ChannelIndex,
    pub sequence: u32,
    pub publish_time_ns: u64,
    pub data: Vec<u8>,
}

/// The messages that a late joiner would get from each topic, for the next file.
#[derive(Debug, Default)]
pub struct LatchedMessages {
    /// How many messages of each latched topic are kept.
    depths: BTreeMap<ChannelIndex, usize>,
    newest: BTreeMap<ChannelIndex, VecDeque<Repeated>>,
}

impl LatchedMessages {
    /// Adds a topic; its QoS says how many messages its publishers keep for late joiners.
    pub fn add_channel(&mut self, channel: ChannelIndex, spec: &ChannelSpec) {
        let kept = |qos: &crate::qos::QosProfile| qos.depth_for_late_joiners();
        let depth: usize = spec.qos.iter().map(kept).fold(0, usize::saturating_add);
        if depth > 0 {
            self.depths.insert(channel, depth.min(REPEATED_MAX));
        }
    }

    /// Keeps a message, if its topic is latched.
    pub fn note(
        &mut self,
        channel: ChannelIndex,
        sequence: u32,
        publish_time_ns: u64,
        data: &[u8],
    ) {
        let Some(depth) = self.depths.get(&channel) else { return };
        let newest = self.newest.entry(channel).or_default();
        newest.push_back(Repeated { channel, sequence, publish_time_ns, data: data.to_vec() });
        while newest.len() > *depth {
            newest.pop_front();
        }
    }

    /// The messages that the next file repeats, by topic and in their order.
    pub fn iter(&self) -> impl Iterator<Item = &Repeated> {
        self.newest.values().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::qos::QosProfile;

    #[test]
    fn a_file_is_full_by_size_or_by_time_and_never_without_a_message() {
        const MB: u64 = 1_000_000;
        let limits = |size, seconds| SplitLimits { size, duration: Duration::from_secs(seconds) };
        // limits, messages, bytes, age in seconds, due
        let table = [
            (limits(0, 0), 9, u64::MAX, 1 << 30, false),
            (limits(MB, 0), 9, MB - 1, 1 << 30, false),
            (limits(MB, 0), 9, MB, 0, true),
            (limits(MB, 0), 0, 5 * MB, 0, false),
            (limits(0, 60), 1, 0, 59, false),
            (limits(0, 60), 1, 0, 60, true),
            (limits(0, 60), 0, 0, 600, false),
            (limits(MB, 60), 1, MB - 1, 59, false),
            (limits(MB, 60), 1, MB - 1, 61, true),
            (limits(MB, 60), 1, MB + 1, 0, true),
        ];
        for (limits, messages, size, age, expected) in table {
            let due = limits.is_due(messages, size, Duration::from_secs(age));
            assert_eq!(due, expected, "{limits:?}, {messages} messages, {size} bytes, {age} s");
        }
    }

    #[test]
    fn what_late_joiners_get_is_kept_as_deep_as_its_publishers_keep_it() {
        let spec = |qos: &[QosProfile]| ChannelSpec {
            topic: "/a".into(),
            type_name: "a/msg/A".into(),
            schema_text: String::new(),
            type_hash: String::new(),
            qos: qos.to_vec(),
        };
        let mut latched = LatchedMessages::default();
        let offers: [&[QosProfile]; 4] = [
            &[QosProfile::latched(1)],
            &[QosProfile::reliable(10)],
            // Two publishers of one topic, as of /tf_static.
            &[QosProfile::latched(1), QosProfile::latched(1)],
            &[],
        ];
        for (index, qos) in offers.iter().enumerate() {
            latched.add_channel(ChannelIndex(index as u16), &spec(qos));
        }
        for sequence in 0..5 {
            for channel in 0..4 {
                latched.note(ChannelIndex(channel), sequence, 0, &[]);
            }
        }
        let kept: Vec<_> = latched.iter().map(|m| (m.channel.0, m.sequence)).collect();
        assert_eq!(kept, [(0, 4), (2, 3), (2, 4)]);
    }
}
