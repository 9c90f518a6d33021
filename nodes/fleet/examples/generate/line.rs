//! Both ends of a serial line, and the bag of what is published.

use super::Event;
use axis_driver::driver::{
    Command, Driver, DriverConfig, Input, Output, Overrides, RunOutcome, RunRequest,
};
use axis_driver::journal::{Entry, Journal, kind_to_wire};
use axis_driver::node::settings_to_wire;
use cnc_msgs::cdr;
use cnc_msgs::convert::machine_state_to_wire;
use cnc_msgs::interface::Message;
use cnc_msgs::machine::Mode;
use cnc_msgs::schema::TypeInfo;
use cnc_msgs::wire::builtin_interfaces::msg::{Duration as WireDuration, Time};
use cnc_msgs::wire::cnc_msgs::msg as wire;
use cnc_msgs::wire::std_msgs::msg::Header;
use run_recorder::bag_writer::{BagWriter, ChannelIndex, ChannelSpec};
use run_recorder::qos::QosProfile;
use std::collections::BTreeMap;
use std::time::Duration;
use virtual_controller::{Build, Controller, Fault, FaultInjector, LineTiming, PacedLine};

/// Entries in one message of the driver.
const BATCH: usize = 32;
/// The longest run, machine time.
const RUN_MAX: Duration = Duration::from_secs(600);

/// A bag that is written into memory.
pub(super) struct BagInMemory {
    writer: BagWriter<Vec<u8>>,
    channels: BTreeMap<&'static str, ChannelIndex>,
    begin_ns: u64,
    machine: String,
}

impl BagInMemory {
    pub(super) fn new(begin_ns: u64, machine: &str) -> Self {
        let writer = BagWriter::new(Vec::new()).expect("a bag can be begun");
        Self { writer, channels: BTreeMap::new(), begin_ns, machine: machine.to_owned() }
    }

    pub(super) fn put<M: Message>(&mut self, topic: &'static str, at: Duration, message: &M) {
        let info = TypeInfo::of::<M>();
        let (writer, machine) = (&mut self.writer, &self.machine);
        let channel = self.channels.entry(topic).or_insert_with(|| {
            let spec = ChannelSpec {
                topic: format!("/{machine}/{topic}"),
                type_name: info.name.to_owned(),
                schema_text: info.schema_text.to_owned(),
                type_hash: info.rihs01.to_owned(),
                qos: vec![QosProfile::reliable(10)],
            };
            writer.add_channel(&spec).expect("a topic of ours")
        });
        let at_ns = self.begin_ns + u64::try_from(at.as_nanos()).expect("584 years fit");
        let data = cdr::encapsulated(message);
        self.writer.write(*channel, at_ns, at_ns, &data).expect("a message can be written");
    }

    pub(super) fn metadata(&mut self, name: &str, values: &BTreeMap<String, String>) {
        self.writer.write_metadata(name, values).expect("a record can be written");
    }

    pub(super) fn finish(self, name: &str) -> Vec<u8> {
        self.writer.finish(name, &BTreeMap::new()).expect("a bag can be closed").0
    }

    fn stamp(&self, at: Duration) -> Time {
        time(at + Duration::from_nanos(self.begin_ns))
    }
}

fn time(at: Duration) -> Time {
    let sec = i32::try_from(at.as_secs()).expect("68 years fit");
    Time { sec, nanosec: at.subsec_nanos() }
}

/// A driver and a controller on one line.
pub(super) struct Run {
    driver: Driver,
    controller: PacedLine<FaultInjector>,
    journal: Journal,
    entries: Vec<wire::TrafficEntry>,
    now: Duration,
    result: Option<wire::RunResult>,
    bag: Option<BagInMemory>,
    next_id: u64,
}

impl Run {
    pub(super) fn new(bag: BagInMemory, build: Build, faults: &[&str]) -> Self {
        let config = DriverConfig::default();
        let timing = LineTiming { baud: Some(config.baud), ..LineTiming::default() };
        let faults = faults.iter().map(|it| it.parse::<Fault>().expect("a fault")).collect();
        let device = FaultInjector::new(Controller::with_build(build), faults, 1);
        let mut run = Self {
            driver: Driver::new(config),
            controller: PacedLine::new(device, timing),
            journal: Journal::default(),
            entries: Vec::new(),
            now: Duration::ZERO,
            result: None,
            bag: Some(bag),
            next_id: 1,
        };
        run.handle(Input::PortOpened);
        run
    }

