//! `kerf replay --update`: replaces the recorded outputs of a bag by what the cores make today.
//!
//! Inputs stay byte for byte. The new bag is written next to the old one and must replay without a
//! difference before it replaces it. The controller's answers cannot be made again: if it would get
//! other lines, or at other times, the run has to be recorded again.

use super::recording::{monotonic_ns, nanoseconds};
use super::{Level, Options, ReplayError, ReplayResult, replay};
use axis_driver::driver::Output;
use axis_driver::journal::EntryKind;
use cnc_msgs::cdr;
use cnc_msgs::convert::machine_state_to_wire;
use cnc_msgs::interface::Message;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use run_recorder::bag_reader::BagMessage;
use run_recorder::files;
use run_recorder::recover::CopySelection;
use run_recorder::rewrite::rewrite_bag;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::Path;

/// Types whose messages are replaced.
const MADE: [&str; 7] = [
    wire::ProgrammedContour::TYPE_NAME,
    wire::ContourChunk::TYPE_NAME,
    wire::CompensationReport::TYPE_NAME,
    wire::CompensatedPath::TYPE_NAME,
    wire::PathChunk::TYPE_NAME,
    wire::ControllerTraffic::TYPE_NAME,
    wire::MachineState::TYPE_NAME,
];
const AGAIN: &str = "record this run again";

/// Writes what the cores make now into the bag; returns a report.
///
/// The new bag must be reproduced at these levels by itself, without a chain.
///
/// # Errors
/// The bag was not changed.
pub fn update(bag: &Path, result: &ReplayResult, levels: &[Level]) -> Result<String, ReplayError> {
    if !result.has_rows() {
        return Ok("nothing to update".to_owned());
    }
    let now = Now::of(result)?;
    let opened = files::open_bag(bag)?;
    let definitions = &result.inputs.recording.definitions;
    let old = opened.channels().iter().find(|channel| {
        MADE.contains(&channel.type_name()) && definitions.is_migrated(channel.type_name())
    });
    if let Some(channel) = old {
        return Err(ReplayError::Update(format!(
            "{} was recorded with an older definition of {}; {AGAIN}",
            channel.topic,
            channel.type_name()
        )));
    }
    drop(opened);
    let problem = |error: &dyn std::fmt::Display| ReplayError::Update(error.to_string());
    let selection =
        CopySelection { instead: &|message| now.instead(message), ..CopySelection::ALL };
    let rewritten = rewrite_bag(bag, selection).map_err(|error| problem(&error))?;
    // An error of the copy names the bag, because the user does not know the copy.
    let again =
        replay(rewritten.path(), levels, Options::default()).map_err(|error| problem(&error))?;
    if again.has_rows_beyond(result) {
        let report = again.report("the new bag", false);
        return Err(ReplayError::Update(format!("the new bag would not be reproduced:\n{report}")));
    }
    rewritten.put_in_place().map_err(|error| problem(&error))?;
    Ok("updated; the bag is reproduced now".to_owned())
}

/// The messages that replace the recorded ones.
#[derive(Debug, Default)]
struct Now {
    contours: BTreeMap<String, Vec<u8>>,
    /// By program and chunk number.
    contour_chunks: BTreeMap<(String, u32), Vec<u8>>,
    reports: BTreeMap<u64, wire::CompensationReport>,
    paths: BTreeMap<u64, Vec<u8>>,
    /// By revision and chunk number.
    path_chunks: BTreeMap<(u64, u32), Vec<u8>>,
    /// What was written to the controller, by entry number.
    transmitted: BTreeMap<u64, Vec<u8>>,
    /// The states of the driver, by wall clock, ns; empty when they are as recorded.
    states: Vec<(i64, wire::MachineState)>,
    /// How many of them have been written.
    written: Cell<usize>,
}

impl Now {
    fn of(result: &ReplayResult) -> Result<Self, ReplayError> {
        let mut now = Self::default();
        for output in &result.outputs {
            let data = output.data.clone();
            match output.type_name {
                wire::ProgrammedContour::TYPE_NAME => {
                    let contour: wire::ProgrammedContour = cdr::decode(&data)?;
                    now.contours.insert(contour.program_id, data);
                }
                wire::ContourChunk::TYPE_NAME => {
                    let chunk: wire::ContourChunk = cdr::decode(&data)?;
                    now.contour_chunks.insert((chunk.program_id, chunk.index), data);
                }
                wire::CompensationReport::TYPE_NAME => {
                    let report: wire::CompensationReport = cdr::decode(&data)?;
                    now.reports.insert(report.revision, report);
                }
                wire::CompensatedPath::TYPE_NAME => {
                    let path: wire::CompensatedPath = cdr::decode(&data)?;
                    now.paths.insert(path.revision, data);
                }
                wire::PathChunk::TYPE_NAME => {
                    let chunk: wire::PathChunk = cdr::decode(&data)?;
                    now.path_chunks.insert((chunk.revision, chunk.index), data);
                }
                _ => {}
            }
        }
        now.take_driver(result)?;
        Ok(now)
    }

