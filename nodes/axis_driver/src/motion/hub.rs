//! The middle of the motion process: between the driver, its face and local operators.
//!
//! Nothing here waits for a face: what it is to hear is in bounded queues and in the ring of
//! the journal, and a face that does not take it is replaced.

use super::connection::{Check, Unchecked, check_paths};
use super::memory::{Memory, PathRefusal, Paths, refusal};
use super::reading::read;
use crate::driver::{Command, LogLevel, Output, Refusal};
use crate::journal::{Entry, Ring, command_from_json};
use crate::protocol::Vital;
use crate::serial::{Event, Serial};
use cnc_msgs::machine::MachineState;
use std::collections::{BTreeMap, VecDeque};
use std::io;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Ids of commands that no face gives: of operators and of this process.
const OWN_IDS: u64 = 1 << 62;
/// Time over which entries are gathered before they go on.
const BATCH: Duration = Duration::from_millis(10);
/// Events that may wait for a face; telemetry goes first.
const EVENTS_MAX: usize = 4_096;
/// Entries that go to a face in one message, bytes.
const ENTRIES_BYTES: usize = 128 << 10;
/// What an entry takes besides its data, bytes.
const ENTRY_BYTES: usize = 32;
/// Paths that may wait while one is checked.
const UNCHECKED_MAX: usize = 1;

pub(super) type Reply = Result<String, Refusal>;

/// All that the threads of this process share.
pub(super) struct Hub {
    serial: Serial,
    /// Wall time at which the driver's clock showed zero, ns since 1970.
    pub(super) zero_wall_ns: i64,
    next_own_id: AtomicU64,
    is_closed: AtomicBool,
    state: Mutex<HubState>,
    /// Something waits for the face, or it is another.
    pub(super) news: Condvar,
    unchecked: SyncSender<Unchecked>,
}

#[derive(Debug, Default)]
struct HubState {
    ring: Ring,
    memory: Memory,
    paths: Paths,
    face: Option<Queue>,
    faces: u64,
    operators: BTreeMap<u64, SyncSender<Reply>>,
    local_stops: u64,
    /// Telemetry that no face has read in time, since the start.
    unread_dropped: u64,
}

/// What a face has still to hear.
#[derive(Debug)]
struct Queue {
    /// Which face; one that is gone takes nothing from the next.
    number: u64,
    events: VecDeque<Event>,
    next_entry: u64,
}

/// What a face is to hear next.
#[derive(Debug, Default)]
pub(super) struct News {
    pub(super) events: Vec<Event>,
    pub(super) entries: Vec<Entry>,
}

impl Hub {
    /// Starts the threads that listen to the driver.
    pub(super) fn start(
        serial: Serial,
        events: Receiver<Event>,
        entries: Receiver<Entry>,
        check: Check,
    ) -> io::Result<Arc<Self>> {
        let wall = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        let zero = wall.unwrap_or_default().saturating_sub(serial.epoch().elapsed());
        let (unchecked, jobs) = sync_channel(UNCHECKED_MAX);
        let hub = Arc::new(Self {
            serial,
            zero_wall_ns: i64::try_from(zero.as_nanos()).unwrap_or(0),
            next_own_id: AtomicU64::new(OWN_IDS),
            is_closed: AtomicBool::new(false),
            state: Mutex::default(),
            news: Condvar::new(),
            unchecked,
        });
        let shared = Arc::clone(&hub);
        std::thread::Builder::new()
            .name("paths".into())
            .spawn(move || check_paths(&shared, &jobs, check))?;
        let shared = Arc::clone(&hub);
        std::thread::Builder::new().name("driver events".into()).spawn(move || {
            while let Ok(event) = events.recv() {
                shared.take_event(event);
            }
        })?;
        let shared = Arc::clone(&hub);
        std::thread::Builder::new()
            .name("journal".into())
            .spawn(move || gather(&entries, |batch| shared.take_entries(&batch)))?;
        Ok(hub)
    }

