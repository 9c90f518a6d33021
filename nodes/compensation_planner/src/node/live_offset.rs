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

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::contour::Source;
    use cnc_msgs::geometry::AxisSet;
    use cnc_msgs::wire::cnc_msgs::msg::ProgrammedContour as Manifest;

    fn action(line: u32, action: Action) -> ContourEvent {
        let source = Source { line, ..Source::default() };
        ContourEvent { source, kind: ContourEventKind::Action(action) }
    }

    fn input(program_id: &str, events: Vec<ContourEvent>) -> Input {
        let contour = cnc_msgs::contour::ProgrammedContour { events, ..Default::default() };
        let manifest = Manifest { program_id: program_id.into(), ..Manifest::default() };
        let contour = Arc::new(contour);
        let profile = Arc::new(settings::load_profile("rs274").expect("a profile of ours"));
        Input { manifest, contour, profile, too_long: None }
    }

    fn plan(revision: u64, continues: u64, input: &Input) -> RunningPlan {
        RunningPlan {
            revision,
            program_id: input.manifest.program_id.clone(),
            run_of: "part".into(),
            continues,
            tools_revision: 1,
            input: input.clone(),
            tools: ToolTable::default(),
            path: Arc::default(),
        }
    }

    #[test]
    fn a_run_takes_any_plan_that_goes_on_from_its_own() {
        let stretch = |line| action(line, Action::Stretch { axes: AxisSet::NONE });
        let dwell = action(5, Action::Dwell { seconds: 1.0 });
        let first = input("part", vec![stretch(4)]);
        let second = input("part with one result", vec![stretch(4), dwell, stretch(6)]);
        let third = input("part with two", vec![stretch(4), dwell, stretch(6), dwell]);
        let mut live = Live::default();
        let runs = |live: &mut Live, path_revision| {
            let program_id = "part".to_owned();
            live.update(&MachineState { path_revision, program_id, ..MachineState::default() });
        };
        live.offer(plan(1, 0, &first));
        assert!(live.continued_by(&second).is_none(), "nothing runs");
        runs(&mut live, 1);
        assert_eq!(live.continued_by(&second).map(|it| it.revision), Some(1));
        assert!(live.continued_by(&first).is_none(), "it is the program that runs");
        assert!(live.continued_by(&input("other", vec![stretch(3), dwell])).is_none());
        // Planned twice before the driver has taken the first.
        live.offer(plan(2, 1, &second));
        live.offer(plan(3, 1, &second));
        runs(&mut live, 2);
        assert_eq!(live.continued_by(&third).map(|it| it.revision), Some(2));
        live.offer(plan(4, 2, &third));
        assert_eq!(live.offered.len(), 1, "no plan is kept that cannot be taken");
        runs(&mut live, 4);
        assert!(live.continued_by(&third).is_none(), "it is the last");
        runs(&mut live, 0);
        assert!(live.continued_by(&second).is_none(), "nothing runs");
    }
}
