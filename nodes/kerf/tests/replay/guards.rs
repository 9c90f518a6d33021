//! Nothing passes because nothing was looked at.

use crate::bag::{Form, TestBag, golden};
use crate::replay;
use crate::support::{Folder, Ran, kerf, run};
use cnc_msgs::wire::action_msgs::msg::{GoalStatus, GoalStatusArray};
use cnc_msgs::wire::cnc_msgs::msg as wire;

const BAG: &str = "sinumerik_840c_contour";

#[track_caller]
fn after(change: impl FnOnce(&mut TestBag), form: Form, more: &[&str]) -> Ran {
    let folder = Folder::new();
    let path = folder.path().join("bag");
    let mut bag = TestBag::golden(BAG);
    change(&mut bag);
    bag.write(&path, form);
    replay(&path, more)
}

#[test]
fn a_bag_that_is_written_again_replays() {
    after(|_| {}, Form::OURS, &[]).expect(0).says(&["reproduced"]);
}

#[test]
fn an_expected_topic_that_is_absent_or_silent_is_an_error_of_its_level() {
    type Change = fn(&mut TestBag);
    let table: [(&str, Change, &[&str]); 11] = [
        ("loader", |bag| bag.forget::<wire::Program>(), &["no topic is of type", "msg/Program"]),
        ("loader", |bag| bag.silence::<wire::ProgramChunk>(), &["/program/chunks has no message"]),
        ("loader", |bag| bag.silence::<wire::ContourChunk>(), &["/programmed_contour/chunks"]),
        ("planner", |bag| bag.silence::<wire::ProgrammedContour>(), &["/programmed_contour has"]),
        ("planner", |bag| bag.forget::<wire::ToolTable>(), &["ToolTable", "usually tool_table"]),
        ("planner", |bag| bag.silence::<wire::CompensationReport>(), &["/compensation_report"]),
        ("planner", |bag| bag.silence::<wire::CompensatedPath>(), &["the path of revision"]),
        ("driver", |bag| bag.silence::<wire::NodeParameters>(), &["/node_parameters has no"]),
        ("driver", |bag| bag.silence::<wire::ControllerTraffic>(), &["/controller_traffic has no"]),
        ("driver", |bag| bag.forget::<wire::MachineState>(), &["usually machine_state"]),
        (
            "driver",
            |bag| bag.forget::<wire::CompensationReport>(),
            &["no topic is of type", "usually compensation_report"],
        ),
    ];
    for (level, change, says) in table {
        let named = format!("the {level} cannot be replayed");
        let all = [says, &[named.as_str()]].concat();
        after(change, Form::OURS, &["--level", level]).expect(2).says(&all);
        // Without a level everything has to be there.
        after(change, Form::OURS, &[]).expect(2).says(says);
    }
}

#[test]
fn a_level_alone_needs_nothing_of_the_others() {
    let only_planner = |bag: &mut TestBag| {
        bag.forget::<wire::Program>();
        bag.forget::<wire::ProgramChunk>();
        bag.forget::<wire::ControllerTraffic>();
        bag.forget::<wire::MachineState>();
    };
    after(only_planner, Form::OURS, &["--level", "planner"]).expect(0).says(&["reproduced"]);
    let only_loader = |bag: &mut TestBag| {
        bag.forget::<wire::CompensatedPath>();
        bag.forget::<wire::PathChunk>();
        bag.forget::<wire::CompensationReport>();
    };
    after(only_loader, Form::OURS, &["--level", "loader"]).expect(0).says(&["reproduced"]);
}

#[test]
fn a_run_that_never_ran_proves_nothing_of_the_driver() {
    let never = |bag: &mut TestBag| {
        bag.change(|state: &mut wire::MachineState| {
            state.state = wire::MachineState::STATE_IDLE;
            true
        });
        bag.change(|traffic: &mut wire::ControllerTraffic| {
            traffic.entries.retain(|entry| {
                entry.kind != wire::TrafficEntry::KIND_TRANSMITTED
                    || !entry.data.first().is_some_and(u8::is_ascii_uppercase)
            });
            true
        });
    };
    after(never, Form::OURS, &["--level", "driver"]).expect(2).says(&["the run did not start"]);
}

