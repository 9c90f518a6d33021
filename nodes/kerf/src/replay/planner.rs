//! The planner's core on recorded contours and tool tables.

use super::compare::Comparison;
use super::recording::Recording;
use super::{Output, ReplayError};
use cnc_msgs::chunk::PathChunks;
use cnc_msgs::units::point_from_position;
use cnc_msgs::wire::cnc_msgs::msg::{CompensatedPath, CompensationReport, PathChunk};
use compensation_planner::plan;
use std::sync::Arc;

/// Plans again whatever was planned and whose inputs are there.
pub(super) fn replay(
    recording: &Recording,
    comparison: &mut Comparison,
    outputs: &mut Vec<Output>,
) -> Result<(), ReplayError> {
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
        let now = plan(&program.contour, &profile, tools);
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

        let (Some(manifest), Some(path)) = (&recorded.manifest, &recorded.path) else { continue };
        if !now.accepted() {
            continue;
        }
        let cut = |path| PathChunks::new(report.program_id.clone(), revision, path);
        let (before, now) = (cut(Arc::clone(path)), cut(Arc::new(now.path)));
        let manifest_now = CompensatedPath {
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
    Ok(())
}
