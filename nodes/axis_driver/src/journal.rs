//! The record of everything the driver received and wrote, and its repetition.
//!
//! Entries carry the driver's inputs with their times, and the bytes that it wrote.
//! A path is not in the record: the entry of a run names program and revision, and
//! whoever plays the record again looks the path up. Where entries are kept is the
//! shell's business.

mod command;
mod kind;
mod mdi;
mod ring;

pub use command::{
    CommandError, Order, ReplanOrder, RunOrder, command_from_json, command_to_json, order_to_json,
};
pub use kind::{kind_from_wire, kind_to_wire};
pub use ring::Ring;

use crate::driver::{Driver, DriverConfig, Input, Output};
use cnc_msgs::path::CompensatedPath;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Duration;

/// What an entry is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum EntryKind {
    /// Bytes from the controller.
    Rx,
    /// Bytes to the controller; all others are inputs.
    Tx,
    /// A port was opened.
    Opened,
    /// The port went; the data is the reason.
    Closed,
    /// Time passed.
    Timer,
    /// A command, as JSON.
    Command,
    /// The driver as it was before the next entry, as JSON; a record can begin here.
    Checkpoint,
}

/// One entry; sequences begin at 1 and have no gaps.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Entry {
    pub sequence: u64,
    /// The time handed to the driver, ns from any zero.
    pub monotonic_ns: u64,
    pub kind: EntryKind,
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}

/// Numbers entries.
#[derive(Debug, Default)]
pub struct Journal {
    last_sequence: u64,
}

impl Journal {
    /// The entry of an input.
    pub fn input(&mut self, now: Duration, input: &Input) -> Entry {
        let (kind, data) = match input {
            Input::PortOpened => (EntryKind::Opened, Vec::new()),
            Input::PortClosed { reason } => (EntryKind::Closed, reason.as_bytes().to_vec()),
            Input::Received(bytes) => (EntryKind::Rx, bytes.clone()),
            Input::Timer => (EntryKind::Timer, Vec::new()),
            Input::Command { id, command } => {
                (EntryKind::Command, command_to_json(*id, command).into_bytes())
            }
        };
        self.entry(now, kind, data)
    }

    /// The entry of a checkpoint that was made just before an input at `now`.
    pub fn checkpoint(&mut self, now: Duration, json: String) -> Entry {
        self.entry(now, EntryKind::Checkpoint, json.into_bytes())
    }

    /// The entry of bytes that the driver gave out while it handled the input at `now`.
    pub fn transmitted(&mut self, now: Duration, bytes: &[u8]) -> Entry {
        self.entry(now, EntryKind::Tx, bytes.to_vec())
    }

    fn entry(&mut self, now: Duration, kind: EntryKind, data: Vec<u8>) -> Entry {
        self.last_sequence += 1;
        let sequence = self.last_sequence;
        // 584 years fit.
        let monotonic_ns = u64::try_from(now.as_nanos()).unwrap_or(u64::MAX);
        Entry { sequence, monotonic_ns, kind, data }
    }
}

/// Why a record cannot be played again.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    #[error("entry {wanted} is missing, {found} follows: the record is not complete")]
    Gap { wanted: u64, found: u64 },
    #[error("entry {sequence}: {problem}")]
    Command { sequence: u64, problem: CommandError },
    #[error("entry {sequence}: the checkpoint is not understood: {problem}")]
    Checkpoint { sequence: u64, problem: serde_json::Error },
    #[error("the record begins with entry {sequence}, which is neither the first nor a checkpoint")]
    Beginning { sequence: u64 },
}

/// What the driver did when the record was played again.
#[derive(Debug, Default, PartialEq)]
pub struct Replay {
    /// The bytes it gave out, as entries without a number of their own: each has the
    /// time and the sequence of the input that caused it.
    pub transmitted: Vec<Entry>,
    /// All other outputs with the time of the input that caused them.
    pub outputs: Vec<(Duration, Output)>,
}

/// Plays a record again: the same inputs at the same times to a new driver.
pub fn replay(
    entries: &[Entry],
    lookup: &dyn Fn(&str, u64) -> Option<Arc<CompensatedPath>>,
    config: DriverConfig,
) -> Result<Replay, ReplayError> {
    let mut driver = Driver::new(config);
    let mut replay = Replay::default();
    let first = entries.first().map_or(1, |entry| entry.sequence);
    if first > 1 && entries.first().is_some_and(|entry| entry.kind != EntryKind::Checkpoint) {
        return Err(ReplayError::Beginning { sequence: first });
    }
    for (wanted, entry) in (first..).zip(entries) {
        if entry.sequence != wanted {
            return Err(ReplayError::Gap { wanted, found: entry.sequence });
        }
        let input = match entry.kind {
            EntryKind::Tx => continue,
            EntryKind::Checkpoint => {
                driver = Driver::from_checkpoint(&entry.data).map_err(|problem| {
                    ReplayError::Checkpoint { sequence: entry.sequence, problem }
                })?;
                let now = Duration::from_nanos(entry.monotonic_ns);
                replay.outputs.push((now, Output::State(driver.state(now))));
                continue;
            }
            EntryKind::Rx => Input::Received(entry.data.clone()),
            EntryKind::Opened => Input::PortOpened,
            EntryKind::Closed => {
                Input::PortClosed { reason: String::from_utf8_lossy(&entry.data).into_owned() }
            }
            EntryKind::Timer => Input::Timer,
            EntryKind::Command => {
                let (id, command) = command_from_json(&entry.data, lookup).map_err(|problem| {
                    ReplayError::Command { sequence: entry.sequence, problem }
                })?;
                Input::Command { id, command }
            }
        };
        let now = Duration::from_nanos(entry.monotonic_ns);
        driver.handle(now, input);
        while let Some(output) = driver.poll_output() {
            match output {
                Output::Transmit(data) => replay.transmitted.push(Entry {
                    sequence: entry.sequence,
                    monotonic_ns: entry.monotonic_ns,
                    kind: EntryKind::Tx,
                    data,
                }),
                output => replay.outputs.push((now, output)),
            }
        }
    }
    Ok(replay)
}

