//! Replays the driver's core on its recorded journal: the same inputs at the same times.

use super::ReplayError;
use super::compare::{Comparison, DifferencePlace};
use super::controller_lines::{self, OtherLine};
use super::inputs::CoreInputs;
use super::output::CoreOutput;
use super::recording::{Recording, monotonic_ns};
use super::states::States;
use axis_driver::driver::{DriverConfig, Output};
use axis_driver::encoder::EncoderConfig;
use axis_driver::journal::{
    CommandError, Entry, EntryKind, command_from_json, kind_from_wire, replay as play,
};
use cnc_msgs::convert::parameter_from_wire;
use cnc_msgs::parameter::ParameterValue;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::wire::cnc_msgs::msg::{ControllerTraffic, TrafficEntry};
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

/// Bytes of one difference that are shown.
const SHOWN_BYTES: usize = 60;

/// Plays the journal again and compares every byte that goes to the machine.
///
/// In a chain the paths are those of today. If one of them is sent in different lines, the
/// recorded answers do not fit: then only the lines are compared, and nothing is played.
pub(crate) fn replay(
    inputs: &CoreInputs,
    comparison: &mut Comparison,
    outputs: &mut Vec<CoreOutput>,
) -> Result<Option<Played>, ReplayError> {
    let recording = &inputs.recording;
    let of_driver = |reason: String| ReplayError::Input { of: "the driver".into(), reason };
    let Some(parameters) = recording.parameters.get("axis_driver") else {
        return Err(ReplayError::Incomplete { what: "the parameters", of: "axis_driver".into() });
    };
    let config = DriverConfig::from_parameters(|name| {
        let row = parameters.parameters.iter().find(|row| row.name == name);
        row.and_then(|row| parameter_from_wire(&row.value))
            // The bag may lack a newer parameter: a value of another type selects its default.
            .unwrap_or(ParameterValue::BoolArray(Vec::new()))
    });
    // The paths that are run; in a chain they may not exist any more.
    let used = RefCell::new(BTreeSet::new());
    let recorded_paths = |program_id: &str, revision: u64| {
        let path = recording.path(program_id, revision)?;
        used.borrow_mut().insert((program_id.to_owned(), revision));
        Some(path)
    };
    let entries = entries(recording, &recorded_paths)?;
    for (program_id, revision) in used.borrow().iter().filter(|_| inputs.is_chain()) {
        if !fits(inputs, program_id, *revision, config.encoder, comparison) {
            return Ok(None);
        }
    }
    let paths = |program_id: &str, revision: u64| inputs.path(program_id, revision);
    let played = play(&entries, &paths, config).map_err(|error| of_driver(error.to_string()))?;

    let recorded: Vec<&Entry> =
        entries.iter().filter(|entry| entry.kind == EntryKind::Tx).collect();
    if recorded.len() != played.transmitted.len() {
        comparison.differs(
            "transmissions",
            "count",
            format!("{} were recorded, {} are made now", recorded.len(), played.transmitted.len()),
        );
    }
    let mut pairs = recorded.iter().zip(&played.transmitted);
    let differs = |(was, now): (&&Entry, &Entry)| {
        (was.monotonic_ns, &was.data) != (now.monotonic_ns, &now.data)
    };
    let first = pairs.position(differs);
    // After the first wrong byte the recorded answers do not fit any more.
    let compared = first.map_or(recorded.len().min(played.transmitted.len()), |index| index + 1);
    comparison.count("transmissions", compared);
    if let Some(index) = first {
        let (recorded, now) = (recorded[index], &played.transmitted[index]);
        let text = format!(
            "at {:.6} s {} became at {:.6} s {}",
            recorded.monotonic_ns as f64 / 1e9,
            shown(&recorded.data),
            now.monotonic_ns as f64 / 1e9,
            shown(&now.data)
        );
        let place = place_at(&played.outputs, recorded.monotonic_ns);
        comparison.differs_at(&format!("transmission {index}"), "data", text, place);
    }
    if let Some(states) = States::of(recording, &entries, &played.outputs) {
        states.compare(comparison);
    }
    outputs.extend(traffic(recording, &played.transmitted));
    Ok(Some(Played { entries, played }))
}

/// The journal, and what the core makes of it now.
#[derive(Debug)]
pub(crate) struct Played {
    pub(crate) entries: Vec<Entry>,
    pub(crate) played: axis_driver::journal::Replay,
}