    fn take_driver(&mut self, result: &ReplayResult) -> Result<(), ReplayError> {
        let Some(played) = &result.played else {
            let why = format!("the machine would be sent other lines; {AGAIN}");
            return Err(ReplayError::Update(why));
        };
        let recorded = played.entries.iter().filter(|entry| entry.kind == EntryKind::Tx);
        let recorded: Vec<_> = recorded.collect();
        let transmitted = &played.played.transmitted;
        let mut pairs = recorded.iter().zip(transmitted);
        if recorded.len() != transmitted.len()
            || pairs.any(|(was, now)| was.monotonic_ns != now.monotonic_ns)
        {
            let why = format!("the driver writes at other times than were answered; {AGAIN}");
            return Err(ReplayError::Update(why));
        }
        let data = transmitted.iter().map(|entry| entry.data.clone());
        self.transmitted = recorded.iter().map(|entry| entry.sequence).zip(data).collect();
        if !result.has_other_states() {
            return Ok(());
        }
        let entries = result.inputs.recording.traffic.values();
        let walls: BTreeMap<u64, i64> =
            entries.map(|(_, entry)| (monotonic_ns(entry), nanoseconds(&entry.stamp))).collect();
        self.states = played
            .played
            .outputs
            .iter()
            .filter_map(|(at, output)| match output {
                Output::State(state) => {
                    let wall = walls.get(&u64::try_from(at.as_nanos()).ok()?)?;
                    Some((*wall, machine_state_to_wire(Default::default(), state)))
                }
                _ => None,
            })
            .collect();
        Ok(())
    }

    /// The messages that replace a recorded one.
    fn instead(&self, message: &BagMessage) -> Option<Vec<Vec<u8>>> {
        let data = &message.data;
        let one = |data: &Vec<u8>| vec![data.clone()];
        match message.channel.type_name() {
            wire::ProgrammedContour::TYPE_NAME => {
                let contour: wire::ProgrammedContour = cdr::decode(data).ok()?;
                self.contours.get(&contour.program_id).map(one)
            }
            wire::CompensatedPath::TYPE_NAME => {
                let path: wire::CompensatedPath = cdr::decode(data).ok()?;
                self.paths.get(&path.revision).map(one)
            }
            wire::ContourChunk::TYPE_NAME => {
                let chunk: wire::ContourChunk = cdr::decode(data).ok()?;
                let id = chunk.program_id;
                let is_last = chunk.index + 1 >= chunk.chunk_count;
                self.contours.contains_key(&id).then(|| {
                    let range = (id.clone(), chunk.index)..=(id, until(chunk.index, is_last));
                    self.contour_chunks.range(range).map(|(_, data)| data.clone()).collect()
                })
            }
            wire::PathChunk::TYPE_NAME => {
                let chunk: wire::PathChunk = cdr::decode(data).ok()?;
                let id = chunk.revision;
                let is_last = chunk.index + 1 >= chunk.chunk_count;
                self.paths.contains_key(&id).then(|| {
                    let range = (id, chunk.index)..=(id, until(chunk.index, is_last));
                    self.path_chunks.range(range).map(|(_, data)| data.clone()).collect()
                })
            }
            wire::CompensationReport::TYPE_NAME => {
                let recorded: wire::CompensationReport = cdr::decode(data).ok()?;
                let mut report = self.reports.get(&recorded.revision)?.clone();
                report.header = recorded.header;
                // The first report of a plan, which has no certificates yet.
                if recorded.certificate_count == 0 {
                    report.certificate_count = 0;
                    report.certificates.clear();
                }
                Some(vec![cdr::encapsulated(&report)])
            }
            wire::ControllerTraffic::TYPE_NAME => {
                let mut traffic: wire::ControllerTraffic = cdr::decode(data).ok()?;
                for entry in &mut traffic.entries {
                    let is_written = entry.kind == wire::TrafficEntry::KIND_TRANSMITTED;
                    if let Some(data) = self.transmitted.get(&entry.sequence)
                        && is_written
                    {
                        entry.data.clone_from(data);
                    }
                }
                Some(vec![cdr::encapsulated(&traffic)])
            }
            wire::MachineState::TYPE_NAME => {
                let recorded: wire::MachineState = cdr::decode(data).ok()?;
                let at = i64::try_from(message.publish_time_ns).unwrap_or(i64::MAX);
                let written = self.written.get();
                let count = self.states.partition_point(|(wall, _)| *wall <= at).max(written);
                self.written.set(count);
                // All states since the last message; the newest again if there is none.
                let range = written.min(count.saturating_sub(1))..count;
                let states = self.states.get(range).filter(|states| !states.is_empty())?;
                let made = states.iter().map(|(_, state)| {
                    cdr::encapsulated(&wire::MachineState {
                        header: recorded.header.clone(),
                        link_age: recorded.link_age,
                        ..state.clone()
                    })
                });
                Some(made.collect())
            }
            _ => None,
        }
    }
}

/// The end of the chunks that replace a recorded one: the last recorded chunk is replaced by all
/// remaining chunks of today.
fn until(index: u32, is_last: bool) -> u32 {
    if is_last { u32::MAX } else { index }
}
