//! The audit of a path: silent about sound ones, and loud about every fault that is put in.

#[path = "../../compensation_planner/tests/support/programs.rs"]
mod support;

use cnc_msgs::contour::{Action, ContourEvent, ContourEventKind, CutterSide, ProgrammedContour};
use cnc_msgs::finding::Code;
use cnc_msgs::geometry::{Plane, Shape};
use cnc_msgs::path::{CompensatedPath, PathElement, Role};
use cnc_msgs::profile::{OutputPoint, Profile};
use cnc_msgs::text::Words;
use cnc_msgs::tool_table::ToolTable;
use path_audit::{Audit, audit, audit_after};
use proptest::prelude::*;
use settings::Control;
use support::*;

/// A program with its path.
struct Planned {
    contour: ProgrammedContour,
    profile: Profile,
    tools: ToolTable,
    path: CompensatedPath,
}

impl Planned {
    fn new(text: &str, profile: Profile, radius_mm: f64) -> Self {
        let (contour, tools) = (contour(text, &profile), tool(radius_mm));
        let plan = plan_of(&contour, &profile, &tools);
        assert!(plan.accepted(), "{}", findings(&plan));
        Self { contour, profile, tools, path: plan.path }
    }

    fn audit(&self, path: &CompensatedPath) -> Audit {
        audit(&self.contour, path, &self.profile, &self.tools)
    }

    /// The codes of the errors that a change of the path brings.
    #[track_caller]
    fn codes_after(&self, change: impl Fn(&mut CompensatedPath)) -> Vec<Code> {
        let mut path = self.path.clone();
        change(&mut path);
        let audit = self.audit(&path);
        let errors = audit.findings.iter().filter(|finding| finding.is_error());
        errors.map(|finding| finding.code).collect()
    }

    #[track_caller]
    fn check(&self, code: Code, change: impl Fn(&mut CompensatedPath)) {
        let codes = self.codes_after(change);
        assert!(codes.contains(&code), "{} is not among {codes:?}", code.name());
    }

    /// The first element of this block and role.
    fn index(&self, block: u32, role: Role) -> usize {
        let is_it = |e: &PathElement| e.source.block == Some(block) && e.role == role;
        self.path.elements.iter().position(is_it).expect("the block is there")
    }
}

fn a6() -> Planned {
    Planned::new(A6, sinumerik(), 5.0)
}

fn remove(path: &mut CompensatedPath, index: usize) {
    path.elements.remove(index);
    for event in &mut path.events {
        event.at_element -= usize::from(event.at_element > index);
    }
}

#[test]
fn a_sound_path_has_no_finding_and_is_counted() {
    let planned = a6();
    let audit = planned.audit(&planned.path);
    assert_eq!(audit.findings, []);
    assert_eq!((audit.elements, audit.spans), (planned.path.elements.len(), 1));
    assert_eq!(audit.events, planned.path.events.len());
    assert_eq!(audit.nearest_mm, None);
}

#[test]
fn a_joint_that_is_moved_is_found() {
    let planned = a6();
    for (index, element) in planned.path.elements.iter().enumerate() {
        if !matches!(element.role, Role::Contour | Role::Corner) {
            continue;
        }
        // Along a tangent joint a smaller move stays on both sides of it.
        for by in [[0.02, 0.0], [0.0, 0.02], [-0.02, 0.0], [0.0, -0.02]] {
            let codes = planned.codes_after(|path| {
                path.elements[index].end[0] += by[0];
                path.elements[index].end[1] += by[1];
            });
            assert!(!codes.is_empty(), "element {index} moved by {by:?}");
        }
    }
}

#[test]
fn a_wrong_radius_is_found() {
    let planned = a6();
    for (radius_mm, code) in [(5.001, Code::Unreachable), (4.999, Code::Gouge)] {
        let other = Planned::new(A6, sinumerik(), radius_mm);
        let codes: Vec<Code> = (planned.audit(&other.path).findings.iter())
            .filter(|finding| finding.is_error())
            .map(|finding| finding.code)
            .collect();
        assert!(codes.contains(&code), "{codes:?}");
    }
}

#[test]
fn a_corner_or_a_block_that_is_left_out_is_found() {
    let planned = a6();
    for (index, element) in planned.path.elements.iter().enumerate() {
        let codes = planned.codes_after(|path| remove(path, index));
        assert!(!codes.is_empty(), "without element {index}, a {}", element.role.name());
    }
}

