//! Functions and feeds of a program along its path: each once, in order, and where it belongs.

mod support;

use cnc_msgs::contour::{Action, ContourEventKind, ProgrammedContour, Source};
use cnc_msgs::geometry::Shape;
use cnc_msgs::path::{CompensatedPath, PathElement, Role};
use compensation_planner::{Plan, tessellate};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use support::opened::{Opened, shapes};
use support::outline::closed_part;
use support::random::{config, near, run};
use support::shapes::{closed, vertices};
use support::*;

/// What the program says in and before the block of an edge.
#[derive(Debug, Clone)]
struct Words {
    feed: Option<u32>,
    /// In the block itself.
    has_function: bool,
    /// Blocks before it: functions, and moves out of the plane where it says so.
    before: Vec<bool>,
}

fn words() -> impl Strategy<Value = Words> {
    let before = prop_oneof![3 => Just(vec![]), 1 => prop::collection::vec(any::<bool>(), 1..3)];
    (prop::option::of(10..5000_u32), any::<bool>(), before)
        .prop_map(|(feed, has_function, before)| Words { feed, has_function, before })
}

/// The shape as a program with functions, feeds and moves out of the plane.
fn program(shape: &Opened, mode: &str, words: &[Words]) -> String {
    let mut words = words.iter().cycle();
    let mut number = 100;
    let mut text = String::new();
    let plain = shape.program().replace("D1", &format!("D1 {mode}"));
    let count = plain.lines().count();
    for (index, line) in plain.lines().enumerate() {
        let is_edge = (2..count - 1).contains(&index);
        let Some(words) = words.next().filter(|_| is_edge) else {
            text += &format!("{line}\n");
            continue;
        };
        for moves in &words.before {
            number += 1;
            text += &if *moves { format!("G1 Z-{number}\n") } else { format!("M{number}\n") };
        }
        text += line;
        if let Some(feed) = words.feed {
            text += &format!(" F{feed}");
        }
        if words.has_function {
            number += 1;
            text += &format!(" H{number}");
        }
        text += "\n";
    }
    text
}

/// The feed of each block with motion, mm/min: its own, or the last one before it.
fn feeds(contour: &ProgrammedContour) -> BTreeMap<u32, Option<f64>> {
    let feed = |event: &cnc_msgs::contour::ContourEvent| match event.kind {
        ContourEventKind::Motion(motion) => {
            Some((event.source.line, Some(motion.feed_mm_per_min).filter(|feed| *feed > 0.0)))
        }
        _ => None,
    };
    contour.events.iter().filter_map(feed).collect()
}

fn starts(contour: &ProgrammedContour) -> BTreeMap<u32, [f64; 3]> {
    let mut at = contour.start;
    let mut starts = BTreeMap::new();
    for event in &contour.events {
        if let ContourEventKind::Motion(motion) = event.kind {
            starts.insert(event.source.line, at);
            at = motion.end;
        }
    }
    starts
}

/// Whether something is generated between two blocks, and for which one.
fn generated(path: &CompensatedPath, index: usize) -> Option<Source> {
    let element = path.elements.get(index)?;
    (element.role == Role::Corner).then_some(element.source)
}

/// A shape with these words, with a tool of a part of its clearance.
fn planned(shape: &Opened, is_arc: bool, words: &[Words], part: f64) -> (ProgrammedContour, Plan) {
    let mode = if is_arc { "G450" } else { "G451" };
    let contour = contour(&program(shape, mode, words), &sinumerik());
    let plan = run(&contour, &sinumerik(), part * shape.clearance_mm);
    (contour, plan)
}

