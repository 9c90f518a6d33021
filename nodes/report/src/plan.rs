//! The JSON object that `kerf plan --json` prints, for scripts and tests.
//!
//! Millimetres and degrees. The keys are a contract, in the order of the alphabet; the Rust types
//! may change. Lists are made item by item while they are written: see [`json`].

use crate::json;
use cnc_msgs::calls::Call;
use cnc_msgs::contour::{Action, CutterSide, Source};
use cnc_msgs::finding::{Finding, Severity};
use cnc_msgs::further::FURTHER_LETTERS;
use cnc_msgs::geometry::{Arc, Position, Shape};
use cnc_msgs::path::{PathElement, PathEvent, StartInSpan};
use compensation_planner::{Certificate, CertificateLimit, OutlinePiece, Start, UncutRegion};
use path_audit::Audit;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;
use std::io;

/// The content of the object.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct PlanReport<'a> {
    pub accepted: bool,
    /// `None`: there was no path to audit.
    #[serde(serialize_with = "audit", skip_serializing_if = "Option::is_none")]
    pub audit: Option<&'a Audit>,
    /// The table that `call` of elements and events counts in, from 1; absent without calls.
    #[serde(serialize_with = "calls", skip_serializing_if = "<[Call]>::is_empty")]
    pub calls: &'a [Call],
    #[serde(serialize_with = "certificates")]
    pub certificates: &'a [Certificate],
    pub control: &'a str,
    pub elements: Elements<'a>,
    #[serde(serialize_with = "events")]
    pub events: &'a [PathEvent],
    #[serde(serialize_with = "findings")]
    pub findings: &'a [Finding],
    /// With `--machine`: how the path fits it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub machine: Option<&'a OnMachine>,
    /// What a refused program would have cut, for pictures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refused_elements: Option<Elements<'a>>,
    /// How a run starts at the requested line.
    #[serde(serialize_with = "start", skip_serializing_if = "Option::is_none")]
    pub start: Option<&'a Start>,
    #[serde(serialize_with = "uncut")]
    pub uncut: &'a [UncutRegion],
}

impl PlanReport<'_> {
    /// Prints it, and a line feed.
    ///
    /// # Errors
    /// See [`json::print`].
    pub fn print(&self) -> io::Result<()> {
        json::print(self)
    }
}

/// What was found about a path on a machine.
#[derive(Debug, Serialize)]
pub struct OnMachine {
    /// The name of the machine's file.
    pub file: String,
    pub firmware: &'static str,
    pub not_judged: Vec<String>,
    /// From the first move to standstill.
    pub seconds: f64,
}

/// A path.
#[derive(Debug, Clone, Copy)]
pub struct Elements<'a> {
    /// Start of the first element.
    pub start: Position,
    pub elements: &'a [PathElement],
}

impl Serialize for Elements<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let ends = self.elements.iter().map(|element| element.end);
        let starts = std::iter::once(self.start).chain(ends);
        let rows = starts.zip(self.elements);
        serializer.collect_seq(rows.map(|(start, element)| ElementJson::new(start, element)))
    }
}

/// A line or arc of the path.
#[derive(Serialize)]
struct ElementJson {
    block: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    call: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    center: Option<Position>,
    #[serde(skip_serializing_if = "Option::is_none")]
    clockwise: Option<bool>,
    end: Position,
    feed_mm_per_min: Option<f64>,
    kind: &'static str,
    line: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    plane: Option<&'static str>,
    rapid: bool,
    role: &'static str,
    start: Position,
    #[serde(skip_serializing_if = "Option::is_none")]
    turns: Option<u16>,
}

impl ElementJson {
    fn new(start: Position, element: &PathElement) -> Self {
        let arc = arc(&element.shape);
        Self {
            block: element.source.block,
            call: row(element.source),
            center: arc.map(|arc| arc.center),
            clockwise: arc.map(|arc| arc.clockwise),
            end: element.end,
            feed_mm_per_min: element.feed_mm_per_min,
            kind: kind(&element.shape),
            line: element.source.line,
            plane: arc.map(|arc| arc.plane.name()),
            rapid: element.feed_mm_per_min.is_none(),
            role: element.role.name(),
            start,
            turns: arc.map(|arc| arc.turns),
        }
    }
}

