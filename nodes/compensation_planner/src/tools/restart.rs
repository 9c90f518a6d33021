//! Plans how a run begins at a line of a program, by the rules of its control.
//!
//! Knows where compensation is on and which point of the path comes next. The driver decides how
//! the tool gets there and what is sent to the controller.

use crate::check::finding::block_name;
use cnc_msgs::contour::{Action, ContourEventKind, CutterSide, ProgrammedContour, Source};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::{AXIS_LETTERS, Plane, Position};
use cnc_msgs::path::{CompensatedPath, Entry, PathElement, PathEvent, StartInSpan, in_force};
use cnc_msgs::profile::{HomeMode, Profile, RestartMode};
use std::fmt;

/// How a run begins at a line. Its text says where, and with which words in force.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    pub entry: Entry,
    /// Where the first element starts, work frame, mm.
    pub at: Position,
    pub in_span: StartInSpan,
    /// Set if the control would not begin there and its profile makes that a warning.
    pub warning: Option<Finding>,
    first: PathElement,
    in_force: Vec<PathEvent>,
}

/// Why no run begins at a line.
#[derive(Debug, Clone, PartialEq)]
pub struct NoStart {
    pub finding: Finding,
    /// The block before the selection: the nearest line to begin at.
    pub nearest: Source,
}

/// Plans how a run of an accepted path begins at `line` (M28, C19).
///
/// Under compensation, which lasts from the selection to the end of the lead-off, a
/// control that rebuilds it begins at the compensated point: the path is proved as a
/// whole, and whoever begins there cuts the same as whoever comes along it.
///
/// # Errors
/// The control does not begin under compensation, or nothing is left from that line on.
pub fn start(
    contour: &ProgrammedContour,
    profile: &Profile,
    path: &CompensatedPath,
    line: u32,
) -> Result<Start, Box<NoStart>> {
    let of_line = Source { line, ..Source::default() };
    let entry = path.entry(line).map_err(|past_end| {
        let text = past_end.to_string();
        let finding = Finding::error(Code::Restart, of_line, text)
            .help(format!("begin at line {} or before", past_end.last));
        Box::new(NoStart { finding, nearest: Source { line: past_end.last, ..of_line } })
    })?;
    // The path decides: a move after a cancel can still be compensated.
    let begins_in_span = path.begins_in_span(entry.element);
    let (span, ended) = span_at(contour, profile, line);
    let span = span.or(ended.filter(|_| begins_in_span));
    let mut warning = None;
    if let Some(SelectedSpan { selected, nearest, .. }) = span
        && profile.restart.rule == RestartMode::Forbidden
    {
        let text = format!(
            "line {line} lies under cutter compensation, which is on since {}; {} does not start \
             there",
            block_name(selected),
            profile.name
        );
        let mut finding = Finding::error(Code::Restart, of_line, text).help(match nearest.line {
            0 => "start at the beginning".into(),
            line => format!("start at line {line} ({}) or before", block_name(nearest)),
        });
        finding.severity = profile.restart.severity();
        finding.other = Some(selected);
        if finding.is_error() {
            return Err(Box::new(NoStart { finding, nearest }));
        }
        warning = Some(finding);
    }
    let in_span = match span.map(|span| span.plane) {
        None => StartInSpan::Refused,
        Some(Plane::Xy) => StartInSpan::FromAbove,
        Some(Plane::Zx | Plane::Yz) => StartInSpan::Standing,
    };
    Ok(Start {
        entry,
        at: path.start_of(entry.element),
        in_span,
        warning,
        first: path.elements[entry.element],
        in_force: in_force(&path.events[..entry.event]),
    })
}

/// Compensation that is on at the start of a line.
#[derive(Debug, Clone, Copy)]
struct SelectedSpan {
    selected: Source,
    /// The last block before that which is not under compensation itself, or the selection.
    nearest: Source,
    plane: Plane,
}

/// Compensation that is on at the start of a line, and the last one before it.
fn span_at(
    contour: &ProgrammedContour,
    profile: &Profile,
    line: u32,
) -> (Option<SelectedSpan>, Option<SelectedSpan>) {
    let mut plane = Plane::default();
    // The last block so far that is outside compensation or ends a lead-off, and the block before
    // it.
    let (mut last, mut is_free) = (Source::default(), true);
    let mut before = None;
    let (mut span, mut ended): (Option<SelectedSpan>, Option<SelectedSpan>) = (None, None);
    let mut is_cancelled = false;
    for event in &contour.events {
        if event.source.line >= line {
            break;
        }
        if span.is_none() && last.line != event.source.line {
            before = is_free.then_some(last);
            (last, is_free) = (event.source, true);
        }
        match event.kind {
            ContourEventKind::Plane(other) => plane = other,
            ContourEventKind::Select { .. } => {
                let selected = event.source;
                let nearest = before.unwrap_or(selected);
                span.get_or_insert(SelectedSpan { selected, nearest, plane });
                is_cancelled = false;
            }
            ContourEventKind::Cancel { .. } => is_cancelled = span.is_some(),
            ContourEventKind::Action(Action::Home { .. })
                if profile.home.rule == HomeMode::Drop =>
            {
                (ended, last, is_cancelled) = (span.take(), event.source, false);
            }
            ContourEventKind::Motion(motion) if is_cancelled => {
                let [u, v, _] = plane.axes();
                if motion.axes.contains(u) || motion.axes.contains(v) {
                    (ended, last, is_cancelled) = (span.take(), event.source, false);
                    is_free = false;
                }
            }
            _ => {}
        }
    }
    (span, ended)
}

impl fmt::Display for Start {
    /// `begins with block N70 at X105.000 Y-25.000 Z-5.000, cutter left of the contour, F250,
    /// T1 S8000 M3`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "begins with {} at", block_name(self.first.source))?;
        for (letter, place) in AXIS_LETTERS.iter().zip(self.at) {
            write!(f, " {letter}{place:.3}")?;
        }
        if self.in_span != StartInSpan::Refused {
            let side = match self.first.side {
                Some(CutterSide::Left) => ", cutter left of the contour",
                Some(CutterSide::Right) => ", cutter right of the contour",
                None => "",
            };
            f.write_str(side)?;
        }
        match self.first.feed_mm_per_min {
            Some(feed) => write!(f, ", F{feed}")?,
            None => f.write_str(", at rapid")?,
        }
        let words = self.in_force.iter().map(|event| match event.action {
            Action::ChangeTool { tool } => format!("T{tool} M6"),
            other => other.text(),
        });
        let words: Vec<String> = words.collect();
        if !words.is_empty() {
            write!(f, ", {}", words.join(" "))?;
        }
        match self.in_span {
            StartInSpan::Standing => f.write_str("; the tool has to stand there"),
            StartInSpan::Refused | StartInSpan::FromAbove => Ok(()),
        }
    }
}
