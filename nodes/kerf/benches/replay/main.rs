//! How fast `kerf replay` is as a process: messages a second and times real time.
//!
//! ```text
//! cargo bench -p kerf --bench replay                     the golden bags, and a long run
//! cargo bench -p kerf --bench replay -- --blocks 1000    a shorter one
//! cargo bench -p kerf --bench replay -- --keep FOLDER    and keep its bag, to profile with
//! cargo bench -p kerf --bench replay -- --test           each once, 200 blocks
//! ```
//!
//! Time is from the start of the process to its end, the best of some runs. For comparison, the
//! table has the time to read every message of the same bags without using them.

#![allow(clippy::print_stdout)]

mod long_run;

use run_recorder::files::open_bag;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// Segments of at least 0.1 mm: about two and a half hours of them.
const BLOCKS: u32 = 300_000;
const RUNS: usize = 5;

fn main() {
    let (mut blocks, mut runs, mut keep) = (BLOCKS, RUNS, None);
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--test" => (blocks, runs) = (200, 1),
            "--blocks" => {
                let number = words.next().and_then(|word| word.parse().ok());
                blocks = number.expect("--blocks takes a number");
            }
            "--keep" => keep = words.next().map(PathBuf::from),
            _ => {}
        }
    }
    let folder = tempfile::tempdir().expect("a folder for the bag");
    let folder = keep.as_deref().unwrap_or(folder.path());
    std::fs::create_dir_all(folder).expect("the folder of the bag");
    let long = folder.join("long.mcap");
    long_run::write(&long, blocks);

    println!(
        "{:<12} {:>9} {:>9} {:>9} {:>9} {:>12} {:>16} {:>14}",
        "bags",
        "messages",
        "run, s",
        "ms",
        "read, ms",
        "messages/s",
        "times real time",
        "least of one"
    );
    let golden = golden();
    measure("golden", &golden, runs);
    measure("long", &[long], runs);
}

/// The bags that the tests replay.
fn golden() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags");
    let entries = std::fs::read_dir(folder).expect("bags/ is there");
    let paths = entries.map(|entry| entry.expect("its entries can be read").path());
    let mut bags: Vec<PathBuf> = paths.filter(|path| path.is_dir()).collect();
    bags.sort();
    bags
}

fn measure(name: &str, bags: &[PathBuf], runs: usize) {
    let (mut messages, mut length_s) = (0, 0.0);
    let mut least = f64::INFINITY;
    let mut read = Duration::ZERO;
    for path in bags {
        let begin = Instant::now();
        let mut bag = open_bag(path).expect("a whole bag");
        let mut count = 0;
        // A bag begins with latched messages from long before the run.
        let mut run: Option<(u64, u64)> = None;
        for message in bag.messages().filter_map(Result::ok) {
            count += 1;
            if message.channel.topic.ends_with("/controller_traffic") {
                let at = message.log_time_ns;
                let (first, last) = run.unwrap_or((at, at));
                run = Some((first.min(at), last.max(at)));
            }
        }
        read += begin.elapsed();
        let summary = bag.summary();
        assert_eq!(summary.message_count, count as u64, "{}", path.display());
        let (first, last) = run.expect("the traffic of a run");
        let seconds = (last - first) as f64 / 1e9;
        (messages, length_s) = (messages + count, length_s + seconds);
        least = least.min(seconds / best(std::slice::from_ref(path), runs).as_secs_f64());
    }
    let took = best(bags, runs).as_secs_f64();
    println!(
        "{name:<12} {messages:>9} {length_s:>9.0} {:>9.1} {:>9.1} {:>12.0} {:>16.0} {least:>14.0}",
        took * 1e3,
        read.as_secs_f64() * 1e3,
        messages as f64 / took,
        length_s / took,
    );
}

/// The shortest time of one process for all bags.
fn best(bags: &[PathBuf], runs: usize) -> Duration {
    let once = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_kerf"));
        command.arg("replay").args(bags);
        let begin = Instant::now();
        let output = command.output().expect("kerf can be started");
        let took = begin.elapsed();
        let said = String::from_utf8_lossy(&output.stdout);
        // 1 means that a bag differs today; it takes as long.
        let is_answer = matches!(output.status.code(), Some(0 | 1));
        assert!(is_answer, "{said}{}", String::from_utf8_lossy(&output.stderr));
        took
    };
    (0..runs).map(|_| once()).min().expect("at least one run")
}
