//! The run in a bag: its goal, all traffic on the line since then, its states.
//!
//! Reads the driver's journal in order and assembles lines. Other files decide what can be played
//! and what has to be the same. Pure.

use axis_driver::driver::{Command, RunRequest};
use axis_driver::journal::command_from_json;
use axis_driver::link::realtime::{SOFT_RESET, STATUS, is_named};
use axis_driver::report::{Report, ReportUnits, parse};
use cnc_msgs::wire::action_msgs::msg::GoalStatus;
use cnc_msgs::wire::cnc_msgs::msg::{MachineState, TrafficEntry};
use replay::ReplayError;
use replay::recording::{RecordedState, Recording, nanoseconds};
use serde_json::Value;
use std::collections::BTreeMap;

/// An event, with its wall time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Event {
    pub(super) stamp_ns: i64,
    pub(super) what: Happened,
}

/// Something that passed on the line or reached the driver.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Happened {
    /// The controller sent a line.
    Received(Report),
    /// The driver sent a line, without its line end.
    Sent(String),
    /// The driver sent a real-time byte, except a status request.
    Acted(u8),
    Asked(Command),
    /// The port was opened.
    Opened,
    /// The port was lost.
    Closed(String),
}

/// What happened in one run.
#[derive(Debug)]
pub(super) struct RunHistory<'a> {
    /// The id of the command that began it.
    pub(super) id: u64,
    pub(super) goal: RunRequest,
    pub(super) began_ns: i64,
    /// After the goal, in order.
    pub(super) events: Vec<Event>,
    /// From the first one with the path to the end of the bag, each with its recording time: the
    /// same state is published again and again, with the stamp of its report.
    pub(super) states: Vec<(i64, &'a MachineState)>,
    /// As in `action_msgs/GoalStatus`; `None`: not in the bag.
    pub(super) status: Option<i8>,
    /// Whether single-block mode was on when the run began.
    pub(super) is_single_block: bool,
}

impl<'a> RunHistory<'a> {
    /// The run of a bag.
    ///
    /// # Errors
    /// What is missing, by name.
    pub(super) fn of(recording: &'a Recording) -> Result<Self, ReplayError> {
        let missing = |what, of: &str| ReplayError::Incomplete { what, of: of.into() };
        let entries: Vec<&TrafficEntry> =
            recording.traffic.values().map(|(_, entry)| entry).collect();
        if entries.is_empty() {
            return Err(missing("the serial dialogue", "the run"));
        }
        let begin = begin(recording, &entries).ok_or_else(|| missing("the goal", "the run"))?;
        let (id, goal) = goal(recording, entries[begin])?;
        let began_ns = nanoseconds(&entries[begin].stamp);
        let states = states(recording);
        if states.is_empty() {
            return Err(missing("machine_state", "the run"));
        }
        let goals = recording.goals.iter().flat_map(|goals| &goals.status_list);
        let newest = goals.max_by_key(|goal| nanoseconds(&goal.goal_info.stamp));
        let checkpoint = entries[..begin].iter().rev();
        let mut checkpoint = checkpoint.filter(|entry| entry.kind == TrafficEntry::KIND_CHECKPOINT);
        let checkpoint =
            checkpoint.next().and_then(|entry| serde_json::from_slice::<Value>(&entry.data).ok());
        Ok(Self {
            id,
            goal,
            began_ns,
            events: events(recording, &entries[begin + 1..], units(recording))?,
            states,
            status: newest.map(|goal| goal.status),
            is_single_block: checkpoint
                .is_some_and(|checkpoint| checkpoint["is_single_block"] == Value::Bool(true)),
        })
    }

    /// What the node of the cell said of the functions that this run has called, by their number.
    pub(super) fn functions(&self) -> BTreeMap<u32, Result<String, String>> {
        let answers = self.events.iter().filter_map(|event| match &event.what {
            Happened::Asked(Command::UserFunctionEnded { run, call, answer }) => {
                (*run == self.id).then(|| (*call, answer.clone()))
            }
            _ => None,
        });
        answers.collect()
    }

    /// Whether it ended before its program did.
    pub(super) fn was_stopped(&self) -> bool {
        match self.status {
            Some(status) => status != GoalStatus::STATUS_SUCCEEDED,
            None => self.events.iter().any(|event| event.what == Happened::Acted(SOFT_RESET)),
        }
    }

    /// When the driver had no path any more; `None`: not in the bag.
    pub(super) fn ended_ns(&self) -> Option<i64> {
        self.states.iter().find(|(_, it)| it.path_revision == 0).map(|(at_ns, _)| *at_ns)
    }

    /// The last state published by this time.
    pub(super) fn state_at(&self, at_ns: i64) -> Option<&'a MachineState> {
        let published =
            self.states.iter().take_while(|(reported_ns, _)| *reported_ns <= at_ns).last();
        published.or(self.states.first()).map(|(_, state)| *state)
    }

    /// The source line that the driver derived from a report of this time.
    pub(super) fn line_after(&self, reported_ns: i64) -> Option<u32> {
        let next = self.states.partition_point(|(at_ns, _)| *at_ns < reported_ns);
        self.states.get(next).map(|(_, state)| state.line)
    }

    /// How many paths had been run by then.
    pub(super) fn paths_at(&self, at_ns: i64) -> usize {
        let published = self.states.iter().take_while(|(reported_ns, _)| *reported_ns <= at_ns);
        distinct(published.map(|(_, it)| it.path_revision).filter(|revision| *revision > 0))
    }

    /// The lines that were sent for the program, up to the reset that drops the rest.
    pub(super) fn lines(&self) -> Vec<&str> {
        let to_reset =
            self.events.iter().take_while(|event| event.what != Happened::Acted(SOFT_RESET));
        let lines = to_reset.filter_map(|event| match &event.what {
            // The checks among the lines depend on the clock.
            Happened::Sent(line) if line != "$G" => Some(line.as_str()),
            _ => None,
        });
        lines.collect()
    }
}