#[test]
fn of_a_goal_that_was_only_checked_the_plan_is_replayed() {
    let folder = Folder::new();
    let path = folder.path().join("bag");
    let mut bag = TestBag::golden("rs274_touch_off");
    bag.silence::<wire::RunResult>();
    bag.write(&path, Form::OURS);
    let ran = replay(&path, &[]).expect(0);
    ran.says(&["reproduced", "planner: 0 differences", "its goal was only checked"]);
    let info = run(kerf().args(["bag", "info"]).arg(&path)).expect(0);
    info.says(&["result:      checked: nothing was sent to the machine"]);
}

#[test]
fn a_bag_that_is_not_all_there_was_is_refused_by_the_level_that_was_asked_for() {
    let lost = |bag: &mut TestBag| {
        for (name, record) in &mut bag.records {
            if name == "cnc_run_result" {
                record.insert("complete".into(), "false".into());
                record.insert("reasons".into(), "12 messages were lost".into());
            }
        }
    };
    for level in ["driver", "stack"] {
        let named = format!("12 messages were lost); the {level} cannot be replayed from it");
        after(lost, Form::OURS, &["--level", level]).expect(2).says(&[&named]);
    }
    let ran = after(lost, Form::OURS, &["--level", "planner"]).expect(0);
    ran.says(&["reproduced", "remark: bag: ", "12 messages were lost"]);
}

#[test]
fn a_whole_file_is_replayed_without_metadata_yaml_as_it_is_by_its_name() {
    let folder = Folder::new();
    let path = folder.path().join("bag");
    TestBag::golden(BAG).write(&path, Form::OURS);
    let listed = std::fs::read_to_string(path.join("metadata.yaml")).expect("it was written");
    std::fs::remove_file(path.join("metadata.yaml")).expect("it is there");
    replay(&path, &[]).expect(0).says(&["reproduced", "remark: bag: there is no metadata.yaml"]);
    replay(&path.join("foreign_0.mcap"), &[]).expect(0).says(&["reproduced"]);
    // Nor is it refused for a list that does not name it.
    std::fs::write(path.join("metadata.yaml"), listed.replace("    - foreign_0.mcap\n", ""))
        .expect("a file");
    replay(&path, &[]).expect(0).says(&["reproduced"]);
}

#[test]
fn an_error_names_the_bag_however_it_is_called() {
    let folder = Folder::new();
    let mut bag = TestBag::golden(BAG);
    bag.write(&folder.path().join("whole"), Form::OURS);
    bag.silence::<wire::ProgramChunk>();
    bag.write(&folder.path().join("b"), Form::OURS);
    for (bag, says) in [
        ("b", "b: the loader cannot be replayed: /program/chunks has no message"),
        ("a", "kerf: a does not exist"),
    ] {
        let mut command = kerf();
        command.args(["replay", "whole", bag, "--level", "loader"]).current_dir(folder.path());
        let ran = run(&mut command).expect(2);
        assert!(!ran.err.contains("a: a"), "{}", ran.err);
        ran.says(&["whole: reproduced", says]);
    }
}

#[test]
fn a_bag_that_says_it_is_of_a_program_must_hold_it() {
    let other = |bag: &mut TestBag| {
        for (_, record) in &mut bag.records {
            if let Some(id) = record.get_mut("program_id") {
                *id = "0123456789abcdef".into();
            }
        }
    };
    after(other, Form::OURS, &[]).expect(2).says(&["program 0123456789abcdef, but holds nothing"]);
}

