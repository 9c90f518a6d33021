//! Paths as rows of numbers on the paper.

use crate::picture::look::{self, Look};
use crate::picture::view::{Point, View};
use cnc_msgs::contour::{ContourEventKind, MotionClass, ProgrammedContour, Source};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::path::PathElement;
use compensation_planner::UncutRegion;
use serde::ser::SerializeSeq;
use serde::{Serialize, Serializer};

/// Rapids are thin: they cut nothing.
const RAPID_WIDTH: f64 = 0.8;

/// A path that can be switched on and off.
#[derive(Debug, Serialize)]
pub(crate) struct Layer<'a> {
    name: &'static str,
    color: &'static str,
    corner: &'static str,
    rapid: &'static str,
    /// Width of its lines, pixels.
    width: f64,
    /// The same of its rapids.
    rapid_width: f64,
    start: Point,
    elements: Rows<'a>,
}

/// The rows of a path.
#[derive(Debug)]
enum Rows<'a> {
    /// Made while they are written.
    Contour(&'a ProgrammedContour, View),
    /// Made while they are written.
    Path(&'a [PathElement], View),
    Made(Vec<Row>),
}

impl Rows<'_> {
    /// The same rows, made.
    fn made(self) -> Vec<Row> {
        match self {
            Self::Contour(contour, view) => contour_rows(contour, view).collect(),
            Self::Path(elements, view) => path_rows(elements, view).collect(),
            Self::Made(rows) => rows,
        }
    }
}

impl Serialize for Rows<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match *self {
            Self::Contour(contour, view) => serializer.collect_seq(contour_rows(contour, view)),
            Self::Path(elements, view) => serializer.collect_seq(path_rows(elements, view)),
            Self::Made(ref rows) => serializer.collect_seq(rows),
        }
    }
}

/// The outline of an area that stays uncut.
#[derive(Debug, Serialize)]
pub(crate) struct Outline {
    start: Point,
    elements: Vec<Row>,
}

/// Kind, end and centre on the paper, end in work coordinates, line, block, look, feed, call. `page.js`
/// has the names of the columns.
#[derive(Debug, Clone, Copy)]
struct Row {
    kind: u8,
    numbers: [f64; 7],
    source: Source,
    look: u8,
    feed: Option<f64>,
}

impl Serialize for Row {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { kind, numbers, source, look, feed } = *self;
        let Source { line, block, call, .. } = source;
        let mut row = serializer.serialize_seq(None)?;
        row.serialize_element(&kind)?;
        for number in numbers {
            row.serialize_element(&number)?;
        }
        row.serialize_element(&line)?;
        row.serialize_element(&block)?;
        row.serialize_element(&look)?;
        row.serialize_element(&feed)?;
        row.serialize_element(&call)?;
        row.end()
    }
}

impl<'a> Layer<'a> {
    /// The programmed contour.
    pub(crate) fn programmed(contour: &'a ProgrammedContour, view: View) -> Self {
        let (name, color, rapid) = ("programmed", look::PROGRAMMED, "#b3b8bf");
        Self {
            name,
            color,
            corner: color,
            rapid,
            width: 1.2,
            rapid_width: RAPID_WIDTH,
            start: view.project(contour.start),
            elements: Rows::Contour(contour, view),
        }
    }

    /// The path of the tool centre.
    pub(crate) fn compensated(
        name: &'static str,
        start: Position,
        elements: &'a [PathElement],
        view: View,
    ) -> Self {
        let elements = Rows::Path(elements, view);
        let (color, corner, rapid) = (look::PATH, look::CORNER, look::RAPID);
        let (width, rapid_width) = (2.2, RAPID_WIDTH);
        let start = view.project(start);
        Self { name, color, corner, rapid, width, rapid_width, start, elements }
    }

