//! A topic of a type that the recorder was not compiled with is recorded too.

use cnc_msgs::wire::action_msgs::msg::{GoalStatus, GoalStatusArray};
use cnc_msgs::wire::cnc_msgs::msg::Recording;
use run_recorder::files::open_bag;
use runtime::{Qos, client_session};
use std::path::Path;
use std::process::{Child, Command};
use std::time::Duration;
use tokio::time::{sleep, timeout};

/// The recorder as a process of its own, killed with the test.
struct Recorder(Child);

impl Drop for Recorder {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A timeout that only a broken build reaches.
const PATIENCE: Duration = Duration::from_secs(60);

fn status(status: i8) -> GoalStatusArray {
    let mut goal = GoalStatus { status, ..GoalStatus::default() };
    goal.goal_info.goal_id.uuid = [7; 16];
    GoalStatusArray { status_list: vec![goal] }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_topic_of_an_unknown_type_is_recorded_byte_for_byte() {
    let folder = tempfile::tempdir().expect("a folder");
    let namespace = format!("__ns:=/foreign_{}", std::process::id());
    let ros = |extra: &[&str]| -> Vec<String> {
        ["--ros-args", "-r", &namespace]
            .iter()
            .chain(extra)
            .map(|word| (*word).to_owned())
            .collect()
    };
    let directory = format!("directory:={}", folder.path().display());
    let recorder = Command::new(env!("CARGO_BIN_EXE_run_recorder"))
        .args(ros(&["-p", &directory]))
        .spawn()
        .expect("the recorder starts");
    let _recorder = Recorder(recorder);

    let session = client_session("test", &ros(&[])).expect("a node");
    let node = session.handle();
    let mut recordings =
        node.subscription::<Recording>("recording", Qos::LATCHED).expect("a topic");
    let goals = node.publisher("run_program/_action/status", Qos::LATCHED).expect("a topic");
    let foreign =
        node.raw_publisher("gripper", "cell_msgs/msg/Gripper", Qos::DEFAULT).expect("a topic");
    let wait_for = async |recordings: &mut runtime::Subscription<Recording>, is_recording| {
        let found = timeout(PATIENCE, async {
            loop {
                let (recording, _) = recordings.next().await;
                if recording.is_recording == is_recording && !recording.run_id.is_empty() {
                    break recording;
                }
            }
        });
        found.await.expect("the recorder reports its bag")
    };

    goals.publish(status(GoalStatus::STATUS_EXECUTING));
    wait_for(&mut recordings, true).await;
    let sent = [0, 1, 0, 0, 0xde, 0xad, 0xbe, 0xef];
    for _ in 0..20 {
        foreign.publish(&sent);
        sleep(Duration::from_millis(50)).await;
    }
    goals.publish(status(GoalStatus::STATUS_SUCCEEDED));
    let closed = wait_for(&mut recordings, false).await;
    assert!(!closed.complete, "there is no driver, so its traffic is missing");

    let mut bag = open_bag(Path::new(&closed.uri)).expect("a bag");
    let topic = node.names().resolve("gripper").expect("a name");
    let messages: Vec<_> = bag
        .messages()
        .map(|message| message.expect("a message"))
        .filter(|message| message.channel.topic == topic)
        .collect();
    assert!(!messages.is_empty(), "nothing of {topic} is in the bag");
    for message in &messages {
        assert_eq!(message.data, sent);
        assert_eq!(message.channel.type_name(), "cell_msgs/msg/Gripper");
    }
    session.stop().await;
}
