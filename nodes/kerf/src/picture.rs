//! Draws a plan as an SVG picture.
//!
//! User units are millimetres. The programmed contour is grey, the path purple, leads are dashed,
//! rapids thin, findings are pinned with code and line. This file knows how things look; other
//! files decide what is shown.

pub(crate) mod look;
pub(crate) mod strips;
mod strokes;
pub(crate) mod turns;
pub(crate) mod view;

use cnc_msgs::contour::{Action, ContourEventKind, CutterSide, ProgrammedContour};
use cnc_msgs::finding::{Finding, Severity};
use cnc_msgs::geometry::{AXIS_LETTERS, Position};
use cnc_msgs::path::PathElement;
use cnc_msgs::profile::{OutputPoint, Profile};
use compensation_planner::UncutRegion;
use look::{CORNER, PATH, PROGRAMMED, RAPID, TURN};
use std::io::{self, Write};
use strokes::Bounds;
use view::{Point, View};

/// The content of a picture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Picture<'a> {
    pub(crate) title: &'a str,
    pub(crate) contour: &'a ProgrammedContour,
    /// Start of the first element.
    pub(crate) start: Position,
    /// The compensated path, or what a refused program would have cut.
    pub(crate) elements: &'a [PathElement],
    pub(crate) accepted: bool,
    pub(crate) findings: &'a [Finding],
    pub(crate) uncut: &'a [UncutRegion],
    pub(crate) profile: &'a Profile,
}

/// Draws the picture: a complete SVG document.
pub(crate) fn write(picture: &Picture<'_>, svg: &mut impl Write) -> io::Result<()> {
    let view = View::of(picture.contour, picture.profile);
    let legend = legend(picture);
    let programmed = || strokes::programmed(picture.contour);
    let compensated = || strokes::compensated(picture.start, picture.elements);
    let mut bounds = Bounds::new();
    bounds.add_motions(programmed(), view);
    bounds.add_motions(compensated(), view);
    let pins = picture.findings.iter().filter_map(|finding| finding.position);
    pins.for_each(|position| bounds.add(view.project(position)));
    let mut frame = Frame::around(bounds);
    let title = title(picture, view);
    frame.make_room(&title, &legend);
    let strips = strips::strips(picture.contour);
    frame.below = strips::height(&strips, frame.text);

    frame.open(svg, &title, &legend)?;
    frame.grid(svg, view)?;
    for region in picture.uncut {
        strokes::write_uncut(svg, region, view)?;
    }
    strokes::write(svg, programmed(), view)?;
    strokes::write(svg, compensated(), view)?;
    frame.turns(svg, picture.contour, view)?;
    let corner = [frame.min[0], frame.min[1] + frame.size[1]];
    strips::write(svg, &strips, corner, frame.size[0], frame.text)?;
    for (number, finding) in picture.findings.iter().enumerate() {
        if let Some(position) = finding.position {
            frame.pin(svg, view.project(position), number, finding)?;
        }
    }
    svg.write_all(b"</svg>\n")
}

/// The part of the plane that the picture shows.
struct Frame {
    min: Point,
    size: Point,
    /// Height of a line of text, millimetres.
    text: f64,
    /// Height of what stands below the drawing.
    below: f64,
}

/// The width of a picture in which X, Y and Z move nowhere, mm.
const AT_ONE_PLACE_MM: f64 = 20.0;

impl Frame {
    fn around(bounds: Bounds) -> Self {
        let Bounds { mut min, mut max } = bounds;
        if !min.iter().chain(&max).all(|value| value.is_finite()) {
            (min, max) = ([0.0; 2], [0.0; 2]);
        }
        if min == max {
            let half = AT_ONE_PLACE_MM / 2.0;
            (min, max) = (min.map(|value| value - half), max.map(|value| value + half));
        }
        let extent = (max[0] - min[0]).max(max[1] - min[1]).max(1e-3);
        let (margin, text) = (extent * 0.08, extent * 0.022);
        // Room for the title above and the legend below.
        let min = [min[0] - margin, min[1] - margin - 2.0 * text];
        let size =
            [(max[0] + margin - min[0]).max(extent * 0.9), max[1] + margin + 2.0 * text - min[1]];
        Self { min, size, text, below: 0.0 }
    }

    /// Widens the picture until its title fits above it, and its legend below.
    fn make_room(&mut self, title: &str, legend: &[Look]) {
        let below: f64 = legend.iter().map(Look::width).sum();
        let width = below.max(1.0 + 0.55 * title.chars().count() as f64);
        self.size[0] = self.size[0].max((width + 1.0) * self.text);
    }

