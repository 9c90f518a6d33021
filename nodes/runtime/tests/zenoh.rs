//! Nodes at a router of Zenoh, on the loopback interface.
#![cfg(feature = "zenoh")]

mod common;

use cnc_msgs::wire::std_msgs::msg::{Bool, String as Text};
use cnc_msgs::wire::std_srvs::srv::{Trigger, TriggerRequest, TriggerResponse};
use common::soon;
use runtime::configuration::Configuration;
use runtime::zenoh_settings::RouterCheck;
use runtime::{CallError, Qos, Router, ServiceMapping, Session};
use std::collections::BTreeMap;
use std::net::TcpListener;
use std::sync::Arc;
use std::time::Duration;

const ZENOH: (&str, &str) = ("RMW_IMPLEMENTATION", "rmw_zenoh_cpp");

/// A router on a port of its own, and how nodes find it.
struct Place {
    _router: Router,
    variables: BTreeMap<String, String>,
}

fn free_port() -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    listener.local_addr().expect("bound").port()
}

fn variables(of: &[(&str, &str)]) -> BTreeMap<String, String> {
    of.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect()
}

impl Place {
    fn new() -> Self {
        let at = format!("[\"tcp/127.0.0.1:{}\"]", free_port());
        let listens = variables(&[("ZENOH_CONFIG_OVERRIDE", &format!("listen/endpoints={at}"))]);
        let router = std::thread::spawn(move || Router::start(&listens));
        let connects = format!("connect/endpoints={at}");
        Self {
            _router: router.join().expect("no panic").expect("a router"),
            variables: variables(&[ZENOH, ("ZENOH_CONFIG_OVERRIDE", &connects)]),
        }
    }

