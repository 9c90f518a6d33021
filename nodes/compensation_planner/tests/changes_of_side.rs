//! Straight from one side of the contour to the other, where both offsets meet (O02): wherever
//! that is, planner and audit both report a tool that cuts the programmed line.

mod support;

use cnc_msgs::finding::{Code, Severity};
use cnc_msgs::geometry::Shape;
use cnc_msgs::path::{PathElement, Role};
use compensation_planner::{Plan, Planning, Verdict, judge};
use std::f64::consts::{PI, TAU};
use support::{contour, finding, findings, profile, tool};

const RADIUS_MM: f64 = 3.0;

/// A leg of the contour: its block, and points along it.
struct Leg {
    block: String,
    points: Vec<[f64; 2]>,
}

/// A line, or an arc of 60 degrees, from a point in a direction; where it ends, and how.
fn leg(from: [f64; 2], heading: f64, bend: f64) -> (Leg, [f64; 2], f64) {
    let length = 40.0;
    let steps = 400;
    let at = |along: f64| -> [f64; 2] {
        if bend == 0.0 {
            return [from[0] + along * heading.cos(), from[1] + along * heading.sin()];
        }
        let turned = heading + along * bend;
        [
            from[0] + (turned.sin() - heading.sin()) / bend,
            from[1] - (turned.cos() - heading.cos()) / bend,
        ]
    };
    let points: Vec<[f64; 2]> =
        (0..=steps).map(|step| at(length * f64::from(step) / f64::from(steps))).collect();
    let end = points[steps as usize];
    let block = if bend == 0.0 {
        format!("G1 X{:.6} Y{:.6}", end[0], end[1])
    } else {
        let word = if bend > 0.0 { "G3" } else { "G2" };
        let (i, j) = (-heading.sin() / bend, heading.cos() / bend);
        format!("{word} X{:.6} Y{:.6} I{i:.6} J{j:.6}", end[0], end[1])
    };
    (Leg { block, points }, end, heading + length * bend)
}

/// Points along an element.
fn sampled(start: [f64; 3], element: &PathElement) -> Vec<[f64; 2]> {
    let parts = (0..=400).map(|part| f64::from(part) / 400.0);
    let end = element.end;
    match element.shape {
        Shape::Line => {
            let at = |axis: usize, part: f64| start[axis] + (end[axis] - start[axis]) * part;
            parts.map(|part| [at(0, part), at(1, part)]).collect()
        }
        Shape::Arc(arc) => {
            let out = |at: [f64; 3]| [at[0] - arc.center[0], at[1] - arc.center[1]];
            let ([ax, ay], [bx, by]) = (out(start), out(end));
            let turn = if arc.clockwise { -1.0 } else { 1.0 };
            let sweep =
                turn * (turn * (bx * -ay + by * ax).atan2(ax * bx + ay * by)).rem_euclid(TAU);
            let at = |part: f64| {
                let (sin, cos) = (sweep * part).sin_cos();
                [arc.center[0] + ax * cos - ay * sin, arc.center[1] + ax * sin + ay * cos]
            };
            parts.map(at).collect()
        }
    }
}

/// How near the tool comes to a leg on its way along the contour.
fn nearest(plan: &Plan, points: &[[f64; 2]]) -> f64 {
    let mut start = plan.path.start;
    let mut least = f64::INFINITY;
    for element in &plan.path.elements {
        if element.role == Role::Contour {
            for at in sampled(start, element) {
                for point in points {
                    least = least.min((at[0] - point[0]).hypot(at[1] - point[1]));
                }
            }
        }
        start = element.end;
    }
    least
}

