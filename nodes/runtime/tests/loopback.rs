//! Topics and services between two nodes on the loopback interface.

mod common;

use common::{AddTwoInts, Count, Sum, Terms, Text, domain, soon, start, start_with};
use runtime::environment::DiscoveryRange;
use runtime::parameters::Declared;
use runtime::{CallError, Qos, ServiceMapping};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn samples_arrive_in_order_with_sender_number_and_times() {
    let (left, right) = (start("left", domain(0)), start("right", domain(0)));
    // Far longer than a datagram.
    let (publisher, subscription) = common::samples_pass(&left, &right, 3_000_000).await;
    drop((publisher, subscription));
    left.stop().await;
    right.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_find_each_other_in_the_last_domain_too() {
    // The ports of its last participants would be over 65535.
    let (left, right) = (start("left", 232), start("right", 232));
    drop(common::samples_pass(&left, &right, 100).await);
    left.stop().await;
    right.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_late_joiner_of_a_latched_topic_gets_the_newest_sample_and_no_other() {
    let left = start("left", domain(1));
    let publisher = left.handle().publisher::<Count>("state", Qos::LATCHED).expect("publisher");
    // The depth of the publisher is one; this one would take them all.
    let deep = Qos::LATCHED.with_depth(100);
    // With no reader, and with one that has them all.
    let mut joined = Vec::new();
    for newest in [5, 45] {
        for data in newest - 4..=newest {
            assert!(publisher.publish(Count { data }));
        }
        let right = start(&format!("right{newest}"), domain(1));
        let mut late = right.handle().subscription::<Count>("state", deep).expect("reader");
        assert_eq!(soon("the newest", late.next()).await.0.data, newest);
        let more = tokio::time::timeout(Duration::from_secs(1), late.next()).await;
        assert!(more.is_err(), "{more:?}");
        joined.push((late, right));
    }
    drop(publisher);
    for (late, right) in joined {
        drop(late);
        right.stop().await;
    }
    left.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_sender_of_another_type_is_not_heard() {
    let (left, right) = (start("left", domain(2)), start("right", domain(2)));
    let wrong = left.handle().publisher::<Count>("chatter", Qos::DEFAULT).expect("publisher");
    let mut subscription =
        right.handle().subscription::<Text>("chatter", Qos::DEFAULT.with_depth(100)).expect("sub");
    let sane = left.handle().publisher::<Text>("chatter", Qos::DEFAULT).expect("publisher");
    assert!(soon("a match", sane.wait_for_subscriber(common::PATIENCE)).await);
    assert!(!wrong.wait_for_subscriber(Duration::from_secs(1)).await);
    for _ in 0..3 {
        assert!(wrong.publish(Count { data: 4_000_000_000 }));
    }
    assert!(sane.publish(Text { data: "good".into() }));
    assert_eq!(soon("the good one", subscription.next()).await.0.data, "good");
    assert_eq!(subscription.undecodable(), 0);
    drop((wrong, sane, subscription));
    left.stop().await;
    right.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn eight_calls_at_once_each_get_their_own_answer_in_either_mapping() {
    for (offset, mapping) in [(3, ServiceMapping::Enhanced), (4, ServiceMapping::Cyclone)] {
        let server = start_with("server", domain(offset), mapping);
        let asker = start_with("asker", domain(offset), mapping);
        let served = Arc::new(AtomicU32::new(0));
        let count = Arc::clone(&served);
        let answer = move |terms: Terms, _| {
            count.fetch_add(1, Ordering::Relaxed);
            async move { Sum { sum: terms.a + terms.b } }
        };
        server.handle().service::<AddTwoInts, _, _>("add", answer).expect("service");
        let client = asker.handle().client::<AddTwoInts>("add").expect("client");
        let calls = (0..8).map(|a| {
            let client = client.clone();
            tokio::spawn(async move { client.call(Terms { a, b: 40 }).await })
        });
        for (a, call) in calls.collect::<Vec<_>>().into_iter().enumerate() {
            let sum = soon("an answer", call).await.expect("no panic").expect("an answer").sum;
            assert_eq!(sum, a as i64 + 40);
        }
        assert_eq!(served.load(Ordering::Relaxed), 8);
        drop(client);
        server.stop().await;
        asker.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn so_many_requests_wait_as_the_parameter_says() {
    // The DDS layer keeps some more for a moment.
    for (offset, depth, answered) in [(9, 2_i64, 0..=300), (10, 1000, 400..=400)] {
        let depth = Declared::new("service_depth", depth, "requests that wait");
        let mapping = ServiceMapping::Enhanced;
        let server = common::start_declared("server", domain(offset), mapping, vec![depth]);
        let asker = start("asker", domain(offset));
        let slow = move |terms: Terms, _| async move {
            tokio::time::sleep(Duration::from_millis(5)).await;
            Sum { sum: terms.a + terms.b }
        };
        server.handle().service::<AddTwoInts, _, _>("add", slow).expect("service");
        let client = asker.handle().client::<AddTwoInts>("add").expect("client");
        assert!(soon("a server", client.wait_for_server(common::PATIENCE)).await);
        let within = Duration::from_secs(5);
        let calls = (0..400).map(|a| client.call_within(Terms { a, b: 1 }, within));
        let answers = futures::future::join_all(calls).await;
        let count = answers.iter().filter(|it| it.is_ok()).count();
        assert!(answered.contains(&count), "{count} of 400 were answered");
        drop(client);
        server.stop().await;
        asker.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_call_to_nobody_says_that_no_such_node_answered() {
    let asker = start("asker", domain(5));
    let client = asker.handle().client::<AddTwoInts>("nobody/add").expect("client");
    let error = client.call(Terms { a: 1, b: 2 }).await.expect_err("nobody is there");
    assert!(matches!(error, CallError::NoServer { .. }));
    let text = error.to_string();
    assert!(text.contains("within 5 s; start its node"), "{text}");
    assert!(text.contains("/nobody/add"), "{text}");
    drop(client);
    asker.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_that_does_not_answer_is_distinguished_from_a_missing_one() {
    let (server, asker) = (start("server", domain(6)), start("asker", domain(6)));
    let silent = |_: Terms, _| std::future::pending::<Sum>();
    server.handle().concurrent_service::<AddTwoInts, _, _>("add", silent).expect("service");
    let client = asker.handle().client::<AddTwoInts>("add").expect("client");
    assert!(soon("a server", client.wait_for_server(common::PATIENCE)).await);
    let within = Duration::from_millis(300);
    let error = client.call_within(Terms { a: 1, b: 2 }, within).await.expect_err("silence");
    assert!(matches!(error, CallError::NoAnswer { .. }), "{error}");
    drop(client);
    server.stop().await;
    asker.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_panic_in_a_task_stops_the_node_and_says_why() {
    let session = start("fragile", domain(7));
    session.handle().spawn("thinker", async { panic!("no idea") });
    soon("the stop", session.handle().shutdown().requested()).await;
    assert!(session.handle().shutdown().is_failure());
    let reason = session.handle().shutdown().reason().expect("a reason");
    assert!(reason.contains("thinker") && reason.contains("no idea"), "{reason}");
    session.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn with_discovery_off_a_node_is_alone() {
    let hermit = common::start_in(DiscoveryRange::Off, "hermit", domain(8));
    let other = start("other", domain(8));
    let publisher = hermit.handle().publisher::<Text>("chatter", Qos::DEFAULT).expect("publisher");
    let subscription = other.handle().subscription::<Text>("chatter", Qos::DEFAULT).expect("sub");
    assert!(!publisher.wait_for_subscriber(Duration::from_secs(2)).await);
    assert!(publisher.publish(Text { data: "nobody hears".into() }));
    drop((publisher, subscription));
    hermit.stop().await;
    other.stop().await;
}
