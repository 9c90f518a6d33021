//! Retention removes only bags of ours, and leaves everything else in the directory.
#![cfg(feature = "std-fs")]

mod common;

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::time::{Duration, UNIX_EPOCH};

use common::*;
use run_recorder::retention::{ExceededLimit, RetentionLimits, Stays};
use run_recorder::run_bag::{RunBag, RunBagOptions};
use run_recorder::stored_bags::{MARK_FILE, find, mark, mark_of, remove_old_bags, unmark};

const LONG: Duration = Duration::from_secs(60);
const DAY_NS: u64 = 86_400_000_000_000;
const NOW: u64 = 1000 * DAY_NS;

fn begin(directory: &Path, name: &str) -> RunBag {
    let mut options = RunBagOptions::new(directory, name);
    options.run.insert("run_id".into(), name.into());
    // Some files each.
    options.split.size = 2_000;
    let bag = RunBag::create(options).unwrap();
    let channel = bag.add_channel(&string_channel("/a")).unwrap();
    for i in 0..30 {
        assert!(bag.write(channel, i, i, string_message(&format!("message {i}"))));
    }
    bag
}

/// A finished bag that was written to last so many days ago.
fn bag(directory: &Path, name: &str, days_ago: u64) -> PathBuf {
    let bag = begin(directory, name);
    let path = bag.path().to_owned();
    assert!(bag.finish(LONG).complete);
    date(&path, days_ago);
    path
}

fn date(bag: &Path, days_ago: u64) {
    let written = UNIX_EPOCH + Duration::from_nanos(NOW - days_ago * DAY_NS);
    for entry in fs::read_dir(bag).unwrap() {
        let file = File::options().append(true).open(entry.unwrap().path()).unwrap();
        file.set_modified(written).unwrap();
    }
}

