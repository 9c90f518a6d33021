//! The discovered topics, their latched samples, and the open bag.

use super::numbers::Numbers;
use super::prelude::{KeptSample, Prelude};
use super::run_id::create_bag;
use crate::bag_writer::{ChannelIndex, ChannelSpec};
use crate::run_bag::{RecordingStatus, RunBag, RunBagError, RunBagOptions, SplitLimits};
use cnc_msgs::cdr;
use cnc_msgs::interface::Message;
use cnc_msgs::machine::WAITING_FOR_RECORDER;
use cnc_msgs::schema::TypeInfo;
use cnc_msgs::wire::builtin_interfaces::msg::Time;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use runtime::{RawSample, RosTime};
use std::collections::BTreeMap;
use std::path::Path;

/// Publishers of a latched topic whose newest sample is kept, at most.
const PUBLISHERS_MAX: usize = 32;
/// Publishers of a topic whose newest number is known, at most.
const SAMPLES_MAX: usize = 256;

#[derive(Debug)]
struct Topic {
    spec: ChannelSpec,
    is_latched: bool,
    /// Of latched topics: the newest of each publisher.
    newest: BTreeMap<[u8; 16], KeptSample>,
    /// The newest sample of each publisher.
    samples: BTreeMap<[u8; 16], NewestSample>,
}

/// The number and log time of a publisher's newest sample.
#[derive(Debug, Clone, Copy)]
struct NewestSample {
    sequence: i64,
    log_time_ns: u64,
}

impl Topic {
    /// Records a sample after the others of its publisher: sets how many were missed before it,
    /// and its log time.
    ///
    /// Samples come in the order of their numbers. A sample that had to be resent arrived after
    /// those that follow it, and they are logged no earlier than it.
    fn order(&mut self, kept: &mut KeptSample) {
        let KeptSample { publisher, sequence, .. } = *kept;
        if self.samples.len() >= SAMPLES_MAX && !self.samples.contains_key(&publisher) {
            self.samples.pop_first();
        }
        let newest = NewestSample { sequence, log_time_ns: kept.log_time_ns };
        let newest = self.samples.entry(publisher).or_insert(newest);
        let missed = sequence.saturating_sub(newest.sequence).saturating_sub(1);
        // A publisher with impossible numbers counts as missing nothing.
        kept.missed_before = u32::try_from(missed).unwrap_or(0);
        kept.log_time_ns = kept.log_time_ns.max(newest.log_time_ns);
        newest.sequence = sequence.max(newest.sequence);
        newest.log_time_ns = kept.log_time_ns;
    }
}

/// All topics, in the order in which they were seen.
#[derive(Debug, Default)]
pub(super) struct Store {
    topics: Vec<Topic>,
    prelude: Prelude,
}

impl Store {
    pub(super) fn knows(&self, topic: &str) -> bool {
        self.topics.iter().any(|known| known.spec.topic == topic)
    }

    /// Adds a topic and returns its number.
    pub(super) fn add(&mut self, spec: ChannelSpec, is_latched: bool) -> usize {
        self.topics.push(Topic {
            spec,
            is_latched,
            newest: BTreeMap::new(),
            samples: BTreeMap::new(),
        });
        self.topics.len() - 1
    }

    /// Takes a sample: into the bag if one is open, and into memory if late joiners would get it or
    /// the next bag begins with it.
    pub(super) fn take(&mut self, open: Option<&mut OpenRun>, index: usize, sample: RawSample) {
        let mut kept = KeptSample::new(sample);
        let publisher = kept.publisher;
        let topic = &mut self.topics[index];
        topic.order(&mut kept);
        let mut followed = None;
        if topic.is_latched {
            if topic.newest.len() >= PUBLISHERS_MAX && !topic.newest.contains_key(&publisher) {
                topic.newest.pop_first();
            }
            followed = topic.newest.insert(publisher, kept.clone());
        }
        match open {
            Some(open) => open.write(index, &topic.spec.type_name, kept),
            // Earlier traffic is fetched from the driver, which numbers every entry.
            // Earlier machine states show how the machine came to its state at the beginning.
            None if topic.spec.type_name == wire::MachineState::TYPE_NAME => {
                followed.into_iter().for_each(|before| self.prelude.push(index, before));
            }
            None if topic.is_latched || is_traffic(&topic.spec.type_name) => {}
            None => self.prelude.push(index, kept),
        }
    }

