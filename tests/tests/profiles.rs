//! No key of a control profile is idle, and each is explained to users.

use cnc_msgs::tool_table::ToolTable;
use kerf_tests::root;
use kerf_tests::rows::observe::{merge, observe, profile};
use kerf_tests::rows::{Case, IN_ORDER};
use serde::Deserialize;
use serde_json::{Value, json};
use settings::Control;
use std::collections::{BTreeMap, BTreeSet};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    #[serde(rename = "programs")]
    _programs: Value,
    keys: Vec<Row>,
    elsewhere: BTreeMap<String, String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    key: String,
    control: String,
    /// What differs from the shipped profile on both sides.
    #[serde(default)]
    base: Value,
    change: Value,
    #[serde(default)]
    table: Option<ToolTable>,
    #[serde(default)]
    start_line: Option<u32>,
    #[serde(default)]
    radius_value: Option<(u32, f64)>,
    program: String,
    why: String,
}

fn table() -> Table {
    let text = std::fs::read_to_string(root().join("tests/profiles.yaml")).expect("the table");
    serde_yaml::from_str(&text).expect("its form")
}

/// `cancel.axes.rule`, of every key that a profile has.
fn keys() -> BTreeSet<String> {
    fn walk(value: &Value, path: &str, keys: &mut BTreeSet<String>) {
        match value {
            // The words of a control are values.
            Value::Object(fields) if !path.ends_with("words") => {
                for (key, value) in fields {
                    let dot = if path.is_empty() { "" } else { "." };
                    walk(value, &format!("{path}{dot}{key}"), keys);
                }
            }
            _ => {
                keys.insert(path.to_owned());
            }
        }
    }
    let mut keys = BTreeSet::new();
    let whole = serde_json::to_value(profile("sinumerik_840c", &Value::Null)).expect("a profile");
    walk(&whole, "", &mut keys);
    keys
}

fn default_tools() -> ToolTable {
    serde_json::from_value(json!({
        "tools": {"1": {"diameter_mm": 10.0}, "2": {"diameter_mm": 16.0}},
        "offsets": {"1": {"radius_mm": 5.0}, "2": {"radius_mm": 7.0}},
    }))
    .expect("tools")
}

#[test]
fn every_key_changes_what_comes_of_some_program() {
    let mut idle = Vec::new();
    for row in table().keys {
        let outcome = |changes: Value| {
            let case = Case {
                name: row.key.clone(),
                control: Some(row.control.clone()),
                profile: changes,
                table: row.table.clone().unwrap_or_else(default_tools),
                start: [0.0; 3],
                program: row.program.clone(),
                start_line: row.start_line,
                radius_value: row.radius_value,
                other: None,
                tolerance: 1e-6,
                expect: Value::Null,
            };
            observe(&case, &row.control)
        };
        let mut changed = row.base.clone();
        merge(&mut changed, &row.change);
        let (before, after) = (outcome(row.base.clone()), outcome(changed));
        if before == after {
            idle.push(format!("{}: {} ({})", row.key, row.why, before["findings"]));
        }
    }
    assert!(idle.is_empty(), "{}", idle.join("\n"));
}

#[test]
fn every_key_has_its_proof() {
    let table = table();
    let proved: BTreeSet<String> = (table.keys.iter().map(|row| row.key.clone()))
        .chain(table.elsewhere.keys().cloned())
        .collect();
    let missing: Vec<_> = keys().difference(&proved).cloned().collect();
    let unknown: Vec<_> = proved.difference(&keys()).cloned().collect();
    assert!(missing.is_empty() && unknown.is_empty(), "missing {missing:?}, unknown {unknown:?}");
}

#[test]
fn every_key_is_explained_to_users() {
    let page = std::fs::read_to_string(root().join("docs/profiles.md")).expect("docs/profiles.md");
    let missing: Vec<_> =
        keys().into_iter().filter(|key| !page.contains(&format!("`{key}`"))).collect();
    assert!(missing.is_empty(), "docs/profiles.md does not explain {missing:#?}");
}

