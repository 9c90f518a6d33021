//! A recorded bag cut at every byte: every chunk that was completely written is recovered.
//!
//! The index of the uncut bag, read by crate `mcap`, says which chunks those are.
#![cfg(feature = "std-fs")]

mod common;

use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use common::*;
use run_recorder::bag_reader::{Bag, BagMessage, Problem};
use run_recorder::bag_writer::BagAttachment;
use run_recorder::files::open_bag;
use run_recorder::recover::{CopySelection, Recovered, recover};
use run_recorder::run_bag::{RunBag, RunBagOptions, SplitLimits};

const LONG: Duration = Duration::from_secs(60);
const CHUNKS: usize = 6;

/// A run of [`CHUNKS`] chunks of messages, recorded as runs are.
fn record(directory: &Path, split: SplitLimits) -> PathBuf {
    let mut options = RunBagOptions::new(directory, "run");
    options.run.insert("run_id".into(), "run".into());
    options.flush_interval = Duration::from_millis(5);
    options.split = split;
    let bag = RunBag::create(options).unwrap();
    let latched = bag.add_channel(&string_channel("/mill/state")).unwrap();
    let tool = bag.add_channel(&point_channel("/mill/tool")).unwrap();
    let data = b"N10 G1 X5 F100\nM30\n".to_vec();
    let (name, media_type) = ("program.mpf".into(), "text/plain".into());
    bag.attach(BagAttachment { name, media_type, log_time_ns: 1, data }).unwrap();
    let begin = Instant::now();
    for chunk in 1..=CHUNKS as u64 {
        for i in 0..7 {
            let time = chunk * 1000 + i;
            let channel = if i == 3 { latched } else { tool };
            let data = match i {
                3 => string_message(&format!("state {chunk}")),
                _ => point_message(time as i32, [i as f64, 0.5, -1.0]),
            };
            assert!(bag.write(channel, time, time - 1, data));
        }
        // The next chunk begins when this one is closed.
        let is_flushed = || open_bag(bag.path()).is_ok_and(|bag| count(&bag) >= chunk * 7);
        while !is_flushed() {
            assert!(begin.elapsed() < LONG, "chunk {chunk} is not closed");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    let path = bag.path().to_owned();
    assert!(bag.finish(LONG).complete);
    path
}

fn count<R: std::io::Read + std::io::Seek>(bag: &Bag<R>) -> u64 {
    bag.summary().message_count
}

/// Where each chunk of a finished file ends, and how many messages are in it.
fn chunk_ends(bytes: &[u8]) -> Vec<(usize, usize)> {
    let summary = mcap::Summary::read(bytes).unwrap().expect("an index");
    summary
        .chunk_indexes
        .iter()
        .map(|index| {
            let end = index.chunk_start_offset + index.chunk_length;
            let messages = summary.stream_chunk(bytes, index).unwrap().count();
            (usize::try_from(end).unwrap(), messages)
        })
        .collect()
}

fn recovered(bag: &mut Bag<Cursor<Vec<u8>>>) -> (Vec<u8>, Recovered) {
    recover(bag, Vec::new(), "saved_0.mcap", &BTreeMap::new(), CopySelection::ALL).unwrap()
}

/// Content without the channels, whose counts differ.
fn contents(bag: &mut Bag<Cursor<Vec<u8>>>) -> Vec<(usize, u32, u64, u64, Vec<u8>)> {
    bag.messages()
        .map(|message| {
            let BagMessage { channel_index, sequence, log_time_ns, publish_time_ns, data, .. } =
                message.unwrap();
            (channel_index, sequence, log_time_ns, publish_time_ns, data)
        })
        .collect()
}

#[test]
fn a_bag_cut_at_every_byte_is_recovered_up_to_its_last_whole_chunk() {
    let directory = tempfile::tempdir().unwrap();
    let bag = record(directory.path(), SplitLimits::default());
    let bytes = fs::read(bag.join("run_0.mcap")).unwrap();
    let ends = chunk_ends(&bytes);
    assert!(ends.iter().filter(|(_, messages)| *messages > 0).count() >= CHUNKS, "{ends:?}");
    let original = contents(&mut open(&bytes));
    assert_eq!(original.len(), CHUNKS * 7);
    let (mut refused, mut last) = (0, usize::MAX);
    for length in 0..bytes.len() {
        let whole: usize =
            ends.iter().filter(|(end, _)| *end <= length).map(|(_, messages)| messages).sum();
        let mut cut = match Bag::open("run_0.mcap", Cursor::new(bytes[..length].to_vec())) {
            Ok(cut) => cut,
            Err(error) => {
                // Before the header is whole there is nothing to read.
                assert_eq!(whole, 0, "cut at {length}: {error}");
                assert!(error.to_string().contains("run_0.mcap"), "cut at {length}: {error}");
                refused = length;
                continue;
            }
        };
        assert!(!cut.is_complete(), "cut at {length}");
        let (saved, report) = recovered(&mut cut);
        assert_eq!(report.summary.message_count as usize, whole, "cut at {length}");
        assert!(report.left_out.is_empty(), "cut at {length}: {:?}", report.left_out);
        assert!(!report.problems.is_empty(), "cut at {length}");
        let mut first = open(&saved);
        assert!(contents(&mut first) == original[..whole], "cut at {length}");
        // It reports what is missing, and no other problem.
        assert!(matches!(first.problems(), [Problem::RecorderSays { .. }]), "cut at {length}");
        // Its recovered copy has the same messages; checked at each chunk's end and at samples.
        if std::mem::replace(&mut last, whole) == whole && length % 8 != 0 {
            continue;
        }
        let (again, second) = recovered(&mut first);
        assert_eq!(second.summary, report.summary, "cut at {length}");
        assert!(again == saved, "cut at {length}: the second copy differs");
    }
    assert!(refused < 64, "the first {refused} bytes alone are too few");
}

#[test]
fn the_last_file_of_a_split_bag_cut_at_every_byte_costs_nothing_of_the_others() {
    let directory = tempfile::tempdir().unwrap();
    let bag = record(directory.path(), SplitLimits { size: 1, duration: Duration::ZERO });
    let file = |part| fs::read(bag.join(format!("run_{part}.mcap"))).unwrap();
    // A file for each message; two of them are enough.
    let (first, second) = (file(0), file(1));
    let before = count(&open(&first));
    let ends = chunk_ends(&second);
    let (last_end, own) = *ends.last().expect("chunks");
    assert_eq!(own, 1, "{ends:?}");
    for length in 0..second.len() {
        let sources = [&first[..], &second[..length]].map(|bytes| {
            let reader = Cursor::new(bytes.to_vec());
            run_recorder::bag_reader::BagSource { name: "part".into(), reader }
        });
        let mut cut = Bag::from_sources(sources.into()).unwrap();
        assert!(!cut.is_complete(), "cut at {length}");
        let expected = before + u64::from(length >= last_end);
        let (saved, report) = recovered(&mut cut);
        assert_eq!(report.summary.message_count, expected, "cut at {length}");
        assert_eq!(count(&open(&saved)), expected, "cut at {length}");
    }
}
