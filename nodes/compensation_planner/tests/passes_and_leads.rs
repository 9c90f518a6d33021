//! What every CAM system posts: leads along the contour, arcs to it and away from it, more than
//! a whole turn, many passes, and leads above the part. Accepted by planner and audit.

mod support;

use cnc_msgs::finding::{Code, Severity};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::path::{PathElement, Role};
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::{Plan, Planning, Verdict, judge, plan_certified};
use std::f64::consts::TAU;
use std::fmt::Write;
use support::{codes, contour, finding, findings, profile, tool};

/// Planned and audited; both say the same.
#[track_caller]
fn judged(text: &str, control: &str, tools: &ToolTable) -> Plan {
    let profile = profile(control);
    let contour = contour(text, &profile);
    let Verdict { plan, disagreement, .. } = judge(&contour, &profile, tools, Planning::default());
    assert_eq!(disagreement, None, "{}", findings(&plan));
    plan
}

#[track_caller]
fn of_rs274(text: &str) -> Plan {
    judged(text, "rs274", &ToolTable::default())
}

#[test]
fn a_lead_along_the_contour_nicks_its_free_end() {
    // As LinuxCNC's pages show it.
    let plan = of_rs274("F100\nG0 X-20\nG41.1 D2 G1 X-10\nG1 X0\nG1 X20\nG40 G1 X20 Y20");
    let nick = finding(&plan, Code::LeadNick);
    assert_eq!(nick.severity, Severity::Warning);
    // R (1 - cos φ), where the lead of 10 mm misses the radius at its end by R.
    let depth_mm = 1.0 - (0.1_f64.atan()).cos();
    assert!((nick.depth_mm.unwrap() - depth_mm).abs() < 1e-9, "{nick:?}");
    assert_eq!(codes(&plan), [Code::LeadNick], "{}", findings(&plan));
    // Short chords after the end are passed over with it.
    let chords = of_rs274(
        "F100\nG0 X-20\nG41.1 D6 G1 X-10\nG1 X-9.9 Y0.001\nG1 X-9.8 Y0.003\nG1 X-9.6 Y0.009\n\
         G1 X20 Y2\nG40 G1 X20 Y20",
    );
    assert_eq!(codes(&chords), [Code::LeadNick], "{}", findings(&chords));
    // What is too small to be seen is not reported.
    let long = of_rs274("F100\nG0 X-200\nG41.1 D2 G1 X-10\nG1 X20\nG40 G1 X20 Y20");
    assert_eq!(findings(&long), "");
}

#[test]
fn a_lead_that_cuts_more_than_the_free_end_gouges() {
    // The corner belongs to the last block of a closed contour too.
    let plan =
        of_rs274("F100\nG0 X-20\nG42.1 D6 G1 X0\nG1 X20\nG1 Y20\nG1 X0\nG1 Y0\nG40 G1 X0 Y-20");
    assert_eq!(finding(&plan, Code::LeadGouge).severity, Severity::Error);
    // Through the middle of the first block.
    let text = "G0 X50 Y-20\nG41 D1 G1 X0 Y0 F100\nX100\nG40 X100 Y20";
    let plan = judged(text, "nct", &tool(5.0));
    assert_eq!(codes(&plan), [Code::LeadGouge], "{}", findings(&plan));
}

#[test]
fn arcs_that_lead_to_a_circle_and_away_from_it_bound_nothing() {
    for text in [
        "G0 X12 Y-4\nG41.1 D4 G1 X16 Y-4 F100\nG3 X20 Y0 I0 J4\nG3 X20 Y0 I-20 J0\n\
         G3 X16 Y4 I-4 J0\nG40 G1 X12 Y4",
        // A quarter of the circle twice.
        "G0 X0 Y0\nG41.1 D6 G1 X20 Y-10 F100\nG3 X30 Y0 I0 J10\nG3 X30 Y0 I-30 J0\n\
         G3 X0 Y30 I-30 J0\nG3 X-10 Y20 I0 J-10\nG40 G1 X0 Y0",
        // The leads cross each other.
        "G0 X5 Y9\nG41.1 D4 G1 X9.1716 Y1.1716 F100\nG1 X13.1716 Y-2.8284\n\
         G3 X20 Y0 I2.8284 J2.8284\nG3 X20 Y0 I-20 J0\nG3 X13.1716 Y2.8284 I-4 J0\n\
         G1 X9.1716 Y-1.1716\nG40 G1 X5 Y-9",
    ] {
        assert_eq!(findings(&of_rs274(text)), "", "{text}");
    }
}

