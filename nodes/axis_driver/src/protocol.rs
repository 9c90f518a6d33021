//! What the motion process and its ROS side say to each other.
//!
//! Frames on a local socket: four bytes of length, little-endian, then one message in CDR.
//! Both ends are of one build, since the motion process starts the face from its own file;
//! the version is checked all the same. No frame is longer than [`FRAME_BYTES_MAX`]. Pure:
//! bytes in, messages out.
//!
//! An operator on the same computer speaks the same frames on a socket with a name, with
//! messages of its own: [`Wish`] and [`Answer`].

use crate::driver::{Output, Refusal};
use crate::encoder::CalledFunction;
use crate::journal::Entry;
use cnc_msgs::cdr;
use cnc_msgs::machine::MachineState;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// What the reason of a state begins with while the motion process says nothing.
pub const MOTION_LOST: &str = "MOTION_LOST";
/// Of all messages in this file.
pub const VERSION: u16 = 4;
/// The longest message, bytes: a chunk of a path takes 60 kB, a record of a single block more.
pub const FRAME_BYTES_MAX: usize = 1 << 20;
/// Bytes of the length before each message.
const LENGTH_BYTES: usize = 4;

/// From the ROS side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum ToMotion {
    /// The first message.
    Hello { version: u16 },
    /// The face is at work: ROS users reach the driver.
    Ready,
    /// A sign of life.
    Alive,
    /// Opens the port, and again whenever it goes.
    Open,
    /// Closes the port as it is.
    Close,
    /// A command in the form of the journal (JSON), with its id. It is refused if a local
    /// operator has stopped the machine more often than `local_stops` times, where that is given.
    Command { json: String, local_stops: Option<u64> },
    /// A path is going to be sent: a [`cnc_msgs::wire::cnc_msgs::msg::CompensatedPath`].
    PathBegin {
        #[serde(with = "serde_bytes")]
        manifest: Vec<u8>,
    },
    /// One chunk of it: a [`cnc_msgs::wire::cnc_msgs::msg::PathChunk`].
    PathChunk {
        #[serde(with = "serde_bytes")]
        chunk: Vec<u8>,
    },
    /// That was all; [`ToFace::PathTaken`] or [`ToFace::PathRefused`] follows.
    PathEnd,
    /// Something that the next face will need; `None` forgets it.
    Keep { key: String, value: Option<serde_bytes::ByteBuf> },
    /// Entries up to this one have gone out on the topic.
    Published { sequence: u64 },
}

/// To the ROS side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum ToFace {
    /// Answers [`ToMotion::Hello`].
    Welcome(Welcome),
    /// What an earlier face has kept.
    Kept {
        key: String,
        value: serde_bytes::ByteBuf,
    },
    /// All that an earlier face has left was sent; what follows is new.
    Restored,
    /// An output of the driver and its time, ns since the zero of its clock.
    Event {
        at_ns: u64,
        output: Output,
    },
    /// Entries of the journal whose numbers follow each other.
    Entries(Vec<Entry>),
    /// How the line does.
    Vital(Vital),
    /// The path is here as a whole.
    PathTaken {
        program_id: String,
        revision: u64,
        functions: Vec<CalledFunction>,
    },
    PathRefused {
        program_id: String,
        revision: u64,
        message: String,
    },
}

/// What a face begins with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Welcome {
    pub version: u16,
    /// What the driver's clock shows, ns.
    pub now_ns: u64,
    /// Wall time at which it showed zero, ns since 1970.
    pub zero_wall_ns: i64,
    /// The first id for a command that no earlier face has used.
    pub next_id: u64,
    /// No face was there before.
    pub is_first: bool,
    /// The first entry that has not gone out on the topic.
    pub publish_from: u64,
    /// The paths that are here.
    pub paths: Vec<PathHere>,
}

/// A path that is here.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PathHere {
    pub program_id: String,
    pub revision: u64,
    pub sha256: String,
    pub functions: Vec<CalledFunction>,
}

