//! Bags of several files, and an index of many parts.

use super::support::{Failing, bags, indexed, open, replay, said};
use fleet::core::schema::{INDEX, place};
use fleet::dataset;
use fleet::push::{Done, Order, push};
use fleet::store::Store;
use run_recorder::bag_reader::RUN_RECORD;
use run_recorder::bag_writer::ChannelSpec;
use run_recorder::files::open_bag;
use run_recorder::run_bag::{RunBag, RunBagOptions, SplitLimits};
use run_recorder::stored_bags::MARK_FILE;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tempfile::tempdir;

/// Records the messages of a bag anew, in files of this size.
fn record(from: &Path, folder: &Path, name: &str, size: u64) -> PathBuf {
    let mut from = open_bag(from).expect("a bag");
    let mut options = RunBagOptions::new(folder, name);
    options.run = from.metadata_named(RUN_RECORD).cloned().expect("a run");
    options.split = SplitLimits { size, duration: Duration::ZERO };
    let bag = RunBag::create(options).expect("a bag");
    let channels = from.channels().iter().map(|channel| {
        let schema = channel.schema.as_ref().expect("a schema");
        let spec = ChannelSpec {
            topic: channel.topic.clone(),
            type_name: schema.name.clone(),
            schema_text: String::from_utf8(schema.text.clone()).expect("text"),
            type_hash: channel.type_hash.clone(),
            qos: channel.qos.clone(),
        };
        bag.add_channel(&spec).expect("a channel")
    });
    let channels: Vec<_> = channels.collect();
    for message in from.messages() {
        let message = message.expect("a message");
        let channel = channels[message.channel_index];
        let (at, sent) = (message.log_time_ns, message.publish_time_ns);
        assert!(bag.write(channel, at, sent, message.data.to_vec()));
    }
    let path = bag.path().to_owned();
    assert!(bag.finish(Duration::from_secs(60)).complete);
    path
}

fn files(bag: &Path) -> Vec<PathBuf> {
    let files = fs::read_dir(bag).expect("a folder").map(|it| it.expect("a file").path());
    let mut files: Vec<PathBuf> =
        files.filter(|it| it.extension().is_some_and(|it| it == "mcap")).collect();
    files.sort();
    files
}

/// Pushes; what came of it, and the sentences.
fn pushed(store: &Store, bags: &[&Path]) -> (Done, Vec<String>) {
    let said = std::cell::RefCell::new(Vec::new());
    let order =
        Order { bags: bags.iter().map(|it| it.to_path_buf()).collect(), ..Order::default() };
    let done = push(Ok(store), &order, &|text| said.borrow_mut().push(text.to_owned()));
    (done.expect("a push"), said.into_inner())
}

#[test]
fn a_bag_of_several_files_is_one_bag_of_the_store_and_replays_as_the_whole_one() {
    let folder = tempdir().expect("a folder");
    let store = open(&folder.path().join("store"));
    let whole = record(&bags()[3], folder.path(), "whole", 0);
    let split = record(&bags()[3], folder.path(), "split", 20_000);
    let parts = files(&split);
    assert!(parts.len() > 2, "{parts:?}");
    fs::write(split.join(MARK_FILE), "worn tool").expect("marked");
    for bag in [&whole, &split] {
        let (done, said) = pushed(&store, &[bag]);
        assert_eq!((done.sent, done.refused), (1, 0), "{said:?}");
    }
    // Again, and under another name: it is there.
    let renamed = folder.path().join("renamed");
    fs::rename(&split, &renamed).expect("renamed");
    assert_eq!(pushed(&store, &[&renamed]).0, Done { known: 1, ..Done::default() });
    let rows: Vec<_> = indexed(&store).into_values().collect();
    let of = |column: &str| -> Vec<_> {
        rows.iter().map(|row| row[place(INDEX, column)].clone()).collect()
    };
    for column in ["messages", "outcome", "program_sha256", "duration_s", "holds", "complete"] {
        let values = of(column);
        assert_eq!(values[0], values[1], "{column}");
    }
    assert!(of("kept").iter().any(|it| it.as_text() == "worn tool"));
    replay(&store, "0/1", "today", &folder.path().join("journal")).expect("done");
    let verdicts = said(&store, "today");
    assert_eq!(verdicts.len(), 2);
    assert!(verdicts.values().all(|rows| rows[0][1].as_text() == "reproduced"), "{verdicts:?}");
    // One part alone, and a bag without one of its parts.
    let parts = files(&renamed);
    let (done, said) = pushed(&store, &[&parts[1]]);
    assert_eq!(done.refused, 1);
    assert!(said[0].contains("push their folder; else `kerf bag recover"), "{said:?}");
    fs::remove_file(&parts[1]).expect("removed");
    let (done, said) = pushed(&store, &[&renamed]);
    assert_eq!(done.refused, 1);
    assert!(said[0].contains(parts[1].file_name().unwrap().to_str().unwrap()), "{said:?}");
}

