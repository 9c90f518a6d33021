//! The way from the ROS side to the motion process, and back.
//!
//! The socket is this process's standard input. When it ends, so does the process: a face
//! without a driver is of no use to anybody. Nothing is decided here.

// This is where the clock and the thread of the connection are.
#![allow(clippy::disallowed_methods, clippy::disallowed_types)]

use crate::encoder::CalledFunction;
use crate::journal::{Entry, Order, order_to_json};
use crate::protocol::{Deframer, ToFace, ToMotion, VERSION, Vital, Welcome, frame};
use crate::serial::{Dropped, Event};
use cnc_msgs::cdr;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use serde_bytes::ByteBuf;
use std::collections::BTreeMap;
use std::io::{self, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// How long the motion process may take to say what was.
const RESTORED_WITHIN: Duration = Duration::from_secs(20);
/// How long it may take to take a message.
const WRITE_WITHIN: Duration = Duration::from_secs(10);
/// Read in one go, bytes.
const READ_BYTES: usize = 64 << 10;
/// With this the process ends when the motion process has gone; nobody is there to see it.
const MOTION_GONE: i32 = 1;

/// The connection.
pub(super) struct MotionLink {
    out: Mutex<UnixStream>,
    newest: Mutex<Newest>,
    epoch: Instant,
}

/// What the motion process said last.
#[derive(Debug, Clone, Copy)]
struct Newest {
    vital: Vital,
    at: Instant,
}

/// What was before this face.
#[derive(Debug)]
pub(super) struct Before {
    pub(super) welcome: Welcome,
    pub(super) kept: BTreeMap<String, Vec<u8>>,
    /// The newest state and settings, and how runs, moves and commands ended.
    pub(super) events: Vec<Event>,
}

/// What comes from the motion process from now on.
#[derive(Debug)]
pub(super) enum FromMotion {
    Event(Event),
    Entries(Vec<Entry>),
    /// A path was taken, or why not.
    Path {
        program_id: String,
        revision: u64,
        taken: Result<Vec<CalledFunction>, String>,
    },
}

impl MotionLink {
    /// Connects, and hears what was before.
    pub(super) fn connect() -> io::Result<(Arc<Self>, Incoming, Before)> {
        Self::over(UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?))
    }

    fn over(stream: UnixStream) -> io::Result<(Arc<Self>, Incoming, Before)> {
        stream.set_read_timeout(Some(RESTORED_WITHIN))?;
        stream.set_write_timeout(Some(WRITE_WITHIN))?;
        let mut out = stream.try_clone()?;
        out.write_all(&frame(&ToMotion::Hello { version: VERSION }).map_err(io::Error::other)?)?;
        let (mut incoming, mut kept, mut events) =
            (Incoming::new(stream), BTreeMap::new(), Vec::new());
        let (mut welcome, mut vital) = (None, Vital::default());
        loop {
            match incoming.message()? {
                ToFace::Welcome(first) => welcome = Some((first, Instant::now())),
                ToFace::Kept { key, value } => drop(kept.insert(key, value.into_vec())),
                ToFace::Vital(newer) => vital = newer,
                ToFace::Event { at_ns, output } => {
                    events.push(Event { at: Duration::from_nanos(at_ns), output });
                }
                ToFace::Restored => break,
                ToFace::Entries(_) | ToFace::PathTaken { .. } | ToFace::PathRefused { .. } => {}
            }
        }
        let Some((welcome, at)) = welcome else {
            return Err(io::Error::other("the motion process did not identify itself"));
        };
        if welcome.version != VERSION {
            let text = format!("the motion process has protocol version {}", welcome.version);
            return Err(io::Error::other(text));
        }
        incoming.stream.set_read_timeout(None)?;
        let epoch = at.checked_sub(Duration::from_nanos(welcome.now_ns)).unwrap_or(at);
        let newest = Mutex::new(Newest { vital, at });
        let link = Arc::new(Self { out: Mutex::new(out), newest, epoch });
        Ok((link, incoming, Before { welcome, kept, events }))
    }

    /// Hands on what comes until the motion process goes, and this process with it.
    pub(super) fn listen(&self, mut incoming: Incoming, hand_on: impl Fn(FromMotion)) {
        loop {
            let message = match incoming.message() {
                Ok(message) => message,
                Err(error) => gone(&error),
            };
            self.newest().at = Instant::now();
            match message {
                ToFace::Event { at_ns, output } => {
                    hand_on(FromMotion::Event(Event { at: Duration::from_nanos(at_ns), output }));
                }
                ToFace::Entries(entries) => hand_on(FromMotion::Entries(entries)),
                ToFace::Vital(vital) => self.newest().vital = vital,
                ToFace::PathTaken { program_id, revision, functions } => {
                    hand_on(FromMotion::Path { program_id, revision, taken: Ok(functions) });
                }
                ToFace::PathRefused { program_id, revision, message } => {
                    hand_on(FromMotion::Path { program_id, revision, taken: Err(message) });
                }
                ToFace::Welcome(_) | ToFace::Kept { .. } | ToFace::Restored => {}
            }
        }
    }

    fn newest(&self) -> MutexGuard<'_, Newest> {
        self.newest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn send(&self, messages: &[ToMotion]) {
        let mut bytes = Vec::new();
        for message in messages {
            match frame(message) {
                Ok(frame) => bytes.extend(frame),
                Err(error) => return tracing::error!("cannot send to the motion process: {error}"),
            }
        }
        let mut out = self.out.lock().unwrap_or_else(PoisonError::into_inner);
        if let Err(error) = out.write_all(&bytes) {
            gone(&error);
        }
    }

    /// This face is at work.
    pub(super) fn say_ready(&self) {
        self.send(&[ToMotion::Ready]);
    }

    pub(super) fn say_alive(&self) {
        self.send(&[ToMotion::Alive]);
    }

    /// Opens the port. What happens shows in the state.
    pub(super) fn open(&self) {
        self.send(&[ToMotion::Open]);
    }

    /// Closes the port as it is; it is reopened only on request.
    pub(super) fn close(&self) {
        self.send(&[ToMotion::Close]);
    }

    /// Hands an order to the driver; the reply comes as an event with the same id. It is
    /// refused if a local operator has stopped the machine since there were `local_stops`.
    pub(super) fn order(&self, id: u64, order: &Order, local_stops: Option<u64>) {
        self.send(&[ToMotion::Command { json: order_to_json(id, order), local_stops }]);
    }

    /// Sends a path as it came from the planner; [`FromMotion::Path`] follows.
    pub(super) fn send_path(&self, manifest: &wire::CompensatedPath, chunks: &[wire::PathChunk]) {
        self.send(&[ToMotion::PathBegin { manifest: cdr::encapsulated(manifest) }]);
        for chunk in chunks {
            self.send(&[ToMotion::PathChunk { chunk: cdr::encapsulated(chunk) }]);
        }
        self.send(&[ToMotion::PathEnd]);
    }

    /// Keeps a value for the next face.
    pub(super) fn keep(&self, key: &str, value: Option<Vec<u8>>) {
        let (key, value) = (key.to_owned(), value.map(ByteBuf::from));
        self.send(&[ToMotion::Keep { key, value }]);
    }

    /// Entries up to this one have gone out.
    pub(super) fn say_published(&self, sequence: u64) {
        self.send(&[ToMotion::Published { sequence }]);
    }

    /// How long ago something happened at a time of the motion process's clock.
    pub(super) fn age(&self, at: Duration) -> Duration {
        self.epoch.elapsed().saturating_sub(at)
    }

    /// Seconds since the last report of the controller, infinite when there was none through
    /// the port that is open.
    pub(super) fn link_age_s(&self) -> f64 {
        let at = self.newest().vital.last_report_ns;
        at.map_or(f64::INFINITY, |at| self.age(Duration::from_nanos(at)).as_secs_f64())
    }

    /// How long the motion process has said nothing; it speaks ten times a second.
    pub(super) fn silence(&self) -> Duration {
        self.newest().at.elapsed()
    }

    /// How often a local operator has stopped the machine.
    pub(super) fn local_stops(&self) -> u64 {
        self.newest().vital.local_stops
    }

    /// What nobody took in time.
    pub(super) fn dropped(&self) -> Dropped {
        let Vital { events_dropped: events, entries_dropped: entries, .. } = self.newest().vital;
        Dropped { events, entries }
    }
}

