//! How a run begins at a line of a program (M28, C19).

mod support;

use cnc_msgs::finding::Code;
use cnc_msgs::path::StartInSpan;
use cnc_msgs::profile::{Profile, RestartMode, Strictness};
use compensation_planner::{NoStart, Start, start};
use support::{contour, masso, plan_of, rs274, sinumerik, tool};

/// Two contours, the second right after the first, with all that can be in force.
const TWO: &str = "N10 T1 M6 M3 X-50 Y-25 Z-5 F250
    N20 X-40
    N30 G41 D1 X-25
    N40 X100
    N50 Y-100
    N60 G40 X120 Y-120
    N70 G42 D1 X140
    N80 X180
    N90 G40 X200 Y-100
    N100 X210";

fn starts(text: &str, profile: &Profile, line: u32) -> Result<Start, Box<NoStart>> {
    let contour = contour(text, profile);
    let plan = plan_of(&contour, profile, &tool(5.0));
    assert!(plan.accepted(), "{:#?}", plan.findings);
    start(&contour, profile, &plan.path, line, 0)
}

fn lenient(mut profile: Profile, strictness: Strictness) -> Profile {
    // The links and leads here are of no interest.
    profile.interference.leads = Strictness::Warn;
    profile.restart.strictness = strictness;
    profile
}

#[test]
fn m28_where_it_is_forbidden_the_nearest_line_is_the_last_outside_of_compensation() {
    let masso = lenient(masso(), Strictness::Error);
    for (line, wanted) in [
        (2, None),
        (3, None),
        (4, Some((2, "start at line 2 (block N20) or before"))),
        (5, Some((2, "start at line 2 (block N20) or before"))),
        (6, Some((2, "start at line 2 (block N20) or before"))),
        // The selection itself: the block before it is the lead-off of the first contour.
        (7, None),
        (8, Some((7, "start at line 7 (block N70) or before"))),
        (9, Some((7, "start at line 7 (block N70) or before"))),
        (10, None),
    ] {
        let refused = starts(TWO, &masso, line).err();
        let refusal = refused.as_ref().map(|no| (no.nearest.line, no.finding.help.as_str()));
        assert_eq!(refusal, wanted, "line {line}");
        let is_restart = |no: &NoStart| no.finding.code == Code::Restart && no.finding.is_error();
        assert!(refused.is_none_or(|no| is_restart(&no)), "line {line}");
    }
    // What it names is a place to begin at.
    for line in [2, 7] {
        assert!(starts(TWO, &masso, line).is_ok(), "line {line}");
    }
}

#[test]
fn c19_where_it_is_rebuilt_a_run_begins_at_the_compensated_point_from_above() {
    let mut profiles = vec![sinumerik(), rs274(), masso()];
    profiles[2].restart.rule = RestartMode::Rebuild;
    for profile in profiles.into_iter().map(|profile| lenient(profile, Strictness::Error)) {
        let begun = |line| starts(TWO, &profile, line).expect("it begins");
        for (line, at, in_span) in [
            (3, [-40.0, -25.0, -5.0], StartInSpan::Refused),
            // The offset of N40, on the left of the contour.
            (4, [-25.0, -20.0, -5.0], StartInSpan::FromAbove),
            // N50 begins with the arc around the corner that belongs to it.
            (5, [100.0, -20.0, -5.0], StartInSpan::FromAbove),
            (6, [105.0, -100.0, -5.0], StartInSpan::FromAbove),
            (7, [120.0, -120.0, -5.0], StartInSpan::Refused),
            (8, [140.0, -125.0, -5.0], StartInSpan::FromAbove),
            (10, [200.0, -100.0, -5.0], StartInSpan::Refused),
        ] {
            let start = begun(line);
            let off = (0..3).map(|axis| (start.at[axis] - at[axis]).abs()).fold(0.0, f64::max);
            assert!(off < 1e-9, "{} line {line}: {start}", profile.name);
            assert_eq!(start.in_span, in_span, "{} line {line}", profile.name);
            assert_eq!(start.warning, None, "{} line {line}", profile.name);
        }
        let text = begun(5).to_string();
        let wanted = "begins with block N50 at X100.000 Y-20.000 Z-5.000, cutter left of the \
                      contour, F250, T1 M6 M3";
        assert_eq!(text, wanted, "{}", profile.name);
        assert_eq!(
            begun(10).to_string(),
            "begins with block N100 at X200.000 Y-100.000 Z-5.000, F250, T1 M6 M3"
        );
    }
}

#[test]
fn m28_as_a_warning_the_start_is_rebuilt_all_the_same() {
    let masso = lenient(masso(), Strictness::Warn);
    let start = starts(TWO, &masso, 5).expect("it begins");
    assert_eq!(start.in_span, StartInSpan::FromAbove);
    let warning = start.warning.expect("a warning");
    assert!(!warning.is_error());
    assert_eq!(
        warning.message,
        "line 5 lies under cutter compensation, which is on since block N30; masso does not start \
         there"
    );
}

#[test]
fn in_a_plane_that_holds_z_the_tool_has_to_stand_on_the_path() {
    let profile = lenient(sinumerik(), Strictness::Error);
    let text = "N10 G18 X0 Z20 Y0 F100
        N20 G41 D1 G456 G1 X0 Z0
        N30 X50
        N40 X90
        N50 G40 G456 X90 Z20
        N60 X100";
    let start = starts(text, &profile, 4).expect("it begins");
    assert_eq!(start.in_span, StartInSpan::Standing);
    assert!(start.to_string().ends_with("; the tool has to stand there"), "{start}");
    assert_eq!(starts(text, &profile, 6).expect("it begins").in_span, StartInSpan::Refused);
}

#[test]
fn nothing_begins_after_the_last_motion() {
    let refused = starts(TWO, &rs274(), 11).expect_err("it is past the end");
    assert_eq!(
        refused.finding.message,
        "the program has no motion from line 11 on; its last is in line 10"
    );
    assert_eq!(refused.nearest.line, 10);
}
