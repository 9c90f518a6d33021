//! Nodes that start together: each makes its endpoints while it finds those of the others.

mod common;

use common::{Count, PATIENCE, domain, start};
use runtime::{Handle, Qos};
use std::sync::mpsc;
use std::time::Instant;

/// As many as a cell with one machine has, without observers.
const NODES: u16 = 6;
/// Endpoints of each kind that each of them makes, on these topics.
const ENDPOINTS: u16 = 40;
const TOPICS: u16 = 2;

/// The DDS layer can deadlock when an endpoint is made while it discovers others. A node with a
/// deadlocked DDS layer cannot even be stopped.
#[test]
fn nodes_that_start_together_all_come_up() {
    for round in 0..2 {
        let (done, ended) = mpsc::channel();
        let domain = domain(round);
        for number in 0..NODES {
            let done = done.clone();
            std::thread::spawn(move || {
                let executor = tokio::runtime::Runtime::new().expect("threads");
                let _inside = executor.enter();
                let session = start(&format!("node{number}"), domain);
                let node = session.handle().clone();
                // As a recorder, which subscribes to discovered topics while it does other work.
                let others = std::thread::spawn({
                    let node = node.clone();
                    move || {
                        (0..ENDPOINTS).map(|number| subscribe(&node, number)).collect::<Vec<_>>()
                    }
                });
                let publishers: Vec<_> =
                    (0..ENDPOINTS).map(|number| publish(&node, number)).collect();
                let subscriptions = others.join().expect("subscriptions");
                done.send(number).expect("a test that waits");
                drop((publishers, subscriptions));
                executor.block_on(session.stop());
            });
        }
        drop(done);
        let end = Instant::now() + PATIENCE;
        let mut missing: Vec<_> = (0..NODES).collect();
        while !missing.is_empty() {
            let left = end.saturating_duration_since(Instant::now());
            match ended.recv_timeout(left) {
                Ok(number) => missing.retain(|node| *node != number),
                Err(_) => panic!("round {round}: nodes {missing:?} hang while they start"),
            }
        }
    }
}

fn publish(node: &Handle, number: u16) -> runtime::Publisher<Count> {
    node.publisher(&format!("topic{}", number % TOPICS), Qos::EVENTS).expect("a publisher")
}

fn subscribe(node: &Handle, number: u16) -> runtime::Subscription<Count> {
    node.subscription(&format!("topic{}", number % TOPICS), Qos::EVENTS).expect("a subscription")
}
