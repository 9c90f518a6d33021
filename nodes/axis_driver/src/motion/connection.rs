//! One connection to a ROS face: what it says is done, what it is to hear is written.

use super::hub::{Hub, News, log, ns};
use super::memory::{PathRefusal, checked};
use crate::protocol::{Deframer, ProtocolError, ToFace, ToMotion, VERSION, Welcome, frame};
use cnc_msgs::cdr;
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
    std::thread::Builder::new().name("ROS face".into()).spawn(move || {
        if let Err(error) = converse(&hub, &stream, is_first, &shared)
            && !hub.is_closed()
        {
            tracing::warn!("the connection to the ROS face ended: {error}");
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
    let writer = std::thread::Builder::new().name("to the ROS face".into()).spawn(move || {
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
    let tell = |refusal: PathRefusal| {
        let PathRefusal { program_id, revision, message } = refusal;
        // One who sends more paths than it hears answers for gets none.
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
                let manifest = cdr::decode(&manifest).map_err(ProtocolError::Content)?;
                if let Err(refusal) = hub.paths(|paths| paths.begin(manifest)) {
                    tell(refusal);
                }
            }
            ToMotion::PathChunk { chunk } => {
                let chunk = cdr::decode(&chunk).map_err(ProtocolError::Content)?;
                if let Err(refusal) = hub.paths(|paths| paths.add(chunk)) {
                    tell(refusal);
                }
            }
            ToMotion::PathEnd => take_path(hub, answers)?,
            ToMotion::Keep { key, value } => {
                let value = value.map(serde_bytes::ByteBuf::into_vec);
                if let Err(error) = hub.memory(|memory| memory.keep(key, value)) {
                    tracing::error!("the ROS face cannot keep {error}");
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
        tracing::error!("the ROS face: {error}");
    }
}

/// Checks the path that was sent, without keeping the face from being heard meanwhile.
fn take_path(hub: &Arc<Hub>, answers: &SyncSender<ToFace>) -> io::Result<()> {
    let Some((manifest, collector)) = hub.paths(super::memory::Paths::end) else { return Ok(()) };
    let (hub, answers) = (Arc::clone(hub), answers.clone());
    std::thread::Builder::new().name("path".into()).spawn(move || {
        let answer = match checked(&manifest, collector) {
            Ok(path) => {
                hub.paths(|paths| paths.put(&manifest, path));
                let (program_id, revision) = (manifest.program_id, manifest.revision);
                ToFace::PathTaken { program_id, revision }
            }
            Err(PathRefusal { program_id, revision, message }) => {
                ToFace::PathRefused { program_id, revision, message }
            }
        };
        let _ = answers.try_send(answer);
        hub.news.notify_all();
    })?;
    Ok(())
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
            if let Some(message) = self.deframer.take()? {
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