    /// The program and path that are loaded and planned now.
    pub(super) fn wanted(&self) -> RunInputs {
        RunInputs { program: self.latched(), contour: self.latched(), path: self.latched() }
    }

    /// Whether the machine may be moving, as far as its driver knows.
    pub(super) fn motion_possible(&self) -> bool {
        self.latched::<wire::MachineState>().is_some_and(|state| state.motion_possible)
    }

    /// Whether the driver has sent nothing yet because it waits for the recorder; `None` if it
    /// has published no state.
    pub(super) fn waits_for_recorder(&self) -> Option<bool> {
        let state = self.latched::<wire::MachineState>()?;
        Some(state.reason.starts_with(WAITING_FOR_RECORDER))
    }

    /// The newest message of a latched topic of this type.
    fn latched<M: Message>(&self) -> Option<M> {
        let topic = self.topics.iter().find(|topic| topic.spec.type_name == M::TYPE_NAME)?;
        let newest = topic.newest.values().max_by_key(|kept| kept.log_time_ns)?;
        cdr::decode(&newest.bytes).ok()
    }
}

fn is_traffic(type_name: &str) -> bool {
    type_name == wire::ControllerTraffic::TYPE_NAME
}

/// The inputs that have to be fetched when a run begins.
#[derive(Debug, Default)]
pub(super) struct RunInputs {
    pub(super) program: Option<wire::Program>,
    pub(super) contour: Option<wire::ProgrammedContour>,
    pub(super) path: Option<wire::CompensatedPath>,
}

impl RunInputs {
    /// Inputs that no publisher has announced.
    pub(super) fn missing(&self) -> impl Iterator<Item = String> {
        [
            (self.program.is_none(), "program"),
            (self.contour.is_none(), "programmed contour"),
            (self.path.is_none(), "compensated path"),
        ]
        .into_iter()
        .filter(|(is_missing, _)| *is_missing)
        .map(|(_, what)| format!("no {what} was seen"))
    }
}

/// The `cnc_run` record of a run.
fn described(run_id: &str, goal: [u8; 16], wanted: &RunInputs) -> BTreeMap<String, String> {
    let mut run = BTreeMap::from([
        ("run_id".to_owned(), run_id.to_owned()),
        ("goal_id".to_owned(), cnc_msgs::chunk::hex(&goal)),
        ("software".to_owned(), concat!("kerf ", env!("CARGO_PKG_VERSION")).to_owned()),
        ("build".to_owned(), crate::COMMIT.unwrap_or("unknown").to_owned()),
    ]);
    if let Some(program) = &wanted.program {
        for (key, value) in [
            ("program", &program.name),
            ("program_id", &program.program_id),
            ("program_sha256", &program.sha256),
            ("control", &program.control),
        ] {
            run.insert(key.to_owned(), value.clone());
        }
    }
    run
}

/// The bag of the run that is under way.
#[derive(Debug)]
pub(super) struct OpenRun {
    pub(super) run_id: String,
    pub(super) goal: [u8; 16],
    pub(super) bag: RunBag,
    /// The traffic entries that are in the bag.
    pub(super) numbers: Numbers,
    /// Whether the program, contour and path were fetched as far as they are available.
    pub(super) has_inputs: bool,
    /// Whether the serial traffic begins early enough for a replay.
    pub(super) has_beginning: bool,
    /// The clock of the driver whose traffic is counted: wall time of its zero, ns.
    driver_zero_ns: Option<i64>,
    /// The driver was restarted: its numbers begin again.
    pub(super) driver_restarted: bool,
    /// The bag was begun after its goal, and it is not known yet what it misses.
    pub(super) is_beginning_unclear: bool,
    channels: BTreeMap<usize, ChannelIndex>,
}

