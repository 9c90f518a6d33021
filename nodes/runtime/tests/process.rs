//! A node as a process of its own: arguments, log, signals, exit status.
//!
//! The node is this test program, started again with a variable set.

#![allow(clippy::print_stderr, reason = "what was measured is in the log of the tests")]

mod common;

use cnc_msgs::wire::rcl_interfaces::msg::Log;
use common::{Count, PATIENCE, Text, domain, namespace, soon, start};
use runtime::parameters::Declared;
use runtime::supervision::{PANICKED, TOO_LARGE};
use runtime::{Handle, NodeError, Qos};
use std::net::UdpSocket;
use std::os::unix::net::UnixDatagram;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const IS_NODE: &str = "RUNTIME_TEST_NODE";

/// The node: publishes its greeting every 50 ms; `fault` makes it fail.
async fn node(handle: Handle) -> Result<(), NodeError> {
    let publisher = handle.publisher::<Text>("greeting", Qos::DEFAULT)?;
    match handle.parameter::<String>("fault").as_str() {
        "panic" => handle.spawn("thinker", async { panic!("no idea") }),
        "thread" => drop(handle.spawn_thread("serial", || panic!("no line"))),
        "stranger" => drop(std::thread::spawn(|| panic!("no name"))),
        // As much as there is, but not at once.
        "grow" => drop(handle.spawn_thread("grower", || {
            let mut all: Vec<Vec<u8>> = Vec::new();
            loop {
                all.push(vec![1; 1 << 20]);
                std::thread::sleep(Duration::from_millis(2));
            }
        })),
        "jump" => drop(handle.spawn_thread("jumper", || {
            // Not zeroed: the size is what counts, and it is used.
            let all = std::hint::black_box(vec![1_u8; 4 << 30]);
            panic!("{}", all.len());
        })),
        "error" => {
            let what = "the line".to_owned();
            return Err(NodeError::Stopping { what });
        }
        "deaf" => std::future::pending().await,
        "listen" => {
            let mut flood = handle.subscription::<Count>("flood", Qos::EVENTS)?;
            loop {
                tokio::select! {
                    () = handle.shutdown().requested() => return Ok(()),
                    _ = flood.next() => {}
                }
            }
        }
        _ => {}
    }
    let mut ticks = tokio::time::interval(Duration::from_millis(50));
    loop {
        tokio::select! {
            () = handle.shutdown().requested() => return Ok(()),
            _ = ticks.tick() => {
                publisher.publish(Text { data: handle.parameter("greeting") });
                tracing::info!(greeted = 1, "a greeting went out");
            }
        }
    }
}

#[test]
fn the_node_itself() {
    let Ok(words) = std::env::var(IS_NODE) else { return };
    let declared = vec![
        Declared::new("greeting", "hello", "what is said"),
        Declared::new("fault", "", "how it fails").one_of(&[
            "", "panic", "thread", "stranger", "grow", "jump", "error", "deaf", "listen",
        ]),
    ];
    let words: Vec<String> = words.split_whitespace().map(str::to_owned).collect();
    let status = runtime::run_with("greeter", declared, &words, node);
    std::process::exit(if status == std::process::ExitCode::SUCCESS {
        0
    } else if status == std::process::ExitCode::from(2) {
        2
    } else {
        1
    });
}

fn launch(words: &str, domain_id: u16) -> Child {
    command(words, domain_id).spawn().expect("starts")
}

fn command(words: &str, domain_id: u16) -> Command {
    let mut command = Command::new(std::env::current_exe().expect("this program"));
    command
        .args(["--exact", "the_node_itself", "--nocapture"])
        .env(IS_NODE, words)
        .env("ROS_DOMAIN_ID", domain_id.to_string())
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    command
}

fn signal(child: &Child, name: &str) {
    let status = Command::new("kill").args([name, &child.id().to_string()]).status();
    assert!(status.expect("kill").success());
}