/// The first place where a record and its repetition wrote something else.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// Counted in writes, from 0.
    pub index: usize,
    pub recorded: Option<Entry>,
    pub repeated: Option<Entry>,
}

impl Replay {
    /// Compares what was written, bytes and times.
    pub fn first_difference(&self, entries: &[Entry]) -> Option<Difference> {
        let mut recorded = entries.iter().filter(|entry| entry.kind == EntryKind::Tx);
        let mut repeated = self.transmitted.iter();
        for index in 0.. {
            let (recorded, repeated) = (recorded.next(), repeated.next());
            match (recorded, repeated) {
                (None, None) => break,
                (Some(a), Some(b)) if (a.monotonic_ns, &a.data) == (b.monotonic_ns, &b.data) => {}
                _ => {
                    let (recorded, repeated) = (recorded.cloned(), repeated.cloned());
                    return Some(Difference { index, recorded, repeated });
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::driver::{Command, DriverConfig, JogRequest, Overrides, ReplanRequest, RunRequest};
    use cnc_msgs::further::FurtherAxes;
    use cnc_msgs::geometry::AxisSet;
    use cnc_msgs::path::StartInSpan;

    #[test]
    fn every_command_reads_back_as_it_was_written() {
        let path = Arc::new(CompensatedPath::default());
        let run = Command::RunProgram(RunRequest {
            program_id: "a\"b\n".into(),
            revision: 3,
            path: path.clone(),
            start_line: 12,
            occurrence: 3,
            in_span: StartInSpan::FromAbove,
            check_only: true,
            tool_diameters_mm: [(1, 6.0)].into(),
        });
        let commands = [
            run,
            Command::CancelRun { run: None },
            Command::CancelRun { run: Some(7) },
            Command::FeedHold,
            Command::Resume,
            Command::SoftReset,
            Command::Unlock,
            Command::Home,
            Command::ConfirmToolChange { objection: None },
            Command::ConfirmToolChange { objection: Some("T2 is not in the tool table".into()) },
            Command::Jog(JogRequest {
                further: FurtherAxes::NONE,
                frame: crate::driver::JogFrame::Work,
                axes: AxisSet::NONE.with(1),
                target: [0.0, -0.1, 0.0],
                feed_mm_per_min: 1.0 / 3.0,
            }),
            Command::SetOverrides(Overrides { rapid: Some(25), ..Overrides::default() }),
            Command::Heartbeat,
            Command::ForgetCommander,
            Command::Replan(ReplanRequest {
                program_id: "part".into(),
                of: 3,
                revision: 4,
                path: path.clone(),
            }),
            Command::ExecuteMdi { path: path.clone(), tool_diameters_mm: [(1, 6.0)].into() },
            Command::SetSingleBlock(true),
            Command::SetConfig(Box::new(DriverConfig {
                homing_s_max: 7,
                ..DriverConfig::default()
            })),
            Command::Activate,
            Command::Deactivate,
            Command::Shutdown,
        ];
        for (id, command) in (7..).zip(commands) {
            let json = command_to_json(id, &command);
            let read = command_from_json(json.as_bytes(), &|_, _| Some(path.clone())).unwrap();
            assert_eq!(read, (id, command));
        }
        assert_eq!(command_to_json(7, &Command::FeedHold), r#"{"id":7,"command":"feed_hold"}"#);
    }

    #[test]
    fn a_record_with_a_gap_or_without_its_path_is_refused_by_name() {
        let entry = |sequence, kind, data: &str| Entry {
            sequence,
            monotonic_ns: 0,
            kind,
            data: data.as_bytes().to_vec(),
        };
        let middle = [entry(4, EntryKind::Opened, "")];
        let problem = replay(&middle, &|_, _| None, DriverConfig::default()).unwrap_err();
        assert_eq!(
            problem.to_string(),
            "the record begins with entry 4, which is neither the first nor a checkpoint"
        );
        let gap = [entry(1, EntryKind::Opened, ""), entry(3, EntryKind::Timer, "")];
        let problem = replay(&gap, &|_, _| None, DriverConfig::default()).unwrap_err();
        assert_eq!(
            problem.to_string(),
            "entry 2 is missing, 3 follows: the record is not complete"
        );
        let json = r#"{"id":1,"command":"run_program","program_id":"p","revision":2,"start_line":0,"check_only":false}"#;
        let run = [entry(1, EntryKind::Command, json)];
        let problem = replay(&run, &|_, _| None, DriverConfig::default()).unwrap_err();
        assert_eq!(
            problem.to_string(),
            "entry 1: the path of program p, revision 2, is not available"
        );
    }
}
