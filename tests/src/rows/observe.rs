//! Runs a case through loader and planner, and writes down what came of it.
//!
//! | key | what |
//! |---|---|
//! | `accepted` | whether no finding is an error |
//! | `path` | all elements with a role, of what was refused too |
//! | `moves` | all elements |
//! | `events` | functions, and where the tool is when they run |
//! | `findings` | of loader and planner; none are allowed when it is not expected |
//! | `spans` | side and radius of each compensated piece |
//! | `certificates` | the radii that each piece is good for, and the blocks that limit them |
//! | `uncut` | what is left next to blocks that are left out |
//! | `table_fault` | what is wrong with the tool table |
//! | `restart` | what is said against starting at `start_line` |
//! | `start` | the first element of such a start, what is said of it, and what the driver sends up to it |
//! | `length_mm` | by role |
//! | `offset_mm` | smallest and largest distance of contour elements from their blocks, and of corner arcs from their vertex |
//! | `same_mm` | largest distance between ends of elements and those of the other program |

use super::{Case, Other, start};
use cnc_msgs::contour::Action;
use cnc_msgs::contour::{ContourEvent, ContourEventKind, CutterSide, ProgrammedContour, Source};
use cnc_msgs::finding::{Finding, Severity};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::path::{CompensatedPath, PathElement, Role};
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::{Plan, Planning, judge};
use program_loader::LoadOptions;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// A shipped profile with some keys changed.
///
/// # Panics
/// There is no such profile, or the keys do not belong to one.
pub fn profile(name: &str, changes: &Value) -> Profile {
    let shipped = settings::load_profile(name).expect("a shipped profile");
    let mut value = serde_json::to_value(shipped).expect("a profile is an object");
    merge(&mut value, changes);
    let profile: Profile =
        serde_json::from_value(value).unwrap_or_else(|error| panic!("{name}: {error}"));
    profile.check().unwrap_or_else(|fault| panic!("{name}: {fault}"));
    profile
}

/// Puts the keys of one object into another.
pub fn merge(into: &mut Value, changes: &Value) {
    match (into, changes) {
        (_, Value::Null) => {}
        (Value::Object(into), Value::Object(changes)) => {
            for (key, value) in changes {
                merge(into.entry(key.clone()).or_insert(Value::Null), value);
            }
        }
        (into, changes) => *into = changes.clone(),
    }
}

/// What comes of a case.
pub fn observe(case: &Case, control: &str) -> Value {
    let control = case.control.as_deref().unwrap_or(control);
    let run = Run::of(control, &case.profile, &case.table, case);
    let mut observed = run.observed();
    if let Err(fault) = case.table.check() {
        observed.insert("table_fault".into(), json!(fault.to_string()));
    }
    if let Some(line) = case.start_line {
        let profile = profile(control, &case.profile);
        start::observe(&mut observed, &run.contour, &profile, &run.path, line);
    }
    if let Some(other) = &case.other {
        observed.insert("same_mm".into(), json!(run.distance(&other_run(case, other, control))));
    }
    Value::Object(observed)
}

fn other_run(case: &Case, other: &Other, control: &str) -> Run {
    let mut changes = case.profile.clone();
    if changes.is_null() {
        changes = json!({});
    }
    merge(&mut changes, &other.profile);
    let program = other.program.as_ref().unwrap_or(&case.program).clone();
    let case = &Case { program, ..case.clone() };
    let control = other.control.as_deref().unwrap_or(control);
    Run::of(control, &changes, other.table.as_ref().unwrap_or(&case.table), case)
}

struct Run {
    contour: ProgrammedContour,
    findings: Vec<Finding>,
    plan: Plan,
    path: CompensatedPath,
}

impl Run {
    fn of(control: &str, changes: &Value, table: &ToolTable, case: &Case) -> Self {
        let profile = profile(control, changes);
        let options = LoadOptions { start: case.start, ..LoadOptions::default() };
        let mut loaded = program_loader::load(case.program.as_bytes(), &profile, &options);
        if let Some((line, radius_mm)) = case.radius_value {
            let events = &mut loaded.contour.events;
            let at = events.partition_point(|event| event.source.line <= line);
            let source = Source { line, column: 1, ..Source::default() };
            events.insert(
                at,
                ContourEvent { source, kind: ContourEventKind::RadiusValue { radius_mm } },
            );
        }
        let mut findings = loaded.findings;
        let mut plan = Plan::default();
        if !findings.iter().any(Finding::is_error) {
            let planning = Planning { certifies: true, ..Planning::default() };
            let verdict = judge(&loaded.contour, &profile, table, planning);
            let (program, found) = (&case.program, &verdict.audit);
            assert_eq!(verdict.disagreement, None, "of the path of\n{program}\n{found:#?}");
            plan = verdict.plan;
            findings.extend(plan.findings.iter().cloned());
        }
        let mut path = plan.path.clone();
        if !plan.accepted() {
            path.start = loaded.contour.start;
            path.elements.clone_from(&plan.refused);
        }
        Self { contour: loaded.contour, findings, plan, path }
    }

