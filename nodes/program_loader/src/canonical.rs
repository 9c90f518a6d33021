//! A programmed contour as text: one event a line, for goldens and comparisons.
//!
//! Millimetres with six decimals: contours that differ on a machine differ in text; rounding of
//! the last bits does not.

use cnc_msgs::contour::{
    Action, Approach, ContourEvent, ContourEventKind, CutterSide, Motion, MotionClass,
    OutsideCorner, ProgrammedContour, RadiusSource,
};
use cnc_msgs::further::{FURTHER_LETTERS, FurtherMode, FurtherMove};
use cnc_msgs::geometry::{AXIS_LETTERS, Direction, Position, Shape};
use std::fmt::Write;

/// The contour as text, with the line and block number before each event.
pub fn text(contour: &ProgrammedContour) -> String {
    let mut text = format!("start {}", position(contour.start));
    if !contour.assumed_axes.is_empty() {
        let _ = write!(text, " assumed {}", contour.assumed_axes.letters());
    }
    text.push('\n');
    for event in &contour.events {
        let source = event.source;
        let _ = write!(text, "{:>4}", source.line);
        if let Some(block) = source.block {
            let _ = write!(text, " N{block}");
        }
        let _ = writeln!(text, "  {}", event_text(event));
    }
    text
}

/// One event without its line and block number.
pub fn event_text(event: &ContourEvent) -> String {
    match event.kind {
        ContourEventKind::Motion(motion) => motion_text(&motion),
        ContourEventKind::Plane(plane) => format!("plane {}", plane.name()),
        ContourEventKind::Radius(source) => format!("radius {}", radius(source)),
        ContourEventKind::Select { side, approach, along } => {
            let side = match side {
                CutterSide::Left => "left",
                CutterSide::Right => "right",
            };
            format!("select {side}{}{}", approach.map_or("", approach_text), along_text(along))
        }
        ContourEventKind::Cancel { exit } => format!("cancel{}", exit.map_or("", approach_text)),
        ContourEventKind::Corner(corner) => format!(
            "corner {}",
            match corner {
                OutsideCorner::Arc => "arc",
                OutsideCorner::Intersection => "intersection",
                OutsideCorner::ExtendByRadius => "extend_by_radius",
            }
        ),
        ContourEventKind::RadiusValue { radius_mm } => {
            format!("radius value {}", number(radius_mm))
        }
        ContourEventKind::HoldDirection { along } => format!("hold direction{}", along_text(along)),
        ContourEventKind::CornerArc { along } => format!("corner arc{}", along_text(along)),
        ContourEventKind::Calculation => "calculation".to_owned(),
        ContourEventKind::Action(action) => action_text(&action),
    }
}

fn along_text(along: Option<Direction>) -> String {
    along.map_or_else(String::new, |[x, y, z]| {
        format!(" along {} {} {}", number(x), number(y), number(z))
    })
}

fn approach_text(approach: Approach) -> &'static str {
    match approach {
        Approach::Corner => " corner",
        Approach::Normal => " normal",
    }
}

fn action_text(action: &Action) -> String {
    match action {
        Action::ChangeTool { tool } => format!("{} T{tool}", action.text()),
        Action::ToolLength { offset: Some(1..), length_mm, .. } if *length_mm != 0.0 => {
            format!("{} and {}", action.text(), number(*length_mm))
        }
        Action::MachineMove { feed_mm_per_min, rapid: false, .. } => {
            format!("{} F{}", action.text(), number(*feed_mm_per_min))
        }
        Action::Further(FurtherMove { axes, mode }) => {
            let way = match mode {
                FurtherMode::Along => "along".to_owned(),
                FurtherMode::Rapid => "rapid".to_owned(),
                FurtherMode::Feed(feed) => format!("line F{}", number(*feed)),
            };
            let words =
                axes.iter().map(|(axis, at)| format!(" {}{}", FURTHER_LETTERS[axis], number(at)));
            format!("axes {way}{}", words.collect::<String>())
        }
        _ => action.text(),
    }
}

fn radius(source: RadiusSource) -> String {
    match source {
        RadiusSource::SpindleTool => "of the tool in the spindle".to_owned(),
        RadiusSource::Tool(tool) => format!("of tool {tool}"),
        RadiusSource::Offset(offset) => format!("of offset {offset}"),
        RadiusSource::Diameter { mm, tip: 0 } => format!("diameter {}", number(mm)),
        RadiusSource::Diameter { mm, tip } => format!("diameter {}, tip {tip}", number(mm)),
        RadiusSource::Radius(radius) => number(radius),
        RadiusSource::Nose(nose) => format!("nose {nose}"),
        RadiusSource::SpindleToolPlus(radius) => {
            format!("of the tool in the spindle and {}", number(radius))
        }
    }
}

fn motion_text(motion: &Motion) -> String {
    let mut text = match (motion.class, motion.shape) {
        (MotionClass::Rapid, Shape::Line) => "rapid".to_owned(),
        (MotionClass::NonCoordinated, Shape::Line) => "non_coordinated".to_owned(),
        (_, Shape::Line) => "line".to_owned(),
        (_, Shape::Arc(arc)) => {
            let way = if arc.clockwise { "cw" } else { "ccw" };
            format!("arc {way} {}", arc.plane.name())
        }
    };
    let _ = write!(text, " {}", position(motion.end));
    if let Shape::Arc(arc) = motion.shape {
        let _ = write!(text, " center");
        let axes = arc.plane.axes();
        for axis in (0..3).filter(|&axis| axis != axes[2]) {
            let _ = write!(text, " {}{}", AXIS_LETTERS[axis], number(arc.center[axis]));
        }
        if arc.turns > 0 {
            let _ = write!(text, " turns {}", arc.turns);
        }
    }
    if motion.class == MotionClass::Feed {
        let _ = write!(text, " F{}", number(motion.feed_mm_per_min));
    }
    let _ = write!(text, " named {}", motion.axes.letters());
    text
}

fn position(position: Position) -> String {
    let words: Vec<String> = AXIS_LETTERS
        .iter()
        .zip(position)
        .map(|(letter, value)| format!("{letter}{}", number(value)))
        .collect();
    words.join(" ")
}

/// Six decimals, without trailing zeros and without a negative zero.
fn number(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}
