//! The verdict on a contour that is not kept: planned and proved in parts while it is still being
//! read.
//!
//! Three steps, each of which a shell may do on a thread of its own: [`PartCutter`] ends the parts,
//! [`PartPlanner`] plans them, and [`PartProof`] proves their paths. What is kept from part to part
//! are the walls of the contours so far, against which later ones are checked.
//!
//! The verdict says only whether the contour is accepted. A caller who wants to know why it is not
//! reads it again and asks [`judge`](crate::judge).

use crate::tools::verdict::{prove_part, too_long};
use crate::walk::Walk;
use crate::walk::parts::PartEnd;
use crate::walk::plan::{Plan, Workers};
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use path_audit::Auditor;

/// The events of a contour from one place where a part may end to the next.
#[derive(Debug, Clone, PartialEq)]
pub struct ContourPart {
    pub events: ProgrammedContour,
    /// Whether the contour ends with it.
    pub is_last: bool,
}

/// Cuts a contour into parts.
#[derive(Debug)]
pub struct PartCutter<'a> {
    profile: &'a Profile,
    /// `None` before the first event.
    end: Option<PartEnd>,
    /// Events that `end` has seen and that wait.
    seen: usize,
}

impl<'a> PartCutter<'a> {
    /// Before the first part.
    pub fn new(profile: &'a Profile) -> Self {
        Self { profile, end: None, seen: 0 }
    }

    /// Takes all events so far, if a part may end after them.
    pub fn cut(&mut self, contour: &mut ProgrammedContour) -> Option<ContourPart> {
        let end = self.end.get_or_insert_with(|| PartEnd::new(contour.start, self.profile));
        let may_end = end.may_end_after(&contour.events[self.seen..]);
        self.seen = contour.events.len();
        if !may_end {
            return None;
        }
        self.seen = 0;
        let next = Vec::with_capacity(contour.events.len());
        let events = std::mem::replace(&mut contour.events, next);
        let start = contour.start;
        let events = ProgrammedContour { events, start, ..Default::default() };
        Some(ContourPart { events, is_last: false })
    }
}

/// Plans one part of a contour after another.
#[expect(missing_debug_implementations, reason = "the walk is private")]
pub struct PartPlanner<'a> {
    profile: &'a Profile,
    tools: &'a ToolTable,
    workers: &'a dyn Workers,
    /// `None` before the first part.
    walk: Option<Walk<'a>>,
}

impl<'a> PartPlanner<'a> {
    /// Before the first part.
    pub fn new(profile: &'a Profile, tools: &'a ToolTable, workers: &'a dyn Workers) -> Self {
        Self { profile, tools, workers, walk: None }
    }

    /// The plan of the next part, which then starts where the one before has ended; `None` where no
    /// part may end.
    pub fn plan(&mut self, part: &mut ContourPart) -> Option<Plan> {
        let (profile, tools, workers) = (self.profile, self.tools, self.workers);
        let so_far = self.walk.take();
        if let Some(walk) = &so_far {
            part.events.start = walk.programmed();
        }
        let first = || Walk::new(&part.events, profile, tools, workers, None);
        let mut walk: Walk<'_> = so_far.unwrap_or_else(first);
        for event in &part.events.events {
            walk.event(&event.kind, event.source);
        }
        if part.is_last {
            return Some(walk.finish());
        }
        let (plan, next) = walk.next_part(profile, tools, workers)?;
        self.walk = Some(next);
        Some(plan)
    }
}

/// Proves one part of a contour after another.
#[derive(Debug)]
pub struct PartProof<'a> {
    auditor: Auditor<'a>,
    /// Events of the contour; elements and functions of the path.
    counts: [usize; 3],
}

impl<'a> PartProof<'a> {
    /// Before the first part.
    pub fn new(profile: &'a Profile, tools: &'a ToolTable) -> Self {
        Self { auditor: Auditor::new(profile, tools), counts: [0; 3] }
    }

    /// Whether the plan of the next part is accepted, and all parts together are not too long. After
    /// a part that is not, the contour is refused.
    ///
    /// Nothing is accepted that [`judge`](crate::judge) refuses: planner and audit go from part to
    /// part with all that they know.
    pub fn accepts(&mut self, part: &ContourPart, plan: Plan) -> bool {
        let contour = &part.events;
        let path = [plan.path.elements.len(), plan.path.events.len()];
        for (count, more) in self.counts.iter_mut().zip([contour.events.len(), path[0], path[1]]) {
            *count += more;
        }
        let [events, elements, functions] = self.counts;
        too_long(events, [elements, functions]).is_none()
            && prove_part(&mut self.auditor, plan, contour).plan.accepted()
    }
}