    /// Runs a path; what the operator does happens while the machine cuts.
    pub(super) fn run_out(
        &mut self,
        request: RunRequest,
        event: Event,
    ) -> (wire::RunResult, BagInMemory, Duration) {
        self.until(|run| run.mode() == Mode::Idle);
        self.command(Command::RunProgram(request));
        let mut to_come = Some(event);
        while self.result.is_none() {
            assert!(self.now < RUN_MAX, "the run of {event:?} does not end: {:?}", self.mode());
            self.step();
            let state = self.driver.state(self.now);
            if state.mode == Mode::ToolChange {
                self.command(Command::ConfirmToolChange { objection: None });
            }
            if state.mode == Mode::Run
                && state.line >= 5
                && let Some(event) = to_come.take()
            {
                match event {
                    Event::Hold => {
                        self.command(Command::FeedHold);
                        self.until(|run| run.mode() == Mode::Hold);
                        let until = self.now + Duration::from_secs(2);
                        self.until(|run| run.now >= until);
                        self.command(Command::Resume);
                    }
                    Event::Override => {
                        self.command(Command::SetOverrides(Overrides {
                            feed: Some(80),
                            ..Overrides::default()
                        }));
                    }
                    Event::Cancel => self.command(Command::CancelRun { run: None }),
                    Event::None | Event::Reset | Event::Limit => {}
                }
            }
        }
        // As run_recorder does: until the machine stands.
        let until = self.now + Duration::from_millis(500);
        self.until(|run| run.now >= until);
        self.publish_entries();
        let result = self.result.take().expect("it has ended");
        (result, self.bag.take().expect("a bag"), self.now)
    }

    fn mode(&self) -> Mode {
        self.driver.state(self.now).mode
    }

    fn bag(&mut self) -> &mut BagInMemory {
        self.bag.as_mut().expect("it is taken at the end")
    }

    fn command(&mut self, command: Command) {
        let id = self.next_id;
        self.next_id += 1;
        self.handle(Input::Command { id, command });
    }

    fn handle(&mut self, input: Input) {
        let entry = self.journal.input(self.now, &input);
        self.enter(entry);
        self.driver.handle(self.now, input);
        let now = self.now;
        while let Some(output) = self.driver.poll_output() {
            match output {
                Output::Transmit(bytes) => {
                    let entry = self.journal.transmitted(now, &bytes);
                    self.enter(entry);
                    self.controller.receive(now, &bytes);
                }
                Output::State(state) => {
                    let header = Header { stamp: self.bag().stamp(now), ..Default::default() };
                    let state = machine_state_to_wire(header, &state);
                    self.bag().put("machine_state", now, &state);
                }
                Output::Settings(settings) => {
                    let (stamp, baud) = (self.bag().stamp(now), DriverConfig::default().baud);
                    let message = settings_to_wire(stamp, baud, &settings);
                    self.bag().put("controller_settings", now, &message);
                }
                Output::RunFinished(result) => {
                    let outcome = match result.outcome {
                        RunOutcome::Succeeded => wire::RunResult::OUTCOME_SUCCEEDED,
                        RunOutcome::Canceled => wire::RunResult::OUTCOME_CANCELED,
                        RunOutcome::Aborted => wire::RunResult::OUTCOME_ABORTED,
                    };
                    self.result = Some(wire::RunResult {
                        stamp: self.bag().stamp(now),
                        outcome,
                        error_code: result.error_code,
                        message: result.message,
                        last_line: result.last_line,
                        ..Default::default()
                    });
                }
                _ => {}
            }
        }
    }

    fn enter(&mut self, entry: Entry) {
        let Time { sec, nanosec } = time(self.now);
        let now = self.now;
        let stamp = self.bag().stamp(now);
        self.entries.push(wire::TrafficEntry {
            sequence: entry.sequence,
            kind: kind_to_wire(entry.kind),
            stamp,
            monotonic: WireDuration { sec, nanosec },
            data: entry.data,
        });
        if self.entries.len() >= BATCH {
            self.publish_entries();
        }
    }

    fn publish_entries(&mut self) {
        let (entries, now) = (std::mem::take(&mut self.entries), self.now);
        self.bag().put("controller_traffic", now, &wire::ControllerTraffic { entries });
    }

    fn until(&mut self, condition: impl Fn(&Self) -> bool) {
        while !condition(self) {
            assert!(self.now < RUN_MAX, "it never comes: {:?}", self.mode());
            self.step();
        }
    }

    fn step(&mut self) {
        let timer = self.driver.next_deadline();
        let event = self.controller.next_event();
        let next = timer.into_iter().chain(event).min().unwrap_or(self.now);
        self.now = self.now.max(next) + Duration::from_nanos(1);
        self.controller.advance(self.now);
        let mut bytes = Vec::new();
        self.controller.transmit(self.now, &mut bytes);
        if !bytes.is_empty() {
            self.handle(Input::Received(bytes));
        }
        if self.driver.next_deadline().is_some_and(|deadline| deadline <= self.now) {
            self.handle(Input::Timer);
        }
    }
}
