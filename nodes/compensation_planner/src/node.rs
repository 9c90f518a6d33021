//! The ROS shell of the planner: a contour in, a path and a verdict out.
//!
//! Follows the newest programmed contour, keeps the tool table, and plans again when either
//! changes. [`plan`](crate::plan) decides what the path is.

pub mod disagreement;
mod health;
mod input;
mod lifecycle;
mod live_offset;
mod mdi;
pub mod parts;
mod preview;
mod report;
mod restart;
pub mod threads;
mod tool_file;

use crate::tools::report::{manifest_of, uncut_to_wire};
use crate::tools::set_tool::{self, LoadedProgram, Refusal};
use crate::tools::verdict::{Verdict, judge};
use crate::walk::plan::{Plan, Planning};
use cnc_msgs::chunk::PathChunks;
use cnc_msgs::count::counted;
use cnc_msgs::interface::Service;
use cnc_msgs::tool_table::ToolTable;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use cnc_msgs::wire::cnc_msgs::srv::{
    GetContourChunks, GetFindings, GetPathChunks, GetPathChunksRequest, GetPathChunksResponse,
    GetProgramChunks, GetTools, GetToolsResponse, PlanBlock, PlanStart, SetTool, SetToolRequest,
    SetToolResponse,
};
use cnc_msgs::wire::std_msgs::msg::Header;
use cnc_msgs::wire::{nav_msgs, visualization_msgs};
use health::PlanSummary;
use input::{Input, fetch};
use live_offset::{Live, RunningPlan};
use report::Uncertified;
use runtime::chunks::{ChunkTopic, Cut, page};
use runtime::commands::{Answer, CommandLog};
use runtime::{Client, Declared, Handle, Publisher, Qos, RosTime, WarningRateLimit};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use threads::Threads;
use tokio::sync::{mpsc, watch};
use tool_file::ToolFile;

/// Runs the node until it is asked to stop.
pub fn main(args: Vec<String>) -> ExitCode {
    runtime::run_managed("compensation_planner", parameters(), &args, start)
}

/// The node's parameters.
pub fn parameters() -> Vec<Declared> {
    vec![
        Declared::new(
            "tool_table",
            "",
            "YAML file with tools and offsets, millimetres; set_tool writes it; empty: no tools",
        )
        .read_only(),
        Declared::new(
            "report_directory",
            disagreement::FOLDER,
            "folder for bug reports: programs on which the planner and its audit disagree",
        )
        .read_only(),
        Declared::new("preview_chord_error_mm", 0.05, "how far the preview may be from an arc")
            .read_only()
            .within(1e-4, 10.0),
    ]
}

