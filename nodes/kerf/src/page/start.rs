//! The page of a run that begins in the middle: what was cut, what comes, and how the tool gets there.

use super::{Layer, Page, Pin, PinKind, Sheet};
use crate::picture::view::View;
use axis_driver::approach::ApproachText;
use cnc_msgs::contour::{ProgrammedContour, Source};
use cnc_msgs::geometry::Position;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::profile::Profile;
use std::borrow::Cow;

/// Such a run.
#[derive(Debug)]
pub(crate) struct StartInTheMiddle<'a> {
    pub(crate) name: &'a str,
    pub(crate) text: &'a str,
    pub(crate) contour: &'a ProgrammedContour,
    pub(crate) profile: &'a Profile,
    pub(crate) path: &'a CompensatedPath,
    pub(crate) line: u32,
    /// Which time that line is run; 0: the only one.
    pub(crate) occurrence: u32,
    /// What will be done, in the words of planner and driver.
    pub(crate) rows: &'a [String],
}

impl<'a> StartInTheMiddle<'a> {
    /// Its page.
    pub(crate) fn page(&self) -> Page<'a> {
        let Self { name, text, contour, profile, path, line, occurrence, rows } = *self;
        let view = View::of(contour, profile);
        let first = path.entry(line, occurrence).map_or(path.elements.len(), |entry| entry.element);
        let (before, rest) = path.elements.split_at(first);
        let start = path.start_of(first);
        let source = path.elements.get(first).map_or(Source::default(), |first| first.source);
        let approach = rows.iter().find_map(|row| row.parse::<ApproachText>().ok());
        let mut sheet = Sheet::new(name.to_owned(), view, Cow::Borrowed(text));
        sheet.good = true;
        sheet.verdict = format!("begins with line {line}");
        // The time to the end; the rest is long, and stands at the start.
        sheet.summary = rows.get(1).cloned().unwrap_or_default();
        sheet.call(&contour.calls);
        sheet.turn(contour, view);
        sheet.layers = vec![
            Layer::programmed(contour, view),
            Layer::left_out(path.start, before, view),
            Layer::compensated("to be cut", start, rest, view),
        ];
        let pin = |label: &str, text: String, line: u32, at: Position| Pin {
            kind: PinKind::Start,
            label: label.to_owned(),
            text,
            line,
            at: Some(view.project(at)),
        };
        sheet.pins.push(pin(&format!("start, line {line}"), rows.join("\n"), line, start));
        if let Some((it, (from, height))) = approach.and_then(|it| Some((it, it.from?))) {
            let [x, y, z] = from;
            let text = format!("X{x:.3} Y{y:.3} Z{z:.3}");
            sheet.pins.push(pin("the tool is here", text, 0, from));
            let [x, y, z] = std::array::from_fn(|axis| it.to[axis].unwrap_or(from[axis]));
            let down = it.to[2].map(|_| ([x, y, z], it.feed_mm_per_min));
            let over = [([from[0], from[1], height], None), ([x, y, height], None)];
            let moves: Vec<_> = over.into_iter().chain(down).collect();
            sheet.layers.push(Layer::approach(from, &moves, source, view));
        }
        Page { sheets: vec![sheet], runs: Vec::new() }
    }
}