impl OpenRun {
    /// Makes the bag and writes the messages that were kept for it.
    pub(super) fn create(
        directory: &Path,
        now: RosTime,
        goal: [u8; 16],
        wanted: &RunInputs,
        split: SplitLimits,
        store: &mut Store,
    ) -> Result<Self, RunBagError> {
        let (run_id, bag) = create_bag(now, goal, |run_id| {
            let mut options = RunBagOptions::new(directory, run_id);
            options.split = split;
            options.run = described(run_id, goal, wanted);
            options
        })?;
        let mut open = Self {
            run_id,
            goal,
            bag,
            numbers: Numbers::default(),
            has_inputs: false,
            has_beginning: false,
            driver_zero_ns: None,
            driver_restarted: false,
            is_beginning_unclear: false,
            channels: BTreeMap::new(),
        };
        for index in 0..store.topics.len() {
            open.add_channel(store, index);
        }
        let newest = store.topics.iter().enumerate().flat_map(|(index, topic)| {
            topic.newest.values().map(move |newest| (index, newest.clone()))
        });
        let newest = newest.collect();
        let now_ns = u64::try_from(RosTime::wall().as_nanos()).unwrap_or(0);
        for (index, kept) in store.prelude.take_with(newest, now_ns) {
            open.write(index, &store.topics[index].spec.type_name, kept);
        }
        // A disk that has failed is already reported in the status.
        let _ = open.bag.begin();
        Ok(open)
    }

    /// Whether it is known that writing works or has failed.
    pub(super) fn is_decided(&self) -> bool {
        let status = self.bag.status();
        status.error.is_some()
            || status.is_stalled
            || (status.has_begun && !self.is_beginning_unclear)
    }

    /// Adds a topic that was seen before or during the run.
    pub(super) fn add_channel(&mut self, store: &Store, index: usize) {
        match self.bag.add_channel(&store.topics[index].spec) {
            Ok(channel) => {
                self.channels.insert(index, channel);
            }
            Err(error) => self.bag.note_incomplete(error.to_string()),
        }
    }

    fn write(&mut self, index: usize, type_name: &str, kept: KeptSample) {
        let Some(&channel) = self.channels.get(&index) else { return };
        if is_traffic(type_name) {
            match cdr::decode::<wire::ControllerTraffic>(&kept.bytes) {
                Ok(traffic) => self.take_numbers(&traffic),
                Err(error) => self.bag.note_incomplete(error.to_string()),
            }
        }
        if kept.missed_before > 0 {
            self.bag.note_missed(channel, kept.missed_before);
        }
        self.bag.write(channel, kept.log_time_ns, kept.publish_time_ns, kept.bytes);
    }

    /// Records which traffic entries have arrived, from the first driver.
    ///
    /// A driver whose ROS process was restarted continues its numbers, on the same clock.
    fn take_numbers(&mut self, traffic: &wire::ControllerTraffic) {
        let Some(first) = traffic.entries.first() else { return };
        let zero_ns = zero_of_clock_ns(first);
        if *self.driver_zero_ns.get_or_insert(zero_ns) != zero_ns {
            self.driver_restarted = true;
            self.bag.note_incomplete("the driver was started again in the middle of the run");
            return;
        }
        for entry in &traffic.entries {
            self.numbers.add(entry.sequence);
        }
    }

    /// Whether fetched messages may be written: they wait while the queue is half full, so
    /// that messages that arrive meanwhile are not lost.
    pub(super) fn has_room(&self) -> bool {
        self.bag.has_room()
    }

    /// Writes traffic that was fetched.
    pub(super) fn add_traffic(&mut self, store: &Store, traffic: &wire::ControllerTraffic) {
        let Some(first) = traffic.entries.first() else { return };
        let at_ns = nanoseconds(&first.stamp);
        self.take_numbers(traffic);
        self.write_ours(store, at_ns, traffic);
    }

