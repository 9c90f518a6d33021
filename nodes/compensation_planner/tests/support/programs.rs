//! Contours for tests, written in a few words of G-code.
//!
//! Not a dialect: just enough words to write the manuals' examples down, in
//! the order in which every block is executed: plane, radius, corner mode,
//! functions, selection, motion, stop.
#![allow(dead_code, unreachable_pub)]

use cnc_msgs::contour::{
    Action, Approach, ContourEvent, ContourEventKind, CoolantMode, CutterSide, Motion, MotionClass,
    OutsideCorner, ProgrammedContour, RadiusSource, Source, SpindleMode,
};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::{Arc, AxisSet, Plane, Position, Shape};
use cnc_msgs::path::PathElement;
use cnc_msgs::profile::{Dialect, Profile};
use cnc_msgs::text::Words;
use cnc_msgs::tool_table::{Offset, Tool, ToolTable};
use compensation_planner::Plan;
use path_audit::audit_after;

pub fn profile(name: &str) -> Profile {
    settings::load_profile(name).unwrap()
}

pub fn sinumerik() -> Profile {
    profile("sinumerik_840c")
}

pub fn masso() -> Profile {
    profile("masso")
}

pub fn rs274() -> Profile {
    profile("rs274")
}

/// T1 in the spindle's row and D1, both of this radius.
pub fn tool(radius_mm: f64) -> ToolTable {
    let mut tools = ToolTable::default();
    tools.tools.insert(1, Tool { diameter_mm: 2.0 * radius_mm, ..Tool::default() });
    if radius_mm < 0.0 {
        tools.tools.clear();
    }
    tools.offsets.insert(1, Offset { radius_mm, ..Offset::default() });
    tools
}

pub fn plan(text: &str, profile: &Profile, tools: &ToolTable) -> Plan {
    plan_of(&contour(text, profile), profile, tools)
}

/// The plan; what is accepted is audited.
#[track_caller]
pub fn plan_of(contour: &ProgrammedContour, profile: &Profile, tools: &ToolTable) -> Plan {
    let plan = compensation_planner::plan(contour, profile, tools);
    assert_sound(contour, &plan, profile, tools);
    plan
}

/// The audit refuses no plan that is accepted.
#[track_caller]
pub fn assert_sound(
    contour: &ProgrammedContour,
    plan: &Plan,
    profile: &Profile,
    tools: &ToolTable,
) {
    if !plan.accepted() {
        return;
    }
    let audit = audit_after(contour, &plan.path, profile, tools, &plan.findings);
    let said: Vec<String> = (audit.findings.iter())
        .filter(|finding| finding.is_error())
        .map(|finding| {
            let (line, other) = (finding.source.line, finding.other.map(|other| other.line));
            format!(
                "{:?} {} {line} {other:?}: {}\n",
                finding.severity,
                finding.code.name(),
                finding.message
            )
        })
        .collect();
    assert!(
        said.is_empty(),
        "false alarm:\n{}planner:\n{}path:\n{}",
        said.concat(),
        findings(plan),
        listing(&plan.path.elements)
    );
}

pub fn contour(text: &str, profile: &Profile) -> ProgrammedContour {
    let mut reader = Reader::new(profile.language.dialect);
    for (index, line) in text.trim().lines().enumerate() {
        reader.block(line.trim(), index as u32 + 1);
    }
    reader.contour
}

struct Reader {
    contour: ProgrammedContour,
    dialect: Dialect,
    at: Position,
    feed: f64,
    motion: f64,
    incremental: bool,
    plane: Plane,
}

impl Reader {
    fn new(dialect: Dialect) -> Self {
        Self {
            contour: ProgrammedContour::default(),
            dialect,
            at: [0.0; 3],
            feed: 100.0,
            motion: 1.0,
            incremental: false,
            plane: Plane::Xy,
        }
    }

