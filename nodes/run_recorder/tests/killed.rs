//! A recorder that is killed leaves everything that is older than a flush.
#![cfg(feature = "std-fs")]

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use run_recorder::bag_writer::ChannelSpec;
use run_recorder::files::{open_bag, recover_bag};
use run_recorder::run_bag::{RunBag, RunBagOptions};

const DIRECTORY: &str = "KERF_TEST_KILLED_BAG";
const FLUSHED: u64 = 1000;

/// Runs itself a second time as the recorder, which is told so by an environment variable.
#[test]
fn a_killed_recorder_leaves_what_was_flushed() {
    if let Some(directory) = std::env::var_os(DIRECTORY) {
        record_for_ever(directory.into());
    }
    let directory = tempfile::tempdir().unwrap();
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "a_killed_recorder_leaves_what_was_flushed"])
        .env(DIRECTORY, directory.path())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let given_up = Instant::now() + Duration::from_secs(60);
    while !directory.path().join("flushed").exists() && Instant::now() < given_up {
        sleep(Duration::from_millis(10));
    }
    assert!(directory.path().join("flushed").exists());
    // Into the writing of later messages.
    sleep(Duration::from_millis(50));
    child.kill().unwrap();
    child.wait().unwrap();

    let bag_path = directory.path().join("run");
    let mut bag = open_bag(&bag_path).unwrap();
    assert!(!bag.is_complete());
    let messages: Vec<_> = bag.messages().map(|message| message.unwrap()).collect();
    assert!(messages.len() as u64 >= FLUSHED, "{}", messages.len());
    for (i, message) in messages.iter().enumerate() {
        assert_eq!((message.sequence, message.log_time_ns), (i as u32, i as u64));
    }
    let recovered = recover_bag(&bag_path, &directory.path().join("saved")).unwrap();
    assert_eq!(recovered.summary.message_count, messages.len() as u64);
}

fn record_for_ever(directory: PathBuf) -> ! {
    let mut options = RunBagOptions::new(&directory, "run");
    options.flush_interval = Duration::from_millis(20);
    let bag = RunBag::create(options).unwrap();
    let spec = ChannelSpec {
        topic: "/a".into(),
        type_name: "a_msgs/msg/A".into(),
        schema_text: "uint64 a\n".into(),
        type_hash: String::new(),
        qos: Vec::new(),
    };
    let channel = bag.add_channel(&spec).unwrap();
    for i in 0_u64.. {
        if i == FLUSHED {
            // At first the file is not there yet, or empty.
            let readable = || open_bag(bag.path()).map_or(0, |bag| bag.summary().message_count);
            while readable() < FLUSHED {
                sleep(Duration::from_millis(5));
            }
            std::fs::write(directory.join("flushed"), "").unwrap();
        }
        if i > FLUSHED {
            sleep(Duration::from_micros(100));
        }
        let mut data = vec![0, 1, 0, 0];
        data.extend(i.to_le_bytes());
        bag.write(channel, i, i, data);
    }
    std::process::exit(1)
}
