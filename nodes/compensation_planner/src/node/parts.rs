//! Plans and proves the parts of a contour while it is still being read, each step on a thread of
//! its own.

use crate::tools::parts::{ContourPart, PartCutter, PartPlanner, PartProof};
use crate::tools::verdict::Verdict;
use crate::walk::plan::{Plan, Workers};
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::finding::Finding;
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{Scope, ScopedJoinHandle};

/// Parts that wait for a step: so few that a fast reader does not fill the memory.
const WAITING_MAX: usize = 1;

/// Why no node runs a contour that is accepted, or the verdict on its first part that is refused.
pub type Outcome = Result<Option<Finding>, Box<Verdict>>;

/// The verdict on a contour that comes in parts, of which none is kept.
#[derive(Debug)]
pub struct PartsVerdict<'scope> {
    cutter: PartCutter<'scope>,
    parts: SyncSender<ContourPart>,
    proof: ScopedJoinHandle<'scope, Outcome>,
    is_untouched: bool,
}

impl<'scope> PartsVerdict<'scope> {
    /// Before the first part. Its threads end when it is dropped. What is kept of the parts takes at most so much memory.
    pub fn new(
        scope: &'scope Scope<'scope, '_>,
        profile: &'scope Profile,
        tools: &'scope ToolTable,
        workers: &'scope dyn Workers,
        memory_bytes_max: u64,
    ) -> Self {
        let planner = PartPlanner::new(profile, tools, workers, memory_bytes_max);
        let (parts, to_plan) = sync_channel(WAITING_MAX);
        let (plans, to_prove) = sync_channel(WAITING_MAX);
        scope.spawn(move || plan(planner, to_plan, plans));
        let proof = scope.spawn(move || prove(PartProof::new(profile, tools), to_prove));
        Self { cutter: PartCutter::new(profile), parts, proof, is_untouched: true }
    }

    /// Whether no part has been taken yet, so that the contour is still whole.
    pub fn is_untouched(&self) -> bool {
        self.is_untouched
    }

    /// Takes all events so far, if a part may end after them.
    pub fn take(&mut self, contour: &mut ProgrammedContour) {
        if let Some(part) = self.cutter.cut(contour) {
            self.is_untouched = false;
            // Nobody takes a part after one that is refused: it is dropped.
            let _ = self.parts.send(part);
        }
    }

    /// Judges what is left of the contour.
    ///
    /// # Errors
    /// Any part is refused.
    pub fn judge(self, rest: ProgrammedContour) -> Outcome {
        let _ = self.parts.send(ContourPart { events: rest, is_last: true });
        drop(self.parts);
        self.proof.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }
}

/// Plans parts until one of them is refused.
fn plan(
    mut planner: PartPlanner<'_>,
    parts: Receiver<ContourPart>,
    plans: SyncSender<(ContourPart, Plan)>,
) {
    for mut part in parts {
        let plan = planner.plan(&mut part);
        let goes_on = plan.accepted();
        if plans.send((part, plan)).is_err() || !goes_on {
            return;
        }
    }
}

/// Proves all parts, to the last one.
fn prove(mut proof: PartProof<'_>, plans: Receiver<(ContourPart, Plan)>) -> Outcome {
    for (part, plan) in plans {
        proof.prove(&part, plan)?;
        if part.is_last {
            return Ok(proof.too_long());
        }
    }
    Err(Box::default())
}
