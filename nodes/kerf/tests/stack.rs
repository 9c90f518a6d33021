//! The whole stack as people run it: real processes on the loopback interface.

#[path = "support/machine.rs"]
#[allow(dead_code, reason = "each test program uses its part")]
mod machine;
mod support;

use machine::{Machine, SLOW_POLLING, Turn, domain, kill_at_once, processes, transmitted, until};
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use support::{CONTOUR, Folder, kerf, run};

/// Twelve moves of 100 mm at 20 mm/s: a minute of machine time.
const SLOW: &str = "slow.ngc";

fn slow_program() -> String {
    let moves: String = (0..6).map(|_| "G1 X110\nG1 X10\n").collect();
    format!("G21 G90 G94 G17\nG0 X10 Y10\nF1200\n{moves}M30\n")
}

/// Fails unless the bag is whole and every core does today what it did then.
#[track_caller]
fn reproduced(machine: &Machine, bag: &Path) {
    let bag = bag.to_str().expect("a path of ours is UTF-8");
    machine.kerf(&["bag", "info", bag]).expect(0).says(&["complete:    yes"]);
    machine.kerf(&["replay", bag]).expect(0).says(&[
        "reproduced",
        "loader: 0 differences",
        "planner: 0 differences",
        "driver: 0 differences",
    ]);
}

#[test]
fn two_programs_of_one_session_make_two_bags_that_replay() {
    let machine = Machine::virtual_one(10);
    machine
        .kerf(&["load", CONTOUR, "--control", "sinumerik_840c"])
        .expect(0)
        .says(&["contour.mpf is loaded: 14 lines, and planned"]);
    machine.kerf(&["run"]).expect(0);
    machine.folder.file("two.ngc", "G21 G90\nG0 X5 Y5\nG1 X40 F600\nY30\nM30\n");
    machine.kerf(&["run", "two.ngc"]).expect(0).says(&["two.ngc is loaded: 5 lines"]);
    let status = machine.until_state("IDLE");
    assert!(status.contains("work     X40.000 Y30.000 Z50.000 mm"), "{status}");
    let bags = machine.until_bags(2);
    assert_eq!(bags.len(), 2);
    for bag in &bags {
        reproduced(&machine, bag);
    }
    let sent = transmitted(&bags[1]).concat();
    assert!(!sent.windows(4).any(|bytes| bytes == b"G2X6"), "only the second program");

    // What does not come through loader or planner moves nothing and stays refused.
    machine.folder.file("bad.ngc", "G21\nG99.7 X1\nM30\n");
    machine.kerf(&["run", "bad.ngc"]).expect(4).says(&["unknown_word", "bad.ngc:2:1"]);
    machine.folder.file("full.ngc", "G21 G17\nG41 D99 G1 X1 F100\nX30\nG40 X40\nM30\n");
    machine.kerf(&["run", "full.ngc"]).expect(4).says(&["error[", "full.ngc:2:"]);
    assert_eq!(machine.bags().len(), 2, "nothing ran, nothing was recorded");
}

#[test]
fn a_program_that_does_not_fit_the_machine_is_refused_running_or_not() {
    let boxes = Folder::new();
    let clamp =
        "keep_out:\n  left clamp: {frame: G54, min_mm: [50, -5, -99], max_mm: [60, 5, 99]}\n";
    boxes.file("clamps.yaml", clamp);
    let file = format!("axis_driver:keep_out:={}", boxes.path().join("clamps.yaml").display());
    let judged = ["-p", &file, "-p", "axis_driver:check_travel:=refuse"];
    let machine = Machine::virtual_with(10, &[&SLOW_POLLING[..], &judged].concat());
    machine.folder.file("far.ngc", "G21 G90\nG0 X0 Y0\nG1 X5000 F600\nM30\n");
    let far = ["line 3", "needs 5000.000 mm in X", "($130)"];
    machine.kerf(&["run", "far.ngc"]).expect(4).says(&far);
    machine.folder.file("through.ngc", "G21 G90\nG0 X0 Y0\nG1 X100 F600\nM30\n");
    let hit = ["line 3", "touches the keep-out \"left clamp\"", "X50.000"];
    machine.kerf(&["run", "through.ngc"]).expect(4).says(&hit);
    machine.folder.file("beside.ngc", "G21 G90\nG0 X0 Y6\nG1 X100 F2000\nM30\n");
    machine.kerf(&["run", "beside.ngc"]).expect(0);

    let dumped = machine.kerf(&["controller", "dump"]).expect(0).says(&["firmware: \"grbl\""]).out;
    machine.folder.file("mill.yaml", dumped);
    let plan = |program: &str| machine.kerf(&["plan", program, "--machine", "mill.yaml"]);
    plan("far.ngc").expect(1).says(&["error[travel]", "far.ngc:3:1", "needs 5000.000 mm in X"]);
    plan("beside.ngc").expect(0).says(&["fits the machine of mill.yaml (grbl); takes "]);
}

