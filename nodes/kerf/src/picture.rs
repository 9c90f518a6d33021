//! Draws a plan as an SVG picture.
//!
//! User units are millimetres. The programmed contour is grey, the path purple, leads are dashed,
//! rapids thin, findings are pinned with code and line. This file knows how things look; other
//! files decide what is shown.

pub(crate) mod look;
pub(crate) mod view;

use cnc_msgs::contour::{ContourEventKind, CutterSide, MotionClass, ProgrammedContour};
use cnc_msgs::finding::{Finding, Severity};
use cnc_msgs::geometry::{AXIS_LETTERS, Position, Shape};
use cnc_msgs::path::PathElement;
use cnc_msgs::profile::{OutputPoint, Profile};
use compensation_planner::UncutRegion;
use look::{CORNER, Look as ElementLook, PATH, PROGRAMMED, RAPID};
use std::fmt::Write;
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

/// Draws the picture; returns a complete SVG document.
pub(crate) fn draw(picture: &Picture<'_>) -> String {
    let view = View::of(picture.contour, picture.profile);
    let programmed = programmed_strokes(picture.contour, view);
    let compensated = compensated_strokes(picture.start, picture.elements, view);
    let legend = legend(picture);
    let mut frame = Frame::around(programmed.iter().chain(&compensated), picture.findings, view);
    frame.make_room(&legend);

    let mut svg = String::new();
    frame.open(&mut svg, picture, view, &legend);
    frame.grid(&mut svg, view);
    for stroke in uncut_strokes(picture.uncut, view) {
        stroke.write(&mut svg);
    }
    for stroke in programmed.iter().chain(&compensated) {
        stroke.write(&mut svg);
    }
    for (number, finding) in picture.findings.iter().enumerate() {
        if let Some(position) = finding.position {
            frame.pin(&mut svg, view.project(position), number, finding);
        }
    }
    svg.push_str("</svg>\n");
    svg
}

/// Drawing commands of one look.
struct Stroke {
    class: &'static str,
    commands: String,
    points: Vec<Point>,
}

impl Stroke {
    fn new(class: &'static str, start: Point) -> Self {
        let mut commands = String::new();
        let _ = write!(commands, "M{:.6} {:.6}", start[0], start[1]);
        Self { class, commands, points: vec![start] }
    }

    fn add(&mut self, start: Position, shape: &Shape, end: Position, view: View) {
        let (from, to) = (view.project(start), view.project(end));
        match shape {
            Shape::Arc(arc) if arc.plane == view.plane => {
                let center = view.project(arc.center);
                let radius = (from[0] - center[0]).hypot(from[1] - center[1]);
                let clockwise = view.turns_clockwise(arc.clockwise);
                for &corner in &[[-1.0, -1.0], [1.0, 1.0]] {
                    self.points
                        .push([center[0] + corner[0] * radius, center[1] + corner[1] * radius]);
                }
                let mut half_circle = |point: Point| {
                    let _ = write!(
                        self.commands,
                        "A{radius:.6} {radius:.6} 0 0 {} {:.6} {:.6}",
                        u8::from(clockwise),
                        point[0],
                        point[1]
                    );
                };
                if arc.turns > 0 {
                    half_circle([2.0 * center[0] - from[0], 2.0 * center[1] - from[1]]);
                    half_circle(from);
                }
                let _ = write!(
                    self.commands,
                    "A{radius:.6} {radius:.6} 0 {} {} {:.6} {:.6}",
                    u8::from(is_major(from, to, center, clockwise)),
                    u8::from(clockwise),
                    to[0],
                    to[1]
                );
            }
            _ => {
                let _ = write!(self.commands, "L{:.6} {:.6}", to[0], to[1]);
            }
        }
        self.points.push(to);
    }

    fn write(&self, svg: &mut String) {
        let _ = writeln!(svg, "<path class=\"{}\" d=\"{}\"/>", self.class, self.commands);
    }
}

/// Whether the arc is longer than half a circle, on paper with y downwards.
fn is_major(from: Point, to: Point, center: Point, clockwise: bool) -> bool {
    let (a, b) =
        ([from[0] - center[0], from[1] - center[1]], [to[0] - center[0], to[1] - center[1]]);
    let cross = a[0] * b[1] - a[1] * b[0];
    // With y downwards a clockwise turn has a positive cross product.
    if clockwise { cross < 0.0 } else { cross > 0.0 }
}

/// The areas that stay uncut, filled.
fn uncut_strokes(uncut: &[UncutRegion], view: View) -> impl Iterator<Item = Stroke> {
    uncut.iter().map(move |region| {
        let mut stroke = Stroke::new("uncut", view.project(region.start));
        let mut start = region.start;
        for piece in &region.outline {
            stroke.add(start, &piece.shape, piece.end, view);
            start = piece.end;
        }
        stroke
    })
}

fn programmed_strokes(contour: &ProgrammedContour, view: View) -> Vec<Stroke> {
    let mut strokes = Strokes::default();
    let mut position = contour.start;
    for event in &contour.events {
        if let ContourEventKind::Motion(motion) = event.kind {
            let class =
                if motion.class == MotionClass::Feed { "programmed" } else { "programmed rapid" };
            strokes.add(class, position, &motion.shape, motion.end, view);
            position = motion.end;
        }
    }
    strokes.done
}

fn compensated_strokes(start: Position, elements: &[PathElement], view: View) -> Vec<Stroke> {
    let mut strokes = Strokes::default();
    let mut position = start;
    for element in elements {
        let class = match ElementLook::of(element) {
            ElementLook::Lead => "path lead",
            ElementLook::Rapid => "path rapid",
            ElementLook::Corner => "path corner",
            ElementLook::Cut => "path",
        };
        strokes.add(class, position, &element.shape, element.end, view);
        position = element.end;
    }
    strokes.done
}

