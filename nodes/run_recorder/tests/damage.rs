//! Truncated and damaged bags: everything readable is read, and nothing panics.

mod common;

use std::collections::BTreeMap;
use std::io::Cursor;

use common::*;
use proptest::prelude::*;
use run_recorder::bag_reader::{Bag, Problem};
use run_recorder::bag_writer::LIBRARY;
use run_recorder::info::BagInfo;
use run_recorder::recover::{CopySelection, recover};

#[test]
fn a_bag_cut_at_any_byte_gives_everything_flushed_before() {
    let (bytes, flushes) = bag_bytes(60, 7);
    for length in 0..bytes.len() {
        let cut = Cursor::new(bytes[..length].to_vec());
        let flushed = flushes.iter().rev().find(|(size, _)| *size <= length);
        let mut bag = match Bag::open("cut.mcap", cut) {
            Ok(bag) => bag,
            Err(error) => {
                assert!(flushed.is_none(), "cut at {length}: {error}");
                continue;
            }
        };
        assert!(!bag.is_complete(), "cut at {length}");
        let messages = read_all(&mut bag);
        let wanted = flushed.map_or(0, |(_, count)| *count);
        // A chunk that was complete before its flush was reported may be there too.
        assert!(messages.len() >= wanted, "cut at {length}");
        if let Some((_, count)) = flushed
            && flushes.iter().any(|(size, _)| *size == length)
        {
            assert_eq!(messages.len(), *count, "cut at {length}");
        }
        assert_eq!(bag.summary().message_count, messages.len() as u64);
    }
}

#[test]
fn any_changed_byte_is_reported_and_never_gives_a_wrong_message() {
    let (bytes, _) = bag_bytes(60, 20);
    let original = read_all(&mut open(&bytes));
    for at in 0..bytes.len() {
        let mut changed = bytes.clone();
        changed[at] ^= 0x55;
        let Ok(mut bag) = Bag::open("changed.mcap", Cursor::new(changed)) else {
            continue;
        };
        for message in bag.messages() {
            let message = message.unwrap();
            assert!(
                original.iter().any(|m| m.data == message.data && m.sequence == message.sequence),
                "byte {at}: {message:?}"
            );
        }
        bag.verify().unwrap();
        let of = records(&bytes).into_iter().rfind(|(_, start, _)| *start <= at);
        assert!(!bag.is_complete(), "byte {at} of {of:?} is another one, and nobody says so");
        let info = BagInfo::new("changed", &bag).to_string();
        assert!(info.contains("messages:"));
    }
}

#[test]
fn a_damaged_chunk_is_left_out_and_named_by_its_place() {
    let (mut bytes, flushes) = bag_bytes(60, 20);
    let start = flushes[1].0;
    // Well inside the compressed part of the second chunk of messages.
    bytes[start + 9 + 60 + 40] ^= 0xff;
    let mut bag = open(&bytes);
    bag.verify().unwrap();
    assert!(!bag.is_complete());
    let Problem::DamagedChunk { at, .. } = &bag.problems()[0] else {
        panic!("{:?}", bag.problems());
    };
    assert_eq!(*at, start as u64);
    assert_eq!(bag.problems()[1], Problem::MessagesMissing { promised: 60, found: 40 });
    assert_eq!(read_all(&mut bag).len(), 40);
}

#[test]
fn a_wrong_checksum_of_an_uncompressed_chunk_is_found() {
    let mut bytes = Vec::new();
    let options = mcap::WriteOptions::new().profile("ros2").compression(None);
    let mut writer = options.create(Cursor::new(&mut bytes)).unwrap();
    let schema = writer.add_schema("a/msg/A", "ros2msg", b"uint8 a\n").unwrap();
    let channel = writer.add_channel(schema, "/a", "cdr", &BTreeMap::new()).unwrap();
    let header = |log_time| mcap::records::MessageHeader {
        channel_id: channel,
        sequence: 0,
        log_time,
        publish_time: 0,
    };
    writer.write_to_known_channel(&header(1), b"\0\x01\0\0needle").unwrap();
    writer.finish().unwrap();
    drop(writer);
    assert_eq!(open(&bytes).messages().count(), 1);
    let at = bytes.windows(6).position(|bytes| bytes == b"needle").unwrap();
    bytes[at] ^= 1;
    let mut bag = open(&bytes);
    assert_eq!(bag.messages().count(), 0);
    let problem = bag.problems()[0].to_string();
    assert!(problem.contains("checksum"), "{problem}");
}