    fn open(&self, svg: &mut impl Write, title: &str, legend: &[Look]) -> io::Result<()> {
        let (text, line) = (self.text, self.text * 0.12);
        let height = self.size[1] + self.below;
        let pixels = 1200.0 / self.size[0].max(height);
        writeln!(
            svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.0}\" height=\"{:.0}\" \
             viewBox=\"{:.6} {:.6} {:.6} {:.6}\">",
            self.size[0] * pixels,
            height * pixels,
            self.min[0],
            self.min[1],
            self.size[0],
            height
        )?;
        writeln!(
            svg,
            "<style>path{{fill:none;stroke-linejoin:round;stroke-linecap:round}}\
             .programmed{{stroke:{PROGRAMMED};stroke-width:{:.4}}}\
             .path{{stroke:{PATH};stroke-width:{:.4}}}.corner{{stroke:{CORNER}}}\
             .lead{{stroke-dasharray:{:.4} {:.4}}}\
             .rapid{{stroke:{RAPID};stroke-width:{:.4};stroke-dasharray:{:.4}}}\
             .grid{{stroke:#e6e8eb;stroke-width:{:.4}}}\
             .axis{{stroke:#c3c8ce;stroke-width:{:.4}}}\
             text{{font:{text:.4}px sans-serif;fill:#30343a}}.tick{{fill:#9aa0a8;font-size:{:.4}px}}\
             .uncut{{fill:#f2b8a0;stroke:#c65b2b;stroke-width:{:.4}}}\
             .strip{{stroke:{TURN};stroke-width:{:.4}}}\
             .turn path{{fill:{TURN}}}.turn text{{fill:{TURN};font-size:{:.4}px}}\
             .error{{fill:#c62828}}.warning{{fill:#d98200}}</style>",
            line * 1.2,
            line * 1.8,
            line * 5.0,
            line * 4.0,
            line * 0.6,
            line * 2.0,
            line * 0.4,
            line * 0.8,
            text * 0.7,
            line * 0.8,
            line * 1.2,
            text * 0.8,
        )?;
        writeln!(
            svg,
            "<rect x=\"{:.6}\" y=\"{:.6}\" width=\"{:.6}\" height=\"{:.6}\" fill=\"white\"/>",
            self.min[0], self.min[1], self.size[0], height
        )?;
        writeln!(
            svg,
            "<text x=\"{:.6}\" y=\"{:.6}\">{}</text>",
            self.min[0] + text,
            self.min[1] + 1.6 * text,
            escape(title),
        )?;
        self.legend(svg, legend)
    }

    fn legend(&self, svg: &mut impl Write, legend: &[Look]) -> io::Result<()> {
        let y = self.min[1] + self.size[1] - self.text;
        let mut x = self.min[0] + self.text;
        for look in legend {
            let Look { class, label } = look;
            writeln!(
                svg,
                "<path class=\"{class}\" d=\"M{x:.6} {:.6}h{:.6}\"/>\
                 <text x=\"{:.6}\" y=\"{y:.6}\">{label}</text>",
                y - 0.3 * self.text,
                2.5 * self.text,
                x + 3.0 * self.text,
            )?;
            x += look.width() * self.text;
        }
        Ok(())
    }

    /// Lines at round coordinates, about ten across, with their numbers: below the title and above
    /// the legend.
    fn grid(&self, svg: &mut impl Write, view: View) -> io::Result<()> {
        let step = round_step(self.size[0].max(self.size[1]) / 10.0);
        let min = [self.min[0], self.min[1] + 2.2 * self.text];
        let size = [self.size[0], self.size[1] - 4.6 * self.text];
        // A number at the right edge would be cut.
        let last_number = min[0] + size[0] - 2.0 * self.text;
        for axis in 0..2 {
            let first = (min[axis] / step).ceil() as i64;
            let last = ((min[axis] + size[axis]) / step).floor() as i64;
            for index in first..=last {
                let at = index as f64 * step;
                if axis == 0 && at > last_number {
                    break;
                }
                let class = if index == 0 { "axis" } else { "grid" };
                let value = if axis == 0 || view.is_mirrored { at } else { -at };
                // Without the last digits of a product.
                let value = (value * 1e9).round() / 1e9 + 0.0;
                let (line, x, y) = if axis == 0 {
                    (format!("M{at:.6} {:.6}v{:.6}", min[1], size[1]), at, min[1] + size[1])
                } else {
                    (format!("M{:.6} {at:.6}h{:.6}", min[0], size[0]), min[0], at - 0.2 * self.text)
                };
                writeln!(
                    svg,
                    "<path class=\"{class}\" d=\"{line}\"/>\
                     <text class=\"tick\" x=\"{x:.6}\" y=\"{y:.6}\">{value}</text>"
                )?;
            }
        }
        Ok(())
    }

    /// Marks where further axes arrive; a word that another one would cover is left out.
    fn turns(
        &self,
        svg: &mut impl Write,
        contour: &ProgrammedContour,
        view: View,
    ) -> io::Result<()> {
        let (text, size) = (self.text, 0.35 * self.text);
        let mut written: Vec<Point> = Vec::new();
        for mark in turns::marks(contour, view) {
            let [x, y] = mark.at;
            let words = escape(&mark.words);
            let is_free = |at: &Point| {
                (at[0] - x).abs() > 0.6 * text * words.len() as f64 || (at[1] - y).abs() > text
            };
            write!(
                svg,
                "<g class=\"turn\"><title>{words}, line {}</title>\
                 <path d=\"M{x:.6} {:.6}l{size:.6} {size:.6}l-{size:.6} {size:.6}l-{size:.6} -{size:.6}z\"/>",
                mark.line,
                y - size
            )?;
            if written.iter().all(is_free) {
                written.push([x, y]);
                write!(
                    svg,
                    "<text x=\"{:.6}\" y=\"{:.6}\">{words}</text>",
                    x + 1.5 * size,
                    y - 0.5 * text
                )?;
            }
            writeln!(svg, "</g>")?;
        }
        Ok(())
    }

    fn pin(
        &self,
        svg: &mut impl Write,
        at: Point,
        number: usize,
        finding: &Finding,
    ) -> io::Result<()> {
        let class = match finding.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        let text = self.text;
        writeln!(
            svg,
            "<g><title>{}</title><circle class=\"{class}\" cx=\"{:.6}\" cy=\"{:.6}\" r=\"{:.6}\"/>\
             <text class=\"{class}\" x=\"{:.6}\" y=\"{:.6}\">{} line {}</text></g>",
            escape(&finding.message),
            at[0],
            at[1],
            0.3 * text,
            at[0] + 0.6 * text,
            // Several findings often share a place: their labels must not overlap.
            at[1] - (0.4 + 1.1 * (number % 4) as f64) * text,
            finding.code.name(),
            finding.source.line,
        )
    }
}

