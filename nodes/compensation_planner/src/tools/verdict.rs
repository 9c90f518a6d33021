//! One verdict on a contour for all callers: the plan, and the proof of its path.
//!
//! `kerf plan`, `kerf check`, the planner's node, `set_tool`, single blocks, replans and `kerf
//! replay` all ask [`judge`] or [`prove`]. Nobody asks only one of the two algorithms. If they
//! disagree, the path is refused. The verdict then says that Kerf is wrong and not the program, and
//! names the file that a shell keeps for a report. If one of them has only reached a limit, that is
//! no disagreement: the contour is refused with advice.

use crate::walk::plan::{Plan, Planning, plan_with};
use cnc_msgs::chunk::ITEM_COUNT_MAX;
use cnc_msgs::contour::{ProgrammedContour, Source};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::path::{PathTooLong, check_length};
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use path_audit::{Audit, Auditor};
use std::fmt::Write;

/// A plan whose path is proved, or refused.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Verdict {
    pub plan: Plan,
    /// `None`: the planner refused the contour, so there was no path to audit.
    pub audit: Option<Audit>,
    /// The planner accepted the contour, and the audit refused its path.
    pub disagreement: Option<Disagreement>,
}

/// A contour on which the two algorithms disagree, a defect of Kerf; with everything that a report
/// needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Disagreement {
    /// Name of the file that keeps the program; the same wherever the verdict is made.
    pub file_name: String,
    pub contour: ProgrammedContour,
    pub profile: Profile,
    pub tools: ToolTable,
    /// The findings about it, the internal error first.
    pub findings: Vec<Finding>,
}

impl Verdict {
    /// A contour that is refused before it is planned.
    pub fn refused(why: Finding) -> Self {
        Self { plan: Plan { findings: vec![why], ..Plan::default() }, ..Self::default() }
    }
}

/// Plans a contour and audits the path.
///
/// Never panics. The verdict depends neither on certificates nor on the workers.
pub fn judge(
    contour: &ProgrammedContour,
    profile: &Profile,
    tools: &ToolTable,
    planning: Planning<'_>,
) -> Verdict {
    prove(plan_with(contour, profile, tools, planning), contour, profile, tools)
}

/// Audits a plan before anybody runs it. Findings that the planner has reported already are not
/// repeated. An error of the audit refuses the plan; a warning becomes one of the plan.
pub fn prove(
    plan: Plan,
    contour: &ProgrammedContour,
    profile: &Profile,
    tools: &ToolTable,
) -> Verdict {
    prove_part(&mut Auditor::new(profile, tools), plan, contour)
}

/// The same of the next part of a contour.
pub(crate) fn prove_part(
    auditor: &mut Auditor<'_>,
    mut plan: Plan,
    contour: &ProgrammedContour,
) -> Verdict {
    let (profile, tools) = (auditor.profile(), auditor.tools());
    if !plan.accepted() {
        return Verdict { plan, ..Verdict::default() };
    }
    let path = [plan.path.elements.len(), plan.path.events.len()];
    if let Some(limit) = too_long(contour.events.len(), path) {
        refuse(&mut plan, [limit]);
        return Verdict { plan, ..Verdict::default() };
    }
    #[cfg(test)]
    tests::spoil(&mut plan, tools);
    let mut audit = auditor.audit(contour, &plan.path, &plan.findings);
    contour.calls.explain(&mut audit.findings);
    if !audit.refuses() {
        plan.findings.extend(audit.findings.iter().cloned());
        plan.findings.sort_by_key(|finding| finding.source.line);
        return Verdict { plan, audit: Some(audit), disagreement: None };
    }
    // A limit of the audit is no disagreement.
    let contradicts = |finding: &&Finding| finding.is_error() && finding.code != Code::Limit;
    let disagrees = audit.findings.iter().any(|finding| contradicts(&finding));
    let name = disagrees.then(|| file_name(contour, profile, tools));
    let errors = audit.findings.iter().filter(|finding| finding.is_error()).cloned();
    refuse(&mut plan, name.as_deref().map(internal_error).into_iter().chain(errors));
    let disagreement = name.map(|file_name| Disagreement {
        file_name,
        contour: contour.clone(),
        profile: profile.clone(),
        tools: tools.clone(),
        findings: plan.findings.clone(),
    });
    Verdict { plan, audit: Some(audit), disagreement }
}

/// Refuses a plan that was accepted.
pub(crate) fn refuse(plan: &mut Plan, why: impl IntoIterator<Item = Finding>) {
    plan.findings.extend(why);
    // Findings about the program as a whole come first.
    plan.findings.sort_by_key(|finding| finding.source.line);
    plan.refused = std::mem::take(&mut plan.path).elements;
    plan.uncut.clear();
}

/// Finds what no node accepts: a contour longer than messages can be, or a path too long for the
/// driver.
pub(crate) fn too_long(
    contour_events: usize,
    [elements, functions]: [usize; 2],
) -> Option<Finding> {
    let limit = |message| Finding::error(Code::Limit, Source::default(), message);
    if contour_events as u64 > ITEM_COUNT_MAX {
        let message =
            format!("the contour has {contour_events} events; at most {ITEM_COUNT_MAX} can be run");
        return Some(limit(message).help("split the program into several"));
    }
    let too_long = check_length(elements as u64, functions as u64).err()?;
    Some(limit(too_long.to_string()).help(PathTooLong::help()))
}

