//! The path that a run would take: the newest that the planner accepted.
//!
//! It is fetched here and handed on to the motion process, which checks and keeps it; this
//! process keeps its name.

use super::motion_link::MotionLink;
use crate::encoder::CalledFunction;
use crate::protocol::PathHere;
use crate::tool_check::objection;
use cnc_msgs::calls::chain_after;
use cnc_msgs::cdr;
use cnc_msgs::chunk::Collector;
use cnc_msgs::finding::Finding;
use cnc_msgs::tool_table::ToolTable;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use cnc_msgs::wire::cnc_msgs::srv::{GetPathChunks, GetPathChunksRequest};
use runtime::chunks::pull;
use runtime::{Client, Handle, NodeError, Qos, WarningRateLimit};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{Notify, oneshot};

/// How long the motion process may take to check a path.
const TAKEN_WITHIN: Duration = Duration::from_secs(60);
/// Under this name the tools of the path that is run are kept for the face after this one.
const KEPT_TOOLS: &str = "running tools";

/// A path that the motion process has as a whole.
#[derive(Debug, Clone)]
pub(super) struct Planned {
    pub(super) program_id: String,
    pub(super) revision: u64,
    /// The tool table it was planned with.
    tool_table_revision: u64,
    element_count: u64,
    /// The functions of the user that it calls.
    pub(super) functions: Vec<CalledFunction>,
}

/// The functions of a path that the motion process has, or why it has not.
type Taken = Result<Vec<CalledFunction>, String>;

/// Who waits to hear that the motion process has a path; one at a time.
#[derive(Debug, Default)]
pub(super) struct Answers {
    waiting: Mutex<Option<WaitingForPath>>,
}

#[derive(Debug)]
struct WaitingForPath {
    program_id: String,
    revision: u64,
    sender: oneshot::Sender<Taken>,
}

impl Answers {
    fn wait(&self, program_id: &str, revision: u64) -> oneshot::Receiver<Taken> {
        let (sender, answer) = oneshot::channel();
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        *waiting = Some(WaitingForPath { program_id: program_id.to_owned(), revision, sender });
        answer
    }

    /// The motion process says whether it has this one.
    pub(super) fn give(&self, program_id: &str, revision: u64, taken: Taken) {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let is_meant = |waiting: &mut WaitingForPath| {
            waiting.program_id == program_id && waiting.revision == revision
        };
        if let Some(WaitingForPath { sender, .. }) = waiting.take_if(is_meant) {
            // Whoever waited may have given up.
            let _ = sender.send(taken);
        }
    }
}

/// The way to the motion process, and what it has already.
pub(super) struct Here {
    pub(super) motion: Arc<MotionLink>,
    pub(super) answers: Arc<Answers>,
    pub(super) paths: Vec<PathHere>,
}

/// What the planner said last.
#[derive(Debug, Default)]
struct Newest {
    planned: Option<Planned>,
    /// Program and revision of the newest verdict, and why it was refused.
    verdict: Option<(String, u64, Option<String>)>,
    /// The newest path for the rest of a run, and the revision that it goes on from.
    rest: Option<(u64, Planned)>,
    /// The program that was loaded last, planned or not.
    program_id: Option<String>,
    /// The tool table in force, with its revision.
    tool_table: Option<(u64, ToolTable)>,
    /// The tables themselves, because a planner that is started anew counts its revisions
    /// from the beginning: of the newest path, and of the path that is run.
    planned_tools: Option<ToolTable>,
    running_tools: Option<ToolTable>,
}

impl Newest {
    fn on_tool_table(&mut self, revision: u64, table: ToolTable) {
        let is_meant = |planned: &Planned| planned.tool_table_revision == revision;
        if self.planned_tools.is_none() && self.planned.as_ref().is_some_and(is_meant) {
            self.planned_tools = Some(table.clone());
        }
        self.tool_table = Some((revision, table));
    }

    fn take(&mut self, planned: Planned) {
        self.planned_tools = self.table_of(&planned);
        self.planned = Some(planned);
    }

    fn begin(&mut self, planned: &Planned) {
        self.rest = None;
        self.running_tools = self.table_of(planned).or_else(|| self.planned_tools.clone());
    }

    /// A rest that was made with a table which is not in force was made with that of its run.
    fn go_on(&mut self, planned: &Planned) {
        if let Some(table) = self.table_of(planned) {
            self.running_tools = Some(table);
        }
    }

