//! `kerf bag trim`: cuts a bag down to what replay needs.
//!
//! Decides what is needed, and replays both bags: the small bag must give the same result as the
//! large one.

use super::driver::first_entry;
use super::recording::{READ_TYPES, Recording, nanoseconds};
use super::{Level, Options, ReplayError, ReplayResult, replay};
use cnc_msgs::interface::Message;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use run_recorder::bag_reader::{BagChannel, BagMessage};
use run_recorder::files::{self, trim_bag};
use run_recorder::recover::CopySelection;
use std::path::Path;

/// What is kept of a bag.
#[derive(Debug, PartialEq)]
struct Need {
    /// Traffic from this entry on.
    first_entry: u64,
    /// States from here on, nanoseconds since the epoch.
    states_from_ns: u64,
    /// Additional topics, whole.
    topics: Vec<String>,
}

impl Need {
    fn of(recording: &Recording, topics: &[String]) -> Result<Self, ReplayError> {
        let first_entry = first_entry(recording)?.unwrap_or(0);
        let begin = recording.traffic.get(&first_entry);
        // Only the states that replay itself does not compare are dropped.
        let stamp = begin.map(|(_, entry)| &entry.stamp);
        let states_from_ns =
            stamp.map_or(0, |stamp| u64::try_from(nanoseconds(stamp)).unwrap_or(0));
        Ok(Self { first_entry, states_from_ns, topics: topics.to_vec() })
    }

    fn topic(&self, channel: &BagChannel) -> bool {
        let type_name = channel.type_name();
        self.topics.contains(&channel.topic)
            || (channel.message_count > 0 && READ_TYPES.contains(&type_name))
    }

    /// For a kept topic: drops messages that are too early; keeps unreadable ones.
    fn message(&self, message: &BagMessage) -> bool {
        if self.topics.contains(&message.channel.topic) {
            return true;
        }
        match message.channel.type_name() {
            wire::ControllerTraffic::TYPE_NAME => {
                let traffic = cnc_msgs::cdr::decode::<wire::ControllerTraffic>(&message.data);
                traffic.map_or(true, |traffic| {
                    traffic.entries.iter().any(|entry| entry.sequence >= self.first_entry)
                })
            }
            wire::MachineState::TYPE_NAME => message.log_time_ns >= self.states_from_ns,
            _ => true,
        }
    }
}

/// Trims a bag; returns a report.
///
/// # Errors
/// One sentence for people, which names the bag.
pub fn trim(bag: &Path, out: &Path, keep: &[String]) -> Result<String, String> {
    let of = |path: &Path, error: ReplayError| error.of(path);
    let before = replay(bag, &Level::ALL, Options::default()).map_err(|error| of(bag, error))?;
    let recording = &before.inputs.recording;
    let known = files::open_bag(bag).map_err(|error| of(bag, error.into()))?;
    let is_known = |topic: &&String| known.channels().iter().any(|it| it.topic == **topic);
    if let Some(unknown) = keep.iter().find(|topic| !is_known(topic)) {
        let bag = bag.display();
        return Err(format!("{bag}: there is no topic {unknown} in it"));
    }
    let need = Need::of(recording, keep).map_err(|error| of(bag, error))?;
    let selection = CopySelection {
        topics: &|channel| need.topic(channel),
        messages: &|message| need.message(message),
        ..CopySelection::ALL
    };
    let trimmed = trim_bag(bag, out, selection).map_err(|error| error.to_string())?;
    let after = replay(out, &Level::ALL, Options::default()).map_err(|error| of(out, error))?;
    let shown = |result: &ReplayResult| result.report("", true);
    if shown(&before) != shown(&after) {
        return Err(format!(
            "{} does not replay as {} does; it was kept for inspection:\n{}",
            out.display(),
            bag.display(),
            shown(&after)
        ));
    }

    Ok(format!(
        "{}: {} messages of {} topics; replay result as before: {}",
        out.display(),
        trimmed.summary.message_count,
        trimmed.summary.topics.len(),
        after.word()
    ))
}
