//! A recorder that is killed leaves everything that is older than a second.
#![cfg(feature = "std-fs")]

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use run_recorder::bag_reader::BagMessage;
use run_recorder::bag_writer::{ChannelIndex, ChannelSpec};
use run_recorder::files::{open_bag, recover_bag};
use run_recorder::run_bag::{RunBag, RunBagOptions};

const DIRECTORY: &str = "KERF_TEST_KILLED_BAG";
const FLUSHED: u64 = 1000;
const LONG: Duration = Duration::from_secs(60);

/// Runs this binary a second time as the recorder of one test, and kills it some time after
/// the file `ready` is there. Returns when that was.
fn kill_recorder(test: &str, directory: &Path, after: Duration) -> Duration {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", test])
        .env(DIRECTORY, directory)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let begin = Instant::now();
    while !directory.join("ready").exists() && begin.elapsed() < LONG {
        sleep(Duration::from_millis(10));
    }
    assert!(directory.join("ready").exists());
    sleep(after);
    let killed = since_epoch();
    child.kill().unwrap();
    child.wait().unwrap();
    killed
}

fn since_epoch() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap()
}

/// The readable part of the bag, which is what recovery keeps.
fn left_in(directory: &Path) -> Vec<BagMessage> {
    let path = directory.join("run");
    let mut bag = open_bag(&path).unwrap();
    assert!(!bag.is_complete());
    let messages: Vec<_> = bag.messages().map(|message| message.unwrap()).collect();
    let recovered = recover_bag(&path, &directory.join("saved")).unwrap();
    assert_eq!(recovered.summary.message_count, messages.len() as u64);
    messages
}

#[test]
fn a_killed_recorder_leaves_what_was_flushed() {
    if let Some(directory) = std::env::var_os(DIRECTORY) {
        record_and_wait_for_a_flush(directory.into());
    }
    let directory = tempfile::tempdir().unwrap();
    // Into the writing of later messages.
    let after = Duration::from_millis(50);
    kill_recorder("a_killed_recorder_leaves_what_was_flushed", directory.path(), after);
    let messages = left_in(directory.path());
    assert!(messages.len() as u64 >= FLUSHED, "{}", messages.len());
    for (i, message) in messages.iter().enumerate() {
        assert_eq!((message.sequence, message.log_time_ns), (i as u32, i as u64));
    }
}

#[test]
fn a_killed_recorder_leaves_all_that_is_older_than_a_second() {
    if let Some(directory) = std::env::var_os(DIRECTORY) {
        record_by_the_clock(directory.into());
    }
    let test = "a_killed_recorder_leaves_all_that_is_older_than_a_second";
    // At three places between one flush and the next.
    for after in [1800, 2150, 2330] {
        let directory = tempfile::tempdir().unwrap();
        let killed = kill_recorder(test, directory.path(), Duration::from_millis(after));
        let messages = left_in(directory.path());
        for (i, message) in messages.iter().enumerate() {
            assert_eq!(message.sequence, i as u32);
        }
        // Each message has the time at which it was written, so the last one that is left
        // gives the age of the first lost one.
        let last = Duration::from_nanos(messages.last().expect("messages").log_time_ns);
        let stall = longest_stall(directory.path(), killed);
        let lost = killed.saturating_sub(last);
        assert!(
            lost <= Duration::from_secs(1) + stall,
            "{lost:?} are lost; the host itself stood still for {stall:?}"
        );
    }
}

/// How long the host delayed a thread that writes to the same disk, from the notes of
/// [`watch_the_host`]. The test allows the recorder the same delay.
fn longest_stall(directory: &Path, killed: Duration) -> Duration {
    let text = fs::read_to_string(directory.join("stalls")).unwrap();
    let numbers = text.lines().filter_map(|line| line.split_once(' '));
    let numbers: Vec<(u64, u64)> =
        numbers.filter_map(|(at, stall)| Some((at.parse().ok()?, stall.parse().ok()?))).collect();
    let longest = numbers.iter().map(|(_, stall)| *stall).max().expect("a witness");
    let last = numbers.iter().map(|(at, _)| *at).max().expect("a witness");
    // The delay that was not over.
    let open = killed.saturating_sub(Duration::from_millis(last + TURN_MS));
    open.max(Duration::from_millis(longest))
}

const TURN_MS: u64 = 50;

/// Notes in each turn the extra time that a sleep and a synced write took.
fn watch_the_host(directory: &Path) {
    let mut file = File::create(directory.join("stalls")).unwrap();
    let mut stall_ms = 0;
    loop {
        let begin = Instant::now();
        writeln!(file, "{} {stall_ms}", since_epoch().as_millis()).unwrap();
        file.sync_data().unwrap();
        sleep(Duration::from_millis(TURN_MS));
        stall_ms = (begin.elapsed().as_millis() as u64).saturating_sub(TURN_MS);
    }
}

fn begin(options: RunBagOptions) -> (RunBag, ChannelIndex) {
    let bag = RunBag::create(options).unwrap();
    let spec = ChannelSpec {
        topic: "/a".into(),
        type_name: "a_msgs/msg/A".into(),
        schema_text: "uint64 a\n".into(),
        type_hash: String::new(),
        qos: Vec::new(),
    };
    let channel = bag.add_channel(&spec).unwrap();
    (bag, channel)
}

fn message(number: u64) -> Vec<u8> {
    let mut data = vec![0, 1, 0, 0];
    data.extend(number.to_le_bytes());
    data
}

fn record_by_the_clock(directory: PathBuf) -> ! {
    let (bag, channel) = begin(RunBagOptions::new(&directory, "run"));
    let for_witness = directory.clone();
    std::thread::spawn(move || watch_the_host(&for_witness));
    for number in 0.. {
        let now = since_epoch().as_nanos() as u64;
        assert!(bag.write(channel, now, now, message(number)));
        if number == 0 {
            fs::write(directory.join("ready"), "").unwrap();
        }
        sleep(Duration::from_millis(1));
    }
    std::process::exit(1)
}

fn record_and_wait_for_a_flush(directory: PathBuf) -> ! {
    let mut options = RunBagOptions::new(&directory, "run");
    options.flush_interval = Duration::from_millis(20);
    let (bag, channel) = begin(options);
    for i in 0_u64.. {
        if i == FLUSHED {
            // At first the file is not there yet, or empty.
            let readable = || open_bag(bag.path()).map_or(0, |bag| bag.summary().message_count);
            while readable() < FLUSHED {
                sleep(Duration::from_millis(5));
            }
            fs::write(directory.join("ready"), "").unwrap();
        }
        if i > FLUSHED {
            sleep(Duration::from_micros(100));
        }
        bag.write(channel, i, i, message(i));
    }
    std::process::exit(1)
}
