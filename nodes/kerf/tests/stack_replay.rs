//! Recorded runs on the whole stack again: processes, DDS, the virtual controller.

#[path = "support/bag.rs"]
#[allow(dead_code, reason = "each test program uses its part")]
mod bag;
#[path = "support/machine.rs"]
#[allow(dead_code, reason = "each test program uses its part")]
mod machine;
#[path = "stack_replay/port.rs"]
mod port;
mod support;

use bag::{Form, TestBag, golden};
use cnc_msgs::wire::cnc_msgs::msg::{
    ControllerTraffic, MachineState, NodeParameters, Program, ProgramChunk, TrafficEntry,
};
use cnc_msgs::wire::rcl_interfaces::msg::ParameterValue;
use machine::{Machine, processes, until};
use port::SilentPort;
use rustix::process::{Pid, Signal, kill_process};
use std::process::{Child, Stdio};
use std::time::Duration;
use support::{CONTOUR, Folder, Ran, kerf, number, run};

/// `kerf replay BAG --level stack`, and that nothing of it is left.
#[track_caller]
fn replayed(arguments: &[&str]) -> Ran {
    let mut command = kerf();
    // Whatever the caller's environment says, no machine of his is met.
    command.env("ROS_DOMAIN_ID", "7").env("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET");
    let child = command
        .args(["replay", "--level", "stack"])
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command can be started");
    let id = child.id();
    let out = child.wait_with_output().expect("it ends by itself");
    nothing_is_left(id);
    let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
    Ran { status: number(out.status), out: text(out.stdout), err: text(out.stderr) }
}

/// Nodes of a replay, by the id of its process.
fn nodes_of(id: u32) -> Vec<(Pid, String)> {
    processes(&[format!("__ns:=/kerf_replay_{id}_")])
}

