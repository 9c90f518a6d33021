//! Rows of the manuals that prove themselves.
//!
//! Each row has a case that no other row has. A case that expects a path notices another
//! radius, the other side and a moved coordinate; what other cases do not notice is listed
//! in `tests/controls/unnoticed.txt`. The switch of a row changes what comes of its cases.

use kerf_tests::root;
use kerf_tests::rows::compare::matches;
use kerf_tests::rows::observe::{merge, observe};
use kerf_tests::rows::{Case, RuleRow, controls, of};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// Rows that a worked program belongs to; others show parts of it.
const OWNERS: [&str; 4] = ["M12", "S72", "W1", "W2"];

/// What a case becomes by small mistakes.
type Mutate = fn(&Case) -> Vec<Case>;

/// All rows with their control.
fn rows() -> Vec<(&'static str, RuleRow)> {
    controls().flat_map(|control| of(control).into_iter().map(move |row| (control, row))).collect()
}

/// What a case is made of, without what it expects.
fn inputs(control: &str, case: &Case) -> String {
    let Case { profile, table, start, program, radius_value, start_line, other, .. } = case;
    let control = case.control.as_deref().unwrap_or(control);
    format!(
        "{control} {profile} {table:?} {start:?} {program} {radius_value:?} {start_line:?} {other:?}"
    )
}

