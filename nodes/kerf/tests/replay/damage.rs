//! Bags that are broken or lie: an error that names the record, status 2, no panic.

use crate::bag::{Form, TestBag, definition, files, golden};
use crate::replay;
use crate::support::{Folder, kerf, run};
use cnc_msgs::wire::cnc_msgs::msg as wire;
use mcap::records::op;
use serde_json::Value;

const BAG: &str = "nct_offsets";

#[test]
fn a_definition_that_lies_about_its_data_is_refused_by_name() {
    type Lie = fn(&mut TestBag);
    let cases: [(&str, Lie, &[&str]); 8] = [
        (
            "another definition under our name, and the hash of ours",
            |bag| {
                let topic = bag.topic::<wire::ToolTable>();
                bag.topics[topic].schema = b"string data\n".to_vec();
            },
            &["cnc_msgs/msg/ToolTable", "definition"],
        ),
        (
            "two fields the other way around, and no hash",
            |bag| {
                let topic = bag.topic::<wire::ProgramChunk>();
                let text = definition::<wire::ProgramChunk>()
                    .replace("uint32 index", "uint32 chunk_count_")
                    .replace("uint32 chunk_count\n", "uint32 index\n");
                bag.topics[topic].schema = text.into_bytes();
                bag.topics[topic].metadata.remove("topic_type_hash");
            },
            &["cnc_msgs/msg/ProgramChunk", "definition"],
        ),
        (
            "no definition at all",
            |bag| {
                let topic = bag.topic::<wire::MachineState>();
                bag.topics[topic].schema = Vec::new();
            },
            &["cnc_msgs/msg/MachineState was recorded with"],
        ),
        (
            "IDL instead of a message file",
            |bag| {
                let topic = bag.topic::<wire::MachineState>();
                bag.topics[topic].encoding = "ros2idl".into();
                bag.topics[topic].schema = b"module cnc_msgs { };".to_vec();
                bag.topics[topic].metadata.remove("topic_type_hash");
            },
            &["/machine_state"],
        ),
        (
            "a message that is too short",
            |bag| {
                let topic = bag.topic::<wire::CompensationReport>();
                for message in bag.messages.iter_mut().filter(|it| it.topic == topic) {
                    message.data.truncate(20);
                }
            },
            &["message 1 of /compensation_report at "],
        ),
        (
            "a message that is too long",
            |bag| {
                let topic = bag.topic::<wire::CompensationReport>();
                for message in bag.messages.iter_mut().filter(|it| it.topic == topic) {
                    message.data.extend([7; 40]);
                }
            },
            &["message 1 of /compensation_report at ", "40 bytes follow"],
        ),
        (
            "a chunk that is not what its checksum says",
            |bag| {
                bag.change(|chunk: &mut wire::PathChunk| {
                    chunk.elements[0].end.x += 1.0;
                    true
                });
            },
            &["the path, revision 3 of ", "chunk 0 is damaged: its checksum is"],
        ),
        (
            "a list that claims more than there is",
            |bag| {
                let topic = bag.topic::<wire::ControllerTraffic>();
                let mut of_topic = bag.messages.iter_mut().filter(|it| it.topic == topic);
                let third = of_topic.nth(2).expect("three batches");
                third.data[4..8].copy_from_slice(&u32::MAX.to_le_bytes());
            },
            &["message 3 of /controller_traffic at "],
        ),
    ];
    for (what, lie, says) in cases {
        let folder = Folder::new();
        let path = folder.path().join("bag");
        let mut bag = TestBag::golden(BAG);
        lie(&mut bag);
        bag.write(&path, Form::OURS);
        let ran = replay(&path, &[]);
        assert_eq!(ran.status, 2, "{what}: {}{}", ran.out, ran.err);
        ran.says(says);
    }
}

#[test]
fn a_request_that_cannot_be_read_is_named_by_whom_it_was_sent_to_and_when() {
    let folder = Folder::new();
    let path = folder.path().join("bag");
    let mut bag = TestBag::golden("refused_programs");
    let mut stamp = None;
    bag.change(|command: &mut wire::Command| {
        let is_load = command.endpoint_type.ends_with("LoadProgram") && !command.success;
        if is_load && stamp.is_none() {
            stamp = Some(command.stamp.clone());
            command.request.truncate(5);
        }
        true
    });
    let stamp = stamp.expect("programs were refused");
    let when = format!("stamped {}.{:09} s: ", stamp.sec, stamp.nanosec);
    bag.write(&path, Form::OURS);
    let ran = replay(&path, &["--level", "loader"]).expect(2);
    ran.says(&[
        "the request to /",
        "load_program (cnc_msgs/srv/LoadProgram) on command_log",
        &when,
    ]);
}