#[test]
fn a_contour_that_closes_within_a_line_is_closed() {
    // The posted blocks before and after the beginning are one line to 1e-4 mm, which passes the
    // beginning by; the end of the overlap is 5e-5 mm off the first block.
    let plan = of_rs274(
        "F600\nG0 X98.2608 Y61.0233\nG41.1 D10 G1 X109.5245 Y70.9445\nG1 X38.7691 Y151.2740\n\
         G1 X-47.7313 Y144.6142\nG1 X-137.3187 Y50.1976\nG1 X-125.4162 Y-92.4945\n\
         G1 X-25.5774 Y-151.4079\nG1 X122.6345 Y-82.7981\nG1 X152.2660 Y22.4195\n\
         G1 X109.5245 Y70.9445\nG1 X74.1468 Y111.1092\nG3 X70.5391 Y112.8786 I-3.9397 J-3.4701\n\
         G1 X61.2600 Y113.4666\nG40 G1 X60.7851 Y105.9716",
    );
    assert!(plan.accepted(), "{}", findings(&plan));
}

#[test]
fn a_full_circle_between_arcs_is_cut_whatever_its_decimals() {
    // Where posted coordinates leave the joints off tangent by 1e-7 rad, the tool leaves the
    // circle a hair before where it came onto it, or a hair after.
    for text in [
        "F600\nG0 X-10.215609 Y20.359677\nG41.1 D10 G1 X-6.807122 Y4.726948\n\
         G3 X0.333333 Y0.142857 I5.862273 J1.278183\nG3 X0.333333 Y0.142857 I-4.260607 J19.540912\n\
         G3 X4.917424 Y7.283313 I-1.278182 J5.862274\nG40 G1 X1.508938 Y22.916042",
        "F600\nG0 X-0.842272 Y-22.630328\nG42.1 D10 G1 X-4.250758 Y-6.997599\n\
         G2 X0.333333 Y0.142857 I5.862274 J1.278183\nG3 X0.333333 Y0.142857 I-4.260607 J19.540912\n\
         G3 X0.674629 Y0.220406 I-4.260607 J19.540912\nG2 X7.894209 Y-4.238032 I1.380572 J-5.839009\n\
         G40 G1 X11.575732 Y-19.808722",
        "F600\nG0 X-16.165988 Y24.179753\nG41.1 D10 G1 X-12.757502 Y8.547024\n\
         G3 X0.333333 Y0.142857 I10.747501 J2.343334\nG2 X0.333333 Y0.142857 I4.260608 J-19.540911\n\
         G2 X0.675934 Y0.214422 I4.260608 J-19.540911\nG3 X9.307892 Y13.156188 I-2.154904 J10.786862\n\
         G40 G1 X6.173487 Y28.846168",
        // Four decimals: both ends are moved by 2e-5 mm.
        "F600\nG0 X-20.3743 Y9.5036\nG42.1 D10 G1 X1.5113 Y6.7900\n\
         G2 X8.8102 Y-2.5749 I-1.0330 J-8.3319\nG2 X8.8102 Y-2.5749 I-32.1743 J3.9892\n\
         G2 X-0.5548 Y-9.8738 I-8.3319 J1.0330\nG40 G1 X-22.1028 Y-7.2020",
    ] {
        let plan = of_rs274(text);
        assert!(plan.accepted(), "{}", findings(&plan));
        let is_circle = |it: &&PathElement| it.source.line == 5 && it.role == Role::Contour;
        let index = plan.path.elements.iter().position(|it| is_circle(&it)).expect("the circle");
        let circle = &plan.path.elements[index];
        let Shape::Arc(arc) = circle.shape else { panic!("{circle:?}") };
        let angle = |at: Position| (at[1] - arc.center[1]).atan2(at[0] - arc.center[0]);
        let turned = angle(circle.end) - angle(plan.path.start_of(index));
        let turned = if arc.clockwise { -turned } else { turned }.rem_euclid(TAU);
        let sweep = turned + TAU * f64::from(arc.turns);
        assert!((sweep - TAU).abs() < 1e-6, "{circle:?}");
    }
}

