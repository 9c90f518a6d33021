//! A bag of a long run, made without ports, threads or clocks.
//!
//! A program of short segments goes through loader and planner. Driver and virtual controller run
//! it on one line in virtual time. Everything that a recorder would receive is written as
//! `run_recorder` writes it.

use axis_driver::driver::{Command, Driver, DriverConfig, Input, Output, RunRequest};
use axis_driver::journal::{Entry, Journal, kind_to_wire};
use cnc_msgs::cdr;
use cnc_msgs::chunk::{
    Collector, ContourChunks, PathChunks, ProgramChunks, program_id, sha256_hex,
};
use cnc_msgs::convert::machine_state_to_wire;
use cnc_msgs::interface::Message;
use cnc_msgs::machine::Mode;
use cnc_msgs::schema::TypeInfo;
use cnc_msgs::tool_table::ToolTable;
use cnc_msgs::wire::builtin_interfaces::msg::{Duration as WireDuration, Time};
use cnc_msgs::wire::cnc_msgs::msg as wire;
use cnc_msgs::wire::std_msgs::msg::Header;
use compensation_planner::report::{manifest_of, report_of};
use program_loader::{LoadOptions, load};
use run_recorder::bag_writer::{BagWriter, ChannelIndex, ChannelSpec};
use run_recorder::qos::QosProfile;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use virtual_controller::{Build, Controller, LineTiming, PacedLine, Settings};

/// When the driver was started, ns since the epoch.
const BEGIN_NS: u64 = 1_800_000_000_000_000_000;
/// Entries in one message of the driver.
const BATCH: usize = 32;
/// Of states closer than this, only some are published.
const STATE_PERIOD: Duration = Duration::from_millis(100);

/// Writes the bag of a run of this many blocks; returns its number of messages and its length.
pub(crate) fn write(file: &Path, blocks: u32) -> (u64, Duration) {
    let sink = BufWriter::new(File::create(file).expect("a file for the bag"));
    let mut bag = Bag {
        writer: BagWriter::new(sink).expect("a bag can be begun"),
        channels: BTreeMap::new(),
        count: 0,
    };
    let (id, path) = plan(&mut bag, blocks);
    let mut run = Run::new(bag);
    run.until(|run| run.driver.state(run.now).mode == Mode::Idle);
    let request = RunRequest {
        program_id: id,
        revision: 1,
        path,
        start_line: 0,
        occurrence: 0,
        in_span: Default::default(),
        check_only: false,
        tool_diameters_mm: Default::default(),
    };
    run.handle(Input::Command { id: 1, command: Command::RunProgram(request) });
    run.until(|run| run.has_finished);
    run.publish_entries();
    let (count, length) = (run.bag.count, run.now);
    run.bag.writer.finish("long.mcap", &BTreeMap::new()).expect("a bag can be closed");
    (count, length)
}

struct Bag {
    writer: BagWriter<BufWriter<File>>,
    channels: BTreeMap<&'static str, ChannelIndex>,
    count: u64,
}

impl Bag {
    fn put<M: Message>(&mut self, topic: &'static str, at: Duration, message: &M) {
        let info = TypeInfo::of::<M>();
        let writer = &mut self.writer;
        let channel = self.channels.entry(topic).or_insert_with(|| {
            let spec = ChannelSpec {
                topic: topic.to_owned(),
                type_name: info.name.to_owned(),
                schema_text: info.schema_text.to_owned(),
                type_hash: info.rihs01.to_owned(),
                qos: vec![QosProfile::reliable(10)],
            };
            writer.add_channel(&spec).expect("a topic of ours")
        });
        let at_ns = BEGIN_NS + nanoseconds(at);
        let data = cdr::encapsulated(message);
        self.writer.write(*channel, at_ns, at_ns, &data).expect("a message can be written");
        self.count += 1;
    }
}

