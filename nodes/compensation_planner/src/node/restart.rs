//! Answers how a run begins at a line: the service around `restart`.

use super::live_offset::RunningPlan;
use crate::tools::restart::start;
use cnc_msgs::convert::start_in_span_to_wire;
use cnc_msgs::wire::cnc_msgs::srv::{PlanStartRequest, PlanStartResponse};

/// The answer of a planner with this newest plan.
pub(super) fn plan(newest: Option<&RunningPlan>, request: &PlanStartRequest) -> PlanStartResponse {
    type W = PlanStartResponse;
    let is_meant = |plan: &&RunningPlan| {
        plan.revision == request.revision && plan.program_id == request.program_id
    };
    let Some(RunningPlan { input, path, .. }) = newest.filter(is_meant) else {
        let PlanStartRequest { program_id, revision, .. } = request;
        let message = format!("revision {revision} of {program_id} is not the newest plan");
        return W { error_code: W::UNKNOWN_PLAN, message, ..W::default() };
    };
    match start(&input.contour, &input.profile, path, request.line, request.occurrence) {
        Ok(start) => {
            let message = match &start.warning {
                Some(warning) => format!("{}; the run {start}", warning.message),
                None => format!("the run {start}"),
            };
            W {
                success: true,
                message,
                entry: start_in_span_to_wire(start.in_span),
                ..W::default()
            }
        }
        Err(refused) => {
            let finding = &refused.finding;
            let message = format!("{}; {}", finding.message, finding.help);
            W {
                error_code: W::START_REFUSED,
                message,
                nearest_line: refused.nearest.line,
                nearest_occurrence: refused.nearest_occurrence,
                ..W::default()
            }
        }
    }
}
