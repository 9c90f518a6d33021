//! The planner's core on recorded contours and tool tables.

use super::compare::Comparison;
use super::recording::{RecordedProgram, Recording};
use super::{Output, ReplayError};
use cnc_msgs::chunk::PathChunks;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::profile::Profile;
use cnc_msgs::units::point_from_position;
use cnc_msgs::wire::cnc_msgs::msg::{
    CompensatedPath as CompensatedPathMessage, CompensationReport, PathChunk,
};
use compensation_planner::audit::{audit, veto};
use compensation_planner::rest::{Rest, plan_rest};
use compensation_planner::set_tool::LoadedProgram;
use compensation_planner::{Plan, UncutRegion, plan};
use std::sync::Arc;

/// What today's planner makes of a revision; of a refused one, nothing.
#[derive(Debug)]
pub(crate) struct Replanned {
    pub(crate) revision: u64,
    pub(crate) path: Arc<CompensatedPath>,
    pub(crate) uncut: Vec<UncutRegion>,
}

/// Plans again whatever was planned and whose inputs are there.
pub(super) fn replay(
    recording: &Recording,
    comparison: &mut Comparison,
    outputs: &mut Vec<Output>,
) -> Result<Vec<Replanned>, ReplayError> {
    let mut plans = Vec::new();
    for (&revision, recorded) in &recording.plans {
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
        let profile = runtime::profile_from_yaml(&program.manifest.profile).map_err(|error| {
            ReplayError::Input { of: report.program_id.clone(), reason: error.to_string() }
        })?;
        let rest = rest_of(recording, program, &profile, revision)?;
        let (contour, tools) = match &rest {
            Some(rest) => (&rest.contour, &rest.tools),
            None => (&*program.contour, tools),
        };
        let mut now = match &rest {
            Some(rest) => rest.plan.clone(),
            None => plan(contour, &profile, tools),
        };
        veto(&mut now, contour, &profile, tools);
        if let Some(path) = &recorded.path {
            let found = audit(contour, path, &profile, tools).beside(&now.diagnostics);
            comparison.count("audit", 1);
            for error in found.findings.iter().filter(|finding| finding.is_error()) {
                let of = format!("audit of revision {revision}");
                comparison.differs(&of, error.code.name(), error.message.clone());
            }
        }
        let errors = now.diagnostics.iter().filter(|finding| finding.is_error()).count();
        let mut report_now = CompensationReport {
            accepted: now.accepted(),
            error_count: errors as u32,
            warning_count: (now.diagnostics.len() - errors) as u32,
            diagnostics: now.diagnostics.iter().map(Into::into).collect(),
            ..report.clone()
        };
        // The report holds only what fits; get_findings has the rest.
        report_now.diagnostics.truncate(report.diagnostics.len().max(1));
        comparison.message("compensation_report", report, &report_now);
        outputs.push(Output::new("compensation_report", recorded.log_time_ns, &report_now));

        if !now.accepted() {
            continue;
        }
        let Plan { path: path_now, uncut, .. } = now;
        let path_now = Arc::new(path_now);
        plans.push(Replanned { revision, path: Arc::clone(&path_now), uncut });
        let (Some(manifest), Some(path)) = (&recorded.manifest, &recorded.path) else { continue };
        let cut = |path| PathChunks::new(report.program_id.clone(), revision, path);
        let (before, now) = (cut(Arc::clone(path)), cut(path_now));
        let manifest_now = CompensatedPathMessage {
            element_count: now.path().elements.len() as u64,
            event_count: now.path().events.len() as u64,
            chunk_count: now.count(),
            sha256: now.sha256().to_owned(),
            start: point_from_position(now.path().start),
            assumed_axes: now.path().assumed_axes.bits(),
            ..manifest.clone()
        };
        comparison.message("compensated_path", manifest, &manifest_now);
        let all = |chunks: &PathChunks| -> Vec<PathChunk> {
            (0..chunks.count()).filter_map(|index| chunks.chunk(index)).collect()
        };
        let chunks = all(&now);
        comparison.sequence("compensated_path/chunks", &all(&before), &chunks);
        let at = recorded.log_time_ns;
        outputs.push(Output::new("compensated_path", at, &manifest_now));
        outputs
            .extend(chunks.iter().map(|chunk| Output::new("compensated_path/chunks", at, chunk)));
    }
    Ok(plans)
}

/// What was planned for the rest of a run that stood in a hold: upon the plan that ran
/// then, which may be such a rest itself. `None` for a plan of its own.
fn rest_of(
    recording: &Recording,
    program: &RecordedProgram,
    profile: &Profile,
    revision: u64,
) -> Result<Option<Rest>, ReplayError> {
    let manifest = recording.plans.get(&revision).and_then(|plan| plan.manifest.as_ref());
    let Some(manifest) = manifest.filter(|manifest| manifest.continues_revision > 0) else {
        return Ok(None);
    };
    let of = || format!("revision {revision} of {}", manifest.program_id);
    let base = manifest.continues_revision;
    let earlier = (base < revision).then(|| recording.plans.get(&base)).flatten();
    let running = earlier.and_then(|plan| plan.path.as_ref());
    let tables = earlier.map(|plan| plan.report.tool_table_revision);
    let before = tables.and_then(|revision| recording.tool_tables.get(&revision));
    let after = recording.tool_tables.get(&manifest.tool_table_revision);
    let (Some(running), Some(before), Some(after)) = (running, before, after) else {
        return Err(ReplayError::Incomplete { what: "the plan that ran", of: of() });
    };
    let base = rest_of(recording, program, profile, base)?;
    let (contour, before) = match &base {
        Some(rest) => (&rest.contour, &rest.tools),
        None => (&*program.contour, before),
    };
    let name = &program.manifest.name;
    let settled = usize::try_from(manifest.settled_elements).unwrap_or(usize::MAX);
    let program = LoadedProgram { name, contour, profile };
    plan_rest(program, before, after, running, settled)
        .map(Some)
        .map_err(|reason| ReplayError::Input { of: of(), reason })
}
