//! What every control refuses, with a place and before anything moves.

use cnc_msgs::tool_table::ToolTable;
use kerf_tests::rows::Case;
use kerf_tests::rows::observe::observe;
use serde_json::{Value, json};
use settings::Control;

/// A contour in the words of a control; `{}` is replaced inside it.
fn program(control: Control, select: &str, inside: &str) -> String {
    let (start, tool) = match control {
        Control::OspLathe => ("N1 G0 X100 Z0\nN2 T010101\nN3 F100", ""),
        Control::Automation1 => ("G0 X0 Y20\nG43 P5\nF100", ""),
        Control::Masso | Control::Rs274 => ("T1 M6\nG0 X0 Y20\nF100", ""),
        Control::Sinumerik840c | Control::Nct => ("N1 G0 X0 Y20\nN2 F100", " D1"),
    };
    let (a, b, c, d) = match control {
        Control::OspLathe => ("X40 Z0", "Z30", "Z60", "X100 Z60"),
        _ => ("X0 Y0", "X50", "X90", "X90 Y20"),
    };
    format!("{start}\n{select}{tool} G1 {a}\n{b}\n{inside}\n{c}\nG40 {d}\nM2\n")
}

fn outcome(control: Control, program: String, table: &Value) -> Value {
    let table: ToolTable = serde_json::from_value(table.clone()).expect("a table");
    let case = Case {
        name: String::new(),
        control: Some(control.name().into()),
        profile: Value::Null,
        table,
        start: [0.0; 3],
        program,
        start_line: None,
        radius_value: None,
        other: None,
        tolerance: 1e-6,
        expect: Value::Null,
    };
    observe(&case, control.name())
}

fn tools() -> Value {
    json!({
        "tools": {"1": {"diameter_mm": 10.0, "nose_radius_mm": 5.0}},
        "offsets": {"1": {"radius_mm": 5.0}},
    })
}

/// An error of this code, at a line; nothing is put out to be run.
#[track_caller]
fn refused(control: Control, program: String, table: &Value, codes: &[&str]) {
    let observed = outcome(control, program.clone(), table);
    let findings = observed["findings"].as_array().expect("a list");
    let error = findings.iter().find(|finding| {
        finding["severity"] == "error" && codes.iter().any(|code| finding["code"] == **code)
    });
    let error = error.unwrap_or_else(|| panic!("{control}: no {codes:?}\n{program}\n{observed:#}"));
    assert!(error["line"].as_u64().expect("a line") > 0, "{control}: {error}");
    assert_eq!(observed["accepted"], false, "{control}");
    // What is drawn of it is never run: it has no events.
    assert_eq!(observed["events"], json!([]), "{control}");
}

#[test]
fn the_program_that_is_spoilt_here_is_a_good_one() {
    for control in Control::ALL {
        let side = if control == Control::OspLathe { "G42" } else { "G41" };
        let observed = outcome(control, program(control, side, ""), &tools());
        let errors = observed["findings"].as_array().expect("a list").iter();
        let errors: Vec<_> = errors.filter(|finding| finding["severity"] == "error").collect();
        assert!(errors.is_empty(), "{control}: {errors:#?}");
    }
}

#[test]
fn two_codes_of_one_group_and_words_that_contradict_each_other() {
    for control in Control::ALL {
        refused(control, program(control, "G41 G42", ""), &tools(), &["modal_conflict"]);
        refused(control, program(control, "G41", "G0 G1 X60"), &tools(), &["modal_conflict"]);
        refused(control, program(control, "G41", "G90 G91"), &tools(), &["modal_conflict"]);
        refused(control, program(control, "G41", "X60 X70"), &tools(), &["modal_conflict"]);
    }
}

#[test]
fn a_tool_or_register_that_the_table_does_not_have() {
    let other =
        json!({"tools": {"7": {"diameter_mm": 10.0}}, "offsets": {"9": {"radius_mm": 5.0}}});
    for control in Control::ALL.into_iter().filter(|control| *control != Control::Automation1) {
        refused(control, program(control, "G41", ""), &other, &["unknown_tool"]);
    }
    // Its radius is in the program, whatever the table holds.
    let bare = program(Control::Automation1, "G41", "").replace("G43 P5\n", "");
    refused(Control::Automation1, bare, &tools(), &["radius_source"]);
}

#[test]
fn a_radius_that_is_no_number_or_larger_than_the_contour() {
    for control in Control::ALL {
        let inside = if control == Control::OspLathe { "X80\nZ40\nX40" } else { "Y-20\nX54\nY0" };
        let huge = json!({
            "tools": {"1": {"diameter_mm": 100.0, "nose_radius_mm": 50.0}},
            "offsets": {"1": {"radius_mm": 50.0}},
        });
        let side = if control == Control::OspLathe { "G42" } else { "G41" };
        let text = program(control, side, inside).replace("G43 P5", "G43 P50");
        refused(control, text, &huge, &["unreachable", "gouge"]);
    }
    for control in [Control::Sinumerik840c, Control::Nct] {
        let table: ToolTable = serde_yaml::from_str("offsets: {1: {radius_mm: .nan}}").expect("it");
        assert!(table.check().is_err(), "{control}");
    }
    refused(
        Control::Automation1,
        program(Control::Automation1, "G41", "").replace("P5", "PNaN"),
        &tools(),
        &["bad_number", "syntax", "unknown_word"],
    );
    refused(Control::Masso, program(Control::Masso, "G41 PNaN", ""), &tools(), &["bad_number"]);
    refused(Control::Rs274, program(Control::Rs274, "G41.1 DNaN", ""), &tools(), &["bad_number"]);
}

#[test]
fn a_change_of_plane_under_compensation() {
    for control in Control::ALL {
        let side = if control == Control::OspLathe { "G42" } else { "G41" };
        let codes = ["forbidden_under_compensation", "unsupported"];
        refused(control, program(control, side, "G19"), &tools(), &codes);
    }
}
