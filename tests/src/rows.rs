//! The rows of the control manuals as data: `tests/controls/*.yaml`.
//!
//! A row is one rule of a control. It is proved by cases, which are programs
//! with what must come of them, or by a test of a node that takes its numbers
//! from here. This file knows the form of the data; `observe` runs a case and
//! `compare` judges it.

pub mod compare;
pub mod observe;
mod start;

use crate::files;
use cnc_msgs::tool_table::ToolTable;
use serde::Deserialize;
use serde_json::Value;
use settings::Control;
use std::path::PathBuf;

/// All controls in the order of the pages: the default first.
pub const IN_ORDER: [Control; Control::ALL.len()] = [
    Control::Rs274,
    Control::Masso,
    Control::Automation1,
    Control::OspLathe,
    Control::Sinumerik840c,
    Control::Nct,
];

/// The files in `tests/controls`, in the order of the page: of each control that [`manual`] knows.
pub fn controls() -> impl Iterator<Item = &'static str> {
    IN_ORDER.into_iter().filter(|control| manual(*control).is_some()).map(Control::name)
}

/// The identifiers of the rows of a control's manual. `None`: its rows are tested elsewhere.
pub fn manual(control: Control) -> Option<Vec<String>> {
    let (letter, last, worked_programs) = match control {
        // LinuxCNC, which the oracles compare with.
        Control::Rs274 => return None,
        Control::Masso => ('M', 30, 0),
        Control::Automation1 => ('A', 22, 0),
        Control::OspLathe => ('O', 8, 0),
        Control::Sinumerik840c => ('S', 73, 2),
        Control::Nct => ('N', 10, 0),
    };
    let rules = (1..=last).map(|n| format!("{letter}{n:02}"));
    Some(rules.chain((1..=worked_programs).map(|n| format!("W{n}"))).collect())
}

/// One rule of a control.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RuleRow {
    /// `S06`.
    pub id: String,
    /// What it asks, in one line.
    pub rule: String,
    /// The key of the profile that it can be switched with.
    #[serde(default)]
    pub switch: Option<String>,
    /// How it is read where the manual's figure is lost.
    #[serde(default)]
    pub interpretation: Option<String>,
    /// What of it does not hold, and why.
    #[serde(default)]
    pub falls_short: Option<String>,
    #[serde(default)]
    pub cases: Vec<Case>,
    /// Tests of nodes.
    #[serde(default)]
    pub nodes: Vec<NodeTest>,
}

/// A program and what must come of it.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// What it shows.
    pub name: String,
    /// The profile; that of the file when absent.
    #[serde(default)]
    pub control: Option<String>,
    /// Keys that differ from the profile.
    #[serde(default)]
    pub profile: Value,
    #[serde(default)]
    pub table: ToolTable,
    /// Where the tool is before the program, mm.
    #[serde(default)]
    pub start: [f64; 3],
    pub program: String,
    /// The program changes the value of the offset in force: in this line, to this
    /// radius, mm. No language here has words for it; the neutral events do.
    #[serde(default)]
    pub radius_value: Option<(u32, f64)>,
    /// A line to start the program at.
    #[serde(default)]
    pub start_line: Option<u32>,
    /// A program whose path must be the same; see `same_mm` in `observe`.
    #[serde(default)]
    pub other: Option<Other>,
    /// How far numbers may be off; smaller than what a perturbed number is off by.
    #[serde(default = "tolerance")]
    pub tolerance: f64,
    pub expect: Value,
}

/// What differs in the program to compare with.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Other {
    #[serde(default)]
    pub control: Option<String>,
    #[serde(default)]
    pub profile: Value,
    #[serde(default)]
    pub table: Option<ToolTable>,
    #[serde(default)]
    pub program: Option<String>,
}

/// A test of a node that proves a row with the numbers given here.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NodeTest {
    /// Its file, from the root.
    pub file: String,
    /// Its name.
    pub test: String,
    pub expect: Value,
}

const fn tolerance() -> f64 {
    2e-6
}

/// All rows of a control, in order: `nct.yaml`, `nct_node.yaml`, ...
///
/// # Panics
/// There is no file, or it has not the form of rows.
pub fn of(control: &str) -> Vec<RuleRow> {
    let is_of_control = |path: &PathBuf| {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        name.strip_prefix(control).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
            && path.parent().is_some_and(|folder| folder.ends_with("tests/controls"))
    };
    let mut rows: Vec<RuleRow> = Vec::new();
    for path in files(".yaml").iter().filter(|path| is_of_control(path)) {
        let text = std::fs::read_to_string(path).expect("rows are a file");
        let more: Vec<RuleRow> = serde_yaml::from_str(&text)
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        rows.extend(more);
    }
    rows.sort_by(|a, b| a.id.cmp(&b.id));
    // What is proved in two places, in cases and at a node, is one row.
    rows.dedup_by(|more, row| {
        let is_same = more.id == row.id && (more.cases.is_empty() || row.cases.is_empty());
        if is_same {
            if row.cases.is_empty() {
                std::mem::swap(row, more);
            }
            row.nodes.append(&mut more.nodes);
        }
        is_same
    });
    rows
}

/// Checks what a test of a node has seen against the numbers of its row, and
/// that other numbers would not do.
///
/// # Panics
/// There is no such row, or what was seen is not what it asks.
pub fn check_at_node(id: &str, test: &str, observed: &Value) {
    let rows = controls().flat_map(of);
    let row = rows.into_iter().find(|row| row.id == id).expect("the row is there");
    let node = row.nodes.iter().find(|node| node.test == test).expect("the row names the test");
    if let Err(difference) = compare::matches(&node.expect, observed, tolerance()) {
        panic!("{id}: {difference}");
    }
    let lax = compare::lax_numbers(&node.expect, observed, tolerance());
    assert!(lax.is_empty(), "{id}: another number would do as well: {lax:?}");
}
