//! Times that follow from the formulas; the virtual controller judges whole programs.

use super::*;
use crate::driver::ControllerSettings;
use crate::firmware::Firmware;
use crate::machine_limits::tests::settings;
use cnc_msgs::contour::Source;
use cnc_msgs::further::FurtherMove;
use cnc_msgs::geometry::{Arc, AxisSet, Plane, Shape};
use cnc_msgs::path::{PathElement, PathEvent, Role};
use cnc_msgs::text::Words;

/// 500 mm/s² on X and Y, 5000 mm/min.
fn limits(changes: &[(u16, f64)]) -> MachineLimits {
    MachineLimits::of(&settings(Firmware::Grbl, "V", changes)).expect("a machine")
}

fn path(ends: &[([f64; 3], Option<f64>)]) -> CompensatedPath {
    let element = |&(end, feed_mm_per_min)| PathElement {
        side: None,
        shape: Shape::Line,
        end,
        feed_mm_per_min,
        role: Role::None,
        axes: AxisSet::ALL,
        source: Source::default(),
    };
    CompensatedPath { elements: ends.iter().map(element).collect(), ..CompensatedPath::default() }
}

#[track_caller]
fn check(limits: &MachineLimits, path: &CompensatedPath, seconds: f64) {
    let found = CycleTime::new(limits, path, 0, None).advance_to(path, path.elements.len());
    assert!((found - seconds).abs() < 1e-6 * seconds.max(1.0), "{found} s, not {seconds} s");
    // In small slices it is the same, and it never goes back.
    let (mut sliced, mut last) = (CycleTime::new(limits, path, 0, None), 0.0);
    for element in 0..=path.elements.len() {
        while !sliced.advance_within(path, element, 1) {}
        assert!(sliced.seconds() >= last);
        last = sliced.seconds();
    }
    assert!((last - found).abs() < 1e-9, "{last} s in slices, {found} s at once");
}

#[test]
fn one_line_takes_its_ramps_and_its_cruise() {
    let feed = Some(600.0);
    // 10 mm/s at 500 mm/s²: 0.02 s up, 0.02 s down, 0.1 mm each.
    check(&limits(&[]), &path(&[([100.0, 0.0, 0.0], feed)]), 0.04 + 99.8 / 10.0);
    // Straight on nothing is lost.
    check(
        &limits(&[]),
        &path(&[([50.0, 0.0, 0.0], feed), ([100.0, 0.0, 0.0], feed)]),
        0.04 + 99.8 / 10.0,
    );
    // Back again all of it is.
    check(
        &limits(&[]),
        &path(&[([50.0, 0.0, 0.0], feed), ([0.0, 0.0, 0.0], feed)]),
        0.08 + 99.6 / 10.0,
    );
    // Too short for its speed: v² = a l.
    check(&limits(&[]), &path(&[([0.05, 0.0, 0.0], feed)]), 2.0 * 25f64.sqrt() / 500.0);
    // A rapid along the diagonal is as fast as both axes together.
    let rapid = 5_000.0 / 60.0 * 2f64.sqrt();
    let acceleration = 500.0 * 2f64.sqrt();
    let ramp = rapid / acceleration;
    let length = 100.0 * 2f64.sqrt();
    check(&limits(&[]), &path(&[([100.0, 100.0, 0.0], None)]), ramp + length / rapid);
}

#[test]
fn a_corner_is_taken_at_its_junction_speed() {
    let feed = Some(3_000.0);
    let corner = path(&[([100.0, 0.0, 0.0], feed), ([100.0, 100.0, 0.0], feed)]);
    let inward = 500.0 * 2f64.sqrt();
    let sine = 0.5f64.sqrt();
    let junction = (inward * 0.01 * sine / (1.0 - sine)).sqrt();
    let leg = |nominal: f64| {
        let ramps = (2.0 * nominal * nominal - junction * junction) / 1_000.0;
        (2.0 * nominal - junction) / 500.0 + (100.0 - ramps) / nominal
    };
    check(&limits(&[]), &corner, 2.0 * leg(50.0));
}

#[test]
fn the_ring_ends_at_rest_so_that_short_blocks_are_slower_in_a_short_one() {
    // 0.1 mm each, straight on, at 83 mm/s: 14 blocks of look-ahead reach (2 · 500 · 1.5)^½ mm/s.
    let blocks: Vec<_> =
        (1..=2_000).map(|number| ([f64::from(number) * 0.1, 0.0, 0.0], Some(5_000.0))).collect();
    let (line, whole) = (path(&blocks), path(&[([200.0, 0.0, 0.0], Some(5_000.0))]));
    let seconds = |limits: &MachineLimits, path: &CompensatedPath| {
        CycleTime::new(limits, path, 0, None).advance_to(path, path.elements.len())
    };
    let short = limits(&[]);
    let long = MachineLimits { planner_blocks: 100, ..limits(&[]) };
    let cruising = 200.0 / (1_000.0f64 * 1.45).sqrt();
    assert!((seconds(&short, &line) / cruising - 1.0).abs() < 0.03, "{}", seconds(&short, &line));
    let at_once = seconds(&long, &whole);
    assert!((seconds(&long, &line) / at_once - 1.0).abs() < 1e-6, "{}", seconds(&long, &line));
}

