//! Bags as bytes: ours, in one file and in several, and as others write them.
//!
//! Whatever comes in: no panic, errors that name the file, problems of records that
//! name their place, every message that is given fits into the file it is from, and
//! what is recovered is a whole bag with the same messages. A bag of ours that was
//! damaged by accident and is reported as complete has all its messages.

use crate::bag_mutate::{has_chunks, mutate, mutate_definition};
use crate::mutate::Random;
use kerf_tests::root;
use mcap::{Compression, WriteOptions};
use rosidl::decode::decode;
use rosidl::schema::MessageSchema;
use run_recorder::bag_reader::{Bag, BagMessage, BagSource, Problem};
use run_recorder::bag_writer::BagAttachment;
use run_recorder::info::BagInfo;
use run_recorder::recover::{CopySelection, recover};
use run_recorder::run_bag::{RunBag, RunBagOptions};
use std::collections::BTreeMap;
use std::io::Cursor;
use std::time::Duration;

/// The most that may be in memory for the bag of one case, with all other tests of this
/// process as well, kB. A record or a chunk may take 256 MB, and a chunk is there twice
/// while it is decompressed.
const MEMORY_KB_MAX: u64 = 2_000_000;

/// Bags of real runs, the first of the corpus.
const GOLDEN: [&str; 2] = ["automation1_calls", "osp_lathe_shaft"];

/// A bag: its files, and whether checksums guard all of its messages.
pub(crate) struct Whole {
    files: Vec<Vec<u8>>,
    is_guarded: bool,
    messages: Vec<RecordedMessage>,
}

/// Topic, number, time, content.
type RecordedMessage = (String, u32, u64, Vec<u8>);

type Read = Bag<Cursor<Vec<u8>>>;

fn as_recorded(message: &BagMessage) -> RecordedMessage {
    let topic = message.channel.topic.clone();
    (topic, message.sequence, message.log_time_ns, message.data.clone())
}

fn open(files: &[Vec<u8>]) -> Result<Read, run_recorder::bag_reader::BagError> {
    let source = |(number, bytes): (usize, &Vec<u8>)| BagSource {
        name: format!("part_{number}.mcap"),
        reader: Cursor::new(bytes.clone()),
    };
    Bag::from_sources(files.iter().enumerate().map(source).collect())
}

impl Whole {
    fn new(files: Vec<Vec<u8>>, is_guarded: bool) -> Self {
        let mut bag = open(&files).expect("a whole bag");
        let messages =
            bag.messages().map(|message| as_recorded(&message.expect("a message"))).collect();
        Self { files, is_guarded, messages }
    }
}

/// Bags to begin with.
pub(crate) fn corpus() -> Vec<Whole> {
    let golden = root().join("bags");
    let mut corpus = Vec::new();
    for name in GOLDEN {
        let files = std::fs::read_dir(golden.join(name)).expect("a golden bag");
        let mut paths = files.map(|file| file.expect("a file").path());
        let path = paths.find(|path| path.extension().is_some_and(|ending| ending == "mcap"));
        let bytes = std::fs::read(path.expect("an .mcap file")).expect("a golden bag");
        corpus.push(Whole::new(vec![bytes], true));
    }
    // The same small run in many forms.
    for split in [0, 1500] {
        corpus.push(Whole::new(recorded(split), true));
    }
    let of_others = WriteOptions::new().profile("ros2").library("libmcap 1.3.0");
    for (options, is_guarded) in [
        (of_others.clone().compression(None).calculate_chunk_crcs(false), false),
        (of_others.clone().compression(Some(Compression::Zstd)).chunk_size(Some(600)), true),
        (of_others.clone().compression(Some(Compression::Lz4)).chunk_size(Some(900)), true),
        (of_others.clone().use_chunks(false), false),
        (of_others.use_chunks(false).emit_summary_records(false), false),
    ] {
        corpus.push(Whole::new(vec![written(options)], is_guarded));
    }
    corpus
}

fn text_message(number: u64) -> Vec<u8> {
    let text = format!("line {number} of the program");
    let mut data = vec![0, 1, 0, 0];
    data.extend((text.len() as u32 + 1).to_le_bytes());
    data.extend(text.bytes());
    data.push(0);
    data
}

