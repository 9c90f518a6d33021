//! The advice of findings, applied: what a help text says to do makes the finding go.
//!
//! `tests/remedies.yaml` has a program for each help text with a concrete remedy, and the
//! same program with the remedy applied. Help that leaves the choice to its reader is
//! listed there as free text. Every help text that any program of the tests gets is one
//! or the other.

use cnc_msgs::tool_table::ToolTable;
use kerf_tests::root;
use kerf_tests::rows::observe::{observe, profile};
use kerf_tests::rows::{Case, controls, of};
use program_loader::{LoadOptions, load};
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeSet;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    remedies: Vec<Remedy>,
    /// Parts of help texts that leave the choice to their reader.
    free: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Remedy {
    /// A part of the help text.
    help: String,
    /// The code of the finding.
    code: String,
    control: String,
    #[serde(default)]
    profile: Value,
    #[serde(default)]
    table: ToolTable,
    program: String,
    /// Text of the program, and its replacement by the remedy.
    #[serde(default)]
    replace: Vec<(String, String)>,
    /// The tool table and the profile with the remedy.
    #[serde(default)]
    mended_table: Option<ToolTable>,
    #[serde(default)]
    mended_profile: Option<Value>,
}

impl Remedy {
    fn case(&self, is_mended: bool) -> Case {
        let mut program = self.program.clone();
        let (mut table, mut changes) = (self.table.clone(), self.profile.clone());
        if is_mended {
            for (from, to) in &self.replace {
                assert!(program.contains(from), "{}: no {from:?}", self.help);
                program = program.replace(from, to);
            }
            table = self.mended_table.clone().unwrap_or(table);
            changes = self.mended_profile.clone().unwrap_or(changes);
        }
        Case {
            name: self.help.clone(),
            control: None,
            profile: changes,
            table,
            start: [0.0; 3],
            program,
            start_line: None,
            radius_value: None,
            other: None,
            tolerance: 1e-6,
            expect: Value::Null,
        }
    }
}

fn table() -> Table {
    let text = std::fs::read_to_string(root().join("tests/remedies.yaml")).expect("the table");
    serde_yaml::from_str(&text).expect("its form")
}

fn findings(observed: &Value) -> Vec<(&str, &str, &str)> {
    let text = |finding: &Value, key: &str| finding[key].as_str().is_some();
    let list = observed["findings"].as_array().expect("a list");
    list.iter()
        .filter(|finding| text(finding, "code"))
        .map(|finding| {
            let text = |key: &str| finding[key].as_str().unwrap_or_default();
            (text("code"), text("severity"), text("help"))
        })
        .collect()
}

#[test]
fn a_remedy_makes_its_finding_go_and_leaves_no_error() {
    let mut wrong = String::new();
    for remedy in table().remedies {
        let before = observe(&remedy.case(false), &remedy.control);
        let is_there = |&(code, _, help): &(&str, &str, &str)| {
            code == remedy.code && help.contains(&remedy.help)
        };
        if !findings(&before).iter().any(is_there) {
            wrong += &format!("{}: not found in {:#?}\n", remedy.help, findings(&before));
        }
        let after = observe(&remedy.case(true), &remedy.control);
        let stays =
            |&(code, severity, _): &(&str, &str, &str)| code == remedy.code || severity == "error";
        if findings(&after).iter().any(stays) {
            wrong += &format!("{}: with the remedy {:#?}\n", remedy.help, findings(&after));
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

/// All help texts of the rows, of the programs of the profile keys and of bad programs.
fn helps() -> BTreeSet<String> {
    let mut helps = BTreeSet::new();
    for control in controls() {
        for case in of(control).iter().flat_map(|row| &row.cases) {
            let observed = observe(case, control);
            helps.extend(findings(&observed).iter().map(|(.., help)| (*help).to_owned()));
        }
    }
    for entry in std::fs::read_dir(root().join("nodes/program_loader/tests/bad")).expect("there") {
        let folder = entry.expect("an entry").path();
        let control = folder.file_name().expect("a name").to_string_lossy().into_owned();
        for entry in std::fs::read_dir(&folder).expect("there") {
            let bytes = std::fs::read(entry.expect("an entry").path()).expect("a program");
            let loaded = load(&bytes, &profile(&control, &Value::Null), &LoadOptions::default());
            helps.extend(loaded.findings.into_iter().map(|finding| finding.help));
        }
    }
    helps.remove("");
    helps
}

/// Numbers are those of the program.
fn without_digits(text: &str) -> String {
    let shown = text.chars().filter(|letter| !letter.is_ascii_digit() && *letter != '.');
    shown.collect()
}

#[test]
fn every_help_text_is_applied_or_known_to_be_free() {
    let table = table();
    let known: Vec<String> = (table.remedies.iter().map(|remedy| &remedy.help))
        .chain(&table.free)
        .map(|part| without_digits(part))
        .collect();
    let is_known =
        |help: &String| known.iter().any(|part| without_digits(help).contains(part.as_str()));
    let unknown: Vec<_> = helps().into_iter().filter(|help| !is_known(help)).collect();
    assert!(unknown.is_empty(), "{unknown:#?}");
}
