//! Copies all that can be read of a bag into a new, finished one.

use std::collections::BTreeMap;
use std::io::{Read, Seek, Write};

use crate::bag_reader::{Bag, BagError, RESULT_RECORD};
use crate::bag_writer::{BagAttachment, BagWriteError, BagWriter, ChannelIndex, ChannelSpec};
use crate::metadata::BagSummary;

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
    /// Topics left out, with the reason: those that could not stand in a bag of ours.
    pub left_out: Vec<(String, String)>,
    /// What was wrong with the old bag.
    pub problems: Vec<String>,
}

/// Copies a bag: attachments, metadata, topics, messages with their sequence numbers.
///
/// Unless the old bag was complete, the new one says in its `cnc_run_result`
/// that it is not, and why. `file_name` is the name the new file has beside its metadata.yaml.
pub fn recover<R: Read + Seek, W: Write>(
    bag: &mut Bag<R>,
    sink: W,
    file_name: &str,
    custom_data: &BTreeMap<String, String>,
) -> Result<(W, Recovered), RecoverError> {
    let mut writer = BagWriter::new(sink)?;
    for info in bag.attachments().to_vec() {
        writer.attach(&BagAttachment {
            data: bag.read_attachment(&info)?,
            name: info.name,
            media_type: info.media_type,
            log_time_ns: info.log_time_ns,
        })?;
    }
    // The first is written anew, the second last.
    let again = ["rosbag2", RESULT_RECORD];
    for record in bag.metadata() {
        if !again.contains(&record.name.as_str()) {
            writer.write_metadata(&record.name, &record.values)?;
        }
    }
    let mut left_out = Vec::new();
    let mut channels: Vec<Option<ChannelIndex>> = Vec::new();
    for channel in bag.channels() {
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
    for message in bag.messages() {
        let message = message?;
        if let Some(Some(channel)) = channels.get(message.channel_index) {
            writer.write_with_sequence(
                *channel,
                message.sequence,
                message.log_time_ns,
                message.publish_time_ns,
                &message.data,
            )?;
        }
    }
    let problems: Vec<String> = bag.problems().iter().map(ToString::to_string).collect();
    if !bag.is_complete() || !left_out.is_empty() {
        let mut reasons = problems.clone();
        reasons.extend(
            left_out.iter().map(|(topic, reason)| format!("topic {topic} is left out: {reason}")),
        );
        let result = result_record(false, &reasons);
        writer.write_metadata(RESULT_RECORD, &result)?;
    } else if let Some(result) = bag.metadata_named(RESULT_RECORD) {
        writer.write_metadata(RESULT_RECORD, result)?;
    }
    let (sink, summary) = writer.finish(file_name, custom_data)?;
    Ok((sink, Recovered { summary, left_out, problems }))
}

/// The values of [`RESULT_RECORD`].
pub(crate) fn result_record(complete: bool, reasons: &[String]) -> BTreeMap<String, String> {
    BTreeMap::from([
        ("complete".to_owned(), complete.to_string()),
        ("reasons".to_owned(), reasons.join("; ")),
    ])
}