#[test]
fn a_plan_that_was_refused_and_blocks_without_a_request_are_different() {
    // Refused then, and no path; accepted now.
    let refused = |bag: &mut TestBag| {
        bag.change(|report: &mut wire::CompensationReport| {
            report.accepted = false;
            report.error_count = 1;
            true
        });
        bag.silence::<wire::CompensatedPath>();
    };
    let ran = after(refused, Form::OURS, &["--level", "planner"]).expect(1);
    ran.says(&["DIFFERENT", "accepted: false became true"]);
    // Blocks were sent that no command asks for.
    let unasked = |bag: &mut TestBag| {
        bag.change(|traffic: &mut wire::ControllerTraffic| {
            traffic.entries.retain_mut(|entry| {
                if entry.kind == wire::TrafficEntry::KIND_COMMAND {
                    // What is numbered must stay numbered.
                    entry.kind = wire::TrafficEntry::KIND_TIMER;
                    entry.data.clear();
                }
                true
            });
            true
        });
    };
    let ran = after(unasked, Form::OURS, &["--level", "driver"]).expect(1);
    ran.says(&["DIFFERENT", "were recorded"]);
}

#[test]
fn a_record_that_stops_in_mid_run_is_refused_whatever_it_says_of_itself() {
    for folder in std::fs::read_dir(golden("")).expect("bags/") {
        let folder = folder.expect("an entry").path();
        if !folder.is_dir() || folder.ends_with("rs274_older_definitions") {
            continue;
        }
        let whole = TestBag::read(&folder);
        let is_end = |status: &GoalStatusArray| {
            status
                .status_list
                .last()
                .is_some_and(|goal| goal.status >= GoalStatus::STATUS_SUCCEEDED)
        };
        let topic = whole.goals();
        let of_goals = whole.messages.iter().filter(|it| it.topic == topic);
        let end = of_goals
            .filter(|it| is_end(&cnc_msgs::cdr::decode(&it.data).expect("a status")))
            .map(|it| it.log_time)
            .max()
            .expect("the goal ended");
        let times = whole.messages.iter().map(|it| it.log_time);
        let begin = times.min().expect("messages");
        for (part, form) in [(2, Form::OURS), (9, Form::OURS), (5, Form::JAZZY)] {
            let until = begin + (end - begin) * part / 10;
            let mut bag = whole.clone();
            bag.messages.retain(|it| it.log_time < until);
            bag.recount();
            let place = Folder::new();
            let path = place.path().join("bag");
            bag.write(&path, form);
            let ran = replay(&path, &[]);
            assert_eq!(ran.status, 2, "{}, {part}/10: {}", folder.display(), ran.out);
        }
        // All but what became of the goal.
        let mut bag = whole.clone();
        bag.messages.retain(|it| it.topic != topic);
        bag.recount();
        let place = Folder::new();
        let path = place.path().join("bag");
        bag.write(&path, Form::OURS);
        replay(&path, &[]).expect(2).says(&["the result of goal", "run_program/_action/status"]);
    }
}

#[test]
fn a_bag_may_end_in_the_middle_of_what_is_loaded_after_its_run() {
    let whole = TestBag::golden("rs274_stretches");
    let paths = whole.all::<wire::CompensatedPath>();
    let (Some(first), Some(last)) = (paths.first(), paths.last()) else {
        panic!("a golden bag has paths");
    };
    let replayed = |cut: &dyn Fn(&mut TestBag)| {
        let mut bag = whole.clone();
        cut(&mut bag);
        let place = Folder::new();
        let path = place.path().join("bag");
        bag.write(&path, Form::OURS);
        replay(&path, &[])
    };
    // When a run with stretches has ended, the program is published without results again.
    let (began, ended) = (first.revision, last.revision);
    for (cut, status) in [(ended, 0), (ended - 1, 2), (began, 2)] {
        let chunks = |bag: &mut TestBag| bag.change(|it: &mut wire::PathChunk| it.revision != cut);
        let reports =
            |bag: &mut TestBag| bag.change(|it: &mut wire::CompensationReport| it.revision != cut);
        let paths =
            |bag: &mut TestBag| bag.change(|it: &mut wire::CompensatedPath| it.revision != cut);
        replayed(&chunks).expect(status);
        replayed(&reports).expect(status);
        replayed(&paths).expect(status);
    }
    // It is the program of the run all the same.
    let id = &first.program_id;
    let programs = |bag: &mut TestBag| bag.change(|it: &mut wire::Program| it.program_id != *id);
    let chunks = |bag: &mut TestBag| bag.change(|it: &mut wire::ProgramChunk| it.program_id != *id);
    let contours =
        |bag: &mut TestBag| bag.change(|it: &mut wire::ContourChunk| it.program_id != *id);
    replayed(&programs).expect(2);
    replayed(&chunks).expect(2);
    replayed(&contours).expect(2);
}