/// Depends only on what was judged.
fn file_name(contour: &ProgrammedContour, profile: &Profile, tools: &ToolTable) -> String {
    let mut name = Fnv::default();
    // Writing to it cannot fail.
    let _ = write!(name, "{contour:?}{profile:?}{tools:?}");
    format!("disagreement_{:016x}.yaml", name.0)
}

fn internal_error(file_name: &str) -> Finding {
    Finding::error(
        Code::InternalError,
        Source::default(),
        "the planner accepts this program, and the audit refuses the path that it made: this is \
         a defect of Kerf, not of the program",
    )
    .help(format!(
        "send {file_name} to the developers of Kerf; it holds the program, the tools and the \
         control"
    ))
}

/// FNV-1a: a hash that is the same on every machine.
#[derive(Debug)]
struct Fnv(u64);

impl Default for Fnv {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Write for Fnv {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        for byte in text.bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
        Ok(())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use cnc_msgs::contour::{
        ContourEvent, ContourEventKind as Kind, CutterSide, Motion, MotionClass, RadiusSource,
    };
    use cnc_msgs::geometry::{AxisSet, Shape};
    use cnc_msgs::path::{PATHS_BYTES_MAX, path_bytes};
    use cnc_msgs::tool_table::Offset;
    use std::cell::Cell;

    thread_local! {
        static SPOILS: Cell<fn(&ToolTable) -> bool> = const { Cell::new(|_| false) };
    }

    /// From now on, in this thread, damages the path of plans with these tools, as if the planner
    /// were wrong.
    pub(crate) fn spoil_if(spoils: fn(&ToolTable) -> bool) {
        SPOILS.set(spoils);
    }

    /// The same with any tools.
    pub(crate) fn spoil_paths() {
        spoil_if(|_| true);
    }

    pub(super) fn spoil(plan: &mut Plan, tools: &ToolTable) {
        if SPOILS.get()(tools)
            && let Some(last) = plan.path.elements.last_mut()
        {
            last.end[0] += 0.1;
        }
    }

    pub(crate) fn sinumerik() -> Profile {
        settings::load_profile("sinumerik_840c").expect("a profile")
    }

    /// D1 of this radius.
    pub(crate) fn offset(radius_mm: f64) -> ToolTable {
        let mut tools = ToolTable::default();
        tools.offsets.insert(1, Offset { radius_mm, ..Offset::default() });
        tools
    }

    /// Around the outside of a square of 100 mm, and straight moves to it and from it.
    pub(crate) fn square() -> ProgrammedContour {
        let points =
            [[0.0, -20.0], [0.0, 0.0], [0.0, 100.0], [100.0, 100.0], [100.0, 0.0], [0.0, 0.0]];
        let points = points.into_iter().chain([[-20.0, -20.0]]);
        let mut contour = ProgrammedContour::default();
        for (line, [x, y]) in (1..).zip(points) {
            let source = Source { line, ..Source::default() };
            let mut push = |kind| contour.events.push(ContourEvent { source, kind });
            if line == 2 {
                push(Kind::Radius(RadiusSource::Offset(1)));
                push(Kind::Select { side: CutterSide::Left, approach: None, along: None });
            }
            if line == 7 {
                push(Kind::Cancel { exit: None });
            }
            push(Kind::Motion(Motion {
                shape: Shape::Line,
                end: [x, y, 0.0],
                class: MotionClass::Feed,
                feed_mm_per_min: 100.0,
                axes: AxisSet::default(),
            }));
        }
        contour
    }

    #[test]
    fn a_path_that_no_driver_takes_is_a_limit_with_numbers_and_advice() {
        let elements_max = (PATHS_BYTES_MAX / path_bytes(1, 0)) as usize;
        let functions_max = (PATHS_BYTES_MAX / path_bytes(0, 1)) as usize;
        let events_max = ITEM_COUNT_MAX as usize;
        for (events, path) in [(events_max, [elements_max, 0]), (events_max, [0, functions_max])] {
            assert_eq!(too_long(events, path), None, "{path:?}");
        }
        for (events, path, numbers) in [
            (events_max + 1, [0, 0], "50000001 events; at most 50000000 can be run"),
            (0, [elements_max + 1, 0], "takes 769 MB of the driver's memory; 768 MB are allowed"),
            (0, [0, functions_max + 1], "takes 769 MB of the driver's memory; 768 MB are allowed"),
            (0, [elements_max, functions_max], "takes 1536 MB of the driver's memory"),
        ] {
            let limit = too_long(events, path).expect("a limit");
            assert!(limit.is_error() && limit.code == Code::Limit, "{limit:?}");
            assert!(limit.message.contains(numbers), "{limit:?}");
            assert!(limit.help.contains("split the program into several"), "{limit:?}");
        }
    }
}
