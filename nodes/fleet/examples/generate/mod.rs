//! Bags of runs that a driver and a virtual controller did on one line in virtual time.
//!
//! Equal numbers make equal bags, byte for byte. Programs, controls, tools, firmware, what the operator
//! does and what fails follow from the number.

mod line;

use axis_driver::driver::RunRequest;
use cnc_msgs::chunk::{
    Collector, ContourChunks, PathChunks, ProgramChunks, program_id, sha256_hex,
};
use cnc_msgs::tool_table::{Offset, Tool, ToolTable};
use cnc_msgs::wire::action_msgs::msg::{GoalInfo, GoalStatus, GoalStatusArray};
use cnc_msgs::wire::cnc_msgs::msg as wire;
use cnc_msgs::wire::unique_identifier_msgs::msg::UUID;
use compensation_planner::plan_certified;
use compensation_planner::report::{certify, manifest_of, report_of};
use line::{BagInMemory, Run};
use program_loader::{LoadOptions, load};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;
use virtual_controller::{Build, Firmware, Settings};

/// What an operator does, or what fails, in a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Event {
    None,
    /// Feed hold and resume.
    Hold,
    /// The feed override is set to 80 %.
    Override,
    Cancel,
    /// The controller resets by itself.
    Reset,
    /// A limit switch closes.
    Limit,
}

/// One run.
#[derive(Debug, Clone)]
pub(crate) struct Spec {
    pub(crate) number: u64,
    pub(crate) machine: String,
    pub(crate) control: &'static str,
    pub(crate) program: String,
    pub(crate) text: String,
    pub(crate) tools: ToolTable,
    pub(crate) firmware: Firmware,
    pub(crate) event: Event,
}

/// The numbers that follow from a seed: splitmix64.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % end
    }
}

impl Spec {
    /// The run of this number.
    pub(crate) fn new(number: u64) -> Self {
        let mut numbers = Numbers(number);
        let part = numbers.below(60);
        let control = ["rs274", "rs274", "sinumerik_840c", "nct"][(part % 4) as usize];
        let wear_mm = -0.01 * numbers.below(6) as f64;
        let mut tools = ToolTable::default();
        tools.tools.insert(
            1,
            Tool { diameter_mm: 10.0, wear_diameter_mm: wear_mm * 2.0, ..Tool::default() },
        );
        tools.offsets.insert(1, Offset { radius_mm: 5.0, wear_mm, ..Offset::default() });
        let event = match numbers.below(20) {
            0 | 1 => Event::Hold,
            2 => Event::Override,
            3 => Event::Cancel,
            4 => Event::Reset,
            5 => Event::Limit,
            _ => Event::None,
        };
        Self {
            number,
            machine: format!("mill_{}", numbers.below(50)),
            control,
            program: format!(
                "part_{part}.{}",
                if control == "sinumerik_840c" { "mpf" } else { "ngc" }
            ),
            text: program(control, part),
            tools,
            firmware: Firmware::ALL[numbers.below(Firmware::ALL.len() as u64) as usize],
            event,
        }
    }
}

/// A contour of lines and arcs whose size is that of the part.
fn program(control: &str, part: u64) -> String {
    let (width, height, feed) = (30 + part, 25 + part / 2, 1200 + 60 * part);
    if control == "nct" {
        return format!(
            "%O{part}\nN10 G21 G17 G90 G0 X-20 Y0 F{feed}\nN20 G41 D1 G1 X0 Y10\nN30 Y{height}\nN40 X{width}\n\
             N50 Y0\nN60 X-1\nN70 G40 X-20 Y-10\nN80 M30\n"
        );
    }
    let change = if part.is_multiple_of(3) && control == "rs274" { "T1 M6\n" } else { "" };
    let (x, y) = (width + 8, height - 8);
    format!(
        "{begin}G0 X-20 Y0 Z5\n{change}M3 S1000\nG1 Z-1\nG41 D1 G1 X0 Y10\nG1 Y{height}\nG1 X{width}\n\
         G2 X{x} Y{y} I0 J-8\nG1 Y0\nG1 X-1\nG40 G1 X-20 Y-10\nG0 Z5\nM5\nM30\n",
        begin = if control == "rs274" {
            format!("G21 G90 G17 F{feed}\n")
        } else {
            format!("G90 G17 F{feed}\n")
        }
    )
}

/// Makes the bag of a run.
pub(crate) fn bag(spec: &Spec) -> Vec<u8> {
    let begin_ns = 1_760_000_000_000_000_000 + spec.number * 300_000_000_000;
    let mut bag = BagInMemory::new(begin_ns, &spec.machine);
    let goal = goal_id(spec.number);
    let (id, path) = plan(&mut bag, spec, goal);
    let mut settings = Settings::of(spec.firmware);
    if spec.event == Event::Limit {
        settings.set(21, 1.0).expect("hard limits");
    }
    let faults = match spec.event {
        Event::Reset => &["reset@line=20"][..],
        Event::Limit => &["limit:X@line=20"],
        _ => &[],
    };
    let mut run = Run::new(bag, Build::new(settings), faults);
    let request = RunRequest {
        program_id: id.clone(),
        revision: 1,
        path,
        start_line: 0,
        occurrence: 0,
        in_span: Default::default(),
        check_only: false,
        tool_diameters_mm: Default::default(),
    };
    let (result, mut bag, end) = run.run_out(request, spec.event);
    bag.put(
        "run_result",
        end,
        &wire::RunResult { goal_id: UUID { uuid: goal }, program_id: id, ..result.clone() },
    );
    let status = match result.outcome {
        wire::RunResult::OUTCOME_SUCCEEDED => GoalStatus::STATUS_SUCCEEDED,
        wire::RunResult::OUTCOME_CANCELED => GoalStatus::STATUS_CANCELED,
        _ => GoalStatus::STATUS_ABORTED,
    };
    let goal_info = GoalInfo { goal_id: UUID { uuid: goal }, ..GoalInfo::default() };
    let status_list = vec![GoalStatus { goal_info, status }];
    bag.put("run_program/_action/status", end, &GoalStatusArray { status_list });
    bag.finish(&format!("run_{}_0.mcap", spec.number))
}

