//! Turns a plan into messages: the report, first without its certificates and then with them, and
//! its findings page by page.

use super::{Input, Planner};
use crate::check::certificate::Certificate;
use crate::check::uncut::UncutRegion;
use crate::node::preview;
use crate::node::threads::Threads;
use crate::walk::plan::{Plan, certificates};
use cnc_msgs::cdr;
use cnc_msgs::chunk::PathChunks;
use cnc_msgs::contour::CutterSide;
use cnc_msgs::convert::chain_to_wire;
use cnc_msgs::interface::Message;
use cnc_msgs::tool_table::ToolTable;
use cnc_msgs::units::{m_from_mm, m2_from_mm2, point_from_position};
use cnc_msgs::wire::cnc_msgs::msg as wire;
use cnc_msgs::wire::cnc_msgs::srv::{GetFindingsRequest, GetFindingsResponse};
use runtime::RosTime;
use std::sync::PoisonError;

/// Findings of each severity in the report; `get_findings` returns the others.
const FINDINGS_IN_REPORT: usize = 50;
/// The most bytes of findings in one message.
const FINDINGS_BYTES_MAX: usize = 40_000;
/// The most points of an outline in a message; beyond that the chords get longer.
const OUTLINE_POINTS_MAX: usize = 1000;

/// A plan that was reported without its certificates.
pub(super) struct Uncertified {
    pub(super) input: Input,
    pub(super) tools: ToolTable,
    pub(super) report: wire::CompensationReport,
}

/// The report of a plan; the caller fills in the header and the program.
///
/// `chord_error_mm` is how closely outlines follow arcs, the parameter `preview_chord_error_mm`.
/// Certificates come later: [`certify`].
pub fn report_of(planned: &Plan, chord_error_mm: f64) -> wire::CompensationReport {
    let errors = planned.findings.iter().filter(|finding| finding.is_error()).count();
    let findings = planned.findings.iter().take(FINDINGS_IN_REPORT).map(Into::into);
    let uncut = planned.uncut.iter().map(|region| uncut_to_wire(region, chord_error_mm));
    wire::CompensationReport {
        accepted: planned.accepted(),
        error_count: errors as u32,
        warning_count: (planned.findings.len() - errors) as u32,
        findings: fitting(findings),
        uncut_count: planned.uncut.len() as u32,
        uncut: fitting(uncut.take(FINDINGS_IN_REPORT)),
        ..wire::CompensationReport::default()
    }
}

/// Puts the first certificates into a report, which is published without them before.
pub fn certify(report: &mut wire::CompensationReport, certificates: &[Certificate]) {
    report.certificate_count = certificates.len() as u32;
    let first = certificates.iter().take(FINDINGS_IN_REPORT).map(certificate_to_wire);
    report.certificates = fitting(first);
}

/// The manifest of a path; the caller fills in the header and the program.
///
/// Arcs are measured to within `chord_error_mm`, the parameter `preview_chord_error_mm`.
pub fn manifest_of(chunks: &PathChunks, chord_error_mm: f64) -> wire::CompensatedPath {
    let extent = preview::extent(chunks.path(), chord_error_mm);
    wire::CompensatedPath {
        bounds_min: point_from_position(extent.min),
        bounds_max: point_from_position(extent.max),
        feed_length: m_from_mm(extent.feed_mm),
        rapid_length: m_from_mm(extent.rapid_mm),
        ..chunks.manifest()
    }
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

/// An outline in chords, so that it fits a message.
pub(super) fn uncut_to_wire(region: &UncutRegion, mut chord_error_mm: f64) -> wire::UncutRegion {
    let mut outline = region.points(chord_error_mm);
    while outline.len() > OUTLINE_POINTS_MAX && chord_error_mm < 1e3 {
        chord_error_mm *= 4.0;
        outline = region.points(chord_error_mm);
    }
    wire::UncutRegion {
        line: region.first.line,
        area: m2_from_mm2(region.area_mm2),
        outline: outline.into_iter().map(point_from_position).collect(),
        calls: chain_to_wire(&region.calls),
    }
}

fn certificate_to_wire(certificate: &Certificate) -> wire::RadiusCertificate {
    let missing_mm = (certificate.radius_mm - certificate.valid_to_mm).max(0.0);
    let limits = certificate.limited_by.iter().map(|limit| wire::CertificateLimit {
        line: limit.source.line,
        block: limit.source.block.into_iter().collect(),
        position: point_from_position(limit.position),
        missing: m_from_mm(missing_mm),
        calls: chain_to_wire(&limit.calls),
    });
    wire::RadiusCertificate {
        first_line: certificate.first_line,
        last_line: certificate.last_line,
        side: match certificate.side {
            CutterSide::Left => wire::RadiusCertificate::SIDE_LEFT,
            CutterSide::Right => wire::RadiusCertificate::SIDE_RIGHT,
        },
        radius: m_from_mm(certificate.radius_mm),
        valid_from: m_from_mm(certificate.valid_from_mm),
        valid_to: m_from_mm(certificate.valid_to_mm),
        limited_by: limits.collect(),
        leads_valid_to: m_from_mm(certificate.leads_valid_to_mm),
        calls: chain_to_wire(&certificate.calls),
    }
}

/// As many findings as fit into one message.
pub(super) fn fitting<M: Message>(messages: impl Iterator<Item = M>) -> Vec<M> {
    let mut bytes = 0;
    let fits = |message: &M| {
        bytes += cdr::body(message).len();
        bytes <= FINDINGS_BYTES_MAX
    };
    messages.take_while(fits).collect()
}
