//! Contours that are wrong as programmed: a finding with a place, in bounded time and
//! memory, and never a panic.

mod support;

use cnc_msgs::contour::{ContourEvent, ContourEventKind, Motion, ProgrammedContour, Source};
use cnc_msgs::finding::{Code, Finding};
use compensation_planner::{Plan, plan_certified};
use std::time::{Duration, Instant};
use support::*;

/// Enough for a busy machine without optimisation; what is not bounded takes hours.
const TIME_MAX: Duration = Duration::from_secs(120);

/// Ten million without debug assertions, in a release build; fewer where the planner
/// itself is not optimised.
const MANY: usize = if cfg!(debug_assertions) { 200_000 } else { 10_000_000 };

fn timed(contour: &ProgrammedContour, radius_mm: f64) -> Plan {
    let start = Instant::now();
    let plan = compensation_planner::plan(contour, &sinumerik(), &tool(radius_mm));
    assert!(start.elapsed() < TIME_MAX, "{:?}", start.elapsed());
    plan
}

fn assert_places(plan: &Plan) {
    assert!(!plan.findings.is_empty());
    for finding in &plan.findings {
        assert!(finding.source.line > 0, "{finding:?}");
        let numbers = [finding.depth_mm, finding.needed_mm, finding.available_mm];
        let numbers = numbers.into_iter().chain(finding.position.into_iter().flatten().map(Some));
        assert!(numbers.flatten().all(f64::is_finite), "{finding:?}");
    }
    assert!(plan.accepted() || plan.path.elements.is_empty());
}

/// A contour whose motion in the middle is said many times over, a line each time.
fn repeated(text: &str, line: u32, count: usize) -> ProgrammedContour {
    let mut contour = contour(text, &sinumerik());
    let is_it = |event: &ContourEvent| {
        event.source.line == line && matches!(event.kind, ContourEventKind::Motion(_))
    };
    let at = contour.events.iter().position(is_it).expect("a motion in this line");
    let event = contour.events[at];
    let more = (0..count).map(|index| ContourEvent {
        source: Source { line: line + index as u32, ..event.source },
        ..event
    });
    contour.events.splice(at..=at, more);
    contour
}

const SQUARE: &str = "
    G0 X-20 Y20
    G41 D1 G456 G1 X0 Y0 F100
    X40
    Y40
    X0
    Y0
    G40 G456 X-20 Y20";

#[test]
fn very_many_coincident_points_are_one_point() {
    // On the outside corner at X40 Y0, the tool on the right; again with an inside one.
    for side in ["G42", "G41"] {
        let text = SQUARE.replace("G41", side);
        let plain = plan(&text, &sinumerik(), &tool(5.0));
        let many = timed(&repeated(&text, 3, MANY), 5.0);
        // The control looks over a few blocks that go nowhere, not over all of these.
        let mut reported = codes(&many);
        assert!(reported.contains(&Code::OffPlaneBlocks), "{}", findings(&many));
        reported.retain(|&code| code != Code::OffPlaneBlocks);
        assert_eq!(reported, codes(&plain), "{side}");
        let ends = |plan: &Plan| -> Vec<_> {
            let elements = if plan.accepted() { &plan.path.elements } else { &plan.refused };
            elements.iter().map(|element| element.end).collect()
        };
        assert_eq!(ends(&many), ends(&plain), "{side}");
    }
}

#[test]
fn nothing_but_coincident_points_is_no_contour() {
    let text = "G0 X-20 Y20\nG41 D1 G456 G1 X0 Y0 F100\nX0 Y0\nG40 G456 X-20 Y20";
    let plan = timed(&repeated(text, 3, MANY), 5.0);
    assert_places(&plan);
    assert!(!plan.accepted());
    finding(&plan, Code::NeverActive);
}

/// Every motion of a contour with its end, and centre, changed.
fn each_motion(contour: &ProgrammedContour, change: impl Fn(&mut Motion), check: impl Fn(&Plan)) {
    for index in 0..contour.events.len() {
        let mut contour = contour.clone();
        if let ContourEventKind::Motion(motion) = &mut contour.events[index].kind {
            change(motion);
            for radius_mm in [0.0, 5.0, -5.0] {
                check(&timed(&contour, radius_mm));
            }
        }
    }
}

#[test]
fn an_end_or_a_centre_that_is_no_number_is_refused_at_its_block() {
    use cnc_msgs::geometry::Shape;
    let contour = contour(A6, &sinumerik());
    let bad_number = |plan: &Plan| {
        assert_places(plan);
        finding(plan, Code::BadNumber);
        assert!(!plan.accepted());
    };
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e10] {
        for axis in 0..3 {
            each_motion(&contour, |motion| motion.end[axis] = bad, bad_number);
        }
    }
    let mut arcs = 0;
    for event in &contour.events {
        arcs += usize::from(
            matches!(event.kind, ContourEventKind::Motion(motion) if motion.shape != Shape::Line),
        );
    }
    assert!(arcs >= 2, "the example has arcs");
    let no_centre = |motion: &mut Motion| {
        if let Shape::Arc(arc) = &mut motion.shape {
            arc.center[0] = f64::NAN;
        }
    };
    let is_refused_if_arc = |plan: &Plan| assert!(plan.findings.iter().all(has_place));
    each_motion(&contour, no_centre, is_refused_if_arc);
}

