//! A value that is entered while the machine holds (S46, S48): the rest of the path.

mod support;

use cnc_msgs::profile::{Profile, Strictness};
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::replan::replan;
use compensation_planner::set_tool::LoadedProgram;
use support::{contour, masso, plan, sinumerik, tool};

const SQUARE: &str = "N10 G41 D1 G1 X0 Y0 F500
    N20 X0 Y100
    N30 X100 Y100
    N40 X100 Y0
    N50 X0 Y0
    N60 G40 X-20 Y-20";

/// A control that begins a closed contour in its inside corner.
fn from_a_corner() -> Profile {
    let mut profile = sinumerik();
    profile.interference.at_closing = Strictness::Warn;
    profile
}

#[test]
fn s48_a_value_entered_in_a_stop_is_in_force_from_the_next_corner_on() {
    let (profile, before, after) = (from_a_corner(), tool(-5.0), tool(-8.0));
    let square = contour(SQUARE, &profile);
    let program = LoadedProgram { name: "square", contour: &square, profile: &profile };
    let running = plan(SQUARE, &profile, &before).path;
    let ends = |path: &cnc_msgs::path::CompensatedPath| -> Vec<[f64; 2]> {
        let round = |value: f64| (value * 1e6).round() / 1e6;
        path.elements.iter().map(|e| [round(e.end[0]), round(e.end[1])]).collect()
    };
    // Right of the square with its inside to the right: the tool runs inside.
    let all = ends(&running);
    assert_eq!(all[1..5], [[5.0, 95.0], [95.0, 95.0], [95.0, 5.0], [0.0, 5.0]], "{all:?}");
    // N20 is under way: N30 ends at the corner with the new radius.
    let rest = replan(program, &before, &after, &running, 2).expect("it can change");
    assert_eq!(rest.from_line, 3);
    let now = ends(&rest.plan.path);
    assert_eq!(now[..2], all[..2]);
    assert_eq!(now[2..5], [[92.0, 92.0], [92.0, 8.0], [0.0, 8.0]], "{now:?}");
    // And once more, on top of that.
    let program = LoadedProgram { contour: &rest.contour, ..program };
    let again = replan(program, &rest.tools, &tool(-2.0), &rest.plan.path, 3).expect("it can");
    let now = ends(&again.plan.path);
    assert_eq!(now[2..5], [[92.0, 92.0], [98.0, 2.0], [0.0, 2.0]], "{now:?}");
    assert_eq!(again.from_line, 4);
}

#[test]
fn a_value_may_change_within_a_line_that_is_written_in_pieces() {
    let (profile, before, after) = (sinumerik(), tool(5.0), tool(4.0));
    // The first two blocks are one line, which N30 ends with the new radius.
    let text = "N10 G41 D1 G456 G1 X0 Y0 F500
        N20 X30.3 Y10.1
        N30 X90.9 Y30.3
        N40 X60.6 Y121.2
        N50 G40 X-20 Y60";
    let line = contour(text, &profile);
    let program = LoadedProgram { name: "line", contour: &line, profile: &profile };
    let running = plan(text, &profile, &before).path;
    let rest = replan(program, &before, &after, &running, 2).expect("it can change");
    assert_eq!((rest.from_line, &rest.plan.path.elements[..2]), (3, &running.elements[..2]));
    let whole = plan(text, &profile, &after).path;
    assert_eq!(rest.plan.path.elements[3..], whole.elements[3..]);
}

#[test]
fn a_rest_that_cannot_change_leaves_the_program_as_it_is() {
    let (profile, before) = (from_a_corner(), tool(-5.0));
    let square = contour(SQUARE, &profile);
    let program = LoadedProgram { name: "square", contour: &square, profile: &profile };
    let running = plan(SQUARE, &profile, &before).path;
    let refused = |tools: &ToolTable, settled| {
        replan(program, &before, tools, &running, settled).expect_err("refused").message
    };
    for (radius, settled, part) in [
        (-60.0, 2, "line "),
        (-8.0, 99, "no straight block"),
        (-8.0, 0, "no straight block"),
        (-5.0, 2, "does not affect"),
    ] {
        let text = refused(&tool(radius), settled);
        assert!(text.contains(part), "{text}");
    }
    let profile = masso();
    let program = LoadedProgram { profile: &profile, ..program };
    let text =
        replan(program, &before, &tool(8.0), &running, 2).expect_err("not this control").message;
    assert_eq!(text, "masso uses a new value from the next run on");
}
