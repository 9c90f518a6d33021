//! Typed subscriptions.
//!
//! Samples wait in the reader's own queue, with the depth of the subscription;
//! there is no second queue and no background task. A sample whose bytes do not
//! fit the type is counted, logged once per sender, and skipped.

use crate::endpoints::middleware::Incoming;
use crate::endpoints::wire::Framed;
use crate::samples::gid::Gid;
use crate::samples::sample::{Sample, SampleInfo};
use cnc_msgs::cdr::Cdr;
use cnc_msgs::interface::Message;
use std::collections::BTreeSet;
use std::marker::PhantomData;

/// A typed subscription; it lives as long as the value.
pub struct Subscription<T: Message> {
    reader: Reader,
    message: PhantomData<fn() -> T>,
}

impl<T: Message> Subscription<T> {
    pub(crate) fn new(reader: Reader) -> Self {
        Self { reader, message: PhantomData }
    }

    /// The next sample, in the order of arrival.
    ///
    /// Never ends by itself, and may be dropped while it waits without losing
    /// a sample.
    pub async fn next(&mut self) -> (T, SampleInfo) {
        let (framed, info) = self.reader.next().await;
        (framed.body, info)
    }

    /// The samples that are here already, oldest first.
    pub fn drain(&mut self) -> Vec<(T, SampleInfo)> {
        let mut samples = Vec::new();
        while let Some((framed, info)) = self.reader.take::<T>() {
            samples.push((framed.body, info));
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
pub(crate) struct Reader {
    topic: String,
    incoming: Incoming,
    /// Whether the mapping puts a [`CycloneHeader`](crate::wire::CycloneHeader) before samples.
    has_header: bool,
    undecodable: u64,
    warned_senders: BTreeSet<Gid>,
}

/// Senders of invalid samples that are remembered, at most.
const WARNED_SENDERS_MAX: usize = 1000;

impl Reader {
    pub(crate) fn new(topic: String, incoming: Incoming, has_header: bool) -> Self {
        Self { topic, incoming, has_header, undecodable: 0, warned_senders: BTreeSet::new() }
    }

    pub(crate) fn gid(&self) -> Gid {
        self.incoming.gid()
    }

    /// The next valid sample.
    pub(crate) async fn next<T: Cdr>(&mut self) -> (Framed<T>, SampleInfo) {
        loop {
            let sample = self.next_received().await;
            if let Some(framed) = self.decode(&sample) {
                return (framed, sample.info);
            }
        }
    }

    fn take<T: Cdr>(&mut self) -> Option<(Framed<T>, SampleInfo)> {
        loop {
            let sample = self.take_received()?;
            if let Some(framed) = self.decode(&sample) {
                return Some((framed, sample.info));
            }
        }
    }

    /// The next sample, whatever its bytes are. May be dropped while it waits without losing a
    /// sample.
    pub(crate) async fn next_received(&mut self) -> Sample {
        loop {
            match self.incoming.next().await {
                Ok(sample) => return sample,
                Err(reason) => self.skip(Gid::default(), &reason),
            }
        }
    }

    fn take_received(&mut self) -> Option<Sample> {
        loop {
            match self.incoming.take()? {
                Ok(sample) => return Some(sample),
                Err(reason) => self.skip(Gid::default(), &reason),
            }
        }
    }

    fn decode<T: Cdr>(&mut self, sample: &Sample) -> Option<Framed<T>> {
        self.valid(sample.received.decode(self.has_header), sample.info.publisher)
    }

    /// What was decoded; counts and reports a sample that did not fit the type.
    pub(crate) fn valid<R>(&mut self, decoded: Result<R, String>, sender: Gid) -> Option<R> {
        decoded.map_err(|reason| self.skip(sender, &reason)).ok()
    }

    /// Whether the mapping puts a header before samples.
    pub(crate) fn has_header(&self) -> bool {
        self.has_header
    }

    fn skip(&mut self, sender: Gid, reason: &str) {
        self.undecodable += 1;
        if self.warned_senders.len() < WARNED_SENDERS_MAX && self.warned_senders.insert(sender) {
            tracing::warn!(
                "{} gets samples from {sender} that it cannot read, and skips them: {reason}; \
                 the sender has another type, another version of it, or another service mapping \
                 (see RMW_IMPLEMENTATION)",
                self.topic
            );
        }
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
