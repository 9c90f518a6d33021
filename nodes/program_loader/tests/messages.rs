//! The texts of findings: one finding for each cause, with the word of the program.

mod common;

use common::profile;
use program_loader::{LoadOptions, load};

/// The findings of a program: `line: message`.
#[track_caller]
fn check(control: &str, text: &str, expected: &[&str]) {
    let text = format!("{text}\nM2\n");
    let loaded = load(text.as_bytes(), &profile(control), &LoadOptions::default());
    let found: Vec<String> =
        loaded.findings.iter().map(|it| format!("{}: {}", it.source.line, it.message)).collect();
    assert_eq!(found, expected, "{text:?}");
}

#[test]
fn an_expression_is_one_finding_with_all_of_it() {
    check("rs274", "G0 X0\nG1 X#<depth> F100", &["2: `X#<DEPTH>` is an expression"]);
    check("rs274", "G0 X-#<a_1> Y0", &["1: `X-#<A_1>` is an expression"]);
    check("rs274", "G0 X[#<a>+[2]] Y0", &["1: `X[#<A>+[2]]` is an expression"]);
    check(
        "rs274",
        "G0 X#[1+#2] Y##3",
        &["1: `X#[1+#2]` is an expression", "1: `Y##3` is an expression"],
    );
    check("rs274", "G0 X#<open", &["1: `X#<OPEN` is an expression"]);
}

#[test]
fn a_refused_cycle_is_one_finding_with_its_words_and_the_blocks_after_it() {
    for (control, cycle) in [
        ("rs274", "G83 X1 Z-2 R1 Q1"),
        ("sinumerik_840c", "G81 X1 Z-2 R1 Q2"),
        ("osp_lathe", "G73 X1 Z-2 Q1"),
    ] {
        let text = format!("G0 X0 Z5\n{cycle}\nX5 Z2.5\nZ2.5\nG80\nZ2.5\nG0 Z5\n");
        let text = if control == "osp_lathe" { text.replace("G80\n", "") } else { text };
        let word = cycle.split(' ').next().unwrap_or_default();
        check(control, &text, &[&format!("2: {word} is not supported")]);
    }
    check("nct", "G0 X0\nG77 U5 X1", &["2: nct has no word G77"]);
    // Without a rejected word the letter is a finding by itself.
    check("nct", "G0 X0\nG1 U5 X1 F100", &["2: U is not an axis of this machine"]);
}

#[test]
fn a_call_is_named_as_it_is_written() {
    check(
        "automation1",
        "G43 P5\nG41 G1 X0 Y0 F100\nCutterCompensationSetRadius(2)\nG40 G1 X9 Y9",
        &[
            "3: CutterCompensationSetRadius must not stand under cutter radius compensation, which is on since line 2",
        ],
    );
}
