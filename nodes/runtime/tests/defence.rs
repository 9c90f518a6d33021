//! Peers that send invalid samples, on topics of others.
//!
//! A peer may claim any type, so everything here reaches the reader.

mod common;

use common::{PATIENCE, Text, domain, soon, start};
use runtime::{Qos, RawPublisher};
use std::time::Duration;

/// A text in CDR, with the given length field and bytes.
fn text(length: u32, bytes: &[u8]) -> Vec<u8> {
    [&[0, 1, 0, 0], &length.to_le_bytes()[..], bytes].concat()
}

/// Bytes that are not a text, and why.
fn garbage() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("nothing", vec![0, 1, 0, 0]),
        ("half a length", vec![0, 1, 0, 0, 9, 0]),
        ("a text of 4 GB that is not there", text(u32::MAX, b"abc\0")),
        ("a text of 2 GB that is not there", text(1 << 31, b"abc\0")),
        ("a text that is no UTF-8", text(4, b"\xff\xfe\xfd\0")),
        ("a text and 60 kB more", text(4, &[b'a'; 60_000])),
        ("another type: a number", vec![0, 1, 0, 0, 7, 7, 7, 7, 7, 7, 7, 7]),
    ]
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_storm_of_garbage_on_a_topic_hides_no_message_of_another_peer() {
    let (stranger, friend) = (start("stranger", domain(50)), start("friend", domain(50)));
    let node = start("node", domain(50));
    let topic = format!("{}/chatter", common::namespace());
    let mut received = node
        .handle()
        .subscription::<Text>("chatter", Qos::DEFAULT.with_depth(10_000))
        .expect("sub");
    let type_name = "std_msgs/msg/String";
    let storm = stranger.handle().raw_publisher(&topic, type_name, Qos::DEFAULT).expect("raw");
    let sane = friend.handle().publisher::<Text>("chatter", Qos::DEFAULT).expect("publisher");
    assert!(soon("a match", sane.wait_for_subscriber(PATIENCE)).await);
    let (stop, stopped) = tokio::sync::oneshot::channel();
    let storming = tokio::spawn(storm_of(storm, stopped));

    // The friend sends a message now and then during the storm.
    for number in 0..50 {
        sane.publish(Text { data: format!("{number}") });
        loop {
            let (said, info) = soon("a sane message", received.next()).await;
            if info.publisher == sane.gid() {
                assert_eq!(said.data, format!("{number}"));
                break;
            }
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    stop.send(()).expect("it storms");
    let sent = storming.await.expect("no panic");
    assert!(sent > 1000, "{sent} were sent");
    assert!(received.undecodable() > 0);
    drop((sane, received));
    for session in [stranger, friend, node] {
        session.stop().await;
    }
}

/// Sends ten thousand invalid samples a second until it is stopped; returns how many.
async fn storm_of(storm: RawPublisher, mut stopped: tokio::sync::oneshot::Receiver<()>) -> u64 {
    let (garbage, mut sent) = (garbage(), 0);
    // The long one would be 60 MB/s.
    let mut short = garbage.iter().map(|(_, bytes)| bytes).filter(|it| it.len() < 100).cycle();
    let mut ticks = tokio::time::interval(Duration::from_millis(1));
    while stopped.try_recv().is_err() {
        ticks.tick().await;
        for bytes in short.by_ref().take(10) {
            sent += u64::from(storm.publish(bytes));
        }
    }
    sent
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_piece_of_garbage_is_counted_and_passed_over() {
    let (stranger, node) = (start("stranger", domain(51)), start("node", domain(51)));
    let topic = format!("{}/chatter", common::namespace());
    let qos = Qos::DEFAULT.with_depth(100);
    let mut received = node.handle().subscription::<Text>("chatter", qos).expect("subscription");
    let raw =
        stranger.handle().raw_publisher(&topic, "std_msgs/msg/String", Qos::DEFAULT).expect("raw");
    let good = text(3, b"ab\0");
    // Until it is matched nothing arrives.
    soon("a match", async {
        while received.drain().is_empty() {
            raw.publish(&good);
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    })
    .await;
    tokio::time::sleep(Duration::from_millis(200)).await;
    received.drain();
    let before = received.undecodable();
    let garbage = garbage();
    for (index, (what, bytes)) in garbage.iter().enumerate() {
        assert!(raw.publish(bytes), "{what}");
        assert!(raw.publish(&good), "{what}");
        assert_eq!(soon(what, received.next()).await.0.data, "ab", "{what}");
        assert_eq!(received.undecodable() - before, index as u64 + 1, "{what} is no text");
    }
    drop((raw, received));
    stranger.stop().await;
    node.stop().await;
}

/// A message whose list says that it is longer than any memory.
#[derive(Debug, Clone, Default)]
struct Lists {
    names: Vec<String>,
    numbers: Vec<f64>,
}

cnc_msgs::cdr_struct!(Lists { names, numbers });

impl runtime::interface::Message for Lists {
    const TYPE_NAME: &'static str = "test_msgs/msg/Lists";
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_list_of_four_billion_that_is_not_there_takes_no_memory() {
    let (stranger, node) = (start("stranger", domain(52)), start("node", domain(52)));
    let topic = format!("{}/lists", common::namespace());
    let qos = Qos::DEFAULT.with_depth(100);
    let mut received = node.handle().subscription::<Lists>("lists", qos).expect("subscription");
    let raw = stranger.handle().raw_publisher(&topic, Lists::name(), Qos::DEFAULT).expect("raw");
    let billions = [&[0, 1, 0, 0], &u32::MAX.to_le_bytes()[..], &[0; 8]].concat();
    let none = [0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    soon("the good one after the bad ones", async {
        loop {
            for _ in 0..100 {
                raw.publish(&billions);
            }
            raw.publish(&none);
            tokio::select! {
                (lists, _) = received.next() => {
                    assert!(lists.names.is_empty() && lists.numbers.is_empty());
                    if received.undecodable() > 0 {
                        return;
                    }
                }
                () = tokio::time::sleep(Duration::from_millis(200)) => {}
            }
        }
    })
    .await;
    let status = std::fs::read_to_string("/proc/self/status").expect("it is Linux");
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).expect("VmHWM");
    let peak: u64 = peak.trim().trim_end_matches(" kB").parse().expect("a number");
    assert!(peak < 500_000, "{peak} kB were needed");
    drop((raw, received));
    stranger.stop().await;
    node.stop().await;
}

impl Lists {
    fn name() -> &'static str {
        <Self as runtime::interface::Message>::TYPE_NAME
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_request_whose_answer_would_be_too_long_gets_none_and_the_next_one_does() {
    use cnc_msgs::wire::rcl_interfaces::srv::{GetParameters, GetParametersRequest};
    let (stranger, node) = (start("stranger", domain(53)), start("node", domain(53)));
    let service = format!("{}/node/get_parameters", common::namespace());
    let client = stranger.handle().client::<GetParameters>(&service).expect("a client");
    // Nine bytes each ask for a value of some sixty.
    let greedy = GetParametersRequest { names: vec!["a".to_owned(); 400_000] };
    let modest = GetParametersRequest { names: vec!["use_sim_time".to_owned()] };
    assert!(soon("a server", client.wait_for_server(PATIENCE)).await);
    let answer = client.call_within(greedy, Duration::from_secs(5)).await;
    assert!(answer.is_err());
    let answer = client.call_within(modest, PATIENCE).await.expect("the node lives");
    assert_eq!(answer.values.len(), 1);
    let too_long = GetParametersRequest { names: vec!["a".repeat(1000); 17_000] };
    let error = client.call(too_long).await.expect_err("it is more than 16 MiB");
    assert!(error.to_string().contains("at most"), "{error}");
    drop(client);
    stranger.stop().await;
    node.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn long_answers_without_end_all_arrive() {
    use cnc_msgs::wire::rcl_interfaces::srv::{GetParameters, GetParametersRequest};
    let (asker, node) = (start("asker", domain(54)), start("node", domain(54)));
    let service = format!("{}/node/get_parameters", common::namespace());
    let client = asker.handle().client::<GetParameters>(&service).expect("a client");
    // Some 9 MB each: in between the writer of the answers has sent all that it may have to keep.
    let long = GetParametersRequest { names: vec!["a".to_owned(); 150_000] };
    for number in 0..20 {
        let answer = client.call_within(long.clone(), PATIENCE).await;
        assert_eq!(answer.map(|it| it.values.len()).ok(), Some(150_000), "answer {number}");
    }
    drop(client);
    asker.stop().await;
    node.stop().await;
}