#[test]
fn a_full_circle_that_is_left_out_is_found() {
    let text = "N10 G0 X30 Y10\nN20 G42 D1 G1 X30 Y30 F600\nN25 G1 X50 Y30\n\
                N30 G3 X50 Y30 I0 J20\nN40 G3 X70 Y50 I0 J20\nN50 G40 G1 X90 Y50";
    let planned = Planned::new(text, rs274(), 5.0);
    let circle = planned.index(30, Role::Contour);
    assert!(matches!(planned.path.elements[circle].shape, Shape::Arc(_)));
    planned.check(Code::Unreachable, |path| remove(path, circle));
    // A turn less, nothing is left of it.
    let codes = planned.codes_after(|path| {
        let Shape::Arc(arc) = &mut path.elements[circle].shape else { unreachable!() };
        arc.turns -= 1;
    });
    assert!(!codes.is_empty());
}

#[test]
fn an_arc_that_leads_to_the_contour_is_the_one_that_its_control_makes() {
    for text in [
        "N10 G0 X0 Y0\nN20 G41 D1\nN30 G3 X20 Y20 I0 J20\nN40 G1 Y60\nN50 G40 X-30",
        "N10 G0 X0 Y0\nN20 G42 D1\nN30 G3 X20 Y20 I0 J20\nN40 G1 X60\nN50 G40 Y0",
        "N10 G0 X0 Y0\nN20 G41 D1\nN30 G2 X-20 Y-20 I0 J-20\nN40 G1 X-60\nN50 G40 Y-60",
    ] {
        let planned = Planned::new(text, rs274(), 5.0);
        let lead = planned.index(30, Role::LeadOn);
        assert_eq!(planned.audit(&planned.path).findings, []);
        let changed = |change: &dyn Fn(&mut PathElement)| {
            planned.codes_after(|path| change(&mut path.elements[lead]))
        };
        // Straight, the other way around, once more around, and about the programmed centre.
        assert!(!changed(&|element| element.shape = Shape::Line).is_empty(), "{text}");
        for what in 0..5 {
            let codes = changed(&|element| {
                let Shape::Arc(arc) = &mut element.shape else { unreachable!("an arc") };
                match what {
                    0 => arc.clockwise = !arc.clockwise,
                    1 => arc.turns += 1,
                    2 => arc.center = [0.0, 20.0, 0.0],
                    3 => arc.center[0] += 1e-3,
                    _ => arc.center[1] += 1e-3,
                }
            });
            assert!(!codes.is_empty(), "{what}: {text}");
        }
        // Aside at its end. Along a tangent joint a smaller move stays on both sides of it.
        for by in [[0.02, 0.0], [0.0, 0.02]] {
            let codes = changed(&|element| {
                element.end[0] += by[0];
                element.end[1] += by[1];
            });
            assert!(!codes.is_empty(), "{by:?}: {text}");
        }
        // The arc that leads another tool, with all that follows.
        let smaller = Planned::new(text, rs274(), 4.999);
        assert!(planned.audit(&smaller.path).refuses(), "{text}");
    }
}

#[test]
fn events_that_are_lost_doubled_or_swapped_are_found() {
    let planned = a6();
    let count = planned.path.events.len();
    for index in 0..count {
        planned.check(Code::PathMismatch, |path| {
            path.events.remove(index);
        });
        planned.check(Code::PathMismatch, |path| path.events.insert(index, path.events[index]));
        for to in [0, 5, path_end(&planned)] {
            if planned.path.events[index].at_element != to {
                planned.check(Code::PathMismatch, |path| path.events[index].at_element = to);
            }
        }
    }
    planned.check(Code::PathMismatch, |path| path.events.swap(0, 1));
    planned.check(Code::PathMismatch, |path| {
        path.events[0].action =
            Action::Auxiliary { letter: 'M', number: 62.0, words: Words::EMPTY };
    });
}

fn path_end(planned: &Planned) -> usize {
    planned.path.elements.len() - 2
}