    fn state(&self) -> MutexGuard<'_, HubState> {
        // Nothing in it is left half done by a panic.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take_event(&self, event: Event) {
        if event.output == Output::ReadyToClose {
            self.is_closed.store(true, Ordering::Relaxed);
        }
        let mut state = self.state();
        if let Output::Reply { id, result } = &event.output
            && *id >= OWN_IDS
        {
            if let Some(operator) = state.operators.remove(id) {
                // It may have given up.
                let _ = operator.try_send(result.clone());
            }
            return;
        }
        state.memory.remember(&event);
        let unsent = state.send(event);
        drop(state);
        self.news.notify_all();
        // There is nobody else to log it.
        unsent.iter().for_each(|event| log(&event.output));
    }

    fn take_entries(&self, batch: &[Entry]) {
        let mut state = self.state();
        batch.iter().for_each(|entry| state.ring.push(entry));
        drop(state);
        self.news.notify_all();
    }

    /// Whether the driver has been shut down.
    pub(super) fn is_closed(&self) -> bool {
        self.is_closed.load(Ordering::Relaxed)
    }

    /// The serial line, for what needs no more than that.
    pub(super) fn serial(&self) -> &Serial {
        &self.serial
    }

    /// Gives the driver a command of this process, whose answer nobody waits for.
    pub(super) fn order(&self, command: &Command) {
        let id = self.next_own_id.fetch_add(1, Ordering::Relaxed);
        if self.serial.command(id, command.clone()).is_err() {
            tracing::error!("the driver does not take {command:?}: too many commands wait");
        }
    }

    /// Gives the driver the command of an operator, and waits for the answer.
    pub(super) fn ask(&self, command: Command, within: Duration) -> Reply {
        let id = self.next_own_id.fetch_add(1, Ordering::Relaxed);
        let (sender, answer) = sync_channel(1);
        let is_sent = {
            let mut state = self.state();
            state.local_stops += u64::from(command.stops_whatever_moves());
            state.operators.insert(id, sender);
            self.serial.command(id, command).is_ok()
        };
        let answer = if is_sent { answer.recv_timeout(within).ok() } else { None };
        self.state().operators.remove(&id);
        let no_answer = || {
            let message = "the driver did not answer; the machine may be moving".into();
            Err(Refusal { error_code: crate::codes::error_code::NO_ANSWER, message })
        };
        answer.unwrap_or_else(no_answer)
    }

    /// Hands on a command that a face has given. What cannot be handed on is answered here.
    pub(super) fn command(&self, json: &str, local_stops: Option<u64>) {
        let command = self.read_command(json);
        let mut state = self.state();
        let refuse = |id, error_code, message: String| {
            let output = Output::Reply { id, result: Err(Refusal { error_code, message }) };
            Event { at: self.serial.epoch().elapsed(), output }
        };
        let refusal = match command {
            Ok((id, _)) if id >= OWN_IDS => {
                drop(state);
                return tracing::error!(
                    "a command of the ROS side has id {id}, which does not belong to it"
                );
            }
            Ok((id, command)) => {
                state.memory.note(id, &command);
                if local_stops.is_some_and(|known| known != state.local_stops) {
                    let text =
                        "somebody stopped the machine before the command began: send it again";
                    refuse(id, crate::codes::error_code::CANCELED, text.into())
                } else if self.serial.command(id, command).is_err() {
                    let text = "too many commands wait for the driver";
                    refuse(id, crate::codes::error_code::NO_ANSWER, text.into())
                } else {
                    return;
                }
            }
            Err(error) => {
                let Some(id) = id_of(json) else {
                    drop(state);
                    return tracing::error!("a command of the ROS side has no id: {error}");
                };
                refuse(id, crate::codes::error_code::NO_ANSWER, error)
            }
        };
        let unsent = state.send(refusal);
        drop(state);
        self.news.notify_all();
        unsent.iter().for_each(|event| log(&event.output));
    }

    /// Reads a command. No lock is held meanwhile: a defect is logged, which may take its time.
    fn read_command(&self, json: &str) -> Result<(u64, Command), String> {
        let lookup = |program_id: &str, revision| self.paths(|it| it.get(program_id, revision));
        let command = read("a command", || {
            command_from_json(json.as_bytes(), &lookup).map_err(|error| error.to_string())
        });
        command.flatten()
    }

    /// What outlives a face.
    pub(super) fn memory<R>(&self, look: impl FnOnce(&mut Memory) -> R) -> R {
        look(&mut self.state().memory)
    }

    pub(super) fn paths<R>(&self, look: impl FnOnce(&mut Paths) -> R) -> R {
        look(&mut self.state().paths)
    }

    /// Has a path checked; the answer goes where the job says. One that cannot wait is refused.
    pub(super) fn check(&self, job: Unchecked) -> Result<(), PathRefusal> {
        let Err(error) = self.unchecked.try_send(job) else { return Ok(()) };
        let (TrySendError::Full(job) | TrySendError::Disconnected(job)) = error;
        self.paths(|paths| paths.forget(job.collected.bytes()));
        let text =
            "an earlier path is still being checked, and another one waits: send it again later";
        Err(refusal(&job.collected.manifest, &text))
    }

    /// The newest state, with the age of what was heard.
    pub(super) fn machine_state(&self) -> MachineState {
        let state = self.state().memory.state().cloned().unwrap_or_default();
        MachineState { link_age_s: self.serial.link_age_s(), ..state }
    }

    /// From now on there is a face, which hears everything from the beginning of the ring on.
    /// Returns its number and what it hears first.
    pub(super) fn greet(&self) -> (u64, Vec<Event>) {
        let mut state = self.state();
        state.faces += 1;
        let (number, next_entry) = (state.faces, state.ring.oldest());
        state.face = Some(Queue { number, events: VecDeque::new(), next_entry });
        (number, state.memory.events())
    }

    /// The face has gone; what it did not take is returned.
    pub(super) fn forget(&self, number: u64) -> VecDeque<Event> {
        let mut state = self.state();
        let unsent = state.face.take_if(|queue| queue.number == number);
        drop(state);
        self.news.notify_all();
        unsent.map_or_else(VecDeque::new, |queue| queue.events)
    }

    /// Whether there is a face that listens.
    pub(super) fn has_face(&self) -> bool {
        self.state().face.is_some()
    }

    pub(super) fn vital(&self) -> Vital {
        let dropped = self.serial.dropped();
        let age = Duration::try_from_secs_f64(self.serial.link_age_s()).ok();
        let last_report = age.map(|age| self.serial.epoch().elapsed().saturating_sub(age));
        let state = self.state();
        Vital {
            last_report_ns: last_report.map(ns),
            events_dropped: dropped.events + state.unread_dropped,
            entries_dropped: dropped.entries,
            local_stops: state.local_stops,
        }
    }

    /// Waits for news of the face with this number; `None` when there is another.
    pub(super) fn wait(&self, number: u64, until: Instant) -> Option<News> {
        let mut state = self.state();
        loop {
            let newest = state.ring.newest();
            let queue = state.face.as_mut().filter(|queue| queue.number == number)?;
            let patience = until.saturating_duration_since(Instant::now());
            if !queue.events.is_empty() || queue.next_entry <= newest || patience.is_zero() {
                break;
            }
            let waited = self.news.wait_timeout(state, patience);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        let HubState { ring, face, .. } = &mut *state;
        let queue = face.as_mut()?;
        let events = queue.events.drain(..).collect();
        let mut bytes = 0;
        let within = |entry: &Entry| {
            bytes += ENTRY_BYTES + entry.data.len();
            bytes <= ENTRIES_BYTES || bytes == ENTRY_BYTES + entry.data.len()
        };
        let entries: Vec<Entry> = ring.from(queue.next_entry).take_while(within).collect();
        if let Some(last) = entries.last() {
            queue.next_entry = last.sequence + 1;
        }
        Some(News { events, entries })
    }
}

