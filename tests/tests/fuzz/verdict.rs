//! One verdict: what the planner accepts, the audit of its path accepts too.
//!
//! Programs of the project, changed in their words and with tools that just fit; and contours
//! of straights and fillets on a grid, written for each control and planned with tools of
//! exactly the radii that are in them.

use crate::mutate::{Random, mutate};
use crate::programs::profile;
use cnc_msgs::chunk::{Collector, ContourChunks, PathChunks};
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::profile::{Profile, Reaction, Strictness};
use cnc_msgs::tool_table::{Offset, Tool, ToolTable};
use cnc_msgs::wire::cnc_msgs::msg::{
    CompensatedPath as CompensatedPathMessage, ProgrammedContour as ProgrammedContourMessage,
};
use compensation_planner::{Planning, judge};
use kerf_tests::rows::IN_ORDER;
use kerf_tests::{root, rows};
use program_loader::{LoadOptions, load};
use settings::Control;
use std::fmt::Write;
use std::sync::Arc;

/// A program with the control and the tools that it was made for.
#[derive(Debug, Clone)]
pub(crate) struct Program {
    profile: Profile,
    text: Vec<u8>,
    tools: ToolTable,
    start: [f64; 3],
}

impl Program {
    /// A program of a control, with tools of one radius.
    pub(crate) fn of(control: &str, text: &str, radius_mm: f64) -> Self {
        let (profile, text) = (profile(control), text.as_bytes().to_vec());
        Self { profile, text, tools: table(radius_mm), start: [0.0; 3] }
    }
}

/// Golden programs, golden runs, those that are refused, the demo, and the manuals' rows.
pub(crate) fn corpus() -> Vec<Program> {
    let mut corpus: Vec<Program> = crate::programs::corpus()
        .into_iter()
        .map(|(profile, text)| Program { profile, text, tools: table(5.0), start: [0.0; 3] })
        .collect();
    for folder in ["tests/golden_runs", "tests/golden_runs/refused", "config/demo"] {
        let mut paths: Vec<_> = std::fs::read_dir(root().join(folder))
            .expect("a folder of programs")
            .map(|entry| entry.expect("an entry").path())
            .filter(|path| path.is_file())
            .collect();
        paths.sort();
        for path in paths {
            let ending = path.extension().unwrap_or_default().to_string_lossy().into_owned();
            let control = match &*ending {
                "mpf" => "sinumerik_840c",
                "nct" => "nct",
                "min" => "osp_lathe",
                "ascript" => "automation1",
                "nc" => "masso",
                "ngc" => "rs274",
                ending => match Control::named(ending) {
                    Some(control) => control.name(),
                    None => continue,
                },
            };
            let text = std::fs::read(&path).expect("a program");
            corpus.push(Program {
                profile: profile(control),
                text,
                tools: table(5.0),
                start: [0.0; 3],
            });
        }
    }
    for control in rows::controls() {
        for case in rows::of(control).into_iter().flat_map(|row| row.cases) {
            let name = case.control.as_deref().unwrap_or(control);
            corpus.push(Program {
                profile: rows::observe::profile(name, &case.profile),
                text: case.program.into_bytes(),
                tools: case.table,
                start: case.start,
            });
        }
    }
    corpus
}

/// All tools and registers that programs name, of one radius.
fn table(radius_mm: f64) -> ToolTable {
    let mut tools = ToolTable::default();
    for number in 1..8 {
        let tool = Tool {
            diameter_mm: 2.0 * radius_mm.abs(),
            nose_radius_mm: radius_mm.abs(),
            ..Tool::default()
        };
        tools.tools.insert(number, tool);
        tools.offsets.insert(number, Offset { radius_mm, ..Offset::default() });
    }
    tools
}

/// What became of a program.
#[derive(Debug)]
pub(crate) enum ProgramOutcome {
    Refused,
    Accepted,
    /// Control and tools, what the audit found, and the program.
    Disagreed(String),
}

