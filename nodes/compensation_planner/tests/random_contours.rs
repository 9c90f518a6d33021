//! What holds for every contour, however absurd.

mod support;

use cnc_msgs::contour::{
    Action, ContourEventKind, CutterSide, Motion, OutsideCorner, ProgrammedContour,
};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::path::{PathElement, Role};
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::Plan;
use proptest::prelude::*;
use support::outline::along;
use support::random::{config, elements, free, in_modes, random_contour, run, sides, step};
use support::*;

fn check_elements(start: Position, elements: &[PathElement]) -> Result<(), TestCaseError> {
    let mut at = start;
    for element in elements {
        let finite = element.end.iter().all(|value| value.is_finite());
        prop_assert!(finite, "{element:?}");
        let moved = (0..3).any(|axis| (at[axis] - element.end[axis]).abs() > 1e-7);
        match element.shape {
            Shape::Line => {
                prop_assert!(moved || element.role == Role::None, "{element:?} at {at:?}")
            }
            Shape::Arc(arc) => {
                prop_assert!(moved || arc.turns > 0, "{element:?} at {at:?}");
                let out = |p: Position| (p[0] - arc.center[0]).hypot(p[1] - arc.center[1]);
                prop_assert!(out(at).is_finite() && out(at) > 0.0);
                let off = (out(at) - out(element.end)).abs();
                prop_assert!(off < 3e-3 + 1e-9 * out(at), "off {off} {element:?} at {at:?}");
            }
        }
        at = element.end;
    }
    Ok(())
}

proptest! {
    #![proptest_config(config(2000))]

    #[test]
    fn p13_absurd_contours_give_finite_chained_paths(steps in prop::collection::vec(step(), 1..14), side in sides(), corner in in_modes(), radius in prop_oneof![0.01..20.0_f64, Just(-5.0), Just(0.0), Just(1000.0)]) {
        let mut contour = random_contour(&steps, side, corner);
        set_radius(&mut contour, radius);
        let plan = run(&contour, &free(), 0.0);
        check_elements(contour.start, elements(&plan))?;
    }

    #[test]
    fn p12_every_action_comes_once_and_in_order(steps in prop::collection::vec(step(), 1..14), side in sides(), corner in in_modes(), radius in 0.01..20.0_f64) {
        let mut contour = random_contour(&steps, side, corner);
        set_radius(&mut contour, radius);
        let mut plan = run(&contour, &free(), 0.0);
        let programmed: Vec<Action> = contour.events.iter().filter_map(|event| match event.kind {
            ContourEventKind::Action(action) => Some(action),
            _ => None,
        }).collect();
        if !plan.accepted() {
            // The events of what is refused are not kept; a small tool is never refused.
            let mut small = contour.clone();
            set_radius(&mut small, 1e-7);
            plan = run(&small, &free(), 0.0);
        }
        prop_assume!(plan.accepted());
        let got: Vec<Action> = plan.path.events.iter().map(|event| event.action).collect();
        prop_assert_eq!(got, programmed);
        prop_assert!(plan.path.events.windows(2).all(|pair| pair[0].at_element <= pair[1].at_element));
    }

    #[test]
    fn p5_a_negative_radius_is_the_other_side(steps in prop::collection::vec(step(), 1..10), corner in in_modes(), radius in 0.01..20.0_f64) {
        let mut left = random_contour(&steps, CutterSide::Left, corner);
        let mut right = left.clone();
        right.events[2].kind = ContourEventKind::Select { side: CutterSide::Right, approach: None, along: None };
        set_radius(&mut left, radius);
        set_radius(&mut right, -radius);
        let (left, right) = (run(&left, &free(), 0.0), run(&right, &free(), 0.0));
        prop_assert_eq!(elements(&left), elements(&right));
    }

    #[test]
    fn p1_every_point_is_the_radius_away_from_its_own_block(steps in prop::collection::vec(step(), 1..10), side in sides(), radius in 0.1..10.0_f64) {
        let mut contour = random_contour(&steps, side, OutsideCorner::Arc);
        set_radius(&mut contour, radius);
        let plan = run(&contour, &free(), 0.0);
        if !plan.accepted() {
            return Ok(());
        }
        let mut programmed = std::collections::BTreeMap::new();
        let mut at = contour.start;
        for event in &contour.events {
            if let ContourEventKind::Motion(motion) = event.kind {
                programmed.insert(event.source.line, (at, motion));
                at = motion.end;
            }
        }
        for (index, element) in plan.path.elements.iter().enumerate() {
            if !matches!(element.role, Role::Contour | Role::Corner) {
                continue;
            }
            let start = plan.path.start_of(index);
            let (from, motion) = programmed[&element.source.line];
            let length = (motion.end[0] - from[0]).hypot(motion.end[1] - from[1]);
            let is_full = matches!(motion.shape, Shape::Arc(arc) if arc.turns > 0);
            if length < 0.05 && !is_full && element.role == Role::Contour {
                // Merged with its neighbours: its own direction means nothing.
                continue;
            }
            for part in [0.0, 0.3, 0.7, 1.0] {
                let point = along(start, element, part);
                let distance = if element.role == Role::Corner {
                    (point[0] - from[0]).hypot(point[1] - from[1])
                } else {
                    off_carrier(point, from, &motion)
                };
                // Twice what merging and acceptance may move it.
                prop_assert!((distance - radius).abs() < 2.0 * 0.0021, "{distance} {element:?}");
            }
        }
    }
}

/// The distance from the whole line or circle of a motion.
fn off_carrier(point: Position, start: Position, motion: &Motion) -> f64 {
    match motion.shape {
        Shape::Line => {
            let (dx, dy) = (motion.end[0] - start[0], motion.end[1] - start[1]);
            let cross = dx * (point[1] - start[1]) - dy * (point[0] - start[0]);
            (cross / dx.hypot(dy)).abs()
        }
        Shape::Arc(arc) => {
            let radius = (start[0] - arc.center[0]).hypot(start[1] - arc.center[1]);
            ((point[0] - arc.center[0]).hypot(point[1] - arc.center[1]) - radius).abs()
        }
    }
}

#[test]
fn an_empty_program_is_an_empty_path() {
    let plan =
        compensation_planner::plan(&ProgrammedContour::default(), &rs274(), &ToolTable::default());
    assert_eq!(plan, Plan::default());
}
