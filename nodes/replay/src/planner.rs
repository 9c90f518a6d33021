//! Replays the planner's core on recorded contours and tool tables.

use super::compare::{Comparison, Difference};
use super::inputs::CoreInputs;
use super::output::CoreOutput;
use super::path_difference::{Likeness, at_most, likeness};
use super::plan_memo::name_of;
use super::recording::{RecordedPlan, RecordedProgram, Recording};
use super::{Options, ReplayError};
use cnc_msgs::chunk::PathChunks;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::profile::Profile;
use cnc_msgs::wire::cnc_msgs::msg::{
    CompensatedPath as CompensatedPathMessage, CompensationReport, PathChunk, PathEvent,
};
use compensation_planner::report::{certify, manifest_of, report_of};
use compensation_planner::set_tool::LoadedProgram;
use compensation_planner::verdict::prove;
use compensation_planner::{Plan, UncutRegion, plan, plan_certified, replan as rest};
use path_audit::audit_after;
use std::sync::Arc;

/// What today's planner makes of a revision; without a path if it is refused.
#[derive(Debug)]
pub struct PlannedToday {
    pub revision: u64,
    pub path: Arc<CompensatedPath>,
    /// Whether it has the same bytes on the wire as the recorded one.
    is_as_sent: bool,
    pub uncut: Vec<UncutRegion>,
}

/// Plans every revision again whose inputs are in the bag.
pub(crate) fn replay(
    inputs: &mut CoreInputs,
    options: Options<'_>,
    comparison: &mut Comparison,
    outputs: &mut Vec<CoreOutput>,
) -> Result<Vec<PlannedToday>, ReplayError> {
    let revisions: Vec<u64> = inputs.recording.plans.keys().copied().collect();
    let mut plans = Vec::new();
    for revision in revisions {
        let made = replan(inputs, options, &plans, revision, comparison, outputs)?;
        let handed = made.as_ref().and_then(|(_, handed)| handed.as_ref());
        inputs.hand_on_path(revision, handed.map(|(manifest, cut)| (manifest, cut)))?;
        plans.extend(made.map(|(plan, _)| plan));
    }
    Ok(plans)
}

/// Today's plan, and its messages.
type Made = (PlannedToday, Option<(CompensatedPathMessage, PathChunks)>);

/// Plans one revision again; `None` when it is refused now.
fn replan(
    inputs: &CoreInputs,
    options: Options<'_>,
    plans: &[PlannedToday],
    revision: u64,
    comparison: &mut Comparison,
    outputs: &mut Vec<CoreOutput>,
) -> Result<Option<Made>, ReplayError> {
    let recording = &inputs.recording;
    let chord_error_mm = chord_error_mm(recording);
    let recorded = &recording.plans[&revision];
    let report = &recorded.report;
    let (Some(program), Some(tools)) = (
        recording.programs.get(&report.program_id),
        recording.tool_tables.get(&report.tool_table_revision),
    ) else {
        return Err(ReplayError::Incomplete {
            what: "the contour or the tool table",
            of: format!("revision {revision} of {}", report.program_id),
        });
    };
    let of_plan = format!("plan {revision}");
    let Some(programmed) = inputs.contour(&report.program_id) else {
        comparison.differs(&of_plan, "contour", "the loader refuses its program now");
        return Ok(None);
    };
    let profile = program.profile()?;
    let rest = match rest_of(inputs, options, plans, program, &profile, revision) {
        Err(error) if inputs.is_chain() => {
            // It was a rest of the path that ran, and that path is different now.
            comparison.differs(&of_plan, "rest", error.to_string());
            return Ok(None);
        }
        rest => rest?,
    };
    let (contour, tools) = match &rest {
        Some(rest) => (&rest.contour, &rest.tools),
        None => (&*programmed, tools),
    };
    // What the loader makes now, and the rest of a run, are of this bag alone.
    let is_of_bag = rest.is_some() || inputs.is_chain();
    // A plan is known by the checksum of its contour.
    let memo = options.memo.filter(|_| !is_of_bag);
    let memoized = |certifies: bool, make: &dyn Fn() -> Plan| match memo {
        Some(memo) => memo.plan(name_of(program, tools, certifies), make),
        None => Arc::new(make()),
    };
    let mut now = match &rest {
        Some(rest) => rest.plan.clone(),
        None => Arc::unwrap_or_clone(memoized(false, &|| {
            let verdict = prove(plan(contour, &profile, tools), contour, &profile, tools);
            if let Some(found) = &verdict.disagreement {
                options.keep(&program.manifest.name, &program.text, found);
            }
            verdict.plan
        })),
    };
    let mut report_now = CompensationReport {
        header: report.header.clone(),
        program_id: report.program_id.clone(),
        revision,
        tool_table_revision: report.tool_table_revision,
        ..report_of(&now, chord_error_mm)
    };
    // Certificates are published later; the bag of a short run may not have them.
    if report.certificate_count > 0 {
        let certified = memoized(true, &|| plan_certified(contour, &profile, tools));
        certify(&mut report_now, &certified.certificates);
    }
    comparison.message(&format!("compensation_report {revision}"), report, &report_now);
    outputs.push(CoreOutput::new("compensation_report", recorded.log_time_ns, &report_now));

    let mut is_same = false;
    let mut made = None;
    if now.accepted() {
        let path_now = Arc::new(std::mem::take(&mut now.path));
        let handed;
        (is_same, handed) =
            compare_accepted(comparison, recorded, (&path_now, chord_error_mm), outputs);
        let uncut = std::mem::take(&mut now.uncut);
        let before = recorded.manifest.as_ref().map(|manifest| &manifest.sha256);
        let is_as_sent = before.is_some() && before == handed.as_ref().map(|(it, _)| &it.sha256);
        made = Some((PlannedToday { revision, path: path_now, is_as_sent, uncut }, handed));
    }
    if let Some(path) = &recorded.path {
        comparison.count("audit", 1);
        let found = match is_same {
            // The same curve was audited when the plan was accepted.
            true => Vec::new(),
            false => audit_after(contour, path, &profile, tools, &now.findings).findings,
        };
        for error in found.iter().filter(|finding| finding.is_error()) {
            let of = format!("audit of revision {revision}");
            comparison.differs(&of, error.code.name(), error.message.clone());
        }
    }
    Ok(made)
}

