//! Replays the loader's core on recorded program texts.

use super::bounds::comparable;
use super::compare::Comparison;
use super::inputs::CoreInputs;
use super::output::CoreOutput;
use super::recording::Recording;
use super::{ReplayError, refused_loads};
use cnc_msgs::chunk::ContourChunks;
use cnc_msgs::interface::Message as _;
use cnc_msgs::wire::cnc_msgs::msg::{ContourChunk, ProgrammedContour};
use cnc_msgs::wire::rcl_interfaces::msg::{ParameterType, ParameterValue};
use program_loader::limits::FlowLimits;
use program_loader::{LoadOptions, load};

/// Loads every recorded program again.
pub(crate) fn replay(
    inputs: &mut CoreInputs,
    comparison: &mut Comparison,
    outputs: &mut Vec<CoreOutput>,
) -> Result<(), ReplayError> {
    let mut made = Vec::new();
    let recording = &inputs.recording;
    for (id, program) in &recording.programs {
        let profile = program.profile()?;
        let options = LoadOptions {
            start: program.contour.start,
            block_delete: block_delete(recording),
            flow: flow(recording),
            ..LoadOptions::default()
        };
        let mut loaded = load(&program.text, &profile, &options);
        if recording.definitions.is_migrated(ContourChunk::TYPE_NAME) {
            // What was recorded knows no calls, and neither does the path that was made of it.
            loaded.contour.forget_calls();
        }
        if let Some(finding) = loaded.findings.iter().find(|finding| finding.is_error()) {
            comparison.differs(
                "program",
                "accepted",
                format!(
                    "{} was accepted and is refused now: line {}: {}",
                    program.manifest.name, finding.source.line, finding.message
                ),
            );
            made.push((id.clone(), None));
            continue;
        }
        let bounds = program_loader::answer::corners(&loaded);
        let now = ContourChunks::new(id.clone(), loaded.contour);
        let then = &program.manifest;
        let manifest = ProgrammedContour {
            header: then.header.clone(),
            program_id: id.clone(),
            name: then.name.clone(),
            control: then.control.clone(),
            profile: then.profile.clone(),
            bounds_min: bounds.0,
            bounds_max: bounds.1,
            ..now.manifest()
        };
        comparison.message("programmed_contour", &comparable(then), &comparable(&manifest));
        let all = |chunks: &ContourChunks| -> Vec<ContourChunk> {
            (0..chunks.count()).filter_map(|index| chunks.chunk(index)).collect()
        };
        let chunks = all(&now);
        if program.manifest.sha256 == manifest.sha256 {
            // Every byte is the same: the checksums of the recorded chunks were checked when
            // they were read.
            comparison.count("programmed_contour/chunks", chunks.len());
        } else {
            let recorded = all(&ContourChunks::new(id.clone(), (*program.contour).clone()));
            comparison.sequence("programmed_contour/chunks", &recorded, &chunks);
        }
        let at = program.log_time_ns;
        outputs.push(CoreOutput::new("programmed_contour", at, &manifest));
        outputs.extend(
            chunks.iter().map(|chunk| CoreOutput::new("programmed_contour/chunks", at, chunk)),
        );
        made.push((id.clone(), Some((manifest, now))));
    }
    for (id, made) in &made {
        inputs.hand_on_contour(id, made.as_ref().map(|(manifest, cut)| (manifest, cut)))?;
    }
    refused_loads::replay(&inputs.recording, comparison)
}

/// Whether blocks that begin with a slash were skipped.
pub(crate) fn block_delete(recording: &Recording) -> bool {
    parameter(recording, "block_delete")
        .is_some_and(|value| value.type_ == ParameterType::PARAMETER_BOOL && value.bool_value)
}

/// The recorded limits of loops and subroutines.
pub(crate) fn flow(recording: &Recording) -> FlowLimits {
    let recorded = |name| parameter(recording, name).map(|value| value.integer_value);
    let standard = FlowLimits::default();
    // A loader without the parameter had no such bound.
    let bytes_max = recorded("executed_bytes_max").map_or(u64::MAX, i64::unsigned_abs);
    FlowLimits {
        bytes_max,
        blocks_max: recorded("executed_blocks_max").map_or(standard.blocks_max, i64::unsigned_abs),
        depth_max: recorded("subroutine_depth_max")
            .map_or(standard.depth_max, |most| most.unsigned_abs() as usize),
        // What took too long on another computer is read whole.
        time: None,
    }
}

/// A recorded parameter of the loader.
pub(crate) fn parameter<'a>(recording: &'a Recording, name: &str) -> Option<&'a ParameterValue> {
    let node = recording.parameters.get("program_loader")?;
    node.parameters.iter().find(|row| row.name == name).map(|row| &row.value)
}
