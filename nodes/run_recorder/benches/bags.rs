//! Compares writing, opening and seeking in large bags with crate `mcap`.
//!
//! ```text
//! cargo bench -p run_recorder --bench bags                  a bag of 1 GiB
//! cargo bench -p run_recorder --bench bags -- --mb 100      a smaller one
//! ```
//!
//! Both write the same messages with the same options in turn, to files below the target
//! folder. Opening and seeking is in the cache of the host, the middle of some runs. The
//! other way of opening and seeking is `mcap`'s own: `SummaryReader` and `IndexedReader`.

#![allow(clippy::print_stdout)]

mod load;

use load::{Load, argument, channels, is_test};
use mcap::sans_io::indexed_reader::{IndexedReadEvent, IndexedReader, IndexedReaderOptions};
use mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader};
use mcap::write::NoSeek;
use mcap::{Compression, Summary, WriteOptions};
use run_recorder::bag_reader::MessageFilter;
use run_recorder::bag_writer::{BagWriter, CHUNK_SIZE};
use run_recorder::files::open_bag;
use run_recorder::run_bag::{RunBag, RunBagOptions};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const ROUNDS: usize = 5;
const BYTES_PER_MB: f64 = 1e6;
const MIB: u64 = 1 << 20;

fn main() {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder on the disk");
    write(folder.path());
    let size = argument("--mb").unwrap_or(if is_test() { 2 } else { 1024 }) * MIB;
    read(&large_bag(folder.path(), size));
}

/// A way to write them to a folder.
type WriteBag = fn(&Path, &Messages);
/// Time, place of the topic, content.
type Messages = Vec<(u64, usize, Vec<u8>)>;

fn write(folder: &Path) {
    let mut load = Load::new();
    let count = if is_test() { 1000 } else { 200_000 };
    let messages: Messages = (0..count)
        .map(|time| {
            let (topic, data) = load.message();
            (time, topic, data)
        })
        .collect();
    let bytes: usize = messages.iter().map(|(.., data)| data.len()).sum();
    println!("{:<28} {:>10} {:>14} {:>10}", "written", "MB/s", "messages/s", "of mcap");
    let ways: [(&str, WriteBag); 3] = [
        ("crate mcap", by_mcap),
        ("BagWriter", by_bag_writer),
        ("RunBag, through to the disk", by_run_bag),
    ];
    let mut best = [Duration::MAX; 3];
    for round in 0..if is_test() { 1 } else { ROUNDS } {
        for (way, (_, write)) in ways.iter().enumerate() {
            let place = folder.join(format!("written_{round}_{way}"));
            std::fs::create_dir(&place).expect("a folder");
            let begin = Instant::now();
            write(&place, &messages);
            best[way] = best[way].min(begin.elapsed());
            std::fs::remove_dir_all(place).expect("our folder");
        }
    }
    for (way, (name, _)) in ways.iter().enumerate() {
        let seconds = best[way].as_secs_f64();
        println!(
            "{name:<28} {:>10.0} {:>14.0} {:>9.0}%",
            bytes as f64 / BYTES_PER_MB / seconds,
            count as f64 / seconds,
            100.0 * best[0].as_secs_f64() / seconds
        );
    }
}

fn by_mcap(folder: &Path, messages: &Messages) {
    let file = BufWriter::new(File::create(folder.join("plain.mcap")).expect("a file"));
    let mut writer = WriteOptions::new()
        .profile("ros2")
        .compression(Some(Compression::Zstd))
        .compression_threads(0)
        .chunk_size(Some(CHUNK_SIZE))
        .disable_seeking(true)
        .create(NoSeek::new(file))
        .expect("a writer");
    let ids: Vec<u16> = channels()
        .iter()
        .map(|spec| {
            let text = spec.schema_text.as_bytes();
            let schema = writer.add_schema(&spec.type_name, "ros2msg", text).expect("a schema");
            writer.add_channel(schema, &spec.topic, "cdr", &BTreeMap::new()).expect("a channel")
        })
        .collect();
    for (time, topic, data) in messages {
        let header = mcap::records::MessageHeader {
            channel_id: ids[*topic],
            sequence: 0,
            log_time: *time,
            publish_time: *time,
        };
        writer.write_to_known_channel(&header, data).expect("a message");
    }
    writer.finish().expect("an end");
    writer.into_inner().into_inner().flush().expect("an end");
}

fn by_bag_writer(folder: &Path, messages: &Messages) {
    let file = BufWriter::new(File::create(folder.join("ours.mcap")).expect("a file"));
    let mut writer = BagWriter::new(file).expect("a writer");
    let indices: Vec<_> =
        channels().iter().map(|spec| writer.add_channel(spec).expect("a topic")).collect();
    for (time, topic, data) in messages {
        writer.write(indices[*topic], *time, *time, data).expect("a message");
    }
    let (mut file, _) = writer.finish("ours.mcap", &BTreeMap::new()).expect("an end");
    file.flush().expect("an end");
}