/// Compares the path of an accepted plan with the recorded one; returns whether it is the same,
/// and its messages.
fn compare_accepted(
    comparison: &mut Comparison,
    recorded: &RecordedPlan,
    (path_now, chord_error_mm): (&Arc<CompensatedPath>, f64),
    outputs: &mut Vec<CoreOutput>,
) -> (bool, Option<(CompensatedPathMessage, PathChunks)>) {
    let (Some(manifest), Some(path)) = (&recorded.manifest, &recorded.path) else {
        return (false, None);
    };
    let now = PathChunks::new(manifest.program_id.clone(), manifest.revision, Arc::clone(path_now));
    let manifest_now = CompensatedPathMessage {
        header: manifest.header.clone(),
        program_id: manifest.program_id.clone(),
        revision: manifest.revision,
        control: manifest.control.clone(),
        tool_table_revision: manifest.tool_table_revision,
        continues_revision: manifest.continues_revision,
        settled_elements: manifest.settled_elements,
        ..manifest_of(&now, chord_error_mm)
    };
    let chunks: Vec<PathChunk> = (0..now.count()).filter_map(|index| now.chunk(index)).collect();
    let is_same = compare_paths(comparison, (manifest, &manifest_now), path, (now.path(), &chunks));
    let at = recorded.log_time_ns;
    outputs.push(CoreOutput::new("compensated_path", at, &manifest_now));
    outputs
        .extend(chunks.iter().map(|chunk| CoreOutput::new("compensated_path/chunks", at, chunk)));
    (is_same, Some((manifest_now, now)))
}

/// Fields of a chunk or manifest that depend on how a curve is split into elements.
const OF_THE_SPLIT: [&str; 6] =
    ["element_count", "chunk_count", "bounds_min", "bounds_max", "feed_length", "rapid_length"];

