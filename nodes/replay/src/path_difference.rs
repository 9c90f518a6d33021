//! Whether today's path is the recorded one, and where they first differ.
//!
//! Paths are compared as curves, run by run: a run is everything that one block does with one kind
//! of element (line or arc, one feed, one side, one role), however many elements it has. Two paths
//! are the same when their runs have the same kinds in the same order, the curves of each pair are
//! within [`SAME_MM`], and the events along them are at the same places. `compare.rs` compares
//! fields, `path_difference/curve.rs` points and arcs.

mod curve;

use super::compare::DifferencePlace;
use super::tolerances::{SAME_FEED_MM_PER_MIN, SAME_MM};
use crate::path_distance::between;
use cnc_msgs::contour::{CutterSide, Source};
use cnc_msgs::geometry::{Plane, Position, Shape};
use cnc_msgs::path::{CompensatedPath, PathElement};
use curve::{Curve, distance};

/// How similar today's path is to the recorded one.
#[derive(Debug, Clone, PartialEq)]
pub enum Likeness {
    /// Equal, element for element.
    Same,
    /// The same curve, split into other elements.
    OtherElements { recorded: usize, now: usize },
    /// Other curves, other kinds, or other events along them.
    Diverges(Divergence),
}

/// The first place where two paths differ.
#[derive(Debug, Clone, PartialEq)]
pub struct Divergence {
    pub position: Position,
    pub line: u32,
    /// The distance between them there, mm; `None` if something other than the curve differs.
    pub distance_mm: Option<f64>,
    pub text: String,
}

impl Divergence {
    /// Where it is in the program and on the part.
    pub fn place(&self) -> DifferencePlace {
        DifferencePlace {
            line: self.line,
            position: Some(self.position),
            distance_mm: self.distance_mm,
        }
    }
}

/// The first place where two paths are not the same.
pub fn first_difference(recorded: &CompensatedPath, now: &CompensatedPath) -> Option<Divergence> {
    match likeness(recorded, now) {
        Likeness::Diverges(divergence) => Some(divergence),
        Likeness::Same | Likeness::OtherElements { .. } => None,
    }
}

/// The largest distance between two paths, for reports; measured with chords of 0.0001 mm error.
pub fn at_most(recorded: &CompensatedPath, now: &CompensatedPath) -> String {
    let worst = between(recorded, now);
    let [x, y, z] = worst.position;
    match worst.distance_mm {
        far if far.is_finite() => format!(
            "the whole paths are at most {far:.6} mm apart, at X{x:.6} Y{y:.6} Z{z:.6} in line {}",
            worst.source.line
        ),
        _ => format!("line {} is in one of them alone", worst.source.line),
    }
}

/// Compares two paths as curves with their events.
pub fn likeness(recorded: &CompensatedPath, now: &CompensatedPath) -> Likeness {
    match compare(recorded, now) {
        Err(divergence) => Likeness::Diverges(divergence),
        Ok(true) => Likeness::Same,
        Ok(false) => {
            Likeness::OtherElements { recorded: recorded.elements.len(), now: now.elements.len() }
        }
    }
}

/// Whether they are equal element for element, or where they differ.
fn compare(recorded: &CompensatedPath, now: &CompensatedPath) -> Result<bool, Divergence> {
    let first = recorded.elements.first().map_or(0, |element| element.source.line);
    if is_beyond(distance(recorded.start, now.start), SAME_MM) {
        return Err(Divergence {
            position: recorded.start,
            line: first,
            distance_mm: Some(distance(recorded.start, now.start)),
            text: format!(
                "the path began at {} and begins at {} now",
                place(recorded.start),
                place(now.start)
            ),
        });
    }
    let mut is_same = recorded.elements.len() == now.elements.len();
    let (runs, runs_now) = (runs(recorded), runs(now));
    for (&was, &is) in runs.iter().zip(&runs_now) {
        is_same &= compare_runs(recorded, was, now, is)?;
    }
    if runs.len() != runs_now.len() {
        let common = runs.len().min(runs_now.len());
        let (longer, run, what) = match runs.get(common) {
            Some(&run) => (recorded, run, "was removed"),
            None => (now, runs_now[common], "was added"),
        };
        let element = &longer.elements[run.1 - 1];
        return Err(Divergence {
            position: element.end,
            line: element.source.line,
            distance_mm: None,
            text: format!(
                "{} to {} {what}: there were {} elements and are {} now",
                name(element),
                place(element.end),
                recorded.elements.len(),
                now.elements.len()
            ),
        });
    }
    compare_events((recorded, &runs), (now, &runs_now))?;
    Ok(is_same)
}