/// How many rows have each input.
fn shares(rows: &[(&'static str, RuleRow)]) -> BTreeMap<String, BTreeSet<String>> {
    let mut shares: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (control, row) in rows {
        for case in &row.cases {
            shares.entry(inputs(control, case)).or_default().insert(row.id.clone());
        }
    }
    shares
}

fn is_noticed(case: &Case, control: &str, mutant: &Case) -> bool {
    let mut expect = case.expect.clone();
    let object = expect.as_object_mut().expect("an object");
    object.entry("findings").or_insert_with(|| json!([]));
    matches(&expect, &observe(mutant, control), case.tolerance).is_err()
}

/// The radius times 1.03, wherever it comes from.
fn with_another_radius(case: &Case) -> Vec<Case> {
    const FACTOR: f64 = 1.03;
    let mut mutant = case.clone();
    let mut is_changed = false;
    let mut scale = |value: &mut f64| {
        is_changed |= *value != 0.0;
        *value *= FACTOR;
    };
    for tool in mutant.table.tools.values_mut() {
        scale(&mut tool.diameter_mm);
        scale(&mut tool.wear_diameter_mm);
        scale(&mut tool.nose_radius_mm);
    }
    for offset in mutant.table.offsets.values_mut() {
        scale(&mut offset.radius_mm);
        scale(&mut offset.wear_mm);
    }
    let lines = case.program.lines().map(|line| {
        let values = ["G43 P", "G41 P", "G42 P", "SetRadius(", "G41.1 D", "G42.1 D"];
        for word in values {
            let Some(at) = line.find(word) else { continue };
            let rest = &line[at + word.len()..];
            let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.' && c != '-');
            let (number, rest) = rest.split_at(end.unwrap_or(rest.len()));
            let Ok(mut value) = number.parse::<f64>() else { continue };
            scale(&mut value);
            return format!("{}{word}{value}{rest}\n", &line[..at]);
        }
        format!("{line}\n")
    });
    mutant.program = lines.collect();
    if is_changed { vec![mutant] } else { Vec::new() }
}

/// G42 for G41 and vice versa.
fn on_the_other_side(case: &Case) -> Vec<Case> {
    let swapped =
        case.program.replace("G41", "G4\u{0}").replace("G42", "G41").replace("G4\u{0}", "G42");
    if swapped == case.program {
        return Vec::new();
    }
    vec![Case { program: swapped, ..case.clone() }]
}

/// Each coordinate after the selection moved by 0.05 mm.
fn with_a_moved_coordinate(case: &Case) -> Vec<Case> {
    let selects = |line: &str| line.contains("G41") || line.contains("G42");
    let from = case.program.lines().position(selects).unwrap_or(usize::MAX);
    let lines = case.program.lines().enumerate().filter(|(index, _)| *index > from);
    let moved = lines.flat_map(|(index, line)| {
        let coordinates = (0..line.len()).filter(|&at| is_coordinate(line.as_bytes(), at));
        coordinates.filter_map(move |at| Some((index, with_more(line, at, 0.05)?)))
    });
    moved
        .map(|(index, line)| Case {
            program: with_line(&case.program, index, &line),
            ..case.clone()
        })
        .collect()
}

fn is_coordinate(line: &[u8], at: usize) -> bool {
    b"XYZ".contains(&line[at])
        && (at == 0 || !line[at - 1].is_ascii_alphanumeric())
        && line.get(at + 1).is_some_and(|next| next.is_ascii_digit() || *next == b'-')
}

/// The line with more after the letter at a place.
fn with_more(line: &str, at: usize, more: f64) -> Option<String> {
    let (head, rest) = line.split_at(at + 1);
    let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.' && c != '-');
    let (number, tail) = rest.split_at(end.unwrap_or(rest.len()));
    Some(format!("{head}{:.6}{tail}", number.parse::<f64>().ok()? + more))
}

fn with_line(program: &str, index: usize, line: &str) -> String {
    let lines = program.lines().enumerate();
    lines.map(|(at, old)| if at == index { line } else { old }.to_owned() + "\n").collect()
}

/// Whether a case expects where a compensated path goes.
fn expects_a_path(case: &Case) -> bool {
    let is_compensated = |element: &Value| !matches!(element["role"].as_str(), None | Some("none"));
    ["path", "moves"].iter().any(|key| {
        let elements = case.expect[*key].as_array();
        elements.is_some_and(|list| {
            list.iter().any(is_compensated) || (*key == "path" && !list.is_empty())
        })
    })
}

#[test]
fn each_row_has_a_case_of_its_own() {
    let rows = rows();
    let shares = shares(&rows);
    let without: Vec<&str> = rows
        .iter()
        .filter(|(_, row)| row.nodes.is_empty() && !OWNERS.contains(&row.id.as_str()))
        .filter(|(control, row)| {
            row.cases.iter().all(|case| shares[&inputs(control, case)].len() > 1)
        })
        .map(|(_, row)| row.id.as_str())
        .collect();
    assert!(without.is_empty(), "{} rows have only cases of others: {without:?}", without.len());
}

#[test]
fn a_case_notices_another_radius_the_other_side_and_a_moved_coordinate() {
    let mutants: [(&str, Mutate); 3] = [
        ("radius", with_another_radius),
        ("side", on_the_other_side),
        ("coordinate", with_a_moved_coordinate),
    ];
    let (mut failures, mut listed, mut count) = (String::new(), String::new(), 0);
    for (control, row) in &rows() {
        for case in &row.cases {
            let before = observe(case, control);
            let spans = before["spans"].as_array().into_iter().flatten();
            let mut radii = spans.filter_map(|span| span["radius_mm"].as_f64());
            if !radii.any(|radius_mm| radius_mm != 0.0) && before["accepted"] == true {
                continue;
            }
            let unnoticed: Vec<&str> = mutants
                .iter()
                .filter(|(_, mutate)| {
                    let mutants = mutate(case);
                    let is_blind = |mutant: &Case| !is_noticed(case, control, mutant);
                    !mutants.is_empty() && mutants.iter().all(is_blind)
                })
                .map(|(name, _)| *name)
                .collect();
            count += usize::from(unnoticed.is_empty());
            if unnoticed.is_empty() {
                continue;
            }
            let to = if expects_a_path(case) { &mut failures } else { &mut listed };
            writeln!(to, "{} {}: {}", row.id, case.name, unnoticed.join(", ")).expect("a text");
        }
    }
    assert!(failures.is_empty(), "expects a path and does not notice:\n{failures}");
    assert!(count > 200, "{count} cases notice everything");
    expect_test::expect_file![root().join("tests/controls/unnoticed.txt")].assert_eq(&listed);
}

/// The changes of a key, or of those below it, that `tests/profiles.yaml` has.
fn changes_of(switch: &str) -> Vec<Value> {
    let text = std::fs::read_to_string(root().join("tests/profiles.yaml")).expect("the table");
    let table: Value = serde_yaml::from_str(&text).expect("its form");
    let keys = table["keys"].as_array().expect("a list").iter();
    let is_of = |key: &str| {
        let below = key.strip_prefix(switch);
        below.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
    };
    keys.filter(|row| is_of(row["key"].as_str().unwrap_or_default()))
        .map(|row| {
            let mut change = row["base"].clone();
            if change.is_null() {
                change = json!({});
            }
            merge(&mut change, &row["change"]);
            change
        })
        .collect()
}

#[test]
fn the_switch_of_a_row_changes_what_comes_of_its_cases() {
    let mut idle = Vec::new();
    for (control, row) in &rows() {
        let Some(switch) = &row.switch else { continue };
        if row.cases.is_empty() {
            continue;
        }
        let changes = changes_of(switch);
        let pointer = format!("/{}", switch.replace('.', "/"));
        let switches = row.cases.iter().any(|case| {
            if case.profile.pointer(&pointer).is_some() {
                return true;
            }
            let before = observe(case, control);
            changes.iter().any(|change| {
                let mut profile = case.profile.clone();
                if profile.is_null() {
                    profile = json!({});
                }
                merge(&mut profile, change);
                let other = Case { profile, ..case.clone() };
                std::panic::catch_unwind(|| observe(&other, control))
                    .is_ok_and(|after| after != before)
            })
        });
        if !switches {
            idle.push(format!("{} {switch}", row.id));
        }
    }
    assert!(idle.is_empty(), "{} rows: {idle:#?}", idle.len());
}