#[test]
fn a_damaged_index_is_reported_and_not_used() {
    let (mut bytes, _) = bag_bytes(60, 20);
    let original = read_all(&mut open(&bytes));
    // The topic in the index, after all chunks.
    let at = bytes.windows(9).rposition(|bytes| bytes == b"/mill/log").unwrap();
    bytes[at + 1] ^= 1;
    let mut bag = open(&bytes);
    let [problem] = bag.problems() else { panic!("{:?}", bag.problems()) };
    let text = problem.to_string();
    let footer = bytes.len() - 37;
    assert!(text.contains(&format!("the record at byte {footer}")), "{text}");
    assert!(text.contains("checksum"), "{text}");
    assert_eq!(bag.channels()[0].topic, "/mill/log");
    assert_eq!(read_all(&mut bag), original);
}

#[test]
fn an_index_that_lies_is_found_out_where_it_is_used() {
    let (bytes, _) = bag_bytes(60, 20);
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let chunk = summary.chunk_indexes.last().unwrap();
    let footer = bytes.len() - 37;
    let start = u64::from_le_bytes(bytes[footer + 9..footer + 17].try_into().unwrap()) as usize;
    let place = chunk.chunk_start_offset.to_le_bytes();
    let entry = start + bytes[start..].windows(8).position(|bytes| bytes == place).unwrap();
    // Times come before the offset, the length after it.
    let at_chunk = format!("the chunk at byte {}", chunk.chunk_start_offset);
    let at_footer = format!("the record at byte {footer}");
    for (at, by, place, says, left) in [
        (entry - 16, 7, &at_chunk, "the index says that it is from", 40),
        // The frames show what the index does not.
        (entry + 8, -1, &at_footer, "does not agree with the records", 60),
    ] {
        let mut lying = bytes.clone();
        let was = i64::from_le_bytes(lying[at..at + 8].try_into().unwrap());
        lying[at..at + 8].copy_from_slice(&(was + by).to_le_bytes());
        let crc = crc32fast::hash(&lying[start..footer + 25]);
        lying[footer + 25..footer + 29].copy_from_slice(&crc.to_le_bytes());
        let mut bag = open(&lying);
        bag.verify().unwrap();
        let text = bag.problems()[0].to_string();
        assert!(text.contains(says) && text.contains(place), "{text}");
        assert_eq!(bag.messages().count(), left);
    }
}

/// Kind, place and length of each record, frames included.
fn records(bytes: &[u8]) -> Vec<(u8, usize, usize)> {
    let mut at = mcap::MAGIC.len();
    let mut records = Vec::new();
    while at + mcap::MAGIC.len() < bytes.len() {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize + 9;
        records.push((bytes[at], at, length));
        at += length;
    }
    records
}

/// Recalculates the checksums for the changed file.
fn seal(bytes: &mut [u8]) {
    let records = records(bytes);
    let place = |kind: u8| records.iter().find(|(of, ..)| *of == kind).unwrap().1;
    let (end, footer) = (place(mcap::records::op::DATA_END), place(mcap::records::op::FOOTER));
    let data = crc32fast::hash(&bytes[..end]);
    bytes[end + 9..end + 13].copy_from_slice(&data.to_le_bytes());
    let summary = crc32fast::hash(&bytes[end + 13..footer + 25]);
    bytes[footer + 25..footer + 29].copy_from_slice(&summary.to_le_bytes());
}

