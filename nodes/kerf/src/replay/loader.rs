//! The loader's core on recorded program texts.

use super::compare::Comparison;
use super::recording::Recording;
use super::{Output, ReplayError};
use cnc_msgs::chunk::ContourChunks;
use cnc_msgs::units::point_from_position;
use cnc_msgs::wire::cnc_msgs::msg::{ContourChunk, ProgrammedContour};
use cnc_msgs::wire::rcl_interfaces::msg::ParameterType;
use program_loader::{LoadOptions, load};

/// Loads every recorded program again.
pub(super) fn replay(
    recording: &Recording,
    comparison: &mut Comparison,
    outputs: &mut Vec<Output>,
) -> Result<(), ReplayError> {
    for (id, program) in &recording.programs {
        let profile = runtime::profile_from_yaml(&program.manifest.profile)
            .map_err(|error| ReplayError::Input { of: id.clone(), reason: error.to_string() })?;
        let options = LoadOptions {
            start: program.contour.start,
            block_delete: block_delete(recording),
            ..LoadOptions::default()
        };
        let loaded = load(&program.text, &profile, &options);
        if let Some(finding) = loaded.diagnostics.iter().find(|finding| finding.is_error()) {
            comparison.differs(
                "program",
                "accepted",
                format!(
                    "{} was accepted and is refused now: line {}: {}",
                    program.manifest.name, finding.source.line, finding.message
                ),
            );
            continue;
        }
        let bounds = program_loader::node::corners(&loaded);
        let now = ContourChunks::new(id.clone(), loaded.contour);
        let recorded = ContourChunks::new(id.clone(), (*program.contour).clone());
        let manifest = ProgrammedContour {
            event_count: now.contour().events.len() as u64,
            chunk_count: now.count(),
            sha256: now.sha256().to_owned(),
            start: point_from_position(now.contour().start),
            assumed_axes: now.contour().assumed_axes.bits(),
            bounds_min: point_from_position(bounds.0),
            bounds_max: point_from_position(bounds.1),
            ..program.manifest.clone()
        };
        comparison.message("programmed_contour", &program.manifest, &manifest);
        let all = |chunks: &ContourChunks| -> Vec<ContourChunk> {
            (0..chunks.count()).filter_map(|index| chunks.chunk(index)).collect()
        };
        let chunks = all(&now);
        comparison.sequence("programmed_contour/chunks", &all(&recorded), &chunks);
        let at = program.log_time_ns;
        outputs.push(Output::new("programmed_contour", at, &manifest));
        outputs
            .extend(chunks.iter().map(|chunk| Output::new("programmed_contour/chunks", at, chunk)));
    }
    Ok(())
}

/// The loader's parameter of that name, as it was.
fn block_delete(recording: &Recording) -> bool {
    let parameters = recording.parameters.get("program_loader");
    parameters
        .and_then(|node| node.parameters.iter().find(|row| row.name == "block_delete"))
        .is_some_and(|row| row.value.type_ == ParameterType::PARAMETER_BOOL && row.value.bool_value)
}
