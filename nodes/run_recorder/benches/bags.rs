//! Compares writing, opening and seeking in large bags with crate `mcap`.
//!
//! ```text
//! cargo bench -p run_recorder --bench bags                  a bag of 1 GiB
//! cargo bench -p run_recorder --bench bags -- --mb 100      a smaller one
//! ```
//!
//! All write the same messages with the same options in turn, to files below the target
//! folder. Each is compared with the writer of `mcap` that leaves its file to the cache of the
//! host, and with one that promises what `RunBag` does: its chunk is closed and synced to the
//! disk each half second, and its file is synced at the end. Opening and seeking is in that
//! cache, the middle of some runs. The other way of opening and seeking is `mcap`'s own:
//! `SummaryReader` and `IndexedReader`.

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
/// The default of [`RunBagOptions`], for the writer of `mcap` too.
const FLUSH_INTERVAL: Duration = Duration::from_millis(500);
/// The unit of processor time in /proc.
const TICKS_PER_S: f64 = 100.0;

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
    let ways: [(&str, WriteBag); 5] = [
        ("crate mcap, no sync", |folder, messages| by_mcap(folder, messages, None)),
        ("crate mcap, synced", |folder, messages| by_mcap(folder, messages, Some(FLUSH_INTERVAL))),
        ("BagWriter, no sync", by_bag_writer),
        ("RunBag, synced at the end", |folder, messages| by_run_bag(folder, messages, false)),
        ("RunBag, synced", |folder, messages| by_run_bag(folder, messages, true)),
    ];
    let mut best = [Duration::MAX; 5];
    let mut cpu_s = [f64::MAX; 5];
    for round in 0..if is_test() { 1 } else { ROUNDS } {
        for (way, (_, write)) in ways.iter().enumerate() {
            let place = folder.join(format!("written_{round}_{way}"));
            std::fs::create_dir(&place).expect("a folder");
            let (begin, cpu_before) = (Instant::now(), processor_s());
            write(&place, &messages);
            best[way] = best[way].min(begin.elapsed());
            cpu_s[way] = cpu_s[way].min(processor_s() - cpu_before);
            std::fs::remove_dir_all(place).expect("our folder");
        }
    }
    println!(
        "{:<28} {:>6} {:>11} {:>8} {:>8} {:>12}",
        "written", "MB/s", "messages/s", "of mcap", "synced", "processor, s"
    );
    for (way, (name, _)) in ways.iter().enumerate() {
        let seconds = best[way].as_secs_f64();
        println!(
            "{name:<28} {:>6.0} {:>11.0} {:>7.0}% {:>7.0}% {:>12.2}",
            bytes as f64 / BYTES_PER_MB / seconds,
            count as f64 / seconds,
            100.0 * best[0].as_secs_f64() / seconds,
            100.0 * best[1].as_secs_f64() / seconds,
            cpu_s[way]
        );
    }
}

/// Processor time of this process so far, threads that ended included.
fn processor_s() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").expect("Linux");
    // The second field is a name in brackets; user and system time are fields 14 and 15.
    let (_, rest) = text.rsplit_once(')').expect("a name");
    let ticks = rest.split_whitespace().skip(11).take(2);
    ticks.map(|ticks| ticks.parse::<f64>().expect("ticks")).sum::<f64>() / TICKS_PER_S
}

fn by_mcap(folder: &Path, messages: &Messages, sync_each: Option<Duration>) {
    let file = File::create(folder.join("plain.mcap")).expect("a file");
    let for_sync = file.try_clone().expect("a file");
    let mut writer = WriteOptions::new()
        .profile("ros2")
        .compression(Some(Compression::Zstd))
        .compression_threads(0)
        .chunk_size(Some(CHUNK_SIZE))
        .disable_seeking(true)
        .create(NoSeek::new(BufWriter::new(file)))
        .expect("a writer");
    let ids: Vec<u16> = channels()
        .iter()
        .map(|spec| {
            let text = spec.schema_text.as_bytes();
            let schema = writer.add_schema(&spec.type_name, "ros2msg", text).expect("a schema");
            writer.add_channel(schema, &spec.topic, "cdr", &BTreeMap::new()).expect("a channel")
        })
        .collect();
    let mut synced = Instant::now();
    for (time, topic, data) in messages {
        let header = mcap::records::MessageHeader {
            channel_id: ids[*topic],
            sequence: 0,
            log_time: *time,
            publish_time: *time,
        };
        writer.write_to_known_channel(&header, data).expect("a message");
        if sync_each.is_some_and(|interval| synced.elapsed() >= interval) {
            writer.flush().expect("a chunk");
            for_sync.sync_data().expect("a disk");
            synced = Instant::now();
        }
    }
    writer.finish().expect("an end");
    writer.into_inner().into_inner().flush().expect("an end");
    if sync_each.is_some() {
        for_sync.sync_all().expect("a disk");
        File::open(folder).and_then(|folder| folder.sync_all()).expect("a disk");
    }
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

fn by_run_bag(folder: &Path, messages: &Messages, syncs_each_flush: bool) {
    let options = RunBagOptions {
        syncs_each_flush,
        flush_interval: FLUSH_INTERVAL,
        ..RunBagOptions::new(folder, "run")
    };
    let bag = RunBag::create(options).expect("a bag");
    let indices: Vec<_> =
        channels().iter().map(|spec| bag.add_channel(spec).expect("a topic")).collect();
    for (time, topic, data) in messages {
        // A recorder does not wait; this bench does, to measure the disk.
        wait_for_room(&bag);
        assert!(bag.write(indices[*topic], *time, *time, data.clone()));
    }
    assert!(bag.finish(Duration::from_secs(600)).complete);
}

/// Asks seldom: each time it takes the processor from the write thread. Half of the queue lasts
/// for hundreds of milliseconds.
fn wait_for_room(bag: &RunBag) {
    while !bag.has_room() {
        std::thread::sleep(Duration::from_millis(5));
    }
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
        wait_for_room(&bag);
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
