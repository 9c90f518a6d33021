//! Whether a run of many messages from another process is recorded without loss.
//!
//! ```text
//! cargo bench -p run_recorder --bench through_dds                    ten minutes
//! cargo bench -p run_recorder --bench through_dds -- --seconds 60 --rate 20000
//! ```
//!
//! A recorder as a process, with its defaults, on a real disk (below the target folder). This
//! process is all the others: it begins a goal, publishes on six reliable topics at the rate,
//! a hundredth of a second's messages at a time, and ends the goal. There is no driver, so the
//! bag says that its traffic is missing; what was published has to be in it nevertheless.

#![allow(clippy::print_stdout)]

mod load;

use cnc_msgs::wire::action_msgs::msg::{GoalStatus, GoalStatusArray};
use cnc_msgs::wire::cnc_msgs::msg::Recording;
use load::{Load, TOPICS, TYPES, argument, is_test, memory_mb, print_memory};
use run_recorder::files::open_bag;
use runtime::{Qos, Subscription, client_session};
use std::path::Path;
use std::process::{Child, Command};
use std::time::{Duration, Instant};
use tokio::time::{sleep, timeout};

const SECONDS: u64 = 600;
const RATE: u64 = 10_000;
const TURNS_PER_SECOND: u64 = 100;
/// How long discovery may take.
const SETTLE: Duration = Duration::from_secs(3);
const PATIENCE: Duration = Duration::from_secs(120);

/// The recorder process, killed when this is dropped.
struct Recorder(Child);

impl Drop for Recorder {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[tokio::main]
async fn main() {
    let seconds = if is_test() { 1 } else { argument("--seconds").unwrap_or(SECONDS) };
    let rate = argument("--rate").unwrap_or(RATE);
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder on the disk");
    let namespace = format!("__ns:=/load_{}", std::process::id());
    let directory = format!("directory:={}", folder.path().display());
    let ros = ["--ros-args", "-r", &namespace, "-p", &directory].map(str::to_owned);
    let recorder = Command::new(env!("CARGO_BIN_EXE_run_recorder")).args(&ros).spawn();
    let recorder = Recorder(recorder.expect("the recorder starts"));

    let session = client_session("load", &ros[..3]).expect("a node");
    let node = session.handle();
    let mut recordings = node.subscription("recording", Qos::LATCHED).expect("a topic");
    let goals = node.publisher("run_program/_action/status", Qos::LATCHED).expect("a topic");
    let topics = TOPICS.iter().zip(TYPES).map(|((topic, ..), type_name)| {
        let name = topic.trim_start_matches('/');
        node.raw_publisher(name, type_name, Qos::EVENTS).expect("a topic")
    });
    let topics: Vec<_> = topics.collect();
    sleep(SETTLE).await;
    goals.publish(goal(GoalStatus::STATUS_EXECUTING));
    recording_is(&mut recordings, true).await;

    let mut load = Load::new();
    let mut counts = [0_u64; TOPICS.len()];
    let (mut refused, mut bytes) = (0_u64, 0);
    let mut memory = Vec::new();
    let begin = Instant::now();
    for turn in 0..seconds * TURNS_PER_SECOND {
        let due = begin + Duration::from_secs(turn) / TURNS_PER_SECOND as u32;
        sleep(due.saturating_duration_since(Instant::now())).await;
        for _ in 0..rate / TURNS_PER_SECOND {
            let (topic, data) = load.message();
            if topics[topic].publish(&data) {
                counts[topic] += 1;
                bytes += data.len();
            } else {
                refused += 1;
            }
        }
        if turn % TURNS_PER_SECOND == 0 {
            memory.push(memory_mb(recorder.0.id()));
        }
    }
    let took = begin.elapsed().as_secs_f64();
    goals.publish(goal(GoalStatus::STATUS_SUCCEEDED));
    let closed = recording_is(&mut recordings, false).await;

    let fed: u64 = counts.iter().sum();
    println!("published                {fed} in {took:.1} s, {:.0} a second", fed as f64 / took);
    println!("                         {:.1} MB/s", bytes as f64 / 1e6 / took);
    println!("not taken by DDS here    {refused}");
    print_memory("memory of the recorder", &memory);
    println!("reasons                  {}", closed.reason);
    let in_bag = counted(Path::new(&closed.uri));
    for ((topic, ..), (sent, recorded)) in TOPICS.iter().zip(counts.iter().zip(in_bag)) {
        println!("{topic:<24} {sent} published, {recorded} in the bag");
    }
    assert_eq!(counts, in_bag, "published, and in the bag");
}

fn goal(status: i8) -> GoalStatusArray {
    let mut goal = GoalStatus { status, ..GoalStatus::default() };
    goal.goal_info.goal_id.uuid = [7; 16];
    GoalStatusArray { status_list: vec![goal] }
}

/// Waits until the recorder reports that it records, or that it has stopped.
async fn recording_is(recordings: &mut Subscription<Recording>, is_recording: bool) -> Recording {
    let found = timeout(PATIENCE, async {
        loop {
            let (recording, _) = recordings.next().await;
            if recording.is_recording == is_recording && !recording.run_id.is_empty() {
                break recording;
            }
        }
    });
    found.await.expect("the recorder reports its bag")
}

/// The messages of each topic.
fn counted(path: &Path) -> [u64; TOPICS.len()] {
    let mut counts = [0; TOPICS.len()];
    for message in open_bag(path).expect("a bag").messages() {
        let message = message.expect("a message");
        let place = TOPICS.iter().position(|(name, ..)| message.channel.topic.ends_with(name));
        if let Some(place) = place {
            counts[place] += 1;
        }
    }
    counts
}
