//! Every difference is reported with its place, in any field.

use crate::bag::{Form, TestBag};
use crate::replay;
use crate::support::{Folder, Ran};
use cnc_msgs::interface::Message;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::BTreeMap;

const BAG: &str = "sinumerik_840c_contour";

#[track_caller]
fn after(change: impl FnOnce(&mut TestBag), more: &[&str]) -> Ran {
    after_of(BAG, change, more)
}

#[track_caller]
fn after_of(name: &str, change: impl FnOnce(&mut TestBag), more: &[&str]) -> Ran {
    let folder = Folder::new();
    let path = folder.path().join("bag");
    let mut bag = TestBag::golden(name);
    change(&mut bag);
    bag.write(&path, Form::OURS);
    replay(&path, more)
}

/// Changes the recorded path, with the checksums over it.
pub(crate) fn change_path(bag: &mut TestBag, change: impl Fn(&mut Vec<wire::PathElement>)) {
    use cnc_msgs::chunk::Chunk;
    // A chunk may be there twice: from its topic and from who was asked for it.
    let mut bodies = BTreeMap::new();
    bag.change(|chunk: &mut wire::PathChunk| {
        change(&mut chunk.elements);
        chunk.crc32 = chunk.checksums().1;
        bodies.insert(chunk.index, (chunk.elements.len() as u64, chunk.body()));
        true
    });
    bag.change(|manifest: &mut wire::CompensatedPath| {
        let all: Vec<u8> = bodies.values().flat_map(|(_, body)| body.clone()).collect();
        manifest.sha256 = cnc_msgs::chunk::sha256_hex(&all);
        manifest.element_count = bodies.values().map(|(count, _)| count).sum();
        true
    });
}

/// Moves the end of an element and the start of the next along X.
pub(crate) fn shift(elements: &mut [wire::PathElement], index: usize, by_m: f64) {
    elements[index].end.x += by_m;
    elements[index + 1].start.x += by_m;
}

#[test]
fn a_micrometre_is_reported_with_its_line_and_a_picometre_is_a_remark() {
    let ran = after(|bag| change_path(bag, |it| shift(it, 2, 1e-6)), &["--level", "planner"]);
    let ran = ran.expect(1).says(&[
        "DIFFERENT",
        "first: path 1: element 2",
        "0.001000 mm apart",
        "of line",
        "1 x compensated_path/chunks elements[].end.x",
    ]);
    assert!(ran.out.contains("the whole paths are at most 0.00"), "{}", ran.out);
    let ran = after(|bag| change_path(bag, |it| shift(it, 2, 1e-12)), &["--level", "planner"]);
    ran.expect(0).says(&["reproduced", "remark: compensated_path 1: sha256"]);
}

/// Cuts the last line of the recorded contour in two; what happens along the path stays.
fn split(bag: &mut TestBag) {
    let cut = std::cell::Cell::new(0);
    change_path(bag, |elements| {
        let line = |it: &wire::PathElement| {
            it.kind == wire::PathElement::KIND_LINE && it.role == wire::PathElement::ROLE_CONTOUR
        };
        let at = elements.iter().rposition(line).expect("a line");
        let mut first = elements[at].clone();
        let (from, to) = (&elements[at].start, &elements[at].end);
        first.end.x = from.x + (to.x - from.x) * 0.25;
        first.end.y = from.y + (to.y - from.y) * 0.25;
        first.end.z = from.z + (to.z - from.z) * 0.25;
        elements[at].start = first.end.clone();
        elements.insert(at, first);
        cut.set(at as u64);
    });
    change_events(bag, |event| event.at_element += u64::from(event.at_element > cut.get()));
}

/// Changes what happens along the recorded path, with the checksums over it.
fn change_events(bag: &mut TestBag, mut change: impl FnMut(&mut wire::PathEvent)) {
    bag.change(|chunk: &mut wire::PathChunk| {
        chunk.events.iter_mut().for_each(&mut change);
        true
    });
    change_path(bag, |_| {});
}

#[test]
fn another_split_of_the_same_path_is_a_remark() {
    let ran = after(split, &["--level", "planner"]).expect(0);
    ran.says(&["reproduced", "remark: path 1: the same curve,", "elements became"]);
    // The text is M6; the number of the tool is in another field.
    const WITH_TOOL: &str = "rs274_hold_and_tool_change";
    let other_tool = |event: &mut wire::PathEvent| {
        let is_change = event.function.kind == wire::MachineFunction::CHANGE_TOOL;
        event.function.number += u32::from(is_change);
    };
    for (has_other_tool, status, says) in [
        (false, 0, &["reproduced", "remark: path 1: the same curve,"][..]),
        (
            true,
            1,
            &[
                "DIFFERENT",
                "the same curve,",
                "first: events of path 1: events[1].function.number: 2 became 1",
            ],
        ),
    ] {
        let change = |bag: &mut TestBag| {
            split(bag);
            if has_other_tool {
                change_events(bag, other_tool);
            }
        };
        after_of(WITH_TOOL, change, &["--level", "planner"]).expect(status).says(says);
    }
}

