//! The metadata record `cnc_run_result`, which a recorder writes when it closes a bag.
//!
//! The record counts the messages of each topic. With these counts a reader notices messages
//! that were removed later, and knows how many never reached the recorder.

use std::collections::BTreeMap;

const COMPLETE: &str = "complete";
const REASONS: &str = "reasons";
const LOST: &str = "messages_lost";
/// Keys of [`Closing::written`]: the name of the topic follows the colon.
const WRITTEN: &str = "messages_of:";
/// Keys of [`Closing::missed`], in the same way.
const MISSED: &str = "missed_of:";

/// The values of [`crate::bag_reader::RESULT_RECORD`].
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Closing {
    /// Nothing that a replay needs is known to be missing.
    pub complete: bool,
    /// Why not.
    pub reasons: String,
    /// Messages that were received but not written.
    pub lost: u64,
    /// Messages of each topic in the bag; empty if the recorder did not count.
    pub written: BTreeMap<String, u64>,
    /// Messages of each topic that were sent but not received; topics without any are left out.
    pub missed: BTreeMap<String, u64>,
}

impl Closing {
    /// Encodes the record.
    pub fn to_record(&self) -> BTreeMap<String, String> {
        let Self { complete, reasons, lost, written, missed } = self;
        let counts = |prefix: &'static str, counts: &BTreeMap<String, u64>| {
            let row =
                |(topic, count): (&String, &u64)| (prefix.to_owned() + topic, count.to_string());
            counts.iter().map(row).collect::<Vec<_>>()
        };
        let mut record = BTreeMap::from([
            (COMPLETE.to_owned(), complete.to_string()),
            (REASONS.to_owned(), reasons.clone()),
            (LOST.to_owned(), lost.to_string()),
        ]);
        record.extend(counts(WRITTEN, written));
        record.extend(counts(MISSED, missed));
        record
    }

    /// Decodes a record; entries that are not understood are skipped.
    pub fn from_record(record: &BTreeMap<String, String>) -> Self {
        let text = |key: &str| record.get(key).map_or("", String::as_str);
        let counts = |prefix: &str| {
            let row = |(key, count): (&String, &String)| {
                Some((key.strip_prefix(prefix)?.to_owned(), count.parse().ok()?))
            };
            record.iter().filter_map(row).collect()
        };
        Self {
            complete: text(COMPLETE) == "true",
            reasons: text(REASONS).to_owned(),
            lost: text(LOST).parse().unwrap_or(0),
            written: counts(WRITTEN),
            missed: counts(MISSED),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_read_as_it_was_written() {
        let count = |topic: &str, count| BTreeMap::from([(topic.to_owned(), count)]);
        for closing in [
            Closing::default(),
            Closing {
                complete: false,
                reasons: "the disk is full; it is slow".into(),
                lost: 3,
                written: count("/a:b", 7),
                missed: count("/messages_of:", u64::MAX),
            },
        ] {
            assert_eq!(Closing::from_record(&closing.to_record()), closing);
        }
    }

    #[test]
    fn the_record_of_an_older_recorder_counts_nothing() {
        let record = BTreeMap::from([("complete".to_owned(), "true".to_owned())]);
        let complete = Closing { complete: true, ..Closing::default() };
        assert_eq!(Closing::from_record(&record), complete);
        let damaged = BTreeMap::from([("messages_of:/a".to_owned(), "-1".to_owned())]);
        assert_eq!(Closing::from_record(&damaged), Closing::default());
    }
}
