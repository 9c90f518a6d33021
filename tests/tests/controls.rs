//! Every row of the control manuals, one test each: `cargo test S06` runs one.
//!
//! The rows are data in `tests/controls/*.yaml`. A row holds when all its cases
//! do, and when none of its numbers could be another; the page
//! `docs/controls.md` is made of them.

use kerf_tests::root;
use kerf_tests::rows::compare::{count_numbers, lax_numbers, matches};
use kerf_tests::rows::observe::observe;
use kerf_tests::rows::{IN_ORDER, RuleRow, controls, manual, of};
use libtest_mimic::{Arguments, Failed, Trial};
use serde_json::json;
use std::fmt::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let mut trials = vec![
        Trial::test("every_rule_of_the_manuals_has_its_row", every_rule_has_its_row),
        Trial::test("the_page_of_all_rows_is_up_to_date", the_page_is_up_to_date),
    ];
    for control in controls() {
        for row in of(control) {
            let name = format!("{}::{}", control, row.id);
            trials.push(Trial::test(name, move || holds(&row, control)));
        }
    }
    libtest_mimic::run(&arguments, trials).exit_code()
}

fn holds(row: &RuleRow, control: &str) -> Result<(), Failed> {
    let mut failures = String::new();
    let mut numbers = 0;
    for case in &row.cases {
        let mut expect = case.expect.clone();
        let object = expect.as_object_mut().ok_or("what is expected is an object")?;
        object.entry("findings").or_insert_with(|| json!([]));
        numbers += count_numbers(&expect);
        if case.tolerance > 4e-4 {
            writeln!(failures, "{}: a tolerance of {} is too lax", case.name, case.tolerance)?;
        }
        let observed = observe(case, control);
        if let Err(difference) = matches(&expect, &observed, case.tolerance) {
            writeln!(failures, "{}: {difference}", case.name)?;
            for finding in observed["findings"].as_array().into_iter().flatten() {
                writeln!(failures, "  {}: {}", finding["line"], finding["message"])?;
            }
        }
        for place in lax_numbers(&expect, &observed, case.tolerance) {
            writeln!(failures, "{}: {place} could be another number", case.name)?;
        }
    }
    for node in &row.nodes {
        numbers += count_numbers(&node.expect);
        let text = std::fs::read_to_string(root().join(&node.file))?;
        let has_test = text.contains(&format!("fn {}(", node.test));
        if !has_test || !text.contains(&format!("\"{}\"", row.id)) {
            writeln!(failures, "{} has no test {} of {}", node.file, node.test, row.id)?;
        }
    }
    if numbers == 0 {
        writeln!(failures, "nothing that it expects is a number")?;
    }
    if failures.is_empty() { Ok(()) } else { Err(failures.into()) }
}

fn every_rule_has_its_row() -> Result<(), Failed> {
    let mut missing = Vec::new();
    for control in IN_ORDER {
        let Some(wanted) = manual(control) else { continue };
        let rows = of(control.name());
        let count = |id: &String| rows.iter().filter(|row| row.id == *id).count();
        missing.extend(wanted.iter().filter(|id| count(id) != 1).cloned());
        missing.extend(rows.iter().filter(|row| !wanted.contains(&row.id)).map(|r| r.id.clone()));
        missing.extend(
            rows.iter()
                .filter(|row| {
                    row.cases.is_empty() && row.nodes.is_empty() && row.falls_short.is_none()
                })
                .map(|row| format!("{} without a proof", row.id)),
        );
    }
    if missing.is_empty() { Ok(()) } else { Err(format!("not there once: {missing:?}").into()) }
}

/// How many rules hold, and which fall short.
fn tally() -> String {
    let rows: Vec<RuleRow> = controls().flat_map(of).collect();
    // The worked programs are no rules.
    let is_rule = |row: &&RuleRow| !row.id.starts_with('W');
    let short: Vec<&str> = (rows.iter().filter(is_rule))
        .filter(|row| row.falls_short.is_some())
        .map(|row| row.id.as_str())
        .collect();
    let count = rows.iter().filter(is_rule).count();
    format!(
        "\n{} of {count} rules hold whole; what falls short says of what: {}.\n",
        count - short.len(),
        short.join(", ")
    )
}

fn the_page_is_up_to_date() -> Result<(), Failed> {
    let mut page = String::from(
        "# Controls\n\n\
         Every rule of the five control manuals, under the profile of its control, and what\n\
         proves it. `cargo test -p kerf_tests --test controls S06` runs one row. The numbers of\n\
         each are in `tests/controls/`; this page is made from there: change a row, then run\n\
         `UPDATE_EXPECT=1 cargo test -p kerf_tests --test controls page`.\n\n\
         A *switch* is the key of the profile that changes the rule; where the manual's figure\n\
         is lost, the page gives our reading. Each row has a case of its own. The suite changes the\n\
         radius, the side and the coordinates of every case; `tests/controls/unnoticed.txt`\n\
         lists what a case without a path does not notice.\n",
    );
    page += &tally();
    for control in controls() {
        write!(page, "\n## `{control}`\n\n| row | rule | proof | switch |\n|---|---|---|---|\n")?;
        for row in of(control) {
            let mut proof: Vec<String> = row.cases.iter().map(|case| case.name.clone()).collect();
            proof
                .extend(row.nodes.iter().map(|node| format!("`{}` in `{}`", node.test, node.file)));
            if let Some(why) = &row.falls_short {
                proof.push(format!("**falls short:** {why}"));
            }
            let mut rule = row.rule.clone();
            if let Some(reading) = &row.interpretation {
                write!(rule, " *Reading:* {reading}")?;
            }
            let switch = row.switch.map(|key| format!("`{key}`")).unwrap_or_default();
            let cell = |text: &str| text.trim().replace('|', "\\|").replace('\n', " ");
            let proof = cell(&proof.join("; "));
            writeln!(page, "| {} | {} | {proof} | {switch} |", row.id, cell(&rule))?;
        }
    }
    page += include_str!("../controls/language.txt");
    expect_test::expect_file![root().join("docs/controls.md")].assert_eq(&page);
    Ok(())
}