/// A line or arc of an outline.
#[derive(Serialize)]
struct PieceJson {
    #[serde(skip_serializing_if = "Option::is_none")]
    center: Option<Position>,
    #[serde(skip_serializing_if = "Option::is_none")]
    clockwise: Option<bool>,
    end: Position,
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    plane: Option<&'static str>,
    start: Position,
    #[serde(skip_serializing_if = "Option::is_none")]
    turns: Option<u16>,
}

impl PieceJson {
    fn new(start: Position, piece: &OutlinePiece) -> Self {
        let arc = arc(&piece.shape);
        Self {
            center: arc.map(|arc| arc.center),
            clockwise: arc.map(|arc| arc.clockwise),
            end: piece.end,
            kind: kind(&piece.shape),
            plane: arc.map(|arc| arc.plane.name()),
            start,
            turns: arc.map(|arc| arc.turns),
        }
    }
}

fn arc(shape: &Shape) -> Option<&Arc> {
    match shape {
        Shape::Line => None,
        Shape::Arc(arc) => Some(arc),
    }
}

fn kind(shape: &Shape) -> &'static str {
    match shape {
        Shape::Line => "line",
        Shape::Arc(_) => "arc",
    }
}

/// The row in `calls` of the plan.
fn row(source: Source) -> Option<u32> {
    (source.call > 0).then_some(source.call)
}

/// Calls and loop passes: the table of the plan, or the chain of one place.
fn calls<S: Serializer>(calls: &[Call], serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct CallJson<'a> {
        depth: u32,
        line: u32,
        #[serde(skip_serializing_if = "Option::is_none")]
        name: Option<&'a str>,
        #[serde(skip_serializing_if = "Option::is_none")]
        parent: Option<u32>,
        pass: u32,
    }
    serializer.collect_seq(calls.iter().map(|call| CallJson {
        depth: call.depth,
        line: call.line,
        name: call.name.as_deref(),
        parent: (call.parent > 0).then_some(call.parent),
        pass: call.pass,
    }))
}

/// The areas that stay uncut, with their outlines.
fn uncut<S: Serializer>(uncut: &[UncutRegion], serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct UncutJson<'a> {
        area_mm2: f64,
        #[serde(serialize_with = "calls", skip_serializing_if = "<[Call]>::is_empty")]
        calls: &'a [Call],
        first_line: u32,
        last_line: u32,
        #[serde(serialize_with = "outline")]
        outline: &'a UncutRegion,
    }
    serializer.collect_seq(uncut.iter().map(|region| UncutJson {
        area_mm2: region.area_mm2,
        calls: &region.calls,
        first_line: region.first.line,
        last_line: region.last.line,
        outline: region,
    }))
}

fn outline<S: Serializer>(region: &UncutRegion, serializer: S) -> Result<S::Ok, S::Error> {
    let ends = region.outline.iter().map(|piece| piece.end);
    let starts = std::iter::once(region.start).chain(ends);
    let rows = starts.zip(&region.outline);
    serializer.collect_seq(rows.map(|(start, piece)| PieceJson::new(start, piece)))
}

fn events<S: Serializer>(events: &[PathEvent], serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct EventJson {
        at_element: usize,
        #[serde(skip_serializing_if = "BTreeMap::is_empty")]
        axes: BTreeMap<char, f64>,
        block: Option<u32>,
        #[serde(skip_serializing_if = "Option::is_none")]
        call: Option<u32>,
        kind: &'static str,
        line: u32,
        text: String,
    }
    serializer.collect_seq(events.iter().map(|event| EventJson {
        at_element: event.at_element,
        axes: match event.action {
            Action::Further(further) => {
                further.axes.iter().map(|(axis, at)| (FURTHER_LETTERS[axis], at)).collect()
            }
            _ => BTreeMap::new(),
        },
        block: event.source.block,
        call: row(event.source),
        kind: event.action.kind(),
        line: event.source.line,
        text: event.action.text(),
    }))
}