/// A wave in short segments, loaded and planned.
fn plan(bag: &mut Bag, blocks: u32) -> (String, Arc<cnc_msgs::path::CompensatedPath>) {
    let mut text = String::from("G21 G90 G17\nF1200\n");
    for block in 1..=blocks {
        let x = f64::from(block % 2000) * 0.1;
        let y = 20.0 * (f64::from(block) * 0.004).sin();
        let _ = writeln!(text, "G1 X{x:.3} Y{y:.3}");
    }
    text += "M30\n";
    let profile = settings::load_profile("rs274").expect("a profile of ours");
    let yaml = settings::profile_to_yaml(&profile);
    let loaded = load(text.as_bytes(), &profile, &LoadOptions::default());
    let id = program_id(&yaml, text.as_bytes());
    let at = Duration::ZERO;

    let chunks = ProgramChunks { program_id: id.clone(), text: text.clone().into_bytes() };
    let program = wire::Program {
        program_id: id.clone(),
        sha256: sha256_hex(text.as_bytes()),
        size: text.len() as u64,
        line_count: loaded.line_count,
        chunk_count: chunks.count(),
        ..Default::default()
    };
    bag.put("/program", at, &program);
    (0..chunks.count()).filter_map(|it| chunks.chunk(it)).for_each(|chunk| {
        bag.put("/program/chunks", at, &chunk);
    });
    let (bounds_min, bounds_max) = program_loader::answer::corners(&loaded);
    let contour = ContourChunks::new(id.clone(), loaded.contour);
    let manifest = wire::ProgrammedContour {
        program_id: id.clone(),
        control: profile.name.clone(),
        profile: yaml,
        bounds_min,
        bounds_max,
        ..contour.manifest()
    };
    bag.put("/programmed_contour", at, &manifest);
    (0..contour.count()).filter_map(|it| contour.chunk(it)).for_each(|chunk| {
        bag.put("/programmed_contour/chunks", at, &chunk);
    });
    let tools = ToolTable::default();
    bag.put("/tool_table", at, &wire::ToolTable { revision: 1, ..(&tools).into() });
    let planned = compensation_planner::plan(contour.contour(), &profile, &tools);
    let report = wire::CompensationReport {
        program_id: id.clone(),
        revision: 1,
        tool_table_revision: 1,
        ..report_of(&planned, 0.05)
    };
    let cut = PathChunks::new(id.clone(), 1, Arc::new(planned.path));
    let manifest = wire::CompensatedPath {
        program_id: id.clone(),
        revision: 1,
        tool_table_revision: 1,
        ..manifest_of(&cut, 0.05)
    };
    bag.put("/compensated_path", at, &manifest);
    // The driver has its path from these messages, which round millimetres to metres.
    let mut received = Collector::for_path(&manifest).expect("a manifest");
    for chunk in (0..cut.count()).filter_map(|it| cut.chunk(it)) {
        bag.put("/compensated_path/chunks", at, &chunk);
        received.add(chunk).expect("a chunk of it");
    }
    let path = Arc::new(received.finish(&manifest).expect("a path"));
    bag.put("/compensation_report", at, &report);
    let parameters = axis_driver::node::default_parameters();
    let node = "/axis_driver".to_owned();
    bag.put(
        "/node_parameters",
        at,
        &wire::NodeParameters { node, parameters, ..Default::default() },
    );
    (id, path)
}

/// Both ends of the line, and what the driver publishes.
struct Run {
    driver: Driver,
    controller: PacedLine<Controller>,
    journal: Journal,
    entries: Vec<wire::TrafficEntry>,
    now: Duration,
    last_state: Option<Duration>,
    has_finished: bool,
    bag: Bag,
}

impl Run {
    fn new(bag: Bag) -> Self {
        let config = DriverConfig::default();
        let timing = LineTiming { baud: Some(config.baud), ..LineTiming::default() };
        let mut run = Self {
            driver: Driver::new(config),
            controller: PacedLine::new(
                Controller::with_build(Build::new(Settings::default())),
                timing,
            ),
            journal: Journal::default(),
            entries: Vec::new(),
            now: Duration::ZERO,
            last_state: None,
            has_finished: false,
            bag,
        };
        run.handle(Input::PortOpened);
        run
    }

    fn handle(&mut self, input: Input) {
        let entry = self.journal.input(self.now, &input);
        self.enter(entry);
        self.driver.handle(self.now, input);
        while let Some(output) = self.driver.poll_output() {
            match output {
                Output::Transmit(bytes) => {
                    let entry = self.journal.transmitted(self.now, &bytes);
                    self.enter(entry);
                    self.controller.receive(self.now, &bytes);
                }
                Output::State(state)
                    if self.last_state.is_none_or(|last| self.now >= last + STATE_PERIOD) =>
                {
                    self.last_state = Some(self.now);
                    let header = Header { stamp: stamp(self.now), ..Default::default() };
                    let state = machine_state_to_wire(header, &state);
                    self.bag.put("/machine_state", self.now, &state);
                }
                Output::RunFinished(_) => self.has_finished = true,
                _ => {}
            }
        }
    }

    fn enter(&mut self, entry: Entry) {
        let Time { sec, nanosec } = time(self.now);
        self.entries.push(wire::TrafficEntry {
            sequence: entry.sequence,
            kind: kind_to_wire(entry.kind),
            stamp: stamp(self.now),
            monotonic: WireDuration { sec, nanosec },
            data: entry.data,
        });
        if self.entries.len() >= BATCH {
            self.publish_entries();
        }
    }

    fn publish_entries(&mut self) {
        let entries = std::mem::take(&mut self.entries);
        self.bag.put("/controller_traffic", self.now, &wire::ControllerTraffic { entries });
    }

    fn until(&mut self, condition: impl Fn(&Self) -> bool) {
        while !condition(self) {
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
}

fn nanoseconds(at: Duration) -> u64 {
    u64::try_from(at.as_nanos()).expect("584 years fit")
}

fn time(at: Duration) -> Time {
    let sec = i32::try_from(at.as_secs()).expect("68 years fit");
    Time { sec, nanosec: at.subsec_nanos() }
}

fn stamp(at: Duration) -> Time {
    time(at + Duration::from_nanos(BEGIN_NS))
}