    fn block(&mut self, text: &str, line: u32) {
        let words: Vec<(char, f64)> = text
            .split_whitespace()
            .map(|word| (word.chars().next().unwrap(), word[1..].parse().unwrap()))
            .collect();
        let get = |letter| words.iter().find(|word| word.0 == letter).map(|word| word.1);
        let source = Source {
            line,
            block: get('N').map(|n| n as u32),
            column: 1,
            length: text.len() as u16,
            call: 0,
        };
        let mut push = |kind| self.contour.events.push(ContourEvent { source, kind });
        let mut approach = None;
        let (mut select, mut cancel) = (None, false);
        for &(letter, value) in &words {
            if letter != 'G' {
                continue;
            }
            match (value * 10.0).round() as u32 {
                0 | 10 | 20 | 30 => self.motion = value,
                400 => cancel = true,
                410 | 411 => select = Some(CutterSide::Left),
                420 | 421 => select = Some(CutterSide::Right),
                900 => self.incremental = false,
                910 => self.incremental = true,
                170 => self.plane = Plane::Xy,
                180 => self.plane = Plane::Zx,
                190 => self.plane = Plane::Yz,
                540 | 550 => {
                    push(ContourEventKind::Action(Action::WorkOffset { system: value as u8 - 53 }))
                }
                4500 => push(ContourEventKind::Corner(OutsideCorner::Arc)),
                4510 => push(ContourEventKind::Corner(OutsideCorner::ExtendByRadius)),
                4520 => push(ContourEventKind::Corner(OutsideCorner::Intersection)),
                4550 => approach = Some(Approach::Corner),
                4560 => approach = Some(Approach::Normal),
                other => panic!("G{other}/10"),
            }
            if (170..=190).contains(&((value * 10.0) as u32)) {
                push(ContourEventKind::Plane(self.plane));
            }
        }
        self.feed = get('F').unwrap_or(self.feed);
        let is_diameter = words.contains(&('G', 41.1)) || words.contains(&('G', 42.1));
        let radius = match self.dialect {
            Dialect::Rs274 if is_diameter => get('D')
                .map(|mm| RadiusSource::Diameter { mm, tip: get('L').map_or(0, |tip| tip as u8) }),
            Dialect::Rs274 => get('D').map(|d| RadiusSource::Tool(d as u32)),
            Dialect::Sinumerik840c | Dialect::Nct => {
                get('D').map(|d| RadiusSource::Offset(d as u32))
            }
            Dialect::Masso => {
                select.map(|_| RadiusSource::SpindleToolPlus(get('P').unwrap_or(0.0)))
            }
            Dialect::Automation1 | Dialect::OspLathe => panic!("write these in their own words"),
        };
        if let Some(radius) = radius {
            push(ContourEventKind::Radius(radius));
        }
        let mut last = Vec::new();
        for &(letter, value) in &words {
            let action = match (letter, value as u32) {
                ('S', _) => Action::SpindleSpeed { rpm: value },
                ('T', _) => Action::SelectTool { tool: value as u32 },
                ('M', 6) => Action::ChangeTool { tool: get('T').unwrap() as u32 },
                ('M', 3) => Action::Spindle(SpindleMode::Clockwise),
                ('M', 5) => Action::Spindle(SpindleMode::Off),
                ('M', 8) => Action::Coolant(CoolantMode::Flood),
                ('H', _) => Action::Auxiliary { letter, number: value, words: Words::EMPTY },
                ('M', 0 | 2 | 30) => {
                    last.push(match value as u32 {
                        0 => Action::Stop { optional: false },
                        end => Action::ProgramEnd { rewind: end == 30 },
                    });
                    continue;
                }
                ('M', _) => Action::Auxiliary { letter, number: value, words: Words::EMPTY },
                _ => continue,
            };
            push(ContourEventKind::Action(action));
        }
        if let Some(side) = select {
            push(ContourEventKind::Select { side, approach, along: None });
        }
        if cancel {
            push(ContourEventKind::Cancel { exit: approach });
        }
        let mut axes = AxisSet::NONE;
        let mut end = self.at;
        for (axis, letter) in ['X', 'Y', 'Z'].into_iter().enumerate() {
            if let Some(value) = get(letter) {
                axes = axes.with(axis);
                end[axis] = if self.incremental { self.at[axis] + value } else { value };
            }
        }
        let mut center = self.at;
        let mut is_arc = false;
        for (axis, letter) in ['I', 'J', 'K'].into_iter().enumerate() {
            if let Some(value) = get(letter) {
                is_arc = true;
                center[axis] += value;
            }
        }
        if is_arc || !axes.is_empty() {
            let [u, v, _] = self.plane.axes();
            let is_full = end[u] == self.at[u] && end[v] == self.at[v];
            let arc = Arc {
                center,
                plane: self.plane,
                clockwise: self.motion == 2.0,
                turns: u16::from(is_full),
            };
            let rapid = self.motion == 0.0;
            let motion = Motion {
                shape: if self.motion >= 2.0 { Shape::Arc(arc) } else { Shape::Line },
                end,
                class: if rapid { MotionClass::Rapid } else { MotionClass::Feed },
                feed_mm_per_min: if rapid { 0.0 } else { self.feed },
                axes,
            };
            push(ContourEventKind::Motion(motion));
            self.at = end;
        }
        for action in last {
            push(ContourEventKind::Action(action));
        }
    }
}