#[test]
fn a_run_can_be_held_resumed_and_aborted() {
    let machine = Machine::virtual_one(8);
    machine.folder.file(SLOW, slow_program());
    let running = machine.kerf_meanwhile(&["run", SLOW]);
    machine.until_state("RUN");
    machine.kerf(&["hold"]).expect(0);
    let status = machine.until_state("HOLD");
    assert!(status.contains("% of the run done, "), "{status}");
    // Nothing resumes by itself.
    assert_eq!(machine.until_state("HOLD").lines().nth(1), status.lines().nth(1));
    machine.kerf(&["run", SLOW]).expect(4);
    machine.kerf(&["resume"]).expect(0);
    running.join().expect("it only runs a command").expect(0).says(&["done"]);

    let running = machine.kerf_meanwhile(&["run", SLOW]);
    machine.until_state("RUN");
    machine.kerf(&["abort"]).expect(0);
    running.join().expect("it only runs a command").expect(4).says(&["line "]);
    machine.until_state("IDLE");
    for bag in machine.until_bags(2) {
        reproduced(&machine, &bag);
    }
}

#[test]
fn ctrl_c_holds_the_machine_closes_the_bag_and_leaves_nothing() {
    let mut machine = Machine::virtual_one(2);
    machine.folder.file(SLOW, slow_program());
    let running = machine.kerf_meanwhile(&["run", SLOW]);
    machine.until_state("RUN");
    assert_eq!(machine.interrupt(), 0);
    machine.until_gone();
    running.join().expect("it only runs a command").expect(4);
    let bags = machine.until_bags(1);
    let bag = bags[0].to_str().expect("UTF-8");
    machine.kerf(&["bag", "info", bag]).expect(0).says(&["complete:    yes"]);
    let ended = "result:      aborted (314)";
    machine.kerf(&["bag", "info", bag]).says(&[ended]);
    machine.kerf(&["replay", bag]).expect(0).says(&["driver: 0 differences"]);
    let sent = transmitted(&bags[0]);
    assert!(sent.iter().any(|bytes| bytes.contains(&b'!')), "no hold was sent: {sent:?}");
}

#[test]
fn a_recorder_that_is_killed_loses_a_second_and_not_the_run() {
    let machine = Machine::virtual_one(6);
    machine.folder.file(SLOW, slow_program());
    let running = machine.kerf_meanwhile(&["run", SLOW]);
    machine.until_state("RUN");
    let bag = until("a bag", || machine.bags().pop());
    // What is asserted is how much of these seconds is kept.
    std::thread::sleep(Duration::from_secs(3));
    let now = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970").as_nanos();
    kill_at_once(machine.node("run_recorder"));
    running.join().expect("it only runs a command").expect(0);

    let path = bag.to_str().expect("UTF-8");
    let ran = machine.kerf(&["bag", "info", path, "--json"]).expect(2);
    assert!(ran.err.contains("_0.mcap"), "{}", ran.err);
    let info: serde_json::Value = serde_json::from_str(&ran.out).expect("one JSON object");
    assert_eq!(info["complete"], false);
    let number = |key: &str| u128::from(info[key].as_u64().expect("a number"));
    let end = number("start_ns") + number("duration_ns");
    assert!(end + 2_000_000_000 > now, "the last {} s are lost", (now - end) as f64 / 1e9);
    machine.kerf(&["bag", "recover", path, "mended"]).expect(0).says(&["messages"]);
    machine.kerf(&["bag", "info", "mended"]).says(&["machine_state"]);

    // The one that was started in its place has the run from the driver's memory, and says
    // that it has not received the others.
    assert!(machine.log().contains("run_recorder ended"), "{}", machine.log());
    let second = until("the second bag", || {
        let bags = machine.bags();
        bags.into_iter().find(|other| *other != bag && other.join("metadata.yaml").exists())
    });
    let second = second.to_str().expect("UTF-8");
    let late = "recorded only from here on";
    machine.kerf(&["bag", "info", second]).expect(1).says(&["complete:    no", late]);
    machine.kerf(&["replay", second]).expect(0).says(&["reproduced", "driver: 0 differences"]);
}