/// Builds strokes; starts a new one when the look changes.
#[derive(Default)]
struct Strokes {
    done: Vec<Stroke>,
}

impl Strokes {
    fn add(
        &mut self,
        class: &'static str,
        start: Position,
        shape: &Shape,
        end: Position,
        view: View,
    ) {
        match self.done.last_mut() {
            Some(stroke) if stroke.class == class => stroke.add(start, shape, end, view),
            _ => {
                let mut stroke = Stroke::new(class, view.project(start));
                stroke.add(start, shape, end, view);
                self.done.push(stroke);
            }
        }
    }
}

/// The part of the plane that the picture shows.
struct Frame {
    min: Point,
    size: Point,
    /// Height of a line of text, millimetres.
    text: f64,
}

impl Frame {
    fn around<'a>(
        strokes: impl Iterator<Item = &'a Stroke>,
        findings: &[Finding],
        view: View,
    ) -> Self {
        let (mut min, mut max) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let pins = findings.iter().filter_map(|finding| finding.position).map(|p| view.project(p));
        for point in strokes.flat_map(|stroke| stroke.points.iter().copied()).chain(pins) {
            for axis in 0..2 {
                min[axis] = min[axis].min(point[axis]);
                max[axis] = max[axis].max(point[axis]);
            }
        }
        if !min.iter().chain(&max).all(|value| value.is_finite()) {
            (min, max) = ([0.0; 2], [1.0; 2]);
        }
        let extent = (max[0] - min[0]).max(max[1] - min[1]).max(1e-3);
        let (margin, text) = (extent * 0.08, extent * 0.022);
        // Room for the title above and the legend below.
        let min = [min[0] - margin, min[1] - margin - 2.0 * text];
        let size =
            [(max[0] + margin - min[0]).max(extent * 0.9), max[1] + margin + 2.0 * text - min[1]];
        Self { min, size, text }
    }

    /// Widens the picture until its legend fits below it.
    fn make_room(&mut self, legend: &[Look]) {
        let width: f64 = legend.iter().map(Look::width).sum();
        self.size[0] = self.size[0].max((width + 1.0) * self.text);
    }

    fn open(&self, svg: &mut String, picture: &Picture<'_>, view: View, legend: &[Look]) {
        let (text, line) = (self.text, self.text * 0.12);
        let pixels = 1200.0 / self.size[0].max(self.size[1]);
        let _ = writeln!(
            svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.0}\" height=\"{:.0}\" \
             viewBox=\"{:.6} {:.6} {:.6} {:.6}\">",
            self.size[0] * pixels,
            self.size[1] * pixels,
            self.min[0],
            self.min[1],
            self.size[0],
            self.size[1]
        );
        let _ = writeln!(
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
        );
        let [first, second, _] = view.plane.axes();
        let _ = writeln!(
            svg,
            "<rect x=\"{:.6}\" y=\"{:.6}\" width=\"{:.6}\" height=\"{:.6}\" fill=\"white\"/>",
            self.min[0], self.min[1], self.size[0], self.size[1]
        );
        let _ = writeln!(
            svg,
            "<text x=\"{:.6}\" y=\"{:.6}\">{} — {}{} to the right, {} {}, mm</text>",
            self.min[0] + text,
            self.min[1] + 1.6 * text,
            escape(picture.title),
            if picture.accepted { "" } else { "REFUSED — " },
            AXIS_LETTERS[first],
            AXIS_LETTERS[second],
            if view.is_mirrored { "down" } else { "up" },
        );
        self.legend(svg, legend);
    }

    fn legend(&self, svg: &mut String, legend: &[Look]) {
        let y = self.min[1] + self.size[1] - self.text;
        let mut x = self.min[0] + self.text;
        for look in legend {
            let Look { class, label } = look;
            let _ = writeln!(
                svg,
                "<path class=\"{class}\" d=\"M{x:.6} {:.6}h{:.6}\"/>\
                 <text x=\"{:.6}\" y=\"{y:.6}\">{label}</text>",
                y - 0.3 * self.text,
                2.5 * self.text,
                x + 3.0 * self.text,
            );
            x += look.width() * self.text;
        }
    }

    /// Lines at round coordinates, about ten across, with their numbers: below the title and above
    /// the legend.
    fn grid(&self, svg: &mut String, view: View) {
        let step = round_step(self.size[0].max(self.size[1]) / 10.0);
        let min = [self.min[0], self.min[1] + 2.2 * self.text];
        let size = [self.size[0], self.size[1] - 4.6 * self.text];
        for axis in 0..2 {
            let first = (min[axis] / step).ceil() as i64;
            let last = ((min[axis] + size[axis]) / step).floor() as i64;
            for index in first..=last {
                let at = index as f64 * step;
                let class = if index == 0 { "axis" } else { "grid" };
                let value = if axis == 0 || view.is_mirrored { at } else { -at } + 0.0;
                let (line, x, y) = if axis == 0 {
                    (format!("M{at:.6} {:.6}v{:.6}", min[1], size[1]), at, min[1] + size[1])
                } else {
                    (format!("M{:.6} {at:.6}h{:.6}", min[0], size[0]), min[0], at - 0.2 * self.text)
                };
                let _ = writeln!(
                    svg,
                    "<path class=\"{class}\" d=\"{line}\"/>\
                     <text class=\"tick\" x=\"{x:.6}\" y=\"{y:.6}\">{value}</text>"
                );
            }
        }
    }

    fn pin(&self, svg: &mut String, at: Point, number: usize, finding: &Finding) {
        let class = match finding.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        let text = self.text;
        let _ = writeln!(
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
        );
    }
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