    fn observed(&self) -> Map<String, Value> {
        let path = &self.path;
        let mut observed = Map::new();
        let accepted = !self.findings.iter().any(Finding::is_error);
        observed.insert("accepted".into(), json!(accepted));
        let elements = |keep: &dyn Fn(&PathElement) -> bool| -> Value {
            (path.elements.iter().enumerate())
                .filter(|(_, element)| keep(element))
                .map(|(index, element)| self::element(path.start_of(index), element))
                .collect()
        };
        observed.insert("path".into(), elements(&|element| element.role != Role::None));
        observed.insert("moves".into(), elements(&|_| true));
        let event = |event: &cnc_msgs::path::PathEvent| {
            let [x, y, z] = path.start_of(event.at_element);
            let mut observed = json!({
                "text": event.action.text(), "kind": event.action.kind(),
                "x": x, "y": y, "z": z, "at": event.at_element,
                "line": event.source.line, "block": event.source.block,
            });
            if let Action::ToolLength { length_mm, .. } = event.action {
                observed["length_mm"] = json!(length_mm);
            }
            observed
        };
        observed.insert("events".into(), path.events.iter().map(event).collect());
        let findings = self.findings.iter().map(finding).collect();
        observed.insert("findings".into(), findings);
        let spans = self.plan.spans.iter().map(|span| {
            json!({
                "side": side(Some(span.side)), "radius_mm": span.radius_mm,
                "first_line": span.first_line, "last_line": span.last_line,
            })
        });
        observed.insert("spans".into(), spans.collect());
        let certificates = self.plan.certificates.iter().map(|certificate| {
            let limits = certificate.limited_by.iter();
            let limits = limits.map(|limit| {
                let [x, y, z] = limit.position;
                json!({"line": limit.source.line, "block": limit.source.block, "x": x, "y": y, "z": z})
            });
            json!({
                "valid_to_mm": certificate.valid_to_mm,
                "leads_valid_to_mm": certificate.leads_valid_to_mm,
                "limited_by": limits.collect::<Vec<_>>(),
            })
        });
        observed.insert("certificates".into(), certificates.collect());
        let uncut = self.plan.uncut.iter().map(|region| {
            json!({
                "area_mm2": region.area_mm2, "first_line": region.first.line,
                "last_line": region.last.line, "first_block": region.first.block,
                "last_block": region.last.block,
            })
        });
        observed.insert("uncut".into(), uncut.collect());
        let mut lengths: BTreeMap<&str, f64> = BTreeMap::new();
        for (index, element) in path.elements.iter().enumerate() {
            let length = element_length(path.start_of(index), element);
            *lengths.entry(element.role.name()).or_default() += length;
        }
        observed.insert("length_mm".into(), json!(lengths));
        if let Some((min, max)) = self.offset() {
            observed.insert("offset_mm".into(), json!({"min": min, "max": max}));
        }
        observed
    }

    /// Distance from the blocks that elements belong to.
    fn offset(&self) -> Option<(f64, f64)> {
        let mut blocks: BTreeMap<u32, (Position, Shape, Position)> = BTreeMap::new();
        let mut at = self.contour.start;
        for event in &self.contour.events {
            if let ContourEventKind::Motion(motion) = event.kind {
                blocks.insert(event.source.line, (at, motion.shape, motion.end));
                at = motion.end;
            }
        }
        let mut range: Option<(f64, f64)> = None;
        for (index, element) in self.path.elements.iter().enumerate() {
            let Some((from, shape, to)) = blocks.get(&element.source.line) else { continue };
            let start = self.path.start_of(index);
            for step in 0..=8 {
                let point = along(start, &element.shape, element.end, f64::from(step) / 8.0);
                let distance = match element.role {
                    Role::Contour => from_block(point, *from, shape, *to),
                    Role::Corner => length(sub(point, *from)),
                    _ => continue,
                };
                let (min, max) = range.unwrap_or((distance, distance));
                range = Some((min.min(distance), max.max(distance)));
            }
        }
        range
    }

    /// How far ends of elements are from those of another run.
    fn distance(&self, other: &Self) -> f64 {
        if self.path.elements.len() != other.path.elements.len() {
            return f64::INFINITY;
        }
        let far = |a: &PathElement, b: &PathElement| {
            let same_kind = matches!(
                (a.shape, b.shape),
                (Shape::Line, Shape::Line) | (Shape::Arc(_), Shape::Arc(_))
            );
            if same_kind { length(sub(a.end, b.end)) } else { f64::INFINITY }
        };
        let pairs = self.path.elements.iter().zip(&other.path.elements);
        pairs.map(|(a, b)| far(a, b)).fold(0.0, f64::max)
    }
}

