//! The page of a run that begins in the middle: what was cut, what comes, and where the tool comes down.

use super::{Layer, Page, Pin, PinKind, Sheet};
use crate::picture::view::View;
use cnc_msgs::contour::ProgrammedContour;
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
    /// Where it begins and what is in force there, in the planner's words.
    pub(crate) planned: &'a str,
}

impl<'a> StartInTheMiddle<'a> {
    /// Its page.
    pub(crate) fn page(&self) -> Page<'a> {
        let Self { name, text, contour, profile, path, line, occurrence, planned } = *self;
        let view = View::of(contour, profile);
        let first = path.entry(line, occurrence).map_or(path.elements.len(), |entry| entry.element);
        let (before, rest) = path.elements.split_at(first);
        let start = path.start_of(first);
        let mut sheet = Sheet::new(name.to_owned(), view, Cow::Borrowed(text));
        sheet.good = true;
        sheet.verdict = format!("begins with line {line}");
        sheet.summary = planned.to_owned();
        sheet.call(&contour.calls);
        sheet.turn(contour, view);
        sheet.layers = vec![
            Layer::programmed(contour, view),
            Layer::left_out(path.start, before, view),
            Layer::compensated("to be cut", start, rest, view),
        ];
        sheet.pins.push(Pin {
            kind: PinKind::Start,
            label: format!("start, line {line}"),
            text: planned.to_owned(),
            line,
            at: Some(view.project(start)),
        });
        Page { sheets: vec![sheet], runs: Vec::new() }
    }
}
