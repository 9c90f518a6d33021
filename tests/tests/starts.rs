//! Runs that begin inside a compensated contour (M28, C19): from the program to the machine,
//! with what the planner says of the start, on one line.

use axis_driver::codes::error_code;
use axis_driver::driver::{
    Command, DriverConfig, JogFrame, JogRequest, OffsetRequest, Refusal, RunOutcome, RunRequest,
};
use axis_driver::encoder::EncoderConfig;
use cnc_msgs::contour::SpindleMode;
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{AxisSet, Position};
use cnc_msgs::machine::Mode;
use cnc_msgs::path::{CompensatedPath, StartInSpan};
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::{NoStart, Planning, Start, judge, start, tessellate};
use kerf_tests::line::Line;
use kerf_tests::root;
use kerf_tests::rows::observe::profile;
use program_loader::LoadOptions;
use serde_json::{Value, json};
use std::sync::Arc;
use virtual_controller::{Build, Settings};

/// Machine frame, mm: the work zero, and the height at which everything is clear.
const ORIGIN: Position = [-500.0, -300.0, -60.0];
const CLEAR_Z: f64 = -2.0;
/// The controller counts in steps, mm.
const NEAR: f64 = 0.02;

/// A program that was loaded and planned.
struct Part {
    profile: Profile,
    contour: cnc_msgs::contour::ProgrammedContour,
    path: CompensatedPath,
}

impl Part {
    fn of(file: &str, control: &str, changes: &Value) -> Self {
        let read = |name: &str| {
            std::fs::read(root().join("tests/golden_runs").join(name)).expect("it is there")
        };
        let profile = profile(control, changes);
        let loaded = program_loader::load(&read(file), &profile, &LoadOptions::default());
        let tools: ToolTable =
            serde_yaml::from_slice(&read("tools.yaml")).expect("a table of tools");
        let plan = judge(&loaded.contour, &profile, &tools, Planning::default()).plan;
        assert!(plan.accepted(), "{:#?}", plan.findings);
        Self { profile, contour: loaded.contour, path: plan.path }
    }

    fn start(&self, line: u32) -> Result<Start, Box<NoStart>> {
        start(&self.contour, &self.profile, &self.path, line, 0)
    }

    fn request(&self, start_line: u32, in_span: StartInSpan) -> Command {
        Command::RunProgram(RunRequest {
            program_id: "part".into(),
            revision: 1,
            path: Arc::new(self.path.clone()),
            start_line,
            occurrence: 0,
            in_span,
            check_only: false,
            tool_diameters_mm: Default::default(),
        })
    }

    /// The path from an element on, in chords.
    fn rest(&self, first: usize) -> Vec<Position> {
        let mut points = vec![self.path.start_of(first)];
        for (index, element) in self.path.elements.iter().enumerate().skip(first) {
            let start = self.path.start_of(index);
            tessellate::points(start, element, 1e-3, &mut |point| points.push(point));
        }
        points
    }
}

/// Homed, with the tool clear of everything.
fn homed() -> Line {
    let mut settings = Settings::small_router();
    // As much travel as the longest part needs.
    for line in ["$22=1", "$131=500", "$132=150"] {
        settings.set_line(line).expect("a setting");
    }
    let encoder = EncoderConfig { approach_z_mm: Some(CLEAR_Z), ..EncoderConfig::default() };
    let config = DriverConfig { encoder, ..DriverConfig::default() };
    let mut line = Line::new(config, Build::new(settings), &[]);
    line.until("locked", |line| line.mode() == Mode::Alarm);
    line.ask(Command::Home).expect("it homes");
    let (axes, is_origin) = (AxisSet::ALL, true);
    let offset =
        OffsetRequest { further: FurtherAxes::NONE, system: 1, axes, position: ORIGIN, is_origin };
    line.ask(Command::SetWorkOffset(offset)).expect("an offset");
    line
}

fn in_work(line: &Line) -> Position {
    let at = line.axes();
    [0, 1, 2].map(|axis| at[axis] - ORIGIN[axis])
}

fn to_segment(point: Position, from: Position, to: Position) -> f64 {
    let along = [0, 1, 2].map(|axis| to[axis] - from[axis]);
    let squared: f64 = along.iter().map(|part| part * part).sum();
    let dot: f64 = (0..3).map(|axis| (point[axis] - from[axis]) * along[axis]).sum();
    let part = if squared > 0.0 { (dot / squared).clamp(0.0, 1.0) } else { 0.0 };
    let off = |axis: usize| point[axis] - from[axis] - along[axis] * part;
    (0..3).map(|axis| off(axis).powi(2)).sum::<f64>().sqrt()
}

fn to_path(point: Position, path: &[Position]) -> f64 {
    path.windows(2).map(|ends| to_segment(point, ends[0], ends[1])).fold(f64::INFINITY, f64::min)
}

/// Runs a part from a line and says everywhere that the tool was.
fn run_from(line: &mut Line, part: &Part, start_line: u32, in_span: StartInSpan) -> Vec<Position> {
    line.finished = None;
    line.ask(part.request(start_line, in_span)).expect("the run begins");
    let mut places = vec![in_work(line)];
    while line.finished.is_none() {
        if line.mode() == Mode::ToolChange {
            line.ask(Command::ConfirmToolChange { objection: None }).expect("it is in");
        }
        line.step();
        let place = in_work(line);
        if places.last() != Some(&place) {
            places.push(place);
        }
    }
    let result = line.finished.take().expect("it has ended");
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
    places
}