fn has_place(finding: &Finding) -> bool {
    finding.source.line > 0
}

#[test]
fn coordinates_of_a_million_metres_are_planned_or_refused_at_a_place() {
    for far in [1e9, -1e9, 999_999_999.999] {
        for axis in 0..2 {
            each_motion(
                &contour(A6, &sinumerik()),
                |motion| motion.end[axis] = far,
                |plan| {
                    assert!(plan.findings.iter().all(has_place), "{}", findings(plan));
                    let elements = plan.path.elements.iter().chain(&plan.refused);
                    for element in elements {
                        assert!(element.end.iter().all(|value| value.is_finite()), "{element:?}");
                    }
                },
            );
        }
    }
    // All of it so far away that a double has no micrometres left.
    let mut contour = contour(SQUARE, &sinumerik());
    contour.start = [1e9, 1e9, 0.0];
    for event in &mut contour.events {
        if let ContourEventKind::Motion(motion) = &mut event.kind {
            motion.end = motion.end.map(|value| value + 1e9 - 100.0);
        }
    }
    let plan = timed(&contour, 5.0);
    assert!(plan.findings.iter().all(has_place), "{}", findings(&plan));
}

#[test]
fn a_contour_that_never_closes_and_never_ends_is_reported() {
    // A zigzag outwards, compensation still on at its end.
    let mut text = "G0 X0 Y20\nG41 D1 G456 G1 X0 Y0 F100\n".to_string();
    for index in 1..5000 {
        text += &format!("X{} Y{}\n", index * 20, if index % 2 == 0 { 0 } else { -8 });
    }
    let open = timed(&contour(&text, &sinumerik()), 2.0);
    assert_places(&open);
    finding(&open, Code::NotCancelled);
    // Cancelled at its end it is a contour like any other.
    text += "G40 G456 X99980 Y40";
    let ended = timed(&contour(&text, &sinumerik()), 2.0);
    assert!(ended.findings.is_empty(), "{}", findings(&ended));
}

#[test]
fn a_contour_that_crosses_itself_as_programmed_is_reported_with_its_place() {
    // An eight: the tool that runs on the outside of one half is inside of the other.
    let eight = "
        G0 X25 Y-40
        G41 D1 G456 G1 X20 Y-20 F100
        X-20 Y20
        X-20 Y-20
        X20 Y20
        X20 Y-20
        G40 G456 X25 Y-40";
    let eight = timed(&contour(eight, &sinumerik()), 5.0);
    assert_places(&eight);
    let gouge = finding(&eight, Code::Gouge);
    assert!(gouge.depth_mm.is_some_and(|depth| depth > 4.9), "{gouge:?}");
    assert!(gouge.position.is_some() && gouge.other.is_some(), "{gouge:?}");

    // Hundreds of star points, each edge across most of the others.
    let count = 601;
    let corner = |index: usize| {
        let angle = std::f64::consts::TAU * (index * 300 % count) as f64 / count as f64;
        format!("X{:.3} Y{:.3}\n", 200.0 * angle.cos(), 200.0 * angle.sin())
    };
    let mut text = format!("G0 X240 Y0\nG42 D1 G456 G1 F100 {}", corner(0));
    text.extend((1..=count).map(corner));
    text += "G40 G456 X240 Y0";
    let star = timed(&contour(&text, &sinumerik()), 5.0);
    assert_places(&star);
    assert!(!star.accepted() && star.findings.len() < 1000, "{}", star.findings.len());
}

#[test]
fn certificates_of_bad_contours_are_bounded_too() {
    let count = 60;
    let point = |index: usize| {
        let index = index as f64;
        format!("X{:.4} Y{:.4}\n", (index * 0.618_033).fract(), (index * 0.786_151).fract())
    };
    let mut text = "G0 X-20 Y20\nG41 D1 G456 G1 X0 Y0 F100\n".to_string();
    text.extend((1..count).map(point));
    text += "G40 G456 X-20 Y20";
    let contour = contour(&text, &sinumerik());
    for radius_mm in [0.001, 0.5, 5.0] {
        let start = Instant::now();
        let plan = plan_certified(&contour, &sinumerik(), &tool(radius_mm));
        assert!(start.elapsed() < TIME_MAX, "{:?}", start.elapsed());
        assert_places(&plan);
        assert!(!plan.accepted());
    }
}
