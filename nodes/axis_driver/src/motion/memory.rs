//! State that survives a restart of the ROS side, so that the next one continues with it.
//!
//! Pure, and bounded in everything: what a face has asked to keep, how runs, moves and
//! commands ended, the newest state and settings, the paths.

use crate::driver::{Command, ControllerSettings, Output};
use crate::encoder::CalledFunction;
use crate::protocol::PathHere;
use crate::serial::Event;
use cnc_msgs::chunk::Collector;
use cnc_msgs::machine::MachineState;
use cnc_msgs::path::{CompensatedPath, PATHS_BYTES_MAX, PathTooLong, check_length, path_bytes};
use cnc_msgs::wire::cnc_msgs::msg as wire;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

/// All values that are kept, bytes.
const KEPT_BYTES_MAX: usize = 4 << 20;
/// How many there are: a face keeps one for each action, and few others.
const KEPT_MAX: usize = 64;
/// Ends of runs and moves, and answers to what began them, that are kept.
const ENDS_MAX: usize = 256;
/// Paths that are here: the one that runs, the newest, and one for the rest of a run.
const PATHS_MAX: usize = 3;
/// Chunks that are not checked yet, bytes as they came: 136 for an element, some more in memory.
const UNCHECKED_BYTES_MAX: usize = 1 << 30;
/// What a chunk takes besides its content, bytes.
const CHUNK_BYTES: usize = 256;
/// The longest name of a program, bytes.
const NAME_BYTES_MAX: usize = 256;

/// A face wants more kept than there is room for.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{key}: {bytes} bytes are more than what is left of {KEPT_BYTES_MAX}, or {KEPT_MAX} values \
     are kept already"
)]
pub(super) struct NoRoom {
    key: String,
    bytes: usize,
}

/// All of it.
#[derive(Debug, Default)]
pub(super) struct Memory {
    kept: BTreeMap<String, Vec<u8>>,
    state: Option<(Duration, MachineState)>,
    settings: Option<(Duration, ControllerSettings)>,
    /// What a run that waits for its plan has said.
    probes: Option<Event>,
    ends: VecDeque<Event>,
    /// Commands whose answer the next face needs, not answered yet.
    followed: BTreeSet<u64>,
    /// Entries up to this one have gone out on the topic.
    pub(super) published: u64,
    /// The largest id that a face has used.
    id_max: u64,
}

impl Memory {
    /// Keeps or forgets a value.
    pub(super) fn keep(&mut self, key: String, value: Option<Vec<u8>>) -> Result<(), NoRoom> {
        let Some(value) = value else {
            self.kept.remove(&key);
            return Ok(());
        };
        let others: usize = self
            .kept
            .iter()
            .filter(|(other, _)| **other != key)
            .map(|(other, value)| other.len() + value.len())
            .sum();
        let bytes = key.len() + value.len();
        let is_one_more = !self.kept.contains_key(&key);
        if others + bytes > KEPT_BYTES_MAX || is_one_more && self.kept.len() >= KEPT_MAX {
            return Err(NoRoom { key, bytes });
        }
        self.kept.insert(key, value);
        Ok(())
    }

    pub(super) fn kept(&self) -> impl Iterator<Item = (&String, &Vec<u8>)> {
        self.kept.iter()
    }

    /// A face has given this command.
    pub(super) fn note(&mut self, id: u64, command: &Command) {
        self.id_max = self.id_max.max(id);
        let is_goal = matches!(
            command,
            Command::RunProgram(_) | Command::Home | Command::Jog(_) | Command::Probe(_)
        );
        if is_goal && self.followed.len() < ENDS_MAX {
            self.followed.insert(id);
        }
    }

    pub(super) fn next_id(&self) -> u64 {
        self.id_max.saturating_add(1)
    }

    /// Remembers what of an event matters later.
    pub(super) fn remember(&mut self, event: &Event) {
        match &event.output {
            Output::State(state) => {
                self.state = Some((event.at, state.clone()));
                let of = state.path_revision;
                let waits = |event: &Event| matches!(&event.output, Output::Probes(it) if it.revision == of);
                self.probes = self.probes.take().filter(waits);
            }
            Output::Settings(settings) => self.settings = Some((event.at, settings.clone())),
            Output::Probes(_) => self.probes = Some(event.clone()),
            Output::Reply { id, .. } => {
                if self.followed.remove(id) {
                    self.keep_end(event);
                }
            }
            Output::RunFinished(_) | Output::MoveFinished(_) => self.keep_end(event),
            Output::Transmit(_)
            | Output::Progress { .. }
            // A face that ends takes the answer with it, and the run ends.
            | Output::UserFunction(_)
            | Output::ReadyToClose
            | Output::Log { .. } => {}
        }
    }

