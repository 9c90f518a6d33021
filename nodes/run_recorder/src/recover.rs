//! Copies the readable part of a bag, or a selection, into a new finished bag.

use std::collections::BTreeMap;
use std::io::{Read, Seek, Write};

use crate::bag_reader::{Bag, BagChannel, BagError, BagMessage, Problem, RESULT_RECORD};
use crate::bag_writer::{BagAttachment, BagWriteError, BagWriter, ChannelIndex, ChannelSpec};
use crate::closing::Closing;
use crate::metadata::BagSummary;
use crate::split::PART_RECORD;

/// The key that names the original bag in a copy.
pub(crate) const RECOVERED_FROM: &str = "recovered_from";
pub(crate) const TRIMMED_FROM: &str = "trimmed_from";
/// The metadata record at the beginning of a copy. It shows that the copy is not an original
/// recording, which begins with the record of the run.
const COPY_RECORD: &str = "cnc_copy";

/// Why a bag could not be copied.
#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    #[error(transparent)]
    Read(#[from] BagError),
    #[error(transparent)]
    Write(#[from] BagWriteError),
}

/// What was copied.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Recovered {
    pub summary: BagSummary,
    /// Topics left out because a bag of ours cannot hold them, with the reason.
    pub left_out: Vec<(String, String)>,
    /// The problems of the old bag.
    pub problems: Vec<String>,
}

/// What to copy.
#[derive(Clone, Copy)]
pub struct CopySelection<'a> {
    /// Which topics.
    pub topics: &'a dyn Fn(&BagChannel) -> bool,
    /// Which messages of them.
    pub messages: &'a dyn Fn(&BagMessage) -> bool,
    /// Replaces a message by none or several; `None` keeps it.
    pub instead: &'a dyn Fn(&BagMessage) -> Option<Vec<Vec<u8>>>,
}

impl std::fmt::Debug for CopySelection<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("CopySelection").finish_non_exhaustive()
    }
}

impl CopySelection<'_> {
    /// All of it.
    pub const ALL: Self = Self { topics: &|_| true, messages: &|_| true, instead: &|_| None };
}

/// Copies a bag: attachments, metadata, topics, messages with their sequence numbers.
///
/// Unless the old bag was complete, the new one says in its `cnc_run_result`
/// that it is not, and why; what is not selected is not missed. `file_name` is the name
/// of the new file in its metadata.yaml.
pub fn recover<R: Read + Seek, W: Write>(
    bag: &mut Bag<R>,
    sink: W,
    file_name: &str,
    custom_data: &BTreeMap<String, String>,
    selection: CopySelection<'_>,
) -> Result<(W, Recovered), RecoverError> {
    let mut writer = BagWriter::new(sink)?;
    let mut copy_of = custom_data.clone();
    copy_of.retain(|key, _| [RECOVERED_FROM, TRIMMED_FROM].contains(&key.as_str()));
    if !copy_of.is_empty() {
        writer.write_metadata(COPY_RECORD, &copy_of)?;
    }
    for info in bag.attachments().to_vec() {
        writer.attach(&BagAttachment {
            data: bag.read_attachment(&info)?,
            name: info.name,
            media_type: info.media_type,
            log_time_ns: info.log_time_ns,
        })?;
    }
    // The first is written again, the second at the end, and the copy has one part.
    let not_here = ["rosbag2", RESULT_RECORD, PART_RECORD];
    for (index, record) in bag.metadata().iter().enumerate() {
        // Each part repeats the record of the run.
        let is_said = bag.metadata()[..index].contains(record)
            || (record.name == COPY_RECORD && record.values == copy_of);
        if !is_said && !not_here.contains(&record.name.as_str()) {
            writer.write_metadata(&record.name, &record.values)?;
        }
    }
    let mut left_out = Vec::new();
    let mut channels: Vec<Option<ChannelIndex>> = Vec::new();
    for channel in bag.channels() {
        if !(selection.topics)(channel) {
            channels.push(None);
            continue;
        }
        let added = match &channel.schema {
            None => Err("it has no schema".to_owned()),
            Some(_) if channel.message_encoding != "cdr" => {
                Err(format!("its messages are {}, not cdr", channel.message_encoding))
            }
            Some(schema) => match String::from_utf8(schema.text.clone()) {
                Err(_) => Err("its schema is not text".to_owned()),
                Ok(schema_text) => match writer.add_channel(&ChannelSpec {
                    topic: channel.topic.clone(),
                    type_name: schema.name.clone(),
                    schema_text,
                    type_hash: channel.type_hash.clone(),
                    qos: channel.qos.clone(),
                }) {
                    Err(error @ (BagWriteError::Io(_) | BagWriteError::Container(_))) => {
                        return Err(error.into());
                    }
                    added => added.map_err(|error| error.to_string()),
                },
            },
        };
        if let Err(reason) = &added {
            left_out.push((channel.topic.clone(), reason.clone()));
        }
        channels.push(added.ok());
    }
    let mut grown: BTreeMap<usize, u32> = BTreeMap::new();
    for message in bag.messages() {
        let message = message?;
        let Some(Some(channel)) = channels.get(message.channel_index) else { continue };
        if !(selection.messages)(&message) {
            continue;
        }
        let (at, sent) = (message.log_time_ns, message.publish_time_ns);
        let count = grown.entry(message.channel_index).or_insert(0_u32);
        let first = message.sequence.wrapping_add(*count);
        match (selection.instead)(&message) {
            None => writer.write_with_sequence(*channel, first, at, sent, &message.data)?,
            Some(instead) => {
                // The following messages are numbered as if these had been there.
                *count = count.wrapping_add(instead.len() as u32).wrapping_sub(1);
                for (number, data) in (0..).zip(&instead) {
                    let sequence = first.wrapping_add(number);
                    writer.write_with_sequence(*channel, sequence, at, sent, data)?;
                }
            }
        }
    }
    bag.verify_indexes()?;
    let words = |problem: &Problem| match problem {
        // Its own words, so that a copy of a copy says the same.
        Problem::RecorderSays { reason } => reason.clone(),
        problem => problem.to_string(),
    };
    let problems: Vec<String> = bag.problems().iter().map(words).collect();
    // The copy has indexes of its own.
    let lasting = bag.problems().iter().filter(|problem| !problem.is_of_index());
    let mut reasons: Vec<String> = lasting.map(words).collect();
    if !reasons.is_empty() || !left_out.is_empty() {
        reasons.extend(
            left_out.iter().map(|(topic, reason)| format!("topic {topic} is left out: {reason}")),
        );
        let Closing { lost, missed, .. } = bag.closing().unwrap_or_default();
        let (complete, written) = (false, BTreeMap::new());
        let closing = Closing { complete, reasons: reasons.join("; "), lost, written, missed };
        writer.write_metadata(RESULT_RECORD, &closing.to_record())?;
    } else if let Some(mut closing) = bag.closing() {
        // Messages that are not selected do not count as missing.
        if !closing.written.is_empty() {
            closing.written = writer.counts();
        }
        writer.write_metadata(RESULT_RECORD, &closing.to_record())?;
    }
    let (sink, summary) = writer.finish(file_name, custom_data)?;
    Ok((sink, Recovered { summary, left_out, problems }))
}
