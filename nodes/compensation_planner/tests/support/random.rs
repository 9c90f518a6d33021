//! Random contours without any sense: what a program can hold at all.

use super::{feed_to, plan_of, sinumerik, tool};
use cnc_msgs::contour::{
    Action, ContourEvent, ContourEventKind, CutterSide, OutsideCorner, ProgrammedContour,
    RadiusSource, Source,
};
use cnc_msgs::geometry::{Arc, Plane, Position, Shape};
use cnc_msgs::path::PathElement;
use cnc_msgs::profile::{Profile, Reaction, Strictness};
use cnc_msgs::text::Words;
use compensation_planner::Plan;
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// So many cases, and more by hand: `PROPTEST_CASES` is 256 when it is not set.
///
/// Failing cases become tests of their own instead of files of seeds.
pub fn config(cases: u32) -> ProptestConfig {
    let usual = ProptestConfig::default();
    ProptestConfig {
        cases: cases.saturating_mul(usual.cases).div_ceil(256),
        failure_persistence: None,
        max_global_rejects: 1_000_000,
        ..usual
    }
}

pub fn run(contour: &ProgrammedContour, profile: &Profile, radius: f64) -> Plan {
    plan_of(contour, profile, &tool(radius))
}

pub fn elements(plan: &Plan) -> &[PathElement] {
    if plan.accepted() { &plan.path.elements } else { &plan.refused }
}

pub fn near(a: Position, b: Position, tolerance: f64) -> bool {
    (0..3).all(|axis| (a[axis] - b[axis]).abs() <= tolerance)
}

/// A random contour: headings turn by these angles, lengths and arcs by these numbers.
#[derive(Debug, Clone)]
pub struct RandomStep {
    pub turn: f64,
    pub length: f64,
    /// Curvature times length, 0 for a line.
    pub bend: f64,
    pub rise: f64,
    pub aux: u8,
}

pub fn step() -> impl Strategy<Value = RandomStep> {
    let turn = prop_oneof![
        4 => -3.1..3.1_f64,
        2 => Just(0.0),
        1 => prop_oneof![Just(3.1), Just(-3.1), Just(PI), Just(1e-7), Just(-1e-5)],
        2 => prop_oneof![Just(FRAC_PI_2), Just(-FRAC_PI_2)],
    ];
    let length = prop_oneof![5 => 0.5..60.0_f64, 1 => Just(1e-5), 1 => Just(0.0), 1 => 1e-4..0.01_f64, 1 => Just(1e3)];
    let bend = prop_oneof![3 => Just(0.0), 2 => -6.0..6.0_f64, 1 => Just(1e-2), 1 => Just(TAU), 1 => Just(-TAU)];
    let rise = prop_oneof![6 => Just(0.0), 1 => -5.0..5.0_f64];
    (turn, length, bend, rise, 0..6_u8).prop_map(|(turn, length, bend, rise, aux)| RandomStep {
        turn,
        length,
        bend,
        rise,
        aux,
    })
}

pub fn random_contour(
    steps: &[RandomStep],
    side: CutterSide,
    corner: OutsideCorner,
) -> ProgrammedContour {
    let mut contour = ProgrammedContour::default();
    let mut line = 0;
    let mut push = |contour: &mut ProgrammedContour, kind, fresh: bool| {
        line += u32::from(fresh);
        let source = Source { line, block: Some(line), column: 1, length: 1, call: 0 };
        contour.events.push(ContourEvent { source, kind });
    };
    push(&mut contour, ContourEventKind::Radius(RadiusSource::Radius(0.0)), true);
    push(&mut contour, ContourEventKind::Corner(corner), false);
    push(&mut contour, ContourEventKind::Select { side, approach: None, along: None }, false);
    push(&mut contour, feed_to(Shape::Line, [0.0, 0.0, 0.0]), false);
    contour.start = [-30.0, if side == CutterSide::Left { 50.0 } else { -50.0 }, 0.0];
    let (mut at, mut heading) = ([0.0_f64; 3], 0.0_f64);
    for (index, step) in steps.iter().enumerate() {
        heading += step.turn;
        let mut end = at;
        end[2] += step.rise;
        let mut shape = Shape::Line;
        if step.bend == 0.0 || step.length == 0.0 {
            end[0] += step.length * heading.cos();
            end[1] += step.length * heading.sin();
        } else {
            let radius = step.length / step.bend.abs();
            let side = step.bend.signum();
            let center = [
                at[0] - radius * side * heading.sin(),
                at[1] + radius * side * heading.cos(),
                at[2],
            ];
            heading += step.bend;
            let is_full = step.bend.abs() == TAU;
            if !is_full {
                end[0] = center[0] + radius * side * heading.sin();
                end[1] = center[1] - radius * side * heading.cos();
            }
            shape = Shape::Arc(Arc {
                center,
                plane: Plane::Xy,
                clockwise: side < 0.0,
                turns: u16::from(is_full),
            });
        }
        push(&mut contour, feed_to(shape, end), true);
        at = end;
        for number in 0..u32::from(step.aux.saturating_sub(3)) {
            let number = f64::from(number + 10 * index as u32);
            let action = Action::Auxiliary { letter: 'M', number, words: Words::EMPTY };
            push(&mut contour, ContourEventKind::Action(action), (number as u32).is_multiple_of(2));
        }
    }
    push(&mut contour, ContourEventKind::Cancel { exit: None }, true);
    push(&mut contour, feed_to(Shape::Line, [at[0] + 40.0, at[1] + 70.0, at[2]]), false);
    contour
}

pub fn free() -> Profile {
    let mut profile = sinumerik();
    profile.interference.react = Reaction::Ignore;
    profile.corner.arc_over_360 = Strictness::Warn;
    profile.off_plane.max_blocks = None;
    profile
}

pub fn in_modes() -> impl Strategy<Value = OutsideCorner> {
    prop_oneof![
        Just(OutsideCorner::Arc),
        Just(OutsideCorner::Intersection),
        Just(OutsideCorner::ExtendByRadius)
    ]
}

pub fn sides() -> impl Strategy<Value = CutterSide> {
    prop_oneof![Just(CutterSide::Left), Just(CutterSide::Right)]
}