#[test]
fn indexes_that_lie_under_sound_checksums_are_found_and_mended_by_a_copy() {
    use mcap::records::op;
    let (bytes, _) = bag_bytes(60, 20);
    let original = read_all(&mut open(&bytes));
    let kinds = [
        (op::MESSAGE_INDEX, 9 + 6),
        (op::MESSAGE_INDEX, 9 + 14),
        (op::CHUNK_INDEX, 9 + 34),
        (op::STATISTICS, 9 + 14),
        (op::STATISTICS, 9 + 18),
        (op::STATISTICS, 9 + 22),
        (op::METADATA_INDEX, 9 + 8),
        (op::SUMMARY_OFFSET, 9 + 1),
        (op::SUMMARY_OFFSET, 9 + 9),
        (op::FOOTER, 9 + 8),
    ];
    for (kind, within) in kinds {
        let of_kind = |it: &&(u8, usize, usize)| it.0 == kind;
        for (_, at, _) in records(&bytes).iter().filter(of_kind) {
            let mut lying = bytes.clone();
            lying[at + within] ^= 1;
            seal(&mut lying);
            let mut bag = open(&lying);
            bag.verify().unwrap();
            let problems = bag.problems().to_vec();
            assert!(!problems.is_empty(), "kind {kind} at byte {at}");
            assert!(problems.iter().all(Problem::is_damage), "{problems:?}");
            assert_eq!(read_all(&mut bag), original, "kind {kind} at byte {at}");
            if problems.iter().all(Problem::is_of_index) {
                let own = BTreeMap::new();
                let (copy, _) =
                    recover(&mut bag, Vec::new(), "copy_0.mcap", &own, CopySelection::ALL).unwrap();
                let mut copy = open(&copy);
                copy.verify().unwrap();
                assert!(copy.is_complete(), "{:?}", copy.problems());
                assert_eq!(read_all(&mut copy), original);
            }
        }
    }
    // The figures of rosbag2, in a record that no index repeats.
    let (_, at, length) = *records(&bytes).iter().rfind(|it| it.0 == op::METADATA).unwrap();
    let text = b"message_count: 60";
    let found = bytes[at..at + length].windows(text.len()).position(|it| it == text).unwrap();
    let mut lying = bytes.clone();
    lying[at + found + text.len() - 1] = b'1';
    seal(&mut lying);
    let mut bag = open(&lying);
    bag.verify().unwrap();
    let [problem] = bag.problems() else { panic!("{:?}", bag.problems()) };
    assert!(problem.is_of_index());
    assert!(problem.to_string().contains("61 messages, and there are 60"), "{problem}");
}

#[test]
fn bags_without_chunks_index_or_schema_are_read() {
    let mut bytes = Vec::new();
    let options =
        mcap::WriteOptions::new().profile("ros2").use_chunks(false).emit_summary_records(false);
    let mut writer = options.create(Cursor::new(&mut bytes)).unwrap();
    let channel = writer.add_channel(0, "/a", "cdr", &BTreeMap::new()).unwrap();
    for log_time in [5, 3, 4] {
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time,
            publish_time: 0,
        };
        writer.write_to_known_channel(&header, b"\0\x01\0\0").unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    let mut bag = open(&bytes);
    let times: Vec<_> = bag.messages().map(|m| m.unwrap().log_time_ns).collect();
    assert_eq!(times, [3, 4, 5]);
    assert_eq!(bag.channels()[0].message_count, 3);
    let expected = Problem::SchemaMissing { topic: "/a".into() };
    assert_eq!(bag.problems(), [expected]);
}

#[test]
fn several_files_are_one_bag() {
    use run_recorder::bag_reader::BagSource;
    let (first, _) = bag_bytes(30, 10);
    let (second, _) = bag_bytes(60, 10);
    let sources =
        [first, second].map(|bytes| BagSource { name: "part".into(), reader: Cursor::new(bytes) });
    let mut bag = Bag::from_sources(sources.into()).unwrap();
    assert_eq!(bag.channels().len(), 2);
    assert_eq!(bag.summary().message_count, 90);
    let messages = read_all(&mut bag);
    assert_eq!(messages.len(), 90);
    assert!(messages.is_sorted_by_key(|m| m.log_time_ns));
}

