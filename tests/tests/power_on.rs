//! What a control assumes at power-on, after the end of a program and after a reset (N08).
//!
//! Here each program is read and planned from G40, whatever ran before it.

use cnc_msgs::tool_table::ToolTable;
use kerf_tests::rows::observe::observe;
use kerf_tests::rows::{Case, check_at_node};
use serde_json::{Value, json};

fn moves(program: &str, profile: Value) -> Value {
    let table: ToolTable =
        serde_json::from_value(json!({"offsets": {"1": {"radius_mm": 5.0}}})).expect("a table");
    let case = Case {
        name: String::new(),
        control: None,
        profile,
        table,
        start: [0.0; 3],
        program: program.into(),
        start_line: None,
        radius_value: None,
        other: None,
        tolerance: 1e-6,
        expect: Value::Null,
    };
    let ends =
        |element: &Value| json!({"x": element["x"], "y": element["y"], "role": element["role"]});
    observe(&case, "nct")["moves"].as_array().expect("a list").iter().map(ends).collect()
}

#[test]
fn n08_a_program_after_one_that_ended_under_compensation_begins_with_g40() {
    let left_active = "N10 G0 X0 Y20\nN20 G41 D1 G1 X0 Y0 F100\nN30 X50\nN40 M30\n";
    let without_g40 = "N10 G0 X0 Y20\nN20 D1 G1 X0 Y0 F100\nN30 X50\nN40 M30\n";
    let first = moves(left_active, json!({"cancel": {"missing": "emulate"}}));
    let second = moves(without_g40, Value::Null);
    check_at_node(
        "N08",
        "n08_a_program_after_one_that_ended_under_compensation_begins_with_g40",
        &json!({"first": first, "second": second}),
    );
}
