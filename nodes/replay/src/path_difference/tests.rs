//! Paths that differ, and equal paths that are split differently.

use super::*;
use cnc_msgs::contour::Action;
use cnc_msgs::geometry::{Arc, AxisSet};
use cnc_msgs::path::{PathEvent, Role};

fn line(line: u32, x: f64, y: f64) -> PathElement {
    PathElement {
        shape: Shape::Line,
        end: [x, y, 0.0],
        feed_mm_per_min: Some(100.0),
        role: Role::None,
        side: None,
        axes: AxisSet::NONE,
        source: Source { line, ..Default::default() },
    }
}

/// An arc about (0, 0) that ends at this angle, rad, on a circle of 10 mm.
fn arc(source: u32, angle: f64, turns: u16) -> PathElement {
    let arc = Arc { center: [0.0; 3], plane: Plane::Xy, clockwise: false, turns };
    PathElement { shape: Shape::Arc(arc), ..line(source, 10.0 * angle.cos(), 10.0 * angle.sin()) }
}

fn path(elements: Vec<PathElement>) -> CompensatedPath {
    CompensatedPath { elements, ..Default::default() }
}

/// On the circle of 10 mm from (10, 0).
fn round(elements: Vec<PathElement>) -> CompensatedPath {
    CompensatedPath { start: [10.0, 0.0, 0.0], ..path(elements) }
}