#[test]
fn recovering_a_broken_off_bag_makes_a_finished_one_that_says_what_is_missing() {
    let (bytes, flushes) = bag_bytes(60, 20);
    let mut broken = open(&bytes[..flushes[2].0 + 100]);
    let kept = read_all(&mut broken);
    assert_eq!(kept.len(), 40);
    let (copy, recovered) =
        recover(&mut broken, Vec::new(), "copy_0.mcap", &BTreeMap::new(), CopySelection::ALL)
            .unwrap();
    assert_eq!(recovered.summary.message_count, 40);
    assert_eq!(recovered.left_out, []);
    let mut bag = open(&copy);
    let messages = read_all(&mut bag);
    assert_eq!(messages.len(), 40);
    assert!(messages.iter().zip(&kept).all(|(a, b)| a == b));
    // Closed, but not complete, and it knows why.
    let [Problem::RecorderSays { reason }] = bag.problems() else {
        panic!("{:?}", bag.problems());
    };
    assert!(reason.contains("without a footer") || reason.contains("claims"), "{reason}");
}

#[test]
fn recovering_a_whole_bag_copies_it() {
    let (bytes, _) = bag_bytes(60, 20);
    let mut bag = open(&bytes);
    let original = read_all(&mut bag);
    let (copy, _) =
        recover(&mut bag, Vec::new(), "c_0.mcap", &BTreeMap::new(), CopySelection::ALL).unwrap();
    let mut copied = open(&copy);
    assert!(copied.is_complete());
    assert_eq!(read_all(&mut copied), original);
}

#[test]
fn info_lists_the_content_of_a_bag() {
    let (bytes, _) = bag_bytes(60, 20);
    let text = BagInfo::new("r1", &open(&bytes)).to_string();
    let expected = format!(
        "\
bag:         r1
written by:  {LIBRARY}
complete:    yes
start:       1970-01-01 00:00:01.000 UTC
duration:    0.059 s
messages:    60
topic:       /mill/log   std_msgs/msg/String                    20
topic:       /mill/tool  geometry_msgs/msg/PointStamped         40
"
    );
    assert_eq!(text, expected);
}

/// Records of every kind with bodies of small numbers, so that lengths and ids often seem right.
fn junk_records() -> impl Strategy<Value = Vec<u8>> {
    let body = prop_oneof![
        prop::collection::vec(prop_oneof![3 => Just(0_u8), 2 => 1..40_u8, 1 => any::<u8>()], 0..90),
        // The beginning of a chunk without compression, whatever may be in it.
        prop::collection::vec(any::<u8>(), 0..60).prop_map(|inside| {
            let mut body = vec![0; 16];
            body.extend((inside.len() as u64).to_le_bytes());
            body.extend([0; 8]);
            body.extend((inside.len() as u64).to_le_bytes());
            body.extend(inside);
            body
        }),
    ];
    prop::collection::vec((0..18_u8, body, any::<bool>()), 0..8).prop_map(|records| {
        let mut bytes = Vec::new();
        for (opcode, body, is_long) in records {
            bytes.push(opcode);
            bytes.extend((body.len() as u64 + u64::from(is_long)).to_le_bytes());
            bytes.extend(body);
        }
        bytes
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn junk_after_a_header_is_never_a_panic(junk in junk_records()) {
        let (bag, _) = bag_bytes(0, 1);
        let header_end = 8 + 9 + usize::from(bag[9]);
        let mut bytes = bag[..header_end].to_vec();
        bytes.extend(junk);
        if let Ok(mut bag) = Bag::open("junk.mcap", Cursor::new(bytes)) {
            prop_assert!(bag.verify().is_ok());
            prop_assert!(!bag.is_complete());
            for info in bag.attachments().to_vec() {
                prop_assert!(bag.read_attachment(&info).is_ok());
            }
        }
    }
}
