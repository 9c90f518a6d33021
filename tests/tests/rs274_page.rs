//! The page of the language, `docs/rs274.md`, held row by row by a program: what is done acts, what has no effect is
//! reported, what is passed on is in the contour, and what is refused is named.

use cnc_msgs::finding::Finding;
use cnc_msgs::tool_table::{Tool, ToolTable};
use compensation_planner::{Planning, judge};
use kerf_tests::root;
use kerf_tests::samples::{Sample, samples};
use program_loader::tool_rows::load_with_tools;
use program_loader::{LoadOptions, canonical};
use std::collections::BTreeMap;

/// What a program becomes.
#[derive(Debug, PartialEq)]
struct Outcome {
    /// The events, or nothing where it is refused.
    events: Option<Vec<String>>,
    warnings: Vec<String>,
    errors: Vec<Finding>,
}

fn outcome(text: &str) -> Outcome {
    let profile = settings::load_profile("rs274").expect("a shipped profile");
    let tool = Tool { diameter_mm: 10.0, length_mm: 20.0, ..Tool::default() };
    let tools =
        ToolTable { tools: (1..10).map(|number| (number, tool)).collect(), ..ToolTable::default() };
    let options = LoadOptions { probes_touch_at: Some(0.5), ..LoadOptions::default() };
    let (_, loaded) = load_with_tools(text.as_bytes(), &profile, &options, &tools);
    let mut findings = loaded.findings.clone();
    if loaded.is_accepted() {
        let verdict = judge(&loaded.contour, &profile, &tools, Planning::default());
        assert_eq!(verdict.disagreement, None, "{text}");
        findings.extend(verdict.plan.findings);
    }
    let (errors, warnings): (Vec<_>, Vec<_>) = findings.into_iter().partition(Finding::is_error);
    let events = errors
        .is_empty()
        .then(|| loaded.contour.events.iter().map(canonical::event_text).collect());
    let warnings = warnings.into_iter().map(|it| it.message).collect();
    Outcome { events, warnings, errors }
}

/// The rows of all tables of words and comments: each word, and what becomes of it.
fn rows() -> BTreeMap<String, String> {
    let page = std::fs::read_to_string(root().join("docs/rs274.md")).expect("the page");
    let mut rows = BTreeMap::new();
    for line in page
        .lines()
        .filter(|line| ["| G", "| M", "| ("].iter().any(|begin| line.starts_with(begin)))
    {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        // `(LOG, ...) (LOGCLOSE)`: several comments.
        let words = match cells[1].starts_with('(') {
            true => cells[1].split_inclusive(')').map(str::trim).collect(),
            false => vec![cells[1]],
        };
        for word in words {
            rows.insert(word.to_owned(), cells[3].to_owned());
        }
    }
    assert!(rows.len() > 120, "{}", rows.len());
    rows
}

/// What is wrong with a sample of a row.
fn wrong(sample: &Sample, becomes: &str) -> Option<String> {
    let (with, without) = (outcome(&sample.whole()), outcome(&sample.without()));
    if outcome(sample.whole().trim_end()).events != with.events {
        return Some("it is another program without its last line end".to_owned());
    }
    // Another form of the number is in a message about a group of words.
    let word = sample.word.split([' ', ',', ')']).next().unwrap_or_default();
    match becomes {
        "refused" => {
            let named = with.errors.iter().any(|it| {
                it.message.contains(word)
                    && it.message.contains("is not supported")
                    && !it.help.is_empty()
            });
            (!named).then(|| format!("{:?}", with.errors))
        }
        // They make others an error.
        _ if with.events.is_none() && !["(ABORT", "M71"].contains(&word) => {
            Some(format!("{:?}", with.errors))
        }
        "no effect" => {
            let is_told = with.warnings.len() == without.warnings.len() + 1;
            (with.events != without.events || !is_told).then(|| format!("{:?}", with.warnings))
        }
        "passed on" => {
            let events = with.events.unwrap_or_default();
            (!events.iter().any(|event| event.starts_with(word))).then(|| format!("{events:?}"))
        }
        "done" => (with.events == without.events).then(|| "it changes nothing".to_owned()),
        other => Some(format!("what is {other}?")),
    }
}

#[test]
fn each_row_of_the_page_is_true_of_a_program() {
    let (rows, samples) = (rows(), samples());
    let mut faults = Vec::new();
    for (word, becomes) in &rows {
        match samples.iter().find(|sample| sample.word == *word) {
            Some(sample) => {
                faults.extend(wrong(sample, becomes).map(|why| format!("{word}: {why}")))
            }
            None => faults.push(format!("{word} has no program")),
        }
    }
    // Operators, functions and O words have no rows: the page names them.
    let page = std::fs::read_to_string(root().join("docs/rs274.md")).expect("the page");
    for sample in samples.iter().filter(|sample| !rows.contains_key(&sample.word)) {
        let becomes = if sample.word.starts_with("/ ") { "no effect" } else { "done" };
        let is_named = sample.word.contains(' ') || page.contains(&format!("`{}", sample.word));
        let why = if is_named {
            wrong(sample, becomes)
        } else {
            Some("the page does not name it".to_owned())
        };
        faults.extend(why.map(|why| format!("{}: {why}", sample.word)));
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

/// The words in backticks of a paragraph that begins so.
fn words_of(begin: &str) -> Vec<String> {
    let page = std::fs::read_to_string(root().join("docs/rs274.md")).expect("the page");
    let at = page.find(begin).expect("the paragraph");
    let paragraph = page[at..].split("\n\n").next().unwrap_or_default();
    paragraph.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn each_operator_function_and_o_word_that_the_page_names_has_a_program() {
    let samples = samples();
    let mut words = words_of("Operators, the first group");
    words.extend(words_of("`sub`, `endsub`"));
    let missing: Vec<_> = words
        .iter()
        // `ATAN[y]/[x]`, `EXISTS[#<name>]`; values and an example.
        .map(|word| word.split('[').next().unwrap_or_default())
        .filter(|word| {
            !word.is_empty()
                && !["L", "o"].contains(word)
                && !word.contains('#')
                && !word.starts_with('O')
        })
        .filter(|word| !samples.iter().any(|sample| sample.word == *word))
        .collect();
    assert!(missing.is_empty(), "{missing:?}");
}
