//! Written bags read back completely and in order.

mod common;

use std::collections::BTreeMap;
use std::io::Cursor;

use common::*;
use rosidl::decode::decode;
use rosidl::value::Value;
use run_recorder::bag_reader::{Bag, BagError, MessageFilter, Problem};
use run_recorder::bag_writer::{BagAttachment, BagWriteError, BagWriter, LIBRARY};
use run_recorder::qos::QosProfile;
use run_recorder::recover::{CopySelection, recover};

#[test]
fn a_written_bag_reads_back_with_topics_messages_and_quality_of_service() {
    let (bytes, _) = bag_bytes(100, 30);
    let mut bag = open(&bytes);
    assert_eq!(bag.problems(), []);
    assert!(bag.is_complete());
    assert_eq!(bag.library(), LIBRARY);
    let topics: Vec<_> = bag.channels().iter().map(|c| c.topic.as_str()).collect();
    assert_eq!(topics, ["/mill/log", "/mill/tool"]);
    assert_eq!(bag.channels()[0].type_name(), "std_msgs/msg/String");
    assert_eq!(bag.channels()[0].qos, [QosProfile::latched(1)]);
    assert!(bag.channels()[0].type_hash.starts_with("RIHS01_df668"));
    assert_eq!(bag.channels()[0].message_count, 34);
    let summary = bag.summary();
    assert_eq!(summary.message_count, 100);
    assert_eq!(summary.duration_ns(), 99_000_000);
    let messages = read_all(&mut bag);
    assert_eq!(messages.len(), 100);
    assert_eq!(messages[0].data, string_message("line 0"));
    assert_eq!(messages[0].publish_time_ns, 999_999_500);
    let of_tool: Vec<_> = messages.iter().filter(|m| m.channel_index == 1).collect();
    assert!(of_tool.iter().enumerate().all(|(i, m)| m.sequence == i as u32));
    assert!(messages.is_sorted_by_key(|m| m.log_time_ns));
}

#[test]
fn a_message_of_a_bag_is_decoded_by_its_path() {
    let (bytes, _) = bag_bytes(6, 3);
    let mut bag = open(&bytes);
    let messages = read_all(&mut bag);
    let schema = messages[1].channel.schema.clone().unwrap().parse().unwrap();
    let value = Value::Message(decode(&schema, &messages[1].data).unwrap());
    assert_eq!(value.get("point.x"), Some(&Value::Float(1.0)));
    assert_eq!(value.get("header.frame_id").unwrap().as_str(), Some("work"));
    assert_eq!(value.get("header.nothing"), None);
    assert_eq!(
        value.to_string(),
        "{header: {stamp: {sec: 1, nanosec: 0}, frame_id: \"work\"}, point: {x: 1.0, y: 0.5, z: -1.0}}"
    );
}

#[test]
fn equal_calls_give_equal_bytes() {
    assert_eq!(bag_bytes(500, 100).0, bag_bytes(500, 100).0);
}

#[test]
fn messages_come_in_the_order_of_log_time_across_chunks() {
    let mut writer = BagWriter::new(Vec::new()).unwrap();
    let log = writer.add_channel(&string_channel("/log")).unwrap();
    // Chunks that overlap, one inside another, and equal times.
    let chunks: [&[u64]; 4] = [&[10, 40, 30, 90], &[20, 35], &[35, 36, 100], &[5]];
    for times in chunks {
        for time in times {
            writer.write(log, *time, 0, &string_message("x")).unwrap();
        }
        writer.flush().unwrap();
    }
    let (bytes, _) = writer.finish("a_0.mcap", &BTreeMap::new()).unwrap();
    let mut bag = open(&bytes);
    let order: Vec<_> =
        bag.messages().map(|m| m.map(|m| (m.log_time_ns, m.sequence)).unwrap()).collect();
    let expected =
        [(5, 9), (10, 0), (20, 4), (30, 2), (35, 5), (35, 6), (36, 7), (40, 1), (90, 3), (100, 8)];
    assert_eq!(order, expected);
    assert!(bag.is_complete());

    // Without a window order is given up; every message still comes, and it is reported.
    let count = bag.messages().with_window(0).count();
    assert_eq!(count, expected.len());
    assert!(matches!(bag.problems(), [Problem::OrderNotKept { .. }]));
}

#[test]
fn a_filter_gives_topics_and_times_alone() {
    let (bytes, _) = bag_bytes(100, 10);
    let mut bag = open(&bytes);
    let filter = MessageFilter {
        topics: Some(["/mill/log".to_owned()].into()),
        from_ns: Some(1_030_000_000),
        before_ns: Some(1_060_000_000),
    };
    let sequences: Vec<_> = bag.messages_where(filter).map(|m| m.unwrap().sequence).collect();
    assert_eq!(sequences, (10..20).collect::<Vec<_>>());
}