    fn keep_end(&mut self, event: &Event) {
        if self.ends.len() >= ENDS_MAX {
            self.ends.pop_front();
        }
        self.ends.push_back(event.clone());
    }

    pub(super) fn state(&self) -> Option<&MachineState> {
        self.state.as_ref().map(|(_, state)| state)
    }

    /// What a new face gets first, oldest first.
    pub(super) fn events(&self) -> Vec<Event> {
        let settings = self.settings.iter();
        let settings = settings
            .map(|(at, settings)| Event { at: *at, output: Output::Settings(settings.clone()) });
        let state = self.state.iter();
        let state =
            state.map(|(at, state)| Event { at: *at, output: Output::State(state.clone()) });
        let probes = self.probes.iter().cloned();
        settings.chain(self.ends.iter().cloned()).chain(probes).chain(state).collect()
    }
}

/// The paths that can be run.
#[derive(Debug, Default)]
pub(super) struct Paths {
    newest_last: VecDeque<Held>,
    collecting: Option<Collected>,
    /// Of what is collected, waits for its check or is being checked.
    unchecked_bytes: usize,
}

/// A path as it came, not checked yet.
#[derive(Debug)]
pub(super) struct Collected {
    pub(super) manifest: wire::CompensatedPath,
    collector: Collector<wire::PathChunk>,
    bytes: usize,
    items: u64,
}

#[derive(Debug)]
struct Held {
    program_id: String,
    revision: u64,
    sha256: String,
    path: Arc<CompensatedPath>,
}

/// Why a path was not taken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct PathRefusal {
    pub(super) program_id: String,
    pub(super) revision: u64,
    pub(super) message: String,
}

impl Paths {
    /// Begins to collect; what was being collected is dropped.
    pub(super) fn begin(&mut self, manifest: wire::CompensatedPath) -> Result<(), PathRefusal> {
        self.drop_collected();
        if manifest.program_id.len() > NAME_BYTES_MAX {
            let text = format!("the program's name is longer than {NAME_BYTES_MAX} bytes");
            return Err(refusal(&manifest, &text));
        }
        // One that announces too much takes the place of none that is here.
        let collector =
            Collector::for_path(&manifest).map_err(|error| refusal(&manifest, &error))?;
        let (elements, events) = (manifest.element_count, manifest.event_count);
        // The planner has refused such a program already, if it is one of ours.
        check_length(elements, events).map_err(|error| {
            refusal(&manifest, &format_args!("{error}: {}", PathTooLong::help()))
        })?;
        // What runs is held by the driver too.
        let needed = path_bytes(elements, events);
        while !self.newest_last.is_empty()
            && self.newest_last.iter().map(Held::bytes).sum::<u64>() + needed > PATHS_BYTES_MAX
        {
            self.newest_last.pop_front();
        }
        self.collecting = Some(Collected { manifest, collector, bytes: 0, items: 0 });
        Ok(())
    }

    /// Adds a chunk, which came in so many bytes, to what is being collected.
    pub(super) fn add(&mut self, chunk: wire::PathChunk, bytes: usize) -> Result<(), PathRefusal> {
        let Some(collected) = &mut self.collecting else { return Ok(()) };
        let bytes = bytes + CHUNK_BYTES;
        collected.bytes += bytes;
        self.unchecked_bytes += bytes;
        let added = if self.unchecked_bytes > UNCHECKED_BYTES_MAX {
            let text = format!(
                "the chunks of paths that are not checked yet take more than {} MB",
                UNCHECKED_BYTES_MAX >> 20
            );
            Err(refusal(&collected.manifest, &text))
        } else {
            collected.add(chunk)
        };
        if added.is_err() {
            self.drop_collected();
        }
        added
    }

    fn drop_collected(&mut self) {
        if let Some(collected) = self.collecting.take() {
            self.forget(collected.bytes);
        }
    }

    /// Takes what was collected out, to be [`Collected::checked`] without holding anything up;
    /// [`Self::forget`] follows.
    pub(super) fn end(&mut self) -> Option<Collected> {
        self.collecting.take()
    }

    /// So many bytes that were taken out with [`Self::end`] are checked, or dropped.
    pub(super) fn forget(&mut self, bytes: usize) {
        self.unchecked_bytes -= bytes;
    }