/// Three decimals: the quarters are one circle to 1e-4 mm, and would end off the last point.
#[test]
fn an_arc_after_quarters_of_a_circle_is_reached_whatever_their_decimals() {
    let text = "G0 X-11.037 Y1.291\nG42 G451 D1 G1 X-8.253 Y3.59 F600\n\
                G3 X-3.59 Y-8.253 I8.253 J-3.59\nG3 X8.253 Y-3.59 I3.59 J8.253\n\
                G3 X3.59 Y8.253 I-8.253 J3.59\nG3 X-8.253 Y3.59 I-3.59 J-8.253\n\
                G3 X-8.374 Y-3.298 I8.253 J-3.59\nG2 X-8.19 Y-4.918 I-2.931 J-1.154\n\
                G40 G1 X-9.088 Y-0.498\nM2";
    let plan = judged(text, "sinumerik_840c", &tool(3.0));
    assert!(plan.accepted(), "{}", findings(&plan));
}

#[test]
fn an_arc_after_a_circle_that_goes_on_is_reached_whatever_its_decimals() {
    // Four decimals: the circle and the half radian after it are one, and end 1e-5 mm off
    // the start of the arc that leads away.
    let text = "F600\nG0 X-0.8423 Y-22.6303\nG42.1 D10 G1 X-4.2508 Y-6.9976\n\
                G2 X0.3333 Y0.1429 I5.8623 J1.2782\nG2 X0.3333 Y0.1429 I4.2606 J-19.5410\n\
                G2 X10.2233 Y-0.2066 I4.2606 J-19.5410\nG2 X14.2919 Y-7.6529 I-1.6888 J-5.7575\n\
                G40 G1 X9.7884 Y-23.0060";
    assert_eq!(findings(&of_rs274(text)), "");
    let profile = profile("rs274");
    let plan = plan_certified(&contour(text, &profile), &profile, &ToolTable::default());
    // The arc that leads away has a radius of 6.
    assert!((plan.certificates[0].valid_to_mm - 6.0).abs() < 1e-3, "{:?}", plan.certificates);
}

#[test]
fn as_many_passes_as_there_are_are_one_wall() {
    let square = |passes: usize| {
        let mut text = String::from("F100\nG0 X-20 Y-20\nG41.1 D6 G1 X-10 Y0");
        for pass in 1..=passes {
            let _ = write!(text, "\nG1 Z-{pass}\nX0 Y0\nX0 Y40\nX40 Y40\nX40 Y0\nX0 Y0");
        }
        text + "\nG40 G1 X-20 Y-20"
    };
    for passes in [1, 2, 23, 24, 80, 200] {
        let plan = of_rs274(&square(passes));
        assert_eq!(findings(&plan), "", "{passes}");
    }
    // A wall that is too near is still seen, once, in the pass that cuts it.
    let narrow =
        square(60).replace("X40 Y0\nX0 Y0", "X40 Y0\nX20 Y0\nX20 Y5\nX15 Y5\nX15 Y0\nX0 Y0");
    let plan = of_rs274(&narrow.replace("D6", "D12"));
    assert!(plan.findings.iter().any(|it| it.is_error()), "{}", findings(&plan));
    assert!(!codes(&plan).contains(&Code::Limit), "{}", findings(&plan));
}

#[test]
fn a_lead_above_the_part_cuts_nothing() {
    let away = |height: f64| {
        format!(
            "F100\nG0 X20 Y60 Z5\nG0 Z-1\nG41.1 D6 G1 X20 Y40\nX40 Y40\nX40 Y0\nX0 Y0\nX0 Y40\n\
             X20 Y40\nG40\nG0 Z{height}\nG0 X20 Y-30"
        )
    };
    assert_eq!(findings(&of_rs274(&away(5.0))), "");
    for height in [-1.0, -0.5, 0.0] {
        let plan = of_rs274(&away(height));
        assert_eq!(codes(&plan), [Code::LeadGouge], "{height}: {}", findings(&plan));
    }
    // The top of the material is higher.
    let mut control = profile("rs274");
    control.interference.stock_top_mm = 10.0;
    let contour = contour(&away(5.0), &control);
    let verdict = judge(&contour, &control, &ToolTable::default(), Planning::default());
    assert_eq!(codes(&verdict.plan), [Code::LeadGouge]);
}

#[test]
fn a_program_may_end_above_the_contour_without_a_lead_off() {
    let part = |end: &str| {
        format!(
            "F100\nG0 X20 Y60 Z5\nG0 Z-1\nG41.1 D6 G1 X20 Y40\nX40 Y40\nX40 Y0\nX0 Y0\nX0 Y40\n\
             X20 Y40\n{end}M2"
        )
    };
    for (end, severity) in [
        ("G0 Z5\n", Severity::Warning),
        ("G40\nG0 Z5\n", Severity::Warning),
        ("", Severity::Error),
        ("G40\nG0 Z0\n", Severity::Error),
    ] {
        let plan = of_rs274(&part(end));
        assert_eq!(finding(&plan, Code::NotCancelled).severity, severity, "{end}");
        assert_eq!(codes(&plan), [Code::NotCancelled], "{end}: {}", findings(&plan));
    }
}