#[test]
fn a_file_that_breaks_off_or_is_spoilt_is_an_error_and_never_a_panic() {
    let folder = Folder::new();
    let file = files(&golden(BAG)).remove(0);
    let bytes = std::fs::read(file).expect("a golden bag");
    let replayed = |name: &str, bytes: &[u8]| {
        let path = folder.file(name, bytes);
        let ran = replay(&path, &[]);
        assert!(!ran.err.contains("panicked"), "{name}: {}", ran.err);
        ran
    };
    for part in 0..16 {
        let cut = bytes.len() * part / 16;
        let ran = replayed("cut.mcap", &bytes[..cut]);
        assert_eq!(ran.status, 2, "{cut} bytes: {}", ran.out);
    }
    // Nor is a part of it taken for the whole at one level, whose inputs may all be there.
    for level in ["loader", "planner", "driver"] {
        let path = folder.file("cut.mcap", &bytes[..bytes.len() * 9 / 10]);
        let ran = replay(&path, &["--level", level]).expect(2);
        ran.says(&["cut.mcap", "the bag is damaged", "kerf bag recover"]);
    }
    // A byte here and there in each chunk: the checksum finds it, and the chunk is named.
    let mut at = mcap::MAGIC.len();
    let mut chunks = 0;
    while bytes[at] != op::DATA_END {
        let length: [u8; 8] = bytes[at + 1..at + 9].try_into().expect("eight bytes");
        let length = usize::try_from(u64::from_le_bytes(length)).expect("a length");
        if bytes[at] == op::CHUNK {
            for part in 1..8 {
                let mut spoilt = bytes.clone();
                spoilt[at + 9 + length * part / 8] ^= 0x55;
                let ran = replayed("spoilt.mcap", &spoilt);
                assert_eq!(ran.status, 2, "chunk at {at}, {part}/8: {}", ran.out);
            }
            chunks += 1;
        }
        at += 9 + length;
    }
    assert!(chunks > 0, "a bag has chunks");
    // Anywhere else, and without checksums: whatever comes of it, it is said and no panic.
    let plain = folder.path().join("plain");
    TestBag::golden(BAG).write(&plain, Form::JAZZY);
    let plain = std::fs::read(plain.join("foreign_0.mcap")).expect("it was written");
    for bytes in [&bytes, &plain] {
        for at in (8..bytes.len()).step_by(bytes.len() / 40) {
            let mut spoilt = bytes.clone();
            spoilt[at] ^= 0x55;
            let ran = replayed("spoilt.mcap", &spoilt);
            assert!((0..=2).contains(&ran.status), "byte {at}: {}{}", ran.out, ran.err);
        }
    }
}

#[test]
fn damage_outside_of_the_messages_is_reported_by_info_and_by_replay() {
    let folder = Folder::new();
    let path = folder.path().join("bag");
    std::fs::create_dir(&path).expect("a folder");
    let file = files(&golden(BAG)).remove(0);
    let (bytes, name) = (std::fs::read(&file).expect("a bag"), file.file_name().expect("a name"));
    let yaml = std::fs::read_to_string(golden(BAG).join("metadata.yaml")).expect("metadata.yaml");
    let info = |bytes: &[u8], yaml: &str| {
        std::fs::write(path.join(name), bytes).expect("a file");
        std::fs::write(path.join("metadata.yaml"), yaml).expect("a file");
        run(kerf().args(["bag", "info"]).arg(&path))
    };
    info(&bytes, &yaml).expect(0).says(&["complete:    yes"]);
    let mut at = mcap::MAGIC.len();
    let mut kinds = std::collections::BTreeSet::new();
    while at + mcap::MAGIC.len() < bytes.len() {
        let length: [u8; 8] = bytes[at + 1..at + 9].try_into().expect("eight bytes");
        let length = usize::try_from(u64::from_le_bytes(length)).expect("a length");
        for within in [length / 3, length - 1] {
            let mut spoilt = bytes.clone();
            spoilt[at + 9 + within] ^= 1;
            let kind = bytes[at];
            let said = info(&spoilt, &yaml);
            assert!([1, 2].contains(&said.status), "kind {kind} at {at}: {}", said.out);
            assert!(!said.out.contains("complete:    yes"), "kind {kind} at {at}: {}", said.out);
            let ran = replay(&path, &["--level", "loader"]);
            let is_reported = ran.status == 2 || ran.out.contains("remark: bag:");
            assert!(is_reported, "kind {kind} at {at}: {}{}", ran.out, ran.err);
            kinds.insert(kind);
        }
        at += 9 + length;
    }
    assert!(kinds.contains(&op::MESSAGE_INDEX) && kinds.contains(&op::METADATA), "{kinds:?}");
    // The contradiction of metadata.yaml is reported, too; the bag still replays.
    let count = yaml.lines().find(|line| line.contains("message_count")).expect("a count");
    let said = info(&bytes, &yaml.replace(count, "  message_count: 7")).expect(2);
    said.says(&["metadata.yaml says 7 messages, and there are "]);
    replay(&path, &[]).expect(0).says(&["reproduced", "remark: bag:", "says 7 messages"]);
}

