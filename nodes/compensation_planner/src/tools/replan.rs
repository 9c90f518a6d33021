//! Plans the rest of a running program with another value of its offset (S46, S48).
//!
//! What the machine has been sent stays as it is. The next straight block after it starts at the
//! intersection with the old radius and ends at the intersection with the new one, as if the
//! program had changed its offset there (S43). Tool lengths stay: they would move the machine where
//! it stands.

use crate::geometry::frame::in_plane;
use crate::geometry::tolerance::MERGE_MM;
use crate::tools::set_tool::{LoadedProgram, message_and_help};
use crate::tools::verdict::{Disagreement, Verdict, prove};
use crate::walk::plan::{Plan, plan};
use cnc_msgs::contour::{ContourEvent, ContourEventKind, ProgrammedContour, RadiusSource};
use cnc_msgs::geometry::{Arc, Plane, Position, Shape};
use cnc_msgs::path::{CompensatedPath, PathElement};
use cnc_msgs::profile::{LiveValue, Profile, RadiusValue};
use cnc_msgs::radius::resolve;
use cnc_msgs::tool_table::ToolTable;

/// A path that begins like the running one and continues with other radii.
#[derive(Debug, Clone, PartialEq)]
pub struct Replanned {
    /// The program with its change of radius; the path is made from it.
    pub contour: ProgrammedContour,
    /// The tools of this plan: new radii, old lengths.
    pub tools: ToolTable,
    pub plan: Plan,
    /// The block that ends with the new radius.
    pub from_line: u32,
}

/// Why the program continues unchanged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct NotReplanned {
    pub message: String,
    /// Planner and audit disagree on the rest.
    pub disagreement: Option<Box<Disagreement>>,
}

impl From<String> for NotReplanned {
    fn from(message: String) -> Self {
        Self { message, disagreement: None }
    }
}

impl From<&str> for NotReplanned {
    fn from(message: &str) -> Self {
        message.to_owned().into()
    }
}

/// Plans the rest of a program that runs along `running`, of which `settled` elements have been
/// sent or are about to be.
///
/// # Errors
/// The control does not support this, nothing is left to change, or the rest cannot be cut: the
/// program continues unchanged.
pub fn replan(
    program: LoadedProgram<'_>,
    before: &ToolTable,
    after: &ToolTable,
    running: &CompensatedPath,
    settled: usize,
) -> Result<Replanned, NotReplanned> {
    let LoadedProgram { contour, profile, .. } = program;
    let rules = &profile.radius;
    if rules.live_value != LiveValue::WhenStopped || rules.value_is != RadiusValue::Radius {
        return Err(format!("{} uses a new value from the next run on", profile.name).into());
    }
    let (at, from_line) = next_straight(contour, running, settled)
        .ok_or("no straight block is left in which the radius could change")?;
    let (mut changed, mut in_force) = (contour.clone(), None);
    for event in &mut changed.events[..at] {
        if let ContourEventKind::Radius(word) = &mut event.kind {
            in_force = Some(*word);
            *word = literal(*word, profile, (before, after));
        }
    }
    let in_force = in_force.ok_or("no offset is in force that could change")?;
    let source = contour.events[at].source;
    let kind = ContourEventKind::Radius(in_force);
    changed.events.insert(at, ContourEvent { source, kind });
    let tools = with_lengths_of(before, after);
    let mut plan = plan(&changed, profile, &tools);
    if let Some(finding) = plan.findings.iter().find(|finding| finding.is_error()) {
        return Err(message_and_help(finding).into());
    }
    if plan.path == *running {
        return Err("the change does not affect the rest of the program".into());
    }
    let sent = running.elements.get(..settled).filter(|sent| begins_as(&plan.path, sent));
    let Some(sent) = sent else {
        return Err("blocks that were sent already would be cut differently".into());
    };
    plan.path.elements[..settled].copy_from_slice(sent);
    let Verdict { plan, disagreement, .. } = prove(plan, &changed, profile, &tools);
    if let Some(finding) = plan.findings.iter().find(|finding| finding.is_error()) {
        let disagreement = disagreement.map(Box::new);
        return Err(NotReplanned { message: message_and_help(finding), disagreement });
    }
    Ok(Replanned { contour: changed, tools, plan, from_line })
}