    /// Puts a path in, in the place of one of the same program and revision.
    pub(super) fn put(&mut self, manifest: &wire::CompensatedPath, path: Arc<CompensatedPath>) {
        let (program_id, revision) = (manifest.program_id.clone(), manifest.revision);
        self.newest_last
            .retain(|held| (&held.program_id, held.revision) != (&program_id, revision));
        if self.newest_last.len() >= PATHS_MAX {
            self.newest_last.pop_front();
        }
        let sha256 = manifest.sha256.clone();
        self.newest_last.push_back(Held { program_id, revision, sha256, path });
    }

    pub(super) fn get(&self, program_id: &str, revision: u64) -> Option<Arc<CompensatedPath>> {
        let mut newest_first = self.newest_last.iter().rev();
        let is_meant = |held: &&Held| held.program_id == program_id && held.revision == revision;
        newest_first.find(is_meant).map(|held| Arc::clone(&held.path))
    }

    pub(super) fn list(&self) -> Vec<PathHere> {
        let here = |held: &Held| PathHere {
            program_id: held.program_id.clone(),
            revision: held.revision,
            sha256: held.sha256.clone(),
            functions: CalledFunction::all_of(&held.path),
        };
        self.newest_last.iter().map(here).collect()
    }
}

impl Collected {
    pub(super) fn bytes(&self) -> usize {
        self.bytes
    }

    fn add(&mut self, chunk: wire::PathChunk) -> Result<(), PathRefusal> {
        let announced = self.manifest.element_count + self.manifest.event_count;
        // A chunk that comes twice is counted twice; the face sends none twice.
        self.items += (chunk.elements.len() + chunk.events.len()) as u64;
        if self.items > announced {
            let items = self.items;
            let text =
                format!("the chunks hold {items} items so far; the manifest announced {announced}");
            return Err(refusal(&self.manifest, &text));
        }
        self.collector.add(chunk).map_err(|error| refusal(&self.manifest, &error))
    }

    /// Makes a path of what was collected.
    pub(super) fn checked(self) -> Result<Arc<CompensatedPath>, PathRefusal> {
        let Self { manifest, collector, .. } = self;
        collector.finish(&manifest).map(Arc::new).map_err(|error| refusal(&manifest, &error))
    }
}

impl Held {
    fn bytes(&self) -> u64 {
        path_bytes(self.path.elements.len() as u64, self.path.events.len() as u64)
    }
}