/// Whether a value exceeds a limit; NaN always does.
fn is_beyond(value: f64, limit: f64) -> bool {
    value.is_nan() || value > limit
}

/// Index of the first element of a run, and of the one after its last.
type ElementRange = (usize, usize);

fn runs(path: &CompensatedPath) -> Vec<ElementRange> {
    let mut runs: Vec<ElementRange> = Vec::new();
    for (index, element) in path.elements.iter().enumerate() {
        match runs.last_mut() {
            Some(run) if is_alike(&path.elements[run.0], element) => run.1 = index + 1,
            _ => runs.push((index, index + 1)),
        }
    }
    runs
}

/// Whether two elements are of one kind; their curves are compared separately.
fn is_alike(a: &PathElement, b: &PathElement) -> bool {
    let shapes = match (&a.shape, &b.shape) {
        (Shape::Line, Shape::Line) => true,
        (Shape::Arc(a), Shape::Arc(b)) => (a.plane, a.clockwise) == (b.plane, b.clockwise),
        _ => false,
    };
    let feeds = match (a.feed_mm_per_min, b.feed_mm_per_min) {
        (None, None) => true,
        (Some(a), Some(b)) => (a - b).abs() <= SAME_FEED_MM_PER_MIN,
        _ => false,
    };
    let of = |it: &PathElement| (it.source, it.role, it.side, it.axes);
    shapes && feeds && of(a) == of(b)
}

fn compare_runs(
    recorded: &CompensatedPath,
    was: ElementRange,
    now: &CompensatedPath,
    is: ElementRange,
) -> Result<bool, Divergence> {
    let (element, element_now) = (&recorded.elements[was.0], &now.elements[is.0]);
    let (piece, piece_now) = (Curve::new(recorded, was), Curve::new(now, is));
    let diverges = |position, distance_mm, text| Divergence {
        position,
        line: element.source.line,
        distance_mm,
        text,
    };
    if !is_alike(element, element_now) {
        let (end, end_now) = (recorded.elements[was.1 - 1].end, now.elements[is.1 - 1].end);
        let text = format!(
            "element {}: {} to {} is {} to {} now",
            was.0,
            name(element),
            place(end),
            name(element_now),
            place(end_now)
        );
        return Err(diverges(end, None, text));
    }
    let (far, position) = piece.distance_to(&piece_now);
    if is_beyond(far, SAME_MM) {
        let ends = (recorded.elements[was.1 - 1].end, now.elements[is.1 - 1].end);
        let text = format!(
            "element {}: {} ended at {} and ends at {} now",
            was.0,
            name(element),
            place(ends.0),
            place(ends.1)
        );
        return Err(diverges(position, Some(far), text));
    }
    // An additional turn is the same curve, but longer.
    let by = (piece.length() - piece_now.length()).abs();
    let count = (was.1 - was.0 + is.1 - is.0) as f64;
    if is_beyond(by, SAME_MM * count) {
        let text = format!(
            "element {}: {} was {:.6} mm long and is {:.6} mm long now",
            was.0,
            name(element),
            piece.length(),
            piece_now.length()
        );
        return Err(diverges(recorded.elements[was.1 - 1].end, None, text));
    }
    let ends = recorded.elements[was.0..was.1].iter().zip(&now.elements[is.0..is.1]);
    let is_same = was.1 - was.0 == is.1 - is.0 && { ends }
        .all(|(was, is)| distance(was.end, is.end) <= SAME_MM);
    Ok(is_same)
}

