//! The page of a plan or of a run: `kerf plan --html`, `kerf replay --html` and `kerf bag report`.
//!
//! Rust decides what is shown; `page/page.{html,css,js}` define how it looks and reacts. The page
//! is one file and loads nothing from elsewhere.

mod layer;
mod run;

use crate::picture::view::{Point, View};
use cnc_msgs::finding::Finding;
use cnc_msgs::geometry::AXIS_LETTERS;
use cnc_msgs::path::CompensatedPath;
pub(crate) use layer::Layer;
use layer::Outline;
use replay::path_difference::first_difference;
pub(crate) use run::{RunLog, of_recording};
use serde::Serialize;

const HTML: &str = include_str!("page/page.html");
const CSS: &str = include_str!("page/page.css");
const JS: &str = include_str!("page/page.js");

/// The content of one file.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Page {
    /// One sheet is shown at a time.
    pub(crate) sheets: Vec<Sheet>,
    pub(crate) runs: Vec<RunLog>,
}

/// A plan, and its run if there is one.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Sheet {
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
    /// The lines of the program.
    pub(crate) program: Vec<String>,
    /// From the bottom to the top.
    pub(crate) layers: Vec<Layer>,
    pub(crate) uncut: Vec<Outline>,
    pub(crate) pins: Vec<Pin>,
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
}

impl Sheet {
    /// An empty sheet with this view.
    pub(crate) fn new(title: String, view: View, text: &[u8]) -> Self {
        let [first, second, _] = view.plane.axes();
        let (right, up) = (AXIS_LETTERS[first], AXIS_LETTERS[second]);
        let way = if view.is_mirrored { "down" } else { "up" };
        Self {
            title,
            axes: format!("{right} to the right, {up} {way}, mm"),
            down: view.is_mirrored,
            program: String::from_utf8_lossy(text).lines().map(str::to_owned).collect(),
            ..Self::default()
        }
    }

    /// Adds findings as pins.
    pub(crate) fn find(&mut self, findings: &[Finding], view: View) {
        self.pins.extend(findings.iter().map(|finding| Pin {
            kind: if finding.is_error() { PinKind::Error } else { PinKind::Warning },
            label: format!("{} line {}", finding.code.name(), finding.source.line),
            text: match finding.help.as_str() {
                "" => finding.message.clone(),
                help => format!("{}\nhelp: {help}", finding.message),
            },
            line: finding.source.line,
            at: finding.position.map(|position| view.project(position)),
        }));
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

impl Page {
    /// The whole file.
    pub(crate) fn to_html(&self) -> String {
        let data = serde_json::to_string(self).expect("texts and numbers are always JSON");
        // No text of a program can close the element that holds the data.
        let data = data.replace('<', "\\u003c");
        let title = self.sheets.first().map_or("kerf", |sheet| sheet.title.as_str());
        let title = crate::picture::escape(title);
        // One pass over the template: inserted text is not searched again.
        let mut html = String::with_capacity(HTML.len() + CSS.len() + JS.len() + data.len());
        let mut rest = HTML;
        while let Some((before, rest_after)) = rest.split_once("{{") {
            let (name, after) = rest_after.split_once("}}").expect("the page closes its places");
            html += before;
            html += match name {
                "css" => CSS,
                "title" => &title,
                "js" => JS,
                "data" => &data,
                _ => panic!("the page has an unknown place {name}"),
            };
            rest = after;
        }
        html + rest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(program: &str) -> Page {
        let sheet = Sheet {
            title: "a < b & c".into(),
            program: program.lines().map(str::to_owned).collect(),
            ..Sheet::default()
        };
        Page { sheets: vec![sheet], runs: Vec::new() }
    }

    #[test]
    fn a_page_is_whole_and_loads_nothing() {
        let html = page("G1 X1").to_html();
        for foreign in ["http:", "https:", "src=", "url(", "@import", "<link", "{{"] {
            assert!(!html.contains(foreign), "{foreign}");
        }
        assert!(html.contains("<title>a &lt; b &amp; c</title>"));
    }

    #[test]
    fn a_title_is_not_a_template() {
        let title = "{{data}} {{js}}.mcap";
        let sheet = Sheet { title: title.into(), ..Sheet::default() };
        let html = Page { sheets: vec![sheet], runs: Vec::new() }.to_html();
        assert!(html.contains(&format!("<title>{title}</title>")));
        assert_eq!(html.matches("\"sheets\":").count(), 1);
    }

    #[test]
    fn no_text_of_a_program_leaves_the_data_element() {
        let evil = "(</script><script>alert(1)</script>) {{js}} {{data}} $& <!--";
        let html = page(evil).to_html();
        assert_eq!(html.matches("<script").count(), 2);
        let (_, data) = html.split_once("id=\"data\">").expect("the data");
        let (data, _) = data.split_once("</script>").expect("its end");
        let data: serde_json::Value = serde_json::from_str(data).expect("JSON");
        assert_eq!(data["sheets"][0]["program"][0], evil);
    }
}