    /// The table that a path was made with, if it is the one in force.
    fn table_of(&self, planned: &Planned) -> Option<ToolTable> {
        let (revision, table) = self.tool_table.as_ref()?;
        (*revision == planned.tool_table_revision).then(|| table.clone())
    }

    /// Why the path that is run must not go on with this tool.
    fn objection(&self, tool: u32, is_by_hand: bool) -> Option<String> {
        let now = self.tool_table.as_ref().map(|(_, table)| table);
        // No path was made with the tool of a block by hand; it has to be in the table.
        let planned = if is_by_hand { now } else { self.running_tools.as_ref() };
        objection(tool, planned, now)
    }
}

/// Follows the planner; clones see the same.
#[derive(Clone)]
pub(super) struct Paths {
    node: Handle,
    newest: Arc<Mutex<Newest>>,
    arrived: Arc<Notify>,
}

impl Paths {
    /// Subscribes; chunks are pulled from the planner as fast as this side takes them.
    /// What is meant for the rest of a run goes to `on_rest`, with the revision that runs.
    pub(super) fn follow(
        node: &Handle,
        here: Here,
        on_rest: impl Fn(&Self, u64, Planned) + Send + 'static,
    ) -> Result<Self, NodeError> {
        let kept = node.memory().and_then(|memory| memory.get(KEPT_TOOLS));
        let running_tools = kept
            .and_then(|kept| cdr::from_body::<wire::ToolTable>(&kept).ok())
            .and_then(|table| ToolTable::try_from(&table).ok());
        let newest = Newest { running_tools, ..Newest::default() };
        let newest = Arc::new(Mutex::new(newest));
        let paths = Self { node: node.clone(), newest, arrived: Arc::default() };
        let mut manifests =
            node.subscription::<wire::CompensatedPath>("compensated_path", Qos::LATCHED)?;
        let client = node.client::<GetPathChunks>("compensated_path/get_chunks")?;
        let shared = paths.clone();
        node.spawn("compensated path", async move {
            let mut complaints = WarningRateLimit::default();
            loop {
                // Of several that waited only a planner's newest matters.
                for (manifest, info) in manifests.newest_of_each().await {
                    let of = manifest.continues_revision;
                    match fetch(&client, &here, &manifest).await {
                        // It is for a run that stands in a hold; no run can begin with it.
                        Ok(planned) if of > 0 => {
                            shared.newest().rest = Some((of, planned.clone()));
                            on_rest(&shared, of, planned);
                        }
                        Ok(planned) => shared.take(planned),
                        Err(error) if complaints.are_due(info.publisher, Instant::now()) => {
                            tracing::error!(
                                "cannot fetch revision {} of the compensated path from {}: {error}",
                                manifest.revision,
                                info.publisher
                            );
                        }
                        Err(_) => {}
                    }
                }
            }
        });
        let mut reports =
            node.subscription::<wire::CompensationReport>("compensation_report", Qos::LATCHED)?;
        let shared = paths.clone();
        node.spawn("compensation report", async move {
            loop {
                let (report, _) = reports.next().await;
                let refused = (!report.accepted).then(|| why_refused(&report));
                shared.newest().verdict = Some((report.program_id, report.revision, refused));
                shared.arrived.notify_waiters();
            }
        });
        let mut programs = node.subscription::<wire::Program>("program", Qos::LATCHED)?;
        let shared = paths.clone();
        node.spawn("program", async move {
            loop {
                let (program, _) = programs.next().await;
                shared.newest().program_id = Some(program.program_id);
            }
        });
        let mut tables = node.subscription::<wire::ToolTable>("tool_table", Qos::LATCHED)?;
        let shared = paths.clone();
        node.spawn("tool table", async move {
            let mut complaints = WarningRateLimit::default();
            loop {
                let (table, info) = tables.next().await;
                match ToolTable::try_from(&table) {
                    Ok(tools) => shared.newest().on_tool_table(table.revision, tools),
                    Err(error) if complaints.are_due(info.publisher, Instant::now()) => {
                        tracing::error!("invalid tool table from {}: {error}", info.publisher);
                    }
                    Err(_) => {}
                }
            }
        });
        Ok(paths)
    }

