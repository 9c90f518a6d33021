//! Checks that a bag holds what a core needs, so that a replay never passes without comparing
//! anything.
//!
//! The bag defines what is expected: the types that a level reads and makes, the program that the
//! metadata name, a path for every accepted plan, and a run that ran. Anything missing is an
//! error that says how to record it; see [`absent`].

use super::recording::Recording;
use super::{Level, ReplayError};
use cnc_msgs::interface::Message;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use run_recorder::bag_reader::BagChannel;
use std::collections::BTreeMap;
use std::sync::Arc;

/// How to record everything that replay needs.
pub(crate) const HELP: &str = "run_recorder always records it; a bag of `ros2 bag record -s mcap --all` holds it if \
     it was started before the program was loaded and stopped after the run";

/// What the channels of a bag say, without its messages.
#[derive(Debug, Default)]
pub(crate) struct Contents {
    /// For each type its topics with their numbers of messages. A topic may have several channels.
    types: BTreeMap<String, BTreeMap<String, u64>>,
    /// The program that the bag was recorded for.
    program_id: Option<String>,
    /// The goal that the bag was recorded for, as hexadecimal digits.
    pub(crate) goal_id: Option<String>,
}

impl Contents {
    pub(crate) fn new(
        channels: &[Arc<BagChannel>],
        run: Option<&BTreeMap<String, String>>,
    ) -> Self {
        let mut contents = Self::default();
        for channel in channels {
            let topics = contents.types.entry(channel.type_name().to_owned()).or_default();
            *topics.entry(channel.topic.clone()).or_default() += channel.message_count;
        }
        let id = |key: &str| run?.get(key).filter(|id| !id.is_empty()).cloned();
        contents.program_id = id("program_id");
        contents.goal_id = id("goal_id");
        contents
    }

    /// The topics of one type that have messages, if there are several: the bag then has more than
    /// one machine. A topic without messages cannot be mistaken for another machine.
    fn is_of_several(&self, type_name: &str) -> Option<String> {
        let topics = self.types.get(type_name)?.iter().filter(|(_, count)| **count > 0);
        let topics: Vec<&str> = topics.map(|(topic, _)| topic.as_str()).collect();
        (topics.len() > 1).then(|| topics.join(" and "))
    }

    /// Why a needed type is missing; `None` when it is there.
    fn lacks(&self, type_name: &str, usual: &str) -> Option<String> {
        match self.types.get(type_name) {
            Some(topics) if topics.values().any(|count| *count > 0) => None,
            Some(topics) => {
                let topics: Vec<&str> = topics.keys().map(String::as_str).collect();
                Some(format!("{} has no message", topics.join(", ")))
            }
            None => Some(format!("no topic is of type {type_name} (usually {usual})")),
        }
    }
}

/// The types that a level reads and makes, with their usual topics.
fn needs(level: Level) -> &'static [(&'static str, &'static str)] {
    const CONTOUR: (&str, &str) = (wire::ProgrammedContour::TYPE_NAME, "programmed_contour");
    const CONTOUR_CHUNKS: (&str, &str) =
        (wire::ContourChunk::TYPE_NAME, "programmed_contour/chunks");
    match level {
        Level::Loader => &[
            (wire::Program::TYPE_NAME, "program"),
            (wire::ProgramChunk::TYPE_NAME, "program/chunks"),
            CONTOUR,
            CONTOUR_CHUNKS,
        ],
        Level::Planner => &[
            CONTOUR,
            CONTOUR_CHUNKS,
            (wire::ToolTable::TYPE_NAME, "tool_table"),
            (wire::CompensationReport::TYPE_NAME, "compensation_report"),
        ],
        Level::Driver => &[
            (wire::NodeParameters::TYPE_NAME, "node_parameters"),
            (wire::CompensatedPath::TYPE_NAME, "compensated_path"),
            (wire::PathChunk::TYPE_NAME, "compensated_path/chunks"),
            // Needed to find the plan of a path.
            (wire::CompensationReport::TYPE_NAME, "compensation_report"),
            (wire::ControllerTraffic::TYPE_NAME, "controller_traffic"),
            (wire::MachineState::TYPE_NAME, "machine_state"),
        ],
        Level::Stack => &[
            (wire::Program::TYPE_NAME, "program"),
            (wire::ProgramChunk::TYPE_NAME, "program/chunks"),
            CONTOUR,
            CONTOUR_CHUNKS,
            (wire::ToolTable::TYPE_NAME, "tool_table"),
            (wire::CompensationReport::TYPE_NAME, "compensation_report"),
            (wire::CompensatedPath::TYPE_NAME, "compensated_path"),
            (wire::PathChunk::TYPE_NAME, "compensated_path/chunks"),
            (wire::NodeParameters::TYPE_NAME, "node_parameters"),
            (wire::ControllerTraffic::TYPE_NAME, "controller_traffic"),
            (wire::MachineState::TYPE_NAME, "machine_state"),
        ],
    }
}

/// Why a level cannot be replayed; `None` when the bag holds all it needs.
pub(crate) fn absent(
    level: Level,
    contents: &Contents,
    recording: &Recording,
) -> Result<(), ReplayError> {
    let several = needs(level).iter().find_map(|(name, _)| contents.is_of_several(name));
    if let Some(topics) = several {
        return Err(ReplayError::Several { topics });
    }
    let absent =
        |missing: String| Err(ReplayError::Absent { level: level.name(), missing, help: HELP });
    let lacking = needs(level).iter().filter_map(|(name, usual)| contents.lacks(name, usual));
    let lacking: Vec<String> = lacking.collect();
    if !lacking.is_empty() {
        return absent(lacking.join("; "));
    }
    if let Some(missing) =
        recording.missing.iter().find(|it| level == Level::Stack || it.levels.contains(&level))
    {
        return absent(missing.to_string());
    }
    if let Some(id) = &contents.program_id {
        let is_there = match level {
            Level::Loader => recording.programs.contains_key(id),
            Level::Planner | Level::Driver | Level::Stack => {
                recording.plans.values().any(|plan| plan.report.program_id == *id)
            }
        };
        if !is_there {
            return absent(format!(
                "the bag was recorded for program {id}, but holds nothing of it"
            ));
        }
    }
    if matches!(level, Level::Driver | Level::Stack) && !has_run(recording) {
        return absent(match recording.is_check() {
            true => "the run: its goal was only checked, and nothing was sent".to_owned(),
            false => {
                "the run did not start: no machine_state is RUN, and no block was sent".to_owned()
            }
        });
    }
    Ok(())
}

/// Whether the machine did anything.
fn has_run(recording: &Recording) -> bool {
    use wire::MachineState as State;
    let moving = [State::STATE_RUN, State::STATE_CHECK, State::STATE_HOME, State::STATE_JOG];
    let is_block = |entry: &wire::TrafficEntry| {
        entry.kind == wire::TrafficEntry::KIND_TRANSMITTED
            && entry.data.first().is_some_and(u8::is_ascii_uppercase)
    };
    recording.states.iter().any(|it| moving.contains(&it.state.state))
        || recording.traffic.values().any(|(_, entry)| is_block(entry))
}