impl HubState {
    /// Sends something to the face; returns what no face will get. A face that has left
    /// so much unread that an answer or a result would have to be dropped is given up: the next
    /// one gets all ends.
    fn send(&mut self, event: Event) -> VecDeque<Event> {
        let Some(queue) = &mut self.face else { return [event].into() };
        queue.events.push_back(event);
        if queue.events.len() <= EVENTS_MAX {
            return VecDeque::new();
        }
        if queue.drop_telemetry() {
            self.unread_dropped += 1;
            return VecDeque::new();
        }
        let message =
            format!("the ROS side has not taken {EVENTS_MAX} answers and results; it is replaced");
        let mut unsent = self.face.take().map(|queue| queue.events).unwrap_or_default();
        // The caller logs it, when it holds no lock.
        let output = Output::Log { level: LogLevel::Error, message };
        unsent.extend(unsent.back().map(|last| Event { at: last.at, output }));
        unsent
    }
}

impl Queue {
    /// Makes room for one event; whether that was possible.
    fn drop_telemetry(&mut self) -> bool {
        let is_telemetry = |event: &Event| {
            matches!(event.output, Output::State(_) | Output::Progress { .. } | Output::Log { .. })
        };
        let oldest = self.events.iter().position(is_telemetry);
        oldest.and_then(|oldest| self.events.remove(oldest)).is_some()
    }
}

