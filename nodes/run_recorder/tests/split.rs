//! A split run reads as one run, and each of its files can be read alone.
#![cfg(feature = "std-fs")]

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, Instant};

use common::*;
use run_recorder::bag_reader::{BagMessage, Problem, RESULT_RECORD, RUN_RECORD};
use run_recorder::bag_writer::BagAttachment;
use run_recorder::files::{FileBag, open_bag, recover_bag};
use run_recorder::info::BagInfo;
use run_recorder::qos::QosProfile;
use run_recorder::run_bag::{RunBag, RunBagOptions, SplitLimits};

const LONG: Duration = Duration::from_secs(60);
const SIZE: u64 = 12_000;

/// Records the same run with any limits: one latched topic, one not, and a late one.
fn record(directory: &Path, name: &str, split: SplitLimits) -> PathBuf {
    let mut options = RunBagOptions::new(directory, name);
    options.run.insert("run_id".into(), "r".into());
    options.split = split;
    // One chunk or more in each file, so that the end of a file is not that of a flush.
    options.flush_interval = Duration::from_millis(1);
    let bag = RunBag::create(options).unwrap();
    let latched = bag.add_channel(&string_channel("/mill/state")).unwrap();
    let tool = bag.add_channel(&point_channel("/mill/tool")).unwrap();
    bag.attach(BagAttachment {
        name: "program.mpf".into(),
        media_type: "text/plain".into(),
        log_time_ns: 1,
        data: b"M30".to_vec(),
    })
    .unwrap();
    let mut late = None;
    for i in 0..1000_u64 {
        let time = 1_000_000_000 + i * 1_000_000;
        if i % 100 == 0 {
            assert!(bag.write(latched, time, time - 5, string_message(&format!("state {i}"))));
        }
        if i == 700 {
            let mut spec = point_channel("/mill/late");
            spec.qos = vec![QosProfile::reliable(10)];
            late = Some(bag.add_channel(&spec).unwrap());
        }
        let channel = late.filter(|_| i % 3 == 0).unwrap_or(tool);
        // Digits that do not compress.
        let noise = |n: u64| f64::from_bits((i + n).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 2);
        let point = point_message(i as i32, [noise(1), noise(7_000), noise(90_000)]);
        assert!(bag.write(channel, time, time - 7, point));
        if i % 50 == 0 {
            // So that some chunks are closed in between.
            sleep(Duration::from_millis(2));
        }
    }
    let path = bag.path().to_owned();
    let status = bag.finish(LONG);
    assert!(status.complete && status.is_finished, "{status:?}");
    assert_eq!(status.messages_written, 1010);
    path
}

fn split_by_size(directory: &Path) -> PathBuf {
    record(directory, "r", SplitLimits { size: SIZE, duration: Duration::ZERO })
}

fn parts(bag: &Path) -> Vec<PathBuf> {
    let name = bag.file_name().unwrap().to_str().unwrap();
    (0..).map(|n| bag.join(format!("{name}_{n}.mcap"))).take_while(|file| file.exists()).collect()
}

/// Topic, number, both times and content.
type Content = (String, u32, u64, u64, Vec<u8>);

fn all(bag: &mut FileBag) -> Vec<Content> {
    bag.messages()
        .map(|message| {
            let BagMessage { channel, sequence, log_time_ns, publish_time_ns, data, .. } =
                message.unwrap();
            (channel.topic.clone(), sequence, log_time_ns, publish_time_ns, data)
        })
        .collect()
}

#[test]
fn a_split_run_reads_as_one_that_was_not_split() {
    let folder = tempfile::tempdir().unwrap();
    let split = split_by_size(folder.path());
    let whole = record(&folder.path().join("whole"), "r", SplitLimits::default());
    let parts = parts(&split);
    assert!(parts.len() > 3, "{parts:?}");
    assert_eq!(self::parts(&whole).len(), 1);
    let (mut of_split, mut of_whole) = (open_bag(&split).unwrap(), open_bag(&whole).unwrap());
    // All figures, before and after every message was read.
    let info = |bag: &FileBag| BagInfo::new("r", bag).to_string();
    assert_eq!(info(&of_split), info(&of_whole));
    of_split.verify().unwrap();
    of_whole.verify().unwrap();
    assert_eq!(info(&of_split), info(&of_whole));
    assert!(of_split.is_complete(), "{:?}", of_split.problems());
    assert!(all(&mut of_split) == all(&mut of_whole));
    let attached = of_split.attachments()[0].clone();
    assert_eq!(of_split.read_attachment(&attached).unwrap(), b"M30");
}

