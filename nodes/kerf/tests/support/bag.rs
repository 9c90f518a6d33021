//! A bag in memory: read from a golden one, changed, and written in the form of others.
//!
//! The forms are those of rosbag2: Humble or Jazzy, compressed in chunks, as a file or not
//! at all, in one file or split, without any of our records.

use cnc_msgs::cdr;
use cnc_msgs::chunk::{Chunk, sha256_hex};
use cnc_msgs::interface::Message;
use cnc_msgs::schema::{TypeInfo, lookup};
use cnc_msgs::wire::cnc_msgs::msg as wire;
use mcap::records::{MessageHeader, Metadata, op};
use mcap::{Compression, MessageStream, WriteOptions};
use replay::{completed, with_names_of_today};
use rosidl::decode::decode;
use rosidl::encode::encode;
use rosidl::schema::MessageSchema;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// A topic.
#[derive(Debug, Clone)]
pub(crate) struct Topic {
    pub(crate) name: String,
    pub(crate) type_name: String,
    pub(crate) encoding: String,
    pub(crate) schema: Vec<u8>,
    pub(crate) metadata: BTreeMap<String, String>,
}

/// A message of a topic.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Recorded {
    /// Place of its topic.
    pub(crate) topic: usize,
    pub(crate) log_time: u64,
    pub(crate) publish_time: u64,
    pub(crate) data: Vec<u8>,
}

/// All that a bag of others can hold of ours.
#[derive(Debug, Clone)]
pub(crate) struct TestBag {
    pub(crate) topics: Vec<Topic>,
    pub(crate) messages: Vec<Recorded>,
    pub(crate) records: Vec<(String, BTreeMap<String, String>)>,
}

/// How the QoS of publishers is written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Qos {
    /// Numbers, and no type hashes.
    Humble,
    /// Words and hashes.
    Jazzy,
}

/// How a bag is laid out.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Form {
    pub(crate) qos: Qos,
    pub(crate) compression: Option<Compression>,
    pub(crate) files: usize,
    /// `compression_mode: FILE`
    pub(crate) is_zstd_file: bool,
    /// With the records of our recorder.
    pub(crate) is_ours: bool,
}

impl Form {
    pub(crate) const OURS: Self = Self {
        qos: Qos::Jazzy,
        compression: Some(Compression::Zstd),
        files: 1,
        is_zstd_file: false,
        is_ours: true,
    };
    pub(crate) const JAZZY: Self = Self { compression: None, is_ours: false, ..Self::OURS };
    pub(crate) const HUMBLE: Self = Self { qos: Qos::Humble, ..Self::JAZZY };
}

/// The folder of a golden bag.
pub(crate) fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags").join(name)
}

/// The files of a bag folder.
pub(crate) fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a bag is a folder");
    let mut files: Vec<_> = entries
        .map(|entry| entry.expect("its entries can be read").path())
        .filter(|path| path.extension().is_some_and(|it| it == "mcap"))
        .collect();
    files.sort();
    files
}

impl TestBag {
    /// Reads a golden bag; what it has with an older definition is as of today.
    pub(crate) fn golden(name: &str) -> Self {
        let mut bag = Self::read(&golden(name));
        for index in 0..bag.topics.len() {
            bag.migrate(index);
        }
        bag.sum_up::<wire::ContourChunk, wire::ProgrammedContour>(
            |chunk, sum| chunk.crc32 = sum,
            |manifest| ((manifest.program_id.clone(), 0), &mut manifest.sha256),
        );
        bag.sum_up::<wire::PathChunk, wire::CompensatedPath>(
            |chunk, sum| chunk.crc32 = sum,
            |manifest| ((manifest.program_id.clone(), manifest.revision), &mut manifest.sha256),
        );
        bag
    }

    /// Computes the checksums of chunks and manifests anew, whose messages may have more fields now.
    fn sum_up<C: Chunk + Message, M: Message>(
        &mut self,
        set: impl Fn(&mut C, u32),
        sum_of: impl Fn(&mut M) -> ((String, u64), &mut String),
    ) {
        if ![C::TYPE_NAME, M::TYPE_NAME]
            .iter()
            .all(|it| self.topics.iter().any(|topic| topic.type_name == *it))
        {
            return;
        }
        let mut bodies: BTreeMap<(String, u64), BTreeMap<u32, Vec<u8>>> = BTreeMap::new();
        self.change::<C>(|chunk| {
            let sum = chunk.checksums().1;
            set(chunk, sum);
            let (program_id, revision) = chunk.owner();
            let of_owner = bodies.entry((program_id.to_owned(), revision)).or_default();
            of_owner.insert(chunk.index(), chunk.body());
            true
        });
        self.change::<M>(|manifest| {
            let (owner, sum) = sum_of(manifest);
            if let Some(bodies) = bodies.get(&owner) {
                *sum = sha256_hex(&bodies.values().flatten().copied().collect::<Vec<u8>>());
            }
            true
        });
    }

