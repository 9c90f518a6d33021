//! A run that begins at a line: the planner is asked what its control says of that.
//!
//! The driver knows a path and no control. Whether a run begins under cutter compensation,
//! and how the tool may get there, is in the profile, which the planner has.

use super::path::Planned;
use crate::codes::error_code;
use crate::driver::Refusal;
use cnc_msgs::convert::start_in_span_from_wire;
use cnc_msgs::path::StartInSpan;
use cnc_msgs::wire::cnc_msgs::srv::{PlanStart, PlanStartRequest};
use runtime::Client;
use std::time::Duration;

/// How long the planner may take.
const ASK_WITHIN: Duration = Duration::from_millis(1_500);

/// What the control of a program says of a run that begins at a line.
///
/// # Errors
/// It does not begin there, or the planner does not say.
pub(super) async fn ask(
    planner: &Client<PlanStart>,
    planned: &Planned,
    (line, occurrence): (u32, u32),
) -> Result<StartInSpan, Refusal> {
    if line <= 1 && occurrence <= 1 {
        // The whole program.
        return Ok(StartInSpan::Refused);
    }
    let Planned { program_id, revision, .. } = planned.clone();
    let refusal = |message| Refusal { error_code: error_code::START_LINE, message };
    let question = PlanStartRequest { program_id, revision, line, occurrence };
    let answer = planner.call_within(question, ASK_WITHIN).await.map_err(|error| {
        refusal(format!(
            "the planner did not answer whether a run can begin at line {line}: {error}"
        ))
    })?;
    if !answer.success {
        return Err(refusal(answer.message));
    }
    tracing::info!("{}", answer.message);
    Ok(start_in_span_from_wire(answer.entry))
}