fn goal_id(number: u64) -> [u8; 16] {
    let mut goal = [0; 16];
    goal[..8].copy_from_slice(&number.to_be_bytes());
    goal[15] = 1;
    goal
}

/// Loads and plans the program; everything that the nodes publish of it goes into the bag.
fn plan(
    bag: &mut BagInMemory,
    spec: &Spec,
    goal: [u8; 16],
) -> (String, Arc<cnc_msgs::path::CompensatedPath>) {
    let text = spec.text.as_bytes();
    let profile = settings::load_profile(spec.control).expect("a profile of ours");
    let yaml = settings::profile_to_yaml(&profile);
    let loaded = load(text, &profile, &LoadOptions::default());
    let errors = loaded.findings.iter().filter(|it| it.is_error()).map(|it| it.message.as_str());
    let errors: Vec<&str> = errors.collect();
    assert!(errors.is_empty(), "{}: {errors:?}\n{}", spec.control, spec.text);
    let (id, at) = (program_id(&yaml, text), Duration::ZERO);
    bag.metadata(
        "cnc_run",
        &BTreeMap::from([
            ("run_id".to_owned(), format!("run_{}", spec.number)),
            ("goal_id".to_owned(), cnc_msgs::chunk::hex(&goal)),
            ("program".to_owned(), spec.program.clone()),
            ("program_id".to_owned(), id.clone()),
            ("program_sha256".to_owned(), sha256_hex(text)),
            ("control".to_owned(), spec.control.to_owned()),
            ("software".to_owned(), "kerf 0.1.0".to_owned()),
            ("build".to_owned(), "generated".to_owned()),
        ]),
    );
    let chunks = ProgramChunks { program_id: id.clone(), text: text.to_vec() };
    bag.put(
        "program",
        at,
        &wire::Program {
            program_id: id.clone(),
            name: spec.program.clone(),
            control: spec.control.to_owned(),
            sha256: sha256_hex(text),
            size: text.len() as u64,
            line_count: loaded.line_count,
            chunk_count: chunks.count(),
            ..Default::default()
        },
    );
    (0..chunks.count()).filter_map(|it| chunks.chunk(it)).for_each(|chunk| {
        bag.put("program/chunks", at, &chunk);
    });
    let (bounds_min, bounds_max) = program_loader::answer::corners(&loaded);
    let contour = ContourChunks::new(id.clone(), loaded.contour);
    bag.put(
        "programmed_contour",
        at,
        &wire::ProgrammedContour {
            program_id: id.clone(),
            name: spec.program.clone(),
            control: spec.control.to_owned(),
            profile: yaml,
            bounds_min,
            bounds_max,
            ..contour.manifest()
        },
    );
    (0..contour.count()).filter_map(|it| contour.chunk(it)).for_each(|chunk| {
        bag.put("programmed_contour/chunks", at, &chunk);
    });
    bag.put("tool_table", at, &wire::ToolTable { revision: 1, ..(&spec.tools).into() });
    let planned = plan_certified(contour.contour(), &profile, &spec.tools);
    assert!(planned.accepted(), "{}: {:?}\n{}", spec.control, planned.findings, spec.text);
    let mut report = wire::CompensationReport {
        program_id: id.clone(),
        revision: 1,
        tool_table_revision: 1,
        ..report_of(&planned, 0.05)
    };
    certify(&mut report, &planned.certificates);
    let cut = PathChunks::new(id.clone(), 1, Arc::new(planned.path));
    let manifest = wire::CompensatedPath {
        program_id: id.clone(),
        revision: 1,
        control: spec.control.to_owned(),
        tool_table_revision: 1,
        ..manifest_of(&cut, 0.05)
    };
    bag.put("compensated_path", at, &manifest);
    // The driver has its path from these messages, which round millimetres to metres.
    let mut received = Collector::for_path(&manifest).expect("a manifest");
    for chunk in (0..cut.count()).filter_map(|it| cut.chunk(it)) {
        bag.put("compensated_path/chunks", at, &chunk);
        received.add(chunk).expect("a chunk of it");
    }
    let path = Arc::new(received.finish(&manifest).expect("a path"));
    bag.put("compensation_report", at, &report);
    let node = format!("/{}/axis_driver", spec.machine);
    let parameters = axis_driver::node::default_parameters();
    bag.put(
        "node_parameters",
        at,
        &wire::NodeParameters { node, parameters, ..Default::default() },
    );
    bag.put(
        "command_log",
        at,
        &wire::Command {
            endpoint: format!("/{}/run_program", spec.machine),
            endpoint_type: "cnc_msgs/action/RunProgram".to_owned(),
            sender: [(spec.number % 3) as u8; 16],
            success: true,
            ..Default::default()
        },
    );
    (id, path)
}