/// A change of each recorded field that the cores make has to be noticed: that it is not
/// copied from the recording and compared with itself. What docs/replay.md calls an input
/// or leaves out does not.
#[test]
fn every_field_that_the_cores_make_is_compared() {
    const OF_THE_NODE: [&str; 4] = ["header", "program_id", "revision", "tool_table_revision"];
    const INPUTS: [&str; 5] =
        ["name", "control", "profile", "continues_revision", "settled_elements"];
    let folder = Folder::new();
    let mut seen = std::collections::BTreeSet::new();
    for name in [BAG, "rs274_trimmed_slot", "osp_lathe_shaft"] {
        let golden = TestBag::golden(name);
        let mut notice = |kind: &str, level: &str, field: &str, changed: Option<TestBag>| {
            // An empty list has nothing to change; another bag has one.
            let Some(bag) = changed else { return };
            if OF_THE_NODE.contains(&field) || INPUTS.contains(&field) {
                return;
            }
            let path = folder.path().join(format!("{name}_{kind}_{field}"));
            bag.write(&path, Form::OURS);
            let ran = replay(&path, &["--level", level]);
            assert!(
                ran.status == 1 && ran.out.contains(field) || ran.status == 2,
                "{name}: {kind}.{field} is not compared:\n{}",
                ran.out
            );
            seen.insert(format!("{kind}.{field}"));
        };
        for field in fields::<wire::CompensationReport>(&golden) {
            let changed = spoilt::<wire::CompensationReport>(&golden, &field);
            notice("report", "planner", &field, changed);
        }
        for field in fields::<wire::CompensatedPath>(&golden) {
            notice("path", "planner", &field, spoilt::<wire::CompensatedPath>(&golden, &field));
        }
        for field in fields::<wire::ProgrammedContour>(&golden) {
            // The start position is a parameter, and only in the bag.
            let is_made = field != "start";
            let changed = spoilt::<wire::ProgrammedContour>(&golden, &field);
            notice("contour", "loader", &field, changed.filter(|_| is_made));
        }
    }
    // Findings are the one thing that no golden bag has.
    for field in ["report.certificates", "report.uncut", "path.feed_length", "contour.bounds_min"] {
        assert!(seen.contains(field), "{field} is in no bag: {seen:?}");
    }
}

/// The value for infinity in JSON, which has none.
const ENDLESS: f64 = 1.25e300;

fn json<M: Message + Serialize + DeserializeOwned>(bag: &TestBag) -> Value {
    let value = bag.all::<M>().pop().expect("one message");
    serde_json::to_value(value).expect("JSON")
}

/// The names of the fields of a message.
fn fields<M: Message + Serialize + DeserializeOwned>(bag: &TestBag) -> Vec<String> {
    json::<M>(bag).as_object().expect("a message is an object").keys().cloned().collect()
}

/// The bag with another value in one field of all messages of a type.
fn spoilt<M: Message + Serialize + DeserializeOwned>(
    golden: &TestBag,
    field: &str,
) -> Option<TestBag> {
    let mut bag = golden.clone();
    let mut is_changed = false;
    bag.change(|message: &mut M| {
        let mut value = serde_json::to_value(&*message).expect("JSON");
        fill(&mut value);
        is_changed |= spoil(&mut value[field]);
        *message = serde_json::from_value(value).expect("the message again");
        true
    });
    bag.change_bytes::<M>(|data| {
        let endless = ENDLESS.to_le_bytes();
        while let Some(at) = data.windows(8).position(|bytes| *bytes == endless) {
            data[at..at + 8].copy_from_slice(&f64::INFINITY.to_le_bytes());
        }
    });
    is_changed.then_some(bag)
}

fn fill(value: &mut Value) {
    match value {
        Value::Null => *value = ENDLESS.into(),
        Value::Array(items) => items.iter_mut().for_each(fill),
        Value::Object(fields) => fields.values_mut().for_each(fill),
        _ => {}
    }
}

/// Changes the first thing in it, if there is one.
fn spoil(value: &mut Value) -> bool {
    match value {
        Value::Bool(it) => *it = !*it,
        Value::Number(it) if it.is_f64() => *value = (it.as_f64().unwrap_or(0.0) + 0.001).into(),
        Value::Number(it) => *value = (it.as_u64().unwrap_or(0) + 1).into(),
        Value::String(it) => it.push('?'),
        Value::Array(items) => return items.pop().is_some(),
        Value::Object(fields) => return fields.values_mut().any(spoil),
        Value::Null => return false,
    }
    true
}

