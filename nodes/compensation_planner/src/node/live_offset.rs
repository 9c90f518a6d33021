//! Applies a new value of an offset to a running program, if its control works so.
//!
//! Follows the driver's reports about its run. When the machine stands in a hold, the rest of the
//! path is planned again and offered. The driver decides whether to take it, and says so in its
//! state. In all other cases a program keeps the values that it began with.

use super::{Current, Input, Planner};
use crate::tools::replan::{NotReplanned, Replanned, replan};
use crate::tools::set_tool::LoadedProgram;
use cnc_msgs::contour::{Action, ContourEvent, ContourEventKind};
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::tool_table::ToolTable;
use cnc_msgs::wire::cnc_msgs::msg::MachineState;
use runtime::{Handle, NodeError, Qos};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long the driver may take to fetch and prove a new path.
const TAKEN_WITHIN: Duration = Duration::from_secs(5);
/// How often the driver's state is checked meanwhile.
const LOOK: Duration = Duration::from_millis(20);
/// Enough time to publish one chunk on its topic.
const CHUNK: Duration = Duration::from_millis(15);

/// A path and what it was planned from.
#[derive(Clone)]
pub(super) struct RunningPlan {
    pub(super) revision: u64,
    pub(super) program_id: String,
    /// The program that the run has begun with: with the results of probes it has another id.
    pub(super) run_of: String,
    /// The revision that it goes on from; 0 for a whole plan.
    pub(super) continues: u64,
    pub(super) tools_revision: u64,
    pub(super) input: Input,
    pub(super) tools: ToolTable,
    pub(super) path: Arc<CompensatedPath>,
}

/// The running path, if this node planned it.
#[derive(Default)]
pub(super) struct Live {
    /// What a run may take next: the newest plan, and before it those that go on from the same one.
    offered: Vec<RunningPlan>,
    running: Option<RunningPlan>,
    /// Revision of the running path, 0 if none runs.
    revision: u64,
    /// Elements of it that can no longer change; 0 unless the machine stands in a hold.
    settled: u64,
    is_held: bool,
}

impl Live {
    pub(super) fn newest(&self) -> Option<&RunningPlan> {
        self.offered.last()
    }

    pub(super) fn offer(&mut self, plan: RunningPlan) {
        self.offered.retain(|it| plan.continues > 0 && it.continues == plan.continues);
        self.offered.push(plan);
    }

    /// The running plan that an input goes on from: the same so far, of a program that computes with the
    /// results of its probes. The driver decides whether it takes what is planned.
    pub(super) fn continued_by(&self, input: &Input) -> Option<&RunningPlan> {
        let running = self.running.as_ref().filter(|_| self.revision > 0)?;
        let before = &running.input.contour.events;
        let is_stretch = |last: &ContourEvent| {
            matches!(last.kind, ContourEventKind::Action(Action::Stretch { .. }))
        };
        let is_continued = before.last().is_some_and(is_stretch)
            && input.manifest.program_id != running.program_id
            && input.contour.events.starts_with(before);
        is_continued.then_some(running)
    }

    fn update(&mut self, state: &MachineState) {
        (self.revision, self.settled) = (state.path_revision, state.settled_elements);
        self.is_held = state.state == MachineState::STATE_HOLD;
        let is_meant = |plan: &&RunningPlan| {
            plan.revision == state.path_revision && plan.run_of == state.program_id
        };
        if self.running.as_ref().filter(is_meant).is_none() {
            self.running = self.offered.iter().find(is_meant).cloned();
        }
    }
}

/// Follows the driver's state.
pub(super) fn follow(node: &Handle, planner: &Arc<Planner>) -> Result<(), NodeError> {
    let mut states = node.subscription::<MachineState>("machine_state", Qos::LATCHED)?;
    let planner = Arc::clone(planner);
    node.spawn("machine state", async move {
        loop {
            let (first, _) = states.next().await;
            let newest = states.drain().pop().map_or(first, |(newest, _)| newest);
            planner.state().live.update(&newest);
        }
    });
    Ok(())
}

impl Planner {
    /// Applies the tool table to a program that stands in a hold, if its control works so; returns
    /// what happened.
    pub(super) fn go_live(&self) -> String {
        let (live, tools, tools_revision, is_running, is_held) = {
            let state = self.state();
            let Live { running, settled, revision, is_held, .. } = &state.live;
            let live = running.clone().map(|running| (running, *settled));
            (live, state.tools.clone(), state.tools_revision, *revision > 0, *is_held)
        };
        let keeps = |why: &str| format!("; the running program keeps its values: {why}");
        let Some((running, settled)) = live else {
            return if is_running { keeps("this planner did not plan it") } else { String::new() };
        };
        if settled == 0 && is_held {
            return keeps("all of its blocks were sent to the controller already");
        }
        if settled == 0 {
            return keeps("the machine is not in a hold");
        }
        let Input { manifest, contour, profile, .. } = &running.input;
        let program = LoadedProgram { name: &manifest.name, contour, profile };
        let settled_here = usize::try_from(settled).unwrap_or(usize::MAX);
        let rest = replan(program, &running.tools, &tools, &running.path, settled_here);
        let Replanned { contour, tools, plan, from_line } = match rest {
            Ok(rest) => rest,
            Err(NotReplanned { message, disagreement }) => {
                if let Some(disagreement) = disagreement {
                    let name = format!("the rest of {}", manifest.name);
                    self.keep(&name, Some(&running.program_id), *disagreement);
                }
                return keeps(&message);
            }
        };
        let revision = {
            let mut state = self.state();
            state.revision += 1;
            state.revision
        };
        let stamp = self.node.now();
        let report = self.report(&running.input, (revision, tools_revision), stamp, &plan);
        let program_id = running.program_id.clone();
        let mut current = Current::new(program_id, revision, &plan, self.chord_error_mm);
        let input = Input { contour: Arc::new(contour), ..running.input };
        let path = Arc::new(plan.path);
        let continues = running.revision;
        let offered =
            RunningPlan { revision, continues, input, tools, tools_revision, path, ..running };
        self.state().live.offer(offered.clone());
        self.publish_path(&offered, settled, stamp, &mut current);
        self.publish_report(report);
        let chunks = (offered.path.elements.len() / 300 + 2) as u32;
        self.state().pause = Some(CHUNK * chunks);
        let end = Instant::now() + TAKEN_WITHIN;
        while Instant::now() < end {
            if self.state().live.revision == revision {
                return format!("; in force in the running program, from line {from_line} on");
            }
            std::thread::sleep(LOOK);
        }
        keeps("the driver did not accept the rest of the path")
    }
}