#[test]
fn a_broken_bag_does_not_hide_those_after_it() {
    let folder = Folder::new();
    let page = folder.path().join("page.html");
    let (none, whole) = (folder.path().join("none"), golden(BAG));
    let all = |more: &[&str]| {
        let page = page.as_os_str();
        run(kerf()
            .arg("replay")
            .args([&none, &whole, &golden("masso_example")])
            .args(more)
            .arg("--html")
            .arg(page))
    };
    let ran = all(&["--level", "loader"]).expect(2);
    let said = ran.says(&[&none.display().to_string(), "reproduced"]);
    assert_eq!(said.out.matches(": reproduced").count(), 2, "{}", said.out);
    assert!(page.exists(), "what could be replayed is shown");

    let json = all(&["--level", "loader", "--json"]).expect(2).out;
    let json: Value = serde_json::from_str(&json).expect("one JSON object");
    assert_eq!(json["reproduced"], false);
    assert_eq!(json["bags"].as_array().map(Vec::len), Some(3));
    assert_eq!(json["bags"][0]["bag"], none.display().to_string());
    assert!(json["bags"][0]["error"].as_str().is_some_and(|it| it.contains("none")), "{json}");
    assert!(json["bags"][1]["error"].is_null() && json["bags"][1]["levels"].is_array());
    // Damage is worse than a difference, and the page of nothing is not written.
    std::fs::remove_file(&page).expect("it was there");
    let only = run(kerf().arg("replay").arg(&none).arg("--html").arg(&page)).expect(2);
    assert!(only.out.is_empty() && !page.exists(), "{}", only.out);
}

/// Numbers as good as random, always the same.
fn next(seed: &mut u64) -> usize {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 33) as usize
}

#[test]
fn a_message_that_is_spoilt_anywhere_never_makes_a_core_panic() {
    let folder = Folder::new();
    let path = folder.path().join("bag");
    let golden = TestBag::golden(BAG);
    let mut seed = 7;
    let of_ours = |place: &usize| {
        let topic = &golden.topics[golden.messages[*place].topic];
        topic.type_name.starts_with("cnc_msgs/")
    };
    let places: Vec<usize> = (0..golden.messages.len()).filter(of_ours).collect();
    for _ in 0..40 {
        let mut bag = golden.clone();
        let place = places[next(&mut seed) % places.len()];
        let data = &mut bag.messages[place].data;
        let at = next(&mut seed) % data.len();
        match next(&mut seed) % 5 {
            0 => data[at] = next(&mut seed) as u8,
            1 => data[at] ^= 1 << (next(&mut seed) % 8),
            2 => data.truncate(at),
            // What is no number, and what is too large for one.
            3 if at + 8 <= data.len() => data[at..at + 8].copy_from_slice(&f64::NAN.to_le_bytes()),
            _ => data[at..].iter_mut().take(4).for_each(|byte| *byte = 0xff),
        }
        let _ = std::fs::remove_dir_all(&path);
        bag.write(&path, Form::JAZZY);
        for more in [&[][..], &["--chain"]] {
            let ran = replay(&path, more);
            assert!((0..=2).contains(&ran.status), "{place} at {at}: {}{}", ran.out, ran.err);
            assert!(!ran.err.contains("panicked"), "{place} at {at}: {}", ran.err);
        }
    }
}