#[test]
fn a_wrong_byte_to_the_machine_is_reported_with_the_line_that_was_cut() {
    let change = |bag: &mut TestBag| {
        let traffic = bag.all::<wire::ControllerTraffic>();
        let mut entries: Vec<_> = traffic.into_iter().flat_map(|it| it.entries).collect();
        // Batches may be in any order in the file.
        entries.sort_by_key(|entry| entry.sequence);
        // What comes before the checkpoint is not played.
        let is_checkpoint =
            |entry: &wire::TrafficEntry| entry.kind == wire::TrafficEntry::KIND_CHECKPOINT;
        let checkpoint = entries.iter().rposition(is_checkpoint).expect("a checkpoint");
        let is_block = |entry: &&wire::TrafficEntry| {
            entry.kind == wire::TrafficEntry::KIND_TRANSMITTED && entry.data.first() == Some(&b'G')
        };
        let fifth = entries[checkpoint..].iter().filter(is_block).nth(4).expect("five blocks");
        let sequence = fifth.sequence;
        bag.change(|traffic: &mut wire::ControllerTraffic| {
            let of_number = traffic.entries.iter_mut().filter(|it| it.sequence == sequence);
            of_number.for_each(|entry| entry.data[1] = b'9');
            true
        });
    };
    let ran = after(change, &["--level", "driver", "--json"]).expect(1);
    let report: Value = serde_json::from_str(&ran.out).expect("one JSON object");
    assert_eq!(report["reproduced"], false);
    let level = &report["bags"][0]["levels"][0];
    assert_eq!((&level["level"], &level["difference_count"]), (&"driver".into(), &1.into()));
    let row = &level["differences"][0];
    assert!(row["text"].as_str().expect("a text").contains("G9"), "{row}");
    // What came after it is not counted as compared.
    let all = after(|_| {}, &["--level", "driver", "--json"]).expect(0);
    let all: Value = serde_json::from_str(&all.out).expect("one JSON object");
    let sent = |report: &Value| {
        report["bags"][0]["levels"][0]["compared"]["transmissions"].as_u64().expect("a count")
    };
    assert!(sent(&report) < sent(&all), "{report}");
}

#[test]
fn all_differences_are_printed_on_demand() {
    let change = |bag: &mut TestBag| {
        change_path(bag, |elements| {
            for element in elements {
                element.axes ^= 4;
                element.column += 1;
            }
        });
    };
    let short = after(change, &["--level", "planner"]).expect(1);
    let short = short.says(&["axes ", "column ", "more; --all shows them"]);
    let long = after(change, &["--level", "planner", "--all"]).expect(1);
    assert!(long.out.lines().count() > short.out.lines().count(), "{}", long.out);
    assert!(!long.out.contains("--all shows them"), "{}", long.out);
}

#[test]
fn the_table_of_tolerances_is_a_command() {
    let ran = crate::support::run(crate::support::kerf().args(["replay", "--tolerances"]));
    ran.expect(0).says(&["| type | fields | same when | why |", "crc32", "within 1e-9 m"]);
}

/// The golden runs whose driver does today what it did.
fn golden_runs() -> impl Iterator<Item = String> {
    let bags = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../../bags"));
    let bags = bags.expect("bags/ is there").map(|it| it.expect("it can be read"));
    let bags = bags.filter(|it| it.path().is_dir()).map(|it| it.file_name());
    let names = bags.map(|name| name.into_string().expect("a plain name"));
    names.filter(|name| name != "rs274_older_definitions")
}

#[test]
fn no_golden_run_is_reproduced_with_other_states() {
    let mut count = 0;
    for name in golden_runs() {
        let folder = Folder::new();
        let path = folder.path().join("bag");
        let mut bag = TestBag::golden(&name);
        bag.change(|state: &mut wire::MachineState| {
            state.state = wire::MachineState::STATE_SLEEP;
            true
        });
        bag.write(&path, Form::OURS);
        let ran = replay(&path, &["--level", "driver"]).expect(1);
        ran.says(&["DIFFERENT", "SLEEP", "was recorded here, and does not occur now"]);

        // The one before the last that was published alone.
        let mut bag = TestBag::golden(&name);
        let mut states: Vec<wire::MachineState> = Vec::new();
        bag.change(|state: &mut wire::MachineState| {
            states.push(state.clone());
            true
        });
        let wrong = states.len() - 2;
        let mut index = 0;
        bag.change(|state: &mut wire::MachineState| {
            if index == wrong {
                state.alarm_code = 99;
            }
            index += 1;
            true
        });
        bag.write(&folder.path().join("one"), Form::OURS);
        replay(&folder.path().join("one"), &["--level", "driver"]).expect(1).says(&["DIFFERENT"]);
        count += 1;
    }
    assert!(count >= 20, "{count} golden runs");
}

#[test]
fn a_driver_that_was_started_again_is_named() {
    let ran = after(
        |bag| {
            let mut is_first = true;
            bag.change(|traffic: &mut wire::ControllerTraffic| {
                if std::mem::take(&mut is_first) {
                    let mut again = traffic.entries[0].clone();
                    again.monotonic.sec += 1;
                    traffic.entries.push(again);
                }
                true
            });
        },
        &["--level", "driver"],
    );
    ran.expect(2).says(&["was started again in this bag", "controller_traffic from entry"]);
}