#[track_caller]
fn divergence(recorded: &CompensatedPath, now: &CompensatedPath) -> Divergence {
    match likeness(recorded, now) {
        Likeness::Diverges(divergence) => divergence,
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_first_place_where_paths_part_is_found() {
    let recorded = path(vec![line(7, 1.0, 0.0), line(8, 2.0, 0.0)]);
    assert_eq!(likeness(&recorded, &recorded), Likeness::Same);
    // A nanometre is no difference, nor is a tenth of one.
    let nearly = path(vec![line(7, 1.0, 0.0), line(8, 2.0, 9e-7)]);
    assert_eq!(likeness(&recorded, &nearly), Likeness::Same);
    let found = divergence(&recorded, &path(vec![line(7, 1.0, 0.0), line(8, 2.0, 0.001)]));
    assert_eq!((found.line, found.distance_mm), (8, Some(0.001)));
    assert!(found.text.contains("ended at X2.000000 Y0.000000 Z0.000000"), "{}", found.text);
    let place = found.place().text();
    assert!(place.contains("0.001000 mm apart"), "{place}");
    let found = divergence(&recorded, &path(vec![line(7, 1.0, 0.0)]));
    assert!(found.text.contains("2 elements and are 1 now"), "{}", found.text);
    assert_eq!(found.line, 8);
    let mut moved = recorded.clone();
    moved.start = [9.0, 0.0, 0.0];
    assert!(divergence(&recorded, &moved).text.contains("the path began at"));
    let mut nowhere = recorded.clone();
    nowhere.elements[1].end[1] = f64::NAN;
    assert_eq!(divergence(&nowhere, &nowhere).line, 8, "NaN never equals anything");
}

#[test]
fn the_same_curve_in_other_elements_is_the_same_curve() {
    let other = |recorded, now| Likeness::OtherElements { recorded, now };
    let whole = path(vec![line(7, 10.0, 0.0), line(8, 10.0, 5.0)]);
    let parts = path(vec![line(7, 4.0, 0.0), line(7, 10.0, 0.0), line(8, 10.0, 5.0)]);
    assert_eq!(likeness(&whole, &parts), other(2, 3));
    assert_eq!(likeness(&parts, &whole), other(3, 2));
    let elsewhere = path(vec![line(7, 6.0, 0.0), line(7, 10.0, 0.0), line(8, 10.0, 5.0)]);
    assert_eq!(likeness(&parts, &elsewhere), other(3, 3));
    // Arcs: a quarter, and two eighths; a whole turn, and three thirds.
    let eighths = round(vec![arc(7, TAU / 8.0, 0), arc(7, TAU / 4.0, 0)]);
    assert_eq!(likeness(&round(vec![arc(7, TAU / 4.0, 0)]), &eighths), other(1, 2));
    let thirds = round((1..=3).map(|k| arc(7, TAU * f64::from(k) / 3.0, 0)).collect());
    let mut turn = round(vec![arc(7, 0.0, 1)]);
    assert_eq!(likeness(&turn, &thirds), other(1, 3));
    // An additional turn is a different path, even if it is split at the same places.
    turn.elements[0] = arc(7, 0.0, 2);
    assert!(divergence(&turn, &thirds).text.contains("mm long"));
}

use std::f64::consts::TAU;

/// A circle in chords that are closer to it than `error_mm`.
fn chords(error_mm: f64) -> CompensatedPath {
    let count = (TAU / (2.0 * (1.0 - error_mm / 10.0).acos())).ceil() as u32;
    let end = |k: u32| TAU * f64::from(k) / f64::from(count);
    round((1..=count).map(|k| line(7, 10.0 * end(k).cos(), 10.0 * end(k).sin())).collect())
}

#[test]
fn chords_are_the_same_curve_as_other_chords_only_within_the_tolerance() {
    let fine = chords(4e-7);
    assert!(matches!(likeness(&fine, &chords(3e-7)), Likeness::OtherElements { .. }));
    let found = divergence(&fine, &chords(1e-4));
    let far = found.distance_mm.expect("a distance");
    assert!((far - 1e-4).abs() < 3e-6, "{far}");
    // Within the tolerance, but of another kind: the machine gets other commands.
    assert!(divergence(&round(vec![arc(7, 0.0, 1)]), &fine).text.contains("is a line"));
}

#[test]
fn an_element_of_another_kind_feed_side_or_block_is_another_path() {
    let recorded = path(vec![line(7, 1.0, 0.0)]);
    type Change = fn(&mut PathElement);
    let changes: [(&str, Change); 9] = [
        ("rapid", |it| it.feed_mm_per_min = None),
        ("F101", |it| it.feed_mm_per_min = Some(101.0)),
        ("F100.000010", |it| it.feed_mm_per_min = Some(100.000_01)),
        ("contour", |it| it.role = Role::Contour),
        ("line 8", |it| it.source.line = 8),
        ("line 7 N60", |it| it.source.block = Some(60)),
        ("column 5, 0 long", |it| it.source.column = 5),
        ("axes XZ", |it| it.axes = AxisSet::from_bits(5)),
        ("left", |it| it.side = Some(CutterSide::Left)),
    ];
    for (says, change) in changes {
        let mut now = recorded.clone();
        change(&mut now.elements[0]);
        let found = divergence(&recorded, &now);
        assert!(found.text.contains(says), "{}", found.text);
    }
}

#[test]
fn events_along_the_path_are_compared_with_their_places() {
    let stop = |at_element| PathEvent {
        at_element,
        action: Action::ExactStop,
        source: Source { line: 8, ..Default::default() },
    };
    let mut recorded = path(vec![line(7, 10.0, 0.0), line(8, 10.0, 5.0)]);
    recorded.events = vec![stop(1)];
    let mut now = path(vec![line(7, 4.0, 0.0), line(7, 10.0, 0.0), line(8, 10.0, 5.0)]);
    now.events = vec![stop(2)];
    assert!(matches!(likeness(&recorded, &now), Likeness::OtherElements { .. }));
    now.events = vec![stop(1)];
    assert!(divergence(&recorded, &now).text.contains("was at X10.000000"));
    now.events = vec![stop(2), stop(3)];
    assert!(divergence(&recorded, &now).text.contains("was added"));
    now.events = Vec::new();
    assert!(divergence(&recorded, &now).text.contains("was removed"));
}

#[test]
fn a_helix_is_the_same_in_one_turn_or_two() {
    let helix = |ends: &[(f64, f64)]| {
        let element = |&(angle, z): &(f64, f64)| {
            let mut element = arc(7, angle, 0);
            element.end[2] = z;
            element
        };
        round(ends.iter().map(element).collect())
    };
    let half = TAU / 2.0;
    let whole = {
        let mut whole = helix(&[(0.0, -4.0)]);
        whole.elements[0].shape = arc(7, 0.0, 1).shape;
        whole
    };
    let halves = helix(&[(half, -2.0), (TAU, -4.0)]);
    assert!(matches!(likeness(&whole, &halves), Likeness::OtherElements { .. }));
    let steep = helix(&[(half, -2.5), (TAU, -4.0)]);
    assert!(divergence(&whole, &steep).distance_mm.expect("a distance") > 0.4);
}