    /// The part of a path that a run leaves out.
    pub(crate) fn left_out(start: Position, elements: &'a [PathElement], view: View) -> Self {
        let grey = "#b3b8bf";
        let layer = Self::compensated("left out", start, elements, view);
        Self { color: grey, corner: grey, rapid: grey, width: 1.1, ..layer }
    }

    /// The way of the tool to where a run begins: the ends of its moves, with their feeds.
    pub(crate) fn approach(
        from: Position,
        moves: &[(Position, Option<f64>)],
        source: Source,
        view: View,
    ) -> Self {
        let green = look::APPROACH;
        let layer = Self::compensated("approach", from, &[], view);
        let row = |(end, feed): &(Position, Option<f64>)| {
            let look = if feed.is_some() { Look::Cut } else { Look::Rapid };
            row(view, &Shape::Line, *end, source, look, *feed)
        };
        let elements = Rows::Made(moves.iter().map(row).collect());
        let (width, rapid_width) = (1.6, 1.6);
        Self { color: green, corner: green, rapid: green, width, rapid_width, elements, ..layer }
    }

    /// Today's path, drawn above a recorded one.
    pub(crate) fn now(start: Position, elements: &'a [PathElement], view: View) -> Self {
        let layer = Self::compensated("compensated now", start, elements, view);
        Self { color: "#e8590c", corner: "#e8590c", rapid: "#e8590c", width: 1.1, ..layer }
    }

    /// The same without the contour or path that it was made of.
    pub(crate) fn into_owned(self) -> Layer<'static> {
        let Self { name, color, corner, rapid, width, rapid_width, start, elements } = self;
        let elements = Rows::Made(elements.made());
        Layer { name, color, corner, rapid, width, rapid_width, start, elements }
    }
}

impl Outline {
    pub(super) fn new(region: &UncutRegion, view: View) -> Self {
        let source = Source { block: None, ..region.first };
        let row = |piece: &compensation_planner::OutlinePiece| {
            row(view, &piece.shape, piece.end, source, Look::Cut, Some(0.0))
        };
        Self {
            start: view.project(region.start),
            elements: region.outline.iter().map(row).collect(),
        }
    }
}

fn contour_rows(contour: &ProgrammedContour, view: View) -> impl Iterator<Item = Row> {
    let motions = contour.events.iter().filter_map(|event| match event.kind {
        ContourEventKind::Motion(motion) => Some((motion, event.source)),
        _ => None,
    });
    motions.map(move |(motion, source)| {
        let is_feed = motion.class == MotionClass::Feed;
        let look = if is_feed { Look::Cut } else { Look::Rapid };
        // Feeds are shown for paths only.
        let feed = is_feed.then_some(0.0);
        row(view, &motion.shape, motion.end, source, look, feed)
    })
}

fn path_rows(elements: &[PathElement], view: View) -> impl Iterator<Item = Row> {
    elements.iter().map(move |element| {
        let (look, feed) = (Look::of(element), element.feed_mm_per_min);
        row(view, &element.shape, element.end, element.source, look, feed)
    })
}

fn row(
    view: View,
    shape: &Shape,
    end: Position,
    source: Source,
    look: Look,
    feed: Option<f64>,
) -> Row {
    // A millionth of a millimetre is far below a pixel, and shorter to write.
    let round = |value: f64| (value * 1e6).round() / 1e6;
    let [x, y] = view.project(end).map(round);
    let (kind, [cx, cy]) = match shape {
        Shape::Arc(arc) if arc.plane == view.plane => {
            let direction = if view.turns_clockwise(arc.clockwise) { 1 } else { 2 };
            let whole_turns = if arc.turns > 0 { 2 } else { 0 };
            (direction + whole_turns, view.project(arc.center).map(round))
        }
        _ => (0, [0.0; 2]),
    };
    let [end_x, end_y, end_z] = end.map(round);
    let numbers = [x, y, cx, cy, end_x, end_y, end_z];
    Row { kind, numbers, source, look: look as u8, feed }
}
