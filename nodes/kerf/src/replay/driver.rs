//! The driver's core on its recorded journal: the same inputs at the same times.

use super::compare::Comparison;
use super::recording::Recording;
use super::{Output, ReplayError};
use axis_driver::driver::Output as DriverOutput;
use axis_driver::journal::{CommandError, Entry, EntryKind, command_from_json, replay as play};
use axis_driver::node::{driver_config, kind_from_wire};
use cnc_msgs::convert::machine_state_to_wire;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::wire::builtin_interfaces::msg::Time;
use cnc_msgs::wire::cnc_msgs::msg::{ControllerTraffic, MachineState, TrafficEntry};
use cnc_msgs::wire::std_msgs::msg::Header;
use runtime::parameters::ParameterValue;
use std::sync::Arc;

/// How long a state may take from the driver to its topic on a busy computer, ns.
const ON_ITS_WAY_NS: i64 = 500_000_000;
/// Bytes of one difference that are shown.
const SHOWN_BYTES: usize = 60;

/// Plays the journal again and compares every byte that goes to the machine.
pub(super) fn replay(
    recording: &Recording,
    comparison: &mut Comparison,
    outputs: &mut Vec<Output>,
) -> Result<(), ReplayError> {
    let of_driver = |reason: String| ReplayError::Input { of: "the driver".into(), reason };
    let Some(parameters) = recording.parameters.get("axis_driver") else {
        return Err(ReplayError::Incomplete { what: "the parameters", of: "axis_driver".into() });
    };
    let config = driver_config(|name| {
        let row = parameters.parameters.iter().find(|row| row.name == name);
        row.and_then(|row| runtime::parameter_from_wire(&row.value))
            // A parameter that did not exist then: any value of another type leaves the default.
            .unwrap_or(ParameterValue::BoolArray(Vec::new()))
    });
    let paths = |program_id: &str, revision: u64| {
        let plan = recording.plans.get(&revision)?;
        (plan.report.program_id == program_id).then(|| plan.path.clone()).flatten()
    };
    let entries = entries(recording, &paths)?;
    let played = play(&entries, &paths, config).map_err(|error| of_driver(error.to_string()))?;

    let recorded: Vec<&Entry> =
        entries.iter().filter(|entry| entry.kind == EntryKind::Tx).collect();
    comparison.count("transmissions", recorded.len());
    if recorded.len() != played.transmitted.len() {
        comparison.differs(
            "transmissions",
            "count",
            format!("{} were recorded, {} are made now", recorded.len(), played.transmitted.len()),
        );
    }
    for (index, (recorded, now)) in recorded.iter().zip(&played.transmitted).enumerate() {
        if (recorded.monotonic_ns, &recorded.data) != (now.monotonic_ns, &now.data) {
            comparison.differs(
                &format!("transmission {index}"),
                "data",
                format!(
                    "at {:.6} s {} became at {:.6} s {}",
                    recorded.monotonic_ns as f64 / 1e9,
                    shown(&recorded.data),
                    now.monotonic_ns as f64 / 1e9,
                    shown(&now.data)
                ),
            );
            // What comes after a first wrong byte is wrong too.
            break;
        }
    }
    let first = entries.first().map_or(0, |entry| entry.sequence);
    compare_states(recording, first, &played.outputs, comparison);
    outputs.extend(traffic(recording, &played.transmitted));
    Ok(())
}

/// The path of a program and a revision, if the bag has it.
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
    // Runs before this one may be in the journal too, but their paths are in their own bags.
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

fn monotonic_ns(entry: &TrafficEntry) -> u64 {
    u64::try_from(entry.monotonic.sec).unwrap_or(0) * 1_000_000_000
        + u64::from(entry.monotonic.nanosec)
}

fn shown(bytes: &[u8]) -> String {
    let text = bytes.escape_ascii().to_string();
    match text.get(..SHOWN_BYTES) {
        Some(start) if text.len() > SHOWN_BYTES => format!("\"{start}...\""),
        _ => format!("\"{text}\""),
    }
}

/// Every state that was published must be one that the core goes through, in order.
///
/// The topic repeats states and may drop some; both are left out of account. So is
/// what was on its way to the topic when the journal begins: states are matched from
/// the last one back, and those of the first [`ON_ITS_WAY_NS`] may be older ones.
fn compare_states(
    recording: &Recording,
    first_sequence: u64,
    outputs: &[(std::time::Duration, DriverOutput)],
    comparison: &mut Comparison,
) {
    let made: Vec<MachineState> = outputs
        .iter()
        .filter_map(|(_, output)| match output {
            DriverOutput::State(state) => {
                Some(comparable(&machine_state_to_wire(Header::default(), state)))
            }
            _ => None,
        })
        .collect();
    // What was said before the journal begins cannot be made again.
    let first = recording.traffic.get(&first_sequence);
    let begin_ns = first.map_or(0, |(_, entry)| nanoseconds(&entry.stamp));
    let mut recorded: Vec<(i64, MachineState)> = recording
        .states
        .iter()
        .map(|state| (nanoseconds(&state.header.stamp), comparable(state)))
        .filter(|(at_ns, _)| *at_ns >= begin_ns)
        .collect();
    recorded.dedup_by(|next, before| next.1 == before.1);
    comparison.count("states", recorded.len());
    let mut rest = made.iter().rev();
    for (index, (at_ns, state)) in recorded.iter().enumerate().rev() {
        if !rest.any(|made| made == state) {
            if *at_ns < begin_ns + ON_ITS_WAY_NS {
                break;
            }
            comparison.differs(
                &format!("state {index}"),
                "state",
                format!("{state:?} is not reached in this order"),
            );
            break;
        }
    }
}

fn nanoseconds(stamp: &Time) -> i64 {
    i64::from(stamp.sec) * 1_000_000_000 + i64::from(stamp.nanosec)
}

/// A state without what depends on when it was published.
fn comparable(state: &MachineState) -> MachineState {
    MachineState { header: Header::default(), link_age: 0.0, ..state.clone() }
}

/// What the core transmits now, as messages.
fn traffic(recording: &Recording, transmitted: &[Entry]) -> Vec<Output> {
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
            Some(Output::new("controller_traffic", *at, &traffic))
        })
        .collect()
}
