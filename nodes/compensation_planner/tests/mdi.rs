//! A single block of manual data input is never compensated (N09, C20).

mod support;

use cnc_msgs::profile::{MdiMode, Rule, Strictness};
use compensation_planner::mdi::plan_block;
use support::{contour, findings, profile, tool};

#[test]
fn n09_a_selection_in_a_single_block_is_without_effect_or_refused_as_the_profile_says() {
    use MdiMode::{Forbidden, Uncompensated};
    use Strictness::{Emulate, Error, Warn};
    for (rule, strictness, is_accepted) in [
        (Uncompensated, Warn, true),
        (Uncompensated, Emulate, true),
        (Uncompensated, Error, false),
        (Forbidden, Error, false),
        (Forbidden, Warn, true),
    ] {
        let mut profile = profile("sinumerik_840c");
        profile.mdi = Rule { rule, strictness };
        let block = contour("G41 D1 G1 X10 F200", &profile);
        let planned = plan_block(&block, &profile, &tool(5.0)).plan;
        assert_eq!(planned.accepted(), is_accepted, "{}", findings(&planned));
        assert_eq!(planned.findings.len(), 1);
        let text = &planned.findings[0].message;
        assert!(text.starts_with("compensation left of the contour"), "{text}");
        let ends: Vec<_> = planned.path.elements.iter().map(|e| (e.end, e.side)).collect();
        assert_eq!(ends, if is_accepted { vec![([10.0, 0.0, 0.0], None)] } else { Vec::new() });
    }
}

#[test]
fn a_single_block_without_a_selection_has_no_findings() {
    let profile = profile("nct");
    let planned = plan_block(&contour("G1 X10 Y5 F200", &profile), &profile, &tool(5.0)).plan;
    assert!(planned.findings.is_empty() && planned.path.elements.len() == 1);
}
