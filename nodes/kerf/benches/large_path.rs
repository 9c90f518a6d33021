//! A path of a million elements, and a subscriber that joins late.
//!
//! ```text
//! cargo bench -p kerf --bench large_path                        1 M elements
//! cargo bench -p kerf --bench large_path -- --elements 100000   fewer
//! cargo bench -p kerf --bench large_path -- --test              20 000
//! ```
//!
//! A whole machine of real processes loads and plans a program. Then a new subscriber requests the
//! path: the latched manifest, and the chunks by service. The bench measures the time from joining
//! the domain to the whole path, and the memory of each process. Then the same program is loaded
//! again, while a subscriber to every chunk is stopped (SIGSTOP): the driver must have its path as
//! soon as before.

#![allow(clippy::print_stdout)]

mod rig;

use cnc_msgs::chunk::Collector;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use cnc_msgs::wire::cnc_msgs::srv::{GetPathChunks, GetPathChunksRequest};
use rig::machine::{Machine, domain};
use rig::memory::resident_mb;
use rig::support::kerf;
use rig::whole::spiral_program;
use rig::{Arguments, load};
use runtime::chunks::pull;
use runtime::configuration::Configuration;
use runtime::{Qos, Session};
use rustix::process::{Pid, Signal, kill_process};
use std::collections::BTreeMap;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Set in the process of this program that is the stopped subscriber.
const ROLE: &str = "KERF_BENCH_LISTENS";
/// How long a path may take to arrive.
const WITHIN: Duration = Duration::from_secs(600);
/// With a stopped subscriber, the noise of the host may make it this much slower.
const SLOWER_MAX: f64 = 1.5;

fn main() {
    if let Ok(role) = std::env::var(ROLE) {
        return listen(&role);
    }
    let arguments = Arguments::read();
    let elements: usize = arguments.value("--elements", 1_000_000, 20_000);
    let machine = Machine::start(&domain(), "large", &["--virtual-controller"], &[], None);
    machine.until_state("IDLE");
    println!("{elements} elements, {}\n", load());
    let nodes = ["program_loader", "compensation_planner", "axis_driver", "run_recorder"];
    let memory = |when: &str| {
        for name in nodes {
            let id = machine.node(name).as_raw_nonzero().get().unsigned_abs();
            println!("{name:>21} {when}: {:.0} MB", resident_mb(id).unwrap_or(f64::NAN));
        }
    };
    memory("before");
    let alone = load_and_plan(&machine, elements);
    println!("loaded, planned and with the driver after {:.1} s", alone.as_secs_f64());
    memory("after");

    let own = || resident_mb(std::process::id()).unwrap_or(f64::NAN);
    let before = own();
    let (times, path) = join_late(&machine);
    println!("\na cold subscriber, seconds from joining the domain:");
    println!("{:>21}  {:.2}", "manifest", times[0].as_secs_f64());
    println!("{:>21}  {:.2}", "all chunks", times[1].as_secs_f64());
    println!("{:>21}  {:.2}", "checked and whole", times[2].as_secs_f64());
    println!("{:>21}  {:.0} MB", "memory", own() - before);
    assert!(path.elements.len() >= elements, "{} elements", path.elements.len());
    drop(path);

    let listener = Command::new(std::env::current_exe().expect("this program"))
        .env(ROLE, format!("{} {}", machine.domain, machine.namespace))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .spawn();
    let mut listener = listener.expect("a listener");
    std::thread::sleep(Duration::from_secs(2));
    let pid = Pid::from_child(&listener);
    let stopping = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(500));
        kill_process(pid, Signal::STOP).expect("it is there");
    });
    let with_subscriber = load_and_plan(&machine, elements + 1);
    stopping.join().expect("it only waits");
    println!("\nwith a stopped subscriber: {:.1} s", with_subscriber.as_secs_f64());
    memory("with it");
    // The last chunk has gone out on the topic; nobody received it.
    std::thread::sleep(Duration::from_millis(elements as u64 / 30));
    memory("after the topic");
    let _ = listener.kill();
    let _ = listener.wait();
    let slower = with_subscriber.as_secs_f64() / alone.as_secs_f64();
    assert!(arguments.is_test() || slower < SLOWER_MAX, "{slower:.2} times as long");
}

/// Loads a program; returns the time until the driver has the path.
fn load_and_plan(machine: &Machine, elements: usize) -> Duration {
    let program = spiral_program(elements, 0.4, 6000.0);
    let path = machine.folder.file("large.ngc", program);
    let here = || machine.log().matches("received the path of ").count();
    let (before, begin) = (here(), Instant::now());
    let status = kerf()
        .env("ROS_DOMAIN_ID", &machine.domain)
        .args(["load", path.to_str().expect("a path of ours is UTF-8")])
        .args(["--ros-args", "-r", &format!("__ns:={}", machine.namespace)])
        .status();
    assert!(status.expect("kerf can be run").success(), "{}", machine.log());
    while here() == before {
        assert!(begin.elapsed() < WITHIN, "the driver has no path: {}", machine.log());
        std::thread::sleep(Duration::from_millis(10));
    }
    begin.elapsed()
}

fn executor() -> tokio::runtime::Runtime {
    let mut builder = tokio::runtime::Builder::new_multi_thread();
    builder.worker_threads(2).enable_all().build().expect("threads")
}

fn join(domain: &str, namespace: &str) -> Session {
    let words = ["--ros-args", "-r", &format!("__ns:={namespace}")].map(String::from);
    let variables = BTreeMap::from([("ROS_DOMAIN_ID".to_owned(), domain.to_owned())]);
    let configuration = Configuration::read("late", Vec::new(), &words, &variables);
    Session::start(configuration.expect("valid")).expect("a node of our own")
}

/// The whole path, and when the manifest, the last chunk and the path were complete.
fn join_late(machine: &Machine) -> ([Duration; 3], CompensatedPath) {
    executor().block_on(async {
        let begin = Instant::now();
        let session = join(&machine.domain, &machine.namespace);
        let node = session.handle();
        let mut manifests =
            node.subscription::<wire::CompensatedPath>("compensated_path", Qos::LATCHED);
        let manifests = manifests.as_mut().expect("a subscription");
        let client = node.client::<GetPathChunks>("compensated_path/get_chunks").expect("client");
        let (manifest, _) = manifests.next().await;
        let announced = begin.elapsed();
        let mut collector = Collector::for_path(&manifest).expect("a manifest");
        let (program_id, revision) = (manifest.program_id.clone(), manifest.revision);
        let request =
            |first| GetPathChunksRequest { program_id: program_id.clone(), revision, first };
        let pulled = pull(&client, &mut collector, request, |response| {
            if response.success { Ok(response.chunks) } else { Err(response.message) }
        });
        pulled.await.expect("all chunks");
        let here = begin.elapsed();
        let path = collector.finish(&manifest).expect("a whole path");
        let times = [announced, here, begin.elapsed()];
        drop(client);
        session.stop().await;
        (times, path)
    })
}

/// Subscribes to every chunk, until it is killed.
fn listen(role: &str) {
    let (domain, namespace) = role.split_once(' ').expect("two words");
    executor().block_on(async {
        let session = join(domain, namespace);
        let mut chunks = session
            .handle()
            .subscription::<wire::PathChunk>("compensated_path/chunks", Qos::EVENTS)
            .expect("a subscription");
        loop {
            chunks.next().await;
        }
    });
}
