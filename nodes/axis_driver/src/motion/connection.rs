//! One connection to a ROS side: executes its requests, and writes what it subscribed to.

use super::hub::{Hub, News, log, ns};
use super::memory::{Collected, PathRefusal, refusal};
use super::reading::read;
use crate::encoder::CalledFunction;
use crate::protocol::{Deframer, ProtocolError, ToFace, ToMotion, VERSION, Welcome, frame};
use cnc_msgs::cdr;
use cnc_msgs::path::CompensatedPath;
use std::io::{self, Read, Write};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// A face that takes nothing for so long hangs.
const WRITE_WITHIN: Duration = Duration::from_secs(2);
/// How often a face hears how the line does.
const VITAL_PERIOD: Duration = Duration::from_millis(100);
/// Read in one go, bytes.
const READ_BYTES: usize = 64 << 10;
/// Answers about paths that may wait to be written.
const ANSWERS_MAX: usize = 16;

/// What is known of the face at the other end.
#[derive(Debug, Default)]
pub(super) struct Pulse {
    /// Messages that came from it.
    pub(super) messages: AtomicU64,
    /// It has said that it is at work.
    pub(super) is_ready: AtomicBool,
    /// The connection is of no more use.
    pub(super) is_over: AtomicBool,
}

/// Why a connection ended.
#[derive(Debug, thiserror::Error)]
enum Broken {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
}

/// Serves a face until it goes.
pub(super) fn serve(hub: &Arc<Hub>, stream: UnixStream, is_first: bool) -> io::Result<Arc<Pulse>> {
    let pulse = Arc::new(Pulse::default());
    let (shared, hub) = (Arc::clone(&pulse), Arc::clone(hub));
    std::thread::Builder::new().name("ROS side".into()).spawn(move || {
        if let Err(error) = converse(&hub, &stream, is_first, &shared)
            && !hub.is_closed()
        {
            tracing::warn!("the connection to the ROS side ended: {error}");
        }
        // The writer notices it by that.
        let _ = stream.shutdown(std::net::Shutdown::Both);
        shared.is_over.store(true, Ordering::Relaxed);
    })?;
    Ok(pulse)
}

fn converse(
    hub: &Arc<Hub>,
    stream: &UnixStream,
    is_first: bool,
    pulse: &Pulse,
) -> Result<(), Broken> {
    let mut messages = Messages::new(stream);
    let Some(ToMotion::Hello { version }) = messages.next()? else {
        return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
    };
    if version != VERSION {
        return Err(ProtocolError::Version { found: version }.into());
    }
    let (number, first) = hub.greet();
    let (answers, waiting) = sync_channel(ANSWERS_MAX);
    let (shared, out) = (Arc::clone(hub), stream.try_clone()?);
    let writer = std::thread::Builder::new().name("to the ROS side".into()).spawn(move || {
        let written = speak(&shared, &out, number, is_first, first, &waiting);
        let _ = out.shutdown(std::net::Shutdown::Both);
        written
    })?;
    let ended = listen(hub, &mut messages, pulse, &answers);
    // A face that hung was to log this.
    hub.forget(number).iter().for_each(|event| log(&event.output));
    drop(answers);
    // A panic of the writer would have ended the process.
    let written = writer.join().unwrap_or(Ok(()));
    ended.and(written)
}

