//! `--update` blesses what the cores make, and nothing else changes.

use crate::bag::{Form, Recorded, TestBag, files, golden};
use crate::differences::{change_path, shift};
use crate::replay;
use crate::support::Folder;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const BAG: &str = "sinumerik_840c_contour";

fn written(folder: &Folder, change: impl FnOnce(&mut TestBag), form: Form) -> PathBuf {
    let path = folder.path().join("bag");
    let mut bag = TestBag::golden(BAG);
    change(&mut bag);
    bag.write(&path, form);
    path
}

/// Every file of a folder.
fn content(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let read = |path: PathBuf| {
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        (name, std::fs::read(path).expect("a file"))
    };
    entries.map(|entry| read(entry.expect("an entry").path())).collect()
}

#[test]
fn what_is_blessed_is_shown_and_reproduced_and_inputs_stay() {
    type Change = fn(&mut TestBag);
    let changes: [(&str, &str, Change); 4] = [
        ("warning_count", "DIFFERENT", |bag| {
            bag.change(|report: &mut wire::CompensationReport| {
                report.warning_count += 3;
                report.certificates.clear();
                true
            });
        }),
        ("sha256", "reproduced", |bag| change_path(bag, |it| shift(it, 2, 1e-12))),
        ("transmission", "DIFFERENT", |bag| {
            bag.change(|traffic: &mut wire::ControllerTraffic| {
                for entry in &mut traffic.entries {
                    let is_status =
                        entry.kind == wire::TrafficEntry::KIND_TRANSMITTED && entry.data == *b"?";
                    if is_status && entry.sequence % 2 == 0 {
                        entry.data = b"!".to_vec();
                    }
                }
                true
            });
        }),
        ("does not occur now", "DIFFERENT", |bag| {
            bag.change(|state: &mut wire::MachineState| {
                state.pins = "Z".into();
                true
            });
        }),
    ];
    for (what, verdict, change) in changes {
        let folder = Folder::new();
        let path = written(&folder, change, Form::OURS);
        let before = TestBag::read(&path);
        let ran = replay(&path, &["--update"]).expect(0);
        ran.says(&[what, verdict, "updated; the bag is reproduced now"]);
        let ran = replay(&path, &["--chain"]).expect(0).says(&["reproduced"]);
        assert!(!ran.out.contains("remark"), "{what}: {}", ran.out);
        // What is not made by a core is as it was: each message with its times, each record.
        let after = TestBag::read(&path);
        let given = |bag: &TestBag| -> Vec<(String, Recorded)> {
            let made = ["Contour", "Path", "Compens", "Traffic", "MachineState"];
            let named = bag.messages.iter().map(|it| (bag.topics[it.topic].name.clone(), it));
            let is_made = |it: &Recorded| {
                made.iter().any(|made| bag.topics[it.topic].type_name.contains(made))
            };
            // The number of a topic is its place among those that have messages.
            let given = named.filter(|(_, it)| !is_made(it));
            let given = given.map(|(name, it)| (name, Recorded { topic: 0, ..it.clone() }));
            let mut given: Vec<_> = given.collect();
            // Files are in the order of arrival, which is nearly that of time.
            given.sort_by(|(a, was), (b, is)| (was.log_time, a).cmp(&(is.log_time, b)));
            given
        };
        assert!(given(&before) == given(&after), "{what}: an input is another one");
        // That it is counted anew the replay of it shows.
        let without_counts = |bag: &TestBag| {
            let mut records = bag.records.clone();
            for (_, record) in &mut records {
                record.retain(|key, _| !key.starts_with("messages_of:"));
            }
            records
        };
        assert_eq!(without_counts(&before), without_counts(&after), "{what}");
        let received = |bag: &TestBag| -> Vec<wire::TrafficEntry> {
            let entries =
                bag.all::<wire::ControllerTraffic>().into_iter().flat_map(|it| it.entries);
            let entries = entries.filter(|it| it.kind != wire::TrafficEntry::KIND_TRANSMITTED);
            let mut entries: Vec<_> = entries.collect();
            entries.sort_by_key(|it| it.sequence);
            entries
        };
        assert!(received(&before) == received(&after), "{what}: the received bytes differ");
        // Both files say the same, and once more there is nothing to do.
        let kept = content(&path);
        let yaml = String::from_utf8(kept["metadata.yaml"].clone()).expect("a text");
        assert!(yaml.contains(&format!("message_count: {}\n", after.messages.len())), "{yaml}");
        replay(&path, &["--update"]).expect(0).says(&["nothing to update"]);
        assert!(content(&path) == kept, "{what}: a file is another one");
    }
}

#[test]
fn golden_bags_need_no_update_and_are_not_touched() {
    let folder = Folder::new();
    let path = folder.path().join("copy");
    std::fs::create_dir(&path).expect("a folder");
    for (name, bytes) in content(&golden(BAG)) {
        std::fs::write(path.join(name), bytes).expect("a file");
    }
    let before = content(&path);
    let ran = replay(&path, &["--update"]).expect(0);
    ran.says(&["reproduced", "nothing to update"]);
    assert!(content(&path) == before, "a file is another one");
}

#[test]
fn what_cannot_be_blessed_stays_as_it_was() {
    type Change = fn(&mut TestBag);
    let split = Form { files: 2, ..Form::OURS };
    let cases: [(Form, Change, &[&str]); 5] = [
        // Nothing to compare with: nothing to bless.
        (Form::OURS, |bag| bag.silence::<wire::ProgramChunk>(), &["the loader cannot be replayed"]),
        // The machine would be sent other lines than were answered.
        (
            Form::OURS,
            |bag| change_path(bag, |it| shift(it, 2, 1e-3)),
            &["the bag was not changed", "other lines", "record this run again"],
        ),
        // It would be sent lines at other times.
        (
            Form::OURS,
            |bag| {
                bag.change(|traffic: &mut wire::ControllerTraffic| {
                    for entry in &mut traffic.entries {
                        if entry.kind == wire::TrafficEntry::KIND_COMMAND {
                            entry.kind = wire::TrafficEntry::KIND_TIMER;
                            entry.data.clear();
                        }
                    }
                    true
                });
            },
            &["the bag was not changed", "at other times", "record this run again"],
        ),
        (
            split,
            |bag| {
                bag.change(|report: &mut wire::CompensationReport| {
                    report.warning_count += 1;
                    true
                });
            },
            &["the bag was not changed", "it is in several files"],
        ),
        (
            Form { is_zstd_file: true, ..Form::OURS },
            |bag| {
                bag.change(|report: &mut wire::CompensationReport| {
                    report.warning_count += 1;
                    true
                });
            },
            &["the bag was not changed", "compressed as a whole"],
        ),
    ];
    for (form, change, says) in cases {
        let folder = Folder::new();
        let path = written(&folder, change, form);
        let before = content(&path);
        replay(&path, &["--update"]).expect(2).says(says);
        assert!(content(&path) == before, "a file is another one");
        let files = std::fs::read_dir(folder.path()).expect("a folder").count();
        assert_eq!(files, 1, "nothing is left next to the bag");
    }
}

#[test]
fn a_file_without_its_folder_can_be_updated() {
    let folder = Folder::new();
    let change = |bag: &mut TestBag| {
        bag.change(|report: &mut wire::CompensationReport| {
            report.error_count += 1;
            true
        });
    };
    let path = files(&written(&folder, change, Form::OURS)).remove(0);
    replay(&path, &["--update"]).expect(0).says(&["DIFFERENT", "updated"]);
    replay(&path, &[]).expect(0).says(&["reproduced"]);
}
