//! The radii that contours are good for.

mod support;

use cnc_msgs::finding::Code;
use cnc_msgs::profile::Profile;
use compensation_planner::{Alone, Certificate, certificates, plan_certified};
use std::sync::atomic::{AtomicUsize, Ordering};
use support::*;

fn certificate(text: &str, profile: &Profile, radius: f64) -> Certificate {
    let plan = plan_certified(&contour(text, profile), profile, &tool(radius));
    assert_eq!(plan.certificates.len(), 1, "{}", findings(&plan));
    plan.certificates[0].clone()
}

fn blocks(certificate: &Certificate) -> Vec<(u32, [f64; 2])> {
    let limits = certificate.limited_by.iter();
    let short = |value: f64| (value * 1e5).round() / 1e5;
    limits
        .map(|limit| {
            let [x, y, _] = limit.position.map(short);
            (limit.source.block.unwrap(), [x, y])
        })
        .collect()
}

#[test]
fn s03_the_contour_of_11_15_is_good_until_n40_vanishes() {
    for radius in [0.5, 5.0, 20.0, 20.85, 20.9, 50.0] {
        let certificate = certificate(A6, &sinumerik(), radius);
        assert!((certificate.valid_to_mm - 20.851449).abs() < 1e-6, "{certificate:?}");
        assert_eq!(blocks(&certificate), [(40, [65.0, 55.0])], "{radius}");
        assert_eq!((certificate.first_line, certificate.last_line), (3, 12));
        // Beyond it the lead from (15,60) turns back along N20: 15 cos of its normal.
        let turns_back = 15.0 * 20.0 / 500.0_f64.sqrt();
        assert!((certificate.leads_valid_to_mm - turns_back).abs() < 1e-4, "{certificate:?}");
    }
}

#[test]
fn s03_the_same_contour_from_inside_is_good_until_n50_and_n70_are_too_near() {
    for radius in [1.0, 5.0, 5.05, 5.2, 9.0] {
        let certificate = certificate(BOTTLENECK, &sinumerik(), radius);
        assert!((certificate.valid_to_mm - 5.0).abs() < 1e-6, "{certificate:?}");
        let limits = [(50, [95.0, 55.0]), (70, [105.0, 55.0])];
        assert_eq!(blocks(&certificate), limits, "{radius}");
    }
}

#[test]
fn s64_the_trapezoid_is_good_until_its_short_side_vanishes() {
    let text = "
        N1 G0 X-40 Y20
        N2 G41 D1 G456 G1 X-22 Y20 F100
        N3 X-2 Y0
        N4 X2
        N5 X22 Y20
        N6 G40 G456 X40 Y20";
    for radius in [1.0, 4.8, 4.9, 5.0] {
        let certificate = certificate(text, &sinumerik(), radius);
        let exact = 2.0 / (2.0_f64.sqrt() - 1.0);
        assert!((certificate.valid_to_mm - exact).abs() < 1e-6, "{certificate:?}");
        assert_eq!(blocks(&certificate), [(4, [-2.0, 0.0])]);
    }
}

#[test]
fn a_contour_that_bends_away_everywhere_takes_any_tool() {
    let text = "
        N1 G0 X-40 Y20
        N2 G41 D1 G456 G1 X-20 Y0 F100
        N3 X0 Y10
        N4 X20 Y0
        N5 G40 G456 X40 Y20";
    let certificate = certificate(text, &sinumerik(), 5.0);
    assert_eq!(certificate.valid_to_mm, f64::INFINITY);
    assert_eq!(certificate.limited_by, []);
}

#[test]
fn an_inside_arc_is_good_until_its_radius() {
    let text = "
        N1 G0 X0 Y30
        N2 G41 D1 G456 G1 X-40 Y0 F100
        N3 X-20
        N4 G3 X20 Y0 I20 J0
        N5 G1 X40
        N6 G40 G456 X0 Y30";
    // A half circle that ends in outside corners: nothing but its radius limits it.
    let certificate = certificate(text, &sinumerik(), 5.0);
    assert!((certificate.valid_to_mm - 20.0).abs() < 1e-6, "{certificate:?}");
}

#[test]
fn the_noise_of_the_point_where_a_contour_closes_limits_nothing() {
    let text = "G0 X-22.126 Y44.838\nG42 D1 G456 G1 X-8.85 Y17.935 F500\nX-30.373 Y7.315
        G3 X-33.098 Y-0.721 I2.656 J-5.381\nG1 X-20.707 Y-25.83
        G3 X-12.672 Y-28.556 I5.38 J2.655\nG1 X30.373 Y-7.315
        G3 X33.098 Y0.721 I-2.656 J5.381\nG1 X20.707 Y25.83
        G3 X12.672 Y28.556 I-5.38 J-2.655\nG1 X-8.85 Y17.935\nG40 G456 X-22.126 Y44.838";
    let certificate = certificate(text, &sinumerik(), 5.0);
    assert!(certificate.valid_to_mm > 1000.0, "{certificate:?}");
    assert!(certificate.leads_valid_to_mm > 20.0, "{certificate:?}");
}

#[test]
fn an_interruption_ends_the_search() {
    let two = A6.replace("M30", "") + A6;
    let contour = contour(&two, &sinumerik());
    let asked = AtomicUsize::new(0);
    let found_within = |most: usize| {
        asked.store(0, Ordering::Relaxed);
        let goes_on = || asked.fetch_add(1, Ordering::Relaxed) < most;
        certificates(&contour, &sinumerik(), &tool(5.0), &Alone, &goes_on).len()
    };
    assert_eq!(found_within(usize::MAX), 2);
    let trials = asked.load(Ordering::Relaxed);
    // Each span asks once more.
    for (most, spans) in [(0, 0), (trials / 2 - 1, 0), (trials / 2, 1), (trials - 1, 1)] {
        assert_eq!(found_within(most), spans, "{most} of {trials}");
        assert!(asked.load(Ordering::Relaxed) <= most + 2, "{most} of {trials}");
    }
}

#[test]
fn no_lead_that_gouges_has_a_radius_that_its_certificate_is_good_for() {
    // Oblique leads to a straight block: larger tools only nick its free end.
    let part = |x: f64, y: f64, radius: f64| {
        format!(
            "N1 G0 X{x} Y{y}\nN2 G42.1 D{} G1 X0 Y0 F100\nN3 X50\nN4 G40 G1 X90 Y-30",
            2.0 * radius
        )
    };
    let profile = rs274();
    let mut gouging = 0;
    for radius in [2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0] {
        for (x, y) in [(-12.0, -4.0), (-8.0, -3.0), (-20.0, -2.0), (-5.0, -5.0), (-30.0, -9.0)] {
            let plan =
                plan_certified(&contour(&part(x, y, radius), &profile), &profile, &tool(1.0));
            let good_for = plan.certificates[0].leads_valid_to_mm;
            let gouges = codes(&plan).contains(&Code::LeadGouge);
            assert_eq!(gouges, good_for < radius, "X{x} Y{y} R{radius}: good for {good_for}");
            gouging += usize::from(gouges);
        }
    }
    assert!(gouging > 3, "{gouging}");
}
