//! `kerf fleet`: the program that it runs.

use super::support::{Folder, run};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::Command;

#[test]
fn fleet_runs_the_program_beside_it_or_says_how_to_make_it() {
    let folder = Folder::new();
    let kerf = folder.path().join("kerf");
    let built = env!("CARGO_BIN_EXE_kerf");
    // A link is as good as a copy, and a hundred megabytes less.
    if fs::hard_link(built, &kerf).is_err() {
        fs::copy(built, &kerf).expect("a copy");
    }
    let fleet = |path: &str, words: &[&str]| {
        let mut command = Command::new(&kerf);
        command.arg("fleet").args(words).env("PATH", path);
        run(&mut command)
    };
    let missing = "kerf-fleet is not installed: run `cargo install --path nodes/fleet --locked`";
    fleet("", &["push", "--store", "x"]).expect(2).says(&[missing]);
    for help in ["--help", "-h", "help"] {
        fleet("", &[help]).expect(0).says(&["push|replay|report|bisect", missing]);
    }
    let script = |file: &std::path::Path, word: &str| {
        fs::write(file, format!("#!/bin/sh\necho {word} \"$@\"\nexit 7\n")).expect("written");
        fs::set_permissions(file, fs::Permissions::from_mode(0o755)).expect("a program");
    };
    let other = folder.path().join("other");
    fs::create_dir(&other).expect("a folder");
    script(&other.join("kerf-fleet"), "on-path");
    let path = other.display().to_string();
    fleet(&path, &["report", "--store", "a b", "--json"])
        .expect(7)
        .says(&["on-path report --store a b --json"]);
    script(&folder.path().join("kerf-fleet"), "beside");
    fleet(&path, &["--help"]).expect(7).says(&["beside --help"]);
}
