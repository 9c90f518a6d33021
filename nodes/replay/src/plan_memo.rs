//! Plans that several bags share: the same contour, profile and tools make the same plan.

use super::recording::RecordedProgram;
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::Plan;
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

/// Plans that are kept; the oldest goes.
const PLANS_MAX: usize = 256;
/// Elements, events, findings and the like that all of them may have; a plan with more is not kept.
const ELEMENTS_MAX: usize = 200_000;

/// The plans of the bags that one worker has replayed.
#[derive(Debug, Default)]
pub struct PlanMemo(Mutex<Kept>);

#[derive(Debug, Default)]
struct Kept {
    plans: BTreeMap<String, Arc<Plan>>,
    /// Their names, oldest first.
    order: VecDeque<String>,
    elements: usize,
}

impl PlanMemo {
    /// The plan of this name, made if it is not here.
    pub(crate) fn plan(&self, name: String, make: impl FnOnce() -> Plan) -> Arc<Plan> {
        // A panic while a plan is made leaves what was kept as it was.
        let kept = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let known = kept().plans.get(&name).cloned();
        known.unwrap_or_else(|| {
            let made = Arc::new(make());
            kept().keep(name, Arc::clone(&made));
            made
        })
    }
}

impl Kept {
    fn keep(&mut self, name: String, plan: Arc<Plan>) {
        if size(&plan) > ELEMENTS_MAX {
            return;
        }
        self.elements += size(&plan);
        if let Some(before) = self.plans.insert(name.clone(), plan) {
            self.elements -= size(&before);
        } else {
            self.order.push_back(name);
        }
        while self.order.len() > PLANS_MAX || self.elements > ELEMENTS_MAX {
            let Some(plan) = self.order.pop_front().and_then(|name| self.plans.remove(&name))
            else {
                return;
            };
            self.elements -= size(&plan);
        }
    }
}

fn size(plan: &Plan) -> usize {
    let Plan { path, refused, findings, spans, certificates, uncut } = plan;
    let of_path = path.elements.len() + path.events.len() + refused.len();
    of_path + findings.len() + spans.len() + certificates.len() + uncut.len()
}

/// What a plan is made from. The contour is named by the checksum of its messages, which was compared when they
/// were read.
pub(crate) fn name_of(program: &RecordedProgram, tools: &ToolTable, certifies: bool) -> String {
    let manifest = &program.manifest;
    // These two of a contour are in its manifest, and not in its chunks.
    let begin = (&program.contour.start, &program.contour.assumed_axes);
    format!("{certifies} {} {begin:?} {tools:?} {}", manifest.sha256, manifest.profile)
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::contour::{ProgrammedContour, Source};
    use cnc_msgs::geometry::{AxisSet, Shape};
    use cnc_msgs::path::{PathElement, Role};
    use std::cell::Cell;

    fn of(elements: usize) -> Plan {
        let element = PathElement {
            shape: Shape::Line,
            end: [0.0; 3],
            feed_mm_per_min: None,
            role: Role::None,
            side: None,
            axes: AxisSet::default(),
            source: Source::default(),
        };
        let mut plan = Plan::default();
        plan.path.elements = vec![element; elements];
        plan
    }

    #[test]
    fn a_plan_has_another_name_where_its_contour_begins_elsewhere() {
        let name = |start, letters: &str| {
            let axes = letters.bytes().map(|letter| usize::from(letter - b'X'));
            let assumed_axes = axes.fold(AxisSet::default(), AxisSet::with);
            let contour = ProgrammedContour { start, assumed_axes, ..Default::default() };
            let program = RecordedProgram {
                text: Vec::new(),
                manifest: Default::default(),
                contour: Arc::new(contour),
                log_time_ns: 0,
            };
            name_of(&program, &ToolTable::default(), false)
        };
        let here = name([0.0; 3], "X");
        assert_eq!(here, name([0.0; 3], "X"));
        assert_ne!(here, name([1.0, 0.0, 0.0], "X"));
        assert_ne!(here, name([0.0; 3], "XY"));
    }

    #[test]
    fn a_plan_is_made_once_while_it_is_kept() {
        let (memo, made) = (PlanMemo::default(), Cell::new(0));
        let ask = |name: &str, elements| {
            let make = || {
                made.set(made.get() + 1);
                of(elements)
            };
            size(&memo.plan(name.to_owned(), make))
        };
        for (name, elements, makes) in [
            ("a", 10, 1),
            ("a", 10, 1),
            ("b", 20, 2),
            // It fills the room: the oldest goes.
            ("c", ELEMENTS_MAX - 20, 3),
            ("b", 20, 3),
            ("a", 10, 4),
            // Too large to be kept.
            ("d", ELEMENTS_MAX + 1, 5),
            ("d", ELEMENTS_MAX + 1, 6),
            ("a", 10, 6),
        ] {
            assert_eq!(ask(name, elements), elements);
            assert_eq!(made.get(), makes, "{name}");
        }
        for number in 0..PLANS_MAX {
            ask(&format!("n{number}"), 1);
        }
        let before = made.get();
        ask("a", 10);
        assert_eq!(made.get(), before + 1, "the oldest went");
    }
}