    /// Gives the messages of a topic the fields that their definition lacks, with zeros, and those that
    /// were renamed their names of today.
    fn migrate(&mut self, index: usize) {
        let topic = &mut self.topics[index];
        let Some(info) = lookup(&topic.type_name) else { return };
        if topic.schema == info.schema_text.as_bytes() {
            return;
        }
        let text = std::str::from_utf8(&topic.schema).expect("a definition is text");
        let schema = |text| MessageSchema::parse(&topic.type_name, text).expect("a definition");
        let old = with_names_of_today(&topic.type_name, schema(text));
        let today = schema(info.schema_text);
        for message in self.messages.iter_mut().filter(|message| message.topic == index) {
            let value = decode(&old, &message.data).expect("a message");
            message.data = encode(&today, &completed(&today, &value)).expect("a message");
        }
        topic.schema = info.schema_text.into();
        if let Some(hash) = topic.metadata.get_mut("topic_type_hash") {
            info.rihs01.clone_into(hash);
        }
    }

    /// Reads the folder of a bag with the container library alone.
    pub(crate) fn read(folder: &Path) -> Self {
        let mut bag = Self { topics: Vec::new(), messages: Vec::new(), records: Vec::new() };
        let mut places: BTreeMap<String, usize> = BTreeMap::new();
        for file in files(folder) {
            let bytes = std::fs::read(file).expect("a golden bag");
            for message in MessageStream::new(&bytes).expect("a whole bag") {
                let message = message.expect("a whole message");
                let channel = &message.channel;
                let topic = *places.entry(channel.topic.clone()).or_insert_with(|| {
                    let schema = channel.schema.as_ref().expect("every topic has a definition");
                    bag.topics.push(Topic {
                        name: channel.topic.clone(),
                        type_name: schema.name.clone(),
                        encoding: schema.encoding.clone(),
                        schema: schema.data.to_vec(),
                        metadata: channel.metadata.clone(),
                    });
                    bag.topics.len() - 1
                });
                bag.messages.push(Recorded {
                    topic,
                    log_time: message.log_time,
                    publish_time: message.publish_time,
                    data: message.data.to_vec(),
                });
            }
            let summary = mcap::Summary::read(&bytes).expect("a summary").expect("it is closed");
            for index in &summary.metadata_indexes {
                let record = mcap::read::metadata(&bytes, index).expect("a record");
                if record.name.starts_with("cnc_run") {
                    bag.records.push((record.name, record.metadata));
                }
            }
        }
        bag
    }

    /// The place of the topic of this type.
    pub(crate) fn topic<M: Message>(&self) -> usize {
        let is_of = |topic: &Topic| topic.type_name == M::TYPE_NAME;
        self.topics.iter().position(is_of).expect("a run has this topic")
    }

    /// Index of the status topic of the goals of `run_program`.
    pub(crate) fn goals(&self) -> usize {
        let is_of = |topic: &Topic| topic.name.ends_with("run_program/_action/status");
        self.topics.iter().position(is_of).expect("a run has this topic")
    }

    /// Leaves out the messages of a type; the topic stays, and is silent.
    pub(crate) fn silence<M: Message>(&mut self) {
        let topic = self.topic::<M>();
        self.messages.retain(|message| message.topic != topic);
        self.recount();
    }

    /// Has the recorder say of each topic how many messages are here.
    pub(crate) fn recount(&mut self) {
        const COUNT: &str = "messages_of:";
        for (name, record) in &mut self.records {
            if name == "cnc_run_result" && record.keys().any(|key| key.starts_with(COUNT)) {
                record.retain(|key, _| !key.starts_with(COUNT));
                for (index, topic) in self.topics.iter().enumerate() {
                    let count = self.messages.iter().filter(|it| it.topic == index).count();
                    if count > 0 {
                        record.insert(format!("{COUNT}{}", topic.name), count.to_string());
                    }
                }
            }
        }
    }