/// Said several times a second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Vital {
    /// When the last report came, ns on the driver's clock.
    #[serde(rename = "heard_ns")]
    pub last_report_ns: Option<u64>,
    /// What was given up because nobody took it.
    pub events_dropped: u64,
    pub entries_dropped: u64,
    /// How often a local operator has stopped the machine.
    pub local_stops: u64,
}

/// What a local operator can wish: to stop, and to know.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Wish {
    FeedHold,
    Cancel,
    SoftReset,
    State,
}

/// The one message of an operator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct OperatorRequest {
    pub version: u16,
    pub wish: Wish,
}

/// What an operator is answered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    pub result: Result<String, Refusal>,
    pub state: MachineState,
    /// Whether ROS users reach the driver.
    pub has_face: bool,
}

/// Why bytes are not messages of this protocol. The connection is of no more use.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ProtocolError {
    #[error("a message of {bytes} bytes is announced; at most {FRAME_BYTES_MAX} are accepted")]
    TooLong { bytes: usize },
    #[error("a message is not understood: {0}")]
    Content(#[from] cdr::CdrError),
    #[error("the other process has protocol version {found}, not {VERSION}")]
    Version { found: u16 },
}

/// A message as bytes.
///
/// # Errors
/// It is longer than a frame may be.
pub fn frame<T: Serialize>(message: &T) -> Result<Vec<u8>, ProtocolError> {
    let body = cdr::record(message);
    let length = u32::try_from(body.len()).ok().filter(|_| body.len() <= FRAME_BYTES_MAX);
    let Some(length) = length else {
        return Err(ProtocolError::TooLong { bytes: body.len() });
    };
    let mut bytes = Vec::with_capacity(LENGTH_BYTES + body.len());
    bytes.extend(length.to_le_bytes());
    bytes.extend(body);
    Ok(bytes)
}

/// Puts bytes together to messages, however they were cut on the way.
#[derive(Debug, Default)]
pub struct Deframer {
    bytes: Vec<u8>,
    taken: usize,
}

impl Deframer {
    /// Takes what was read.
    pub fn push(&mut self, bytes: &[u8]) {
        if self.taken > 0 {
            self.bytes.drain(..self.taken);
            self.taken = 0;
        }
        self.bytes.extend_from_slice(bytes);
    }