/// The tool was only above, in the column over where the run begins, and on what is left of
/// the path; and it was at the end of every block that is left.
#[track_caller]
fn cut_what_is_left(part: &Part, first: usize, places: &[Position]) {
    let rest = part.rest(first);
    let [x, y, z] = rest[0];
    let clear = CLEAR_Z - ORIGIN[2];
    let down = places.iter().position(|place| to_segment(*place, rest[0], rest[0]) < NEAR);
    let down = down.expect("it comes to where the run begins");
    for place in &places[..down] {
        let is_over = (place[0] - x).abs() < NEAR && (place[1] - y).abs() < NEAR;
        let is_lifted = place[2] > clear - NEAR;
        // Up from its previous position: that is the first place.
        let is_lifting = to_segment(*place, places[0], [places[0][0], places[0][1], clear]) < NEAR;
        assert!(is_lifted || is_lifting || (is_over && place[2] > z - NEAR), "{place:?}");
    }
    for place in &places[down..] {
        assert!(to_path(*place, &rest) < NEAR, "{place:?} is not on what is left of the path");
    }
    for element in &part.path.elements[first..] {
        let nearest = to_path(element.end, &places[down..]);
        assert!(nearest < NEAR, "{element:?} was not cut: {nearest:.3} mm");
    }
}

#[test]
fn m28_a_run_that_begins_inside_a_contour_cuts_what_is_left_of_it() {
    let part = Part::of("contour.mpf", "sinumerik_840c", &Value::Null);
    // Every line of the contour, its lead-off too.
    for start_line in 3..=12 {
        let start = part.start(start_line).expect("the 840C begins there");
        assert_eq!(start.in_span, StartInSpan::FromAbove, "line {start_line}");
        let mut line = homed();
        let places = run_from(&mut line, &part, start_line, start.in_span);
        cut_what_is_left(&part, start.entry.element, &places);
        let turned = line.states.iter().any(|(_, state)| {
            state.spindle == Some(SpindleMode::Clockwise) && state.line == start_line
        });
        assert!(turned, "line {start_line}: the spindle was off");
    }
}

#[test]
fn m28_masso_begins_where_its_finding_says_and_not_inside() {
    let part = Part::of("masso_example.nc", "masso", &Value::Null);
    for start_line in 5..=11 {
        let refused = part.start(start_line).expect_err("it is forbidden");
        assert_eq!(refused.nearest.line, 3, "line {start_line}: {}", refused.finding.message);
        // The driver refuses, too, if it is not allowed; it takes the lead-on for outside.
        if start_line > 5 {
            let refusal = homed().ask(part.request(start_line, StartInSpan::Refused)).unwrap_err();
            assert_eq!(refusal.error_code, error_code::START_LINE, "{refusal}");
        }
    }
    let start = part.start(3).expect("it is before the selection");
    let places = run_from(&mut homed(), &part, 3, start.in_span);
    cut_what_is_left(&part, start.entry.element, &places);
    // The same control, where its profile rebuilds: from N70 on, tool change included.
    let part = Part::of("masso_example.nc", "masso", &json!({"restart": {"rule": "rebuild"}}));
    let start = part.start(7).expect("it is rebuilt");
    let places = run_from(&mut homed(), &part, 7, start.in_span);
    cut_what_is_left(&part, start.entry.element, &places);
}

fn is_elsewhere(refusal: &Refusal) -> bool {
    refusal.error_code == error_code::START_POSITION
        && refusal.message.contains("move it there first")
}

#[test]
fn in_a_plane_that_holds_z_nothing_comes_down_and_a_tool_already_there_begins() {
    let part = Part::of("shaft.min", "osp_lathe", &Value::Null);
    let start = part.start(6).expect("the OSP begins there");
    assert_eq!(start.in_span, StartInSpan::Standing);
    let mut line = homed();
    let check = || match part.request(6, start.in_span) {
        Command::RunProgram(request) => {
            Command::RunProgram(RunRequest { check_only: true, ..request })
        }
        other => panic!("{other:?} begins no program"),
    };
    let refusal = line.ask(part.request(6, start.in_span)).unwrap_err();
    assert!(is_elsewhere(&refusal), "{refusal}");
    // A check says so before anybody begins.
    let checked = line.ask(check()).expect("it is checked");
    assert!(checked.contains(&refusal.message), "{checked}");
    let (frame, axes, target) = (JogFrame::Work, AxisSet::from_bits(0b101), start.at);
    line.ask(Command::Jog(JogRequest {
        further: FurtherAxes::NONE,
        frame,
        axes,
        target,
        feed_mm_per_min: 2_000.0,
    }))
    .unwrap();
    assert_eq!(line.move_result().outcome, RunOutcome::Succeeded);
    let checked = line.ask(check()).expect("it is checked");
    assert!(!checked.contains("but the tool is at"), "{checked}");
    let places = run_from(&mut line, &part, 6, start.in_span);
    let rest = part.rest(start.entry.element);
    for place in &places {
        assert!(to_path([place[0], rest[0][1], place[2]], &rest) < NEAR, "{place:?}");
    }
}
