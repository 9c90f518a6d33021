//! Traps of ros2-client and RustDDS; see the table in `hanging.rs`.

mod common;

use cnc_msgs::wire::rcl_interfaces::srv::{ListParameters, ListParametersRequest};
use common::{Count, PATIENCE, domain, namespace, soon, start};
use runtime::{Qos, Session};
use rustix::process::{Resource, getrlimit};
use std::time::Duration;

async fn matched(publisher: &runtime::Publisher<Count>) {
    assert!(soon("a match", publisher.wait_for_subscriber(PATIENCE)).await);
    // The other side needs a moment more.
    tokio::time::sleep(Duration::from_millis(200)).await;
}

async fn stop(sessions: [Session; 2]) {
    for session in sessions {
        session.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_burst_within_the_depth_of_a_subscription_is_whole() {
    const COUNT: u32 = 5000;
    let (left, right) = (start("left", domain(30)), start("right", domain(30)));
    let counts = left.handle().publisher::<Count>("count", Qos::DEFAULT).expect("publisher");
    let qos = Qos::DEFAULT.with_depth(2 * COUNT as usize);
    let mut received = right.handle().subscription::<Count>("count", qos).expect("subscription");
    matched(&counts).await;
    for data in 0..COUNT {
        assert!(counts.publish(Count { data }));
    }
    // Nobody takes a sample before all are there.
    tokio::time::sleep(Duration::from_secs(1)).await;
    for data in 0..COUNT {
        assert_eq!(soon("a sample", received.next()).await.0.data, data);
    }
    drop((counts, received));
    stop([left, right]).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_a_node_says_last_arrives() {
    let (left, right) = (start("left", domain(31)), start("right", domain(31)));
    let counts = left.handle().publisher::<Count>("count", Qos::DEFAULT).expect("publisher");
    let qos = Qos::DEFAULT.with_depth(1000);
    let mut received = right.handle().subscription::<Count>("count", qos).expect("subscription");
    matched(&counts).await;
    let receiving = tokio::spawn(async move {
        for data in 0..200 {
            assert_eq!(soon("a sample", received.next()).await.0.data, data);
        }
        received
    });
    for data in 0..200 {
        assert!(counts.publish(Count { data }));
    }
    // As at the end of a node's own function.
    left.handle().shutdown().request("that was all");
    drop(counts);
    left.stop().await;
    drop(receiving.await.expect("all of it"));
    right.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_burst_of_requests_for_parameters_is_answered() {
    let (node, asker) = (start("node", domain(32)), start("asker", domain(32)));
    let service = format!("{}/node/list_parameters", namespace());
    let client = asker.handle().client::<ListParameters>(&service).expect("client");
    assert!(soon("a server", client.wait_for_server(PATIENCE)).await);
    let calls = (0..50).map(|_| client.call(ListParametersRequest::default()));
    for answer in futures::future::join_all(calls).await {
        assert_eq!(answer.expect("an answer").result.names, ["use_sim_time"]);
    }
    drop(client);
    stop([node, asker]).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_may_open_more_files_than_a_shell_allows() {
    let node = start("node", domain(33));
    let limit = getrlimit(Resource::Nofile);
    assert_eq!(limit.current, limit.maximum);
    node.stop().await;
}
