//! Turns a plan into messages: the report, its certificates, and the manifest of its path.

use crate::check::certificate::Certificate;
use crate::check::uncut::UncutRegion;
use crate::geometry::tessellate;
use crate::walk::plan::Plan;
use cnc_msgs::cdr;
use cnc_msgs::chunk::PathChunks;
use cnc_msgs::contour::CutterSide;
use cnc_msgs::convert::chain_to_wire;
use cnc_msgs::geometry::Position;
use cnc_msgs::interface::Message;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::units::{m_from_mm, m2_from_mm2, point_from_position};
use cnc_msgs::wire::cnc_msgs::msg as wire;

/// Findings of each severity in the report; `get_findings` returns the others.
const FINDINGS_IN_REPORT: usize = 50;
/// The most bytes of findings in one message.
const FINDINGS_BYTES_MAX: usize = 40_000;
/// The most points of an outline in a message; beyond that the chords get longer.
const OUTLINE_POINTS_MAX: usize = 1000;

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
    let extent = extent(chunks.path(), chord_error_mm);
    wire::CompensatedPath {
        bounds_min: point_from_position(extent.min),
        bounds_max: point_from_position(extent.max),
        feed_length: m_from_mm(extent.feed_mm),
        rapid_length: m_from_mm(extent.rapid_mm),
        ..chunks.manifest()
    }
}

/// An outline in chords, so that it fits a message.
pub(crate) fn uncut_to_wire(region: &UncutRegion, mut chord_error_mm: f64) -> wire::UncutRegion {
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
pub(crate) fn fitting<M: Message>(messages: impl Iterator<Item = M>) -> Vec<M> {
    let mut bytes = 0;
    let fits = |message: &M| {
        bytes += cdr::body(message).len();
        bytes <= FINDINGS_BYTES_MAX
    };
    messages.take_while(fits).collect()
}

/// The box around a path and the lengths in it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Extent {
    pub min: Position,
    pub max: Position,
    /// Length of all feed elements, mm.
    pub feed_mm: f64,
    /// Length of all rapids, mm.
    pub rapid_mm: f64,
}

/// Measures a path along its points; arcs are taken to within the chord error.
fn extent(path: &CompensatedPath, chord_error_mm: f64) -> Extent {
    let mut extent = Extent { min: path.start, max: path.start, feed_mm: 0.0, rapid_mm: 0.0 };
    let mut last = path.start;
    for element in &path.elements {
        let mut length = 0.0;
        tessellate::points(last, element, chord_error_mm, |point| {
            length += distance(last, point);
            last = point;
            extent.min = std::array::from_fn(|axis| extent.min[axis].min(point[axis]));
            extent.max = std::array::from_fn(|axis| extent.max[axis].max(point[axis]));
        });
        if element.feed_mm_per_min.is_some() {
            extent.feed_mm += length;
        } else {
            extent.rapid_mm += length;
        }
    }
    extent
}

fn distance(a: Position, b: Position) -> f64 {
    (0..3).map(|axis| (b[axis] - a[axis]).powi(2)).sum::<f64>().sqrt()
}