    fn newest(&self) -> MutexGuard<'_, Newest> {
        self.newest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// This is the path that is run from here on.
    pub(super) fn begin(&self, planned: &Planned) {
        let mut newest = self.newest();
        newest.begin(planned);
        self.keep(&newest);
    }

    /// This is the path of the rest of the run.
    pub(super) fn go_on(&self, planned: &Planned) {
        let mut newest = self.newest();
        newest.go_on(planned);
        self.keep(&newest);
    }

    /// Keeps the tools of the run for the face after this one.
    fn keep(&self, newest: &Newest) {
        let Some(memory) = self.node.memory() else { return };
        match &newest.running_tools {
            Some(tools) => memory.keep(KEPT_TOOLS, cdr::body(&wire::ToolTable::from(tools))),
            None => memory.forget(KEPT_TOOLS),
        }
    }

    /// Why the path that is run must not go on with this tool.
    pub(super) fn objection(&self, tool: u32, is_by_hand: bool) -> Option<String> {
        self.newest().objection(tool, is_by_hand)
    }

    /// The diameters of the tools that a path was made with, by T number, mm.
    pub(super) fn diameters_mm(&self, planned: &Planned) -> BTreeMap<u32, f64> {
        let newest = self.newest();
        let table = newest.table_of(planned).or_else(|| newest.planned_tools.clone());
        diameters_mm(&table.unwrap_or_default())
    }

    /// The same of the table in force.
    pub(super) fn diameters_in_force_mm(&self) -> BTreeMap<u32, f64> {
        let newest = self.newest();
        newest.tool_table.as_ref().map(|(_, table)| diameters_mm(table)).unwrap_or_default()
    }

    /// What came for the rest of a run that goes on from this revision.
    pub(super) fn rest(&self, of: u64, program_id: &str) -> Option<Planned> {
        let rest = self.newest().rest.clone();
        let is_meant = |(from, rest): &(u64, Planned)| *from == of && rest.program_id == program_id;
        rest.filter(is_meant).map(|(_, rest)| rest)
    }

    fn take(&self, planned: Planned) {
        tracing::info!(
            "received the path of {} (revision {}): {} elements",
            planned.program_id,
            planned.revision,
            planned.element_count
        );
        self.newest().take(planned);
        self.arrived.notify_waiters();
    }

    /// The path of a program, or of whatever was planned last; waits for one
    /// that is on its way.
    pub(super) async fn get(&self, program_id: &str, within: Duration) -> Result<Planned, String> {
        let arrival = tokio::time::timeout(within, async {
            loop {
                let arrived = self.arrived.notified();
                if let Some(planned) = self.now(program_id)? {
                    return Ok(planned);
                }
                arrived.await;
            }
        });
        arrival.await.unwrap_or_else(|_| {
            Err(if program_id.is_empty() {
                "no program is loaded and planned".to_owned()
            } else {
                format!("program {program_id} is not loaded and planned")
            })
        })
    }

    /// `None` when it may still come.
    fn now(&self, program_id: &str) -> Result<Option<Planned>, String> {
        let newest = self.newest();
        // Without a name the program that was loaded last is meant, even if its
        // plan is not here yet: never the one before.
        let wanted = match (program_id, &newest.program_id) {
            ("", Some(loaded)) => loaded,
            (program_id, _) => program_id,
        };
        if let Some((id, revision, refused)) = &newest.verdict {
            let is_meant = wanted.is_empty() || wanted == id;
            if let Some(why) = refused.as_ref().filter(|_| is_meant) {
                return Err(format!(
                    "program {id} was refused by the planner (revision {revision}): {why}"
                ));
            }
            if let Some(planned) = &newest.planned {
                let is_newest = planned.revision == *revision
                    && planned.program_id == *id
                    && match &newest.tool_table {
                        Some((_, table)) => newest.planned_tools.as_ref() == Some(table),
                        None => true,
                    };
                if is_meant && is_newest {
                    return Ok(Some(planned.clone()));
                }
            }
        }
        Ok(None)
    }
}

fn diameters_mm(table: &ToolTable) -> BTreeMap<u32, f64> {
    let tools = table.tools.iter();
    tools.map(|(number, tool)| (*number, tool.diameter_mm + tool.wear_diameter_mm)).collect()
}