/// As the recorder writes it, in one file or several.
fn recorded(split: u64) -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().expect("a folder");
    let mut options = RunBagOptions::new(folder.path(), "r");
    options.run.insert("run_id".into(), "r".into());
    options.split.size = split;
    options.flush_interval = Duration::from_secs(60);
    let bag = RunBag::create(options).expect("a bag");
    let spec = |topic: &str, qos| run_recorder::bag_writer::ChannelSpec {
        topic: topic.into(),
        type_name: "std_msgs/msg/String".into(),
        schema_text: "string data\n".into(),
        type_hash: String::new(),
        qos: vec![qos],
    };
    use run_recorder::qos::QosProfile;
    let latched = bag.add_channel(&spec("/state", QosProfile::latched(1))).expect("a topic");
    let plain = bag.add_channel(&spec("/log", QosProfile::reliable(10))).expect("a topic");
    let (name, media_type) = ("program.mpf".into(), "text/plain".into());
    let data = b"N10 G1 X5 F100\nM30\n".to_vec();
    bag.attach(BagAttachment { name, media_type, log_time_ns: 1, data }).expect("an attachment");
    for number in 0..60 {
        let channel = if number % 10 == 0 { latched } else { plain };
        assert!(bag.write(channel, number, number, text_message(number)));
    }
    assert!(bag.finish(Duration::from_secs(60)).complete);
    let file = |part| std::fs::read(folder.path().join(format!("r/r_{part}.mcap"))).ok();
    let files: Vec<_> = (0..).map_while(file).collect();
    assert_eq!(files.len() > 1, split > 0);
    files
}

/// As others write it.
fn written(options: WriteOptions) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = options.create(Cursor::new(&mut bytes)).expect("a writer");
    let schema = writer.add_schema("std_msgs/msg/String", "ros2msg", b"string data\n");
    let schema = schema.expect("a schema");
    for topic in ["/a", "/b"] {
        writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).expect("a channel");
    }
    for number in 0..60 {
        let header = mcap::records::MessageHeader {
            channel_id: 1 + (number % 2) as u16,
            sequence: 0,
            log_time: number ^ 3,
            publish_time: number,
        };
        writer.write_to_known_channel(&header, &text_message(number)).expect("a message");
    }
    writer.finish().expect("a bag");
    drop(writer);
    bytes
}

/// What came of one case.
#[derive(Default)]
pub(crate) struct CaseOutcome {
    pub(crate) is_open: bool,
    pub(crate) has_problem: bool,
    pub(crate) has_message: bool,
}

/// One bag that was hurt.
pub(crate) fn check(corpus: &[Whole], random: &mut Random) -> CaseOutcome {
    // Golden bags are real, but what can be wrong with a bag is in the small ones too.
    let (golden, small) = corpus.split_at(GOLDEN.len());
    let some = if random.once_in(12) { golden } else { small };
    let whole = random.of(some);
    let other = random.of(small).files[0].clone();
    let mut files = whole.files.clone();
    // Accidents alone: a flipped bit, a cut, blocks of nothing. No record lies.
    let is_accident = random.once_in(3);
    let hurt = random.below(files.len());
    if is_accident {
        accident(&mut files[hurt], random);
    } else {
        mutate(&mut files[hurt], &other, random);
        if random.once_in(10) {
            files.swap_remove(random.below(whole.files.len()));
        }
    }
    let outcome = survive(&files, |messages, is_complete| {
        if is_accident && whole.is_guarded && is_complete {
            assert!(messages == whole.messages, "complete, and with other messages");
        }
    });
    // With nothing of it hurt there would be nothing to see.
    debug_assert!(has_chunks(&corpus[0].files[0]));
    outcome
}

fn accident(bytes: &mut Vec<u8>, random: &mut Random) {
    match random.below(4) {
        0 => bytes.truncate(random.below(bytes.len())),
        1 => {
            let start = 512 * random.below(bytes.len().div_ceil(512));
            let end = bytes.len().min(start + 512 * (1 + random.below(8)));
            bytes[start..end].fill(0);
        }
        _ => {
            let at = random.below(bytes.len());
            bytes[at] ^= 1 << random.below(8);
        }
    }
}

/// Bytes that have no more of a bag than its beginning.
pub(crate) fn check_bytes(random: &mut Random) {
    let mut bytes = match random.below(3) {
        0 => Vec::new(),
        1 => mcap::MAGIC.to_vec(),
        _ => written(WriteOptions::new().profile("ros2").compression(None))[..48].to_vec(),
    };
    for _ in 0..random.below(20) {
        // Often a record by its kind and a length that may be right.
        let kind = random.below(18) as u8;
        let length = random.below(60) as u64;
        if random.once_in(3) {
            bytes.push(random.next() as u8);
        } else {
            bytes.push(kind);
            bytes.extend(length.to_le_bytes());
            bytes.extend((0..length).map(|_| random.next() as u8 & 0x1f));
        }
    }
    survive(&[bytes], |_, is_complete| assert!(!is_complete, "that is no bag"));
}

