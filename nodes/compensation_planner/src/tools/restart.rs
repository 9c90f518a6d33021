//! Plans how a run begins at a line of a program, by the rules of its control.
//!
//! Knows where compensation is on and which point of the path comes next. The driver decides how
//! the tool gets there and what is sent to the controller.

use crate::check::finding::block_name;
use cnc_msgs::contour::{Action, ContourEventKind, CutterSide, ProgrammedContour, Source};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes, FurtherMode, FurtherMove};
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet, Plane, Position};
use cnc_msgs::path::{CompensatedPath, Entry, NoEntry, PathEvent, StartInSpan, in_force};
use cnc_msgs::profile::{HomeMode, Profile, RestartMode};
use std::fmt;

/// How a run begins at a line. Its text says where, and with which words in force.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    pub entry: Entry,
    /// Where the first element starts, work frame, mm...
    pub at: Position,
    /// ...in the axes whose place the program has said.
    pub known: AxisSet,
    /// Where A to W are then, as far as the program has said it.
    pub further: FurtherAxes,
    pub in_span: StartInSpan,
    /// Which time its line is run: `, in o<pocket>, called from line 40`; empty without calls.
    calls: String,
    /// Set if the control would not begin there and its profile makes that a warning.
    pub warning: Option<Finding>,
    /// The block that moves something first, and its feed; `None`: a rapid.
    first: (Source, Option<f64>),
    side: Option<CutterSide>,
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
            NoEntry::PastEnd { last, .. } | NoEntry::TurnsAlone { last, .. } => {
                (last, path.last_occurrence(last, None))
            }
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
    let first = first_move(path, entry);
    Ok(Start {
        entry,
        at: path.start_of(entry.element),
        further: path.further_after(entry.event).at,
        in_span,
        known: path.known_place(entry.element, entry.event).known(),
        calls: path.calls.after(first.0),
        warning,
        first,
        side: path.elements[entry.element].side,
        in_force: in_force(&path.events[..entry.event], entry.element),
    })
}

/// The block that moves an axis first, A to W included, and its feed; `None`: a rapid.
fn first_move(path: &CompensatedPath, entry: Entry) -> (Source, Option<f64>) {
    let element = &path.elements[entry.element];
    let before = path.events[entry.event..].iter().take_while(|it| it.at_element <= entry.element);
    let moved = before.into_iter().find_map(|event| match event.action {
        Action::Further(FurtherMove { mode: FurtherMode::Feed(rate), .. }) => {
            Some((event.source, Some(rate)))
        }
        Action::Further(FurtherMove { mode: FurtherMode::Rapid, .. })
        | Action::Reference { .. }
        | Action::Home { .. } => Some((event.source, None)),
        Action::MachineMove { rapid, feed_mm_per_min, .. } => {
            Some((event.source, (!rapid).then_some(feed_mm_per_min)))
        }
        _ => None,
    });
    moved.unwrap_or((element.source, element.feed_mm_per_min))
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
        let (source, feed) = self.first;
        write!(f, "begins with {}{}", block_name(source), self.calls)?;
        if !self.known.is_empty() || !self.further.is_empty() {
            f.write_str(if self.calls.is_empty() { " at" } else { ", at" })?;
        }
        for axis in (0..3).filter(|axis| self.known.contains(*axis)) {
            write!(f, " {}{:.3}", AXIS_LETTERS[axis], self.at[axis])?;
        }
        for (axis, place) in self.further.iter() {
            write!(f, " {}{place:.3}", FURTHER_LETTERS[axis])?;
        }
        if self.in_span != StartInSpan::Refused {
            let side = match self.side {
                Some(CutterSide::Left) => ", cutter left of the contour",
                Some(CutterSide::Right) => ", cutter right of the contour",
                None => "",
            };
            f.write_str(side)?;
        }
        match feed {
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

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::geometry::Shape;
    use cnc_msgs::path::{PathElement, Role};

    /// The text of a start with a line of: `G0 X10 Y10`, `G1 A360 F3600`, `G0 Z20`.
    #[test]
    fn a_start_names_the_first_line_that_moves_anything_and_the_places_that_are_known() {
        let source = |line| Source { line, ..Source::default() };
        let element = |line, end, axes| PathElement {
            shape: Shape::Line,
            end,
            feed_mm_per_min: None,
            role: Role::None,
            side: None,
            axes,
            source: source(line),
        };
        let turn =
            FurtherMove { axes: FurtherAxes::NONE.with(0, 360.0), mode: FurtherMode::Feed(3600.0) };
        let path = CompensatedPath {
            elements: vec![
                element(2, [10.0, 10.0, 0.0], AxisSet::from_bits(0b011)),
                element(4, [10.0, 10.0, 20.0], AxisSet::NONE.with(2)),
            ],
            events: vec![PathEvent {
                at_element: 1,
                action: Action::Further(turn),
                source: source(3),
            }],
            ..CompensatedPath::default()
        };
        let contour = ProgrammedContour::default();
        for (line, text) in [
            (2, "begins with line 2, at rapid"),
            (3, "begins with line 3 at X10.000 Y10.000, F3600"),
            (4, "begins with line 4 at X10.000 Y10.000 A360.000, at rapid"),
        ] {
            let start = start(&contour, &crate::tools::verdict::tests::sinumerik(), &path, line, 0)
                .expect("it begins");
            assert_eq!(start.to_string(), text);
        }
    }
}
