//! A single block of manual data input over the wire: contour in, path out.
//!
//! Keeps nothing: the plan of the loaded program stays as it is.

use crate::tools::mdi::plan_block;
use crate::tools::report::{fitting, manifest_of};
use crate::tools::verdict::{Disagreement, Verdict};
use cnc_msgs::chunk::{Collector, PathChunks};
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::tool_table::ToolTable;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use cnc_msgs::wire::cnc_msgs::srv::{PlanBlockRequest, PlanBlockResponse};
use std::sync::Arc;

/// Nobody draws the arcs of a single block.
const CHORD_ERROR_MM: f64 = 1.0;

/// The name of the program in a report about a single block.
pub(super) const NAME: &str = "a single block";

/// The answer of a planner that is not active.
pub(super) fn refuse(message: String) -> PlanBlockResponse {
    let error_code = PlanBlockResponse::NOT_ACTIVE;
    PlanBlockResponse { error_code, message, ..PlanBlockResponse::default() }
}

/// The answer, and the disagreement between planner and audit if there is one.
pub(super) fn plan(
    request: &PlanBlockRequest,
    tools: &ToolTable,
) -> (PlanBlockResponse, Option<Disagreement>) {
    type W = PlanBlockResponse;
    let invalid = |message| (W { error_code: W::INVALID_REQUEST, message, ..W::default() }, None);
    let profile = match settings::profile_from_yaml(&request.contour.profile) {
        Ok(profile) => profile,
        Err(error) => return invalid(error.to_string()),
    };
    let contour = match contour(request) {
        Ok(contour) => contour,
        Err(error) => return invalid(error),
    };
    let Verdict { plan: planned, disagreement, .. } = plan_block(&contour, &profile, tools);
    let accepted = planned.accepted();
    let said: Vec<&str> = planned
        .findings
        .iter()
        .filter(|finding| accepted || finding.is_error())
        .map(|finding| finding.message.as_str())
        .collect();
    let response = W {
        message: said.join("; "),
        findings: fitting(planned.findings.iter().map(Into::into)),
        ..W::default()
    };
    if !accepted {
        return (W { error_code: W::PLAN_REFUSED, ..response }, disagreement);
    }
    let path = Arc::new(planned.path);
    let chunks = PathChunks::new(request.contour.program_id.clone(), 0, path);
    let response = W {
        success: true,
        path: wire::CompensatedPath {
            header: request.contour.header.clone(),
            program_id: request.contour.program_id.clone(),
            control: request.contour.control.clone(),
            ..manifest_of(&chunks, CHORD_ERROR_MM)
        },
        chunks: (0..chunks.count()).filter_map(|index| chunks.chunk(index)).collect(),
        ..response
    };
    (response, None)
}

fn contour(request: &PlanBlockRequest) -> Result<ProgrammedContour, String> {
    let message = |error: cnc_msgs::chunk::ChunkError| error.to_string();
    let mut collector = Collector::for_contour(&request.contour).map_err(message)?;
    for chunk in &request.chunks {
        collector.add(chunk.clone()).map_err(message)?;
    }
    collector.finish(&request.contour).map_err(message)
}
