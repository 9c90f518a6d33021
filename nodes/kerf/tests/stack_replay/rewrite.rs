//! A bag whose messages a test has changed.

use cnc_msgs::cdr;
use cnc_msgs::interface::Message;
use cnc_msgs::wire::cnc_msgs::msg::ProgramChunk;
use run_recorder::bag_reader::{BagMessage, RESULT_RECORD, RUN_RECORD};
use run_recorder::bag_writer::{BagWriter, ChannelSpec};
use run_recorder::files::open_bag;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A bag of the repository.
pub(crate) fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags").join(name)
}

/// Messages in order, and what the bag says of its run.
#[derive(Clone)]
pub(crate) struct Bag {
    messages: Vec<BagMessage>,
    records: Vec<(&'static str, BTreeMap<String, String>)>,
}

impl Bag {
    pub(crate) fn read(path: &Path) -> Self {
        let mut bag = open_bag(path).expect("a bag");
        let records = [RUN_RECORD, RESULT_RECORD]
            .into_iter()
            .filter_map(|name| Some((name, bag.metadata_named(name)?.clone())))
            .collect();
        let messages = bag.messages().map(|message| message.expect("a message")).collect();
        Self { messages, records }
    }

    /// The same with each message of a type changed.
    pub(crate) fn with<M: Message>(&self, mut change: impl FnMut(&mut M)) -> Self {
        let mut changed = self.clone();
        let mut count = 0;
        for message in &mut changed.messages {
            if message.channel.type_name() == M::TYPE_NAME {
                let mut decoded: M = cdr::decode(&message.data).expect("a message of ours");
                change(&mut decoded);
                message.data = cdr::encapsulated(&decoded);
                count += 1;
            }
        }
        assert!(count > 0, "there is no {} in the bag", M::TYPE_NAME);
        changed
    }

    /// The same without these topics.
    pub(crate) fn without(&self, topics: &[&str]) -> Self {
        let mut changed = self.clone();
        changed.messages.retain(|it| !topics.contains(&it.channel.topic.as_str()));
        assert!(changed.messages.len() < self.messages.len(), "there is none of {topics:?}");
        changed
    }

    pub(crate) fn program_text(&self) -> String {
        let mut chunks: Vec<ProgramChunk> = self
            .messages
            .iter()
            .filter(|it| it.channel.type_name() == ProgramChunk::TYPE_NAME)
            .map(|it| cdr::decode(&it.data).expect("a chunk"))
            .collect();
        chunks.sort_by_key(|chunk| chunk.index);
        chunks.dedup_by_key(|chunk| chunk.index);
        let bytes: Vec<u8> = chunks.into_iter().flat_map(|chunk| chunk.data).collect();
        String::from_utf8(bytes).expect("a text")
    }

    /// Writes it as one file, and returns its name.
    pub(crate) fn write(&self, path: &Path) -> String {
        let file = std::fs::File::create(path).expect("a file");
        let mut writer = BagWriter::new(std::io::BufWriter::new(file)).expect("a writer");
        let mut channels = BTreeMap::new();
        for message in &self.messages {
            let channel = &message.channel;
            let index = *channels.entry(channel.topic.clone()).or_insert_with(|| {
                let schema = channel.schema.as_ref().expect("bags of ours have their schemas");
                let spec = ChannelSpec {
                    topic: channel.topic.clone(),
                    type_name: schema.name.clone(),
                    schema_text: String::from_utf8_lossy(&schema.text).into_owned(),
                    type_hash: channel.type_hash.clone(),
                    qos: channel.qos.clone(),
                };
                writer.add_channel(&spec).expect("a channel")
            });
            writer
                .write(index, message.log_time_ns, message.publish_time_ns, &message.data)
                .expect("room on the disk");
        }
        for (name, values) in &self.records {
            writer.write_metadata(name, values).expect("room on the disk");
        }
        writer.finish("altered.mcap", &BTreeMap::new()).expect("room on the disk");
        path.display().to_string()
    }
}
