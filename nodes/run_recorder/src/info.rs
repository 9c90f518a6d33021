//! The content of a bag, as a value and as text for `kerf bag info`.

use intake::text::one_line;
use std::collections::BTreeMap;
use std::fmt;
use std::io::{Read, Seek};

use chrono::DateTime;
use serde::Serialize;

use crate::bag_reader::{Bag, RUN_RECORD};

/// One topic.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TopicInfo {
    pub topic: String,
    /// `package/msg/Type`, empty if the bag does not say.
    pub type_name: String,
    pub type_hash: String,
    pub message_count: u64,
}

/// One file inside the bag.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct AttachmentInfo {
    pub name: String,
    pub media_type: String,
    /// Bytes.
    pub size: u64,
}

/// How a run ended, as the driver reported it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RunEnd {
    /// `succeeded`, `canceled`, `aborted`, `checked` (nothing was sent) or `unknown`.
    pub outcome: String,
    /// As in the result of `run_program`; 0 when it succeeded.
    pub error_code: u16,
    /// Why.
    pub message: String,
    /// The source line that was cut last; 0 when none was.
    pub last_line: u32,
}

impl fmt::Display for RunEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.outcome == "canceled" && self.message.starts_with("canceled") {
            // A cancel is no error, and its message repeats the outcome.
            f.write_str(&one_line(&self.message))?;
            return match self.last_line {
                0 => Ok(()),
                line => write!(f, " at line {line}"),
            };
        }
        f.write_str(&self.outcome)?;
        if self.error_code > 0 {
            write!(f, " ({})", self.error_code)?;
        }
        if !self.message.is_empty() {
            write!(f, ": {}", one_line(&self.message))?;
        }
        if self.last_line > 0 {
            write!(f, "; the last line that was cut is {}", self.last_line)?;
        }
        Ok(())
    }
}

/// The content of a bag.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct BagInfo {
    /// The caller's name of the bag, for example its path.
    pub bag: String,
    /// The program that wrote it.
    pub library: String,
    /// Closed properly, nothing lost, no damage found so far.
    pub complete: bool,
    /// The problems, a sentence each.
    pub problems: Vec<String>,
    /// How the run ended; the caller sets it, since the recorder's core knows no message types.
    pub result: Option<RunEnd>,
    /// Why it is marked, if it is; the caller sets it, since the mark is a file next to the bag's.
    pub kept: Option<String>,
    pub message_count: u64,
    /// Log time of the first message, nanoseconds since the epoch.
    pub start_ns: Option<u64>,
    /// From the first to the last message, nanoseconds.
    pub duration_ns: u64,
    pub topics: Vec<TopicInfo>,
    pub attachments: Vec<AttachmentInfo>,
    /// The run's own keys and values: id, program, checksums.
    pub run: BTreeMap<String, String>,
}

impl BagInfo {
    /// Summarises an opened bag. Call [`Bag::verify`] first to include damage inside chunks.
    pub fn new<R: Read + Seek>(name: &str, bag: &Bag<R>) -> Self {
        let summary = bag.summary();
        Self {
            bag: name.to_owned(),
            library: bag.library().to_owned(),
            complete: bag.is_complete(),
            problems: bag.problems().iter().map(ToString::to_string).collect(),
            result: None,
            kept: None,
            message_count: summary.message_count,
            start_ns: summary.time_range_ns.map(|(start, _)| start),
            duration_ns: summary.duration_ns(),
            topics: summary
                .topics
                .into_iter()
                .map(|topic| TopicInfo {
                    topic: topic.topic,
                    type_name: topic.type_name,
                    type_hash: topic.type_hash,
                    message_count: topic.message_count,
                })
                .collect(),
            attachments: bag
                .attachments()
                .iter()
                .map(|attachment| AttachmentInfo {
                    name: attachment.name.clone(),
                    media_type: attachment.media_type.clone(),
                    size: attachment.size,
                })
                .collect(),
            run: bag.metadata_named(RUN_RECORD).cloned().unwrap_or_default(),
        }
    }
}

impl fmt::Display for BagInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(result) = &self.result {
            writeln!(f, "result:      {result}")?;
        }
        writeln!(f, "bag:         {}", one_line(&self.bag))?;
        writeln!(f, "written by:  {}", one_line(&self.library))?;
        let complete = if self.complete { "yes" } else { "no" };
        writeln!(f, "complete:    {complete}")?;
        for problem in &self.problems {
            writeln!(f, "             {}", one_line(problem))?;
        }
        match self.kept.as_deref() {
            None => {}
            Some("") => writeln!(f, "kept:        yes")?,
            Some(because) => {
                // Indents a reason of several lines below its key.
                writeln!(f, "kept:        {}", because.replace('\n', "\n             "))?;
            }
        }
        if let Some(start) = self.start_ns {
            writeln!(f, "start:       {} UTC", utc(start))?;
        }
        writeln!(f, "duration:    {:.3} s", self.duration_ns as f64 / 1e9)?;
        writeln!(f, "messages:    {}", self.message_count)?;
        for (key, value) in &self.run {
            writeln!(f, "run:         {} = {}", one_line(key), one_line(value))?;
        }
        for attachment in &self.attachments {
            let AttachmentInfo { name, media_type, size } = attachment;
            writeln!(
                f,
                "attachment:  {} ({}, {size} bytes)",
                one_line(name),
                one_line(media_type)
            )?;
        }
        let width = |text: fn(&TopicInfo) -> usize| self.topics.iter().map(text).max().unwrap_or(0);
        let topic_width = width(|topic| topic.topic.len());
        let type_width = width(|topic| topic.type_name.len());
        for topic in &self.topics {
            writeln!(
                f,
                "topic:       {:topic_width$}  {:type_width$}  {:>9}",
                one_line(&topic.topic),
                one_line(&topic.type_name),
                topic.message_count
            )?;
        }
        Ok(())
    }
}

/// `2026-03-01 12:00:00.250`, from nanoseconds since the epoch.
fn utc(time_ns: u64) -> String {
    let (seconds, rest) = (time_ns / 1_000_000_000, time_ns % 1_000_000_000);
    let date = DateTime::from_timestamp(seconds as i64, rest as u32);
    let date = date.expect("nanoseconds end in the year 2554");
    date.format("%Y-%m-%d %H:%M:%S%.3f").to_string()
}

#[cfg(test)]
mod tests {
    use super::utc;

    #[test]
    fn times_are_shown_as_calendar_dates() {
        let cases = [
            (0, "1970-01-01 00:00:00.000"),
            (951_782_399_999, "2000-02-28 23:59:59.999"),
            (951_782_400_000, "2000-02-29 00:00:00.000"),
            (1_772_366_400_250, "2026-03-01 12:00:00.250"),
            (4_107_542_400_000, "2100-03-01 00:00:00.000"),
        ];
        for (milliseconds, expected) in cases {
            assert_eq!(utc(milliseconds * 1_000_000), expected);
        }
    }
}