#[track_caller]
fn nothing_is_left(id: u32) {
    until("the end of all nodes", || nodes_of(id).is_empty().then_some(()));
    let mark = format!("kerf-replay-{id}-");
    let left = std::fs::read_dir(std::env::temp_dir()).expect("a folder");
    let names = left.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
    let left: Vec<String> = names.filter(|name| name.starts_with(&mark)).collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn golden_bags_are_reproduced_one_after_the_other() {
    let folder = Folder::new();
    let out = folder.path().join("out");
    let bags = ["sinumerik_840c_contour", "rs274_hold_and_tool_change", "sinumerik_840c_canceled"]
        .map(|name| golden(name).display().to_string());
    let ran = replayed(&[&bags[0], &bags[1], &bags[2], "--out", &out.display().to_string()]);
    let ran = ran.expect(0).says(&[
        "24 lines to the controller",
        "feed_hold (line 9)",
        "resume (line 9)",
        "1 programmed_contour",
        "1 compensated_path",
    ]);
    for bag in &bags {
        assert!(ran.out.contains(&format!("{bag}: reproduced")), "{}", ran.out);
    }
    // The new bags are whole bags: they replay as any other.
    for name in ["sinumerik_840c_contour_stack", "rs274_hold_and_tool_change_stack"] {
        let kept = std::fs::read_dir(out.join(name)).expect("a folder").flatten();
        let kept: Vec<String> = kept.map(|bag| bag.path().display().to_string()).collect();
        assert_eq!(kept.len(), 1, "{kept:?}");
        run(kerf().args(["bag", "info", &kept[0]])).expect(0).says(&["complete:    yes"]);
        run(kerf().args(["replay", &kept[0]])).expect(0).says(&["reproduced"]);
    }
}

/// A bag that was recorded otherwise.
fn altered(folder: &Folder, change: impl FnOnce(&mut TestBag)) -> String {
    let mut bag = TestBag::golden("automation1_calls");
    change(&mut bag);
    let path = folder.path().join("altered");
    bag.write(&path, Form::OURS);
    path.display().to_string()
}

fn change_parameter(bag: &mut TestBag, name: &str, change: impl Fn(&mut ParameterValue)) {
    bag.change(|node: &mut NodeParameters| {
        node.parameters
            .iter_mut()
            .filter(|row| row.name == name)
            .for_each(|it| change(&mut it.value));
        true
    });
}

#[test]
fn another_program_is_different_and_reported_with_its_place() {
    let folder = Folder::new();
    let path = altered(&folder, |bag| {
        let chunks: Vec<ProgramChunk> = bag.all();
        let text = String::from_utf8(chunks[0].data.clone()).expect("a text");
        let other = text.replace("X80", "X79");
        assert_ne!(text, other, "the program goes to X80");
        bag.change(|program: &mut Program| {
            program.sha256 = cnc_msgs::chunk::sha256_hex(other.as_bytes());
            program.size = other.len() as u64;
            true
        });
        bag.change(|chunk: &mut ProgramChunk| {
            chunk.data = other.clone().into_bytes();
            chunk.crc32 = cnc_msgs::chunk::crc32(&chunk.data);
            true
        });
    });
    replayed(&[&path]).expect(1).says(&[
        "DIFFERENT",
        "programmed_contour/chunks 0",
        "line 11",
        "to the controller",
        "X80",
        "last position",
    ]);
}

#[test]
fn another_parameter_of_the_driver_is_different_from_the_first_line_on() {
    let folder = Folder::new();
    let path = altered(&folder, |bag| {
        change_parameter(bag, "line_numbers", |value| value.bool_value = true);
    });
    replayed(&[&path]).expect(1).says(&["DIFFERENT", "1 difference", "line 1 to the controller"]);
}

#[test]
fn what_is_missing_or_cannot_be_played_is_named() {
    let folder = Folder::new();
    let none = altered(&folder, |bag| {
        bag.forget::<Program>();
        bag.forget::<ProgramChunk>();
    });
    replayed(&[&none]).expect(2).says(&["cnc_msgs/msg/Program ", &none]);

    // What the controller says in the middle of the run.
    for (received, says) in [
        ("ALARM:1\r\n", "the bag holds an ALARM:1 at line "),
        ("error:20\r\n", "the bag holds an error:20 of the controller at line "),
        ("<Door:0|MPos:0,0,0|FS:0,0>\r\n", "the bag holds an opened door at line "),
        ("\r\nGrbl 1.1h ['$' for help]\r\n", "the bag holds a controller that"),
    ] {
        let report = |entry: &TrafficEntry| {
            entry.kind == TrafficEntry::KIND_RECEIVED && entry.data.starts_with(b"<Run")
        };
        let altered = altered(&folder, |bag| {
            bag.change(|traffic: &mut ControllerTraffic| {
                for entry in traffic.entries.iter_mut().filter(|entry| report(entry)) {
                    entry.data = received.into();
                }
                true
            });
        });
        replayed(&[&altered]).expect(2).says(&[says, "which the stack level does not play"]);
    }

    let lost = altered(&folder, |bag| {
        bag.change(|state: &mut MachineState| {
            if state.path_revision > 0 {
                state.reason = "LINK_LOST: the controller does not answer".into();
            }
            true
        });
    });
    replayed(&[&lost]).expect(2).says(&["the bag holds a lost link at line "]);
}

#[test]
fn the_port_of_the_recording_is_never_opened() {
    let folder = Folder::new();
    let mut port = SilentPort::open();
    let name = port.path().display().to_string();
    let path = altered(&folder, |bag| {
        change_parameter(bag, "port", |value| value.string_value.clone_from(&name));
    });
    replayed(&[&path]).expect(0).says(&["reproduced"]);
    assert_eq!(port.openings(), 0, "the machine's port was opened");
}

#[test]
fn a_hold_overrides_and_a_cancel_come_to_their_places_again() {
    let machine = Machine::virtual_one(3);
    let moves: String = (0..8).map(|_| "G1 X110\nG1 X10\n").collect();
    let text = format!("G21 G90 G94 G17\nG0 X10 Y10\nF1200\n{moves}M30\n");
    machine.folder.file("slow.ngc", text);
    let running = machine.kerf_meanwhile(&["run", "slow.ngc"]);
    machine.until_state("RUN");
    machine.kerf(&["hold"]).expect(0);
    machine.until_state("HOLD");
    machine.kerf(&["override", "--feed", "150"]).expect(0);
    machine.kerf(&["resume"]).expect(0);
    machine.until_state("RUN");
    machine.kerf(&["abort"]).expect(0);
    running.join().expect("it only runs a command").expect(4);
    let bag = machine.until_bags(1).remove(0).display().to_string();
    let ran = replayed(&[&bag]).expect(0).says(&["reproduced", "5 commands"]);
    for what in ["feed_hold", "set_overrides", "resume", "cancel of run_program"] {
        assert!(ran.err.contains(what), "{what} was not given: {}", ran.err);
    }
}

#[test]
fn wear_that_is_entered_in_a_hold_is_entered_there_again() {
    let folder = Folder::new();
    let tools = folder.file("tools.yaml", "offsets:\n  1: {radius_mm: 5.0}\n");
    let tools = format!("compensation_planner:tool_table:={}", tools.display());
    let own = [&machine::SLOW_POLLING[..], &["-p", &tools]].concat();
    let machine = Machine::virtual_with(4, &own);
    let running = machine.kerf_meanwhile(&["run", CONTOUR, "--control", "sinumerik_840c"]);
    machine.until_state("RUN");
    machine.kerf(&["hold"]).expect(0);
    machine.until_state("HOLD");
    machine.kerf(&["tool", "D1", "--wear", "-0.2"]).expect(0).says(&["in the running program"]);
    machine.kerf(&["resume"]).expect(0);
    running.join().expect("it only runs a command").expect(0);
    let bag = machine.until_bags(1).remove(0).display().to_string();
    replayed(&[&bag]).expect(0).says(&["reproduced", "2 compensated_path,", "set_tool"]);
}

/// A replay in progress.
struct UnderWay(Child);

impl UnderWay {
    fn start() -> Self {
        let child = kerf()
            .args(["replay", "--level", "stack"])
            .arg(golden("rs274_hold_and_tool_change"))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        Self(child.expect("the command can be started"))
    }

    /// Waits until all four nodes are there.
    fn until_nodes(&self) {
        until("the nodes", || (nodes_of(self.0.id()).len() == 4).then_some(()));
    }

    fn end(&mut self, signal: Signal) -> i32 {
        kill_process(Pid::from_child(&self.0), signal).expect("it is there");
        let ended = until("the end of the replay", || self.0.try_wait().expect("our child"));
        number(ended)
    }
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn ctrl_c_leaves_nothing_running_nor_lying_about() {
    for wait in [Duration::ZERO, Duration::from_millis(2500)] {
        let mut replay = UnderWay::start();
        replay.until_nodes();
        // What is asserted holds at any moment of it.
        std::thread::sleep(wait);
        assert_eq!(replay.end(Signal::INT), 4);
        nothing_is_left(replay.0.id());
    }
}

#[test]
fn nodes_leave_when_the_replay_is_killed() {
    let mut replay = UnderWay::start();
    replay.until_nodes();
    let id = replay.0.id();
    assert_eq!(replay.end(Signal::KILL), 128 + 9);
    until("the end of all nodes", || nodes_of(id).is_empty().then_some(()));
    // Its folder could not go with it.
    let folder = std::env::temp_dir().join(format!("kerf-replay-{id}-0"));
    std::fs::remove_dir_all(folder).expect("it is still there");
}
