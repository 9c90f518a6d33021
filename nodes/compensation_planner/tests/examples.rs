//! The manuals' own examples, point by point.

mod support;

use cnc_msgs::finding::Code;
use cnc_msgs::tool_table::Tool;
use support::*;

#[track_caller]
fn check(text: &str, profile: &cnc_msgs::profile::Profile, radius: f64, expected: &str) {
    let plan = plan(text, profile, &tool(radius));
    let elements = if plan.accepted() { &plan.path.elements } else { &plan.refused };
    assert_eq!(listing(elements), dedent(expected), "{}", findings(&plan));
    assert!(plan.accepted(), "{}", findings(&plan));
}

#[test]
fn s72_the_worked_example_with_g450_is_exact() {
    check(
        A6,
        &sinumerik(),
        5.0,
        "N1 none G0 (15,60)
         N10 lead_on G1 (25.527864,62.236068)
         N20 contour G1 (35.527864,82.236068)
         N30 corner G2 c(40,80) (40,85)
         N30 contour G2 c(40,55) (69.580399,60)
         N40 contour G1 (90.635083,60)
         N50 contour G2 c(110,55) (110,75)
         N60 corner G2 c(110,70) (114.743416,68.418861)
         N60 contour G1 (110.203845,54.800147)
         N70 contour G1 (114.850713,36.212678)
         N80 corner G2 c(110,35) (110,30)
         N80 contour G1 (91.753905,30)
         N90 contour G1 (68.123475,11.095656)
         N100 corner G2 c(65,15) (61.464466,11.464466)
         N100 contour G1 (36.464466,36.464466)
         N110 corner G2 c(40,40) (35.527864,37.763932)
         N110 contour G1 (25.527864,57.763932)
         N120 lead_off G1 (15,60)
         N130 none G0 (15,60,50)",
    );
}

#[test]
fn s72_the_worked_example_with_g451_is_exact() {
    check(
        &A6.replace("G450", "G451"),
        &sinumerik(),
        5.0,
        "N1 none G0 (15,60)
         N10 lead_on G1 (25.527864,62.236068)
         N20 contour G1 (36.90983,85)
         N30 corner G1 (40,85)
         N30 contour G2 c(40,55) (69.580399,60)
         N40 contour G1 (90.635083,60)
         N50 contour G2 c(110,55) (110,75)
         N60 corner G1 (115,75)
         N60 corner G1 (116.324555,73.162278)
         N60 contour G1 (110.203845,54.800147)
         N70 contour G1 (116.063391,31.361966)
         N80 corner G1 (115,30)
         N80 contour G1 (91.753905,30)
         N90 contour G1 (64.62892,8.300012)
         N100 contour G1 (35.890728,37.038204)
         N110 contour G1 (25.527864,57.763932)
         N120 lead_off G1 (15,60)
         N130 none G0 (15,60,50)",
    );
}

#[test]
fn s72_the_worked_example_takes_a_radius_of_10() {
    let plan = plan(A6, &sinumerik(), &tool(10.0));
    let expected = [
        [15.0, 60.0],
        [21.0557, 64.4721],
        [31.0557, 84.4721],
        [40.0, 90.0],
        [73.5410, 65.0],
        [87.0871, 65.0],
        [110.0, 80.0],
        [119.4868, 66.8377],
        [115.4077, 54.6003],
        [119.7014, 37.4254],
        [110.0, 25.0],
        [93.5078, 25.0],
        [71.2470, 7.1913],
        [57.9289, 7.9289],
        [32.9289, 32.9289],
        [31.0557, 35.5279],
        [21.0557, 55.5279],
        [15.0, 60.0],
        [15.0, 60.0],
    ];
    assert_ends(&plan, &expected, 5.1e-5);
}

#[test]
fn m12_the_masso_example_is_exact() {
    check(
        M12,
        &masso(),
        5.0,
        "N20 none G0 (-50,-25)
         N50 lead_on G1 (-25,-20)
         N60 contour G1 (100,-20)
         N70 corner G2 c(100,-25) (105,-25)
         N70 contour G1 (105,-100)
         N80 corner G2 c(100,-100) (100,-105)
         N80 contour G1 (25,-105)
         N90 corner G2 c(25,-100) (20,-100)
         N90 contour G1 (20,25)
         N110 lead_off G1 (25,50)",
    );
}

#[test]
fn m30_a_worn_tool_shifts_every_straight_by_the_wear() {
    let mut tools = tool(5.0);
    tools.tools.insert(1, Tool { diameter_mm: 10.0, wear_diameter_mm: -0.5, ..Tool::default() });
    let plan = plan(M12, &masso(), &tools);
    let expected = [
        [-50.0, -25.0],
        [-25.0, -20.25],
        [100.0, -20.25],
        [104.75, -25.0],
        [104.75, -100.0],
        [100.0, -104.75],
        [25.0, -104.75],
        [20.25, -100.0],
        [20.25, 25.0],
        [25.0, 50.0],
    ];
    assert_ends(&plan, &expected, 1e-9);
}

#[test]
fn the_rs274_entry_meets_the_contour_where_both_offsets_cross() {
    let text = A6.replace("G450", "");
    let plan = |text: &str| plan(text, &rs274(), &tool(5.0));
    let [x, y] = support::ends(&plan(&text))[1];
    assert!((x - 26.909830).abs() < 1e-6 && (y - 65.0).abs() < 1e-6, "{x} {y}");
    // In the direction of the contour: the normal position, which nicks the start.
    let plan = plan(&text.replace("N1 G0 X15 Y60", "N1 G0 X20 Y40"));
    let [x, y, _] = plan.refused[1].end;
    assert!((x - 25.527864).abs() < 1e-6 && (y - 62.236068).abs() < 1e-6, "{x} {y}");
    let depth = finding(&plan, Code::LeadGouge).depth_mm.unwrap();
    assert!((depth - 0.1205).abs() < 1e-4, "{depth}");
}
