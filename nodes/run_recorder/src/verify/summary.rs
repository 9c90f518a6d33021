//! The summary of a file: its indexes, counts and offsets.

use std::collections::BTreeMap;
use std::fmt::Debug;

use mcap::records::{
    AttachmentIndex, ChunkIndex, Footer, MetadataIndex, Record, Statistics, SummaryOffset, op,
};

use super::DataSection;
use crate::records::{FRAME, parse_body};

/// The part of the file after the data.
#[derive(Debug, Default)]
pub(super) struct Summary {
    /// Where it begins.
    pub(super) start: u64,
    /// Begin and end of the records of each kind, in their order.
    groups: Vec<(u8, u64, u64)>,
    chunks: Vec<(u64, ChunkIndex)>,
    attachments: Vec<(u64, AttachmentIndex)>,
    metadata: Vec<(u64, MetadataIndex)>,
    statistics: Vec<(u64, Statistics)>,
    offsets: Vec<(u64, SummaryOffset)>,
}

impl Summary {
    pub(super) fn record(&mut self, at: u64, opcode: u8, body: &[u8]) {
        let end = at + (FRAME + body.len()) as u64;
        match self.groups.last_mut() {
            Some((kind, _, last)) if *kind == opcode => *last = end,
            _ => self.groups.push((opcode, at, end)),
        }
        match parse_body(opcode, body) {
            Ok(Record::ChunkIndex(index)) => self.chunks.push((at, index)),
            Ok(Record::AttachmentIndex(index)) => self.attachments.push((at, index)),
            Ok(Record::MetadataIndex(index)) => self.metadata.push((at, index)),
            Ok(Record::Statistics(statistics)) => self.statistics.push((at, statistics)),
            Ok(Record::SummaryOffset(offset)) => self.offsets.push((at, offset)),
            _ => {}
        }
    }

    /// What is wrong with the footer; its calculated checksum is `calculated`.
    pub(super) fn footer(&self, at: u64, footer: &Footer, calculated: u32) -> Vec<String> {
        let of_kind = |is: &dyn Fn(u8) -> bool| {
            self.groups.iter().find(|(kind, ..)| is(*kind)).map(|(_, start, _)| *start)
        };
        let summary = if self.start < at { self.start } else { 0 };
        let offsets = of_kind(&|kind| kind == op::SUMMARY_OFFSET).unwrap_or(0);
        let mut wrong = Vec::new();
        // One without indexes has nothing but where they would be.
        let is_bare = of_kind(&|kind| kind != op::SUMMARY_OFFSET).is_none();
        if footer.summary_start != summary && !(is_bare && footer.summary_start == 0) {
            wrong.push(format!(
                "the footer says that the summary begins at byte {}, and it begins at byte {summary}",
                footer.summary_start
            ));
        }
        if footer.summary_offset_start != offsets && footer.summary_offset_start != 0 {
            wrong.push(format!(
                "the footer says that the places of the indexes begin at byte {}, and they begin \
                 at byte {offsets}",
                footer.summary_offset_start
            ));
        }
        let saved = footer.summary_crc;
        if saved != 0 && saved != calculated {
            wrong.push(format!(
                "the index before it has the checksum {calculated:08x} where {saved:08x} was \
                 written"
            ));
        }
        wrong
    }

    /// The expected number of messages.
    pub(super) fn promised(&self) -> Option<u64> {
        self.statistics.first().map(|(_, statistics)| statistics.message_count)
    }