/// That the program moves axes that are not in the drawing, and where it begins to.
pub(crate) fn further_note(contour: &ProgrammedContour) -> Option<String> {
    let mut moved = contour.events.iter().filter_map(|event| match event.kind {
        ContourEventKind::Action(Action::Further(it)) => Some((it.axes, event.source.line)),
        _ => None,
    });
    let (first, line) = moved.next()?;
    let letters = moved.fold(first, |all, (axes, _)| axes.or(all)).letters();
    let letters: Vec<String> = letters.chars().map(String::from).collect();
    Some(format!("also moves {} from line {line} on", letters.join(", ")))
}

/// What is drawn, and how it lies on the paper.
fn title(picture: &Picture<'_>, view: View) -> String {
    let [first, second, _] = view.plane.axes();
    let refused = if picture.accepted { "" } else { "REFUSED — " };
    let way = if view.is_mirrored { "down" } else { "up" };
    let note = further_note(picture.contour).map(|note| format!(" — {note}")).unwrap_or_default();
    let (right, up) = (AXIS_LETTERS[first], AXIS_LETTERS[second]);
    format!("{} — {refused}{right} to the right, {up} {way}, mm{note}", picture.title)
}

/// An entry of the legend.
struct Look {
    class: &'static str,
    label: String,
}

impl Look {
    /// Its width with the gap to the next entry, in heights of text.
    fn width(&self) -> f64 {
        4.5 + 0.55 * self.label.len() as f64
    }
}

fn legend(picture: &Picture<'_>) -> Vec<Look> {
    let look = |class, label: &str| Look { class, label: label.into() };
    let mut looks = vec![
        look("programmed", "programmed"),
        look("path", &path_label(picture)),
        look("path corner", "corner"),
        look("path lead", "lead"),
        look("path rapid", "rapid"),
    ];
    if !picture.uncut.is_empty() {
        looks.push(look("uncut", "uncut"));
    }
    looks
}

fn path_label(picture: &Picture<'_>) -> String {
    let point = match picture.profile.output {
        OutputPoint::Center => "tool centre",
        OutputPoint::Tip => "tool tip",
    };
    let runs_on = |side| picture.elements.iter().any(|element| element.side == Some(side));
    match (runs_on(CutterSide::Left), runs_on(CutterSide::Right)) {
        (true, true) => format!("{point}, on the left and on the right"),
        (true, false) => format!("{point}, on the left"),
        (false, true) => format!("{point}, on the right"),
        (false, false) => point.to_owned(),
    }
}

/// The smallest of 1, 2, 5 times a power of ten that is not below `least`.
fn round_step(least: f64) -> f64 {
    let power = 10f64.powi(least.log10().floor() as i32);
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|digit| digit * power)
        .find(|&step| step >= least)
        .unwrap_or(10.0 * power)
}

/// A text inside an element of XML. Characters that XML 1.0 cannot express are replaced.
pub(crate) fn escape(text: &str) -> String {
    let is_xml =
        |letter: char| matches!(letter, '\t' | '\n' | '\r' | ' '..='\u{fffd}' | '\u{10000}'..);
    let text: String =
        text.chars().map(|letter| if is_xml(letter) { letter } else { '\u{fffd}' }).collect();
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