/// The findings as a list.
///
/// # Errors
/// Those of the serializer.
pub fn findings<S: Serializer>(findings: &[Finding], serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct FindingJson<'a> {
        alarm: Option<&'a str>,
        available_mm: Option<f64>,
        block: Option<u32>,
        #[serde(serialize_with = "calls", skip_serializing_if = "<[Call]>::is_empty")]
        calls: &'a [Call],
        code: &'static str,
        column: u16,
        depth_mm: Option<f64>,
        help: &'a str,
        length: u16,
        line: u32,
        message: &'a str,
        needed_mm: Option<f64>,
        other_block: Option<u32>,
        #[serde(serialize_with = "calls", skip_serializing_if = "<[Call]>::is_empty")]
        other_calls: &'a [Call],
        other_line: Option<u32>,
        position: Option<Position>,
        severity: &'static str,
    }
    serializer.collect_seq(findings.iter().map(|finding| FindingJson {
        alarm: finding.alarm.as_deref(),
        available_mm: finding.available_mm,
        block: finding.source.block,
        calls: &finding.calls,
        code: finding.code.name(),
        column: finding.source.column,
        depth_mm: finding.depth_mm,
        help: &finding.help,
        length: finding.source.length,
        line: finding.source.line,
        message: &finding.message,
        needed_mm: finding.needed_mm,
        other_block: finding.other.and_then(|other| other.block),
        other_calls: &finding.other_calls,
        other_line: finding.other.map(|other| other.line),
        position: finding.position,
        severity: match finding.severity {
            Severity::Warning => "warning",
            Severity::Error => "error",
        },
    }))
}

/// The findings of the audit beyond the planner's own; they are in the list, too.
fn audit<S: Serializer>(audit: &Option<&Audit>, serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct AuditJson<'a> {
        accepted: bool,
        elements: usize,
        events: usize,
        #[serde(serialize_with = "findings")]
        findings: &'a [Finding],
        nearest_mm: Option<f64>,
        spans: usize,
    }
    let audit = audit.map(|audit| AuditJson {
        accepted: !audit.refuses(),
        elements: audit.elements,
        events: audit.events,
        findings: &audit.findings,
        nearest_mm: audit.nearest_mm,
        spans: audit.spans,
    });
    audit.serialize(serializer)
}

/// The radii that each span is good for; `null` when nothing limits them.
fn certificates<S: Serializer>(
    certificates: &[Certificate],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct CertificateJson<'a> {
        #[serde(serialize_with = "calls", skip_serializing_if = "<[Call]>::is_empty")]
        calls: &'a [Call],
        first_line: u32,
        last_line: u32,
        leads_valid_to_mm: Option<f64>,
        #[serde(serialize_with = "limits")]
        limited_by: &'a [CertificateLimit],
        radius_mm: f64,
        side: &'static str,
        valid_from_mm: f64,
        valid_to_mm: Option<f64>,
    }
    let finite = |radius_mm: f64| radius_mm.is_finite().then_some(radius_mm);
    serializer.collect_seq(certificates.iter().map(|certificate| CertificateJson {
        calls: &certificate.calls,
        first_line: certificate.first_line,
        last_line: certificate.last_line,
        leads_valid_to_mm: finite(certificate.leads_valid_to_mm),
        limited_by: &certificate.limited_by,
        radius_mm: certificate.radius_mm,
        side: match certificate.side {
            CutterSide::Left => "left",
            CutterSide::Right => "right",
        },
        valid_from_mm: certificate.valid_from_mm,
        valid_to_mm: finite(certificate.valid_to_mm),
    }))
}

fn limits<S: Serializer>(limits: &[CertificateLimit], serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct LimitJson<'a> {
        block: Option<u32>,
        #[serde(serialize_with = "calls", skip_serializing_if = "<[Call]>::is_empty")]
        calls: &'a [Call],
        line: u32,
        position: Position,
    }
    serializer.collect_seq(limits.iter().map(|limit| LimitJson {
        block: limit.source.block,
        calls: &limit.calls,
        line: limit.source.line,
        position: limit.position,
    }))
}

fn start<S: Serializer>(start: &Option<&Start>, serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct StartJson {
        at_element: usize,
        in_span: bool,
        message: String,
        position: Position,
    }
    let start = start.map(|start| StartJson {
        at_element: start.entry.element,
        in_span: start.in_span != StartInSpan::Refused,
        message: start.to_string(),
        position: start.at,
    });
    start.serialize(serializer)
}
