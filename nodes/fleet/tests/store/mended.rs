//! Stores that go away, objects that are damaged, and bags that stop workers.

use super::support::{bags, indexed, open, replay, said};
use fleet::core::key::{bag_object, key_of};
use fleet::push::{Done, Order, push};
use fleet::store::{MARKER, Store};
use fleet::worker;
use run_recorder::stored_bags::MARK_FILE;
use std::fs;
use std::path::Path;
use std::process::Command;
use tempfile::tempdir;

fn push_some(store: &Store, count: usize) {
    let order = Order { bags: bags()[..count].to_vec(), ..Order::default() };
    push(Ok(store), &order, &|_| {}).expect("pushed");
}

fn key(number: usize) -> String {
    key_of(&fs::read(&bags()[number]).expect("a bag"))
}

/// The one file of a folder.
fn only(folder: &Path) -> std::path::PathBuf {
    let mut files = fs::read_dir(folder).expect("a folder").map(|it| it.expect("a file").path());
    let file = files.next().expect("a file");
    assert!(files.next().is_none());
    file
}

#[test]
fn a_store_that_is_not_mounted_takes_nothing_and_bags_wait_for_it() {
    let folder = tempdir().expect("a folder");
    let (at, spool) = (folder.path().join("mount"), folder.path().join("spool"));
    let run = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_kerf-fleet"));
        command.args(words).arg("--store").arg(&at);
        if words[0] == "replay" {
            command.args(["--build", "a", "--journal"]).arg(folder.path().join("journal"));
        }
        let output = command.output().expect("a process");
        let text = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8(text).expect("UTF-8"))
    };
    let bag = bags()[0].display().to_string();
    let spool = spool.display().to_string();
    for is_mount_point in [false, true] {
        if is_mount_point {
            fs::create_dir(&at).expect("a folder");
        }
        for words in [&["push", &bag][..], &["replay"], &["report"]] {
            let (status, text) = run(words);
            assert_eq!(status, Some(1), "{text}");
            assert!(text.contains("the store does not answer"), "{text}");
        }
        let (status, text) = run(&["push", &bag, "--spool", &spool]);
        assert_eq!(status, Some(0), "{text}");
        assert!(
            text.contains("the store does not answer") && text.contains("1 bags wait in"),
            "{text}"
        );
    }
    assert_eq!(fs::read_dir(&at).expect("a folder").count(), 0, "nothing is in the mount point");
    // What is no store at all is an error with a spool, too.
    let mut command = Command::new(env!("CARGO_BIN_EXE_kerf-fleet"));
    command.args(["push", "--spool", &spool, "--store", "gopher://x"]);
    assert_eq!(command.output().expect("a process").status.code(), Some(2));
    let (status, text) = run(&["push", "--create", "--spool", &spool]);
    assert_eq!(
        (status, text.as_str()),
        (Some(0), "1 bags sent, 0 were there, 0 refused, 0 wait\n")
    );
    assert_eq!(run(&["replay"]).0, Some(0));
}

#[test]
fn a_store_that_goes_away_has_no_absent_bags_and_the_journal_stays() {
    let folder = tempdir().expect("a folder");
    let (at, journal) = (folder.path().join("store"), folder.path().join("journal"));
    let store = open(&at);
    push_some(&store, 3);
    fs::remove_file(at.join(MARKER)).expect("removed");
    fs::rename(at.join("bags"), at.join("elsewhere")).expect("moved");
    let error = replay(&store, "0/1", "today", &journal).expect_err("it went away").to_string();
    assert!(error.contains("the store does not answer"), "{error}");
    assert!(only(&journal).is_file());
    // A push does not call a bag sent that only the mount point has.
    let spool = folder.path().join("spool");
    let order =
        Order { bags: bags()[..2].to_vec(), spool: Some(spool.clone()), ..Order::default() };
    let done = push(Ok(&store), &order, &|_| {}).expect("they wait");
    assert_eq!((done.sent, done.waiting), (0, 2));
    let kept = fs::read_dir(spool).expect("a folder").count();
    assert_eq!(kept, 4, "two bags, and what is said of each");
}