/// Waits for the end, up to a time limit; status and log.
fn end_of(mut child: Child) -> (Option<i32>, String) {
    let start = Instant::now();
    while child.try_wait().expect("a child").is_none() {
        if start.elapsed() > PATIENCE {
            child.kill().expect("killed");
            panic!("the node does not end");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let Output { status, stderr, .. } = child.wait_with_output().expect("output");
    (status.code(), String::from_utf8_lossy(&stderr).into_owned())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_obeys_its_arguments_logs_to_rosout_and_ends_with_0_on_sigint() {
    let watcher = start("watcher", domain(60));
    let mut log = watcher.handle().subscription::<Log>("/rosout", Qos::ROSOUT).expect("rosout");
    let qos = Qos::DEFAULT.with_depth(1000);
    let mut greetings = watcher.handle().subscription::<Text>("moin", qos).expect("sub");
    let (namespace, left) = (namespace(), format!("{}/left", namespace()));
    let logger = left[1..].replace('/', ".");
    let words = format!(
        "--ros-args -r __ns:={namespace} -r __node:=left -r greeting:=moin \
         -p greeter:greeting:=servus"
    );
    let child = launch(&words, domain(60));
    assert_eq!(soon("a greeting", greetings.next()).await.0.data, "servus");
    loop {
        let (line, _) = soon("a line", log.next()).await;
        if line.name == logger && line.msg.contains("a greeting went out") {
            assert_eq!(
                (line.level, line.msg.as_str()),
                (Log::INFO, "a greeting went out greeted=1")
            );
            assert!(line.stamp.sec > 0 && line.file.ends_with("process.rs") && line.line > 0);
            break;
        }
    }
    signal(&child, "-INT");
    let (status, text) = tokio::task::spawn_blocking(|| end_of(child)).await.expect("ends");
    assert_eq!(status, Some(0), "{text}");
    let first = text.lines().find(|line| line.contains(&format!("{left} started"))).expect(&text);
    assert!(first.starts_with("[INFO] [") && first.contains(&format!("] [{logger}]: ")), "{first}");
    assert!(text.contains(&format!("{left} stops: SIGINT")), "{text}");
    assert!(!text.contains("ERROR"), "{text}");
    drop((log, greetings));
    watcher.stop().await;
}

#[test]
fn wrong_arguments_end_with_2_before_the_node_appears() {
    let table = [
        ("--ros-args -p prot:=x", "parameter \"prot\" is not one of this node's"),
        ("--ros-args -p greeting:=5", "write \"5\" in quotes"),
        ("--ros-args --params-file /no/such.yaml", "/no/such.yaml: No such file"),
        ("--ros-args -r __ns:=9", "begins with a digit"),
        ("--fast", "\"--fast\" is not known"),
    ];
    for (words, part) in table {
        let (status, text) = end_of(launch(words, domain(61)));
        assert_eq!(status, Some(2), "{words}: {text}");
        assert!(text.contains("greeter: ") && text.contains(part), "{text}");
    }
}

#[test]
fn a_node_that_fails_ends_with_1_and_says_why() {
    let (status, text) = end_of(launch("--ros-args -p fault:=error", domain(62)));
    assert_eq!(status, Some(1), "{text}");
    assert!(text.contains("[ERROR]") && text.contains("the line"), "{text}");
}

#[test]
fn a_panic_of_any_thread_ends_the_process() {
    let panicked = Some(i32::from(PANICKED));
    for (fault, part) in [("panic", "no idea"), ("thread", "\"serial\""), ("stranger", "no name")] {
        let (status, text) = end_of(launch(&format!("--ros-args -p fault:={fault}"), domain(62)));
        assert_eq!(status, panicked, "{fault}: {text}");
        assert!(text.contains("[FATAL]") && text.contains(part), "{fault}: {text}");
        assert!(text.contains("tests/process.rs:"), "{fault}: {text}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_that_was_stopped_and_continued_is_heard_again() {
    let listener = start("listener", domain(68));
    let node = listener.handle();
    let mut greetings = node.subscription::<Text>("greeting", Qos::DEFAULT).expect("reader");
    let mut child = launch(&format!("--ros-args -r __ns:={}", namespace()), domain(68));
    soon("a greeting", greetings.next()).await;
    for _ in 0..10 {
        signal(&child, "-STOP");
        tokio::time::sleep(Duration::from_millis(200)).await;
        signal(&child, "-CONT");
        // More than the subscription keeps from before.
        for _ in 0..15 {
            soon("a greeting", greetings.next()).await;
        }
    }
    assert!(child.try_wait().expect("a child").is_none(), "it has not been restarted");
    signal(&child, "-INT");
    let (status, text) = tokio::task::spawn_blocking(|| end_of(child)).await.expect("ends");
    assert_eq!(status, Some(0), "{text}");
    listener.stop().await;
}

#[test]
fn a_node_that_grows_ends_before_it_takes_what_others_need() {
    for (fault, ends) in [("grow", Some(i32::from(TOO_LARGE))), ("jump", None)] {
        let words = format!("--ros-args -p memory_mb_max:=256 -p fault:={fault}");
        let (status, text) = end_of(launch(&words, domain(67)));
        assert_eq!(status, ends, "{fault}: {text}");
        let part = ["256 MB are allowed (memory_mb_max)", "memory allocation of"];
        assert!(text.contains(part[usize::from(ends.is_none())]), "{fault}: {text}");
    }
}

#[test]
fn a_supervisor_hears_that_a_node_is_ready_lives_and_ends() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("notify");
    let socket = UnixDatagram::bind(&path).expect("a socket");
    socket.set_read_timeout(Some(PATIENCE)).expect("a deadline");
    let next = || {
        let mut text = [0; 256];
        let length = socket.recv(&mut text).expect("a sign of life");
        String::from_utf8_lossy(&text[..length]).into_owned()
    };
    let child = command("--ros-args", domain(68)).env("NOTIFY_SOCKET", &path).spawn();
    let child = child.expect("starts");
    let until = |wanted: &str| while !next().contains(wanted) {};
    until("READY=1");
    let began = Instant::now();
    (0..8).for_each(|_| until("WATCHDOG=1"));
    eprintln!("eight signs of life in {} ms", began.elapsed().as_millis());
    signal(&child, "-TERM");
    until("STOPPING=1");
    assert_eq!(end_of(child).0, Some(0));
}

#[test]
fn a_second_signal_ends_a_node_at_once_that_does_not_listen() {
    let child = launch("--ros-args -p fault:=deaf", domain(63));
    // It needs a moment before it listens to signals at all.
    std::thread::sleep(Duration::from_secs(2));
    signal(&child, "-TERM");
    std::thread::sleep(Duration::from_millis(300));
    signal(&child, "-TERM");
    let (status, text) = end_of(child);
    assert_eq!(status, Some(130), "{text}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_that_come_after_many_others_on_a_computer_find_each_other() {
    let _others = occupied(domain(66), 20);
    let (left, right) = (start("left", domain(66)), start("right", domain(66)));
    common::samples_pass(&left, &right, 100).await;
    left.stop().await;
    right.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_that_others_do_not_find_on_a_computer_says_what_to_do() {
    let _others = occupied(domain(64), runtime::LOOPBACK_PARTICIPANTS_MAX as u16);
    let child = launch("--ros-args", domain(64));
    tokio::time::sleep(Duration::from_secs(2)).await;
    signal(&child, "-INT");
    let (_, text) = tokio::task::spawn_blocking(|| end_of(child)).await.expect("ends");
    assert!(text.contains("this is participant 65 of ROS_DOMAIN_ID"), "{text}");
    assert!(text.contains("ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET"), "{text}");
}

/// The ports of so many participants, as if others had them.
fn occupied(domain_id: u16, participants: u16) -> Vec<UdpSocket> {
    let port = |participant| 7400 + 250 * domain_id + 10 + 2 * participant;
    let bind = |participant| UdpSocket::bind(("0.0.0.0", port(participant))).ok();
    (0..participants).filter_map(bind).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_subscriber_that_hangs_costs_samples_but_never_holds_the_publisher_up() {
    let node = start("node", domain(65));
    let flood = node.handle().publisher::<Count>("flood", Qos::DEFAULT).expect("publisher");
    let words = format!("--ros-args -r __ns:={} -p fault:=listen", namespace());
    let child = launch(&words, domain(65));
    assert!(soon("a match", flood.wait_for_subscriber(PATIENCE)).await);
    signal(&child, "-STOP");
    // More than the writer keeps for a reader that does not acknowledge.
    let publishing = tokio::task::spawn_blocking(move || {
        let sent = (0..20_000).filter(|data| flood.publish(Count { data: *data })).count();
        (sent as u64, flood)
    });
    let (sent, flood) = soon("the publisher", publishing).await.expect("no panic");
    assert!(flood.dropped() > 0 && sent + flood.dropped() == 20_000, "{sent} sent");
    signal(&child, "-KILL");
    tokio::task::spawn_blocking(|| end_of(child)).await.expect("ends");
    drop(flood);
    node.stop().await;
}

#[test]
fn a_node_whose_terminal_goes_comes_to_its_end_in_order() {
    let child = launch("--ros-args -r __node:=lonely", domain(66));
    std::thread::sleep(Duration::from_secs(2));
    signal(&child, "-HUP");
    let (status, text) = end_of(child);
    assert_eq!(status, Some(0), "{text}");
    assert!(text.contains("lonely stops: SIGHUP"), "{text}");
}
