//! What comes of starting a case at a line: what the planner says, and what the driver sends.

use super::observe::{element, finding};
use axis_driver::encoder::{EncoderConfig, EncoderStep, start_at};
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::profile::Profile;
use serde_json::{Map, Value, json};
use std::sync::Arc;

/// The height that the driver lifts the tool to, machine frame, mm.
const APPROACH_Z_MM: f64 = -1.0;

/// Puts `restart` and `start` into what was observed.
///
/// # Panics
/// Planner and driver begin at different elements.
pub(super) fn observe(
    observed: &mut Map<String, Value>,
    contour: &ProgrammedContour,
    profile: &Profile,
    path: &CompensatedPath,
    line: u32,
) {
    let start = match compensation_planner::start(contour, profile, path, line, 0) {
        Ok(start) => start,
        Err(refused) => {
            let mut start_object = finding(&refused.finding);
            start_object["nearest_line"] = json!(refused.nearest.line);
            start_object["nearest_block"] = json!(refused.nearest.block);
            observed.insert("restart".into(), start_object);
            return;
        }
    };
    observed.insert("restart".into(), json!(start.warning.as_ref().map(finding)));
    let first = start.entry.element;
    let mut start_object = element(path.start_of(first), &path.elements[first]);
    start_object["says"] = json!(start.to_string());
    match sent(path, line, &start) {
        Ok(lines) => start_object["sent"] = json!(lines),
        Err(problem) => start_object["refused"] = json!(problem),
    }
    observed.insert("start".into(), start_object);
}

/// The lines up to the first that cuts, or why the driver does not begin there: the tool may
/// have to come from a place that the program has not given.
fn sent(
    path: &CompensatedPath,
    line: u32,
    start: &compensation_planner::Start,
) -> Result<Vec<String>, String> {
    let config = EncoderConfig { approach_z_mm: Some(APPROACH_Z_MM), ..EncoderConfig::default() };
    let path = Arc::new(path.clone());
    let (mut encoder, first) =
        start_at(path, config, (line, 0), start.in_span).map_err(|problem| problem.to_string())?;
    assert_eq!(first, start.entry.element, "planner and driver begin at different elements");
    let mut lines = Vec::new();
    let mut is_cutting = false;
    while !is_cutting && let Some(step) = encoder.next_step() {
        lines.push(match step.map_err(|problem| problem.to_string())? {
            EncoderStep::Line(line) => {
                is_cutting = line.element.is_some();
                line.text
            }
            EncoderStep::ToolChange { tool, .. } => format!("(put in T{tool})"),
            EncoderStep::CheckStart => "(is the tool there?)".into(),
            other => panic!("{other:?} at a start in the middle"),
        });
    }
    Ok(lines)
}