    /// Records what is missing in the bag; `problem` says why traffic is missing.
    pub(super) fn note_gaps(&mut self, problem: Option<String>) {
        let why = problem.unwrap_or_else(|| "the driver did not have it".into());
        if !self.has_inputs {
            self.bag.note_incomplete("the program and its path were not fetched in time");
        }
        if !self.has_beginning {
            self.bag.note_incomplete(format!("the serial traffic begins too late: {why}"));
        }
        match (self.numbers.first(), self.numbers.last()) {
            (Some(first), Some(last)) => {
                for gap in self.numbers.missing(first, last) {
                    self.bag.note_incomplete(format!(
                        "serial traffic {} to {} is missing: {why}",
                        gap.start(),
                        gap.end(),
                    ));
                }
            }
            _ => self.bag.note_incomplete(format!("no serial traffic was seen: {why}")),
        }
    }

    /// Writes a fetched message to the topic of its type.
    pub(super) fn write_ours<M: Message>(&mut self, store: &Store, at_ns: u64, message: &M) {
        let found = store.topics.iter().position(|topic| {
            topic.spec.type_name == M::TYPE_NAME
                && topic.spec.type_hash == TypeInfo::of::<M>().rihs01
        });
        match found.and_then(|index| self.channels.get(&index)) {
            Some(&channel) => {
                self.bag.write(channel, at_ns, at_ns, cdr::encapsulated(message));
            }
            None => self.bag.note_incomplete(format!("no topic of type {} was seen", M::TYPE_NAME)),
        }
    }

    /// The present status message of the bag.
    pub(super) fn message(&self, now: RosTime) -> wire::Recording {
        recording_message(now.into(), self.run_id.clone(), true, &self.bag.status())
    }
}

/// The status message of a bag.
pub(super) fn recording_message(
    stamp: Time,
    run_id: String,
    is_recording: bool,
    status: &RecordingStatus,
) -> wire::Recording {
    wire::Recording {
        stamp,
        run_id,
        uri: status.path.display().to_string(),
        is_recording,
        complete: status.complete,
        reason: status.reasons.join("; "),
        message_count: status.messages_written,
        size: status.bytes_written,
        lost_count: status.messages_lost,
    }
}

/// Wall time at the zero of the driver's clock, ns; each driver has another.
fn zero_of_clock_ns(entry: &wire::TrafficEntry) -> i64 {
    let wire::TrafficEntry { stamp, monotonic, .. } = entry;
    let ns = |sec: i32, nanosec: u32| i64::from(sec) * 1_000_000_000 + i64::from(nanosec);
    ns(stamp.sec, stamp.nanosec) - ns(monotonic.sec, monotonic.nanosec)
}

fn nanoseconds(stamp: &Time) -> u64 {
    u64::try_from(stamp.sec).unwrap_or(0) * 1_000_000_000 + u64::from(stamp.nanosec)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_of_a_publisher_are_counted_and_logged_in_their_order() {
        let spec = ChannelSpec {
            topic: "/a".into(),
            type_name: String::new(),
            schema_text: String::new(),
            type_hash: String::new(),
            qos: Vec::new(),
        };
        let mut store = Store::default();
        let index = store.add(spec, true);
        let (one, other) = ([1; 16], [2; 16]);
        // Number and time of arrival; how many before it did not come, and the time of the log.
        for (publisher, sequence, arrived, missed, logged) in [
            // Samples from before the first one received do not count as missed.
            (one, 7, 10, 0, 10),
            (one, 8, 40, 0, 40),
            (one, 11, 50, 2, 50),
            // Number 13 has an earlier arrival time than 12, and is received twice.
            (one, 12, 70, 0, 70),
            (one, 13, 60, 0, 70),
            (one, 13, 80, 0, 80),
            (other, 1, 5, 0, 5),
            (one, 14, 90, 0, 90),
            (other, 3, 6, 1, 6),
            (one, i64::MAX, 91, 0, 91),
            (one, i64::MIN, 92, 0, 92),
        ] {
            let mut kept = KeptSample {
                publisher,
                sequence,
                missed_before: 0,
                log_time_ns: arrived,
                publish_time_ns: 0,
                bytes: Vec::new(),
            };
            store.topics[index].order(&mut kept);
            let found = (kept.missed_before, kept.log_time_ns);
            assert_eq!(found, (missed, logged), "{publisher:?} {sequence}");
        }
    }
}
