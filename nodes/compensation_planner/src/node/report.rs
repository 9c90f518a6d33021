//! Publishes the report, first without its certificates and then with them, and returns findings page
//! by page.

use super::{Input, Planner};
use crate::node::threads::Threads;
use crate::tools::report::{certify, fitting, report_of};
use crate::walk::plan::{Plan, certificates};
use cnc_msgs::tool_table::ToolTable;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use cnc_msgs::wire::cnc_msgs::srv::{GetFindingsRequest, GetFindingsResponse};
use runtime::RosTime;
use std::sync::PoisonError;

/// A plan that was reported without its certificates.
pub(super) struct Uncertified {
    pub(super) input: Input,
    pub(super) tools: ToolTable,
    pub(super) report: wire::CompensationReport,
}

impl Planner {
    /// The report of a plan for this input.
    pub(super) fn report(
        &self,
        input: &Input,
        (revision, tool_table_revision): (u64, u64),
        stamp: RosTime,
        planned: &Plan,
    ) -> wire::CompensationReport {
        wire::CompensationReport {
            header: self.header(input, stamp),
            program_id: input.manifest.program_id.clone(),
            revision,
            tool_table_revision,
            ..report_of(planned, self.chord_error_mm)
        }
    }

    /// Finds the valid radii, and publishes the report again with them. A newer program, another
    /// tool and a deactivation end that.
    pub(super) fn find_certificates(&self, Uncertified { input, tools, mut report }: Uncertified) {
        let is_newest = || {
            let state = self.state();
            state.revision == report.revision && !state.is_due
        };
        let goes_on = || is_newest() && self.node.require_active().is_ok();
        let found = certificates(&input.contour, &input.profile, &tools, &Threads::all(), &goes_on);
        if goes_on() && !found.is_empty() {
            certify(&mut report, &found);
            self.publish_report(report);
        }
    }

    /// Publishes a report unless a newer plan was reported meanwhile.
    pub(super) fn publish_report(&self, report: wire::CompensationReport) {
        let mut reported = self.reported.lock().unwrap_or_else(PoisonError::into_inner);
        if report.revision >= *reported {
            *reported = report.revision;
            self.report.publish(report);
        }
    }

    pub(super) fn findings(&self, request: &GetFindingsRequest) -> GetFindingsResponse {
        let Some(current) = self.state().current.clone() else {
            return GetFindingsResponse {
                error_code: GetFindingsResponse::UNKNOWN_PLAN,
                message: "nothing is planned yet".into(),
                ..GetFindingsResponse::default()
            };
        };
        let rest = current.findings.iter().skip(request.first as usize).cloned();
        GetFindingsResponse {
            success: true,
            program_id: current.program_id.clone(),
            revision: current.revision,
            findings: fitting(rest),
            uncut: fitting(current.uncut.iter().skip(request.first as usize).cloned()),
            ..GetFindingsResponse::default()
        }
    }
}