/// Does what the face says, until it says nothing more.
fn listen(
    hub: &Arc<Hub>,
    messages: &mut Messages<'_>,
    pulse: &Pulse,
    answers: &SyncSender<ToFace>,
) -> Result<(), Broken> {
    let refuse = |refusal: PathRefusal| {
        let PathRefusal { program_id, revision, message } = refusal;
        // One who sends more paths than it reads answers for gets none.
        let _ = answers.try_send(ToFace::PathRefused { program_id, revision, message });
    };
    while let Some(message) = messages.next()? {
        pulse.messages.fetch_add(1, Ordering::Relaxed);
        match message {
            ToMotion::Hello { .. } | ToMotion::Alive => {}
            ToMotion::Ready => pulse.is_ready.store(true, Ordering::Relaxed),
            ToMotion::Open => full(hub.serial().open()),
            ToMotion::Close => full(hub.serial().close()),
            ToMotion::Command { json, local_stops } => hub.command(&json, local_stops),
            ToMotion::PathBegin { manifest } => {
                let manifest = content("the manifest of a path", || cdr::decode(&manifest))?;
                if let Err(refusal) = hub.paths(|paths| paths.begin(manifest)) {
                    refuse(refusal);
                }
            }
            ToMotion::PathChunk { chunk } => {
                let bytes = chunk.len();
                let chunk = content("a chunk of a path", || cdr::decode(&chunk))?;
                if let Err(refusal) = hub.paths(|paths| paths.add(chunk, bytes)) {
                    refuse(refusal);
                }
            }
            ToMotion::PathEnd => {
                if let Some(collected) = hub.paths(super::memory::Paths::end) {
                    let job = Unchecked { collected, answers: answers.clone() };
                    if let Err(refusal) = hub.check(job) {
                        refuse(refusal);
                    }
                }
            }
            ToMotion::Keep { key, value } => {
                let value = value.map(serde_bytes::ByteBuf::into_vec);
                if let Err(error) = hub.memory(|memory| memory.keep(key, value)) {
                    tracing::error!("the ROS side cannot keep {error}");
                }
            }
            ToMotion::Published { sequence } => {
                hub.memory(|memory| memory.published = memory.published.max(sequence));
            }
        }
    }
    Ok(())
}

fn full(taken: Result<(), crate::serial::Full>) {
    if let Err(error) = taken {
        tracing::error!("the ROS side: {error}");
    }
}

/// Decodes what is in a message. The connection of a face that sends nonsense ends.
fn content<T>(what: &str, decode: impl FnOnce() -> Result<T, cdr::CdrError>) -> Result<T, Broken> {
    let decoded = read(what, decode).map_err(io::Error::other)?;
    Ok(decoded.map_err(ProtocolError::Content)?)
}

/// A path that a face has sent, and where to answer.
#[derive(Debug)]
pub(super) struct Unchecked {
    pub(super) collected: Collected,
    answers: SyncSender<ToFace>,
}

/// Makes a path of what was collected; a parameter, so that a test can let it panic.
pub(super) type Check = fn(Collected) -> Result<Arc<CompensatedPath>, PathRefusal>;

/// Checks one path after the other, without keeping a face from being heard meanwhile.
pub(super) fn check_paths(hub: &Hub, jobs: &Receiver<Unchecked>, check: Check) {
    while let Ok(Unchecked { collected, answers }) = jobs.recv() {
        let (manifest, bytes) = (collected.manifest.clone(), collected.bytes());
        let checked = read("a path", || check(collected))
            .unwrap_or_else(|defect| Err(refusal(&manifest, &defect)));
        hub.paths(|paths| paths.forget(bytes));
        let answer = match checked {
            Ok(path) => {
                let functions = CalledFunction::all_of(&path);
                hub.paths(|paths| paths.put(&manifest, path));
                let (program_id, revision) = (manifest.program_id, manifest.revision);
                ToFace::PathTaken { program_id, revision, functions }
            }
            Err(PathRefusal { program_id, revision, message }) => {
                ToFace::PathRefused { program_id, revision, message }
            }
        };
        // The face may have gone, or send more paths than it hears answers for.
        let _ = answers.try_send(answer);
        hub.news.notify_all();
    }
}

/// Writes what the face is to hear, until it goes.
fn speak(
    hub: &Hub,
    mut out: &UnixStream,
    number: u64,
    is_first: bool,
    first: Vec<crate::serial::Event>,
    answers: &Receiver<ToFace>,
) -> Result<(), Broken> {
    out.set_write_timeout(Some(WRITE_WITHIN))?;
    let mut write = |message: &ToFace| -> Result<(), Broken> {
        out.write_all(&frame(message)?)?;
        Ok(())
    };
    let (next_id, publish_from, kept) = hub.memory(|memory| {
        let kept: Vec<_> = memory.kept().map(|(key, value)| (key.clone(), value.clone())).collect();
        (memory.next_id(), memory.published + 1, kept)
    });
    write(&ToFace::Welcome(Welcome {
        version: VERSION,
        now_ns: ns(hub.serial().epoch().elapsed()),
        zero_wall_ns: hub.zero_wall_ns,
        next_id,
        is_first,
        publish_from,
        paths: hub.paths(|paths| paths.list()),
    }))?;
    for (key, value) in kept {
        write(&ToFace::Kept { key, value: value.into() })?;
    }
    write(&ToFace::Vital(hub.vital()))?;
    for event in first {
        write(&ToFace::Event { at_ns: ns(event.at), output: event.output })?;
    }
    write(&ToFace::Restored)?;
    let mut vital_at = Instant::now();
    while let Some(News { events, entries }) = hub.wait(number, vital_at) {
        for event in events {
            write(&ToFace::Event { at_ns: ns(event.at), output: event.output })?;
        }
        if !entries.is_empty() {
            write(&ToFace::Entries(entries))?;
        }
        while let Ok(answer) = answers.try_recv() {
            write(&answer)?;
        }
        if Instant::now() >= vital_at {
            write(&ToFace::Vital(hub.vital()))?;
            vital_at = Instant::now() + VITAL_PERIOD;
        }
    }
    Ok(())
}

