//! The page of a plan or of a run: `kerf plan --html`, `kerf replay --html` and `kerf bag report`.
//!
//! Rust decides what is shown; `page/page.{html,css,js}` define how it looks and reacts. The page
//! is one file and loads nothing from elsewhere.

mod layer;
mod run;
mod start;

use crate::picture::strips::{Strip, strips};
use crate::picture::turns::marks;
use crate::picture::view::{Point, View};
use cnc_msgs::calls::{Call, Calls, chain_text};
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::finding::Finding;
use cnc_msgs::geometry::AXIS_LETTERS;
use cnc_msgs::path::CompensatedPath;
pub(crate) use layer::Layer;
use layer::Outline;
use replay::path_difference::first_difference;
pub(crate) use run::{RunLog, of_recording};
use serde::Serialize;
use serde_json::Serializer;
use serde_json::ser::Formatter;
pub(crate) use start::StartInTheMiddle;
use std::borrow::Cow;
use std::io::{self, Write};

const HTML: &str = include_str!("page/page.html");
const CSS: &str = include_str!("page/page.css");
const JS: &str = include_str!("page/page.js");

/// The content of one file.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Page<'a> {
    /// One sheet is shown at a time.
    pub(crate) sheets: Vec<Sheet<'a>>,
    pub(crate) runs: Vec<RunLog>,
}

/// A plan, and its run if there is one.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Sheet<'a> {
    pub(crate) title: String,
    /// `accepted`, `DIFFERENT`
    pub(crate) verdict: String,
    pub(crate) good: bool,
    /// How the run ended.
    pub(crate) end: String,
    pub(crate) summary: String,
    /// `X to the right, Y up, mm`
    pub(crate) axes: String,
    /// Whether the second axis points down on the paper.
    pub(crate) down: bool,
    /// Its lines are listed.
    #[serde(serialize_with = "lines")]
    pub(crate) program: Cow<'a, str>,
    /// From the bottom to the top.
    pub(crate) layers: Vec<Layer<'a>>,
    /// Calls and loop passes, by their row from 1: name, line, pass, and the row around it.
    pub(crate) calls: Vec<(Option<String>, u32, u32, u32)>,
    pub(crate) uncut: Vec<Outline>,
    pub(crate) pins: Vec<Pin>,
    /// Where further axes arrive, with their words and the line.
    pub(crate) turns: Vec<(Point, String, u32)>,
    /// What they do, block by block.
    pub(crate) strips: Vec<Strip>,
    /// Place and text.
    pub(crate) differences: Vec<[String; 2]>,
    /// Index of the run on the page.
    pub(crate) run: Option<usize>,
}

/// A marker at a place; only listed if it has no place.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Pin {
    pub(crate) kind: PinKind,
    pub(crate) label: String,
    pub(crate) text: String,
    pub(crate) line: u32,
    pub(crate) at: Option<Point>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum PinKind {
    Error,
    Warning,
    Alarm,
    Difference,
    /// Where a run begins.
    Start,
}

impl<'a> Sheet<'a> {
    /// An empty sheet with this view.
    pub(crate) fn new(title: String, view: View, program: Cow<'a, str>) -> Self {
        let [first, second, _] = view.plane.axes();
        let (right, up) = (AXIS_LETTERS[first], AXIS_LETTERS[second]);
        let way = if view.is_mirrored { "down" } else { "up" };
        Self {
            title,
            axes: format!("{right} to the right, {up} {way}, mm"),
            down: view.is_mirrored,
            program,
            ..Self::default()
        }
    }

    /// Adds findings as pins.
    pub(crate) fn find(&mut self, findings: &[Finding], view: View) {
        self.pins.extend(findings.iter().map(|finding| Pin {
            kind: if finding.is_error() { PinKind::Error } else { PinKind::Warning },
            label: format!("{} line {}", finding.code.name(), finding.source.line),
            text: pin_text(finding),
            line: finding.source.line,
            at: finding.position.map(|position| view.project(position)),
        }));
    }

    /// Shows what further axes do, and marks where they arrive.
    pub(crate) fn turn(&mut self, contour: &ProgrammedContour, view: View) {
        let marks = marks(contour, view).into_iter();
        self.turns = marks.map(|it| (it.at, it.words, it.line)).collect();
        self.strips = strips(contour);
    }

    /// Takes the calls and passes that elements were run in.
    pub(crate) fn call(&mut self, calls: &Calls) {
        let row = |call: &Call| {
            (call.name.as_deref().map(str::to_owned), call.line, call.pass, call.parent)
        };
        self.calls = calls.rows().iter().map(row).collect();
    }