#[test]
fn attachments_and_metadata_travel_along() {
    let mut writer = BagWriter::new(Vec::new()).unwrap();
    let attachment = BagAttachment {
        name: "program.mpf".into(),
        media_type: "text/plain".into(),
        log_time_ns: 7,
        data: b"N10 G1 X5 F100\n".to_vec(),
    };
    writer.attach(&attachment).unwrap();
    let run = BTreeMap::from([("run_id".to_owned(), "r7".to_owned())]);
    writer.write_metadata("cnc_run", &run).unwrap();
    let log = writer.add_channel(&string_channel("/log")).unwrap();
    writer.write(log, 1, 1, &string_message("a")).unwrap();
    writer.skip(log, 3).unwrap();
    writer.write(log, 2, 2, &string_message("b")).unwrap();
    let (bytes, summary) = writer.finish("r7_0.mcap", &run).unwrap();
    assert_eq!(summary.message_count, 2);

    let mut bag = open(&bytes);
    let info = bag.attachments()[0].clone();
    assert_eq!((info.name.as_str(), info.size), ("program.mpf", 15));
    assert_eq!(bag.read_attachment(&info).unwrap(), attachment.data);
    assert_eq!(bag.metadata_named("cnc_run"), Some(&run));
    let rosbag2 = bag.metadata_named("rosbag2").unwrap();
    assert!(rosbag2["serialized_metadata"].contains("message_count: 2"));
    let sequences: Vec<_> = read_all(&mut bag).iter().map(|m| m.sequence).collect();
    assert_eq!(sequences, [0, 4]);
}

#[test]
fn the_writer_refuses_what_readers_would_choke_on() {
    let mut writer = BagWriter::new(Vec::new()).unwrap();
    writer.add_channel(&string_channel("/log")).unwrap();
    let add = |writer: &mut BagWriter<_>, topic: &str, type_name: &str, text: &str| {
        let mut spec = string_channel(topic);
        spec.type_name = type_name.into();
        spec.schema_text = text.into();
        writer.add_channel(&spec).unwrap_err().to_string()
    };
    let type_name = "std_msgs/msg/String";
    assert!(
        add(&mut writer, "/log", type_name, STRING_TEXT).contains("/log is in the bag already")
    );
    assert!(add(&mut writer, "log", type_name, STRING_TEXT).contains("begin with a slash"));
    assert!(add(&mut writer, "/b", "std_msgs/String", STRING_TEXT).contains("package/msg/Type"));
    assert!(add(&mut writer, "/b", type_name, "string other\n").contains("another definition"));
    let error = add(&mut writer, "/b", "a_msgs/msg/B", "a_msgs/C c\n");
    assert!(error.contains("a_msgs/C, needed by a_msgs/B, is missing"), "{error}");
}