fn parts_of_index(store: &Store) -> usize {
    store.list("index").expect("a listing").len()
}

#[test]
fn runs_that_are_pushed_one_by_one_leave_few_parts_and_every_row() {
    let folder = tempdir().expect("a folder");
    let store = open(&folder.path().join("store"));
    let bags = bags();
    for (count, bag) in bags[..70].iter().enumerate() {
        let (done, said) = pushed(&store, &[bag]);
        assert_eq!((done.sent, said.len()), (1, 0), "{said:?}");
        assert_eq!(indexed(&store).len(), count + 1);
        assert!(parts_of_index(&store) < 32, "{count}");
    }
    // A mark that comes later holds, also when its row is joined with the older one.
    let marked = folder.path().join("marked");
    fs::create_dir(&marked).expect("a folder");
    fs::copy(&bags[0], marked.join("marked_0.mcap")).expect("copied");
    fs::write(marked.join(MARK_FILE), "golden").expect("marked");
    pushed(&store, &[&marked]);
    for bag in &bags[70..105] {
        pushed(&store, &[bag]);
    }
    let rows = indexed(&store);
    assert_eq!(rows.len(), 105);
    let kept = rows.values().filter(|row| row[place(INDEX, "kept")].as_text() == "golden");
    assert_eq!(kept.count(), 1);
}

#[test]
fn a_reader_has_every_row_while_parts_are_joined() {
    let folder = tempdir().expect("a folder");
    let at = folder.path().join("store");
    let store = open(&at);
    let bags = bags();
    let (first, others) = bags.split_at(30);
    first.iter().for_each(|bag| drop(pushed(&store, &[bag])));
    let is_over = Arc::new(AtomicBool::new(false));
    let reader = {
        let is_over = Arc::clone(&is_over);
        std::thread::spawn(move || {
            let store = open(&at);
            let mut reads = 0;
            while !is_over.load(Ordering::Relaxed) || reads == 0 {
                let read = dataset::index(&store, &["bag"]).expect("an index");
                assert!(read.problems.is_empty(), "{:?}", read.problems);
                assert!(read.rows.len() >= 30, "{} rows after {reads} reads", read.rows.len());
                reads += 1;
            }
        })
    };
    for bag in others {
        pushed(&store, &[bag]);
    }
    is_over.store(true, Ordering::Relaxed);
    reader.join().expect("every read was whole");
    assert!(parts_of_index(&store) < 32);
}

#[test]
fn a_join_that_fails_anywhere_loses_no_row() {
    let folder = tempdir().expect("a folder");
    let at = folder.path().join("store");
    let store = open(&at);
    // Parts that nobody has joined yet.
    let mut singles = Vec::new();
    for bag in &bags()[..40] {
        let other = open(&folder.path().join("other"));
        pushed(&other, &[bag]);
        let part = other.list("index").expect("a listing").pop().expect("a part");
        let content = other.get(&part.object).expect("read");
        fs::remove_dir_all(folder.path().join("other")).expect("removed");
        store.put(&part.object, &content).expect("written");
        singles.push((part.object, content));
    }
    let before = indexed(&store);
    assert_eq!((before.len(), parts_of_index(&store)), (40, 40));
    // No room for the joined part.
    let full = Store::with(Arc::new(Failing::new(&at, u64::MAX, 100)), "full".to_owned());
    let full = full.expect("a store");
    let error = dataset::join_index(&full).expect_err("no room").to_string();
    assert!(error.contains("no space left on device"), "{error}");
    assert_eq!((indexed(&store), parts_of_index(&store)), (before.clone(), 40));
    assert_eq!(dataset::join_index(&store).expect("joined"), 40);
    assert_eq!((indexed(&store), parts_of_index(&store)), (before.clone(), 1));
    assert_eq!(dataset::join_index(&store).expect("nothing to do"), 0);
    // A join that was broken off after it had written: that part stays, and none is written.
    let joined = store.list("index").expect("a listing").pop().expect("a part").object;
    singles.iter().for_each(|(object, content)| store.put(object, content).expect("written"));
    let full = Store::with(Arc::new(Failing::new(&at, u64::MAX, 100)), "full".to_owned());
    assert_eq!(dataset::join_index(&full.expect("a store")).expect("joined"), 40);
    assert_eq!(store.list("index").expect("a listing").pop().expect("a part").object, joined);
    assert_eq!((indexed(&store), parts_of_index(&store)), (before.clone(), 1));
    // Parts that a build of before has named by their bags may be replaced by it: they stay.
    for (number, (_, content)) in singles.iter().enumerate() {
        store.put(&format!("index/{number:016x}.parquet"), content).expect("written");
    }
    assert_eq!(dataset::join_index(&store).expect("nothing to do"), 0);
    assert_eq!((indexed(&store), parts_of_index(&store)), (before, 41));
}