    /// Adds the areas that stay uncut.
    pub(crate) fn fill(&mut self, uncut: &[compensation_planner::UncutRegion], view: View) {
        self.uncut.extend(uncut.iter().map(|region| Outline::new(region, view)));
    }

    /// Adds a pin at the first difference of two paths.
    pub(crate) fn pin_difference(
        &mut self,
        recorded: &CompensatedPath,
        now: &CompensatedPath,
        view: View,
    ) {
        let Some(divergence) = first_difference(recorded, now) else { return };
        self.pins.push(Pin {
            kind: PinKind::Difference,
            label: format!("first difference, line {}", divergence.line),
            text: format!("{}{}", divergence.text, divergence.place().text()),
            line: divergence.line,
            at: Some(view.project(divergence.position)),
        });
    }
}

/// What is wrong, how the program came there, and what to do.
fn pin_text(finding: &Finding) -> String {
    let place = |line: u32| format!("line {line}");
    let mut text = finding.message.clone();
    if !finding.calls.is_empty() {
        text += &format!("\n{}", chain_text(&finding.calls, place));
    }
    if let Some(other) = finding.other
        && !finding.other_calls.is_empty()
    {
        text += &format!("\nline {}: {}", other.line, chain_text(&finding.other_calls, place));
    }
    if !finding.help.is_empty() {
        text += &format!("\nhelp: {}", finding.help);
    }
    text
}

fn lines<S: serde::Serializer>(text: &str, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(text.lines())
}

impl Page<'_> {
    /// Writes the whole file.
    pub(crate) fn write_html(&self, to: &mut impl Write) -> io::Result<()> {
        let title = self.sheets.first().map_or("kerf", |sheet| sheet.title.as_str());
        let title = crate::picture::escape(title);
        // One pass over the template: inserted text is not searched again.
        let mut rest = HTML;
        while let Some((before, rest_after)) = rest.split_once("{{") {
            let (name, after) = rest_after.split_once("}}").expect("the page closes its places");
            to.write_all(before.as_bytes())?;
            match name {
                "css" => to.write_all(CSS.as_bytes())?,
                "title" => to.write_all(title.as_bytes())?,
                "js" => to.write_all(JS.as_bytes())?,
                "data" => self.serialize(&mut Serializer::with_formatter(&mut *to, Data))?,
                _ => panic!("the page has an unknown place {name}"),
            }
            rest = after;
        }
        to.write_all(rest.as_bytes())
    }
}

/// JSON inside an element of the page: no text of a program can close it.
struct Data;

impl Formatter for Data {
    fn write_string_fragment<W: Write + ?Sized>(
        &mut self,
        to: &mut W,
        part: &str,
    ) -> io::Result<()> {
        let mut parts = part.split('<');
        to.write_all(parts.next().unwrap_or_default().as_bytes())?;
        parts.try_for_each(|part| {
            to.write_all(b"\\u003c")?;
            to.write_all(part.as_bytes())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn html(title: &str, program: &str) -> String {
        let sheet = Sheet { title: title.into(), program: program.into(), ..Sheet::default() };
        let mut html = Vec::new();
        let page = Page { sheets: vec![sheet], runs: Vec::new() };
        page.write_html(&mut html).expect("memory takes everything");
        String::from_utf8(html).expect("UTF-8")
    }

    #[test]
    fn a_page_is_whole_and_loads_nothing() {
        let html = html("a < b & c", "G1 X1");
        for foreign in ["http:", "https:", "src=", "url(", "@import", "<link", "{{"] {
            assert!(!html.contains(foreign), "{foreign}");
        }
        assert!(html.contains("<title>a &lt; b &amp; c</title>"));
    }

    #[test]
    fn a_title_is_not_a_template() {
        let title = "{{data}} {{js}}.mcap";
        let html = html(title, "");
        assert!(html.contains(&format!("<title>{title}</title>")));
        assert_eq!(html.matches("\"sheets\":").count(), 1);
    }

    #[test]
    fn no_text_of_a_program_leaves_the_data_element() {
        let evil = "(</script><script>alert(1)</script>) {{js}} {{data}} $& <!--";
        let html = html("evil", evil);
        assert_eq!(html.matches("<script").count(), 2);
        let (_, data) = html.split_once("id=\"data\">").expect("the data");
        let (data, _) = data.split_once("</script>").expect("its end");
        let data: serde_json::Value = serde_json::from_str(data).expect("JSON");
        assert_eq!(data["sheets"][0]["program"][0], evil);
    }
}