/// Messages as they come from the motion process.
pub(super) struct Incoming {
    stream: UnixStream,
    deframer: Deframer,
    buffer: Vec<u8>,
}

impl Incoming {
    fn new(stream: UnixStream) -> Self {
        Self { stream, deframer: Deframer::default(), buffer: vec![0; READ_BYTES] }
    }

    /// The next message.
    fn message(&mut self) -> io::Result<ToFace> {
        loop {
            if let Some(message) = self.deframer.take().map_err(io::Error::other)? {
                return Ok(message);
            }
            match self.stream.read(&mut self.buffer) {
                Ok(0) => return Err(io::Error::from(io::ErrorKind::UnexpectedEof)),
                Ok(count) => self.deframer.push(&self.buffer[..count]),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }
}

/// Ends this process at once: whoever started it has gone.
fn gone(error: &io::Error) -> ! {
    if error.kind() != io::ErrorKind::UnexpectedEof {
        tracing::error!("the connection to the motion process ended: {error}");
    }
    std::process::exit(MOTION_GONE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::driver::Output;
    use cnc_msgs::machine::MachineState;

    #[test]
    fn an_event_is_as_old_as_the_clock_of_the_motion_process_says() {
        let (mut motion, face) = UnixStream::pair().expect("a socket");
        let second = |seconds: u64| seconds * 1_000_000_000;
        let welcome = Welcome {
            version: VERSION,
            now_ns: second(100),
            zero_wall_ns: 0,
            next_id: 1,
            is_first: false,
            publish_from: 0,
            paths: Vec::new(),
        };
        let output = Output::State(MachineState::default());
        for message in [
            ToFace::Welcome(welcome),
            ToFace::Vital(Vital { last_report_ns: Some(second(97)), ..Vital::default() }),
            ToFace::Event { at_ns: second(40), output },
            ToFace::Restored,
        ] {
            motion.write_all(&frame(&message).expect("a frame")).expect("written");
        }
        let (link, _, before) = MotionLink::over(face).expect("a motion process");
        let is_about = |age: Duration, seconds: u64| {
            (Duration::from_secs(seconds)..Duration::from_secs(seconds + 3)).contains(&age)
        };
        let [event] = before.events.as_slice() else { panic!("{:?}", before.events) };
        assert!(is_about(link.age(event.at), 60), "{:?}", link.age(event.at));
        assert!(is_about(Duration::from_secs_f64(link.link_age_s()), 3), "{}", link.link_age_s());
        // What happens now may be dated by a clock that is read a moment later.
        assert_eq!(link.age(Duration::from_secs(200)), Duration::ZERO);
    }
}
