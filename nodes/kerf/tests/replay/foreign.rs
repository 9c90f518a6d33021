//! Bags that others recorded: `ros2 bag record` of Humble and Jazzy.

use crate::bag::{Form, TestBag, golden};
use crate::replay;
use crate::support::Folder;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use mcap::Compression;

const BAGS: [&str; 3] = ["sinumerik_840c_contour", "rs274_hold_and_tool_change", "osp_lathe_shaft"];

#[test]
fn a_bag_of_rosbag2_replays_whatever_its_form() {
    let zstd = Some(Compression::Zstd);
    let forms = [
        ("jazzy", Form::JAZZY),
        ("jazzy, zstd in chunks", Form { compression: zstd, ..Form::JAZZY }),
        ("jazzy, split", Form { files: 3, ..Form::JAZZY }),
        (
            "jazzy, split, lz4",
            Form { files: 2, compression: Some(Compression::Lz4), ..Form::JAZZY },
        ),
        ("jazzy, compressed files", Form { files: 2, is_zstd_file: true, ..Form::JAZZY }),
        ("humble", Form::HUMBLE),
        ("humble, zstd in chunks, split", Form { files: 2, compression: zstd, ..Form::HUMBLE }),
    ];
    for name in BAGS {
        let expected = replay(&golden(name), &[]).expect(0).out;
        let bag = TestBag::golden(name);
        for (what, form) in forms {
            let folder = Folder::new();
            let foreign = folder.path().join("foreign");
            bag.write(&foreign, form);
            let ran = replay(&foreign, &[]).expect(0);
            // The same counts; only the name of the bag is another.
            let rows = |out: &str| out.lines().skip(1).map(str::to_owned).collect::<Vec<_>>();
            assert_eq!(rows(&ran.out), rows(&expected), "{name}, {what}");
        }
    }
}

#[test]
fn a_file_without_its_folder_replays_too() {
    let folder = Folder::new();
    let foreign = folder.path().join("foreign");
    TestBag::golden(BAGS[0]).write(&foreign, Form::JAZZY);
    replay(&foreign.join("foreign_0.mcap"), &[]).expect(0).says(&["foreign_0.mcap: reproduced"]);
}

#[test]
fn topics_of_others_do_not_matter() {
    let folder = Folder::new();
    let mut bag = TestBag::golden(BAGS[0]);
    let mut other = bag.topics[0].clone();
    other.name = "/scan".into();
    other.type_name = "sensor_msgs/msg/LaserScan".into();
    other.encoding = "ros2idl".into();
    other.schema = b"module sensor_msgs { };".to_vec();
    bag.topics.push(other.clone());
    let mut message = bag.messages[0].clone();
    message.topic = bag.topics.len() - 1;
    message.data = vec![0, 1, 0, 0, 9, 9];
    bag.messages.push(message.clone());
    let mut undefined = other.clone();
    undefined.name = "/undefined".into();
    undefined.type_name = String::new();
    bag.topics.push(undefined);
    message.topic += 1;
    bag.messages.push(message);
    for topic in &mut bag.topics {
        topic.name.insert_str(0, "/cell1/mill");
    }
    let foreign = folder.path().join("foreign");
    bag.write(&foreign, Form::JAZZY);
    replay(&foreign, &[]).expect(0).says(&["reproduced"]);
}

#[test]
fn what_a_recorder_that_came_late_has_missed_is_named() {
    type Miss = fn(&mut TestBag);
    let cases: [(&str, Miss, &[&str]); 4] = [
        (
            "volatile chunks went by before",
            |bag| bag.silence::<wire::PathChunk>(),
            &["a chunk of the path", "revision", "--all", "before the program was loaded"],
        ),
        (
            "the text went by before",
            |bag| bag.change(|chunk: &mut wire::ProgramChunk| chunk.index > 0),
            &["the loader cannot be replayed", "/program/chunks has no message", "ros2 bag record"],
        ),
        (
            "the traffic began in the middle",
            |bag| {
                let mut batch = 0;
                bag.change(|_: &mut wire::ControllerTraffic| {
                    batch += 1;
                    batch > 20
                });
            },
            &["the record begins with entry", "neither the first nor a checkpoint"],
        ),
        (
            "a batch was lost",
            |bag| {
                let mut batch = 0;
                bag.change(|_: &mut wire::ControllerTraffic| {
                    batch += 1;
                    batch != 30
                });
            },
            &["is missing", "the record is not complete"],
        ),
    ];
    for (what, miss, says) in cases {
        let folder = Folder::new();
        let foreign = folder.path().join("foreign");
        let mut bag = TestBag::golden(BAGS[0]);
        miss(&mut bag);
        bag.write(&foreign, Form::JAZZY);
        let ran = replay(&foreign, &[]).expect(2).says(says);
        assert_eq!(ran.err.matches("kerf:").count(), 1, "{what}: {}", ran.err);
    }
}

#[test]
fn two_machines_in_one_bag_are_not_taken_for_one() {
    let folder = Folder::new();
    let mut bag = TestBag::golden(BAGS[0]);
    let mut other = TestBag::golden(BAGS[1]);
    let count = bag.topics.len();
    other.topics.iter_mut().for_each(|topic| topic.name.insert_str(0, "/cell2"));
    other.messages.iter_mut().for_each(|message| message.topic += count);
    bag.topics.append(&mut other.topics);
    bag.messages.append(&mut other.messages);
    let path = folder.path().join("both");
    bag.write(&path, Form::JAZZY);
    replay(&path, &[]).expect(2).says(&["/cell2/", "several machines", "--regex"]);

    // One that says nothing all the time cannot be taken for the other.
    let idle = folder.path().join("idle");
    bag.messages.retain(|message| message.topic < count);
    bag.write(&idle, Form::JAZZY);
    replay(&idle, &[]).expect(0).says(&["reproduced"]);
}

#[test]
fn a_topic_with_two_channels_is_of_one_machine() {
    let folder = Folder::new();
    let mut bag = TestBag::golden(BAGS[0]);
    let count = bag.topics.len();
    // A restarted recorder announces its topics again.
    for mut topic in bag.topics.clone() {
        topic.metadata.insert("announced".into(), "again".into());
        bag.topics.push(topic);
    }
    let half = bag.messages.len() / 2;
    bag.messages[half..].iter_mut().for_each(|message| message.topic += count);
    let path = folder.path().join("twice");
    bag.write(&path, Form::JAZZY);
    replay(&path, &[]).expect(0).says(&["reproduced"]);
}