/// The length of D acts with N15 and with N34 (S34).
#[test]
fn a_length_of_d_that_is_lost_moved_or_changed_is_found() {
    let text = "N5 G0 X0 Y20 Z10\nN10 G1 G41 D1 X0 Y0 F100\nN15 Z-5\nN20 X50\nN30 G40 X50 Y20\n\
        N32 X60\nN34 Z100\nN40 M30";
    let (profile, mut tools) = (sinumerik(), tool(5.0));
    let mut contour = contour(text, &profile);
    for (line, offset) in [(2, Some(1)), (6, None)] {
        let events = &mut contour.events;
        let at = events.iter().position(|event| event.source.line == line).expect("the block");
        let kind =
            ContourEventKind::Action(Action::ToolLength { offset, length_mm: 0.0, second: None });
        events.insert(at, ContourEvent { kind, ..events[at] });
    }
    tools.offsets.entry(1).or_default().radius_mm = 5.0;
    tools.offsets.entry(1).or_default().length_mm = 60.0;
    let plan = plan_of(&contour, &profile, &tools);
    let planned = Planned { contour, profile, tools, path: plan.path };
    assert_eq!(planned.path.events.len(), 3, "{:?}", planned.path.events);
    planned.check(Code::PathMismatch, |path| {
        path.events.remove(0);
    });
    planned.check(Code::PathMismatch, |path| {
        path.events.remove(1);
    });
    planned.check(Code::PathMismatch, |path| path.events.insert(0, path.events[0]));
    for (event, by) in [(0, -1), (0, 1), (1, -1), (1, 1)] {
        planned.check(Code::PathMismatch, |path| {
            path.events[event].at_element = path.events[event].at_element.saturating_add_signed(by);
        });
    }
    let other = Action::ToolLength { offset: Some(1), length_mm: 61.0, second: None };
    planned.check(Code::PathMismatch, |path| path.events[0].action = other);
    assert_eq!(planned.codes_after(|_| ()), []);
}

#[test]
fn numbers_that_are_none_are_found() {
    let planned = a6();
    for index in 0..planned.path.elements.len() {
        planned.check(Code::BadNumber, |path| path.elements[index].end[1] = f64::NAN);
        planned.check(Code::BadNumber, |path| {
            path.elements[index].feed_mm_per_min = Some(f64::INFINITY);
        });
    }
}

#[test]
fn a_centre_that_is_moved_is_found() {
    let planned = a6();
    for index in 0..planned.path.elements.len() {
        let Shape::Arc(_) = planned.path.elements[index].shape else { continue };
        for axis in [0, 1] {
            for by in [1e-3, -1e-3] {
                let codes = planned.codes_after(|path| {
                    let Shape::Arc(arc) = &mut path.elements[index].shape else { return };
                    arc.center[axis] += by;
                });
                let expected = [Code::ArcRadius, Code::Gouge, Code::Unreachable];
                assert!(expected.iter().any(|code| codes.contains(code)), "{index}: {codes:?}");
            }
        }
    }
    planned.check(Code::ArcRadius, |path| {
        let index = planned.index(30, Role::Contour);
        let Shape::Arc(arc) = &mut path.elements[index].shape else { return };
        arc.center[0] += 1e-3;
    });
}

#[test]
fn an_arc_the_other_way_round_is_found() {
    let planned = a6();
    for index in 0..planned.path.elements.len() {
        let Shape::Arc(_) = planned.path.elements[index].shape else { continue };
        planned.check(Code::PathMismatch, |path| {
            let Shape::Arc(arc) = &mut path.elements[index].shape else { return };
            arc.clockwise = !arc.clockwise;
        });
    }
}

#[test]
fn a_path_that_is_not_compensated_is_found() {
    let planned = a6();
    let free = Planned::new(A6, sinumerik(), 0.0);
    planned.check(Code::Gouge, |path| path.elements.clone_from(&free.path.elements));
    planned.check(Code::PathMismatch, |path| {
        for element in &mut path.elements {
            element.role = Role::None;
        }
    });
}

#[test]
fn the_path_of_another_program_is_found() {
    let planned = a6();
    let other = Planned::new(M12, masso(), 5.0);
    planned.check(Code::PathMismatch, |path| path.clone_from(&other.path));
    planned.check(Code::PathMismatch, |path| *path = CompensatedPath::default());
}

#[test]
fn an_element_of_no_block_is_found_wherever_it_is() {
    let planned = a6();
    for index in 0..planned.path.elements.len() {
        planned.check(Code::PathMismatch, |path| path.elements[index].source.line = 1000);
    }
}

/// What an element runs on: a point and a direction, or a centre and a radius.
fn carrier(start: [f64; 3], element: &PathElement) -> ([f64; 2], [f64; 2], f64) {
    match element.shape {
        Shape::Line => {
            let (dx, dy) = (element.end[0] - start[0], element.end[1] - start[1]);
            let length = dx.hypot(dy);
            ([start[0], start[1]], [dx / length, dy / length], 0.0)
        }
        Shape::Arc(arc) => {
            let center = [arc.center[0], arc.center[1]];
            (center, [0.0; 2], (start[0] - center[0]).hypot(start[1] - center[1]))
        }
    }
}

