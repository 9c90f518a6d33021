//! What the workspace tests share: where things are, the rows of the manuals,
//! a driver on a line with a controller, and the order of a crate's folders.

pub mod layers;
pub mod line;
pub mod lists;
pub mod plain;
pub mod rows;
pub mod samples;

use cnc_msgs::finding::Finding;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::{Planning, judge};
use program_loader::{LoadOptions, load};
use std::path::{Path, PathBuf};

/// The root of the workspace.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("this package is a folder of the root")
}

/// The `kerf` that was built along with the tests.
///
/// # Panics
/// It was not: `cargo test --workspace` builds it, `cargo test -p kerf_tests` alone does not.
pub fn kerf() -> PathBuf {
    let test = std::env::current_exe().expect("a test is a file");
    let profile = test.ancestors().nth(2).expect("tests lie in target/PROFILE/deps");
    let kerf = profile.join("kerf");
    assert!(kerf.exists(), "{} is not built: run cargo build -p kerf first", kerf.display());
    kerf
}

/// The path of a program under the profile `rs274`, with T1 of 4 mm, or the errors that refuse it.
///
/// # Errors
/// Those of the loader, of the planner and of the audit.
pub fn planned(program: &str) -> Result<CompensatedPath, Vec<Finding>> {
    let profile = settings::load_profile("rs274").expect("the shipped profile");
    let loaded = load(program.as_bytes(), &profile, &LoadOptions::default());
    let errors = |findings: Vec<Finding>| findings.into_iter().filter(Finding::is_error).collect();
    let found: Vec<Finding> = errors(loaded.findings);
    if !found.is_empty() {
        return Err(found);
    }
    let mut tools = ToolTable::default();
    tools.tools.entry(1).or_default().diameter_mm = 4.0;
    let verdict = judge(&loaded.contour, &profile, &tools, Planning::default());
    let mut found = verdict.plan.findings.clone();
    found.extend(verdict.audit.iter().flat_map(|audit| audit.findings.clone()));
    let found: Vec<Finding> = errors(found);
    if found.is_empty() { Ok(verdict.plan.path) } else { Err(found) }
}

/// Every file with this ending that belongs to the project, sorted.
pub fn files(ending: &str) -> Vec<PathBuf> {
    fn walk(folder: &Path, ending: &str, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).expect("a folder of the project can be read") {
            let path = entry.expect("its entries too").path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if path.is_dir() {
                // What is of others keeps their form.
                if name != "target" && name != "third_party" && !name.starts_with('.') {
                    walk(&path, ending, found);
                }
            } else if name.ends_with(ending) {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    walk(root(), ending, &mut found);
    found.sort();
    found
}
