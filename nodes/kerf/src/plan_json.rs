//! The JSON object that `kerf plan --json` prints, for scripts and tests.
//!
//! Millimetres and degrees. The keys are a contract; the Rust types may change.

use cnc_msgs::contour::{CutterSide, Source};
use cnc_msgs::finding::{Finding, Severity};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::path::{PathElement, PathEvent, StartInSpan};
use compensation_planner::{Certificate, CertificateLimit, OutlinePiece, Start, UncutRegion};
use path_audit::Audit;
use serde_json::{Map, Value, json};

/// The content of the object.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlanReport<'a> {
    pub(crate) control: &'a str,
    pub(crate) accepted: bool,
    /// Start of the first element.
    pub(crate) start: Position,
    /// How a run starts at the requested line.
    pub(crate) run_start: Option<&'a Start>,
    pub(crate) elements: &'a [PathElement],
    pub(crate) events: &'a [PathEvent],
    /// What a refused program would have cut, for pictures.
    pub(crate) refused_elements: &'a [PathElement],
    pub(crate) findings: &'a [Finding],
    pub(crate) certificates: &'a [Certificate],
    pub(crate) uncut: &'a [UncutRegion],
    /// `None`: there was no path to audit.
    pub(crate) audit: Option<&'a Audit>,
}

impl PlanReport<'_> {
    /// The whole object.
    pub(crate) fn to_json(self) -> Value {
        let mut object = Map::new();
        object.insert("control".into(), json!(self.control));
        object.insert("accepted".into(), json!(self.accepted));
        object.insert("elements".into(), elements(self.start, self.elements));
        if !self.accepted {
            object.insert("refused_elements".into(), elements(self.start, self.refused_elements));
        }
        object.insert("events".into(), self.events.iter().map(event).collect());
        object.insert("findings".into(), self.findings.iter().map(finding).collect());
        let certificates = self.certificates.iter().map(certificate).collect();
        object.insert("certificates".into(), certificates);
        object.insert("uncut".into(), self.uncut.iter().map(uncut).collect());
        if let Some(start) = self.run_start {
            object.insert("start".into(), Self::begun(start));
        }
        if let Some(audit) = self.audit {
            object.insert("audit".into(), self::audit(audit));
        }
        Value::Object(object)
    }

    fn begun(start: &Start) -> Value {
        json!({
            "at_element": start.entry.element,
            "position": start.at,
            "in_span": start.in_span != StartInSpan::Refused,
            "message": start.to_string(),
        })
    }
}

fn elements(start: Position, elements: &[PathElement]) -> Value {
    let starts = std::iter::once(start).chain(elements.iter().map(|element| element.end));
    starts.zip(elements).map(|(start, element)| self::element(start, element)).collect()
}

/// A line or arc.
fn shape(start: Position, shape: &Shape, end: Position) -> Map<String, Value> {
    let mut object = Map::new();
    let kind = match shape {
        Shape::Line => "line",
        Shape::Arc(_) => "arc",
    };
    object.insert("kind".into(), json!(kind));
    object.insert("start".into(), json!(start));
    object.insert("end".into(), json!(end));
    if let Shape::Arc(arc) = shape {
        object.insert("center".into(), json!(arc.center));
        object.insert("clockwise".into(), json!(arc.clockwise));
        object.insert("turns".into(), json!(arc.turns));
        object.insert("plane".into(), json!(arc.plane.name()));
    }
    object
}

/// An area that stays uncut, with its outline.
fn uncut(region: &UncutRegion) -> Value {
    let ends = region.outline.iter().map(|piece| piece.end);
    let starts = std::iter::once(region.start).chain(ends);
    let piece = |(start, piece): (Position, &OutlinePiece)| {
        Value::Object(shape(start, &piece.shape, piece.end))
    };
    json!({
        "first_line": region.first.line,
        "last_line": region.last.line,
        "area_mm2": region.area_mm2,
        "outline": starts.zip(&region.outline).map(piece).collect::<Vec<_>>(),
    })
}

fn element(start: Position, element: &PathElement) -> Value {
    let mut object = shape(start, &element.shape, element.end);
    object.insert("rapid".into(), json!(element.feed_mm_per_min.is_none()));
    object.insert("feed_mm_per_min".into(), json!(element.feed_mm_per_min));
    object.insert("role".into(), json!(element.role.name()));
    place(&mut object, &element.source);
    Value::Object(object)
}

fn event(event: &PathEvent) -> Value {
    let mut object = Map::new();
    object.insert("kind".into(), json!(event.action.kind()));
    object.insert("text".into(), json!(event.action.text()));
    place(&mut object, &event.source);
    object.insert("at_element".into(), json!(event.at_element));
    Value::Object(object)
}

/// One finding of the list.
pub(crate) fn finding(finding: &Finding) -> Value {
    json!({
        "severity": match finding.severity {
            Severity::Warning => "warning",
            Severity::Error => "error",
        },
        "code": finding.code.name(),
        "alarm": finding.alarm,
        "line": finding.source.line,
        "column": finding.source.column,
        "length": finding.source.length,
        "block": finding.source.block,
        "other_line": finding.other.map(|other| other.line),
        "other_block": finding.other.and_then(|other| other.block),
        "position": finding.position,
        "depth_mm": finding.depth_mm,
        "needed_mm": finding.needed_mm,
        "available_mm": finding.available_mm,
        "message": finding.message,
        "help": finding.help,
    })
}

/// The findings of the audit beyond the planner's own; they are in the list, too.
fn audit(audit: &Audit) -> Value {
    json!({
        "accepted": !audit.refuses(),
        "elements": audit.elements,
        "spans": audit.spans,
        "events": audit.events,
        "nearest_mm": audit.nearest_mm,
        "findings": audit.findings.iter().map(finding).collect::<Vec<_>>(),
    })
}

/// The radii that a span is good for; `null` when nothing limits them.
fn certificate(certificate: &Certificate) -> Value {
    let limit = |limit: &CertificateLimit| {
        json!({
            "line": limit.source.line,
            "block": limit.source.block,
            "position": limit.position,
        })
    };
    let finite = |radius_mm: f64| radius_mm.is_finite().then_some(radius_mm);
    json!({
        "first_line": certificate.first_line,
        "last_line": certificate.last_line,
        "side": match certificate.side {
            CutterSide::Left => "left",
            CutterSide::Right => "right",
        },
        "radius_mm": certificate.radius_mm,
        "valid_from_mm": certificate.valid_from_mm,
        "valid_to_mm": finite(certificate.valid_to_mm),
        "limited_by": certificate.limited_by.iter().map(limit).collect::<Vec<_>>(),
        "leads_valid_to_mm": finite(certificate.leads_valid_to_mm),
    })
}

fn place(object: &mut Map<String, Value>, source: &Source) {
    object.insert("line".into(), json!(source.line));
    object.insert("block".into(), json!(source.block));
}