/// Messages of a type that are left in a bag: those that `keeps` is true for, with their place.
fn thin<M: cnc_msgs::interface::Message>(bag: &mut TestBag, keeps: impl Fn(usize, &M) -> bool) {
    let mut index = 0;
    bag.change(|message: &mut M| {
        index += 1;
        keeps(index - 1, message)
    });
}

#[test]
fn a_state_that_the_driver_goes_through_is_missed_and_can_be_blessed() {
    type State = wire::MachineState;
    let without = |mode: u8| move |_: usize, state: &State| state.state != mode;
    for name in ["rs274_hold_and_tool_change", "sinumerik_840c_wear_correction", "alarm_door"] {
        let golden = TestBag::golden(name);
        let middle = golden.all::<State>().len() / 2;
        let one = |index: usize, _: &State| index == middle;
        type Keeps<'a> = &'a dyn Fn(usize, &State) -> bool;
        let cases: [(&str, Keeps<'_>); 4] = [
            ("all but one", &one),
            ("HOLD", &without(State::STATE_HOLD)),
            ("TOOL_CHANGE", &without(State::STATE_TOOL_CHANGE)),
            ("DOOR", &without(State::STATE_DOOR)),
        ];
        for (what, keeps) in cases {
            let folder = Folder::new();
            let path = folder.path().join("bag");
            let mut bag = golden.clone();
            thin(&mut bag, keeps);
            bag.write(&path, Form::JAZZY);
            if bag.messages.len() == golden.messages.len() {
                replay(&path, &[]).expect(0);
                continue;
            }
            let ran = replay(&path, &[]).expect(1);
            ran.says(&["DIFFERENT", "occurs now, and was not recorded here"]);
            if what != "all but one" {
                replay(&path, &["--update"])
                    .expect(0)
                    .says(&["updated; the bag is reproduced now"]);
            }
        }
    }
}

#[test]
fn a_removed_message_of_any_topic_is_reported() {
    type Keeps = fn(usize, usize) -> bool;
    let cases: [(&str, Keeps); 4] = [
        ("all", |_, _| false),
        ("the first", |index, _| index > 0),
        ("one in the middle", |index, count| index != count / 2),
        ("the last", |index, count| index + 1 < count),
    ];
    let golden = TestBag::golden("rs274_hold_and_tool_change");
    for (topic, named) in golden.topics.iter().enumerate() {
        let count = golden.messages.iter().filter(|it| it.topic == topic).count();
        for (what, keeps) in cases {
            let mut bag = golden.clone();
            let mut index = 0;
            bag.messages.retain(|it| {
                index += usize::from(it.topic == topic);
                it.topic != topic || keeps(index - 1, count)
            });
            let folder = Folder::new();
            let path = folder.path().join("bag");
            bag.write(&path, Form::OURS);
            let ran = replay(&path, &[]);
            assert_eq!(ran.status, 2, "{what} of {}: {}", named.name, ran.out);
            ran.says(&[&format!("{} has ", named.name), "the recorder wrote"]);
        }
    }
}