#[test]
fn a_driver_that_is_killed_finds_the_machine_held_and_its_bag_says_so() {
    let machine = Machine::virtual_one(2);
    machine.folder.file(SLOW, slow_program());
    let running = machine.kerf_meanwhile(&["run", SLOW]);
    machine.until_state("RUN");
    until("a bag", || machine.bags().pop());
    kill_at_once(machine.node("axis_driver"));
    let status = machine.until_state("HOLD");
    assert!(status.contains("DRIVER_RESTARTED"), "{status}");
    running.join().expect("it only runs a command").expect(4).says(&["restarted"]);
    machine.kerf(&["run", SLOW]).expect(4).says(&["DRIVER_RESTARTED"]);
    let bag = machine.until_bags(1).remove(0);
    let bag = bag.to_str().expect("UTF-8");
    let why = "the driver was started again in the middle of the run";
    machine.kerf(&["bag", "info", bag]).expect(1).says(&[why]);
    machine.kerf(&["replay", bag]).expect(2).says(&[why]);
}

#[test]
fn a_controller_that_dies_is_never_idle_until_it_is_back() {
    let mut machine = Machine::virtual_one(2);
    machine.folder.file(SLOW, slow_program());
    let running = machine.kerf_meanwhile(&["run", SLOW]);
    machine.until_state("RUN");
    kill_at_once(machine.node("virtual_controller"));
    running
        .join()
        .expect("it only runs a command")
        .expect(4)
        .says(&["LINK_LOST", "motion may continue"]);
    reproduced(&machine, &machine.until_bags(1)[0]);
    // It is a new one, at zero; nothing resumes by itself.
    let status = machine.until_state("IDLE");
    assert!(status.contains("machine  X0.000 Y0.000"), "{status}");
    assert!(machine.log().contains("virtual_controller ended"), "{}", machine.log());
    assert_eq!(machine.interrupt(), 0);
    machine.until_gone();
}

#[test]
fn nodes_leave_when_kerf_up_is_killed() {
    let mut machine = Machine::virtual_one(1);
    // Four nodes, the ROS side of the driver, and the controller.
    assert_eq!(machine.nodes().len(), 6, "{:?}", machine.nodes());
    machine.kill();
    machine.until_gone();
}

#[test]
fn a_port_that_does_not_exist_is_reported_and_refuses_runs() {
    let turn = Turn::wait();
    let port = ["-p", "axis_driver:port:=/dev/no-such-port"];
    let mut machine = Machine::start(&domain(), "mill", &[], &port, Some(turn));
    let status = until("a state that names the port", || {
        let status = machine.kerf(&["status"]).out;
        status.contains("/dev/no-such-port").then_some(status)
    });
    assert!(status.starts_with("DISCONNECTED"), "{status}");
    assert!(status.contains("position not known"), "{status}");
    machine.folder.file("ok.ngc", "G21\nG0 X1\nM30\n");
    machine.kerf(&["run", "ok.ngc"]).expect(4).says(&["/dev/no-such-port"]);
    assert!(machine.bags().is_empty());
    assert_eq!(machine.interrupt(), 0);
    machine.until_gone();
}

