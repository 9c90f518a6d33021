//! Test bags: two topics, readable definitions, and a sink that can be inspected.

#![allow(dead_code)]

use std::io::{self, Cursor, Write};
use std::sync::{Arc, Mutex};

use run_recorder::bag_reader::{Bag, BagMessage};
use run_recorder::bag_writer::{BagWriter, ChannelSpec};
use run_recorder::qos::QosProfile;

pub(crate) const STRING_TEXT: &str = "# A text.\nstring data\n";
pub(crate) const POINT_TEXT: &str = concat!(
    "std_msgs/Header header\n",
    "geometry_msgs/Point point\n",
    "================================================================================\n",
    "MSG: std_msgs/Header\n",
    "builtin_interfaces/Time stamp\n",
    "string frame_id\n",
    "================================================================================\n",
    "MSG: builtin_interfaces/Time\n",
    "int32 sec\n",
    "uint32 nanosec\n",
    "================================================================================\n",
    "MSG: geometry_msgs/Point\n",
    "float64 x\n",
    "float64 y\n",
    "float64 z\n",
);

pub(crate) fn string_channel(topic: &str) -> ChannelSpec {
    ChannelSpec {
        topic: topic.into(),
        type_name: "std_msgs/msg/String".into(),
        schema_text: STRING_TEXT.into(),
        type_hash: "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18".into(),
        qos: vec![QosProfile::latched(1)],
    }
}

pub(crate) fn point_channel(topic: &str) -> ChannelSpec {
    ChannelSpec {
        topic: topic.into(),
        type_name: "geometry_msgs/msg/PointStamped".into(),
        schema_text: POINT_TEXT.into(),
        type_hash: String::new(),
        qos: vec![QosProfile::best_effort(5), QosProfile::reliable(10)],
    }
}

/// CDR, little endian, of std_msgs/String.
pub(crate) fn string_message(text: &str) -> Vec<u8> {
    let mut data = vec![0, 1, 0, 0];
    data.extend((text.len() as u32 + 1).to_le_bytes());
    data.extend(text.bytes());
    data.push(0);
    data
}

/// CDR, little endian, of geometry_msgs/PointStamped with a frame of four letters.
pub(crate) fn point_message(sec: i32, xyz: [f64; 3]) -> Vec<u8> {
    let mut data = vec![0, 1, 0, 0];
    data.extend(sec.to_le_bytes());
    data.extend(0_u32.to_le_bytes());
    data.extend(5_u32.to_le_bytes());
    data.extend(b"work\0");
    data.resize(4 + 24, 0);
    for value in xyz {
        data.extend(value.to_le_bytes());
    }
    data
}

/// A sink whose content can be inspected while it is written.
#[derive(Debug, Clone, Default)]
pub(crate) struct SharedSink(pub(crate) Arc<Mutex<Vec<u8>>>);

impl SharedSink {
    pub(crate) fn bytes(&self) -> Vec<u8> {
        self.0.lock().unwrap().clone()
    }
}

impl Write for SharedSink {
    fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().extend(buf);
        Ok(buf.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A finished bag of `count` messages on two topics, flushed every `flush_every`.
///
/// Returns the bytes and, for each flush, how long the file was and how many
/// messages it held.
pub(crate) fn bag_bytes(count: usize, flush_every: usize) -> (Vec<u8>, Vec<(usize, usize)>) {
    let sink = SharedSink::default();
    let mut writer = BagWriter::new(sink.clone()).unwrap();
    let text = writer.add_channel(&string_channel("/mill/log")).unwrap();
    let point = writer.add_channel(&point_channel("/mill/tool")).unwrap();
    writer.flush().unwrap();
    let mut flushes = vec![(sink.bytes().len(), 0)];
    for i in 0..count {
        let time = 1_000_000_000 + i as u64 * 1_000_000;
        if i % 3 == 0 {
            let data = string_message(&format!("line {i}"));
            writer.write(text, time, time - 500, &data).unwrap();
        } else {
            let data = point_message(i as i32, [i as f64, 0.5, -1.0]);
            writer.write(point, time, time - 500, &data).unwrap();
        }
        if (i + 1) % flush_every == 0 {
            writer.flush().unwrap();
            flushes.push((sink.bytes().len(), i + 1));
        }
    }
    let custom = [("run_id".to_owned(), "r1".to_owned())].into();
    writer.finish("r1_0.mcap", &custom).unwrap();
    (sink.bytes(), flushes)
}

pub(crate) fn open(bytes: &[u8]) -> Bag<Cursor<Vec<u8>>> {
    Bag::open("test.mcap", Cursor::new(bytes.to_vec())).unwrap()
}

pub(crate) fn read_all(bag: &mut Bag<Cursor<Vec<u8>>>) -> Vec<BagMessage> {
    bag.messages().map(|message| message.unwrap()).collect()
}
