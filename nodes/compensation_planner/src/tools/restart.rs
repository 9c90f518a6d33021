//! Plans how a run begins at a line of a program, by the rules of its control.
//!
//! Knows where compensation is on and which point of the path comes next. The driver decides how
//! the tool gets there and what is sent to the controller.

use crate::check::finding::block_name;
use cnc_msgs::contour::{Action, ContourEventKind, CutterSide, ProgrammedContour, Source};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes};
use cnc_msgs::geometry::{AXIS_LETTERS, Plane, Position};
use cnc_msgs::path::{
    CompensatedPath, Entry, NoEntry, PathElement, PathEvent, StartInSpan, in_force,
};
use cnc_msgs::profile::{HomeMode, Profile, RestartMode};
use std::fmt;

/// How a run begins at a line. Its text says where, and with which words in force.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    pub entry: Entry,
    /// Where the first element starts, work frame, mm.
    pub at: Position,
    /// Where A to W are then, as far as the program has said it.
    pub further: FurtherAxes,
    pub in_span: StartInSpan,
    /// Which time its line is run: `, in o<pocket>, called from line 40`; empty without calls.
    calls: String,
    /// Set if the control would not begin there and its profile makes that a warning.
    pub warning: Option<Finding>,
    first: PathElement,
    in_force: Vec<PathEvent>,
}

/// Why no run begins at a line.
#[derive(Debug, Clone, PartialEq)]
pub struct NoStart {
    pub finding: Finding,
    /// The block before the selection: the nearest line to begin at. Line 0: there is none, or it is the
    /// beginning.
    pub nearest: Source,
    /// Which time that line is run; 0: the only one.
    pub nearest_occurrence: u32,
}

/// Plans how a run of an accepted path begins at `line` (M28, C19), the time `occurrence` that it is
/// run, from 1; 0: the only one.
///
/// Under compensation, which lasts from the selection to the end of the lead-off, a
/// control that rebuilds it begins at the compensated point: the path is proved as a
/// whole, and whoever begins there cuts the same as whoever comes along it.
///
/// # Errors
/// The control does not begin under compensation, nothing is left from that line on, the line is run
/// several times and none was asked for, or a probe comes before it whose result is needed.
pub fn start(
    contour: &ProgrammedContour,
    profile: &Profile,
    path: &CompensatedPath,
    line: u32,
    occurrence: u32,
) -> Result<Start, Box<NoStart>> {
    let of_line = Source { line, ..Source::default() };
    let entry = path.entry(line, occurrence).map_err(|refused| {
        let finding =
            Finding::error(Code::Restart, of_line, refused.to_string()).help(refused.help());
        let (line, nearest_occurrence) = match refused {
            NoEntry::PastEnd { last, .. } => (last, path.last_occurrence(last, None)),
            // Only the user knows which one is meant.
            NoEntry::SeveralTimes { .. }
            | NoEntry::TooFew { .. }
            | NoEntry::NoLine { .. }
            | NoEntry::SkippedProbe { .. } => (0, 0),
        };
        let nearest = Source { line, ..of_line };
        Box::new(NoStart { finding, nearest, nearest_occurrence })
    })?;
    // The path decides: a move after a cancel can still be compensated.
    let begins_in_span = path.begins_in_span(entry.element);
    let is_reached = |source: Source| match entry.run {
        None => source.line >= line,
        Some(run) => run.has(source, &contour.calls),
    };
    let (span, ended) = span_at(contour, profile, is_reached);
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
        contour.calls.explain(std::slice::from_mut(&mut finding));
        if finding.is_error() {
            // What the path has nothing of is run before what is asked for, as late as can be.
            let nearest_occurrence = match path.occurrence(nearest) {
                0 => path.last_occurrence(nearest.line, Some(&entry)),
                occurrence => occurrence,
            };
            return Err(Box::new(NoStart { finding, nearest, nearest_occurrence }));
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
        further: path.further_after(entry.event).at,
        in_span,
        calls: path.calls.after(path.elements[entry.element].source),
        warning,
        first: path.elements[entry.element],
        in_force: in_force(&path.events[..entry.event], entry.element),
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
    is_reached: impl Fn(Source) -> bool,
) -> (Option<SelectedSpan>, Option<SelectedSpan>) {
    let mut plane = Plane::default();
    // The last block so far that is outside compensation or ends a lead-off, and the block before
    // it.
    let (mut last, mut is_free) = (Source::default(), true);
    let mut before = None;
    let (mut span, mut ended): (Option<SelectedSpan>, Option<SelectedSpan>) = (None, None);
    let mut is_cancelled = false;
    for event in &contour.events {
        if is_reached(event.source) {
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
        let comma = if self.calls.is_empty() { "" } else { "," };
        write!(f, "begins with {}{}{comma} at", block_name(self.first.source), self.calls)?;
        for (letter, place) in AXIS_LETTERS.iter().zip(self.at) {
            write!(f, " {letter}{place:.3}")?;
        }
        for (axis, place) in self.further.iter() {
            write!(f, " {}{place:.3}", FURTHER_LETTERS[axis])?;
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