pub(super) fn element(start: Position, element: &PathElement) -> Value {
    let ([x, y, z], from) = (element.end, start);
    let mut object = json!({
        "from": {"x": from[0], "y": from[1], "z": from[2]}, "x": x, "y": y, "z": z,
        "kind": "line", "rapid": element.feed_mm_per_min.is_none(),
        "feed": element.feed_mm_per_min, "role": element.role.name(),
        "side": side(element.side), "line": element.source.line, "block": element.source.block,
    });
    if let Shape::Arc(arc) = element.shape {
        let [cx, cy, cz] = arc.center;
        let (radius, sweep) = radius_and_sweep(start, element);
        let arc = json!({
            "kind": "arc", "cx": cx, "cy": cy, "cz": cz, "clockwise": arc.clockwise,
            "turns": arc.turns, "radius": radius, "sweep_deg": sweep.to_degrees(),
        });
        let arc = arc.as_object().expect("an object").clone();
        object.as_object_mut().expect("an object").extend(arc);
    }
    object
}

pub(super) fn finding(finding: &Finding) -> Value {
    let [x, y, z] = finding.position.map_or([None; 3], |position| position.map(Some));
    json!({
        "severity": if finding.severity == Severity::Error { "error" } else { "warning" },
        "code": finding.code.name(), "alarm": finding.alarm,
        "line": finding.source.line, "column": finding.source.column,
        "block": finding.source.block,
        "other_line": finding.other.map(|other| other.line),
        "other_block": finding.other.and_then(|other| other.block),
        "x": x, "y": y, "z": z, "depth_mm": finding.depth_mm,
        "needed_mm": finding.needed_mm, "available_mm": finding.available_mm,
        "message": finding.message, "help": finding.help,
    })
}

fn side(side: Option<CutterSide>) -> Option<&'static str> {
    side.map(|side| match side {
        CutterSide::Left => "left",
        CutterSide::Right => "right",
    })
}

fn radius_and_sweep(start: Position, element: &PathElement) -> (f64, f64) {
    let Shape::Arc(arc) = element.shape else { return (0.0, 0.0) };
    let [u, v, _] = arc.plane.axes();
    let of = |point: Position| (point[u] - arc.center[u], point[v] - arc.center[v]);
    let ((a, b), (c, d)) = (of(start), of(element.end));
    let turn = (a * d - b * c).atan2(a * c + b * d);
    let turn = if arc.clockwise { -turn } else { turn };
    let turn = if turn < -1e-12 { turn + std::f64::consts::TAU } else { turn.max(0.0) };
    (a.hypot(b), turn + f64::from(arc.turns) * std::f64::consts::TAU)
}

fn element_length(start: Position, element: &PathElement) -> f64 {
    match element.shape {
        Shape::Line => length(sub(element.end, start)),
        Shape::Arc(_) => {
            let (radius, sweep) = radius_and_sweep(start, element);
            radius * sweep
        }
    }
}

fn along(start: Position, shape: &Shape, end: Position, part: f64) -> Position {
    match shape {
        Shape::Line => [0, 1, 2].map(|axis| start[axis] + (end[axis] - start[axis]) * part),
        Shape::Arc(arc) => {
            let element = PathElement { shape: *shape, end, ..blank() };
            let (_, sweep) = radius_and_sweep(start, &element);
            let angle = sweep * part * if arc.clockwise { -1.0 } else { 1.0 };
            let [u, v, w] = arc.plane.axes();
            let (x, y) = (start[u] - arc.center[u], start[v] - arc.center[v]);
            let mut point = start;
            point[u] = arc.center[u] + x * angle.cos() - y * angle.sin();
            point[v] = arc.center[v] + x * angle.sin() + y * angle.cos();
            point[w] = start[w] + (end[w] - start[w]) * part;
            point
        }
    }
}

const fn blank() -> PathElement {
    PathElement {
        shape: Shape::Line,
        end: [0.0; 3],
        feed_mm_per_min: None,
        role: Role::None,
        side: None,
        axes: cnc_msgs::geometry::AxisSet::NONE,
        source: cnc_msgs::contour::Source { line: 0, block: None, column: 0, length: 0, call: 0 },
    }
}

/// From the carrier of a block: the infinite line or the whole circle.
fn from_block(point: Position, from: Position, shape: &Shape, to: Position) -> f64 {
    match shape {
        Shape::Line => {
            let (along, to_point) = (sub(to, from), sub(point, from));
            let squared = dot(along, along);
            if squared == 0.0 {
                return length(to_point);
            }
            let part = dot(to_point, along) / squared;
            length([0, 1, 2].map(|axis| to_point[axis] - along[axis] * part))
        }
        Shape::Arc(arc) => {
            let [u, v, _] = arc.plane.axes();
            let radius = (from[u] - arc.center[u]).hypot(from[v] - arc.center[v]);
            ((point[u] - arc.center[u]).hypot(point[v] - arc.center[v]) - radius).abs()
        }
    }
}

fn sub(a: Position, b: Position) -> Position {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: Position, b: Position) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn length(a: Position) -> f64 {
    dot(a, a).sqrt()
}