/// Whether a path begins like the elements that have been sent.
///
/// A block that was merged with the next and is now the last of its line may differ by the merging
/// tolerance.
fn begins_as(path: &CompensatedPath, sent: &[PathElement]) -> bool {
    let is_near =
        |a: Position, b: Position| (0..3).all(|axis| (a[axis] - b[axis]).abs() <= MERGE_MM);
    let is_same = |now: &PathElement, sent: &PathElement| {
        let is_alike = match (now.shape, sent.shape) {
            (Shape::Arc(now), Shape::Arc(sent)) => {
                is_near(now.center, sent.center) && Arc { center: sent.center, ..now } == sent
            }
            (now, sent) => now == sent,
        };
        let PathElement { shape, end, .. } = *sent;
        is_alike && is_near(now.end, end) && PathElement { shape, end, ..*now } == *sent
    };
    let begins = path.elements.get(..sent.len());
    begins.is_some_and(|begins| begins.iter().zip(sent).all(|(now, sent)| is_same(now, sent)))
}

/// The first straight move in the plane after the last block of which anything was sent: its place
/// among the events, and its line.
fn next_straight(
    contour: &ProgrammedContour,
    running: &CompensatedPath,
    settled: usize,
) -> Option<(usize, u32)> {
    let last = running.elements.get(settled.checked_sub(1)?)?.source;
    let is_motion = |event: &ContourEvent| matches!(event.kind, ContourEventKind::Motion(_));
    let sent = contour.events.iter().rposition(|event| is_motion(event) && event.source == last)?;
    let (mut plane, mut position) = (Plane::default(), contour.start);
    for (index, event) in contour.events.iter().enumerate() {
        match event.kind {
            ContourEventKind::Plane(selected) => plane = selected,
            ContourEventKind::Motion(motion) => {
                let moves = in_plane(plane, motion.end) != in_plane(plane, position);
                position = motion.end;
                if index > sent && moves && motion.shape == Shape::Line {
                    return Some((index, event.source.line));
                }
            }
            _ => {}
        }
    }
    None
}

/// Replaces a word whose value has changed by the value that it had.
fn literal(
    word: RadiusSource,
    profile: &Profile,
    (before, after): (&ToolTable, &ToolTable),
) -> RadiusSource {
    let value = |tools| resolve(Some(word), None, profile, tools, Default::default()).0;
    match word {
        RadiusSource::Tool(_) | RadiusSource::Offset(_) | RadiusSource::Nose(_)
            if value(before) != value(after) =>
        {
            RadiusSource::Radius(value(before))
        }
        word => word,
    }
}

fn with_lengths_of(before: &ToolTable, after: &ToolTable) -> ToolTable {
    let mut tools = after.clone();
    for (number, tool) in &mut tools.tools {
        tool.length_mm = before.tools.get(number).map_or(tool.length_mm, |old| old.length_mm);
    }
    for (number, offset) in &mut tools.offsets {
        offset.length_mm = before.offsets.get(number).map_or(offset.length_mm, |old| old.length_mm);
    }
    tools
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tools::verdict::tests::{offset, sinumerik, spoil_paths, square};

    #[test]
    fn a_rest_whose_path_is_wrong_is_handed_out_for_a_report() {
        let (profile, contour, before) = (sinumerik(), square(), offset(5.0));
        let program = LoadedProgram { name: "square", contour: &contour, profile: &profile };
        let running = plan(&contour, &profile, &before).path;
        let rest = || replan(program, &before, &offset(8.0), &running, 3);
        let planned = rest().expect("a rest");
        spoil_paths();
        let disagreement = rest().expect_err("a wrong path").disagreement;
        assert_eq!(disagreement.expect("a disagreement").contour, planned.contour);
    }
}