/// The rows C1 to C21 of `docs/rules.md`, and the keys that decide them.
const QUESTIONS: [(&str, &[&str]); 21] = [
    ("C1", &["off_plane.max_blocks", "off_plane.strictness"]),
    ("C2", &["auxiliary.functions.rule", "auxiliary.moves.rule", "auxiliary.anchor"]),
    ("C3", &["radius.source.rule"]),
    ("C4", &["radius.negative.rule"]),
    ("C5", &["language.dialect"]),
    ("C6", &["corner.words", "corner.default"]),
    ("C7", &["full_circle.rule"]),
    ("C8", &["language.planes.rule"]),
    ("C9", &["rapid.rule"]),
    ("C10", &["select.length.rule", "select.arc_lead"]),
    ("C11", &["select.target"]),
    ("C12", &["side_change.rule"]),
    ("C13", &["reselect.rule"]),
    ("C14", &["cancel.axes.rule", "cancel.missing"]),
    ("C15", &["radius.change.rule"]),
    ("C16", &["home.rule"]),
    ("C17", &["lookahead.blocks"]),
    ("C18", &["interference.react", "interference.leads"]),
    ("C19", &["restart.rule"]),
    ("C20", &["mdi.rule"]),
    ("C21", &["d0"]),
];

/// `UPDATE_EXPECT=1 cargo test -p kerf_tests --test profiles decides` writes it anew.
#[test]
fn the_page_says_how_each_profile_decides() {
    let controls = IN_ORDER.map(Control::name);
    let profiles = controls.map(|name| {
        serde_json::to_value(profile(name, &Value::Null)).expect("a profile is plain data")
    });
    let mut page = String::from(
        "# How each control decides\n\nMade from `config/controls/` by a test. The rows are those \
         of [rules.md](rules.md).\n\n",
    );
    page += &format!(
        "| row | key | {} |\n|---|---|{}\n",
        controls.join(" | "),
        "---|".repeat(controls.len())
    );
    for (row, keys) in QUESTIONS {
        for key in keys {
            let pointer = format!("/{}", key.replace('.', "/"));
            let values = profiles.each_ref().map(|profile| match profile.pointer(&pointer) {
                None | Some(Value::Null) => "no limit".to_owned(),
                Some(Value::String(word)) => word.clone(),
                Some(Value::Array(words)) => {
                    let words = words.iter().map(|word| word.as_str().unwrap_or("?"));
                    words.collect::<Vec<_>>().join(", ")
                }
                Some(Value::Object(words)) if words.is_empty() => "none".to_owned(),
                Some(Value::Object(words)) => {
                    let words = words.iter().map(|(word, is)| format!("{word}: {is}"));
                    words.collect::<Vec<_>>().join(", ").replace('"', "")
                }
                Some(other) => other.to_string(),
            });
            page += &format!("| {row} | `{key}` | {} |\n", values.join(" | "));
        }
    }
    expect_test::expect_file!["../../docs/rules_by_control.md"].assert_eq(&page);
}

#[test]
fn the_sixth_profile_of_the_page_works() {
    let text = std::fs::read_to_string(root().join("config/examples/workshop.yaml")).expect("it");
    let own: cnc_msgs::profile::Profile = serde_yaml::from_str(&text).expect("a profile");
    own.check().expect("a consistent one");
    // LinuxCNC words under 840C rules: registers, G456 and the normal position.
    let program = "G0 X0 Y20\nG41 G456 D1 G1 X0 Y0 F400\nX50\nG40 G456 X50 Y20\nM30\n";
    let loaded = program_loader::load(program.as_bytes(), &own, &Default::default());
    assert_eq!(loaded.findings, []);
    let plan = compensation_planner::plan(&loaded.contour, &own, &default_tools());
    assert_eq!(plan.findings, []);
    assert_eq!(plan.path.elements[1].end, [0.0, 5.0, 0.0]);
}
