//! The recorder gives each bag to a store of many bags, which may be away.

use super::machine::{Machine, SLOW_POLLING, until};
use std::fs;
use std::path::Path;
use std::process::Command;

#[test]
#[allow(clippy::print_stderr, reason = "why nothing was proved")]
fn bags_wait_for_a_store_that_is_away_and_are_in_it_when_it_is_back() {
    // The tests of the workspace make it; those of this package alone do not.
    let fleet = Path::new(env!("CARGO_BIN_EXE_kerf")).with_file_name("kerf-fleet");
    if !fleet.is_file() {
        assert!(std::env::var_os("KERF_MUST_PROVE").is_none(), "{} is missing", fleet.display());
        return eprintln!("nothing is proved: {} is missing", fleet.display());
    }
    let folder = tempfile::tempdir().expect("a folder");
    let store = folder.path().join("store");
    let parameter = format!("run_recorder:fleet_store:={}", store.display());
    let ros: Vec<&str> = SLOW_POLLING.into_iter().chain(["-p", &parameter]).collect();
    let machine = Machine::virtual_with(20, &ros);
    machine.folder.file("short.ngc", "G21 G90\nG1 X10 F1200\nM30\n");
    machine.kerf(&["run", "short.ngc"]).expect(0);
    let waits = "the store does not answer";
    until(waits, || {
        let log = machine.log();
        (log.contains(waits) && log.contains("1 bags wait here")).then_some(())
    });
    let made = Command::new(&fleet)
        .args(["push", "--create", "--spool", "none", "--store"])
        .arg(&store)
        .current_dir(folder.path())
        .output();
    assert!(made.expect("a process").status.success());
    machine.kerf(&["run", "short.ngc"]).expect(0);
    until("two bags in the store", || {
        let bags = fs::read_dir(store.join("bags")).ok()?.count();
        (bags == 2).then_some(())
    });
    let recorded = machine.folder.path().join("bags");
    let given = until("both are noted", || {
        let given = fs::read_to_string(recorded.join(".fleet/pushed")).ok()?;
        (given.lines().filter(|line| !line.is_empty()).count() == 2).then_some(given)
    });
    let runs = fs::read_dir(&recorded).expect("bags").flatten();
    let runs = runs.map(|run| run.file_name().to_string_lossy().into_owned());
    for run in runs.filter(|run| run != ".fleet") {
        assert!(given.contains(&format!("{run}\t{}\n", store.display())), "{run} in {given}");
    }
}