fn names(directory: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

fn size(path: &Path) -> u64 {
    fs::read_dir(path).unwrap().map(|entry| entry.unwrap().metadata().unwrap().len()).sum()
}

#[test]
fn nothing_goes_but_finished_and_dead_bags_of_ours_that_nobody_marked() {
    let outside = tempfile::tempdir().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let old = bag(here, "run_old", 30);
    bag(here, "run_young", 1);
    // It died: no metadata.yaml, and the last file ends anywhere.
    let died = bag(here, "run_died", 40);
    fs::remove_file(died.join("metadata.yaml")).unwrap();
    let first = fs::read(died.join("run_died_0.mcap")).unwrap();
    fs::write(died.join("run_died_1.mcap"), &first[..first.len() / 2]).unwrap();
    fs::write(died.join("run_died_2.mcap"), "").unwrap();
    date(&died, 40);
    let (old_size, died_size) = (size(&old), size(&died));

    mark(&bag(here, "run_marked", 50), "the alarm of May").unwrap();
    let open = begin(here, "run_open");
    // As if it had been written to last before the clock was set.
    date(open.path(), 60);
    // A golden bag: a run of ours in a folder of another name.
    let golden = bag(here, "run_golden", 70);
    fs::rename(&golden, here.join("masso_example")).unwrap();
    // Bags of other recorders, also with names like ours.
    let foreign = here.join("run_foreign");
    fs::create_dir(&foreign).unwrap();
    let mut bytes = Vec::new();
    let options = mcap::WriteOptions::new().profile("ros2").library("libmcap 1.3.0");
    let mut writer = options.create(std::io::Cursor::new(&mut bytes)).unwrap();
    let run = [("run_id".to_owned(), "run_foreign".to_owned())].into();
    let record = mcap::records::Metadata { name: "cnc_run".into(), metadata: run };
    writer.write_metadata(&record).unwrap();
    writer.finish().unwrap();
    drop(writer);
    fs::write(foreign.join("run_foreign_0.mcap"), bytes).unwrap();
    date(&foreign, 80);
    // A bag of ours with a file of somebody else in it.
    let noted = bag(here, "run_noted", 80);
    fs::write(noted.join("notes.txt"), "ask Anna").unwrap();
    let nested = bag(here, "run_nested", 80);
    fs::create_dir(nested.join("plots")).unwrap();
    let with_link = bag(here, "run_with_link", 80);
    let elsewhere = outside.path().join("precious_0.mcap");
    fs::write(&elsewhere, "precious").unwrap();
    symlink(&elsewhere, with_link.join("run_with_link_7.mcap")).unwrap();
    // Without its first file it cannot be recognised.
    let headless = bag(here, "run_headless", 80);
    fs::remove_file(headless.join("run_headless_0.mcap")).unwrap();
    // Links to bags, folders without anything, files.
    let linked = bag(outside.path(), "run_linked", 90);
    symlink(&linked, here.join("run_linked")).unwrap();
    symlink(here.join("nowhere"), here.join("run_dangling")).unwrap();
    fs::create_dir(here.join("run_empty")).unwrap();
    fs::write(here.join("run_file_0.mcap"), &first).unwrap();
    fs::write(here.join("notes.txt"), "").unwrap();
    bag(&here.join("below"), "run_below", 90);

    let before = names(here);
    let stays = |name: &str| {
        let bags = find(here).unwrap();
        bags.into_iter().find(|bag| bag.path == here.join(name)).map(|bag| bag.stays)
    };
    assert_eq!(stays("run_old"), Some(None));
    assert_eq!(stays("run_marked"), Some(Some(Stays::Marked)));
    assert_eq!(stays("run_open"), Some(Some(Stays::InUse)));
    assert_eq!(stays("run_foreign"), None);

    // For ever is for ever.
    assert_eq!(
        remove_old_bags(here, RetentionLimits::default(), NOW, &BTreeSet::new()).unwrap().removed,
        []
    );
    let removal =
        remove_old_bags(here, RetentionLimits { days: 2, bytes: 1 }, NOW, &BTreeSet::new())
            .unwrap();
    assert_eq!(removal.stuck, []);
    let removed: Vec<_> =
        removal.removed.iter().map(|removal| (removal.path.clone(), removal.size)).collect();
    // The young bag is not expired, but there is no space for it besides the open bag.
    assert_eq!(removed[..2], [(died, died_size), (old, old_size)]);
    assert_eq!(removed[2].0, here.join("run_young"));
    assert!(
        matches!(removal.removed[1].beyond, ExceededLimit::Age(age) if age.as_secs() == 30 * 86_400)
    );
    assert!(matches!(removal.removed[2].beyond, ExceededLimit::Space(_)));
    assert_eq!(removed.len(), 3, "{removed:?}");
    let left: Vec<_> = before
        .into_iter()
        .filter(|name| !["run_old", "run_died", "run_young"].contains(&name.as_str()))
        .collect();
    assert_eq!(names(here), left);
    // The targets of links are unchanged.
    assert_eq!(fs::read_to_string(elsewhere).unwrap(), "precious");
    assert!(linked.join("metadata.yaml").exists());
    assert!(noted.join("run_noted_0.mcap").exists() && nested.join("metadata.yaml").exists());

    // The bag that was being written is complete, and is removed when it expires.
    let path = open.path().to_owned();
    assert!(open.finish(LONG).complete);
    date(&path, 60);
    bag(here, "run_newest", 0);
    let removal =
        remove_old_bags(here, RetentionLimits { days: 2, bytes: 0 }, NOW, &BTreeSet::new())
            .unwrap();
    assert_eq!(removal.removed.len(), 1);
    assert!(!path.exists());
}

#[test]
fn a_mark_keeps_a_bag_until_it_is_taken_off() {
    let folder = tempfile::tempdir().unwrap();
    let path = bag(folder.path(), "run_1", 30);
    bag(folder.path(), "run_2", 20);
    let keep = RetentionLimits { days: 1, bytes: 0 };
    assert_eq!(mark_of(&path), None);
    mark(&path, "").unwrap();
    assert_eq!(mark_of(&path).as_deref(), Some(""));
    mark(&path, "alarm 3021 in N70").unwrap();
    assert_eq!(mark_of(&path).as_deref(), Some("alarm 3021 in N70"));
    assert_eq!(remove_old_bags(folder.path(), keep, NOW, &BTreeSet::new()).unwrap().removed, []);
    assert!(unmark(&path).unwrap() && !unmark(&path).unwrap());
    // An unreadable mark is a mark too.
    symlink("nowhere", path.join(MARK_FILE)).unwrap();
    assert_eq!(mark_of(&path).as_deref(), Some(""));
    assert_eq!(remove_old_bags(folder.path(), keep, NOW, &BTreeSet::new()).unwrap().removed, []);
    assert!(unmark(&path).unwrap());
    assert_eq!(
        remove_old_bags(folder.path(), keep, NOW, &BTreeSet::new()).unwrap().removed.len(),
        1
    );
    assert_eq!(names(folder.path()), ["run_2"]);
    // A directory that is not there is an error, not an empty one.
    assert!(remove_old_bags(&folder.path().join("gone"), keep, NOW, &BTreeSet::new()).is_err());
}
