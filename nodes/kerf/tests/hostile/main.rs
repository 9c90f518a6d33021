//! Nodes that are stopped and continued, killed, or sent packets of RTPS with numbers beyond all measure:
//! the stack answers again. On the loopback interface alone.

#![allow(clippy::print_stderr, reason = "what was measured is in the log of the tests")]

#[path = "../support/machine.rs"]
#[allow(dead_code, reason = "each test program uses its part")]
mod machine;
mod rtps;
#[path = "../support/mod.rs"]
mod support;
mod systemd;

use axis_driver::motion::ask_operator;
use axis_driver::protocol::Wish;
use machine::{Machine, SLOW_POLLING, kill_at_once, until};
use rtps::{PACKETS, Random, participants, send, socket};
use runtime::environment::Environment;
use runtime::names::{Names, Remap};
use rustix::process::{Pid, Signal, kill_process};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use support::{CONTOUR, Folder, number};

const NODES: [&str; 4] = ["program_loader", "compensation_planner", "axis_driver", "run_recorder"];
/// More than any node takes that has one small program; they have some 50.
const AT_REST_MB_MAX: u64 = 300;
/// Packets of one fuzz run, unless `KERF_FUZZ_PACKETS` says otherwise.
const FUZZ_PACKETS: usize = 2_000;

fn stop_and_continue(id: Pid) {
    kill_process(id, Signal::STOP).expect("the process is there");
    std::thread::sleep(Duration::from_millis(200));
    kill_process(id, Signal::CONT).expect("the process is there");
}

/// The process of a node that uses DDS: for the driver its ROS side.
fn dds_process(machine: &Machine, name: &str) -> Option<Pid> {
    let name = format!(" {name} ");
    let is_wanted = |line: &str| {
        line.contains(&name) && (name != " axis_driver " || line.starts_with("axis_driver-ros"))
    };
    machine.nodes().iter().find(|(_, line)| is_wanted(line)).map(|(id, _)| *id)
}

/// Waits until another process has the place of this one.
#[track_caller]
fn until_another(machine: &Machine, name: &str, old: Pid) -> Pid {
    until("another process", || dds_process(machine, name).filter(|id| *id != old))
}

/// Waits until the driver answers to a hold, whatever it says.
#[track_caller]
fn until_holdable(machine: &Machine) -> Duration {
    let began = Instant::now();
    until("an answer to hold", || (machine.kerf(&["hold"]).status != 3).then_some(()));
    began.elapsed()
}

/// Holds the machine without ROS, whatever has become of the nodes.
#[track_caller]
fn hold_within_a_second(machine: &Machine) -> Duration {
    let variables = [("ROS_DOMAIN_ID".to_owned(), machine.domain.clone())].into();
    let environment = Environment::read(&variables).expect("a domain");
    let names = Names::new("axis_driver", &[Remap::new("__ns", &machine.namespace)]);
    let began = Instant::now();
    let answer = ask_operator(&environment, &names.expect("a namespace"), Wish::FeedHold);
    let held = began.elapsed();
    assert!(answer.expect("an answer").result.is_ok());
    assert!(held < Duration::from_secs(1), "held after {held:.2?}");
    held
}

/// Loads and plans a program: loader, planner and their chunks work.
#[track_caller]
fn until_loadable(machine: &Machine) {
    until("a plan", || {
        let ran = machine.kerf(&["load", CONTOUR, "--control", "sinumerik_840c"]);
        (ran.status == 0).then_some(())
    });
}

#[test]
fn a_node_that_was_stopped_and_continued_goes_on() {
    let machine = Machine::virtual_one(4);
    let before = machine.nodes();
    for _ in 0..5 {
        for name in NODES {
            stop_and_continue(dds_process(&machine, name).expect("the node runs"));
        }
        let held = until_holdable(&machine);
        eprintln!("holdable {held:.2?} after it");
    }
    until_loadable(&machine);
    assert_eq!(machine.nodes(), before, "{}", machine.log());
}

#[test]
fn a_node_that_is_stopped_for_good_or_killed_is_replaced() {
    let mut machine = Machine::virtual_one(4);
    let (stopped, killed) = (machine.node("axis_driver"), machine.node("program_loader"));
    kill_process(stopped, Signal::STOP).expect("the process is there");
    kill_at_once(killed);
    let began = Instant::now();
    until_another(&machine, "program_loader", killed);
    eprintln!("killed: replaced after {:.2?}", began.elapsed());
    until("another process", || {
        machine.nodes().iter().all(|(id, _)| *id != stopped).then_some(())?;
        dds_process(&machine, "axis_driver")
    });
    eprintln!("stopped: replaced after {:.2?}", began.elapsed());
    until_holdable(&machine);
    until_loadable(&machine);
    let log = machine.log();
    assert!(log.contains("axis_driver gave no sign of life for"), "{log}");

    // A supervisor that dies leaves no child, not even a stopped one.
    kill_process(machine.node("run_recorder"), Signal::STOP).expect("the process is there");
    machine.kill();
    machine.until_gone();
}

