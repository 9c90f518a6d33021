//! Calculations of the 840C: blocks that set R parameters.

mod common;

use cnc_msgs::contour::ContourEventKind;
use common::profile;
use program_loader::{LoadOptions, Loaded, load};

const SIEMENS: &str = "sinumerik_840c";

fn loaded(control: &str, text: &str) -> Loaded {
    load(text.as_bytes(), &profile(control), &LoadOptions::default())
}

#[test]
fn a_calculation_under_compensation_is_a_block_of_the_contour() {
    let calculations = |text: &str| {
        let loaded = loaded(SIEMENS, text);
        assert!(loaded.is_accepted(), "{:#?}", loaded.findings);
        let events = loaded.contour.events.iter();
        events.filter(|event| event.kind == ContourEventKind::Calculation).count()
    };
    // After G40 as well, where the planner knows when the compensation has ended.
    let text = "R1=5\nG0 X0 Y20\nG41 D1 G1 X0 Y0 F100\nX10\nN30 R1=15 R2=R1\nX=R1\nG40 X30 Y20\nR1=1\nM30\n";
    let refused = loaded(SIEMENS, text);
    assert!(!refused.is_accepted(), "R1 is set in this block, and read in it");
    assert_eq!(calculations(&text.replace(" R2=R1", " R2=3")), 2);
    assert_eq!(
        calculations(&text.replace(" R2=R1", " L5").replace("M30\n", "M30\n%SPF5\nM17\n")),
        2
    );
    assert_eq!(calculations("R1=5\nG0 X=R1\nR1=6\nM30\n"), 0);
}

#[test]
fn a_calculation_that_is_not_certain_is_refused_at_its_place() {
    for (text, message, place) in [
        ("R1=2+3*4", "+ or - and * or / in one calculation", (1, 7)),
        ("R1=5\nR2=R1/0", "a division by zero", (2, 6)),
        ("G0 X=R7", "R7 has no value: nothing before this block has set it", (1, 6)),
        ("R1=1 R2=R1", "R1 is set in this block, and read in it", (1, 9)),
        ("R1=1 G0 X5", "a calculation in a block with other words", (1, 1)),
        ("R1=SIN(5)", "a number or a parameter is missing here", (1, 4)),
        ("R1=", "a number or a parameter is missing here", (1, 3)),
        ("R12345=1", "`R12345` is not the number of a parameter", (1, 1)),
        ("R5", "sinumerik_840c has no word R5", (1, 1)),
    ] {
        let loaded = loaded(SIEMENS, &format!("{text}\nM30\n"));
        let [finding] = loaded.findings.as_slice() else {
            panic!("{text}\n{:#?}", loaded.findings)
        };
        assert_eq!(finding.message, message, "{text}");
        assert_eq!((finding.source.line, finding.source.column), place, "{text}");
        assert!(finding.is_error() && !finding.help.is_empty(), "{text}");
    }
    // No other control has them.
    let loaded = loaded("nct", "R1=5\nM30\n");
    assert!(!loaded.is_accepted());
}
