//! Whether a run of many messages is recorded without loss, in how much memory, and how
//! long a call of `write` takes.
//!
//! ```text
//! cargo bench -p run_recorder --bench recording                    ten minutes
//! cargo bench -p run_recorder --bench recording -- --seconds 60 --rate 20000 --split_mb 500
//! ```
//!
//! A real `RunBag` with its defaults on a real disk (below the target folder): zstd, a flush
//! each half second and each through to the disk. One thread feeds it at the rate, a
//! hundredth of a second's messages at a time. After each call of `write` the same thread sends
//! a number through a channel of the standard library, and the receiver drops it. This shows
//! how long the host delays any thread that passes something to another.

#![allow(clippy::print_stdout)]

mod load;

use load::{Load, TOPICS, argument, channels, is_test, memory_mb, print_memory};
use run_recorder::files::open_bag;
use run_recorder::run_bag::{RunBag, RunBagOptions};
use std::time::{Duration, Instant};

const SECONDS: u64 = 600;
const RATE: u64 = 10_000;
const TURNS_PER_SECOND: u64 = 100;
const BYTES_PER_MB: f64 = 1e6;

/// The longest times of one kind.
#[derive(Default)]
struct Longest {
    most: Duration,
    /// Counts above 0.1 ms and above 1 ms.
    above: [u64; 2],
}

impl Longest {
    fn take(&mut self, time: Duration) {
        self.most = self.most.max(time);
        self.above[0] += u64::from(time > Duration::from_micros(100));
        self.above[1] += u64::from(time > Duration::from_millis(1));
    }

    fn print(&self, name: &str) {
        let Self { most, above: [tenth, one] } = self;
        let most = most.as_secs_f64() * 1e3;
        println!("{name:<24} longest {most:.3} ms; above 0.1 ms: {tenth}, above 1 ms: {one}");
    }
}

fn main() {
    let seconds = if is_test() { 1 } else { argument("--seconds").unwrap_or(SECONDS) };
    let rate = argument("--rate").unwrap_or(RATE);
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder on the disk");
    let mut options = RunBagOptions::new(folder.path(), "run");
    options.split.size = argument("--split_mb").unwrap_or(0) * 1_000_000;
    let bag = RunBag::create(options).expect("a bag");
    let channels: Vec<_> =
        channels().iter().map(|spec| bag.add_channel(spec).expect("a topic")).collect();
    let mut load = Load::new();
    let (sender, receiver) = std::sync::mpsc::channel::<u64>();
    let taker = std::thread::spawn(move || receiver.into_iter().count());
    let (mut writes, mut sends) = (Longest::default(), Longest::default());
    let mut counts = [0_u64; TOPICS.len()];
    let (mut bytes, mut most_waiting) = (0, 0);
    let mut memory = vec![memory_mb(std::process::id())];
    let begin = Instant::now();
    for turn in 0..seconds * TURNS_PER_SECOND {
        let due = begin + Duration::from_secs(turn) / TURNS_PER_SECOND as u32;
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        for _ in 0..rate / TURNS_PER_SECOND {
            let (topic, data) = load.message();
            counts[topic] += 1;
            bytes += data.len();
            let time = 1_700_000_000_000_000_000 + begin.elapsed().as_nanos() as u64;
            let before = Instant::now();
            bag.write(channels[topic], time, time, data);
            let between = Instant::now();
            sender.send(time).expect("it is taken");
            sends.take(between.elapsed());
            writes.take(between - before);
        }
        if turn % TURNS_PER_SECOND == 0 {
            most_waiting = most_waiting.max(bag.status().bytes_waiting);
            memory.push(memory_mb(std::process::id()));
        }
    }
    let took = begin.elapsed().as_secs_f64();
    drop(sender);
    assert_eq!(taker.join().expect("it only counts") as u64, counts.iter().sum::<u64>());
    let path = bag.path().to_owned();
    let status = bag.finish(Duration::from_secs(600));
    let fed: u64 = counts.iter().sum();
    println!(
        "fed                      {fed} messages in {took:.1} s, {:.0} a second",
        fed as f64 / took
    );
    println!("                         {:.1} MB/s", bytes as f64 / BYTES_PER_MB / took);
    println!("lost                     {}", status.messages_lost);
    println!("complete                 {}", status.complete);
    println!("on the disk              {:.0} MB", status.bytes_written as f64 / BYTES_PER_MB);
    println!("waited for the disk      at most {:.1} MB", most_waiting as f64 / BYTES_PER_MB);
    print_memory("memory", &memory);
    writes.print("a call of write");
    sends.print("a channel, for comparison");
    check(&path, &counts);
}

/// Reads all of it: every message of each topic, in its order.
fn check(path: &std::path::Path, counts: &[u64]) {
    let begin = Instant::now();
    let mut bag = open_bag(path).expect("a bag");
    assert!(bag.is_complete(), "{:?}", bag.problems());
    let mut next = vec![0_u32; counts.len()];
    for message in bag.messages() {
        let message = message.expect("a message");
        let next = &mut next[message.channel_index];
        assert_eq!(message.sequence, *next, "of {}", message.channel.topic);
        *next += 1;
    }
    assert!(next.iter().map(|count| u64::from(*count)).eq(counts.iter().copied()));
    assert!(bag.is_complete(), "{:?}", bag.problems());
    println!("read back                all of it, in {:.1} s", begin.elapsed().as_secs_f64());
}