#[test]
fn an_object_that_was_damaged_is_sent_again() {
    let folder = tempdir().expect("a folder");
    let (at, journal) = (folder.path().join("store"), folder.path().join("journal"));
    let store = open(&at);
    push_some(&store, 2);
    let objects = [0, 1].map(|number| at.join(bag_object(&key(number))));
    fs::write(&objects[0], b"").expect("written");
    let mut content = fs::read(&objects[1]).expect("an object");
    content[100] ^= 1;
    fs::write(&objects[1], content).expect("written");
    for _ in 0..2 {
        replay(&store, "0/1", "today", &journal).expect("done");
        let said = said(&store, "today");
        assert_eq!(said.len(), 2);
        assert!(said.values().all(|rows| rows.len() == 1), "an error is written once");
        assert!(said.values().all(|rows| rows[0][1].as_text() == "error"));
    }
    for (verify, sent) in [(false, 1), (true, 1), (true, 0)] {
        let order = Order { bags: bags()[..2].to_vec(), verify, ..Order::default() };
        let done = push(Ok(&store), &order, &|_| {}).expect("pushed");
        assert_eq!(done, Done { sent, known: 2 - sent, ..Done::default() });
    }
    assert_eq!(replay(&store, "0/1", "today", &journal).expect("done").replayed, 2);
    let report = fleet::report::report(&store, None, None).expect("a report");
    assert_eq!((report.counts.reproduced, report.counts.error), (2, 0));
}

#[test]
fn a_bag_that_stops_workers_has_a_verdict_in_the_end_and_a_large_one_when_there_is_room() {
    let folder = tempdir().expect("a folder");
    let (at, journal) = (folder.path().join("store"), folder.path().join("journal"));
    let store = open(&at);
    push_some(&store, 3);
    let done = |bag_bytes_max| {
        let order = worker::Order {
            shard: "0/1".parse().expect("a shard"),
            condition: None,
            build: "today",
            journal: &journal,
            bag_bytes_max,
        };
        worker::run(&store, &order, &|_| {}).expect("done").replayed
    };
    assert_eq!(done(1 << 10), 3);
    let texts = |said: &str| {
        let read =
            fleet::dataset::verdicts(&store, "today", &["bag", "verdict", "message", "text"]);
        read.expect("verdicts").rows.values().filter(|it| it[5].as_text().contains(said)).count()
    };
    assert_eq!(texts("--bag-mb-max allows 0"), 3);
    // Three workers were stopped in one, and another store at this place had a bag that is not here.
    let mut other = vec![fleet::core::schema::Value::Null; fleet::core::schema::VERDICTS.len()];
    other[0] = fleet::core::schema::Value::text(&"ab".repeat(32));
    let (mut left, _) =
        fleet::journal::Journal::open(&journal, store.place(), "today", "0-of-1").expect("open");
    left.end(&other).expect("written");
    for _ in 0..3 {
        left.begin(&key(1)).expect("written");
    }
    drop(left);
    assert_eq!(done(64 << 20), 3);
    assert_eq!(texts("3 workers were stopped while they replayed it"), 1);
    let said = said(&store, "today");
    assert_eq!(said.len(), 3, "no verdict on a bag of another store");
    assert_eq!(done(64 << 20), 0);
}

#[test]
fn a_bag_that_is_marked_later_has_a_newer_row() {
    let folder = tempdir().expect("a folder");
    let store = open(&folder.path().join("store"));
    let bag = folder.path().join("run_1");
    fs::create_dir(&bag).expect("a folder");
    let file = bag.join("run_1.mcap");
    fs::copy(&bags()[0], &file).expect("copied");
    let kept = |given: &Path, machine: Option<&str>| {
        let machine = machine.map(str::to_owned);
        let order = Order { bags: vec![given.to_owned()], machine, ..Order::default() };
        let done = push(Ok(&store), &order, &|_| {}).expect("pushed");
        let row = indexed(&store).remove(&key(0)).expect("a row");
        let of =
            |name| row[fleet::core::schema::place(fleet::core::schema::INDEX, name)].to_string();
        (done.sent, of("kept"), of("machine"))
    };
    let of = |sent, kept: &str, machine: &str| (sent, kept.to_owned(), machine.to_owned());
    assert_eq!(kept(&bag, Some("mill")), of(1, "-", "mill"));
    fs::write(bag.join(MARK_FILE), "collision\n").expect("marked");
    // The mark is found from the file, too.
    assert_eq!(kept(&file, Some("mill")), of(1, "collision", "mill"));
    assert_eq!(kept(&bag, Some("mill")), of(0, "collision", "mill"));
    assert_eq!(kept(&bag, Some("lathe")), of(1, "collision", "lathe"));
}
