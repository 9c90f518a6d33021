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
    check("masso", "G0 X0\nG1 X#<depth> F100", &["2: `X#<depth>` is an expression"]);
    check("masso", "G0 X-#<a_1> Y0", &["1: `X-#<a_1>` is an expression"]);
    check("masso", "G0 X[#<a>+[2]] Y0", &["1: `X[#<a>+[2]]` is an expression"]);
    check(
        "masso",
        "G0 X#[1+#2] Y##3",
        &["1: `X#[1+#2]` is an expression", "1: `Y##3` is an expression"],
    );
    check("masso", "G0 X#<open", &["1: `X#<open` is an expression"]);
}

#[test]
fn an_error_is_reported_once_however_often_a_program_comes_there() {
    check(
        "rs274",
        "o<pocket> sub\no10 repeat [3]\nG1 X[1/#1] F100\no10 endrepeat\no<pocket> endsub\n\
         o1 while [#2 LT 5]\n#2=[#2+1]\no<pocket> call [3-#2]\no1 endwhile\nG1 X#7 Y[1/0]",
        &["3: a division by zero", "10: a division by zero"],
    );
}

#[test]
fn parameters_have_the_state_of_the_machine_or_say_that_it_is_not_known() {
    let state = "G20 G18 G91 F10 S500 M3 M8 T2 M6 G99\nG90 G1 X1 Y2 Z3\n";
    for (name, value) in [
        ("_x", 1.0),
        ("_y", 2.0),
        ("_feed", 10.0),
        ("_rpm", 500.0),
        ("_metric", 0.0),
        ("_plane", 180.0),
        ("_absolute", 1.0),
        ("_motion_mode", 10.0),
        ("_spindle_cw", 1.0),
        ("_flood", 1.0),
        ("_mist", 0.0),
        ("_current_tool", 2.0),
        ("_coord_system", 540.0),
        ("_retract_old_z", 1.0),
        ("_line", 3.0),
    ] {
        // Without cycles, G99 is there for whoever reads it.
        let read = "#1=#<_retract_old_z>";
        let text = format!("{state}o1 if [#<{name}> NE {value}]\nG0 X[1/0]\no1 endif\n{read}");
        check("rs274", &text, &[]);
    }
    check("rs274", "T3 M6\nG0 X#5420 Y#5400 Z#5220", &[]);
    check(
        "rs274",
        "G0 Z#5400",
        &["1: #5400 is the tool in the spindle, which is known only after M6"],
    );
    check("rs274", "G28\nG0 X#<_x>", &["2: #<_x> is the position of X, which is not known here"]);
    check(
        "rs274",
        "G0 X#5221",
        &[
            "1: #5221 is a work offset of the machine, which is known only there or from a parameter file",
        ],
    );
    check(
        "rs274",
        "#<_x>=5\n#9=1",
        &["1: `#<_x>=5`: this parameter cannot be set, the machine gives its value"],
    );
}

#[test]
fn a_refused_cycle_is_one_finding_with_its_words_and_the_blocks_after_it() {
    for (control, cycle) in [
        ("masso", "G83 X1 Z-2 R1 Q1"),
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