/// Logs what the driver says while there is no face to do it.
pub(super) fn log(output: &Output) {
    let Output::Log { level, message } = output else { return };
    match level {
        LogLevel::Info => tracing::info!("{message}"),
        LogLevel::Warn => tracing::warn!("{message}"),
        LogLevel::Error => tracing::error!("{message}"),
    }
}

/// The id of a command that is not understood otherwise.
fn id_of(json: &str) -> Option<u64> {
    serde_json::from_str::<serde_json::Value>(json).ok()?.get("id")?.as_u64()
}

pub(super) fn ns(duration: Duration) -> u64 {
    // 584 years fit.
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// Hands on what has gathered, every [`BATCH`]; ends with the driver.
fn gather(entries: &Receiver<Entry>, push: impl Fn(Vec<Entry>)) {
    while let Ok(first) = entries.recv() {
        let (mut batch, end) = (vec![first], Instant::now() + BATCH);
        let is_over = loop {
            match entries.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(entry) => batch.push(entry),
                Err(RecvTimeoutError::Timeout) => break false,
                Err(RecvTimeoutError::Disconnected) => break true,
            }
        };
        push(batch);
        if is_over {
            break;
        }
    }
}

impl std::fmt::Debug for Hub {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Hub").finish_non_exhaustive()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::driver::DriverConfig;
    use crate::journal::{Order, order_to_json};
    use crate::motion::memory::Collected;
    use crate::serial::{Reopen, SerialConfig};

    /// A hub whose port nobody opens.
    fn hub() -> Arc<Hub> {
        hub_that_checks(Collected::checked)
    }

    pub(in crate::motion) fn hub_that_checks(check: Check) -> Arc<Hub> {
        let config = SerialConfig {
            path: "/nowhere".into(),
            dtr: None,
            rts: None,
            reopen: Reopen::WhenTold,
            driver: DriverConfig::default(),
        };
        let (event_sender, events) = sync_channel(16);
        let (entry_sender, entries) = sync_channel(16);
        let serial = Serial::start(config, event_sender, entry_sender).expect("threads");
        Hub::start(serial, events, entries, check).expect("threads")
    }

    #[test]
    fn an_id_that_is_not_of_a_face_spoils_no_later_one() {
        let hub = hub();
        let order = Order::from(Command::Heartbeat);
        for id in [OWN_IDS, u64::MAX, 7] {
            hub.command(&order_to_json(id, &order), None);
        }
        assert_eq!(hub.memory(|memory| memory.next_id()), 8);
    }

    #[test]
    fn what_a_face_did_not_take_is_left_when_it_goes() {
        let hub = hub();
        let (first, _) = hub.greet();
        let output = Output::Log { level: LogLevel::Warn, message: "damage".into() };
        let event = Event { at: Duration::ZERO, output };
        hub.take_event(event.clone());
        assert!(hub.forget(first + 1).is_empty(), "another face");
        assert_eq!(hub.forget(first), [event]);
        assert!(!hub.has_face() && hub.forget(first).is_empty());
    }

    #[test]
    fn no_answer_is_dropped_from_what_waits_for_a_face_but_the_face() {
        let hub = hub();
        let (number, _) = hub.greet();
        let event = |output| Event { at: Duration::ZERO, output };
        let reply = |id| event(Output::Reply { id, result: Ok("done".into()) });
        let progress = Output::Progress { line: 1, fraction: 0.1, time_left_s: 2.0 };
        hub.take_event(event(progress));
        for id in 1..=EVENTS_MAX as u64 {
            hub.take_event(reply(id));
        }
        let news = hub.wait(number, Instant::now()).expect("the face is there");
        assert_eq!(news.events.len(), EVENTS_MAX, "telemetry goes first");
        assert_eq!(hub.vital().events_dropped, 1, "and is counted");
        assert_eq!(news.events[0], reply(1));
        for id in 0..=EVENTS_MAX as u64 {
            assert!(hub.has_face());
            hub.take_event(reply(id));
        }
        assert!(!hub.has_face() && hub.wait(number, Instant::now()).is_none());
    }
}
