//! Typed subscriptions.
//!
//! Samples wait in the reader's own queue, with the depth of the subscription;
//! there is no second queue and no background task. A sample whose bytes do not
//! fit the type is counted, logged once per sender, and skipped.

use crate::endpoints::wire::{Decoded, Decoder, Framed, Gid};
use crate::process::time::RosTime;
use cnc_msgs::interface::Message;
use futures::StreamExt;
use ros2_client::MessageInfo;
use serde::de::DeserializeOwned;
use std::collections::BTreeSet;
use std::pin::pin;

/// Where and when a sample came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SampleInfo {
    /// The endpoint that sent it.
    pub publisher: Gid,
    /// Its number at that endpoint, from 1; a gap is a lost sample.
    pub sequence: i64,
    /// Wall time at the sender, if the sample has it.
    pub source_time: Option<RosTime>,
    /// Wall time at which it arrived here.
    pub reception_time: RosTime,
}

impl From<&SampleInfo> for Gid {
    fn from(info: &SampleInfo) -> Self {
        info.publisher
    }
}

/// A typed subscription; it lives as long as the value.
pub struct Subscription<T: Message> {
    reader: Reader<T>,
}

impl<T: Message> Subscription<T> {
    pub(crate) fn new(reader: Reader<T>) -> Self {
        Self { reader }
    }

    /// The next sample, in the order of arrival.
    ///
    /// Never ends by itself, and may be dropped while it waits without losing
    /// a sample.
    pub async fn next(&mut self) -> (T, SampleInfo) {
        let (framed, info) = self.reader.next().await;
        (framed.body, sample_info(&info))
    }

    /// The samples that are here already, oldest first.
    pub fn drain(&mut self) -> Vec<(T, SampleInfo)> {
        let mut samples = Vec::new();
        while let Some((framed, info)) = self.reader.take() {
            samples.push((framed.body, sample_info(&info)));
        }
        samples
    }

    /// Waits for samples and returns the newest of each sender, in the order of arrival.
    /// For latched values: the value of one sender must not hide that of another.
    pub async fn newest_of_each(&mut self) -> Vec<(T, SampleInfo)> {
        let first = self.next().await;
        newest_of_each(std::iter::once(first).chain(self.drain()), |(_, info)| info.publisher)
    }

    /// The absolute name of the topic.
    pub fn topic(&self) -> &str {
        &self.reader.topic
    }

    /// Samples that did not fit the type, since the start.
    pub fn undecodable(&self) -> u64 {
        self.reader.undecodable
    }

    /// The endpoint's own address.
    pub fn gid(&self) -> Gid {
        self.reader.gid()
    }
}

/// The last of each sender's, in order.
fn newest_of_each<S>(samples: impl Iterator<Item = S>, sender: impl Fn(&S) -> Gid) -> Vec<S> {
    let mut newest: Vec<S> = Vec::new();
    for sample in samples {
        newest.retain(|known| sender(known) != sender(&sample));
        newest.push(sample);
    }
    newest
}

impl<T: Message> std::fmt::Debug for Subscription<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Subscription").field("topic", &self.reader.topic).finish_non_exhaustive()
    }
}

/// The reader of topics, requests and replies.
pub(crate) struct Reader<T> {
    topic: String,
    inner: ros2_client::Subscription<Decoded<T>>,
    decoder: Decoder<T>,
    undecodable: u64,
    warned_senders: BTreeSet<Gid>,
}

/// Senders of invalid samples that are remembered, at most.
const WARNED_SENDERS_MAX: usize = 1000;

impl<T: DeserializeOwned + 'static> Reader<T> {
    pub(crate) fn new(
        topic: String,
        inner: ros2_client::Subscription<Decoded<T>>,
        decoder: Decoder<T>,
    ) -> Self {
        Self { topic, inner, decoder, undecodable: 0, warned_senders: BTreeSet::new() }
    }

    pub(crate) fn gid(&self) -> Gid {
        self.inner.guid().into()
    }

    /// The next valid sample.
    pub(crate) async fn next(&mut self) -> (Framed<T>, MessageInfo) {
        loop {
            let item = {
                let mut stream = pin!(self.inner.async_stream_seed(self.decoder.clone()));
                stream.select_next_some().await
            };
            if let Some(sample) = self.accept(item) {
                return sample;
            }
        }
    }

    fn take(&mut self) -> Option<(Framed<T>, MessageInfo)> {
        loop {
            let item = self.inner.take_seed(self.decoder.clone()).transpose()?;
            if let Some(sample) = self.accept(item) {
                return Some(sample);
            }
        }
    }

    fn accept(
        &mut self,
        item: ros2_client::ReadResult<(Decoded<T>, MessageInfo)>,
    ) -> Option<(Framed<T>, MessageInfo)> {
        let (gid, reason) = match item {
            Ok((Ok(framed), info)) => return Some((framed, info)),
            Ok((Err(reason), info)) => (Gid::from(info.publisher_gid()), reason),
            Err(error) => (Gid::default(), error.to_string()),
        };
        self.undecodable += 1;
        if self.warned_senders.len() < WARNED_SENDERS_MAX && self.warned_senders.insert(gid) {
            tracing::warn!(
                "{} gets samples from {gid} that it cannot read, and skips them: {reason}; \
                 the sender has another type, another version of it, or another service mapping \
                 (see RMW_IMPLEMENTATION)",
                self.topic
            );
        }
        None
    }
}

pub(crate) fn sample_info(info: &MessageInfo) -> SampleInfo {
    let time = |time: ros2_client::ROSTime| RosTime::from_nanos(time.to_nanos());
    SampleInfo {
        publisher: info.publisher_gid().into(),
        sequence: info.sequence_number(),
        source_time: info.source_timestamp().map(time),
        reception_time: info.received_timestamp().map_or(RosTime::ZERO, time),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_storm_of_samples_the_newest_of_each_sender_counts() {
        let samples = [(1, 'a'), (1, 'b'), (2, 'c'), (1, 'd'), (3, 'e'), (1, 'f')];
        let newest = newest_of_each(samples.into_iter(), |(sender, _)| Gid([*sender; 16]));
        assert_eq!(newest, [(2, 'c'), (3, 'e'), (1, 'f')]);
    }
}