    /// Leaves out a type with its topic.
    pub(crate) fn forget<M: Message>(&mut self) {
        let topic = self.topic::<M>();
        self.messages.retain(|message| message.topic != topic);
        self.topics.remove(topic);
        self.messages.iter_mut().filter(|it| it.topic > topic).for_each(|it| it.topic -= 1);
        self.recount();
    }

    /// Changes every message of a type; those that are not kept are left out.
    pub(crate) fn change<M: Message>(&mut self, mut change: impl FnMut(&mut M) -> bool) {
        let topic = self.topic::<M>();
        self.messages.retain_mut(|recorded| {
            if recorded.topic != topic {
                return true;
            }
            let mut message: M = cdr::decode(&recorded.data).expect("a message of ours");
            let is_kept = change(&mut message);
            recorded.data = cdr::encapsulated(&message);
            is_kept
        });
        self.recount();
    }

    /// Changes the bytes of every message of a type.
    pub(crate) fn change_bytes<M: Message>(&mut self, change: impl Fn(&mut Vec<u8>)) {
        let topic = self.topic::<M>();
        let of_type = self.messages.iter_mut().filter(|message| message.topic == topic);
        of_type.for_each(|message| change(&mut message.data));
    }

    /// All messages of a type.
    pub(crate) fn all<M: Message>(&self) -> Vec<M> {
        let topic = self.topic::<M>();
        let of_type = self.messages.iter().filter(|message| message.topic == topic);
        of_type.map(|it| cdr::decode(&it.data).expect("a message of ours")).collect()
    }

    /// Writes it as a folder.
    pub(crate) fn write(&self, folder: &Path, form: Form) {
        std::fs::create_dir_all(folder).expect("a folder for the bag");
        let per_file = self.messages.len().div_ceil(form.files).max(1);
        let mut names = Vec::new();
        for (index, messages) in self.messages.chunks(per_file).enumerate() {
            let mut name = format!("foreign_{index}.mcap");
            let mut bytes = self.file(messages, form);
            if form.is_zstd_file {
                bytes = zstd::encode_all(&bytes[..], 0).expect("bytes can be compressed");
                name += ".zstd";
            }
            std::fs::write(folder.join(&name), bytes).expect("a file of the bag");
            names.push(name);
        }
        let (version, compression) = match (form.qos, form.is_zstd_file) {
            (Qos::Humble, _) => (5, ""),
            (Qos::Jazzy, false) => (9, ""),
            (Qos::Jazzy, true) => (9, "zstd"),
        };
        let mode = if form.is_zstd_file { "FILE" } else { "" };
        let text = format!(
            "rosbag2_bagfile_information:\n  version: {version}\n  storage_identifier: mcap\n  \
             compression_format: \"{compression}\"\n  compression_mode: \"{mode}\"\n  \
             relative_file_paths:\n{}",
            names.iter().map(|name| format!("    - {name}\n")).collect::<String>()
        );
        std::fs::write(folder.join("metadata.yaml"), text).expect("metadata.yaml");
    }