/// Reads a bag in all ways there are; `judge` gets its messages and whether it is complete.
fn survive(files: &[Vec<u8>], judge: impl FnOnce(Vec<RecordedMessage>, bool)) -> CaseOutcome {
    let mut outcome = CaseOutcome::default();
    let mut bag = match open(files) {
        Ok(bag) => bag,
        Err(error) => {
            let error = error.to_string();
            assert!(error.contains("part_") || files.is_empty(), "it names no file: {error}");
            return outcome;
        }
    };
    outcome.is_open = true;
    bag.verify().expect("memory does not fail");
    let size: usize = files.iter().map(Vec::len).sum();
    let mut schemas = BTreeMap::new();
    let mut messages = Vec::new();
    for message in bag.messages() {
        let message = message.expect("memory does not fail");
        let schema = schemas.entry(message.channel_index).or_insert_with(|| {
            message.channel.schema.as_ref().and_then(|schema| schema.parse().ok())
        });
        if let Some(schema) = schema {
            let _ = decode(schema, &message.data);
        }
        messages.push(as_recorded(&message));
    }
    outcome.has_message = !messages.is_empty();
    for info in bag.attachments().to_vec() {
        let data = bag.read_attachment(&info).expect("memory does not fail");
        assert!(data.len() <= size, "an attachment is larger than its bag");
    }
    outcome.has_problem = !bag.problems().is_empty();
    for problem in bag.problems() {
        let says = problem.to_string();
        let is_of_record = matches!(
            problem,
            Problem::Truncated { .. }
                | Problem::CutRecord { .. }
                | Problem::DamagedChunk { .. }
                | Problem::DamagedRecord { .. }
                | Problem::UnknownChannel { .. }
                | Problem::AfterFooter { .. }
        );
        let has_place = says.contains("part_") && says.contains("byte ");
        assert!(has_place || !is_of_record, "it names no place: {says}");
    }
    let text = BagInfo::new("hurt", &bag).to_string();
    assert!(text.contains("messages:"), "{text}");
    judge(messages.clone(), bag.is_complete());

    let (copy, recovered) =
        recover(&mut bag, Vec::new(), "copy_0.mcap", &BTreeMap::new(), CopySelection::ALL)
            .expect("what can be read can be copied");
    let mut whole = open(&[copy]).expect("a copy is a bag");
    whole.verify().expect("memory does not fail");
    let says_so = |problem: &Problem| matches!(problem, Problem::RecorderSays { .. });
    assert!(whole.problems().iter().all(says_so), "a copy with {:?}", whole.problems());
    assert_eq!(whole.summary().message_count, recovered.summary.message_count);
    assert!(recovered.summary.message_count <= messages.len() as u64);
    let left_out: Vec<_> = recovered.left_out.iter().map(|(topic, _)| topic.as_str()).collect();
    let kept = messages.iter().filter(|(topic, ..)| !left_out.contains(&topic.as_str()));
    assert!(kept.count() as u64 <= recovered.summary.message_count, "{left_out:?}");
    outcome
}

/// Definitions that do not match their messages; returns whether one was still a definition.
pub(crate) fn check_definition(corpus: &[Whole], random: &mut Random) -> bool {
    let whole = random.of(corpus);
    let mut bag = open(&whole.files).expect("a whole bag");
    let wanted = random.below(whole.messages.len());
    let message = bag.messages().nth(wanted).expect("it was counted").expect("a message");
    let schema = message.channel.schema.clone().expect("a definition");
    let text = String::from_utf8(schema.text.clone()).expect("text");
    let text = mutate_definition(&text, random);
    let mut data = message.data;
    if random.once_in(2) {
        accident(&mut data, random);
    }
    match MessageSchema::parse(&schema.name, &text) {
        Ok(schema) => {
            if let Err(error) = decode(&schema, &data) {
                assert!(!error.to_string().is_empty());
            }
            true
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            false
        }
    }
}

/// Fails if this process ever held more than it may.
pub(crate) fn check_memory() {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).expect("a peak");
    let kilobytes = line.trim().trim_end_matches(" kB").parse::<u64>().expect("a number");
    assert!(kilobytes < MEMORY_KB_MAX, "{kilobytes} kB were in memory");
}