#[test]
fn a_port_that_answers_garbage_is_never_idle_and_refuses_runs() {
    let turn = Turn::wait();
    let garbage = Garbage::start();
    let port = format!("axis_driver:port:={}", garbage.path);
    let mut machine = Machine::start(&domain(), "mill", &[], &["-p", &port], Some(turn));
    until("the first state", || (machine.kerf(&["status"]).status == 0).then_some(()));
    machine.folder.file("ok.ngc", "G21\nG0 X1\nM30\n");
    for _ in 0..4 {
        let status = machine.kerf(&["status"]).expect(0).out;
        let is_honest = status.starts_with("UNKNOWN") || status.starts_with("DISCONNECTED");
        assert!(is_honest && status.contains("position not known"), "{status}");
        machine.kerf(&["run", "ok.ngc"]).expect(4);
    }
    assert!(machine.bags().is_empty());
    assert_eq!(machine.interrupt(), 0);
    machine.until_gone();
}

#[test]
fn a_program_runs_over_each_network_cable_and_its_bag_replays() {
    for scheme in ["tcp", "ws", "rfc2217"] {
        let free = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        let url = format!("{scheme}://{}", free.local_addr().expect("an address"));
        drop(free);
        let turn = Turn::wait();
        let args = ["--virtual-controller", "--time-factor", "10", "--listen", &url];
        let mut machine = Machine::start(&domain(), scheme, &args, &SLOW_POLLING, Some(turn));
        machine.until_state("IDLE");
        machine.folder.file("part.ngc", "G21 G90\nG0 X11\nG1 X12 Y5 F600\nM30\n");
        machine.kerf(&["run", "part.ngc"]).expect(0);
        assert!(machine.until_state("IDLE").contains("work     X12.000"), "{scheme}");
        reproduced(&machine, &machine.until_bags(1)[0]);
        assert_eq!(machine.interrupt(), 0, "{scheme}");
        machine.until_gone();
    }
}

#[test]
fn two_machines_of_one_domain_do_not_receive_from_each_other() {
    let turn = Turn::wait();
    let domain = domain();
    let args = ["--virtual-controller", "--time-factor", "10"];
    let left = Machine::start(&domain, "left", &args, &[], Some(turn));
    let right = Machine::start(&domain, "right", &args, &[], None);
    left.until_state("IDLE");
    right.until_state("IDLE");
    left.folder.file("left.ngc", "G21 G90\nG0 X11\nG1 X12 F600\nM30\n");
    right.folder.file("right.ngc", "G21 G90\nG0 X21\nG1 X22 F600\nM30\n");
    left.kerf(&["load", "left.ngc"]).expect(0);
    right.kerf(&["load", "right.ngc"]).expect(0);
    left.kerf(&["run"]).expect(0);
    let status = left.until_state("IDLE");
    assert!(status.contains("work     X12.000"), "{status}");
    let status = right.until_state("IDLE");
    assert!(status.contains("work     X0.000"), "{status}");
    let bags = left.until_bags(1);
    reproduced(&left, &bags[0]);
    assert!(right.bags().is_empty(), "the other machine did not run");
    let info = left.kerf(&["bag", "info", bags[0].to_str().expect("UTF-8")]).expect(0);
    assert!(!info.out.contains(&right.namespace), "{}", info.out);
    right.kerf(&["run"]).expect(0);
    assert!(right.until_state("IDLE").contains("work     X22.000"));
    reproduced(&right, &right.until_bags(1)[0]);
    assert_eq!(left.bags().len(), 1);
}