    /// One file, in the order of rosbag2.
    fn file(&self, messages: &[Recorded], form: Form) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        let library = if form.is_ours { "run_recorder 0.1.0" } else { "libmcap 1.3.0" };
        let mut writer = WriteOptions::new()
            .profile("ros2")
            .library(library)
            .compression(form.compression)
            .chunk_size(Some(768 * 1024))
            .calculate_chunk_crcs(form.is_ours)
            .calculate_data_section_crc(false)
            .create(&mut bytes)
            .expect("a bag can be begun");
        let rosbag2 = || {
            // Others write it at the beginning too, when nothing is counted.
            let count = if form.is_ours { messages.len() } else { 0 };
            let text = format!("version: 9\nmessage_count: {count}\n");
            Metadata {
                name: "rosbag2".into(),
                metadata: BTreeMap::from([("serialized_metadata".to_owned(), text)]),
            }
        };
        writer.write_metadata(&rosbag2()).expect("a record");
        if form.is_ours {
            for (name, metadata) in &self.records {
                let record = Metadata { name: name.clone(), metadata: metadata.clone() };
                writer.write_metadata(&record).expect("a record");
            }
        }
        let mut channels: BTreeMap<usize, u16> = BTreeMap::new();
        let mut channel_of = |writer: &mut mcap::Writer<_>, place: usize| {
            *channels.entry(place).or_insert_with(|| {
                let topic = &self.topics[place];
                // Some writers have no definition for what they record.
                let schema = match topic.type_name.as_str() {
                    "" => Ok(0),
                    name => writer.add_schema(name, &topic.encoding, &topic.schema),
                };
                let schema = schema.expect("a definition");
                writer.add_channel(schema, &topic.name, "cdr", &metadata(topic, form)).expect("one")
            })
        };
        if form.is_ours {
            // run_recorder announces all topics at once, rosbag2 each with its first message.
            for place in 0..self.topics.len() {
                channel_of(&mut writer, place);
            }
        }
        for message in messages {
            let header = MessageHeader {
                channel_id: channel_of(&mut writer, message.topic),
                sequence: 0,
                log_time: message.log_time,
                publish_time: message.publish_time,
            };
            writer.write_to_known_channel(&header, &message.data).expect("a message");
        }
        writer.write_metadata(&rosbag2()).expect("a record");
        writer.finish().expect("a bag can be closed");
        drop(writer);
        let mut bytes = bytes.into_inner();
        let silent = (0..self.topics.len()).filter(|place| !channels.contains_key(place));
        for (index, place) in silent.enumerate() {
            let id = u16::try_from(900 + index).expect("few topics");
            add_silent_channel(&mut bytes, id, &self.topics[place]);
        }
        bytes
    }
}

/// What rosbag2 says of a channel.
fn metadata(topic: &Topic, form: Form) -> BTreeMap<String, String> {
    let mut metadata = topic.metadata.clone();
    if form.qos == Qos::Humble {
        metadata.remove("topic_type_hash");
        let time = "{sec: 9223372036, nsec: 854775807}";
        let text = format!(
            "- {{history: 3, depth: 0, reliability: 1, durability: 2, deadline: {time}, lifespan: \
             {time}, liveliness: 1, liveliness_lease_duration: {time}, \
             avoid_ros_namespace_conventions: false}}"
        );
        metadata.insert("offered_qos_profiles".to_owned(), text);
    }
    metadata
}

/// Puts a topic into the summary that is nowhere else, as rosbag2 does with silent ones.
fn add_silent_channel(bytes: &mut Vec<u8>, id: u16, topic: &Topic) {
    let mut at = mcap::MAGIC.len();
    while bytes[at] != op::DATA_END {
        let length: [u8; 8] = bytes[at + 1..at + 9].try_into().expect("eight bytes");
        at += 9 + usize::try_from(u64::from_le_bytes(length)).expect("a length");
    }
    at += 9 + 4;
    let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
    let record = |opcode: u8, body: Vec<u8>| {
        [&[opcode][..], &(body.len() as u64).to_le_bytes(), &body].concat()
    };
    let schema = [
        &id.to_le_bytes()[..],
        &text(&topic.type_name),
        &text(&topic.encoding),
        &(topic.schema.len() as u32).to_le_bytes(),
        &topic.schema,
    ];
    let channel = [
        &id.to_le_bytes()[..],
        &id.to_le_bytes(),
        &text(&topic.name),
        &text("cdr"),
        &0_u32.to_le_bytes(),
    ];
    let records = [record(op::SCHEMA, schema.concat()), record(op::CHANNEL, channel.concat())];
    let records = records.concat();
    let grown = records.len() as u64;
    bytes.splice(at..at, records);
    // The records after it have moved, and the checksum is different.
    let word = |bytes: &[u8], at: usize| {
        u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight bytes"))
    };
    let summary = at;
    while bytes[at] != op::FOOTER {
        if bytes[at] == op::SUMMARY_OFFSET {
            let start = word(bytes, at + 10);
            if start >= summary as u64 {
                bytes[at + 10..at + 18].copy_from_slice(&(start + grown).to_le_bytes());
            }
        }
        at += 9 + usize::try_from(word(bytes, at + 1)).expect("a length");
    }
    let offsets = word(bytes, at + 17) + grown;
    bytes[at + 17..at + 25].copy_from_slice(&offsets.to_le_bytes());
    let checksum = cnc_msgs::chunk::crc32(&bytes[summary..at + 25]);
    bytes[at + 25..at + 29].copy_from_slice(&checksum.to_le_bytes());
}

/// The definition of a type of ours as it is in bags.
pub(crate) fn definition<M: Message>() -> &'static str {
    TypeInfo::of::<M>().schema_text
}