/// `N30 corner G2 c(40,80) (40,85)`: one line an element, six decimals at most.
pub fn listing(elements: &[PathElement]) -> String {
    elements.iter().map(|element| line_of(element) + "\n").collect()
}

fn line_of(element: &PathElement) -> String {
    let [x, y, z] = element.end.map(short);
    let word = match (element.shape, element.feed_mm_per_min) {
        (Shape::Line, None) => "G0".to_string(),
        (Shape::Line, Some(_)) => "G1".to_string(),
        (Shape::Arc(arc), _) => {
            let [cx, cy, _] = arc.center.map(short);
            let turns = if arc.turns > 0 { format!(" +{}", arc.turns) } else { String::new() };
            format!("{} c({cx},{cy}){turns}", if arc.clockwise { "G2" } else { "G3" })
        }
    };
    let height = if z == "0" { String::new() } else { format!(",{z}") };
    let block =
        element.source.block.map_or(format!("L{}", element.source.line), |n| format!("N{n}"));
    format!("{block} {} {word} ({x},{y}{height})", element.role.name())
}

fn short(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

pub fn dedent(text: &str) -> String {
    text.trim().lines().map(|line| format!("{}\n", line.trim())).collect()
}

/// Ends of all elements in the plane.
pub fn ends(plan: &Plan) -> Vec<[f64; 2]> {
    assert!(plan.accepted(), "{}", findings(plan));
    plan.path.elements.iter().map(|element| [element.end[0], element.end[1]]).collect()
}

pub fn findings(plan: &Plan) -> String {
    plan.findings
        .iter()
        .map(|d| {
            format!("{:?} {} line {}: {}\n", d.severity, d.code.name(), d.source.line, d.message)
        })
        .collect()
}

pub fn codes(plan: &Plan) -> Vec<Code> {
    plan.findings.iter().map(|d| d.code).collect()
}

pub fn finding(plan: &Plan, code: Code) -> &Finding {
    plan.findings
        .iter()
        .find(|d| d.code == code)
        .unwrap_or_else(|| panic!("no {}: {}", code.name(), findings(plan)))
}

#[track_caller]
pub fn assert_ends(plan: &Plan, expected: &[[f64; 2]], tolerance: f64) {
    let got = ends(plan);
    let same = got.len() == expected.len()
        && got
            .iter()
            .zip(expected)
            .all(|(a, b)| (a[0] - b[0]).abs() <= tolerance && (a[1] - b[1]).abs() <= tolerance);
    assert!(same, "\n{}expected {expected:?}", listing(&plan.path.elements));
}

/// SINUMERIK 840C, 11.15 (A.6).
pub const A6: &str = "
    N1 G0 X15 Y60 Z0
    N10 G41 G450 G1 G17 G90 D1 X30 Y60 F400 S80 M3
    N20 X40 Y80
    N30 G2 X65 Y55 I0 J-25
    N40 G1 X95
    N50 G2 X110 Y70 I15 J0
    N60 G1 X105 Y55
    N70 X110 Y35
    N80 X90
    N90 X65 Y15
    N100 X40 Y40
    N110 X30 Y60
    N120 G40 X15 Y60
    N130 G0 Z50 M30";

/// MASSO, the example of the page.
pub const M12: &str = "
    N10 T1 M6
    N20 G0 X-50 Y-25
    N40 G41
    N50 G1 X-25
    N60 X100
    N70 Y-100
    N80 X25
    N90 Y25
    N100 G40
    N110 X25 Y50
    N120 M30";

/// 11.15, closed, entered in the middle of N40 from the other side: N50 and N70
/// come within 10 mm of each other.
pub const BOTTLENECK: &str = "
    N1 G0 X80 Y45
    N2 G42 D1 G456 G1 X80 Y55 F400
    N40 X95
    N50 G2 X110 Y70 I15 J0
    N60 G1 X105 Y55
    N70 X110 Y35
    N80 X90
    N90 X65 Y15
    N100 X40 Y40
    N110 X30 Y60
    N20 X40 Y80
    N30 G2 X65 Y55 I0 J-25
    N41 G1 X80
    N120 G40 G456 X80 Y45";

/// A motion at 500 mm/min that names all axes.
pub fn feed_to(shape: Shape, end: Position) -> ContourEventKind {
    let class = MotionClass::Feed;
    ContourEventKind::Motion(Motion {
        shape,
        end,
        class,
        feed_mm_per_min: 500.0,
        axes: AxisSet::ALL,
    })
}

/// Points about the origin, evenly spread, at these distances.
pub fn ring(radii: &[f64]) -> Vec<Position> {
    let step = std::f64::consts::TAU / radii.len() as f64;
    let point = |(index, radius): (usize, &f64)| {
        let (sin, cos) = (index as f64 * step).sin_cos();
        [radius * cos, radius * sin, 0.0]
    };
    radii.iter().enumerate().map(point).collect()
}

/// A closed contour of lines and arcs of these bulges, entered in the middle of its first line.
pub fn closed_contour(points: &[Position], bulges: &[f64], side: CutterSide) -> ProgrammedContour {
    let mut contour = ProgrammedContour::default();
    let mut push = |line: u32, kind| {
        let source = Source { line, block: None, column: 1, length: 1, call: 0 };
        contour.events.push(ContourEvent { source, kind });
    };
    let middle: Position = std::array::from_fn(|axis| (points[0][axis] + points[1][axis]) / 2.0);
    push(1, ContourEventKind::Radius(RadiusSource::Radius(0.0)));
    push(1, ContourEventKind::Select { side, approach: Some(Approach::Normal), along: None });
    push(1, feed_to(Shape::Line, middle));
    for index in 1..=points.len() {
        let (a, b) = (points[index - 1], points[index % points.len()]);
        let bulge = bulges[index - 1];
        let shape = if bulge == 0.0 {
            Shape::Line
        } else {
            // Centre of the arc of this bulge over the chord.
            let lever = (1.0 - bulge * bulge) / (4.0 * bulge);
            let center = [
                (a[0] + b[0]) / 2.0 - (b[1] - a[1]) * lever,
                (a[1] + b[1]) / 2.0 + (b[0] - a[0]) * lever,
                0.0,
            ];
            Shape::Arc(Arc { center, plane: Plane::Xy, clockwise: bulge < 0.0, turns: 0 })
        };
        push(index as u32 + 1, feed_to(shape, b));
    }
    push(90, feed_to(Shape::Line, middle));
    push(91, ContourEventKind::Cancel { exit: Some(Approach::Normal) });
    push(91, feed_to(Shape::Line, [middle[0] - 500.0, middle[1] - 500.0, 0.0]));
    contour
}

/// Of a contour that begins with its radius.
pub fn set_radius(contour: &mut ProgrammedContour, radius: f64) {
    contour.events[0].kind = ContourEventKind::Radius(RadiusSource::Radius(radius));
}
