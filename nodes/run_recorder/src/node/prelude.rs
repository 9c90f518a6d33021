//! The samples from just before a run, with which its bag begins.

use crate::run_bag::QueueLimits;
use runtime::{Gid, RawSample, RosTime};
use std::collections::VecDeque;

/// How much is kept from before a run, nanoseconds and samples.
const PRELUDE_NS: u64 = 2_000_000_000;
const PRELUDE_SAMPLES: usize = 4_000;

/// A sample and its times, nanoseconds since the epoch.
#[derive(Debug, Clone)]
pub(super) struct KeptSample {
    pub(super) publisher: [u8; 16],
    /// Its number at its publisher.
    pub(super) sequence: i64,
    /// How many samples of the publisher were missed before it.
    pub(super) missed_before: u32,
    pub(super) log_time_ns: u64,
    pub(super) publish_time_ns: u64,
    pub(super) bytes: Vec<u8>,
}

impl KeptSample {
    pub(super) fn new(sample: RawSample) -> Self {
        let at = |time: RosTime| u64::try_from(time.as_nanos()).unwrap_or(0);
        let log_time_ns = at(sample.info.reception_time);
        let publish_time_ns = sample.info.source_time.map_or(log_time_ns, at);
        let Gid(publisher) = sample.info.publisher;
        let sequence = sample.info.sequence;
        let (bytes, missed_before) = (sample.bytes, 0);
        Self { publisher, sequence, missed_before, log_time_ns, publish_time_ns, bytes }
    }
}

/// The newest samples, with the numbers of their topics; of latched topics those of machine states
/// that a newer one has followed.
#[derive(Debug)]
pub(super) struct Prelude {
    samples: VecDeque<(usize, KeptSample)>,
    bytes: usize,
    bytes_max: usize,
}

impl Default for Prelude {
    /// They go through the write queue, which must have room for the samples that follow.
    fn default() -> Self {
        let bytes_max = QueueLimits::default().bytes / 4;
        Self { samples: VecDeque::new(), bytes: 0, bytes_max }
    }
}

impl Prelude {
    /// Adds the newest sample; drops the oldest ones.
    pub(super) fn push(&mut self, topic: usize, kept: KeptSample) {
        let oldest = kept.log_time_ns.saturating_sub(PRELUDE_NS);
        self.bytes += kept.bytes.len();
        self.samples.push_back((topic, kept));
        while self.samples.len() > PRELUDE_SAMPLES
            || self.bytes > self.bytes_max
            || self.samples.front().is_some_and(|(_, kept)| kept.log_time_ns < oldest)
        {
            let Some((_, gone)) = self.samples.pop_front() else { break };
            self.bytes -= gone.bytes.len();
        }
    }

    /// Takes the samples that a bag opened now begins with, in order, merged with the `newest`
    /// of latched topics.
    ///
    /// A latched sample may be hours old, but is still valid when the bag begins. So its log time
    /// is the beginning of the bag; its publish time is the original one.
    pub(super) fn take_with(
        &mut self,
        newest: Vec<(usize, KeptSample)>,
        now_ns: u64,
    ) -> Vec<(usize, KeptSample)> {
        let begin_ns = now_ns.saturating_sub(PRELUDE_NS);
        self.bytes = 0;
        let mut taken: Vec<_> = self.samples.drain(..).collect();
        taken.retain(|(_, kept)| kept.log_time_ns >= begin_ns);
        taken.extend(newest);
        // Sorted before they get the same log time, so that the older stays before the newer.
        taken.sort_by_key(|(_, kept)| kept.log_time_ns);
        for (_, kept) in &mut taken {
            kept.log_time_ns = kept.log_time_ns.max(begin_ns);
        }
        taken
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(log_time_ns: u64, size: usize) -> KeptSample {
        let publish_time_ns = log_time_ns;
        let (publisher, bytes) = ([0; 16], vec![0; size]);
        KeptSample { publisher, sequence: 1, missed_before: 0, log_time_ns, publish_time_ns, bytes }
    }

    #[test]
    fn the_oldest_go_for_time_for_count_and_for_bytes() {
        let bounded = |bytes_max| Prelude { bytes_max, ..Prelude::default() };
        let topics = |prelude: &Prelude| prelude.samples.iter().map(|it| it.0).collect::<Vec<_>>();
        let mut prelude = bounded(100);
        for (topic, size) in [40, 40, 20].into_iter().enumerate() {
            prelude.push(topic, kept(1, size));
        }
        assert_eq!((topics(&prelude), prelude.bytes), (vec![0, 1, 2], 100));
        prelude.push(3, kept(1, 50));
        assert_eq!((topics(&prelude), prelude.bytes), (vec![2, 3], 70));
        prelude.push(4, kept(PRELUDE_NS + 2, 1));
        assert_eq!((topics(&prelude), prelude.bytes), (vec![4], 1));
        // A sample that is larger than the limit is not kept.
        prelude.push(5, kept(PRELUDE_NS + 2, 101));
        assert_eq!((topics(&prelude), prelude.bytes), (vec![], 0));
        for topic in 0..=PRELUDE_SAMPLES {
            prelude.push(topic, kept(PRELUDE_NS + 2, 0));
        }
        assert_eq!(prelude.samples.front().unwrap().0, 1);
    }

    #[test]
    fn a_bag_begins_two_seconds_before_it_is_opened_whenever_its_messages_were_said() {
        let now = 10 * PRELUDE_NS;
        let mut prelude = Prelude::default();
        // No sample came for long, so the old one is still there.
        prelude.push(0, kept(3, 5));
        let latched = vec![(1, kept(7, 1)), (2, kept(5, 1)), (3, kept(now - 1, 1))];
        let taken = prelude.take_with(latched.clone(), now);
        let times: Vec<_> =
            taken.iter().map(|(i, kept)| (*i, kept.log_time_ns, kept.publish_time_ns)).collect();
        let begin = now - PRELUDE_NS;
        assert_eq!(times, [(2, begin, 5), (1, begin, 7), (3, now - 1, now - 1)]);
        prelude.push(0, kept(begin + 1, 5));
        let taken = prelude.take_with(latched, now);
        let topics: Vec<_> = taken.iter().map(|(topic, _)| *topic).collect();
        assert_eq!(topics, [2, 1, 0, 3]);
        assert_eq!((prelude.samples.len(), prelude.bytes), (0, 0));
    }
}