#[test]
fn each_file_is_a_bag_by_itself_and_no_larger_than_it_may_be() {
    let folder = tempfile::tempdir().unwrap();
    let split = split_by_size(folder.path());
    let parts = parts(&split);
    let mut own_times = 0..0;
    for (number, part) in parts.iter().enumerate() {
        let mut bag = open_bag(part).unwrap();
        bag.verify().unwrap();
        let (is_first, is_last) = (number == 0, number + 1 == parts.len());
        // It reports its part number, and no other problem.
        for problem in bag.problems() {
            match problem {
                Problem::PartMissing { part, expected: 0, .. } if !is_first => {
                    assert_eq!(*part, number as u64);
                }
                Problem::LastPartMissing { .. } if !is_last => {}
                other => panic!("part {number}: {other}"),
            }
        }
        assert_eq!(bag.problems().len(), usize::from(!is_first) + usize::from(!is_last));
        assert_eq!(bag.metadata_named(RUN_RECORD).unwrap()["run_id"], "r");
        assert_eq!(bag.metadata_named(RESULT_RECORD).is_some(), is_last);
        assert_eq!(bag.attachments().len(), usize::from(is_first));
        // The index is extra.
        assert!(fs::metadata(part).unwrap().len() < SIZE + 8_000, "{}", part.display());
        let messages = all(&mut bag);
        let (start, end) = bag.summary().time_range_ns.unwrap();
        if !is_first {
            // The messages a late joiner would have got when the file begins.
            let (topic, _, log_time_ns, publish_time_ns, _) = &messages[0];
            assert_eq!((topic.as_str(), *log_time_ns), ("/mill/state", start));
            // Where the file begins with a new one, that is it.
            assert!(publish_time_ns + 5 <= start, "it is newer");
        }
        assert!(own_times.end <= start, "part {number} begins before the end of the one before");
        own_times = start..end;
    }
}

#[test]
fn metadata_yaml_lists_each_file_with_what_a_reader_finds_in_it() {
    let folder = tempfile::tempdir().unwrap();
    let split = split_by_size(folder.path());
    let text = fs::read_to_string(split.join("metadata.yaml")).unwrap();
    let mut total = 0;
    for part in parts(&split) {
        let summary = open_bag(&part).unwrap().summary();
        let (start, _) = summary.time_range_ns.unwrap();
        let entry = format!(
            "  - path: {}\n    starting_time:\n      nanoseconds_since_epoch: {start}\n    \
             duration:\n      nanoseconds: {}\n    message_count: {}\n",
            part.file_name().unwrap().to_str().unwrap(),
            summary.duration_ns(),
            summary.message_count
        );
        assert!(text.contains(&entry), "{entry} is not in {text}");
        total += summary.message_count;
    }
    assert!(text.contains(&format!("\n  message_count: {total}\n")), "{text}");
    assert!(total > 1010, "what is repeated is in the files");
}

#[test]
fn a_run_is_split_by_time_too() {
    let folder = tempfile::tempdir().unwrap();
    let mut options = RunBagOptions::new(folder.path(), "r");
    options.split = SplitLimits { size: 0, duration: Duration::from_millis(20) };
    let bag = RunBag::create(options).unwrap();
    let channel = bag.add_channel(&string_channel("/a")).unwrap();
    let begin = Instant::now();
    let mut count = 0;
    while parts(bag.path()).len() < 4 {
        assert!(begin.elapsed() < LONG, "no fourth file");
        assert!(bag.write(channel, count, count, string_message("x")));
        count += 1;
        sleep(Duration::from_millis(1));
    }
    let path = bag.path().to_owned();
    assert!(bag.finish(LONG).complete);
    let mut read = open_bag(&path).unwrap();
    read.verify().unwrap();
    assert!(read.is_complete(), "{:?}", read.problems());
    let sequences: Vec<_> =
        all(&mut read).iter().map(|(_, sequence, ..)| u64::from(*sequence)).collect();
    assert_eq!(sequences, (0..count).collect::<Vec<_>>());
}