/// Messages as they come from the other end.
struct Messages<'a> {
    stream: &'a UnixStream,
    deframer: Deframer,
    buffer: Vec<u8>,
}

impl<'a> Messages<'a> {
    fn new(stream: &'a UnixStream) -> Self {
        Self { stream, deframer: Deframer::default(), buffer: vec![0; READ_BYTES] }
    }

    /// The next one; `None` at the end.
    fn next(&mut self) -> Result<Option<ToMotion>, Broken> {
        loop {
            let taken = read("a message of the ROS side", || self.deframer.take());
            if let Some(message) = taken.map_err(io::Error::other)?? {
                return Ok(Some(message));
            }
            match self.stream.read(&mut self.buffer) {
                Ok(0) => return Ok(None),
                Ok(count) => self.deframer.push(&self.buffer[..count]),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error.into()),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::hub::tests::hub_that_checks;
    use cnc_msgs::wire::cnc_msgs::msg as wire;
    use std::sync::Mutex;

    const SOON: Duration = Duration::from_secs(10);

    fn send(hub: &Hub, revision: u64, answers: &SyncSender<ToFace>) -> Result<(), PathRefusal> {
        let manifest = wire::CompensatedPath { revision, chunk_count: 1, ..Default::default() };
        hub.paths(|paths| paths.begin(manifest)).expect("a manifest");
        let collected = hub.paths(super::super::memory::Paths::end).expect("it was begun");
        hub.check(Unchecked { collected, answers: answers.clone() })
    }

    #[test]
    fn a_panic_in_the_check_of_a_path_refuses_it_and_the_next_one_is_checked() {
        let hub = hub_that_checks(|collected| match collected.manifest.revision {
            1 => panic!("no such plane"),
            _ => Ok(Arc::default()),
        });
        let (answers, received) = sync_channel(ANSWERS_MAX);
        send(&hub, 1, &answers).expect("there is room");
        let Ok(ToFace::PathRefused { message, .. }) = received.recv_timeout(SOON) else {
            panic!("a refusal is missing");
        };
        assert!(message.ends_with("a defect in Kerf: no such plane"), "{message}");
        send(&hub, 2, &answers).expect("there is room");
        let taken = received.recv_timeout(SOON);
        assert!(matches!(taken, Ok(ToFace::PathTaken { revision: 2, .. })), "{taken:?}");
    }

    #[test]
    fn of_many_paths_at_a_time_one_is_checked_and_one_waits() {
        static CHECKING: Mutex<()> = Mutex::new(());
        let held_up = CHECKING.lock().expect("no panic");
        let hub = hub_that_checks(|_| {
            drop(CHECKING.lock().expect("no panic"));
            Ok(Arc::default())
        });
        let (answers, received) = sync_channel(ANSWERS_MAX);
        let refused: Vec<_> =
            (1..=10).filter_map(|revision| send(&hub, revision, &answers).err()).collect();
        // The worker may have taken the first one before the second came, or not.
        assert!(refused.len() >= 8, "{}", refused.len());
        assert!(refused[0].message.contains("is still being checked"), "{}", refused[0].message);
        drop(held_up);
        for _ in refused.len()..10 {
            let taken = received.recv_timeout(SOON);
            assert!(matches!(taken, Ok(ToFace::PathTaken { .. })), "{taken:?}");
        }
    }
}