/// The other place where the carriers of two elements that meet in a point cross: that point
/// mirrored in the line through both centres, or in the normal of the line through the centre.
fn other_root(
    a: ([f64; 2], [f64; 2], f64),
    b: ([f64; 2], [f64; 2], f64),
    at: [f64; 2],
) -> Option<[f64; 2]> {
    let ((one, along, is_round), (other, other_along, is_round_too)) = ((a.0, a.1, a.2), b);
    let (origin, axis) = match (is_round > 0.0, is_round_too > 0.0) {
        (true, true) => (one, [other[0] - one[0], other[1] - one[1]]),
        (true, false) => (one, [-other_along[1], other_along[0]]),
        (false, true) => (other, [-along[1], along[0]]),
        (false, false) => return None,
    };
    let length = axis[0].hypot(axis[1]);
    let axis = [axis[0] / length, axis[1] / length];
    let out = [at[0] - origin[0], at[1] - origin[1]];
    let across = axis[0] * out[1] - axis[1] * out[0];
    Some([at[0] + 2.0 * across * axis[1], at[1] - 2.0 * across * axis[0]])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_other_intersection_at_an_inside_corner_is_found_where_it_cuts(
        radii in prop::collection::vec(38.0..60.0_f64, 5..12),
        bends in prop::collection::vec(prop_oneof![1 => Just(0.0), 2 => -0.3..0.3_f64], 12),
        radius in 0.2..4.0_f64,
        is_left in any::<bool>(),
    ) {
        let (count, points) = (radii.len(), ring(&radii));
        let mut bulges = bends[..count].to_vec();
        bulges[0] = 0.0;
        let side = if is_left { CutterSide::Left } else { CutterSide::Right };
        let mut contour = closed_contour(&points, &bulges, side);
        set_radius(&mut contour, radius);
        let (profile, tools) = (sinumerik(), ToolTable::default());
        let plan = plan_of(&contour, &profile, &tools);
        prop_assume!(plan.accepted());
        for index in 1..plan.path.elements.len() {
            let [a, b] = [&plan.path.elements[index - 1], &plan.path.elements[index]];
            if (a.role, b.role) != (Role::Contour, Role::Contour) {
                continue;
            }
            let carriers = [
                carrier(plan.path.start_of(index - 1), a),
                carrier(plan.path.start_of(index), b),
            ];
            let at = [a.end[0], a.end[1]];
            let Some(other) = other_root(carriers[0], carriers[1], at) else { continue };
            // After the joint the element before it would continue into the next one.
            let start = plan.path.start_of(index - 1);
            let (ahead, moved) = ([at[0] - start[0], at[1] - start[1]], [other[0] - at[0], other[1] - at[1]]);
            let cuts = ahead[0] * moved[0] + ahead[1] * moved[1] > 0.0;
            // So far apart that the way between is deeper than a gouge may be.
            if !cuts || moved[0].hypot(moved[1]) <= 0.5 {
                continue;
            }
            let mut path = plan.path.clone();
            (path.elements[index - 1].end[0], path.elements[index - 1].end[1]) = (other[0], other[1]);
            let found = audit(&contour, &path, &profile, &tools);
            prop_assert!(found.refuses(), "joint {index} at {other:?} instead of {at:?}");
        }
    }
}

#[test]
fn what_every_control_accepts_is_sound() {
    const BLOCKS: &str = "
        N10 T1 M6
        N20 G0 X-50 Y-25
        N30 M3 S1000
        N40 G41 D1
        N50 G1 X-25 F200
        N60 X100
        N70 G2 X110 Y-35 J-10
        N80 G1 Y-100
        N90 G2 X100 Y-110 I-10
        N100 G1 X25
        N110 Y25
        N120 G40
        N130 X25 Y50
        N140 M30";
    // These two are written in their own words; their rules are tried on the same events.
    for control in Control::ALL {
        let mut profile = control.profile().expect("a shipped profile");
        let reader = match control {
            Control::Automation1 | Control::OspLathe => sinumerik(),
            Control::Rs274 | Control::Masso | Control::Sinumerik840c | Control::Nct => {
                profile.clone()
            }
        };
        profile.language.planes.rule = vec![Plane::Xy];
        for radius in [0.0, 0.5, 4.0, 5.0] {
            for output in [OutputPoint::Center, OutputPoint::Tip] {
                for tip in [0, 3, 9] {
                    profile.output = output;
                    let mut tools = tool(radius);
                    for tool in tools.tools.values_mut() {
                        tool.tip_direction = tip;
                    }
                    for offset in tools.offsets.values_mut() {
                        offset.tip_direction = tip;
                    }
                    let contour = contour(BLOCKS, &reader);
                    let plan = plan_of(&contour, &profile, &tools);
                    assert!(plan.accepted(), "{control} {radius}: {}", findings(&plan));
                    let said = &plan.findings;
                    let new = audit_after(&contour, &plan.path, &profile, &tools, said).findings;
                    assert_eq!(new, [], "{control} {radius} {output:?} {tip}");
                }
            }
        }
    }
}