#[test]
fn a_split_run_that_died_is_recovered_into_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let split = split_by_size(folder.path());
    let original = all(&mut open_bag(&split).unwrap());
    let parts = parts(&split);
    let last = parts.last().unwrap();
    let bytes = fs::read(last).unwrap();
    fs::remove_file(split.join("metadata.yaml")).unwrap();
    // At first a file is empty, then it has a header, then what it repeats, then messages.
    let mut most = 0;
    for (number, length) in
        [0, 5, 60, 900, 2_000, bytes.len() / 2, bytes.len() - 9].iter().enumerate()
    {
        fs::write(last, &bytes[..*length]).unwrap();
        let mut died = open_bag(&split).unwrap();
        let read = all(&mut died);
        assert!(!died.is_complete(), "cut at {length}");
        assert!(read.len() >= most, "cut at {length}");
        assert!(read[..] == original[..read.len()], "cut at {length}");
        assert_eq!(died.summary().message_count, read.len() as u64);
        most = read.len();

        let saved = folder.path().join(format!("saved_{number}"));
        let recovered = recover_bag(&split, &saved).unwrap();
        assert_eq!(recovered.summary.message_count, read.len() as u64);
        let mut joined = open_bag(&saved).unwrap();
        assert!(all(&mut joined) == read);
        assert!(
            matches!(joined.problems(), [Problem::RecorderSays { .. }]),
            "{:?}",
            joined.problems()
        );
        assert_eq!(self::parts(&saved).len(), 1);
        let of_run = joined.metadata().iter().filter(|record| record.name == RUN_RECORD).count();
        assert_eq!(of_run, 1);
    }
    assert!(most > original.len() * 3 / 4, "{most} of {}", original.len());
}

#[test]
fn a_file_that_is_missing_or_not_listed_is_reported_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let split = split_by_size(folder.path());
    let original = all(&mut open_bag(&split).unwrap());
    let list = split.join("metadata.yaml");
    let text = fs::read_to_string(&list).unwrap();

    // A list that names only one file, as a truncated one may.
    fs::write(&list, "rosbag2_bagfile_information:\n  relative_file_paths: [r_0.mcap]\n").unwrap();
    let mut bag = open_bag(&split).unwrap();
    assert!(all(&mut bag) == original);
    let problem = bag.problems()[0].to_string();
    assert!(problem.contains("does not name r_1.mcap"), "{problem}");
    // Other files in the directory are not part of this bag.
    fs::write(split.join("other_1.mcap"), "G1 X5").unwrap();
    let before = open_bag(&split).unwrap().problems().len();
    assert_eq!(before, bag.problems().len());
    fs::remove_file(split.join("other_1.mcap")).unwrap();

    fs::write(&list, &text).unwrap();
    fs::remove_file(split.join("r_1.mcap")).unwrap();
    let mut bag = open_bag(&split).unwrap();
    let problems: Vec<_> = bag.problems().iter().map(ToString::to_string).collect();
    assert!(
        problems.iter().any(|it| it.contains("names r_1.mcap, which does not exist")),
        "{problems:?}"
    );
    let is_part = |it: &String| it.contains("part 2 of a bag, where part 1");
    assert!(problems.iter().any(is_part), "{problems:?}");
    let left = all(&mut bag);
    let repeated: Vec<_> = left.iter().filter(|message| !original.contains(message)).collect();
    // Latched messages of the missing part are repeated by the next part.
    assert!(!repeated.is_empty());
    for (topic, number, _, sent, data) in repeated {
        let same = |it: &&Content| (&it.0, it.1, it.3, &it.4) == (topic, *number, *sent, data);
        assert!(original.iter().any(|it| same(&it)), "{topic} {number}");
    }

    // The last part: nothing else would show that the run went on.
    fs::write(split.join("r_1.mcap"), "").unwrap();
    let parts = parts(&split);
    fs::remove_file(parts.last().unwrap()).unwrap();
    fs::remove_file(&list).unwrap();
    let problems: Vec<_> =
        open_bag(&split).unwrap().problems().iter().map(ToString::to_string).collect();
    assert!(problems.iter().any(|it| it.contains("and not the last")), "{problems:?}");
    assert!(problems.iter().any(|it| it.contains("r_1.mcap is empty")), "{problems:?}");
}