#[test]
fn pauses_and_stops_count_once() {
    let mut stops = path(&[([50.0, 0.0, 0.0], Some(600.0)), ([100.0, 0.0, 0.0], Some(600.0))]);
    let event = |at_element, action| PathEvent { at_element, action, source: Source::default() };
    stops.events = vec![
        event(0, Action::SpindleSpeed { rpm: 1_000.0 }),
        event(0, Action::Spindle(SpindleMode::Clockwise)),
        event(0, Action::Dwell { seconds: 2.0 }),
        event(1, Action::Spindle(SpindleMode::Clockwise)),
    ];
    check(&limits(&[]), &stops, 2.0 + 0.04 + 99.8 / 10.0);
    stops.events.push(event(1, Action::SpindleSpeed { rpm: 2_000.0 }));
    check(&limits(&[]), &stops, 2.0 + 0.08 + 99.6 / 10.0);
    // The machine stops where an output is switched; what another control calls so changes nothing.
    let mut switches = stops.clone();
    let port = |words| Action::Auxiliary { letter: 'M', number: 64.0, words };
    switches.events.truncate(4);
    switches.events.push(event(1, port(Words::EMPTY)));
    check(&limits(&[]), &switches, 2.0 + 0.04 + 99.8 / 10.0);
    switches.events.push(event(1, port(Words::new("P1").expect("short"))));
    check(&limits(&[]), &switches, 2.0 + 0.08 + 99.6 / 10.0);
    // A laser goes on.
    check(&limits(&[(32, 1.0)]), &stops, 2.0 + 0.04 + 99.8 / 10.0);
    stops.events.push(event(2, Action::Dwell { seconds: 1.5 }));
    check(&limits(&[]), &stops, 3.5 + 0.08 + 99.6 / 10.0);
}

#[test]
fn an_override_counts_from_where_it_is_set() {
    let line = path(&[([100.0, 0.0, 0.0], Some(600.0)), ([200.0, 0.0, 0.0], Some(600.0))]);
    let mut time = CycleTime::new(&limits(&[]), &line, 0, None);
    let first = time.advance_to(&line, 1);
    time.set_speeds(Speeds { feed: 0.5, rapid: 1.0 });
    let rest = time.advance_to(&line, 2) - first;
    assert!((rest - 20.0).abs() < 0.1, "{rest}");
}

#[test]
fn jerk_makes_ramps_longer_as_grblhal_plans_it() {
    let changes = [(800, 5_000.0), (801, 5_000.0), (802, 5_000.0)];
    let hal = MachineLimits::of(&settings(Firmware::GrblHal, "", &changes)).expect("a machine");
    // 0.1 s to 500 mm/s², 25 mm/s after it: 50 mm/s is reached at once after both ramps.
    check(&hal, &path(&[([100.0, 0.0, 0.0], Some(3_000.0))]), 2.0 * 0.2 + 90.0 / 50.0);
    // 10 mm/s never gets to the acceleration: 10 / (2 (10 / 5000)^½) mm/s².
    let acceleration = 5.0 / (10.0f64 / 5_000.0).sqrt();
    let seconds = 2.0 * 10.0 / acceleration + (100.0 - 100.0 / acceleration) / 10.0;
    check(&hal, &path(&[([100.0, 0.0, 0.0], Some(600.0))]), seconds);
}

#[test]
fn an_arc_is_about_as_long_as_its_chords() {
    let mut circle = path(&[([0.0; 3], Some(600.0))]);
    let arc = Arc { center: [20.0, 0.0, 0.0], plane: Plane::Xy, clockwise: false, turns: 1 };
    circle.elements[0].shape = Shape::Arc(arc);
    let found = CycleTime::new(&limits(&[]), &circle, 0, None).advance_to(&circle, 1);
    let expected = 40.0 * std::f64::consts::PI / 10.0 + 0.02;
    assert!((found / expected - 1.0).abs() < 2e-3, "{found}, about {expected}");
}

#[test]
fn an_axis_without_reported_settings_is_in_doubt_in_paths_that_move_it() {
    let rotary = ControllerSettings { axes: "XYZA".into(), ..settings(Firmware::GrblHal, "", &[]) };
    let limits = MachineLimits::of(&rotary).expect("a machine");
    let turn = FurtherMove { axes: FurtherAxes::NONE.with(0, 90.0), mode: FurtherMode::Along };
    let turn = Action::Further(turn);
    let store = Action::SetWorkOffset {
        system: 2,
        axes: AxisSet::NONE,
        origin: [0.0; 3],
        by_position: false,
    };
    for (actions, is_in_doubt) in [
        (&[][..], false),
        (&[turn], true),
        // `G10 L2 P2 A90` turns nothing.
        (&[turn, store], false),
    ] {
        let mut path = path(&[([10.0, 0.0, 0.0], Some(600.0))]);
        let event = |&action| PathEvent { at_element: 0, action, source: Source::default() };
        path.events = actions.iter().map(event).collect();
        let doubts = CycleTime::doubts(&limits, &path);
        assert_eq!(!doubts.is_empty(), is_in_doubt, "{actions:?}: {doubts:?}");
    }
}