/// A program of the project, changed.
pub(crate) fn check(corpus: &[Program], random: &mut Random) -> ProgramOutcome {
    let mut program = random.of(corpus).clone();
    let other = &random.of(corpus).text;
    if random.once_in(6) {
        let control = IN_ORDER[random.below(IN_ORDER.len())];
        program.profile = profile(control.name());
    }
    if !random.once_in(8) {
        program.text = if random.once_in(3) {
            mutate(&program.text, other, random)
        } else {
            crate::mutate::renumber(&program.text, random)
        };
    }
    if !random.once_in(4) {
        let radius_mm = fitting_radius(&program.text, random);
        program.tools = table(radius_mm);
    }
    other_rules(&mut program.profile, random);
    verdict(&program)
}

/// A contour on a grid.
pub(crate) fn check_grid(random: &mut Random) -> ProgramOutcome {
    let mut program = grid_program(random);
    other_rules(&mut program.profile, random);
    verdict(&program)
}

/// Now and then what does not fit is left out or ignored, or not seen by the control.
fn other_rules(profile: &mut Profile, random: &mut Random) {
    if random.once_in(8) {
        profile.interference.react = *random.of(&[Reaction::Trim, Reaction::Ignore]);
    }
    if random.once_in(12) {
        profile.lookahead.strictness = Strictness::Warn;
    }
}