/// Compares the events along the paths: the same, in the same order, at the same places.
fn compare_events(
    (recorded, runs): (&CompensatedPath, &[ElementRange]),
    (now, runs_now): (&CompensatedPath, &[ElementRange]),
) -> Result<(), Divergence> {
    let at = |path: &CompensatedPath, index: usize| match index {
        0 => path.start,
        _ => path.elements.get(index - 1).map_or(path.start, |element| element.end),
    };
    let run_of = |runs: &[ElementRange], index: usize| runs.partition_point(|run| run.1 <= index);
    let diverges =
        |position, line, text| Err(Divergence { position, line, distance_mm: None, text });
    for (was, is) in recorded.events.iter().zip(&now.events) {
        let (from, to) = (at(recorded, was.at_element), at(now, is.at_element));
        let (what, what_now) = (was.action.text(), is.action.text());
        if (&what, was.source) != (&what_now, is.source) {
            let text = format!("{what} is {what_now} of line {} now", is.source.line);
            return diverges(from, was.source.line, text);
        }
        let is_there = distance(from, to) <= SAME_MM;
        if !is_there || run_of(runs, was.at_element) != run_of(runs_now, is.at_element) {
            let text = format!("{what} was at {} and is at {} now", place(from), place(to));
            return diverges(from, was.source.line, text);
        }
    }
    let common = recorded.events.len().min(now.events.len());
    let (longer, path, what) = match recorded.events.get(common) {
        Some(event) => (Some(event), recorded, "was removed"),
        None => (now.events.get(common), now, "was added"),
    };
    longer.map_or(Ok(()), |event| {
        let text = format!("{} {what}", event.action.text());
        diverges(at(path, event.at_element), event.source.line, text)
    })
}

/// `a line at F100.000000 (contour, left, axes XY) of line 7 N60, column 1, 8 long`: everything
/// that [`is_alike`] compares, so that elements of different kinds never get the same name.
fn name(element: &PathElement) -> String {
    let kind = match &element.shape {
        Shape::Line => "line".to_owned(),
        Shape::Arc(arc) => {
            let plane = match arc.plane {
                Plane::Xy => "XY",
                Plane::Zx => "ZX",
                Plane::Yz => "YZ",
            };
            let sense = if arc.clockwise { "clockwise" } else { "counterclockwise" };
            format!("arc {sense} in {plane}")
        }
    };
    let kind = match (element.feed_mm_per_min, &element.shape) {
        (None, Shape::Line) => "a rapid".to_owned(),
        (None, Shape::Arc(_)) => format!("a rapid {kind}"),
        (Some(feed), Shape::Line) => format!("a {kind} at F{feed:.6}"),
        (Some(feed), Shape::Arc(_)) => format!("an {kind} at F{feed:.6}"),
    };
    let side = match element.side {
        None => "",
        Some(CutterSide::Left) => ", left",
        Some(CutterSide::Right) => ", right",
    };
    let axes = match element.axes.is_empty() {
        true => String::new(),
        false => format!(", axes {}", element.axes.letters()),
    };
    let Source { line, block, column, length, call } = element.source;
    let block = block.map_or(String::new(), |block| format!(" N{block}"));
    let role = element.role.name();
    let call = if call == 0 { String::new() } else { format!(", call {call}") };
    format!(
        "{kind} ({role}{side}{axes}) of line {line}{block}{call}, column {column}, {length} long"
    )
}

fn place([x, y, z]: Position) -> String {
    format!("X{x:.6} Y{y:.6} Z{z:.6}")
}

#[cfg(test)]
mod tests;