async fn start(node: Handle) -> Result<Arc<Planner>, runtime::Error> {
    let (replan, mut work) = watch::channel(());
    let (reports, waiting) = mpsc::channel(disagreement::WAITING_MAX);
    let planner = Arc::new(Planner::new(&node, replan, reports)?);
    let commands = CommandLog::new(&node)?;

    let shared = Arc::clone(&planner);
    node.service::<SetTool, _, _>("set_tool", move |request, info| {
        let (planner, commands) = (Arc::clone(&shared), commands.clone());
        async move {
            let asked = request.clone();
            let worker = Arc::clone(&planner);
            let _work = planner.work.read().await;
            let response = tokio::task::spawn_blocking(move || worker.set_tool(&request)).await;
            let response = response.unwrap_or_else(|error| SetToolResponse {
                message: format!("the planner failed: {error}"),
                ..SetToolResponse::default()
            });
            let answer = Answer {
                success: response.success,
                error_code: response.error_code,
                message: &response.message,
            };
            commands.record("set_tool", SetTool::TYPE_NAME, &info, &asked, answer);
            response
        }
    })?;
    let shared = Arc::clone(&planner);
    node.service::<PlanBlock, _, _>("plan_block", move |request, _| {
        let answer = match shared.node.require_active() {
            Ok(()) => {
                let tools = shared.state().tools.clone();
                let (answer, disagreement) = mdi::plan(&request, &tools);
                if let Some(disagreement) = disagreement {
                    shared.keep(mdi::NAME, None, disagreement);
                }
                answer
            }
            Err(why) => mdi::refuse(why),
        };
        std::future::ready(answer)
    })?;
    let shared = Arc::clone(&planner);
    node.service::<PlanStart, _, _>("plan_start", move |request, _| {
        let newest = shared.state().live.newest().cloned();
        std::future::ready(restart::plan(newest.as_ref(), &request))
    })?;
    let shared = Arc::clone(&planner);
    node.service::<GetTools, _, _>("get_tools", move |_, _| {
        let table = shared.tools_message();
        std::future::ready(GetToolsResponse { success: true, table, ..Default::default() })
    })?;
    let shared = Arc::clone(&planner);
    node.service::<GetPathChunks, _, _>("compensated_path/get_chunks", move |request, _| {
        std::future::ready(shared.path_chunks(&request))
    })?;
    let shared = Arc::clone(&planner);
    node.service::<GetFindings, _, _>("get_findings", move |request, _| {
        std::future::ready(shared.findings(&request))
    })?;

    let shared = Arc::clone(&planner);
    node.spawn("reports", async move { shared.keep_reports(waiting).await });
    live_offset::follow(&node, &planner)?;
    let mut contours = node.subscription("programmed_contour", Qos::LATCHED)?;
    let chunks = node.client::<GetContourChunks>("programmed_contour/get_chunks")?;
    let shared = Arc::clone(&planner);
    let memory = node.memory_bytes_max();
    node.spawn("programmed contour", async move {
        let mut complaints = WarningRateLimit::default();
        loop {
            // Of several waiting contours only the newest matters.
            for (manifest, info) in contours.newest_of_each().await {
                let sender = info.publisher;
                match fetch(&chunks, manifest, memory).await {
                    Ok(input) => shared.take(input),
                    Err(error) if complaints.are_due(sender, Instant::now()) => {
                        tracing::error!("cannot fetch the contour from {sender}: {error}");
                    }
                    Err(_) => {}
                }
            }
        }
    });
    let shared = Arc::clone(&planner);
    node.spawn("planning", async move {
        while work.changed().await.is_ok() {
            let pause = shared.state().pause.take();
            tokio::time::sleep(pause.unwrap_or_default()).await;
            work.borrow_and_update();
            let _work = shared.work.read().await;
            let planner = Arc::clone(&shared);
            match tokio::task::spawn_blocking(move || planner.plan()).await {
                Ok(Some(planned)) => {
                    let planner = Arc::clone(&shared);
                    tokio::task::spawn_blocking(move || planner.find_certificates(planned));
                }
                Ok(None) => {}
                Err(error) => tracing::error!("planning failed: {error}"),
            }
        }
    });
    Ok(planner)
}

/// The newest plan, the tool table, and the endpoints that publish them.
struct Planner {
    node: Handle,
    replan: watch::Sender<()>,
    chord_error_mm: f64,
    /// Where programs are kept on which planner and audit disagree.
    report_directory: PathBuf,
    /// The programs that wait to be kept.
    reports: mpsc::Sender<disagreement::Waiting>,
    /// Asks the loader for the text of a program.
    programs: Client<GetProgramChunks>,
    tool_table: Publisher<wire::ToolTable>,
    path: Publisher<wire::CompensatedPath>,
    path_topic: ChunkTopic<wire::PathChunk>,
    report: Publisher<wire::CompensationReport>,
    /// The revision of the newest report that was published.
    reported: Mutex<u64>,
    preview: Publisher<nav_msgs::msg::Path>,
    markers: Publisher<visualization_msgs::msg::MarkerArray>,
    /// Held while the table is being changed, so that changes come one after another.
    tool_file: Mutex<Option<ToolFile>>,
    state: Mutex<PlannerState>,
    /// Shared by everyone who plans or changes the table; exclusive for a deactivation.
    work: tokio::sync::RwLock<()>,
}

#[derive(Default)]
struct PlannerState {
    tools: ToolTable,
    tools_revision: u64,
    input: Option<Input>,
    /// The contour was not planned yet, or with other tools.
    is_due: bool,
    /// Counts the plans; the first is 1.
    revision: u64,
    current: Option<Current>,
    /// Of the newest plan, refused ones too.
    summary: Option<PlanSummary>,
    live: Live,
    /// How long planning waits, until the path before it has been published.
    pause: Option<Duration>,
}

/// The plan that is published.
#[derive(Clone)]
struct Current {
    program_id: String,
    revision: u64,
    findings: Arc<Vec<wire::Finding>>,
    uncut: Arc<Vec<wire::UncutRegion>>,
    /// `None` when the program was refused.
    chunks: Option<Cut<wire::PathChunk>>,
}

impl Current {
    /// What a plan says; its path is added when it is published.
    fn new(program_id: String, revision: u64, plan: &Plan, chord_error_mm: f64) -> Self {
        let uncut = plan.uncut.iter().map(|region| uncut_to_wire(region, chord_error_mm));
        Self {
            program_id,
            revision,
            findings: Arc::new(plan.findings.iter().map(Into::into).collect()),
            uncut: Arc::new(uncut.collect()),
            chunks: None,
        }
    }
}

