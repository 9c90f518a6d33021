//! Helices, huge and tiny elements, near-reversals, and points for previews.

mod support;

use cnc_msgs::finding::Code;
use cnc_msgs::geometry::Shape;
use cnc_msgs::path::Role;
use compensation_planner::tessellate;
use support::*;

#[test]
fn a_helix_keeps_its_turns_and_its_height() {
    let mut contour = contour(
        "G0 X0 Y60 Z10\nG41 D1 G456 G1 X20 Y0\nG3 X-20 Y0 Z4 I-20 J0\nG3 X20 Y0 Z-2 I20 J0\nG40 G456 G1 X0 Y1",
        &sinumerik(),
    );
    // Two more turns in the first half.
    for event in &mut contour.events {
        if let cnc_msgs::contour::ContourEventKind::Motion(motion) = &mut event.kind
            && let Shape::Arc(arc) = &mut motion.shape
            && motion.end[2] > 0.0
        {
            arc.turns = 2;
        }
    }
    let plan = compensation_planner::plan(&contour, &sinumerik(), &tool(5.0));
    assert!(plan.accepted(), "{}", findings(&plan));
    let expected = "L1 none G0 (0,60,10)
        L2 lead_on G1 (15,0,10)
        L3 contour G3 c(0,0) +2 (-15,0,4)
        L4 contour G3 c(0,0) (15,0,-2)
        L5 lead_off G1 (0,1,-2)";
    assert_eq!(listing(&plan.path.elements), dedent(expected));
    let points = tessellate::path(&plan.path, 0.01);
    let on_helix = points[2..].iter().filter(|p| (p[0].hypot(p[1]) - 15.0).abs() < 1e-9).count();
    assert!(on_helix > 100 && points.iter().all(|p| p[2] >= -2.0 && p[2] <= 10.0));
}

#[test]
fn points_for_previews_keep_the_chord_error() {
    let plan = plan(A6, &sinumerik(), &tool(5.0));
    for error in [1.0, 0.1, 0.001] {
        let mut start = plan.path.start;
        for element in &plan.path.elements {
            let mut last = start;
            tessellate::points(start, element, error, |point| {
                if let Shape::Arc(arc) = element.shape {
                    let out = |x: f64, y: f64| (x - arc.center[0]).hypot(y - arc.center[1]);
                    let radius = out(start[0], start[1]);
                    let middle = out((last[0] + point[0]) / 2.0, (last[1] + point[1]) / 2.0);
                    assert!((out(point[0], point[1]) - radius).abs() < 1e-9);
                    assert!(radius - middle <= error + 1e-12);
                }
                last = point;
            });
            assert_eq!(last, element.end);
            start = element.end;
        }
    }
}

#[test]
fn an_outside_near_reversal_is_gone_around() {
    for degrees in [177.0_f64, 179.0, 179.9, 179.999, 180.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let (x, y) = (100.0 + 100.0 * cos, -100.0 * sin);
        let text = format!(
            "G0 X0 Y40\nG41 D1 G456 G1 X0 Y0\nX100\nX{x:.9} Y{y:.9}\nG40 G456 X{x:.9} Y-60"
        );
        let plan = plan(&text, &sinumerik(), &tool(5.0));
        let elements = &plan.path.elements;
        assert!(!codes(&plan).contains(&Code::Unreachable), "{}", findings(&plan));
        let corner = elements.iter().position(|element| element.role == Role::Corner).unwrap();
        let Shape::Arc(arc) = elements[corner].shape else { panic!("no arc") };
        let sweep = tessellate::sweep(elements[corner - 1].end, &arc, elements[corner].end);
        assert!((sweep.to_degrees() - degrees).abs() < 1e-5, "{degrees}: {sweep}");
    }
}

#[test]
fn an_inside_near_reversal_is_unreachable_unless_the_legs_are_long_enough() {
    // The offsets meet R / tan(gap / 2) before the corner: 190.9 mm at 3 degrees.
    let at = |length: f64| {
        let (sin, cos) = 177.0_f64.to_radians().sin_cos();
        let (x, y) = (length + length * cos, length * sin);
        let text = format!(
            "G0 X0 Y-40\nG41 D1 G456 G1 X0 Y-20\nY0\nX{length}\nX{x:.9} Y{y:.9}\nG40 G456 X{x:.9} Y60"
        );
        codes(&plan(&text, &sinumerik(), &tool(5.0))).contains(&Code::Unreachable)
    };
    assert!(!at(197.0) && at(180.0));
}

#[test]
fn arcs_of_a_radius_of_100_m_are_compensated_to_a_nanometre() {
    // Two flat arcs that meet in an inside corner of 1 mrad and an outside one.
    for (side, center) in [("G41", 1.0), ("G42", -1.0)] {
        let text = format!(
            "G0 X-50 Y{}\n{side} D1 G456 G1 X0 Y0\n{} X100 Y0 I50 J{}\nX200 Y0 I50 J{}\nG40 G456 G1 X250 Y{}",
            60.0 * center,
            if center > 0.0 { "G2" } else { "G3" },
            -100_000.0 * center,
            -100_000.0 * center,
            60.0 * center
        );
        let plan = plan(&text, &sinumerik(), &tool(5.0));
        let joint = plan.path.elements[2].end;
        let out = (joint[0] - 50.0).hypot(joint[1] + 100_000.0 * center);
        let radius = 50.0_f64.hypot(100_000.0);
        assert!((out - radius - 5.0).abs() < 1e-8, "{}", findings(&plan));
        assert!((joint[0] - 100.0).abs() < 1e-8, "{joint:?}");
    }
}

#[test]
fn ten_thousand_segments_of_ten_nanometres_are_one_line() {
    let mut text = "G0 X-20 Y40\nG41 D1 G456 G1 X0 Y0\nX50\n".to_string();
    for index in 1..=10_000 {
        text += &format!("X{:.8}\n", 50.0 + f64::from(index) * 1e-5);
    }
    text += "X60 Y0\nY50\nG40 G456 X20 Y60";
    let plan = plan(&text, &sinumerik(), &tool(5.0));
    assert!(plan.findings.is_empty(), "{}", findings(&plan));
    let elements = &plan.path.elements;
    assert!(elements.iter().all(|element| (element.end[1] - 5.0).abs() < 1e-9
        || !matches!(element.role, Role::Contour)
        || element.end == [55.0, 50.0, 0.0]));
    let corner = elements[elements.len() - 3].end;
    assert!((corner[0] - 55.0).abs() < 1e-9 && (corner[1] - 5.0).abs() < 1e-9, "{corner:?}");
}

#[test]
fn coordinates_that_are_no_place_are_refused() {
    use cnc_msgs::contour::ContourEventKind;
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX] {
        for broken in 1..10 {
            let mut contour = contour(A6, &sinumerik());
            let mut motions = contour.events.iter_mut().filter_map(|event| match &mut event.kind {
                ContourEventKind::Motion(motion) => Some(motion),
                _ => None,
            });
            motions.nth(broken).unwrap().end[0] = bad;
            let plan = compensation_planner::plan(&contour, &sinumerik(), &tool(5.0));
            finding(&plan, Code::BadNumber);
            assert!(!plan.accepted());
        }
    }
}
