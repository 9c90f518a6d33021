//! The topics that were seen, what late joiners would get of them, and the
//! bag that is open.

use super::fetch::Fetched;
use super::numbers::Numbers;
use crate::bag_writer::{BagAttachment, ChannelIndex, ChannelSpec};
use crate::run_bag::{RecordingStatus, RunBag, RunBagError, RunBagOptions};
use cnc_msgs::cdr;
use cnc_msgs::interface::Message;
use cnc_msgs::schema::TypeInfo;
use cnc_msgs::wire::builtin_interfaces::msg::Time;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use runtime::{Gid, RawSample, RosTime};
use std::collections::{BTreeMap, VecDeque};
use std::path::Path;

/// What is kept of the time before a run, nanoseconds and samples.
const PRELUDE_NS: u64 = 2_000_000_000;
const PRELUDE_SAMPLES: usize = 4_000;
/// Publishers of one latched topic of which the newest is kept.
const PUBLISHERS_MAX: usize = 32;

/// A sample and its times, nanoseconds since the epoch.
#[derive(Debug, Clone)]
struct Kept {
    publisher: [u8; 16],
    log_time_ns: u64,
    publish_time_ns: u64,
    bytes: Vec<u8>,
}

impl Kept {
    fn new(sample: RawSample) -> Self {
        let at = |time: RosTime| u64::try_from(time.as_nanos()).unwrap_or(0);
        let log_time_ns = at(sample.info.reception_time);
        let publish_time_ns = sample.info.source_time.map_or(log_time_ns, at);
        let Gid(publisher) = sample.info.publisher;
        Self { publisher, log_time_ns, publish_time_ns, bytes: sample.bytes }
    }
}

#[derive(Debug)]
struct Topic {
    spec: ChannelSpec,
    is_latched: bool,
    /// Of latched topics: the newest of each publisher.
    newest: BTreeMap<[u8; 16], Kept>,
}

/// All topics, in the order in which they were seen.
#[derive(Debug, Default)]
pub(super) struct Store {
    topics: Vec<Topic>,
    prelude: VecDeque<(usize, Kept)>,
}

impl Store {
    pub(super) fn knows(&self, topic: &str) -> bool {
        self.topics.iter().any(|known| known.spec.topic == topic)
    }

    /// Adds a topic and returns its number.
    pub(super) fn add(&mut self, spec: ChannelSpec, is_latched: bool) -> usize {
        self.topics.push(Topic { spec, is_latched, newest: BTreeMap::new() });
        self.topics.len() - 1
    }

    /// Takes a sample: into the bag if one is open, and to memory.
    pub(super) fn take(&mut self, open: Option<&mut OpenRun>, index: usize, sample: RawSample) {
        let kept = Kept::new(sample);
        let publisher = kept.publisher;
        let topic = &mut self.topics[index];
        if topic.is_latched {
            if topic.newest.len() >= PUBLISHERS_MAX && !topic.newest.contains_key(&publisher) {
                topic.newest.pop_first();
            }
            topic.newest.insert(publisher, kept.clone());
        }
        match open {
            Some(open) => open.write(index, &topic.spec.type_name, kept),
            // Traffic of before is fetched from the driver; it numbers every entry.
            None if topic.is_latched || is_traffic(&topic.spec.type_name) => {}
            None => {
                let oldest = kept.log_time_ns.saturating_sub(PRELUDE_NS);
                self.prelude.push_back((index, kept));
                while self.prelude.len() > PRELUDE_SAMPLES
                    || self.prelude.front().is_some_and(|(_, kept)| kept.log_time_ns < oldest)
                {
                    self.prelude.pop_front();
                }
            }
        }
    }