    /// Differences from the data, with the offset of the summary record.
    pub(super) fn compare(&self, found: &DataSection<'_>) -> Vec<(u64, String)> {
        let mut wrong = Vec::new();
        let Some((_, last, _)) = self.groups.last() else { return wrong };
        let kinds = [
            ("chunk", compare_index(&self.chunks, found.chunks, |it| it.chunk_start_offset)),
            ("attachment", compare_index(&self.attachments, found.attachments, |it| it.offset)),
            ("metadata record", compare_index(&self.metadata, found.metadata, |it| it.offset)),
        ];
        for (what, differences) in kinds {
            for (at, place) in differences {
                let why =
                    format!("the index of the {what} at byte {place} does not match what is there");
                wrong.push((at.unwrap_or(*last), why));
            }
        }
        for (at, statistics) in &self.statistics {
            let differences = compare_statistics(statistics, found);
            wrong.extend(differences.into_iter().map(|why| (*at, why)));
        }
        if self.statistics.len() > 1 {
            wrong.push((*last, "the statistics of the file are there twice".to_owned()));
        }
        for (at, offset) in &self.offsets {
            let is_there = self.groups.iter().any(|(kind, start, end)| {
                (*kind, *start, end - start)
                    == (offset.group_opcode, offset.group_start, offset.group_length)
            });
            if !is_there {
                let why = format!(
                    "there are no records of kind {} in the {} bytes from byte {} on",
                    offset.group_opcode, offset.group_length, offset.group_start
                );
                wrong.push((*at, why));
            }
        }
        wrong
    }
}

/// Entries where an index and the data differ, each with the offset of its record if it has
/// one. An index that is missing altogether is not an error.
fn compare_index<T: PartialEq + Debug>(
    indexes: &[(u64, T)],
    there: &BTreeMap<u64, T>,
    place: impl Fn(&T) -> u64,
) -> Vec<(Option<u64>, u64)> {
    if indexes.is_empty() {
        return Vec::new();
    }
    let mut wrong = Vec::new();
    let mut seen = BTreeMap::new();
    for (at, index) in indexes {
        let twice = seen.insert(place(index), ()).is_some();
        if twice || there.get(&place(index)) != Some(index) {
            wrong.push((Some(*at), place(index)));
        }
    }
    wrong.extend(there.keys().filter(|place| !seen.contains_key(place)).map(|it| (None, *it)));
    wrong
}

fn compare_statistics(stated: &Statistics, found: &DataSection<'_>) -> Vec<String> {
    let count = |count: usize| u64::try_from(count).unwrap_or(u64::MAX);
    let (start, end) = found.range_ns.unwrap_or((0, 0));
    let rows = [
        ("chunks", stated.chunk_count.into(), count(found.chunks.len())),
        ("attachments", stated.attachment_count.into(), count(found.attachments.len())),
        ("metadata records", stated.metadata_count.into(), count(found.metadata.len())),
    ];
    let times = [
        ("ns at its first message", stated.message_start_time, start),
        ("ns at its last message", stated.message_end_time, end),
    ];
    let times = times.iter().filter(|_| found.is_counted);
    let differs = rows.iter().chain(times).filter(|(_, stated, found)| stated != found);
    let mut wrong: Vec<String> = differs
        .map(|(what, stated, found)| format!("the file says {stated} {what}, and it has {found}"))
        .collect();
    // Some writers do not count channels without messages.
    let most = [
        ("topics", u64::from(stated.channel_count), count(found.channel_count)),
        ("definitions", u64::from(stated.schema_count), count(found.schema_count)),
    ];
    let differs = most.iter().filter(|(_, stated, found)| stated > found);
    wrong.extend(
        differs.map(|(what, stated, found)| {
            format!("the file says {stated} {what}, and it has {found}")
        }),
    );
    if !found.is_counted {
        return wrong;
    }
    let channels = stated.channel_message_counts.keys().chain(found.counts.keys());
    let channels: std::collections::BTreeSet<_> = channels.collect();
    for channel in channels {
        let of = |counts: &BTreeMap<u16, u64>| counts.get(channel).copied().unwrap_or(0);
        let (stated, found) = (of(&stated.channel_message_counts), of(found.counts));
        if stated != found {
            wrong.push(format!(
                "the file says {stated} messages of channel {channel}, and it has {found}"
            ));
        }
    }
    wrong
}
