//! The verdict on a contour that is not kept: planned and proved in parts while it is still being
//! read.
//!
//! Three steps, each of which a shell may do on a thread of its own: [`PartCutter`] ends the parts,
//! [`PartPlanner`] plans them, and [`PartProof`] proves their paths. What is kept from part to part
//! are the walls of the contours so far, against which later ones are checked.
//!
//! The verdict on the first part that is refused says why that one is, and nothing of those after it. A caller who wants
//! to know all reads the contour again and asks [`judge`](crate::judge).

use crate::tools::verdict::{Verdict, prove_part, refuse, too_long};
use crate::walk::Walk;
use crate::walk::parts::PartEnd;
use crate::walk::plan::{Plan, Workers};
use cnc_msgs::contour::{ProgrammedContour, Source};
use cnc_msgs::finding::{Code, Finding};
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
    /// For what is kept from part to part.
    memory_bytes_max: u64,
    /// `None` before the first part.
    walk: Option<Walk<'a>>,
}

impl<'a> PartPlanner<'a> {
    /// Before the first part. What is kept from part to part takes at most so much memory.
    pub fn new(
        profile: &'a Profile,
        tools: &'a ToolTable,
        workers: &'a dyn Workers,
        memory_bytes_max: u64,
    ) -> Self {
        Self { profile, tools, workers, memory_bytes_max, walk: None }
    }

    /// The plan of the next part, which then starts where the one before has ended. After a plan that is refused
    /// there is no next part.
    pub fn plan(&mut self, part: &mut ContourPart) -> Plan {
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
            return walk.finish();
        }
        let last = part.events.events.last().map(|event| event.source).unwrap_or_default();
        match walk.next_part(profile, tools, workers) {
            Ok((mut plan, next)) => {
                let limit = too_much(next.kept_bytes() as u64, self.memory_bytes_max, last);
                if limit.is_some() {
                    refuse(&mut plan, limit);
                }
                self.walk = Some(next);
                plan
            }
            Err(mut plan) => {
                if plan.accepted() {
                    refuse(&mut plan, [no_end(last)]);
                }
                *plan
            }
        }
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

    /// Proves the plan of the next part. After a part that is refused, the contour is.
    ///
    /// Nothing is accepted that [`judge`](crate::judge) refuses, except for its length
    /// ([`too_long`](Self::too_long)): planner and audit go from part to part with all that they know.
    ///
    /// # Errors
    /// The verdict on a part that is refused.
    pub fn prove(&mut self, part: &ContourPart, plan: Plan) -> Result<(), Box<Verdict>> {
        let contour = &part.events;
        let path = [plan.path.elements.len(), plan.path.events.len()];
        for (count, more) in self.counts.iter_mut().zip([contour.events.len(), path[0], path[1]]) {
            *count += more;
        }
        let verdict = prove_part(&mut self.auditor, plan, contour);
        if verdict.plan.accepted() { Ok(()) } else { Err(Box::new(verdict)) }
    }

    /// What no node accepts of all parts together: a contour longer than messages can be, or a path too long for the
    /// driver.
    pub fn too_long(&self) -> Option<Finding> {
        let [events, elements, functions] = self.counts;
        too_long(events, [elements, functions])
    }
}

/// Finds that contours take more memory than they may.
fn too_much(bytes: u64, most: u64, source: Source) -> Option<Finding> {
    let megabytes = |bytes: u64| bytes.div_ceil(1 << 20);
    let message = format!(
        "the contours up to line {} take {} MB of memory; {} MB are allowed",
        source.line,
        megabytes(bytes),
        megabytes(most)
    );
    (bytes > most).then(|| {
        Finding::error(Code::Limit, source, message)
            .help("split the program, or plan it on a computer with more memory")
    })
}

fn no_end(source: Source) -> Finding {
    Finding::error(
        Code::Limit,
        source,
        "compensation does not end here, so the program is not planned in parts",
    )
    .help("cancel the compensation with a move between contours, or split the program")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tools::verdict::tests::{offset, sinumerik, square};
    use crate::walk::plan::Alone;

    #[test]
    fn contours_that_take_too_much_memory_are_refused_with_numbers() {
        let (profile, tools) = (sinumerik(), offset(2.0));
        for (most, is_refused) in [(1 << 20, false), (100, true)] {
            let mut planner = PartPlanner::new(&profile, &tools, &Alone, most);
            let mut proof = PartProof::new(&profile, &tools);
            let mut part = ContourPart { events: square(), is_last: false };
            let plan = planner.plan(&mut part);
            let proved = proof.prove(&part, plan);
            let Err(verdict) = proved else {
                assert!(!is_refused);
                continue;
            };
            let errors: Vec<_> = verdict.plan.findings.iter().filter(|it| it.is_error()).collect();
            let [limit] = errors[..] else { panic!("{errors:?}") };
            assert!(is_refused && limit.code == Code::Limit, "{limit:?}");
            let wanted = "the contours up to line 7 take 1 MB of memory; 1 MB are allowed";
            assert_eq!((limit.message.as_str(), limit.source.line), (wanted, 7));
        }
    }
}
