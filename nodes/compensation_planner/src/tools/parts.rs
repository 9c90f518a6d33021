//! The verdict on a contour that is not kept: planned and proved in parts while it is still being
//! read.
//!
//! It says only whether the contour is accepted. A caller who wants to know why it is not reads it
//! again and asks [`judge`](crate::judge).

use crate::tools::verdict::{prove_part, too_long};
use crate::walk::Walk;
use crate::walk::parts::PartEnd;
use crate::walk::plan::{Plan, Workers};
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use path_audit::Auditor;

/// Judges a contour whose events come in parts, and keeps none of them.
///
/// What it keeps are the walls of the contours so far, against which later ones are checked. It
/// accepts nothing that [`judge`](crate::judge) refuses: planner and audit go from part to part
/// with all that they know.
#[expect(missing_debug_implementations, reason = "the walk is private")]
pub struct PartsVerdict<'a> {
    profile: &'a Profile,
    tools: &'a ToolTable,
    workers: &'a dyn Workers,
    auditor: Auditor<'a>,
    /// `None` before the first part, and when the contour is refused.
    walk: Option<Walk<'a>>,
    end: Option<PartEnd>,
    /// Events that `end` has seen and that wait.
    seen: usize,
    /// Events of the contour; elements and functions of the path.
    counts: [usize; 3],
    is_refused: bool,
}

impl<'a> PartsVerdict<'a> {
    /// Before the first part.
    pub fn new(profile: &'a Profile, tools: &'a ToolTable, workers: &'a dyn Workers) -> Self {
        let auditor = Auditor::new(profile, tools);
        Self {
            profile,
            tools,
            workers,
            auditor,
            walk: None,
            end: None,
            seen: 0,
            counts: [0; 3],
            is_refused: false,
        }
    }

    /// Whether no part has been judged yet, so that the contour is still whole.
    pub fn is_untouched(&self) -> bool {
        self.walk.is_none() && !self.is_refused
    }

    /// Judges all events so far and takes them, if a part may end after them.
    pub fn take(&mut self, contour: &mut ProgrammedContour) {
        if self.is_refused {
            contour.events.clear();
            return;
        }
        let end = self.end.get_or_insert_with(|| PartEnd::new(contour.start, self.profile));
        let may_end = end.may_end_after(&contour.events[self.seen..]);
        self.seen = contour.events.len();
        if may_end {
            let start = contour.start;
            let part = ProgrammedContour {
                events: std::mem::take(&mut contour.events),
                start,
                ..Default::default()
            };
            let mut part = self.part(part, false);
            part.events.clear();
            // Its memory is for the next part.
            contour.events = part.events;
            self.seen = 0;
        }
    }

    /// Judges what is left of the contour; whether all of it is accepted.
    pub fn accepts(mut self, rest: ProgrammedContour) -> bool {
        if !self.is_refused {
            self.part(rest, true);
        }
        !self.is_refused
    }

    /// Judges the next part; its events come back.
    fn part(&mut self, mut part: ProgrammedContour, is_last: bool) -> ProgrammedContour {
        let (profile, tools) = (self.profile, self.tools);
        let so_far = self.walk.take();
        if let Some(walk) = &so_far {
            part.start = walk.programmed();
        }
        let first = || Walk::new(&part, profile, tools, self.workers, None);
        let mut walk: Walk<'_> = so_far.unwrap_or_else(first);
        for event in &part.events {
            walk.event(&event.kind, event.source);
        }
        let plan = match is_last {
            true => Some(walk.finish()),
            false => walk.next_part(profile, tools, self.workers).map(|(plan, next)| {
                self.walk = Some(next);
                plan
            }),
        };
        if !plan.is_some_and(|plan| self.is_proved(&part, plan)) {
            (self.walk, self.is_refused) = (None, true);
        }
        part
    }

    /// Whether the plan of a part is accepted, and everything together is not too long.
    fn is_proved(&mut self, contour: &ProgrammedContour, plan: Plan) -> bool {
        let path = [plan.path.elements.len(), plan.path.events.len()];
        for (count, more) in self.counts.iter_mut().zip([contour.events.len(), path[0], path[1]]) {
            *count += more;
        }
        let [events, elements, functions] = self.counts;
        too_long(events, [elements, functions]).is_none()
            && prove_part(&mut self.auditor, plan, contour).plan.accepted()
    }
}
