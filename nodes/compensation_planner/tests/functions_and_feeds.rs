//! Functions, feeds and blocks out of the plane between the elements of a contour.

mod support;

use cnc_msgs::finding::Code;
use cnc_msgs::path::Role;
use support::*;

/// 11.10 with an end.
fn s50(mode: &str) -> String {
    format!(
        "N5 {mode}
         N10 G1 X0 Y0 F1000
         N20 G41 D1 X50 Y50 H1
         N25 M3 S2000 Z-5 F10 H2
         N30 Y0 F2000 H3
         N40 G40 G456 X80 Y-20"
    )
}

/// `H1@(0,0)` for every action and `Z-5@...` for every off-plane move.
fn log(plan: &cnc_msgs::path::CompensatedPath) -> Vec<String> {
    let mut log = Vec::new();
    let mut events = plan.events.iter().peekable();
    for index in 0..=plan.elements.len() {
        let [x, y, _] = plan.start_of(index);
        while let Some(event) = events.next_if(|event| event.at_element == index) {
            log.push(format!("{}@{x:.4},{y:.4}", event.action.text()));
        }
        if let Some(element) = plan.elements.get(index).filter(|e| e.role == Role::OffPlane) {
            log.push(format!("Z{}@{x:.4},{y:.4}", element.end[2]));
        }
    }
    log
}

#[test]
fn s50_s51_s56_functions_happen_where_the_manual_says() {
    for (mode, s1, after) in [
        ("G450", "42.9289,57.0711", "60.0000,50.0000"),
        ("G451", "50.0000,64.1421", "60.0000,50.0000"),
    ] {
        let plan = plan(&s50(mode), &sinumerik(), &tool(10.0));
        assert!(plan.accepted(), "{}", findings(&plan));
        let expected = [
            "H1@0.0000,0.0000".to_string(),
            format!("M3@{s1}"),
            format!("S2000@{s1}"),
            format!("H2@{s1}"),
            format!("Z-5@{s1}"),
            format!("H3@{after}"),
        ];
        assert_eq!(log(&plan.path), expected, "{mode}");
    }
}

#[test]
fn s52_s53_generated_blocks_have_the_feed_of_the_next_block_and_no_functions() {
    for mode in ["G450", "G451"] {
        let plan = plan(&s50(mode), &sinumerik(), &tool(10.0));
        for (index, element) in plan.path.elements.iter().enumerate() {
            if element.role == Role::Corner {
                assert_eq!((element.feed_mm_per_min, element.source.line), (Some(2000.0), 5));
                let before_it = plan.path.events.iter().filter(|e| e.at_element == index);
                assert!(before_it.into_iter().all(|event| event.source.line < 5));
            }
        }
    }
}

#[test]
fn s54_without_a_feed_the_one_of_the_block_outside_the_plane_stays() {
    let text = s50("G450").replace(" F2000", "");
    let plan = plan(&text, &sinumerik(), &tool(10.0));
    let corner = plan.path.elements.iter().find(|e| e.role == Role::Corner).unwrap();
    assert_eq!(corner.feed_mm_per_min, Some(10.0));
}

/// 11.11: three blocks without motion in the plane at a corner.
fn s62(side: &str, mode: &str, more: &str) -> String {
    format!(
        "N10 G0 X-20 Y{}
         N20 {side} {mode} D1 G456 G1 X0 Y0
         N25 G91 X200
         N30 M8 H1
         N35 X0
         N40 Z-4
         {more}
         N45 Y-100
         N50 G90 G40 G456 X{} Y-160",
        if side == "G42" { -40 } else { 40 },
        if side == "G42" { 150 } else { 250 }
    )
    .lines()
    .filter(|line| !line.trim().is_empty())
    .collect::<Vec<_>>()
    .join("\n")
}

#[test]
fn s59_s62_three_blocks_out_of_the_plane_are_executed_before_the_corner() {
    let cases = [
        ("G42", "G450", "190.0000,-10.0000"),
        ("G41", "G451", "210.0000,10.0000"),
        ("G41", "G450", "200.0000,10.0000"),
    ];
    for (side, mode, at) in cases {
        let plan = plan(&s62(side, mode, ""), &sinumerik(), &tool(10.0));
        assert!(plan.accepted(), "{side} {mode}: {}", findings(&plan));
        let expected: Vec<String> =
            ["M8", "H1", "Z-4"].iter().map(|what| format!("{what}@{at}")).collect();
        assert_eq!(log(&plan.path), expected);
    }
}

#[test]
fn s59_s61_a_fourth_block_out_of_the_plane_is_alarm_3021() {
    let plan = plan(&s62("G41", "G450", "N42 Z-1"), &sinumerik(), &tool(10.0));
    let finding = finding(&plan, Code::OffPlaneBlocks);
    assert_eq!((finding.alarm.as_deref(), finding.source.block), (Some("3021"), Some(45)));
    let mut first_version = sinumerik();
    first_version.off_plane.max_blocks = Some(1);
    let text = s62("G41", "G450", "").replace("N35 X0\n", "").replace("N30 M8 H1\n", "");
    assert!(support::plan(&text, &first_version, &tool(10.0)).accepted(), "S60");
}

#[test]
fn a_block_that_leaves_the_plane_disturbs_no_geometry() {
    let plain = plan(A6, &sinumerik(), &tool(5.0));
    let lifted = A6.replace("N50 G2", "N45 Z3\nN46 M8\nN47 Z0\nN50 G2");
    let mut lifted = plan(&lifted, &sinumerik(), &tool(5.0));
    lifted.path.elements.retain(|element| element.role != Role::OffPlane);
    assert_eq!(listing(&lifted.path.elements), listing(&plain.path.elements));
}
