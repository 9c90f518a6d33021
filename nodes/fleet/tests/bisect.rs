//! `kerf fleet bisect`, on a history whose `kerf` is a script.

use std::fs;
use std::path::Path;
use std::process::Command;
use tempfile::tempdir;

fn git(folder: &Path, words: &[&str]) -> String {
    let identity =
        ["-c", "user.name=t", "-c", "user.email=t@example.com", "-c", "commit.gpgsign=false"];
    let ran = Command::new("git").arg("-C").arg(folder).args(identity).args(words).output();
    let ran = ran.expect("git");
    assert!(ran.status.success(), "{words:?}: {}", String::from_utf8_lossy(&ran.stderr));
    String::from_utf8_lossy(&ran.stdout).trim().to_owned()
}

/// Commits of a `kerf` that prints these, and ends with these.
fn history(folder: &Path, versions: &[(&str, i32)]) -> Vec<String> {
    git(folder, &["init", "--quiet"]);
    let commit = |(number, (json, status)): (usize, &(&str, i32))| {
        let script = format!("#!/bin/sh\n# {number}\necho '{json}'\nexit {status}\n");
        fs::write(folder.join("kerf"), script).expect("written");
        git(folder, &["add", "kerf"]);
        git(folder, &["commit", "--quiet", "-m", &format!("Version {number}")]);
        git(folder, &["rev-parse", "HEAD"])
    };
    versions.iter().enumerate().map(commit).collect()
}

fn bisect(folder: &Path, good: &str, bad: &str) -> (Option<i32>, String) {
    let bag = folder.join("bag.mcap");
    fs::write(&bag, b"x").expect("written");
    let mut command = Command::new(env!("CARGO_BIN_EXE_kerf-fleet"));
    command
        .arg("bisect")
        .arg(&bag)
        .args(["--good", good, "--bad", bad, "--repository"])
        .arg(folder);
    command.args(["--build-with", "chmod +x kerf", "--program", "kerf", "--work"]);
    let output = command.arg(folder.join("work")).output().expect("a process");
    let text = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(text).expect("UTF-8"))
}

const SAME: (&str, i32) = (r#"{"reproduced": false, "bags": [1]}"#, 1);
const OTHER: (&str, i32) = (r#"{"reproduced": false, "bags": [2]}"#, 1);
const BROKEN: (&str, i32) = ("", 2);

#[test]
fn the_commit_that_first_differs_is_named() {
    let folder = tempdir().expect("a folder");
    let commits =
        history(folder.path(), &[SAME, SAME, SAME, BROKEN, SAME, OTHER, OTHER, SAME, OTHER]);
    let (status, text) = bisect(folder.path(), &commits[0], &commits[6]);
    assert_eq!(status, Some(0), "{text}");
    assert!(text.contains(&format!("{} Version 5\n", commits[5])), "{text}");
    assert!(!text.contains("may be the first"), "{text}");
    // The same worktree again, and a difference that a broken commit may have made.
    let more = history(folder.path(), &[SAME, BROKEN, OTHER]);
    let (status, text) = bisect(folder.path(), &more[0], &more[2]);
    assert_eq!(status, Some(0), "{text}");
    assert!(text.contains(&format!("{} Version 2\n", more[2])), "{text}");
    assert!(
        text.contains(&format!("{} does not build or cannot compare the bag, and may be", more[1])),
        "{text}"
    );
}

#[test]
fn what_cannot_be_searched_is_refused() {
    let folder = tempdir().expect("a folder");
    let commits = history(folder.path(), &[SAME, SAME, BROKEN]);
    for (good, bad, status, says) in [
        (&commits[0], &commits[1], 1, "make the same of"),
        (
            &commits[0],
            &commits[2],
            1,
            "does not build, or cannot compare the bag; choose another commit",
        ),
        (&commits[1], &commits[0], 2, "is not an ancestor of"),
        (&"nothing".to_owned(), &commits[1], 2, "nothing is no commit of"),
    ] {
        let (found, text) = bisect(folder.path(), good, bad);
        assert_eq!(found, Some(status), "{text}");
        assert!(text.contains(says), "{text}");
    }
}

#[test]
fn two_searches_do_not_share_a_folder_and_a_relative_one_is_of_this_folder() {
    let folder = tempdir().expect("a folder");
    let repository = folder.path().join("repository");
    fs::create_dir(&repository).expect("a folder");
    let commits = history(&repository, &[SAME, SAME, OTHER]);
    fs::write(folder.path().join("bag.mcap"), b"x").expect("written");
    let search = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_kerf-fleet"));
        command.current_dir(folder.path()).args([
            "bisect",
            "bag.mcap",
            "--repository",
            "repository",
        ]);
        command.args(["--good", &commits[0], "--bad", &commits[2], "--work", "work"]);
        command.args(["--build-with", "chmod +x kerf", "--program", "kerf"]);
        let output = command.output().expect("a process");
        let text = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8(text).expect("UTF-8"))
    };
    let (status, text) = search();
    assert_eq!(status, Some(0), "{text}");
    assert!(text.contains(&format!("{} Version 2\n", commits[2])), "{text}");
    assert!(folder.path().join("work/tree").exists() && !repository.join("work").exists());
    let other = fs::File::open(folder.path().join("work/lock")).expect("a lock");
    other.lock().expect("locked");
    let (status, text) = search();
    assert_eq!(status, Some(1), "{text}");
    assert!(text.contains("another search uses this folder"), "{text}");
}