    /// What is loaded and planned now.
    pub(super) fn wanted(&self) -> Wanted {
        Wanted { program: self.latched(), contour: self.latched(), path: self.latched() }
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

/// What has to be fetched when a run begins.
#[derive(Debug, Default)]
pub(super) struct Wanted {
    pub(super) program: Option<wire::Program>,
    pub(super) contour: Option<wire::ProgrammedContour>,
    pub(super) path: Option<wire::CompensatedPath>,
}

impl Wanted {
    /// What nobody has told of.
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

/// The bag of the run that is under way.
#[derive(Debug)]
pub(super) struct OpenRun {
    pub(super) run_id: String,
    pub(super) bag: RunBag,
    /// The traffic entries that are in the bag.
    pub(super) numbers: Numbers,
    /// Whether the program, contour and path were asked for, and what was had is here.
    pub(super) has_inputs: bool,
    /// Whether the serial traffic is there from where it can be replayed.
    pub(super) has_beginning: bool,
    /// The driver whose traffic is counted.
    driver: Option<[u8; 16]>,
    /// Another driver was heard: its numbers begin anew.
    pub(super) driver_restarted: bool,
    channels: BTreeMap<usize, ChannelIndex>,
    wanted: Option<Wanted>,
}

impl OpenRun {
    /// Makes the bag and writes what was kept for it.
    pub(super) fn create(
        directory: &Path,
        now: RosTime,
        goal: [u8; 16],
        store: &mut Store,
    ) -> Result<Self, RunBagError> {
        let wanted = store.wanted();
        let run_id = run_id(now, goal);
        let mut options = RunBagOptions::new(directory, &run_id);
        options.run = BTreeMap::from([
            ("run_id".to_owned(), run_id.clone()),
            ("goal_id".to_owned(), cnc_msgs::chunk::hex(&goal)),
            ("software".to_owned(), concat!("kerf ", env!("CARGO_PKG_VERSION")).to_owned()),
        ]);
        if let Some(program) = &wanted.program {
            for (key, value) in [
                ("program", &program.name),
                ("program_id", &program.program_id),
                ("program_sha256", &program.sha256),
                ("controller", &program.controller),
            ] {
                options.run.insert(key.to_owned(), value.clone());
            }
        }
        let bag = RunBag::create(options)?;
        let mut open = Self {
            run_id,
            bag,
            numbers: Numbers::default(),
            has_inputs: false,
            has_beginning: false,
            driver: None,
            driver_restarted: false,
            channels: BTreeMap::new(),
            wanted: Some(wanted),
        };
        for index in 0..store.topics.len() {
            open.add_channel(store, index);
        }
        let mut kept: Vec<(usize, Kept)> = store.prelude.drain(..).collect();
        for (index, topic) in store.topics.iter().enumerate() {
            kept.extend(topic.newest.values().map(|newest| (index, newest.clone())));
        }
        kept.sort_by_key(|(_, kept)| kept.log_time_ns);
        for (index, kept) in kept {
            open.write(index, &store.topics[index].spec.type_name, kept);
        }
        // A disk that has failed already is told of by the status.
        let _ = open.bag.begin();
        Ok(open)
    }

    /// Whether it is known that the disk takes what is written, or that it does not.
    pub(super) fn is_decided(&self) -> bool {
        let status = self.bag.status();
        status.has_begun || status.error.is_some()
    }

    /// What has to be fetched; taken once.
    pub(super) fn wanted_before(&self) -> Wanted {
        match &self.wanted {
            Some(Wanted { program, contour, path }) => {
                Wanted { program: program.clone(), contour: contour.clone(), path: path.clone() }
            }
            None => Wanted::default(),
        }
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

    fn write(&mut self, index: usize, type_name: &str, kept: Kept) {
        let Some(&channel) = self.channels.get(&index) else { return };
        if is_traffic(type_name) && *self.driver.get_or_insert(kept.publisher) != kept.publisher {
            self.driver_restarted = true;
            self.bag.note_incomplete("the driver was started again in the middle of the run");
        } else if is_traffic(type_name) {
            match cdr::decode::<wire::ControllerTraffic>(&kept.bytes) {
                Ok(traffic) => {
                    for entry in &traffic.entries {
                        self.numbers.add(entry.sequence);
                    }
                }
                Err(error) => self.bag.note_incomplete(error.to_string()),
            }
        }
        self.bag.write(channel, kept.log_time_ns, kept.publish_time_ns, kept.bytes);
    }

    /// Writes what was fetched, on the topics where it would have come.
    pub(super) fn add_fetched(&mut self, store: &Store, fetched: Fetched) {
        self.has_inputs = true;
        for chunk in &fetched.program {
            self.write_ours(store, fetched.at_ns, chunk);
        }
        for chunk in &fetched.contour {
            self.write_ours(store, fetched.at_ns, chunk);
        }
        for chunk in &fetched.path {
            self.write_ours(store, fetched.at_ns, chunk);
        }
        if let Some((name, text)) = fetched.text {
            let attachment = BagAttachment {
                name,
                media_type: "text/plain".into(),
                log_time_ns: fetched.at_ns,
                data: text,
            };
            if let Err(error) = self.bag.attach(attachment) {
                self.bag.note_incomplete(error.to_string());
            }
        }
        for problem in fetched.problems {
            self.bag.note_incomplete(problem);
        }
    }

    /// Writes the traffic since the driver's newest checkpoint.
    pub(super) fn add_beginning(&mut self, store: &Store, fetched: super::fetch::FetchedTraffic) {
        self.has_beginning = fetched.problem.is_none() && !fetched.batches.is_empty();
        self.add_traffic(store, fetched);
    }

    /// Writes traffic that was fetched; returns why there is not more of it.
    pub(super) fn add_traffic(
        &mut self,
        store: &Store,
        fetched: super::fetch::FetchedTraffic,
    ) -> Option<String> {
        for traffic in fetched.batches {
            let Some(first) = traffic.entries.first() else { continue };
            let at_ns = nanoseconds(&first.stamp);
            for entry in &traffic.entries {
                self.numbers.add(entry.sequence);
            }
            self.write_ours(store, at_ns, &traffic);
        }
        fetched.problem
    }

    /// Notes what is not in the bag; `problem` says why traffic is missing.
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

    /// Writes a message of ours on the topic of its type.
    fn write_ours<M: Message>(&mut self, store: &Store, at_ns: u64, message: &M) {
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

    /// What is told of the bag now.
    pub(super) fn message(&self, now: RosTime) -> wire::Recording {
        recording_message(now.into(), self.run_id.clone(), true, &self.bag.status())
    }
}

/// What is told of a bag.
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

fn nanoseconds(stamp: &Time) -> u64 {
    u64::try_from(stamp.sec).unwrap_or(0) * 1_000_000_000 + u64::from(stamp.nanosec)
}

/// `run_20261121_004500_1a2b3c4d`: UTC and the beginning of the goal's id.
pub(super) fn run_id(now: RosTime, goal: [u8; 16]) -> String {
    let (sec, _) = now.parts();
    let (days, second) = (i64::from(sec).div_euclid(86_400), i64::from(sec).rem_euclid(86_400));
    let (year, month, day) = civil_from_days(days);
    format!(
        "run_{year:04}{month:02}{day:02}_{:02}{:02}{:02}_{}",
        second / 3600,
        second / 60 % 60,
        second % 60,
        cnc_msgs::chunk::hex(&goal[..4])
    )
}

/// Year, month and day of a number of days since 1970-01-01.
///
/// Source: the proleptic Gregorian calendar in eras of 400 years that begin on 1 March.
fn civil_from_days(days: i64) -> (i64, i64, i64) {
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted.div_euclid(146_097), shifted.rem_euclid(146_097));
    let year_of_era =
        (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    (year_of_era + era * 400 + i64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_named_by_the_second_in_utc() {
        let name = |sec| run_id(RosTime::from_parts(sec, 0), [0xab; 16]);
        assert_eq!(name(0), "run_19700101_000000_abababab");
        assert_eq!(name(951_782_399), "run_20000228_235959_abababab");
        assert_eq!(name(951_782_400), "run_20000229_000000_abababab");
        assert_eq!(name(1_795_222_861), "run_20261121_010101_abababab");
    }
}
