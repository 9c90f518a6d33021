//! Bags as directories: what opens, what does not, and why.
#![cfg(feature = "std-fs")]

mod common;

use std::fs;
use std::path::Path;
use std::time::Duration;

use common::*;
use run_recorder::bag_reader::{BagError, Problem};
use run_recorder::files::{open_bag, recover_bag};
use run_recorder::info::BagInfo;
use run_recorder::run_bag::{RunBag, RunBagOptions};

fn error(path: &Path) -> BagError {
    open_bag(path).unwrap_err()
}

const LISTS_RUN_0: &str =
    "rosbag2_bagfile_information:\n  version: 9\n  relative_file_paths: [run_0.mcap]\n";

#[test]
fn what_is_not_a_bag_directory_says_what_is_missing() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path();
    assert!(matches!(error(&path.join("gone")), BagError::Missing { .. }));
    assert!(matches!(error(path), BagError::EmptyDirectory { .. }));
    fs::write(path.join("metadata.yaml"), LISTS_RUN_0).unwrap();
    let missing = error(path).to_string();
    assert!(missing.contains("names run_0.mcap, which does not exist"), "{missing}");
    fs::write(path.join("run_0.mcap"), "").unwrap();
    assert!(matches!(error(path), BagError::ZeroLength { .. }));
    fs::write(path.join("run_0.mcap"), "G1 X5\n").unwrap();
    assert!(matches!(error(path), BagError::NotABag { .. }));
    // A truncated list is reported if there is nothing else.
    fs::write(path.join("metadata.yaml"), "a: [").unwrap();
    assert!(matches!(error(path), BagError::NotABag { .. }));
    fs::remove_file(path.join("run_0.mcap")).unwrap();
    assert!(matches!(error(path), BagError::Metadata { .. }));
}

#[test]
fn a_metadata_file_cut_at_any_byte_costs_no_message() {
    let directory = tempfile::tempdir().unwrap();
    let mut options = RunBagOptions::new(directory.path(), "run");
    options.split.size = 3_000;
    let bag = RunBag::create(options).unwrap();
    let channel = bag.add_channel(&string_channel("/a")).unwrap();
    for i in 0..100 {
        assert!(bag.write(channel, i, i, string_message(&"x".repeat(100))));
    }
    let path = bag.path().to_owned();
    assert!(bag.finish(Duration::from_secs(60)).complete);
    assert!(path.join("run_2.mcap").exists(), "a bag of several files");
    let list = path.join("metadata.yaml");
    let whole = fs::read(&list).unwrap();
    let mut reported = 0;
    for length in 0..whole.len() {
        fs::write(&list, &whole[..length]).unwrap();
        let mut bag = open_bag(&path).unwrap();
        assert_eq!(bag.messages().count(), 100, "cut at {length}");
        reported += usize::from(!bag.is_complete());
    }
    // Once all file names are there, the rest of the list is redundant.
    let names_end = String::from_utf8(whole).unwrap().find("  files:").unwrap();
    assert!(reported >= names_end - 1, "{reported} of {names_end}");
}

#[test]
fn a_directory_without_metadata_is_read_and_counts_as_incomplete() {
    let directory = tempfile::tempdir().unwrap();
    let (bytes, _) = bag_bytes(30, 10);
    fs::write(directory.path().join("run_0.mcap"), &bytes).unwrap();
    let mut bag = open_bag(directory.path()).unwrap();
    assert_eq!(bag.problems(), [Problem::NoMetadataFile]);
    assert_eq!(bag.messages().count(), 30);
    // The file by itself is complete.
    assert!(open_bag(&directory.path().join("run_0.mcap")).unwrap().is_complete());
    fs::write(directory.path().join("metadata.yaml"), LISTS_RUN_0).unwrap();
    assert!(open_bag(directory.path()).unwrap().is_complete());
}

#[test]
fn a_broken_off_run_is_recovered_to_a_new_directory_and_never_over_an_old_one() {
    let directory = tempfile::tempdir().unwrap();
    let old = directory.path().join("run");
    fs::create_dir(&old).unwrap();
    let (bytes, flushes) = bag_bytes(30, 10);
    fs::write(old.join("run_0.mcap"), &bytes[..flushes[2].0 + 5]).unwrap();
    let new = directory.path().join("saved");
    let recovered = recover_bag(&old, &new).unwrap();
    assert_eq!(recovered.summary.message_count, 20);
    let mut bag = open_bag(&new).unwrap();
    assert_eq!(bag.messages().count(), 20);
    let info = BagInfo::new("saved", &bag);
    assert!(!info.complete);
    assert!(info.problems[0].contains("there is no metadata.yaml"), "{info}");
    assert!(fs::read_to_string(new.join("metadata.yaml")).unwrap().contains("saved_0.mcap"));
    assert!(recover_bag(&old, &new).is_err());
}