fn by_run_bag(folder: &Path, messages: &Messages) {
    let bag = RunBag::create(RunBagOptions::new(folder, "run")).expect("a bag");
    let indices: Vec<_> =
        channels().iter().map(|spec| bag.add_channel(spec).expect("a topic")).collect();
    for (time, topic, data) in messages {
        // A recorder does not wait; this bench does, to measure the disk.
        while !bag.has_room() {
            std::thread::sleep(Duration::from_micros(200));
        }
        assert!(bag.write(indices[*topic], *time, *time, data.clone()));
    }
    assert!(bag.finish(Duration::from_secs(600)).complete);
}

/// A bag of this size in one file, a thousand messages a second.
fn large_bag(folder: &Path, size: u64) -> PathBuf {
    let bag = RunBag::create(RunBagOptions::new(folder, "large")).expect("a bag");
    let indices: Vec<_> =
        channels().iter().map(|spec| bag.add_channel(spec).expect("a topic")).collect();
    let mut load = Load::new();
    for number in 0.. {
        if number % 1000 == 0 && bag.status().bytes_written >= size {
            break;
        }
        while !bag.has_room() {
            std::thread::sleep(Duration::from_micros(200));
        }
        let (topic, data) = load.message();
        assert!(bag.write(indices[topic], number * 1_000_000, number * 1_000_000, data));
    }
    let path = bag.path().to_owned();
    assert!(bag.finish(Duration::from_secs(600)).complete);
    path
}

fn read(bag: &Path) {
    let file = bag.join("large_0.mcap");
    let size = std::fs::metadata(&file).expect("a file").len();
    let summary = open_bag(bag).expect("a bag").summary();
    let (start, end) = summary.time_range_ns.expect("messages");
    let middle = start + (end - start) / 2;
    println!();
    println!(
        "{} MiB, {} messages: the middle of {ROUNDS} runs, ms",
        size / MIB,
        summary.message_count
    );
    println!("{:<28} {:>10} {:>10} {:>10}", "", "ours", "mcap", "ratio");
    let ours = |seek: bool| {
        let mut bag = open_bag(bag).expect("a bag");
        let filter = MessageFilter { from_ns: Some(middle), ..MessageFilter::default() };
        let first = seek.then(|| bag.messages_where(filter).next());
        first.map(|first| first.expect("a message").expect("a message").log_time_ns)
    };
    let theirs = |seek: bool| {
        let mut file = File::open(&file).expect("a file");
        let summary = summary_of(&mut file);
        seek.then(|| first_from(&mut file, &summary, middle))
    };
    assert_eq!(ours(true), theirs(true));
    for (name, seek) in [("open", false), ("open, and the first from the middle", true)] {
        let (mut of_ours, mut of_theirs) = (Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            of_ours.push(timed(|| ours(seek)));
            of_theirs.push(timed(|| theirs(seek)));
        }
        let (ours, theirs) = (median(of_ours), median(of_theirs));
        println!("{name:<36} {ours:>8.2} {theirs:>8.2} {:>8.2}", ours / theirs);
    }
}

fn timed<T>(work: impl FnOnce() -> T) -> f64 {
    let begin = Instant::now();
    work();
    begin.elapsed().as_secs_f64() * 1e3
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn summary_of(file: &mut File) -> Summary {
    let mut reader = SummaryReader::new();
    while let Some(event) = reader.next_event() {
        match event.expect("a summary") {
            SummaryReadEvent::ReadRequest(need) => {
                let read = file.read(reader.insert(need)).expect("a file");
                reader.notify_read(read);
            }
            SummaryReadEvent::SeekRequest(to) => {
                reader.notify_seeked(file.seek(to).expect("a file"));
            }
        }
    }
    reader.finish().expect("a summary")
}

fn first_from(file: &mut File, summary: &Summary, time_ns: u64) -> u64 {
    let options = IndexedReaderOptions::new().starting_at(time_ns);
    let mut reader = IndexedReader::new_with_options(summary, options).expect("an index");
    let mut buffer = Vec::new();
    while let Some(event) = reader.next_event() {
        match event.expect("a chunk") {
            IndexedReadEvent::ReadChunkRequest { offset, length } => {
                file.seek(SeekFrom::Start(offset)).expect("a file");
                buffer.resize(length, 0);
                file.read_exact(&mut buffer).expect("a file");
                reader.insert_chunk_record_data(offset, &buffer).expect("a chunk");
            }
            IndexedReadEvent::Message { header, .. } => return header.log_time,
        }
    }
    panic!("no message from {time_ns} ns on")
}
