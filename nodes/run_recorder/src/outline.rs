//! The channels and schemas of a bag, collected while its files are walked.

use std::collections::BTreeMap;
use std::sync::Arc;

use mcap::records::{self, SchemaHeader};

use crate::bag_reader::BagSchema;

/// Channels and schemas in the order they are found, per file.
#[derive(Default)]
pub(crate) struct Outline {
    pub(crate) schemas: BTreeMap<(usize, u16), Arc<BagSchema>>,
    pub(crate) order: Vec<(usize, records::Channel)>,
    pub(crate) place_of: BTreeMap<(usize, u16), usize>,
    /// Messages by place.
    pub(crate) counts: Vec<u64>,
}

impl Outline {
    pub(crate) fn schema(&mut self, source: usize, header: SchemaHeader, text: Vec<u8>) {
        if header.id == 0 {
            return;
        }
        self.schemas.entry((source, header.id)).or_insert_with(|| {
            Arc::new(BagSchema { name: header.name, encoding: header.encoding, text })
        });
    }

    pub(crate) fn channel(&mut self, source: usize, channel: records::Channel) {
        let key = (source, channel.id);
        if self.place_of.contains_key(&key) {
            return;
        }
        // Each file of a bag has its own channel numbers.
        let same = self.order.iter().find(|(other, known)| {
            *other != source
                && known.topic == channel.topic
                && known.message_encoding == channel.message_encoding
                && self.schemas.get(&(*other, known.schema_id))
                    == self.schemas.get(&(source, channel.schema_id))
        });
        let place = match same {
            Some((other, known)) => self.place_of[&(*other, known.id)],
            None => {
                self.counts.push(0);
                self.counts.len() - 1
            }
        };
        self.place_of.insert(key, place);
        self.order.push((source, channel));
    }

    pub(crate) fn count(&mut self, source: usize, channel: u16) -> bool {
        let Some(place) = self.place_of.get(&(source, channel)) else {
            return false;
        };
        self.counts[*place] += 1;
        true
    }

    /// Takes a counted message off again.
    pub(crate) fn uncount(&mut self, source: usize, channel: u16) {
        if let Some(place) = self.place_of.get(&(source, channel)) {
            self.counts[*place] = self.counts[*place].saturating_sub(1);
        }
    }

    /// Whether the records outside of chunks define every channel of a file, with its schema.
    pub(crate) fn knows_all(&self, source: usize, statistics: &records::Statistics) -> bool {
        let of_source = || self.order.iter().filter(|(other, _)| *other == source);
        of_source().count() >= statistics.channel_count as usize
            && of_source().all(|(_, channel)| {
                channel.schema_id == 0 || self.schemas.contains_key(&(source, channel.schema_id))
            })
            && statistics
                .channel_message_counts
                .keys()
                .all(|channel| self.place_of.contains_key(&(source, *channel)))
    }

    pub(crate) fn take_counts(&mut self, source: usize, statistics: &records::Statistics) {
        for (channel, count) in &statistics.channel_message_counts {
            if let Some(place) = self.place_of.get(&(source, *channel)) {
                self.counts[*place] = self.counts[*place].saturating_add(*count);
            }
        }
    }
}