#[test]
fn the_demo_ends_with_three_lines_and_leaves_nothing() {
    let _turn = Turn::wait();
    let folder = Folder::new();
    let domain = domain();
    let demo = |args: &[&str]| {
        run(kerf().env("ROS_DOMAIN_ID", &domain).current_dir(folder.path()).arg("demo").args(args))
    };
    let ran = demo(&["--out", "out"]).expect(0);
    let lines: Vec<&str> = ran.out.lines().rev().take(3).collect();
    assert_eq!(lines[0], "replay:  reproduced the run");
    let path = |line: &str, key: &str| {
        let path = line.strip_prefix(key).expect(key).trim().to_owned();
        assert!(Path::new(&path).exists(), "{path}");
        path
    };
    let picture = path(lines[1], "picture:");
    assert!(picture.ends_with(".svg"), "{picture}");
    let bag = path(lines[2], "bag:");
    run(kerf().args(["replay", &bag])).expect(0);

    folder.file("file", "");
    let ran = demo(&["--out", "file/out"]);
    ran.expect(2).says(&["file/out", "Not a directory"]);
    // A step that fails in the middle is named, and everything is stopped all the same.
    let wrong = ["--out", "out", "--ros-args", "-p", "program_loader:frame_id:=5"];
    demo(&wrong).expect(4).says(&["starting the nodes", "program_loader", "ended by itself"]);

    let left = processes(&[folder.path().display().to_string()]);
    assert!(left.is_empty(), "{left:?}");
    let own = std::fs::read_dir(std::env::temp_dir()).expect("a folder").flatten();
    let links: Vec<_> = own
        .filter(|entry| entry.file_name().to_string_lossy().starts_with("kerf-demo-"))
        .filter(|entry| !entry.path().exists())
        .collect();
    assert!(links.is_empty(), "links that lead nowhere: {links:?}");
}

/// A serial line that says nothing but noise.
struct Garbage {
    path: String,
    stop: std::sync::Arc<std::sync::atomic::AtomicBool>,
}

impl Garbage {
    fn start() -> Self {
        use serialport::{SerialPort, TTYPort};
        use std::io::{Read, Write};
        use std::sync::atomic::Ordering;
        let (mut controller, slave) = TTYPort::pair().expect("a pseudo-terminal");
        let path = slave.name().expect("it has a name");
        let stop = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
        let shared = std::sync::Arc::clone(&stop);
        controller.set_timeout(Duration::from_millis(10)).expect("a timeout");
        std::thread::spawn(move || {
            // The slave stays open, so that the line does not hang up.
            let _slave = slave;
            let mut seed = 0x2545_f491_4f6c_dd1d_u64;
            while !shared.load(Ordering::Relaxed) {
                let noise: Vec<u8> = (0..48)
                    .map(|_| {
                        seed ^= seed << 13;
                        seed ^= seed >> 7;
                        seed ^= seed << 17;
                        (seed >> 32) as u8
                    })
                    .collect();
                // Full or empty, it continues.
                let _ = controller.write(&noise);
                let _ = controller.read(&mut [0; 256]);
            }
        });
        Self { path, stop }
    }
}

impl Drop for Garbage {
    fn drop(&mut self) {
        self.stop.store(true, std::sync::atomic::Ordering::Relaxed);
    }
}

#[test]
fn a_program_that_was_planned_with_another_tool_is_judged_anew() {
    let folder = Folder::new();
    let tools = folder.file("tools.yaml", "tools:\n  1: {diameter_mm: 7.0}\n");
    let table = format!("compensation_planner:tool_table:={}", tools.display());
    let machine = Machine::virtual_with(10, &["-p", &table]);
    // A slot 8 mm wide.
    let program = "G21 G90 G17\nT1 M6\nG0 X-30 Y20\nG41 D1 G1 X-30 Y0 F500\nX0\nY-10\nX-20\nY-40\n\
                   X40\nY-10\nX8\nY0\nX60\nG40 X60 Y30\nM2\n";
    machine.folder.file("slot.ngc", program);
    machine.kerf(&["load", "slot.ngc"]).expect(0);
    // What would cut into the program that is loaded is refused.
    machine.kerf(&["tool", "T1", "--diameter", "10"]).expect(4).says(&["cuts 2.0000 mm"]);
    machine.kerf(&["load", "slot.ngc", "--interference", "ignore"]).expect(0);
    machine.kerf(&["tool", "T1", "--diameter", "10"]).expect(0);
    machine.kerf(&["load", "slot.ngc"]).expect(4).says(&["cuts 2.0000 mm"]);
    machine.kerf(&["load", "slot.ngc", "--interference", "trim"]).expect(0);
}