/// The states of the last run of a bag.
fn states(recording: &Recording) -> Vec<(i64, &MachineState)> {
    let runs = |it: &RecordedState| it.state.path_revision > 0;
    let states = &recording.states;
    let Some(last) = states.iter().rposition(runs) else { return Vec::new() };
    let before = states[..last].iter().rposition(|state| !runs(state));
    let begin = before.map_or(0, |at| at + 1);
    states[begin..].iter().map(|it| (it.at_ns, &it.state)).collect()
}

/// The number of values that differ from the one before.
fn distinct(all: impl Iterator<Item = u64>) -> usize {
    let mut all: Vec<u64> = all.collect();
    all.dedup();
    all.len()
}

/// The goal of this bag: the last accepted one, or the last one if acceptance was not recorded.
fn begin(recording: &Recording, entries: &[&TrafficEntry]) -> Option<usize> {
    let is_goal = |entry: &&&TrafficEntry| {
        entry.kind == TrafficEntry::KIND_COMMAND
            && serde_json::from_slice::<Value>(&entry.data)
                .is_ok_and(|command| command["command"] == "run_program")
    };
    let accepted = recording.commands.iter().rev();
    let mut accepted = accepted.filter(|it| it.success && it.endpoint.ends_with("/run_program"));
    let until_ns = accepted.next().map_or(i64::MAX, |it| nanoseconds(&it.stamp));
    let last = entries.iter().rev().filter(is_goal).find(|it| nanoseconds(&it.stamp) <= until_ns);
    let sequence = last?.sequence;
    entries.iter().position(|entry| entry.sequence == sequence)
}

fn goal(recording: &Recording, entry: &TrafficEntry) -> Result<(u64, RunRequest), ReplayError> {
    match command(recording, entry)? {
        (id, Command::RunProgram(request)) => Ok((id, request)),
        _ => unreachable!("the entry was chosen by this name"),
    }
}

fn command(recording: &Recording, entry: &TrafficEntry) -> Result<(u64, Command), ReplayError> {
    let path = |program_id: &str, revision: u64| recording.path(program_id, revision);
    command_from_json(&entry.data, &path).map_err(|error| ReplayError::Input {
        of: format!("the command in traffic entry {}", entry.sequence),
        reason: error.to_string(),
    })
}

/// The unit of the controller's reports.
fn units(recording: &Recording) -> ReportUnits {
    let mut settings = recording.settings.iter().flat_map(|it| &it.settings);
    match settings.find(|it| it.number == 13).map(|it| it.value.trim()) {
        Some("1") => ReportUnits::Inches,
        _ => ReportUnits::Millimetres,
    }
}

fn events(
    recording: &Recording,
    entries: &[&TrafficEntry],
    units: ReportUnits,
) -> Result<Vec<Event>, ReplayError> {
    let mut events = Vec::new();
    let (mut received, mut sent) = (Vec::new(), Vec::new());
    for entry in entries {
        let stamp_ns = nanoseconds(&entry.stamp);
        let mut push = |what| events.push(Event { stamp_ns, what });
        match entry.kind {
            TrafficEntry::KIND_RECEIVED => {
                for &byte in &entry.data {
                    match byte {
                        b'\n' => {
                            let report = parse(&std::mem::take(&mut received), units);
                            if report != Report::Empty {
                                push(Happened::Received(report));
                            }
                        }
                        _ => received.push(byte),
                    }
                }
            }
            TrafficEntry::KIND_TRANSMITTED => {
                for &byte in &entry.data {
                    match byte {
                        STATUS => {}
                        _ if is_named(byte) => push(Happened::Acted(byte)),
                        b'\n' => {
                            let line = String::from_utf8_lossy(&sent).trim().to_owned();
                            sent.clear();
                            push(Happened::Sent(line));
                        }
                        _ => sent.push(byte),
                    }
                }
            }
            TrafficEntry::KIND_OPENED => push(Happened::Opened),
            TrafficEntry::KIND_CLOSED => {
                push(Happened::Closed(String::from_utf8_lossy(&entry.data).into_owned()));
            }
            TrafficEntry::KIND_COMMAND => push(Happened::Asked(command(recording, entry)?.1)),
            _ => {}
        }
    }
    Ok(events)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_real_time_byte_is_not_part_of_the_line_around_it() {
        let entry = |data: &[u8]| TrafficEntry {
            kind: TrafficEntry::KIND_TRANSMITTED,
            data: data.to_vec(),
            ..TrafficEntry::default()
        };
        let (first, second) = (entry(b"\x0cG1 ?X1\x19"), entry(b"0\x9e F100!\n"));
        let found = events(&Recording::default(), &[&first, &second], ReportUnits::Millimetres);
        let found: Vec<Happened> =
            found.expect("no commands").into_iter().map(|event| event.what).collect();
        let acted = [0x0c, 0x19, 0x9e, b'!'].map(Happened::Acted);
        assert_eq!(found[..4], acted);
        assert_eq!(found[4..], [Happened::Sent("G1 X10 F100".into())]);
    }
}