#[test]
fn a_corner_between_a_lead_and_the_contour_is_where_the_contour_is() {
    // The tool plunges and goes around the start: there it cuts the block that closes.
    let plan = of_rs274(
        "F100\nG0 X34 Y0 Z5\nG41.1 D6 G1 X30 Y0\nG1 Z-1\nX60 Y0\nX60 Y34\nX0 Y34\nX0 Y0\nX30 Y0\n\
         G40 G1 X30 Y8",
    );
    assert_eq!(finding(&plan, Code::LeadGouge).severity, Severity::Error);
}

#[test]
fn a_lead_that_keeps_the_tool_off_the_first_block_is_to_blame() {
    let text = |diameter: f64| {
        format!(
            "F100\nG0 X0 Y20\nG41.1 D{diameter} G1 X0 Y0\nG1 X1 Y0\nG1 X2 Y0.2\nG1 X20 Y4\n\
             G40 G1 X15 Y20"
        )
    };
    let plan = of_rs274(&text(6.0));
    let lost = finding(&plan, Code::Unreachable);
    assert!(lost.message.contains("the lead meets the contour"), "{lost:?}");
    // The certificate says the same: accepted below, refused above.
    let fits_mm = lost.available_mm.unwrap();
    let certificate = compensation_planner::plan_certified(
        &contour(&text(1.0), &profile("rs274")),
        &profile("rs274"),
        &ToolTable::default(),
    );
    let leads_mm = certificate.certificates[0].leads_valid_to_mm;
    assert!((leads_mm - fits_mm).abs() < 0.01, "{leads_mm} {fits_mm}");
    assert!(of_rs274(&text(2.0 * leads_mm - 1e-3)).accepted());
    assert!(!of_rs274(&text(2.0 * leads_mm + 0.02)).accepted());
}

#[test]
fn a_negative_radius_is_the_positive_one_on_the_other_side() {
    let text = "G0 X-50 Y-25\nG1 Z-5 F100\nG41\nX-25\nX100\nY-100\nX25\nY25\nG40\nX25 Y50";
    for (radius, control) in
        [(4.0, "masso"), (0.25, "masso"), (5.0, "sinumerik_840c"), (5.0, "nct")]
    {
        let text = match control {
            "masso" => text.to_owned(),
            _ => text.replace("G41\nX-25", "G41 D1 G1 X-25").replace("G40\nX25", "G40 X25"),
        };
        let mut runs = [radius, -radius].map(|radius: f64| {
            let mut tools = tool(radius);
            tools.tools.entry(1).or_default().diameter_mm = 0.0;
            tools.tools.entry(1).or_default().wear_diameter_mm = 2.0 * radius;
            let word = if radius < 0.0 { "G41" } else { "G42" };
            let text = format!("T1 M6\n{}", text.replace("G41", word));
            judged(&text, control, &tools)
        });
        for plan in &mut runs {
            plan.spans.clear();
        }
        assert_eq!(findings(&runs[0]), findings(&runs[1]), "{control} {radius}");
        assert_eq!(runs[0].path.elements, runs[1].path.elements, "{control} {radius}");
    }
}

#[test]
fn what_an_entry_skips_of_a_curve_is_reported() {
    // Along a curve of 40 mm in chords, entered along its tangent or from its inside.
    let curve = |start: &str| {
        let mut text = format!("F100\nG0 {start}\nG41.1 D6 G1 X40 Y0");
        for step in 1..=30 {
            let (sin, cos) = (f64::from(step) * 3.0_f64.to_radians()).sin_cos();
            let _ = write!(text, "\nG1 X{:.4} Y{:.4}", 40.0 * cos, 40.0 * sin);
        }
        text + "\nG40 G1 X-0.5 Y30"
    };
    let skips = of_rs274(&curve("X0 Y20"));
    let uncut = finding(&skips, Code::Uncut);
    assert_eq!((uncut.severity, uncut.source.line), (Severity::Warning, 3));
    assert!((0.1..5.0).contains(&uncut.available_mm.unwrap()), "{uncut:?}");
    assert!(skips.accepted(), "{}", findings(&skips));
    let touches = of_rs274(&curve("X40 Y-20"));
    assert!(touches.accepted(), "{}", findings(&touches));
    assert!(!codes(&touches).contains(&Code::Uncut), "{}", findings(&touches));
}