/// A radius that just fits something, or just does not.
fn fitting_radius(text: &[u8], random: &mut Random) -> f64 {
    let mut numbers: Vec<f64> = String::from_utf8_lossy(text)
        .split(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-')))
        .filter_map(|word| word.parse::<f64>().ok())
        .map(f64::abs)
        .filter(|number| (1e-3..200.0).contains(number))
        .collect();
    numbers.push(10.0);
    let number = *random.of(&numbers);
    let other = *random.of(&numbers);
    let exact = match random.below(7) {
        0 => 0.0,
        1 => number,
        2 | 3 => number / 2.0,
        4 => (number - other).abs() / 2.0,
        5 => (number + other) / 2.0,
        _ => number / 4.0,
    };
    let off = *random.of(&[0.0, 0.0, 0.0, 0.0, 1e-9, -1e-9, 1e-6, -1e-6, 1e-4, -1e-4, 0.01, -0.01]);
    let radius = if exact == 0.0 { exact } else { (exact + off).max(0.0) };
    if random.once_in(20) { -radius } else { radius }
}

/// What `kerf plan` and the node say of a program.
pub(crate) fn verdict(program: &Program) -> ProgramOutcome {
    let Program { profile, text, tools, start } = program;
    let options = LoadOptions { start: *start, ..LoadOptions::default() };
    let loaded = load(text, profile, &options);
    if !loaded.is_accepted() {
        return ProgramOutcome::Refused;
    }
    let here = judge(&loaded.contour, profile, tools, Planning::default());
    let received = over_the_wire(loaded.contour.clone());
    let text_shown = String::from_utf8_lossy(text);
    assert_eq!(received, loaded.contour, "the wire changes the contour of {text_shown}");
    let node = judge(&received, profile, tools, Planning::default());
    let is_one = here.plan.accepted() == node.plan.accepted();
    if is_one && here.disagreement.is_none() && node.disagreement.is_none() {
        path_over_the_wire(node.plan.path);
        return if here.plan.accepted() {
            ProgramOutcome::Accepted
        } else {
            ProgramOutcome::Refused
        };
    }
    let radius = tools.tools.get(&1).map(|tool| tool.diameter_mm / 2.0);
    let offset = tools.offsets.get(&1).map(|offset| offset.radius_mm);
    let react = profile.interference.react;
    let mut shown =
        format!("{}, {react:?}, T1 R {radius:?}, D1 {offset:?}, {start:?}\n", profile.name);
    for (place, plan) in [("here", &here.plan), ("node", &node.plan)] {
        for finding in &plan.findings {
            let (severity, line) = (finding.severity, finding.source.line);
            let (code, message) = (finding.code.name(), &finding.message);
            shown += &format!("{place}: {severity:?} {code} line {line}: {message}\n");
        }
    }
    shown += &text_shown;
    ProgramOutcome::Disagreed(shown)
}

/// The contour as the planner's node gets it from the loader's.
fn over_the_wire(contour: ProgrammedContour) -> ProgrammedContour {
    let chunks = ContourChunks::new("program".into(), contour);
    let manifest = ProgrammedContourMessage { program_id: "program".into(), ..chunks.manifest() };
    let mut collector = Collector::for_contour(&manifest).expect("a manifest");
    for index in 0..chunks.count() {
        collector.add(chunks.chunk(index).expect("a chunk")).expect("it fits");
    }
    collector.finish(&manifest).expect("all of it")
}

/// What is accepted the driver gets from the planner's node.
fn path_over_the_wire(path: CompensatedPath) {
    let chunks = PathChunks::new("program".into(), 1, Arc::new(path));
    let manifest =
        CompensatedPathMessage { program_id: "program".into(), revision: 1, ..chunks.manifest() };
    let mut collector = Collector::for_path(&manifest).expect("a manifest");
    for index in 0..chunks.count() {
        collector.add(chunks.chunk(index).expect("a chunk")).expect("it fits");
    }
    collector.finish(&manifest).expect("all of it");
}

type Point = [f64; 2];

/// A polyline on a coarse grid with fillets, closed or open, rounded as posts do.
fn grid_program(random: &mut Random) -> Program {
    let control = IN_ORDER[random.below(IN_ORDER.len())];
    let step = *random.of(&[1.0, 2.5, 5.0, 10.0]);
    let count = 2 + random.below(9);
    let is_rectilinear = random.once_in(2);
    let mut points: Vec<Point> = vec![[0.0, 0.0]];
    for index in 0..count {
        let last = points[points.len() - 1];
        let by = |random: &mut Random| step * (random.below(9) as f64 - 4.0);
        let mut next = [last[0] + by(random), last[1] + by(random)];
        if is_rectilinear {
            next[index % 2] = last[index % 2];
        }
        if next != last {
            points.push(next);
        }
    }
    match random.below(4) {
        // A rectangle as pocket or boss.
        0 => {
            let (w, h) =
                (step * (1.0 + random.below(6) as f64), step * (1.0 + random.below(6) as f64));
            points = vec![
                [0.0, 0.0],
                [w / 2.0, 0.0],
                [w, 0.0],
                [w, h],
                [0.0, h],
                [0.0, 0.0],
                [w / 2.0, 0.0],
            ];
            points.remove(0);
            if random.once_in(2) {
                points.reverse();
            }
        }
        1 | 2 => points.push(points[0]),
        _ => {}
    }
    let fillet = *random.of(&[0.0, 0.0, 1.0, 2.0, 2.5, 4.0, 5.0, 10.0]);
    let radii: Vec<f64> = vec![fillet, fillet, step / 2.0, step, 2.0 * step, 5.0, 10.0];
    let radius = *random.of(&radii);
    let off = *random.of(&[0.0, 0.0, 0.0, 0.0, 1e-9, -1e-9, 1e-6, -1e-6, 1e-4, -1e-4, 0.01, -0.01]);
    let radius = if random.once_in(8) { 0.0 } else { (radius + off).max(0.0) };
    let decimals = *random.of(&[2_usize, 3, 3, 4]);
    // Turned, so that numbers are rounded.
    let (sin, cos) = match random.below(3) {
        0 => random.between(0.0, 6.3).sin_cos(),
        _ => (0.0, 1.0),
    };
    let turn = |p: Point| [p[0] * cos - p[1] * sin, p[0] * sin + p[1] * cos];
    let points: Vec<Point> = points.into_iter().map(turn).collect();
    let text = written(control, &points, fillet, decimals, radius, random);
    Program::of(control.name(), &text, radius)
}

fn written(
    control: Control,
    points: &[Point],
    fillet: f64,
    decimals: usize,
    radius: f64,
    random: &mut Random,
) -> String {
    let round = |value: f64| {
        let unit = 10_f64.powi(decimals as i32);
        let rounded = (value * unit).round() / unit;
        if rounded == 0.0 { 0.0 } else { rounded }
    };
    let (is_lathe, knows_radius) = match control {
        Control::OspLathe => (true, false),
        Control::Automation1 | Control::Sinumerik840c => (false, false),
        Control::Rs274 | Control::Masso | Control::Nct => (false, true),
    };
    // The first letter of a lathe's plane is Z; X is a diameter.
    let at = |p: Point| {
        let [a, b] = p.map(round);
        if is_lathe { format!("Z{a} X{}", 2.0 * b) } else { format!("X{a} Y{b}") }
    };
    let select = *random.of(&["G41", "G42"]);
    let start = points[0];
    let far = *random.of(&[0.5, 1.01, 1.5, 3.0]) * radius.max(1.0) + 1.0;
    let aside = |p: Point, random: &mut Random| {
        let angle =
            *random.of(&[0.0, 90.0, 180.0, 270.0, 45.0, 135.0]) * std::f64::consts::PI / 180.0;
        [p[0] + far * f64::cos(angle), p[1] + far * f64::sin(angle)]
    };
    let mut text = String::new();
    let tool = match control {
        Control::OspLathe => {
            text += &format!("N1 G0 {}\nN2 T010101\nN3 F100\n", at(aside(start, random)));
            ""
        }
        Control::Automation1 => {
            text += &format!("G0 {}\nG43 P{radius}\nF100\n", at(aside(start, random)));
            ""
        }
        Control::Masso | Control::Rs274 => {
            text += &format!("T1 M6\nG0 {}\nF100\n", at(aside(start, random)));
            ""
        }
        Control::Nct => {
            text += &format!("N1 G0 {}\nN2 F100\n", at(aside(start, random)));
            " D1"
        }
        Control::Sinumerik840c => {
            text += &format!("N1 G0 {}\nN2 F100\n", at(aside(start, random)));
            if random.once_in(2) {
                text += "N3 G451\n";
            }
            " D1"
        }
    };
    let _ = writeln!(text, "{select}{tool} G1 {}", at(start));
    let mut here = start;
    for index in 1..points.len() {
        let corner = points[index];
        let Some(&next) = points.get(index + 1) else {
            let _ = writeln!(text, "G1 {}", at(corner));
            here = corner;
            continue;
        };
        let (a, b) = (
            [corner[0] - here[0], corner[1] - here[1]],
            [next[0] - corner[0], next[1] - corner[1]],
        );
        let (la, lb) = (a[0].hypot(a[1]), b[0].hypot(b[1]));
        let cross = (a[0] * b[1] - a[1] * b[0]) / (la * lb);
        let dot = (a[0] * b[0] + a[1] * b[1]) / (la * lb);
        let half = (cross.abs().atan2(dot) / 2.0).tan();
        let cut = fillet * half;
        if fillet == 0.0 || cross.abs() < 1e-6 || cut > la || cut > lb / 2.0 {
            let _ = writeln!(text, "G1 {}", at(corner));
            here = corner;
            continue;
        }
        let (ua, ub) = ([a[0] / la, a[1] / la], [b[0] / lb, b[1] / lb]);
        let from = [corner[0] - ua[0] * cut, corner[1] - ua[1] * cut];
        let to = [corner[0] + ub[0] * cut, corner[1] + ub[1] * cut];
        let side = cross.signum();
        let center = [from[0] - ua[1] * side * fillet, from[1] + ua[0] * side * fillet];
        if (from[0] - here[0]).hypot(from[1] - here[1]) > 1e-9 {
            let _ = writeln!(text, "G1 {}", at(from));
        }
        let word = if side > 0.0 { "G3" } else { "G2" };
        let from = from.map(round);
        let offset = [round(center[0] - from[0]), round(center[1] - from[1])];
        let (i, j) = if is_lathe { ("K", "I") } else { ("I", "J") };
        if random.once_in(4) && fillet > 0.0 && knows_radius {
            let _ = writeln!(text, "{word} {} R{fillet}", at(to));
        } else {
            let _ = writeln!(text, "{word} {} {i}{} {j}{}", at(to), offset[0], offset[1]);
        }
        here = to;
    }
    let _ = write!(text, "G40 G1 {}\nM2\n", at(aside(here, random)));
    text
}