pub(super) fn refusal(
    manifest: &wire::CompensatedPath,
    error: &dyn std::fmt::Display,
) -> PathRefusal {
    PathRefusal {
        program_id: manifest.program_id.clone(),
        revision: manifest.revision,
        message: error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::driver::{Refusal, RunOutcome, RunResult};
    use cnc_msgs::chunk::PathChunks;
    use cnc_msgs::machine::Mode;

    fn event(at: u64, output: Output) -> Event {
        Event { at: Duration::from_secs(at), output }
    }

    fn state(mode: Mode) -> Output {
        Output::State(MachineState { mode, ..MachineState::default() })
    }

    #[test]
    fn a_new_face_gets_the_newest_state_and_how_everything_ended() {
        let mut memory = Memory::default();
        let end = Output::RunFinished(RunResult {
            id: 3,
            outcome: RunOutcome::Succeeded,
            error_code: 0,
            message: "done".into(),
            last_line: 9,
            blamed_line: 0,
            last_occurrence: 0,
        });
        let reply = |id| Output::Reply { id, result: Ok("done".into()) };
        memory.note(3, &Command::Home);
        memory.note(2, &Command::Heartbeat);
        for event in [
            event(1, state(Mode::Idle)),
            // Of what has no end nobody asks later.
            event(1, reply(2)),
            event(2, reply(3)),
            event(3, Output::Progress { line: 1, fraction: 0.1, time_left_s: 2.0 }),
            event(4, state(Mode::Run)),
            event(5, end.clone()),
        ] {
            memory.remember(&event);
        }
        let expected = [event(2, reply(3)), event(5, end), event(4, state(Mode::Run))];
        assert_eq!(memory.events(), expected);
        assert_eq!(memory.next_id(), 4);
    }

    #[test]
    fn what_is_kept_has_a_bound_and_a_value_can_be_replaced_and_forgotten() {
        let mut memory = Memory::default();
        let half = vec![0; KEPT_BYTES_MAX / 2];
        memory.keep("a".into(), Some(half.clone())).expect("room");
        assert!(memory.keep("b".into(), Some(half.clone())).is_err());
        memory.keep("a".into(), Some(half.clone())).expect("in its own place");
        memory.keep("a".into(), None).expect("nothing");
        memory.keep("b".into(), Some(half)).expect("room again");
        assert_eq!(memory.kept().map(|(key, _)| key.as_str()).collect::<Vec<_>>(), ["b"]);
        let kept = (0..10_000).filter(|n| memory.keep(n.to_string(), Some(vec![])).is_ok()).count();
        assert_eq!(kept, KEPT_MAX - 1, "besides b");
        memory.keep("b".into(), Some(vec![1])).expect("it is there already");
        for id in 0..1000 {
            let refusal = Refusal { error_code: 1, message: String::new() };
            memory.note(id, &Command::Home);
            memory.remember(&event(id, Output::Reply { id, result: Err(refusal) }));
        }
        assert_eq!(memory.events().len(), ENDS_MAX);
    }

    #[test]
    fn a_path_is_found_by_program_and_revision_and_few_are_held() {
        let mut paths = Paths::default();
        let send = |paths: &mut Paths, revision: u64| {
            let path = Arc::new(CompensatedPath::default());
            let chunks = PathChunks::new("p".into(), revision, path);
            let manifest =
                wire::CompensatedPath { program_id: "p".into(), revision, ..chunks.manifest() };
            paths.begin(manifest).expect("a manifest");
            for index in 0..chunks.count() {
                paths.add(chunks.chunk(index).expect("a chunk"), 100).expect("of this path");
            }
            let collected = paths.end().expect("collected");
            let manifest = collected.manifest.clone();
            paths.forget(collected.bytes());
            paths.put(&manifest, collected.checked().expect("whole"));
        };
        for revision in 1..=4 {
            send(&mut paths, revision);
        }
        send(&mut paths, 4);
        let found = [1, 2, 3, 4, 5].map(|revision| paths.get("p", revision).is_some());
        assert_eq!(found, [false, true, true, true, false]);
        assert!(paths.get("q", 4).is_none());
        assert_eq!(paths.list().len(), PATHS_MAX);
        let endless = wire::CompensatedPath { element_count: u64::MAX, ..Default::default() };
        assert!(paths.begin(endless).is_err());
        assert_eq!(paths.list().len(), PATHS_MAX, "what is refused drops nothing");
    }

    #[test]
    fn five_million_elements_are_taken_and_what_would_fill_the_memory_is_not() {
        let mut paths = Paths::default();
        let manifest = |element_count, event_count| wire::CompensatedPath {
            element_count,
            event_count,
            chunk_count: 100_000,
            ..Default::default()
        };
        paths.begin(manifest(5_000_000, 100_000)).expect("a long program");
        let refused = paths.begin(manifest(50_000_000, 0)).expect_err("gigabytes").message;
        assert!(
            refused.starts_with("a path of 50000000 elements and 0 functions takes "),
            "{refused}"
        );
        assert!(
            refused.contains(" MB of the driver's memory; 768 MB are allowed: split"),
            "{refused}"
        );
        // The checksum of an empty chunk is that of two empty lists.
        let crc32 = cnc_msgs::chunk::crc32(&[0; 8]);
        let chunk =
            |index| wire::PathChunk { index, crc32, chunk_count: 100_000, ..Default::default() };
        paths.begin(manifest(5_000_000, 0)).expect("a long program");
        let added = (0..5_000).map(|index| paths.add(chunk(index), 1 << 20));
        let refused = added.filter_map(Result::err).next().expect("too much").message;
        assert!(refused.contains("take more than 1024 MB"), "{refused}");
        assert_eq!(paths.unchecked_bytes, 0, "and none of it is kept");
        paths.begin(manifest(100_000, 0)).expect("a path");
        paths.add(chunk(0), 1 << 20).expect("there is room again");
    }

    #[test]
    fn chunks_that_hold_more_than_was_announced_are_refused_at_once() {
        let mut paths = Paths::default();
        let announced =
            wire::CompensatedPath { chunk_count: 1, event_count: 1, ..Default::default() };
        paths.begin(announced).expect("a path");
        let events = vec![wire::PathEvent::default(); 2];
        let chunk = wire::PathChunk { chunk_count: 1, events, ..Default::default() };
        let refused = paths.add(chunk, 200).expect_err("one too many").message;
        assert_eq!(refused, "the chunks hold 2 items so far; the manifest announced 1");
        assert!(paths.end().is_none());
    }
}