    /// The next message; `None` when it is not all there yet.
    ///
    /// # Errors
    /// The bytes are not of this protocol.
    pub fn take<T: DeserializeOwned>(&mut self) -> Result<Option<T>, ProtocolError> {
        let rest = &self.bytes[self.taken..];
        let Some((length, rest)) = rest.split_first_chunk::<LENGTH_BYTES>() else {
            return Ok(None);
        };
        let length = usize::try_from(u32::from_le_bytes(*length)).unwrap_or(usize::MAX);
        if length > FRAME_BYTES_MAX {
            return Err(ProtocolError::TooLong { bytes: length });
        }
        let Some(body) = rest.get(..length) else { return Ok(None) };
        let message = cdr::from_record(body)?;
        self.taken += LENGTH_BYTES + length;
        Ok(Some(message))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::driver::{LogLevel, MoveResult, RunOutcome, RunResult};
    use crate::journal::EntryKind;
    use cnc_msgs::further::FurtherAxes;
    use cnc_msgs::machine::Mode;

    fn to_face() -> Vec<ToFace> {
        let state = MachineState {
            mode: Mode::Hold,
            reason: "FEED_HOLD".into(),
            machine_position: Some([0.1, -2.0, 3.5]),
            link_age_s: f64::INFINITY,
            overrides_percent: [100, 50, 110],
            ..MachineState::default()
        };
        let result = RunResult {
            id: 9,
            outcome: RunOutcome::Canceled,
            error_code: 313,
            message: "canceled".into(),
            last_line: 4,
            blamed_line: 0,
            last_occurrence: 2,
        };
        let jog = |further| MoveResult {
            id: 8,
            outcome: RunOutcome::Succeeded,
            error_code: 0,
            message: "done".into(),
            machine_position: Some([1.0, 2.0, 3.0]),
            work_position: None,
            further,
            found: false,
        };
        let entry = |sequence, kind, data: &[u8]| Entry {
            sequence,
            monotonic_ns: sequence * 7,
            kind,
            data: data.into(),
        };
        let refusal = Refusal { error_code: 301, message: "busy".into() };
        vec![
            ToFace::Welcome(Welcome {
                version: VERSION,
                now_ns: 5,
                zero_wall_ns: -3,
                next_id: 17,
                is_first: false,
                publish_from: 2,
                paths: vec![PathHere {
                    program_id: "p".into(),
                    revision: 3,
                    sha256: "sum".into(),
                    functions: Vec::new(),
                }],
            }),
            ToFace::Kept { key: "lifecycle".into(), value: vec![3].into() },
            ToFace::Restored,
            ToFace::Event { at_ns: 1, output: Output::State(state) },
            ToFace::Event { at_ns: 2, output: Output::RunFinished(result) },
            ToFace::Event { at_ns: 2, output: Output::MoveFinished(jog(FurtherAxes::NONE)) },
            ToFace::Event {
                at_ns: 2,
                output: Output::MoveFinished(jog(FurtherAxes::NONE.with(2, -7.5))),
            },
            ToFace::Event { at_ns: 3, output: Output::Reply { id: 4, result: Err(refusal) } },
            ToFace::Event {
                at_ns: 4,
                output: Output::Log { level: LogLevel::Warn, message: "äöü".into() },
            },
            ToFace::Entries(vec![entry(1, EntryKind::Rx, b"ok\r\n"), entry(2, EntryKind::Tx, b"")]),
            ToFace::Vital(Vital { last_report_ns: Some(8), local_stops: 1, ..Vital::default() }),
            ToFace::PathRefused { program_id: "p".into(), revision: 1, message: "gap".into() },
        ]
    }

    #[test]
    fn messages_come_back_as_they_were_however_the_bytes_are_cut() {
        let messages = to_face();
        let bytes: Vec<u8> =
            messages.iter().flat_map(|message| frame(message).expect("short")).collect();
        for size in [1, 3, 7, 64, bytes.len()] {
            let mut deframer = Deframer::default();
            let mut found = Vec::new();
            for piece in bytes.chunks(size) {
                deframer.push(piece);
                while let Some(message) = deframer.take::<ToFace>().expect("valid") {
                    found.push(message);
                }
            }
            assert_eq!(found, messages, "pieces of {size} bytes");
        }
    }

    #[test]
    fn a_length_or_a_content_that_cannot_be_is_refused_and_nothing_is_allocated_for_it() {
        let mut deframer = Deframer::default();
        deframer.push(&u32::MAX.to_le_bytes());
        let bytes = usize::try_from(u32::MAX).unwrap();
        assert_eq!(deframer.take::<ToMotion>(), Err(ProtocolError::TooLong { bytes }));
        for body in [&[0xff; 16][..], &[99, 0, 0, 0], &[5, 0, 0, 0, 0xff, 0xff, 0xff, 0x7f]] {
            let mut deframer = Deframer::default();
            deframer.push(&u32::try_from(body.len()).unwrap().to_le_bytes());
            deframer.push(body);
            let refused = matches!(deframer.take::<ToMotion>(), Err(ProtocolError::Content(_)));
            assert!(refused, "{body:?}");
        }
        let chunk = vec![0; FRAME_BYTES_MAX + 1];
        let long = frame(&ToMotion::PathChunk { chunk });
        assert!(matches!(long, Err(ProtocolError::TooLong { .. })), "{long:?}");
    }
}
