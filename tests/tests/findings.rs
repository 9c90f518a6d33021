//! `docs/findings.md`: what each code of a finding means, with an example and what to do.

use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::{Planning, judge};
use kerf_tests::root;
use program_loader::render::render;
use program_loader::{LoadOptions, load};
use std::fmt::Write;
use std::path::PathBuf;

/// A program for almost every code, named `CODE.CONTROL`.
const EXAMPLES: &str = "tests/golden_runs/refused";

fn text(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// What a code means, and what to do: both paragraphs of its doc comment.
fn explanations() -> Vec<[String; 2]> {
    let source = text("msgs/src/finding.rs");
    let (_, rest) = source.split_once("pub enum Code {\n").expect("the codes");
    let (list, _) = rest.split_once("\n}").expect("their end");
    let mut explanations = Vec::new();
    let mut comment = String::new();
    for line in list.lines().map(str::trim) {
        match line.strip_prefix("///") {
            Some("") => comment.push('\n'),
            Some(words) => {
                let is_first = comment.is_empty() || comment.ends_with('\n');
                comment.push_str(if is_first { words.trim() } else { words });
            }
            None => {
                let (meaning, remedy) = comment.split_once('\n').unwrap_or_else(|| {
                    panic!("{line} says what it means, or what to do, but not both: {comment}")
                });
                explanations.push([meaning.to_owned(), remedy.to_owned()]);
                comment.clear();
            }
        }
    }
    explanations
}

/// The file of an example, and its control.
fn example(code: Code) -> Option<(PathBuf, String)> {
    let folder = std::fs::read_dir(root().join(EXAMPLES)).expect("the examples");
    let mut paths = folder.map(|entry| entry.expect("an entry").path());
    let path = paths.find(|path| path.file_stem().is_some_and(|stem| stem == code.name()))?;
    let control = path.extension().expect("a control").to_string_lossy().into_owned();
    Some((path, control))
}

/// The first finding of this code, as `kerf plan` draws it.
fn drawn(code: Code, tools: &ToolTable) -> Option<String> {
    let (path, control) = example(code)?;
    let program = std::fs::read_to_string(&path).expect("a program");
    let profile = settings::load_profile(&control).expect("a shipped profile");
    let mut loaded = load(program.as_bytes(), &profile, &LoadOptions::default());
    let mut findings: Vec<Finding> = std::mem::take(&mut loaded.findings);
    if !findings.iter().any(Finding::is_error) {
        findings.extend(judge(&loaded.contour, &profile, tools, Planning::default()).plan.findings);
    }
    let name = path.file_name().expect("a file").to_string_lossy();
    let found = findings.iter().find(|finding| finding.code == code);
    let found = found.unwrap_or_else(|| panic!("{name} has no such finding: {findings:#?}"));
    Some(render(&name, &program, std::slice::from_ref(found), false))
}

/// `UPDATE_EXPECT=1 cargo test -p kerf_tests --test findings` writes it anew.
#[test]
fn the_page_explains_every_code() {
    let tools = settings::tool_table_from_yaml(&text("tests/golden_runs/tools.yaml"), "tools.yaml")
        .expect("a tool table");
    let mut page = format!(
        "# Findings\n\n\
         `kerf plan`, `kerf load` and the service `get_findings` give each finding a code: \
         `error[gouge]`.\nAn error refuses the program. A warning refuses nothing. The profile of \
         the control decides which\nof them some codes are: [profiles.md](profiles.md). \
         [rules.md](rules.md) defines *span*, *pass* and *wall*.\n\n\
         Each example is a file of [`{EXAMPLES}`](../{EXAMPLES}). In that folder it is printed like this:\n\n\
         ```sh\n\
         kerf plan gouge.sinumerik_840c --control sinumerik_840c --tools ../tools.yaml\n\
         ```\n\n\
         This page is made from `msgs/src/finding.rs` and from the examples by a test.\n\n\
         | code | meaning |\n|---|---|\n"
    );
    let explanations = explanations();
    assert_eq!(explanations.len(), Code::ALL.len());
    for (code, [meaning, _]) in Code::ALL.iter().zip(&explanations) {
        writeln!(page, "| [`{0}`](#{0}) | {meaning} |", code.name()).expect("a text");
    }
    for (code, [meaning, remedy]) in Code::ALL.iter().zip(&explanations) {
        write!(page, "\n## {}\n\n{meaning}\n\n**What to do:** {remedy}\n", code.name())
            .expect("a text");
        if let Some(drawn) = drawn(*code, &tools) {
            write!(page, "\n```text\n{drawn}```\n").expect("a text");
        }
    }
    expect_test::expect_file![root().join("docs/findings.md")].assert_eq(&page);
}
