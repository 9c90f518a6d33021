//! Every golden run does today what it did when it was recorded.

use kerf_tests::{kerf, root};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn golden_bags() -> Vec<PathBuf> {
    let bags = std::fs::read_dir(root().join("bags")).expect("bags/ is there");
    let mut bags: Vec<_> = bags
        .map(|entry| entry.expect("its entries can be read").path())
        .filter(|path| path.is_dir())
        .collect();
    bags.sort();
    bags
}

/// What is done otherwise today, on purpose, in a bag that is kept for its definitions.
const DONE_OTHERWISE: [(&str, &str); 1] = [("rs274_older_definitions", "driver")];

fn is_done_otherwise(bag: &Path, level: &str) -> bool {
    DONE_OTHERWISE.iter().any(|(name, other)| bag.ends_with(name) && *other == level)
}

fn replay(args: &[&std::ffi::OsStr]) -> Output {
    Command::new(kerf()).arg("replay").args(args).output().expect("kerf runs")
}

#[test]
fn golden_runs_are_reproduced() {
    let bags = golden_bags();
    assert!(!bags.is_empty(), "there is no golden run, so nothing is proved");
    for bag in bags {
        for level in ["loader", "planner", "driver"] {
            let output = replay(&[bag.as_os_str(), "--level".as_ref(), level.as_ref()]);
            let said = String::from_utf8_lossy(&output.stdout).into_owned();
            let status = i32::from(is_done_otherwise(&bag, level));
            let problem = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(status), "{}:\n{said}{problem}", bag.display());
            let row = said.lines().find(|line| line.trim_start().starts_with(level));
            let row = row.unwrap_or_else(|| panic!("{level} was not replayed:\n{said}"));
            assert!(!row.contains("compared nothing"), "{row}");
        }
    }
}

#[test]
fn a_replay_gives_the_same_bytes_twice() {
    for bag in golden_bags() {
        let outs = [(); 2].map(|()| tempfile::tempdir().expect("a folder"));
        for out in &outs {
            let output = replay(&[bag.as_os_str(), "--out".as_ref(), out.path().as_os_str()]);
            assert!(matches!(output.status.code(), Some(0 | 1)), "{}", bag.display());
        }
        let name = format!("{}.mcap", bag.file_stem().expect("a bag has a name").display());
        let bytes =
            outs.each_ref().map(|out| std::fs::read(out.path().join(&name)).expect("written"));
        assert!(!bytes[0].is_empty() && bytes[0] == bytes[1], "{name} differs");
    }
}

#[test]
fn every_golden_run_has_its_row() {
    let readme = std::fs::read_to_string(root().join("bags/README.md")).expect("bags/README.md");
    for bag in golden_bags() {
        let name = bag.file_name().expect("a bag has a name").to_string_lossy().into_owned();
        assert!(readme.contains(&format!("| `{name}` |")), "bags/README.md says nothing of {name}");
    }
    let rows = readme.lines().filter_map(|line| line.strip_prefix("| `")?.split_once("` |"));
    for (name, _) in rows {
        assert!(root().join("bags").join(name).is_dir(), "bags/README.md has a row for {name}");
    }
}