impl Planner {
    fn new(
        node: &Handle,
        replan: watch::Sender<()>,
        reports: mpsc::Sender<disagreement::Waiting>,
    ) -> Result<Self, runtime::Error> {
        Ok(Self {
            node: node.clone(),
            replan,
            chord_error_mm: node.parameter("preview_chord_error_mm"),
            report_directory: PathBuf::from(node.parameter::<String>("report_directory")),
            reports,
            programs: node.client("program/get_chunks")?,
            tool_table: node.publisher("tool_table", Qos::LATCHED)?,
            path: node.publisher("compensated_path", Qos::LATCHED)?,
            path_topic: ChunkTopic::new(node, "compensated_path/chunks")?,
            report: node.publisher("compensation_report", Qos::LATCHED)?,
            reported: Mutex::default(),
            preview: node.publisher("compensated_path/preview", Qos::LATCHED)?,
            markers: node.publisher("markers", Qos::LATCHED)?,
            tool_file: Mutex::default(),
            work: tokio::sync::RwLock::default(),
            state: Mutex::default(),
        })
    }

    fn state(&self) -> MutexGuard<'_, PlannerState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn health(&self) -> runtime::Health {
        let state = self.state();
        health::health(state.summary.as_ref(), state.tools_revision)
    }

    fn tools_message(&self) -> wire::ToolTable {
        let state = self.state();
        wire::ToolTable {
            stamp: self.node.now().into(),
            revision: state.tools_revision,
            ..(&state.tools).into()
        }
    }

    fn publish_tools(&self) {
        self.tool_table.publish(self.tools_message());
    }

    fn take(&self, input: Input) {
        let mut state = self.state();
        (state.input, state.is_due) = (Some(input), true);
        drop(state);
        self.replan.send_replace(());
    }

    /// Changes the table in memory, in its file and for the loaded program, or not at all.
    fn set_tool(&self, request: &SetToolRequest) -> SetToolResponse {
        let mut file = self.tool_file.lock().unwrap_or_else(PoisonError::into_inner);
        match self.try_set_tool(request, file.as_mut()) {
            Ok((message, revision)) => {
                tracing::info!("{message}");
                SetToolResponse { success: true, message, revision, ..SetToolResponse::default() }
            }
            Err(Refusal { error_code, message, disagreement }) => {
                let input = self.state().input.clone();
                if let Some((disagreement, input)) = disagreement.zip(input) {
                    let wire::ProgrammedContour { name, program_id, .. } = &input.manifest;
                    self.keep(name, Some(program_id), *disagreement);
                }
                let revision = self.state().tools_revision;
                SetToolResponse { error_code, message, revision, ..SetToolResponse::default() }
            }
        }
    }

    fn try_set_tool(
        &self,
        request: &SetToolRequest,
        file: Option<&mut ToolFile>,
    ) -> Result<(String, u64), Refusal> {
        let (tools, input) = {
            let state = self.state();
            (state.tools.clone(), state.input.clone())
        };
        let inactive = |message: String| Refusal::new(SetToolResponse::NOT_ACTIVE, message);
        self.node.require_active().map_err(inactive)?;
        let change = set_tool::change(&tools, request)?;
        if let Some(Input { manifest, contour, profile, .. }) = &input {
            let program = LoadedProgram { name: &manifest.name, contour, profile };
            set_tool::still_cuts(program, &tools, &change)?;
        }
        let kept = match file {
            Some(file) => file.write(&change)?,
            None => "until the planner ends: it has no tool file".to_owned(),
        };
        let message = format!("{}; kept {kept}", change.describe());
        let revision = {
            let mut state = self.state();
            state.tools = change.tools;
            state.tools_revision += 1;
            state.is_due = true;
            state.tools_revision
        };
        self.publish_tools();
        let message = message + &self.go_live();
        self.replan.send_replace(());
        Ok((message, revision))
    }

    /// Plans the current contour and publishes the result, but for its certificates.
    fn plan(&self) -> Option<Uncertified> {
        let (input, tools, tools_revision, revision, continued) = {
            let mut state = self.state();
            // A contour that arrives meanwhile is planned when the node is active.
            let is_wanted = state.is_due && self.node.require_active().is_ok();
            let input = state.input.clone().filter(|_| is_wanted)?;
            state.is_due = false;
            state.revision += 1;
            // A program keeps the tools that it began with.
            let continued = state.live.continued_by(&input).cloned();
            let (tools, tools_revision) = match &continued {
                Some(running) => (running.tools.clone(), running.tools_revision),
                None => (state.tools.clone(), state.tools_revision),
            };
            (input, tools, tools_revision, state.revision, continued)
        };
        let threads = Threads::all();
        let planning = Planning { certifies: false, workers: &threads };
        let judged = match &input.too_long {
            Some(limit) => Verdict::refused(limit.clone()),
            None => judge(&input.contour, &input.profile, &tools, planning),
        };
        let Verdict { plan: planned, disagreement, .. } = judged;
        if let Some(disagreement) = disagreement {
            self.keep(&input.manifest.name, Some(&input.manifest.program_id), disagreement);
        }
        let stamp = self.node.now();
        let accepted = planned.accepted();
        let report = self.report(&input, (revision, tools_revision), stamp, &planned);
        tracing::info!(
            "{} is {}: {}, {}, {}",
            input.manifest.name,
            if accepted { "planned" } else { "refused" },
            counted(planned.path.elements.len(), "element"),
            counted(report.error_count as usize, "error"),
            counted(report.warning_count as usize, "warning")
        );
        self.state().summary = Some(PlanSummary {
            name: input.manifest.name.clone(),
            revision,
            accepted,
            error_count: report.error_count,
            warning_count: report.warning_count,
        });
        let program_id = input.manifest.program_id.clone();
        let mut current = Current::new(program_id, revision, &planned, self.chord_error_mm);
        if accepted {
            let plan = RunningPlan {
                revision,
                program_id: current.program_id.clone(),
                run_of: continued.as_ref().map_or(&current.program_id, |it| &it.run_of).clone(),
                continues: continued.as_ref().map_or(0, |it| it.revision),
                tools_revision,
                input: input.clone(),
                tools: tools.clone(),
                path: Arc::new(planned.path),
            };
            let settled = continued.map_or(0, |it| it.path.elements.len() as u64);
            self.state().live.offer(plan.clone());
            self.publish_path(&plan, settled, stamp, &mut current);
        } else {
            self.state().current = Some(current);
        }
        self.publish_report(report.clone());
        Some(Uncertified { input, tools, report })
    }

    fn header(&self, input: &Input, stamp: RosTime) -> Header {
        Header { stamp: stamp.into(), frame_id: input.manifest.header.frame_id.clone() }
    }

    /// Publishes a path, of which so many elements are settled.
    fn publish_path(
        &self,
        plan: &RunningPlan,
        settled_elements: u64,
        stamp: RosTime,
        current: &mut Current,
    ) {
        let RunningPlan { input, path, continues, tools_revision, .. } = plan;
        let (continues_revision, tool_table_revision) = (*continues, *tools_revision);
        let path = Arc::clone(path);
        let chunks =
            PathChunks::new(current.program_id.clone(), current.revision, Arc::clone(&path));
        let manifest = wire::CompensatedPath {
            header: self.header(input, stamp),
            program_id: current.program_id.clone(),
            revision: current.revision,
            control: input.manifest.control.clone(),
            tool_table_revision,
            continues_revision,
            settled_elements,
            ..manifest_of(&chunks, self.chord_error_mm)
        };
        let cut: Cut<wire::PathChunk> = Arc::new(move |index| chunks.chunk(index));
        current.chunks = Some(Arc::clone(&cut));
        self.state().current = Some(current.clone());
        self.path.publish(manifest);
        self.path_topic.send(cut);

        let header = self.header(input, stamp);
        let view = preview::view(&path, self.chord_error_mm);
        if let Some(note) = &view.note {
            tracing::info!("{note}");
        }
        self.preview.publish(view.path_message(&header));
        self.markers.publish(view.marker_message(&header));
    }

    fn path_chunks(&self, request: &GetPathChunksRequest) -> GetPathChunksResponse {
        type W = GetPathChunksResponse;
        let refuse =
            |error_code, message| GetPathChunksResponse { error_code, message, ..W::default() };
        let Some(current) = self.state().current.clone() else {
            return refuse(W::UNKNOWN_PLAN, "nothing is planned yet".into());
        };
        let wanted = (request.program_id.is_empty() || request.program_id == current.program_id)
            && (request.revision == 0 || request.revision == current.revision);
        let (Some(cut), true) = (&current.chunks, wanted) else {
            return refuse(
                W::UNKNOWN_PLAN,
                format!(
                    "the newest plan is revision {} of {}{}",
                    current.revision,
                    current.program_id,
                    if current.chunks.is_some() { "" } else { ", which is refused" }
                ),
            );
        };
        let chunks = page(request.first, cut);
        if chunks.is_empty() {
            return refuse(W::UNKNOWN_CHUNK, format!("there is no chunk {}", request.first));
        }
        GetPathChunksResponse { success: true, chunks, ..W::default() }
    }
}