#[test]
fn a_full_disk_is_an_error_and_leaves_what_was_flushed() {
    struct Small(SharedSink, usize);
    impl std::io::Write for Small {
        fn write(&mut self, buf: &[u8]) -> std::io::Result<usize> {
            let room = self.1 - self.0.bytes().len();
            if room == 0 {
                return Err(std::io::ErrorKind::StorageFull.into());
            }
            self.0.write(&buf[..room.min(buf.len())])
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let sink = SharedSink::default();
    let mut writer = BagWriter::new(Small(sink.clone(), 3000)).unwrap();
    let log = writer.add_channel(&string_channel("/log")).unwrap();
    let mut flushed = 0;
    let mut written = 0;
    let error = loop {
        let data = string_message(&format!("message {written}"));
        if let Err(error) = writer.write(log, written, 0, &data) {
            break error;
        }
        written += 1;
        if written % 5 == 0 {
            match writer.flush() {
                Ok(()) => flushed = written,
                Err(error) => break error,
            }
        }
    };
    assert!(matches!(error, BagWriteError::Io(_)), "{error}");
    // Further writes fail without a panic.
    assert!(writer.write(log, 0, 0, &[]).is_err());
    assert!(writer.flush().is_err());
    drop(writer);
    let mut bag = open(&sink.bytes());
    assert!(!bag.is_complete());
    assert_eq!(read_all(&mut bag).len() as u64, flushed);
    assert!(flushed > 0);
}

#[test]
fn what_is_not_a_bag_is_refused_with_the_reason() {
    let open = |bytes: &[u8]| Bag::open("x.mcap", Cursor::new(bytes.to_vec())).unwrap_err();
    assert!(matches!(open(b""), BagError::ZeroLength { .. }));
    assert!(matches!(open(b"G1 X5"), BagError::NotABag { .. }));
    assert!(matches!(open(&[0; 4096]), BagError::NotABag { .. }));
    assert!(matches!(open(mcap::MAGIC), BagError::NoHeader { length: 8, .. }));
    let mut other = Vec::new();
    let options = mcap::WriteOptions::new().profile("ros1");
    options.create(Cursor::new(&mut other)).unwrap().finish().unwrap();
    let error = open(&other);
    assert!(matches!(error, BagError::WrongProfile { .. }));
    assert!(error.to_string().contains("\"ros1\""), "{error}");
}

#[test]
fn a_finished_bag_is_opened_and_sought_in_without_reading_it_whole() {
    use std::cell::Cell;
    use std::io::{Read, Seek, SeekFrom};
    use std::rc::Rc;

    struct Counting(Cursor<Vec<u8>>, Rc<Cell<usize>>);
    impl Read for Counting {
        fn read(&mut self, buf: &mut [u8]) -> std::io::Result<usize> {
            let count = self.0.read(buf)?;
            self.1.set(self.1.get() + count);
            Ok(count)
        }
    }
    impl Seek for Counting {
        fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
            self.0.seek(to)
        }
    }

    let mut writer = BagWriter::new(Vec::new()).unwrap();
    let log = writer.add_channel(&string_channel("/log")).unwrap();
    writer.flush().unwrap();
    let mut noise = 1_u64;
    for i in 0..2000 {
        let text: String = (0..40)
            .map(|_| {
                noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                format!("{:08x}", noise >> 32)
            })
            .collect();
        writer.write(log, i, i, &string_message(&text)).unwrap();
        if i % 20 == 19 {
            writer.flush().unwrap();
        }
    }
    let (bytes, _) = writer.finish("a_0.mcap", &BTreeMap::new()).unwrap();
    let size = bytes.len();
    let read = Rc::new(Cell::new(0));
    let mut bag = Bag::open("a", Counting(Cursor::new(bytes), read.clone())).unwrap();
    assert!(read.get() * 10 < size, "{} of {size} bytes are read to open it", read.get());
    let filter = MessageFilter { from_ns: Some(1000), ..MessageFilter::default() };
    let first = bag.messages_where(filter).next().unwrap().unwrap();
    assert_eq!(first.log_time_ns, 1000);
    assert!(read.get() * 8 < size, "{} of {size} bytes are read to seek in it", read.get());
    assert_eq!(bag.messages().count(), 2000);
}

/// A bag of an earlier version: its definitions are in a chunk of their own.
fn bag_with_definitions_alone() -> Vec<u8> {
    let mut bytes = Vec::new();
    let options = mcap::WriteOptions::new().profile("ros2");
    let mut writer = options.create(Cursor::new(&mut bytes)).unwrap();
    let schema = writer.add_schema("std_msgs/msg/String", "ros2msg", STRING_TEXT.as_bytes());
    let channel = writer.add_channel(schema.unwrap(), "/log", "cdr", &BTreeMap::new()).unwrap();
    writer.flush().unwrap();
    for (sequence, time) in [(0, 10), (1, 20)] {
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence,
            log_time: time,
            publish_time: time,
        };
        writer.write_to_known_channel(&header, &string_message("x")).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    bytes
}

#[test]
fn a_bag_that_ros2_bag_play_refuses_is_named_and_its_copy_plays() {
    let mut bag = open(&bag_with_definitions_alone());
    bag.verify().unwrap();
    let [problem] = bag.problems() else { panic!("{:?}", bag.problems()) };
    assert!(matches!(problem, Problem::NotPlayable { .. }), "{problem}");
    assert!(problem.to_string().contains("`kerf bag recover`"), "{problem}");
    // Nothing is missing from it, so it replays.
    assert!(bag.is_complete() && problem.is_of_index() && !problem.is_damage());

    let (sink, all) = (Vec::new(), CopySelection::ALL);
    let (bytes, copied) = recover(&mut bag, sink, "b_0.mcap", &BTreeMap::new(), all).unwrap();
    assert_eq!(copied.summary.message_count, 2);
    let mut copy = open(&bytes);
    copy.verify().unwrap();
    assert_eq!(copy.problems(), []);
    assert_eq!(read_all(&mut copy).len(), 2);
}

#[test]
fn no_chunk_is_written_without_a_message() {
    let run = BTreeMap::from([("run_id".to_owned(), "r7".to_owned())]);
    let mut writer = BagWriter::new(Vec::new()).unwrap();
    writer.flush().unwrap();
    let log = writer.add_channel(&string_channel("/log")).unwrap();
    // Each of these closes a chunk.
    writer.flush().unwrap();
    writer.write_metadata("cnc_run", &run).unwrap();
    writer.add_channel(&string_channel("/silent")).unwrap();
    writer.flush().unwrap();
    writer.write(log, 1, 1, &string_message("a")).unwrap();
    writer.flush().unwrap();
    writer.add_channel(&point_channel("/late")).unwrap();
    writer.flush().unwrap();
    let (bytes, summary) = writer.finish("r7_0.mcap", &run).unwrap();
    let file = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(file.chunk_indexes.len(), 1);
    assert!(file.chunk_indexes.iter().all(|chunk| chunk.message_index_length > 0));
    let mut bag = open(&bytes);
    bag.verify().unwrap();
    assert_eq!(bag.problems(), []);
    // A topic without messages is there if another message came after it; metadata.yaml has
    // every topic.
    let topics: Vec<_> = bag.channels().iter().map(|c| c.topic.as_str()).collect();
    assert_eq!(topics, ["/log", "/silent"]);
    assert_eq!(summary.topics.len(), 3);
}