/// The first error of a report.
fn why_refused(report: &wire::CompensationReport) -> String {
    let is_error = |it: &&wire::Finding| it.severity == wire::Finding::SEVERITY_ERROR;
    match report.findings.iter().find(is_error) {
        Some(first) => {
            let calls =
                Finding::try_from(first).map(|it| chain_after(&it.calls)).unwrap_or_default();
            format!("line {}{calls}: {}", first.line, first.message)
        }
        None => "its report has no finding".into(),
    }
}

async fn fetch(
    client: &Client<GetPathChunks>,
    here: &Here,
    manifest: &wire::CompensatedPath,
) -> Result<Planned, runtime::Error> {
    let (program_id, revision) = (manifest.program_id.clone(), manifest.revision);
    let planned = |functions| Planned {
        program_id: program_id.clone(),
        revision,
        tool_table_revision: manifest.tool_table_revision,
        element_count: manifest.element_count,
        functions,
    };
    let is_meant = |here: &&PathHere| {
        (&here.program_id, here.revision, &here.sha256) == (&program_id, revision, &manifest.sha256)
    };
    if let Some(here) = here.paths.iter().find(is_meant) {
        return Ok(planned(here.functions.clone()));
    }
    let mut collector = Collector::for_path(manifest)?;
    let request = |first| GetPathChunksRequest { program_id: program_id.clone(), revision, first };
    pull(client, &mut collector, request, |response| {
        if response.success { Ok(response.chunks) } else { Err(response.message) }
    })
    .await?;
    let taken = here.answers.wait(&program_id, revision);
    let (motion, manifest) = (Arc::clone(&here.motion), manifest.clone());
    tokio::task::spawn_blocking(move || motion.send_path(&manifest, &collector.into_chunks()))
        .await?;
    Ok(planned(tokio::time::timeout(TAKEN_WITHIN, taken).await???))
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::tool_table::Tool;

    /// With one tool of this diameter.
    fn table(number: u32, diameter_mm: f64) -> ToolTable {
        let tool = Tool { diameter_mm, ..Tool::default() };
        ToolTable { tools: [(number, tool)].into(), ..ToolTable::default() }
    }

    #[test]
    fn without_a_program_a_tool_by_hand_is_looked_up_in_the_table_in_force() {
        let mut newest = Newest::default();
        let says = |newest: &Newest, tool, is_by_hand| {
            newest.objection(tool, is_by_hand).unwrap_or_else(|| "taken".into())
        };
        assert!(says(&newest, 2, true).contains("no tool table was received"));
        newest.on_tool_table(1, table(2, 8.0));
        assert_eq!(says(&newest, 2, true), "taken");
        assert!(says(&newest, 3, true).contains("T3 is not in the tool table"));
        assert_eq!(says(&newest, 0, true), "taken", "an empty spindle is in no table");
        // A run needs the table that its path was made with.
        assert!(says(&newest, 2, false).contains("cancel and run again"));
    }

    #[test]
    fn after_a_stretch_a_tool_is_compared_with_what_the_run_has_begun_with() {
        let plan = |program_id: &str, revision, tool_table_revision| Planned {
            program_id: program_id.into(),
            revision,
            tool_table_revision,
            element_count: 1,
            functions: Vec::new(),
        };
        let mut newest = Newest::default();
        newest.on_tool_table(1, table(2, 8.0));
        newest.take(plan("part", 1, 1));
        newest.begin(&plan("part", 1, 1));
        // The tool is set while the run goes on, and the whole program is planned with it for the next run.
        newest.on_tool_table(2, table(2, 7.9));
        newest.take(plan("part", 2, 2));
        newest.go_on(&plan("part with results", 3, 1));
        let refused = newest.objection(2, false).expect("the path was made with another tool");
        assert!(refused.contains("diameter 8.0000 mm, now 7.9000 mm"), "{refused}");
        // A rest that was planned with it may be cut with it.
        newest.go_on(&plan("part with results", 4, 2));
        assert_eq!(newest.objection(2, false), None);
    }

    #[test]
    fn a_tool_by_hand_is_not_compared_with_the_program_that_ran_before() {
        let mut newest = Newest { running_tools: Some(table(2, 8.0)), ..Newest::default() };
        newest.on_tool_table(2, table(2, 7.9));
        assert_eq!(newest.objection(2, true), None);
        let run = newest.objection(2, false).expect("another tool than was planned with");
        assert!(run.contains("diameter 8.0000 mm, now 7.9000 mm"), "{run}");
    }
}