proptest! {
    #![proptest_config(config(80))]

    #[test]
    fn p12_functions_come_once_in_order_and_none_in_generated_blocks(
        shape in shapes(),
        part in 0.01..0.99_f64,
        is_arc in any::<bool>(),
        words in prop::collection::vec(words(), 30),
    ) {
        let (contour, plan) = planned(&shape, is_arc, &words, part);
        // A corner that is not an arc may cut where the arc does not.
        prop_assume!(plan.accepted() || is_arc);
        let actions = |event: &cnc_msgs::contour::ContourEvent| match event.kind {
            ContourEventKind::Action(action) => Some((action, event.source)),
            _ => None,
        };
        let programmed: Vec<(Action, Source)> = contour.events.iter().filter_map(actions).collect();
        let path = &plan.path;
        let got: Vec<_> = path.events.iter().map(|event| (event.action, event.source)).collect();
        prop_assert_eq!(got, programmed);
        let mut last = 0;
        for event in &path.events {
            let at = event.at_element;
            prop_assert!(at >= last && at <= path.elements.len(), "{event:?} after {last}");
            last = at;
            // Not between two generated elements of one corner; before them only what stands
            // before the block that they belong to, after them only what stands in it.
            if let Some(corner) = generated(path, at) {
                prop_assert!(event.source.line < corner.line, "{event:?} before {corner:?}");
            }
            let before = at.checked_sub(1).and_then(|before| generated(path, before));
            if let Some(corner) = before {
                prop_assert!(generated(path, at) != Some(corner), "{event:?} in {corner:?}");
                prop_assert!(event.source.line >= corner.line, "{event:?} after {corner:?}");
            }
        }
    }

    #[test]
    fn p15_every_element_has_the_feed_of_its_block_and_a_corner_that_of_the_next(
        shape in shapes(),
        part in 0.01..0.99_f64,
        is_arc in any::<bool>(),
        words in prop::collection::vec(words(), 30),
    ) {
        let (contour, plan) = planned(&shape, is_arc, &words, part);
        prop_assume!(plan.accepted() || is_arc);
        let (path, feeds, starts) = (&plan.path, feeds(&contour), starts(&contour));
        for (index, element) in path.elements.iter().enumerate() {
            let line = element.source.line;
            let own = feeds[&line];
            prop_assert_eq!(element.feed_mm_per_min, own, "{:?}", element);
            if element.role != Role::Corner {
                continue;
            }
            // The corner is at the start of the block that it belongs to.
            let vertex = starts[&line];
            if let Shape::Arc(arc) = element.shape {
                let center = [arc.center[0], arc.center[1], vertex[2]];
                prop_assert!(near(center, vertex, 1e-9), "{element:?} is not at {vertex:?}");
            }
            let next = path.elements[index..].iter().find(|next| next.role == Role::Contour);
            prop_assert!(next.is_some_and(|next| next.source == element.source), "{element:?}");
        }
    }
}

/// The time along the contour, min.
fn minutes(path: &CompensatedPath) -> f64 {
    let minutes = |(start, element): ([f64; 3], &PathElement)| {
        let (dx, dy) = (element.end[0] - start[0], element.end[1] - start[1]);
        let length = match element.shape {
            Shape::Line => dx.hypot(dy),
            Shape::Arc(arc) => {
                let radius = (start[0] - arc.center[0]).hypot(start[1] - arc.center[1]);
                radius * tessellate::sweep(start, &arc, element.end)
            }
        };
        length / element.feed_mm_per_min.unwrap()
    };
    closed_part(path).map(minutes).sum()
}

proptest! {
    #![proptest_config(config(200))]

    /// Around a convex boss nothing is longer than it is written but for the corners.
    #[test]
    fn p15_the_time_around_a_boss_is_that_of_its_edges_and_of_corners_at_the_next_feed(
        jitters in prop::collection::vec(-0.8..0.8_f64, 3..12),
        feeds in prop::collection::vec(10..5000_u32, 13),
        radius in 0.1..20.0_f64,
    ) {
        let corners: Vec<(f64, f64)> = jitters.into_iter().map(|jitter| (50.0, jitter)).collect();
        let text = closed(&corners, &[0.0], "G42").replace("X0 Y0", "X900 Y900");
        let lines = text.lines().enumerate().map(|(index, line)| match feeds.get(index.wrapping_sub(2)) {
            Some(feed) => format!("{line} F{feed}\n"),
            None => format!("{line}\n"),
        });
        let contour = contour(&lines.collect::<String>(), &around());
        let plan = run(&contour, &around(), radius);
        prop_assert!(plan.accepted(), "{}", findings(&plan));
        let points: Vec<[f64; 2]> = vertices(&corners, &[0.0]).iter().map(|vertex| vertex.0).collect();
        let edge = |index: usize| {
            let (a, b) = (points[index % points.len()], points[(index + 1) % points.len()]);
            [b[0] - a[0], b[1] - a[1]]
        };
        let expected: f64 = (0..points.len()).map(|index| {
            let (before, edge) = (edge(index + points.len() - 1), edge(index));
            let turn = edge[1].atan2(edge[0]) - before[1].atan2(before[0]);
            // Where the contour is entered it does not turn.
            let turn = if index == 0 { 0.0 } else { turn.rem_euclid(2.0 * PI) };
            (edge[0].hypot(edge[1]) + radius * turn) / f64::from(feeds[index])
        }).sum();
        let found = minutes(&plan.path);
        prop_assert!((found - expected).abs() < 1e-9 * expected, "{found}, not {expected} min");
    }
}

/// No corner is so short that it is left out (S68).
fn around() -> cnc_msgs::profile::Profile {
    let mut profile = sinumerik();
    profile.corner.short_block_mm = 0.0;
    profile
}