#[test]
fn no_change_of_side_cuts_without_a_word() {
    let profile = profile("nct");
    let tools = tool(RADIUS_MM);
    let (mut reported, mut refused) = (0, 0);
    for turn in (-170..=170).step_by(10) {
        for [bend, next_bend] in [[0.0, 1.0], [1.0, 0.0], [1.0, -1.0], [1.0, 1.0], [0.0, 0.0]] {
            for side in [1.0, -1.0] {
                let bends = [bend, next_bend].map(|it: f64| side * it * PI / 3.0 / 40.0);
                let (before, joint, heading) = leg([0.0, 0.0], 0.0, bends[0]);
                let heading = heading + f64::from(turn).to_radians();
                let (after, _, _) = leg(joint, heading, bends[1]);
                let text = format!(
                    "G0 X0 Y20\nG41 D1 G1 X0 Y0 F100\n{}\nG42 {}\nG40 G1 X300 Y300\nM30",
                    before.block, after.block
                );
                let contour = contour(&text, &profile);
                let Verdict { plan, disagreement, .. } =
                    judge(&contour, &profile, &tools, Planning::default());
                assert_eq!(disagreement, None, "{text}\n{}", findings(&plan));
                if !plan.accepted() {
                    refused += 1;
                    continue;
                }
                let near = nearest(&plan, &before.points).min(nearest(&plan, &after.points));
                let alone = compensation_planner::plan(&contour, &profile, &tools);
                let is_reported = alone.findings.iter().any(|it| it.code == Code::LinkGouge);
                assert!(
                    is_reported || near > RADIUS_MM - 0.06,
                    "{near} {text}\n{}",
                    findings(&plan)
                );
                // The audit sees it by itself.
                let audited = path_audit::audit(&contour, &plan.path, &profile, &tools);
                let is_seen = audited.findings.iter().any(|it| it.code == Code::LinkGouge);
                assert_eq!(is_seen, is_reported, "{text}\n{:?}", audited.findings);
                reported += u32::from(is_reported);
            }
        }
    }
    assert!(reported > 100, "{reported} are reported, {refused} are refused");
}

#[test]
fn a_tangent_joint_between_two_sides_is_reported_with_its_depth() {
    let text = "G0 X-40 Y30\nG41 D1 G1 X-40 Y0 F100\nX0\nG42 G3 X0 Y60 I0 J30\nG40 G1 X0 Y90\nM30";
    let profile = profile("nct");
    let contour = contour(text, &profile);
    let plan = compensation_planner::plan(&contour, &profile, &tool(RADIUS_MM));
    let cut = finding(&plan, Code::LinkGouge);
    assert_eq!((cut.severity, cut.depth_mm), (Severity::Warning, Some(RADIUS_MM)));
}

/// The last arc of a closed contour is lengthened to the offset of the other side, and cuts the
/// first block on its way there: that belongs to the change.
#[test]
fn what_an_arc_is_lengthened_by_belongs_to_the_change_of_side() {
    let text = "G0 X-0.151 Y1.201\nG42 D1 G1 X0 Y0 F600\nG1 X-19.611 Y-2.466\n\
                G1 X-1.149 Y-16.185\nG1 X0.893 Y-0.9\nG3 X0 Y0 I-0.793 J0.106\n\
                G41 G1 X3.449 Y6.58\nG40 G1 X1.669 Y7.513\nM30";
    let nct = profile("nct");
    let contour = contour(text, &nct);
    let Verdict { plan, disagreement, .. } = judge(&contour, &nct, &tool(1.0), Planning::default());
    assert_eq!(disagreement, None, "{}", findings(&plan));
    assert!(plan.accepted(), "{}", findings(&plan));
    let links = plan.findings.iter().filter(|found| found.code == Code::LinkGouge);
    let others: Vec<u32> = links.filter_map(|found| Some(found.other?.line)).collect();
    assert!(others.contains(&3), "{}", findings(&plan));
}

/// A block next to a change of side that is too short for the tool is straightened within the
/// accepted tolerance, with the block that continues it: both contours end where these offsets
/// meet.
#[test]
fn a_short_block_next_to_a_change_of_side_counts_with_its_neighbour() {
    let nct = profile("nct");
    for [before, after] in [
        ["G1 X40 Y0", "G42 G1 X39.984 Y0.012\nG1 X-0.536 Y34.666"],
        ["G1 X40 Y0\nG1 X40.016 Y-0.0013", "G42 G1 X80.536 Y34.666"],
        ["G1 X40 Y0\nG1 X40.016 Y-0.0013", "G42 G1 X40 Y0.0107\nG1 X-0.536 Y34.666"],
    ] {
        let text = format!("G0 X0 Y20\nG41 D1 G1 X0 Y0 F100\n{before}\n{after}\nG40 G1 Y70\nM30");
        let contour = contour(&text, &nct);
        let Verdict { plan, disagreement, .. } =
            judge(&contour, &nct, &tool(1.0), Planning::default());
        assert_eq!(disagreement, None, "{text}\n{}", findings(&plan));
        assert!(plan.accepted(), "{text}\n{}", findings(&plan));
    }
}