    fn start(&self, name: &str) -> Session {
        let words = ["--ros-args", "-r", "__ns:=/mill"].map(str::to_owned);
        let configuration = Configuration::read(name, Vec::new(), &words, &self.variables);
        Session::start(configuration.expect("valid")).expect("a node")
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn samples_arrive_in_order_with_sender_number_and_times() {
    let place = Place::new();
    let (left, right) = (place.start("left"), place.start("right"));
    // Far longer than a datagram.
    let (publisher, subscription) = common::samples_pass(&left, &right, 3_000_000).await;
    // The other side notices that it is gone.
    assert_eq!(publisher.subscribers(), 1);
    drop(subscription);
    soon("the end of the match", async {
        while publisher.subscribers() > 0 {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    })
    .await;
    drop(publisher);
    left.stop().await;
    right.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_late_joiner_gets_what_is_latched_and_a_late_publisher_is_found() {
    let place = Place::new();
    let left = place.start("left");
    let publisher = left.handle().publisher::<Text>("state", Qos::LATCHED).expect("publisher");
    for data in ["one", "two", "three"] {
        assert!(publisher.publish(Text { data: data.into() }));
    }
    let right = place.start("right");
    let mut states = right.handle().subscription::<Text>("state", Qos::LATCHED).expect("reader");
    // Of a depth of one, the newest and no other.
    assert_eq!(soon("the latched value", states.next()).await.0.data, "three");
    let mut late = right.handle().subscription::<Text>("later", Qos::LATCHED).expect("reader");
    let other = left.handle().publisher::<Text>("later", Qos::LATCHED).expect("publisher");
    assert!(other.publish(Text { data: "soon enough".into() }));
    assert_eq!(soon("the first value", late.next()).await.0.data, "soon enough");
    assert!(states.drain().is_empty());
    drop((publisher, other, states, late));
    left.stop().await;
    right.stop().await;
}

/// More than DDS allows on one host.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn seventy_nodes_meet_at_one_router() {
    const NODES: usize = 70;
    let place = Arc::new(Place::new());
    let listener = place.start("listener");
    let of_all = Qos { depth: 2 * NODES, ..Qos::LATCHED };
    let mut roll_call =
        listener.handle().subscription::<Text>("roll_call", of_all).expect("reader");
    let begin = |number: usize| {
        let place = Arc::clone(&place);
        tokio::task::spawn_blocking(move || {
            let node = place.start(&format!("node_{number}"));
            let publisher = node.handle().publisher::<Text>("roll_call", Qos::LATCHED);
            let publisher = publisher.expect("publisher");
            assert!(publisher.publish(Text { data: number.to_string() }));
            (node, publisher)
        })
    };
    let nodes = futures::future::join_all((0..NODES).map(begin)).await;
    let nodes: Vec<_> = nodes.into_iter().map(|node| node.expect("no panic")).collect();
    let mut heard = std::collections::BTreeSet::new();
    soon("everyone", async {
        while heard.len() < NODES {
            heard.insert(roll_call.next().await.0.data);
        }
    })
    .await;
    soon("everyone to know the listener", async {
        while nodes.iter().any(|(_, publisher)| publisher.subscribers() != 1) {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    })
    .await;
    drop(roll_call);
    let ends = nodes.into_iter().map(|(node, publisher)| {
        drop(publisher);
        node.stop()
    });
    futures::future::join_all(ends).await;
    listener.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn services_answer_all_clients_and_know_their_processes() {
    let place = Place::new();
    let (server, node) = (place.start("server"), place.start("client"));
    let heartbeat = node.handle().publisher::<Bool>("heartbeat", Qos::DEFAULT).expect("publisher");
    let process = heartbeat.gid().participant();
    server
        .handle()
        .concurrent_service::<Trigger, _, _>("hold", move |_, info| async move {
            tokio::time::sleep(Duration::from_millis(20)).await;
            // Whose sign of life it was that came last matters to the driver.
            let success = info.writer.participant() == process;
            TriggerResponse { success, message: info.sequence.to_string() }
        })
        .expect("service");
    let client = node.handle().client::<Trigger>("hold").expect("client");
    assert!(client.wait_for_server(common::PATIENCE).await);
    let calls = (0..50).map(|_| client.call(TriggerRequest::default()));
    let answers = soon("all answers", futures::future::join_all(calls)).await;
    let mut numbers: Vec<i64> = Vec::new();
    for answer in answers {
        let answer = answer.expect("an answer");
        assert!(answer.success, "another process");
        numbers.push(answer.message.parse().expect("a number"));
    }
    numbers.sort_unstable();
    assert_eq!(numbers, (1..=50).collect::<Vec<i64>>());
    // The process of the server is that of its topics.
    let log = server.handle().publisher::<Bool>("log", Qos::DEFAULT).expect("publisher");
    let answer = client.call_for_server(&TriggerRequest::default(), common::PATIENCE).await;
    assert_eq!(answer.expect("an answer").1.participant(), log.gid().participant());
    let nobody = node.handle().client::<Trigger>("nobody").expect("client");
    let refused = nobody.call(TriggerRequest::default()).await;
    assert!(matches!(refused, Err(CallError::NoServer { .. })), "{refused:?}");
    drop((heartbeat, client, nobody, log));
    server.stop().await;
    node.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_call_ends_at_once_when_its_server_does() {
    let place = Place::new();
    let (server, node) = (place.start("server"), place.start("client"));
    let asked = Arc::new(tokio::sync::Notify::new());
    let told = Arc::clone(&asked);
    server
        .handle()
        .concurrent_service::<Trigger, _, _>("hold", move |_, _| {
            told.notify_one();
            std::future::pending()
        })
        .expect("service");
    let client = node.handle().client::<Trigger>("hold").expect("client");
    let within = 10 * common::PATIENCE;
    let call = client.call_within(TriggerRequest::default(), within);
    let end = async {
        asked.notified().await;
        server.stop().await;
    };
    let (answer, ()) = soon("the end of the call", futures::future::join(call, end)).await;
    assert!(matches!(answer, Err(CallError::Lost { .. })), "{answer:?}");
    drop(client);
    node.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_recorder_discovers_publishers_with_their_definitions() {
    let place = Place::new();
    let (node, recorder) = (place.start("node"), place.start("recorder"));
    let latched = node.handle().publisher::<Text>("manifest", Qos::LATCHED).expect("publisher");
    assert!(latched.publish(Text { data: "ab".into() }));
    let found = soon("discovery", async {
        loop {
            let found = recorder.handle().discovered_publishers();
            if let Some(found) = found.into_iter().find(|it| it.topic == "/mill/manifest") {
                return found;
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    })
    .await;
    assert_eq!((found.type_name.as_str(), found.qos), ("std_msgs/msg/String", Qos::LATCHED));
    let hash = cnc_msgs::schema::lookup("std_msgs/msg/String").expect("known").rihs01;
    assert_eq!((found.type_hash.as_deref(), found.gid), (Some(hash), latched.gid()));
    let raw = recorder.handle().raw_subscription(&found.topic, &found.type_name, found.qos);
    let sample = soon("the latched sample", raw.expect("a reader").next()).await;
    assert_eq!(sample.bytes, b"\0\x01\0\0\x03\0\0\0ab\0");
    assert_eq!(sample.info.publisher, latched.gid());
    let unknown = recorder.handle().raw_subscription("/x", "gripper_msgs/msg/Grip", Qos::DEFAULT);
    let error = unknown.expect_err("no hash").to_string();
    assert!(error.contains("type hash of gripper_msgs/msg/Grip"), "{error}");
    drop(latched);
    node.stop().await;
    recorder.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_without_a_router_is_told_what_is_missing() {
    let at = format!("connect/endpoints=[\"tcp/127.0.0.1:{}\"]", free_port());
    let variables = variables(&[ZENOH, ("ZENOH_CONFIG_OVERRIDE", &at)]);
    let mut configuration =
        Configuration::read("lost", Vec::new(), &[], &variables).expect("valid");
    assert_eq!(configuration.environment.mapping, ServiceMapping::Queries);
    let error = Session::start(configuration.clone()).expect_err("no router").to_string();
    assert!(error.contains("no Zenoh router at tcp/127.0.0.1:"), "{error}");
    assert!(error.contains("kerf router"), "{error}");
    configuration.environment.zenoh.router_check = RouterCheck::Skip;
    let alone = Session::start(configuration).expect("a node without a router");
    alone.stop().await;
}
