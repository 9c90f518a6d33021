//! What findings say: numbers that differ look different, and one cause is one finding.

mod support;

use cnc_msgs::finding::Code;
use cnc_msgs::tool_table::{Offset, ToolTable};
use support::*;

#[test]
fn a_tool_that_hardly_does_not_fit_differs_in_its_message_from_one_that_does() {
    // Between lines of 60 degrees: up to 8.660254 mm.
    let text = "G0 X-40 Y30\nG41 D1 G1 X-15 Y25.980762\nX-5 Y0\nX5\nX15 Y25.980762\nG40 X40 Y30";
    let limit = finding(&plan(text, &sinumerik(), &tool(20.0)), Code::Unreachable)
        .available_mm
        .expect("a limit");
    let plan = plan(text, &sinumerik(), &tool(limit + 4e-5));
    let message = &finding(&plan, Code::Unreachable).message;
    let fits = message.split("at most ").nth(1).and_then(|rest| rest.split(' ').next());
    let radius = message.split("radius ").nth(1).and_then(|rest| rest.split(' ').next());
    assert!(fits.is_some() && fits != radius, "{message}");
}

#[test]
fn a_change_of_sign_shows_both_signs() {
    let mut tools = ToolTable::default();
    tools.offsets.insert(1, Offset { radius_mm: 3.0, ..Offset::default() });
    tools.offsets.insert(2, Offset { radius_mm: -3.0, ..Offset::default() });
    for side in ["G41", "G42"] {
        let y = if side == "G41" { 20 } else { -20 };
        let text = format!("G0 X0 Y{y}\n{side} D1 G1 X0 Y0\nX50\nD2 X90\nG40 X90 Y{y}");
        let plan = plan(&text, &sinumerik(), &tools);
        let message = &finding(&plan, Code::SideChange).message;
        assert!(message.contains("(3.000 mm to -3.000 mm)"), "{message}");
    }
}

#[test]
fn a_move_out_of_the_plane_is_named_by_its_own_axis() {
    let text = M12.replace("N60 X100", "N60 X100 Z-1");
    let plan = plan(&text, &masso(), &tool(5.0));
    let message = &finding(&plan, Code::ForbiddenUnderCompensation).message;
    assert!(message.starts_with("a move of Z while"), "{message}");
}