#[test]
fn a_node_that_takes_too_much_memory_is_replaced() {
    /// Planned, they take far more than is allowed.
    const LINES: usize = 300_000;
    let bound = ["-p", "program_loader:memory_mb_max:=64"];
    let machine = Machine::virtual_with(4, &[&SLOW_POLLING[..], &bound].concat());
    let moves: Vec<String> = (0..LINES).map(|line| format!("G1 X{} F600\n", line % 90)).collect();
    machine.folder.file("long.ngc", format!("G21 G90\n{}M30\n", moves.concat()));
    let old = dds_process(&machine, "program_loader").expect("the node runs");
    let mut loading = machine.command(&["load", "long.ngc", "--control", "rs274"]);
    let mut loading = loading.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("started");
    until_another(&machine, "program_loader", old);
    let held = until_holdable(&machine);
    eprintln!("holdable {held:.2?} after a loader without memory");
    // It waits for a plan that no node makes any more.
    loading.kill().expect("our child");
    loading.wait().expect("our child");
    until_loadable(&machine);
    let log = machine.log();
    for said in ["64 MB are allowed (memory_mb_max)", "program_loader ended (exit status: 71)"] {
        assert!(log.contains(said), "{said} is not in\n{log}");
    }
}

#[test]
fn a_jog_whose_command_was_stopped_and_continued_can_still_be_stopped() {
    let machine = Machine::virtual_one(1);
    let mut jog = machine
        .command(&["jog", "X300", "--feed", "600"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("kerf can be started");
    machine.until_state("JOG");
    stop_and_continue(Pid::from_child(&jog));
    kill_process(Pid::from_child(&jog), Signal::INT).expect("the process is there");
    let began = Instant::now();
    let status = until("the end of the jog", || jog.try_wait().expect("our child"));
    eprintln!("canceled within {:.2?}", began.elapsed());
    let said = jog.wait_with_output().expect("it has ended").stderr;
    let said = String::from_utf8_lossy(&said);
    assert!(number(status) == 4 && !said.contains("reconnecting"), "{said}");
    let status = machine.until_state("IDLE");
    assert!(!status.contains("X300.000"), "{status}");
}

/// Each of them stopped, filled or occupied the DDS layer before it was mended.
#[test]
fn a_packet_with_numbers_beyond_all_measure_stops_no_node() {
    let machine = Machine::virtual_one(4);
    let domain: u16 = machine.domain.parse().expect("a number");
    let before = machine.nodes();
    let prefixes = participants(domain, NODES.len());
    for (name, packet) in PACKETS {
        let (socket, began) = (socket(), Instant::now());
        for prefix in &prefixes {
            send(&socket, domain, &packet(*prefix));
        }
        let locally = hold_within_a_second(&machine);
        let held = until_holdable(&machine);
        eprintln!(
            "{name}: held {locally:.2?} after it without ROS, over ROS {held:.2?} after {:.2?}",
            began.elapsed()
        );
        // What hangs would be given five seconds.
        std::thread::sleep(Duration::from_secs(6));
        assert_eq!(machine.nodes(), before, "{name}: {}", machine.log());
    }
    until_loadable(&machine);
    for (id, line) in machine.nodes() {
        let megabytes = resident_mb(id).expect("the node runs");
        assert!(megabytes < AT_REST_MB_MAX, "{megabytes} MB: {line}");
    }
}

#[test]
fn random_packets_stop_no_node() {
    let count = std::env::var("KERF_FUZZ_PACKETS").ok().and_then(|text| text.parse().ok());
    let count = count.unwrap_or(FUZZ_PACKETS);
    let seed = std::env::var("KERF_FUZZ_SEED").ok().and_then(|text| text.parse().ok());
    let mut random = Random::new(seed.unwrap_or(1));
    let machine = Machine::virtual_one(4);
    let domain: u16 = machine.domain.parse().expect("a number");
    let prefixes: Vec<_> = participants(domain, NODES.len()).into_iter().collect();
    let before = machine.nodes();
    let socket = socket();
    for number in 0..count {
        send(&socket, domain, &random.packet(&prefixes));
        if number % 100 == 99 {
            hold_within_a_second(&machine);
        }
        if number % 500 == 499 {
            eprintln!("{number} packets: holdable after {:.2?}", until_holdable(&machine));
        }
    }
    until_holdable(&machine);
    until_loadable(&machine);
    assert_eq!(machine.nodes(), before, "{}", machine.log());
    for (id, line) in machine.nodes() {
        let megabytes = resident_mb(id).expect("the node runs");
        eprintln!("{megabytes} MB: {}", &line[..line.len().min(60)]);
        assert!(megabytes < AT_REST_MB_MAX, "{line}");
    }
}

/// What a process takes.
fn resident_mb(id: Pid) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{}/status", id.as_raw_nonzero())).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok().map(|kilobytes| kilobytes / 1_024)
}

#[test]
fn the_unit_for_systemd_is_one_that_systemd_understands() {
    let unit = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/systemd/kerf-node@.service");
    let unit = std::fs::read_to_string(unit).expect("the unit");
    for line in ["Type=notify", "WatchdogSec=5", "Restart=on-failure", "MemoryMax=3G"] {
        assert!(unit.lines().any(|it| it == line), "{line}");
    }
    let folder = Folder::new();
    let own = unit.replace("/usr/bin/kerf", env!("CARGO_BIN_EXE_kerf"));
    let file = folder.file("kerf-node@axis_driver.service", own);
    // Not every system has it.
    let Ok(ran) = Command::new("systemd-analyze").arg("verify").arg(file).output() else { return };
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
}
