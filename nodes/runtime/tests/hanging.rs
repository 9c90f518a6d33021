//! Processes that hang or are killed must not slow other peers.
//!
//! The peer is this test program, started again with a variable set. The traps of the
//! DDS layers, and the test that covers each:
//!
//! | trap | test |
//! |---|---|
//! | several nodes in one context: all but one never receive anything | `loopback`: every test has two nodes that find each other, each with its own context |
//! | the loopback interface carries 64 participants, the 65th is not found | `process::a_node_that_others_do_not_find_on_a_computer_says_what_to_do` |
//! | three files an endpoint: the limit of 1024 is near | `traps::a_node_may_open_more_files_than_a_shell_allows` |
//! | what was published last is lost when the process ends | `traps::what_a_node_says_last_arrives` |
//! | endpoints that are made while others are discovered deadlock the participant | `crowd` |
//! | a killed peer stays in the graph for 50 s | `a_killed_server_is_distinguished_from_one_that_answers` |
//! | calls of one client at the same time lose answers | `loopback::eight_calls_at_once_each_get_their_own_answer_in_either_mapping` |
//! | an action server blocks when two results wait, answers one client, or none | `actions` |
//! | requests in a burst are lost in a queue of one | `traps::a_burst_of_requests_for_parameters_is_answered` |
//! | "keep all" keeps 64 samples | `traps::a_burst_within_the_depth_of_a_subscription_is_whole` |
//! | 8192 samples that one reader did not acknowledge stop the topic for all | `a_subscriber_that_hangs_or_dies_leaves_the_others_what_is_published`, and `process::a_subscriber_that_hangs_costs_samples_but_never_holds_the_publisher_up` |
//! | the same for the replies to all clients of a service | `a_client_that_hangs_or_dies_leaves_the_others_their_answers` |
//! | a latched topic gives its first reader all that was ever published | `loopback::a_late_joiner_of_a_latched_topic_gets_the_newest_sample_and_no_other` |
//! | a request through the wrong mapping is garbage, not an error | `wire::tests::a_request_through_the_wrong_mapping_is_refused` |
//! | any type is matched by its topic's name | `loopback::a_sender_of_another_type_is_not_heard` |

mod common;

use common::{AddTwoInts, Count, PATIENCE, Sum, Terms, domain, namespace, soon, start};
use runtime::configuration::Configuration;
use runtime::{CallError, Qos, Session};
use std::collections::BTreeMap;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

const ROLE: &str = "RUNTIME_TEST_PEER";

/// Marks the requests of the peer.
const OF_PEER: i64 = -1;

/// The peer: in the given domain and namespace, it asks, answers or listens.
#[test]
fn the_peer_itself() {
    let Ok(words) = std::env::var(ROLE) else { return };
    let words: Vec<&str> = words.split(' ').collect();
    let [role, domain, namespace] = words[..] else { panic!("three words") };
    let executor = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .expect("threads");
    executor.block_on(async {
        let namespace = format!("__ns:={namespace}");
        let arguments = ["--ros-args", "-r", &namespace].map(str::to_owned);
        let variables = BTreeMap::from([("ROS_DOMAIN_ID".to_owned(), domain.to_owned())]);
        let configuration = Configuration::read("peer", Vec::new(), &arguments, &variables);
        let session = Session::start(configuration.expect("valid")).expect("a node");
        match role {
            "ask" => {
                let client = session.handle().client::<AddTwoInts>("add").expect("client");
                loop {
                    drop(client.call(Terms { a: OF_PEER, b: 0 }).await);
                    tokio::time::sleep(Duration::from_millis(50)).await;
                }
            }
            "answer" => {
                let answer = |terms: Terms, _| async move { Sum { sum: terms.a + terms.b } };
                session.handle().service::<AddTwoInts, _, _>("add", answer).expect("service");
                std::future::pending().await
            }
            _ => {
                let qos = Qos::EVENTS;
                let mut counts = session.handle().subscription::<Count>("count", qos).expect("sub");
                loop {
                    counts.next().await;
                }
            }
        }
    })
}

/// A peer process; killed when this is dropped.
struct Peer(Child);

impl Peer {
    fn start(role: &str, domain: u16) -> Self {
        let child = Command::new(std::env::current_exe().expect("this program"))
            .args(["--exact", "the_peer_itself", "--nocapture"])
            .env(ROLE, format!("{role} {domain} {}", namespace()))
            .stdout(Stdio::null())
            .spawn();
        Self(child.expect("starts"))
    }