/// Compares two paths field by field and, if that finds a difference, as curves.
///
/// The same curve in other elements is a remark. Where elements were added or removed, the
/// elements after them no longer line up: then only the curves are reported.
pub fn compare_paths(
    comparison: &mut Comparison,
    (manifest, manifest_now): (&CompensatedPathMessage, &CompensatedPathMessage),
    path: &Arc<CompensatedPath>,
    (path_now, chunks_now): (&CompensatedPath, &[PathChunk]),
) -> bool {
    let mut fields = comparison.another();
    let mut then = manifest.clone();
    if then.sha256.is_empty() {
        then.sha256.clone_from(&manifest_now.sha256);
    }
    fields.message(&format!("compensated_path {}", manifest.revision), &then, manifest_now);
    comparison.count("paths as curves", 1);
    if manifest.sha256 == manifest_now.sha256 {
        // Every byte is the same: the checksums of the recorded chunks were checked.
        fields.count("compensated_path/chunks", chunks_now.len());
        comparison.take(fields);
        return true;
    }
    let cut = PathChunks::new(manifest.program_id.clone(), manifest.revision, Arc::clone(path));
    let chunks: Vec<PathChunk> = (0..cut.count()).filter_map(|index| cut.chunk(index)).collect();
    fields.sequence("compensated_path/chunks", &chunks, chunks_now);
    let what = format!("path {}", manifest.revision);
    let is_split = |row: &Difference| {
        let field = row.field.split('.').next().unwrap_or_default();
        row.message.starts_with("compensated_path/chunks") || OF_THE_SPLIT.contains(&field)
    };
    let likeness = likeness(path, path_now);
    let is_same = !matches!(likeness, Likeness::Diverges(_));
    match likeness {
        Likeness::Same => {}
        Likeness::OtherElements { recorded, now } => {
            fields.differences.retain(|row| !is_split(row));
            // The places of events have been compared along the curves, but not all their values:
            // their texts leave some out.
            fields.message(&format!("events of {what}"), &events(&chunks), &events(chunks_now));
            comparison.remark(&what, format!("the same curve, {recorded} elements became {now}"));
        }
        Likeness::Diverges(divergence) => {
            if path.elements.len() != path_now.elements.len() {
                fields.differences.retain(|row| !is_split(row));
            }
            let text = format!("{}; {}", divergence.text, at_most(path, path_now));
            comparison.differs_at(&what, "curve", text, divergence.place());
        }
    }
    comparison.take(fields);
    is_same
}

/// The events along a path, without its elements.
fn events(chunks: &[PathChunk]) -> PathChunk {
    let events = chunks.iter().flat_map(|chunk| &chunk.events).cloned();
    let events = events.map(|event| PathEvent { at_element: 0, ..event });
    PathChunk { events: events.collect(), ..PathChunk::default() }
}

/// The chord error with which the node measured arcs.
fn chord_error_mm(recording: &Recording) -> f64 {
    let of_node = recording.parameters.get("compensation_planner");
    let rows = of_node.map_or(&[][..], |node| &node.parameters);
    let row = rows.iter().find(|row| row.name == "preview_chord_error_mm");
    row.map(|row| row.value.double_value).filter(|it| *it > 0.0).unwrap_or(0.05)
}

/// What was planned for the rest of a run that was in a hold: a continuation of the plan that ran
/// then, which may be such a rest itself. `None` for a plan of a whole program.
fn rest_of(
    inputs: &CoreInputs,
    options: Options<'_>,
    plans: &[PlannedToday],
    program: &RecordedProgram,
    profile: &Profile,
    revision: u64,
) -> Result<Option<rest::Replanned>, ReplayError> {
    let recording = &inputs.recording;
    let manifest = recording.plans.get(&revision).and_then(|plan| plan.manifest.as_ref());
    let Some(manifest) = manifest.filter(|manifest| manifest.continues_revision > 0) else {
        return Ok(None);
    };
    let of = || format!("revision {revision} of {}", manifest.program_id);
    let base = manifest.continues_revision;
    let earlier = (base < revision).then(|| recording.plans.get(&base)).flatten();
    // Messages round the path; the planner had it before rounding.
    let today = plans.iter().find(|plan| plan.revision == base && plan.is_as_sent);
    let running = match today {
        Some(today) => Some(Arc::clone(&today.path)),
        None => earlier.and_then(|_| inputs.path(&manifest.program_id, base)),
    };
    let tables = earlier.map(|plan| plan.report.tool_table_revision);
    let before = tables.and_then(|revision| recording.tool_tables.get(&revision));
    let after = recording.tool_tables.get(&manifest.tool_table_revision);
    if earlier.is_some_and(|plan| plan.report.program_id != manifest.program_id) {
        // The text has the results of probes now, and is planned as a whole.
        return Ok(None);
    }
    let contour = inputs.contour(&manifest.program_id);
    let (Some(running), Some(before), Some(after), Some(contour)) =
        (running, before, after, contour)
    else {
        return Err(ReplayError::Incomplete { what: "the plan that ran", of: of() });
    };
    let base = rest_of(inputs, options, plans, program, profile, base)?;
    let (contour, before) = match &base {
        Some(base) => (&base.contour, &base.tools),
        None => (&*contour, before),
    };
    let name = &program.manifest.name;
    let settled = usize::try_from(manifest.settled_elements).unwrap_or(usize::MAX);
    let loaded = LoadedProgram { name, contour, profile };
    rest::replan(loaded, before, after, &running, settled).map(Some).map_err(|why| {
        if let Some(found) = &why.disagreement {
            options.keep(&format!("the rest of {name}"), &program.text, found);
        }
        ReplayError::Input { of: of(), reason: why.message }
    })
}