/// Whether the recorded answers fit today's path, too.
fn fits(
    inputs: &CoreInputs,
    program_id: &str,
    revision: u64,
    config: EncoderConfig,
    comparison: &mut Comparison,
) -> bool {
    let Some(recorded) = inputs.recording.path(program_id, revision) else { return true };
    let what = format!("path {revision}");
    let Some(now) = inputs.path(program_id, revision) else {
        let text = "it was run, and is no longer made; nothing is sent";
        comparison.differs(&what, "lines", text);
        return false;
    };
    if recorded == now {
        return true;
    }
    match controller_lines::compare(&recorded, &now, config) {
        Ok(count) => {
            comparison.count("lines of G-code", count);
            comparison.remark(&what, "a different path, but every line that is sent is the same");
            true
        }
        Err(OtherLine { text, place }) => {
            comparison.count("lines of G-code", 1);
            let text = format!(
                "{text}; the controller answered other lines, so bytes and times are not compared"
            );
            comparison.differs_at(&what, "lines", text, place);
            false
        }
    }
}

/// Where the machine was at that time.
fn place_at(outputs: &[(Duration, Output)], monotonic_ns: u64) -> DifferencePlace {
    let now = Duration::from_nanos(monotonic_ns);
    let before = outputs.iter().take_while(|(at, _)| *at <= now);
    let states = before.filter_map(|(_, output)| match output {
        Output::State(state) => Some(state),
        _ => None,
    });
    states.last().map_or(DifferencePlace::default(), |state| DifferencePlace {
        line: state.line,
        position: state.work_position,
        distance_mm: None,
    })
}

/// The number of the first entry of the journal that is played.
pub(crate) fn first_entry(recording: &Recording) -> Result<Option<u64>, ReplayError> {
    let entries = entries(recording, &|program_id, revision| recording.path(program_id, revision))?;
    Ok(entries.first().map(|entry| entry.sequence))
}

/// Looks up the path of a program and a revision in the bag.
type Paths<'a> = dyn Fn(&str, u64) -> Option<Arc<CompensatedPath>> + 'a;

/// The journal in order, from the driver's start or from a checkpoint.
fn entries(recording: &Recording, paths: &Paths<'_>) -> Result<Vec<Entry>, ReplayError> {
    let mut entries = Vec::with_capacity(recording.traffic.len());
    for (_, entry) in recording.traffic.values() {
        let Some(kind) = kind_from_wire(entry.kind) else {
            return Err(ReplayError::Input {
                of: format!("traffic entry {}", entry.sequence),
                reason: format!("its kind {} is not known", entry.kind),
            });
        };
        entries.push(Entry {
            sequence: entry.sequence,
            monotonic_ns: monotonic_ns(entry),
            kind,
            data: entry.data.clone(),
        });
    }
    let is_checkpoint = |entry: &Entry| entry.kind == EntryKind::Checkpoint;
    if entries.first().is_some_and(|entry| entry.sequence > 1) {
        // A batch on the topic may begin a little before the checkpoint of the run.
        let begin = entries.iter().position(is_checkpoint);
        entries.drain(..begin.unwrap_or(0));
    }
    // The journal may hold earlier runs, too, but their paths are in their own bags.
    let has_no_path = |entry: &Entry| {
        entry.kind == EntryKind::Command
            && matches!(
                command_from_json(&entry.data, paths),
                Err(CommandError::UnknownPath { .. })
            )
    };
    if let Some(other) = entries.iter().rposition(has_no_path)
        && let Some(begin) = entries[other..].iter().position(is_checkpoint)
    {
        entries.drain(..other + begin);
    }
    Ok(entries)
}

fn shown(bytes: &[u8]) -> String {
    let text = bytes.escape_ascii().to_string();
    match text.get(..SHOWN_BYTES) {
        Some(start) if text.len() > SHOWN_BYTES => format!("\"{start}...\""),
        _ => format!("\"{text}\""),
    }
}

/// What the core transmits now, as messages.
fn traffic(recording: &Recording, transmitted: &[Entry]) -> Vec<CoreOutput> {
    let stamps: std::collections::BTreeMap<u64, &(u64, TrafficEntry)> =
        recording.traffic.values().map(|row| (monotonic_ns(&row.1), row)).collect();
    transmitted
        .iter()
        .filter_map(|entry| {
            let (at, input) = stamps.get(&entry.monotonic_ns)?;
            let message = TrafficEntry {
                sequence: entry.sequence,
                kind: TrafficEntry::KIND_TRANSMITTED,
                stamp: input.stamp.clone(),
                monotonic: input.monotonic.clone(),
                data: entry.data.clone(),
            };
            let traffic = ControllerTraffic { entries: vec![message] };
            Some(CoreOutput::new("controller_traffic", *at, &traffic))
        })
        .collect()
}