    fn signal(&self, name: &str) {
        let status = Command::new("kill").args([name, &self.0.id().to_string()]).status();
        assert!(status.expect("kill").success());
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Resident memory of this process, MB.
fn resident_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("it is Linux");
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:")).expect("RssAnon");
    line.trim().trim_end_matches(" kB").parse::<f64>().expect("a number") / 1024.0
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_that_hangs_or_dies_leaves_the_others_their_answers() {
    for (offset, fate) in [(20, "-STOP"), (21, "-KILL")] {
        let (server, asker) = (start("server", domain(offset)), start("asker", domain(offset)));
        let of_peer = Arc::new(AtomicU32::new(0));
        let seen = Arc::clone(&of_peer);
        let answer = move |terms: Terms, _| {
            seen.fetch_add(u32::from(terms.a == OF_PEER), Ordering::Relaxed);
            async move { Sum { sum: terms.a + terms.b } }
        };
        server.handle().service::<AddTwoInts, _, _>("add", answer).expect("service");
        let peer = Peer::start("ask", domain(offset));
        soon("requests of the peer", async {
            while of_peer.load(Ordering::Relaxed) < 3 {
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
        })
        .await;
        peer.signal(fate);
        let client = asker.handle().client::<AddTwoInts>("add").expect("client");
        let before = resident_mb();
        // More than a writer keeps for a reader that does not acknowledge, of RustDDS and ours.
        for first in (0..10_000).step_by(20) {
            let calls = (first..first + 20).map(|a| client.call(Terms { a, b: 1 }));
            let answers = futures::future::join_all(calls).await;
            for (a, answer) in (first..).zip(answers) {
                assert_eq!(answer.map(|sum| sum.sum), Ok(a + 1), "{fate}, call {a}");
            }
        }
        let grown = resident_mb() - before;
        assert!(grown < 64.0, "{fate}: {grown} MB more");
        drop((client, peer));
        server.stop().await;
        asker.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_subscriber_that_hangs_or_dies_leaves_the_others_what_is_published() {
    // At the 100 messages a second that no topic exceeds, for the 50 s until the lease ends.
    const COUNT: u32 = 5000;
    for (offset, fate) in [(22, "-STOP"), (23, "-KILL")] {
        let (node, other) = (start("node", domain(offset)), start("other", domain(offset)));
        let counts = node.handle().publisher::<Count>("count", Qos::DEFAULT).expect("publisher");
        let qos = Qos::DEFAULT.with_depth(2 * COUNT as usize);
        let mut received =
            other.handle().subscription::<Count>("count", qos).expect("subscription");
        let peer = Peer::start("listen", domain(offset));
        soon("two subscribers", async {
            while counts.subscribers() < 2 {
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
        })
        .await;
        tokio::time::sleep(Duration::from_millis(200)).await;
        peer.signal(fate);
        let before = resident_mb();
        let mut longest = Duration::ZERO;
        for data in 0..COUNT {
            let begin = Instant::now();
            assert!(counts.publish(Count { data }), "{fate}: {data} is dropped");
            longest = longest.max(begin.elapsed());
            if data % 50 == 0 {
                tokio::time::sleep(Duration::from_millis(2)).await;
            }
        }
        for data in 0..COUNT {
            assert_eq!(soon("a sample", received.next()).await.0.data, data, "{fate}");
        }
        // It takes microseconds; a busy host may take the processor away for long.
        assert!(longest < Duration::from_secs(5), "{fate}: publishing took {longest:?}");
        let grown = resident_mb() - before;
        assert!(grown < 64.0, "{fate}: {grown} MB more");
        drop((counts, received, peer));
        node.stop().await;
        other.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_killed_server_is_distinguished_from_one_that_answers() {
    let asker = start("asker", domain(24));
    let client = asker.handle().client::<AddTwoInts>("add").expect("client");
    let peer = Peer::start("answer", domain(24));
    let terms = Terms { a: 2, b: 40 };
    let answer = client.call_idempotent(&terms, PATIENCE).await;
    assert_eq!(answer.map(|sum| sum.sum), Ok(42));
    peer.signal("-KILL");
    let begin = Instant::now();
    let error = client.call(terms.clone()).await.expect_err("it is dead");
    assert!(matches!(error, CallError::NoAnswer { .. }), "{error}");
    assert!(begin.elapsed() < PATIENCE, "it waits for {:?}", begin.elapsed());
    // Its replacement is asked at once, even if traces of the first are left.
    let _second = Peer::start("answer", domain(24));
    let answer = client.call_idempotent(&terms, PATIENCE).await;
    assert_eq!(answer.map(|sum| sum.sum), Ok(42));
    drop((client, peer));
    asker.stop().await;
}
