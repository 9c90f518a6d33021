//! Topics without their types, as a recorder sees them.

mod common;

use common::{AddTwoInts, Sum, Terms, Text, domain, soon, start};
use runtime::Qos;
use std::time::Duration;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_recorder_finds_topics_takes_their_bytes_and_can_send_them_again() {
    let (node, recorder) = (start("node", domain(40)), start("recorder", domain(40)));
    let latched = node.handle().publisher::<Text>("manifest", Qos::LATCHED).expect("publisher");
    let sensor = node.handle().publisher::<Text>("sensor", Qos::SENSOR).expect("publisher");
    node.handle()
        .service::<AddTwoInts, _, _>("add", |terms: Terms, _| async move { Sum { sum: terms.a } })
        .expect("service");
    assert!(latched.publish(Text { data: "ab".into() }));

    let ours = |topic: &str| format!("{}/{topic}", common::namespace());
    let found = soon("discovery", async {
        loop {
            let found = recorder.handle().discovered_publishers();
            let has = |topic: String| found.iter().any(|publisher| publisher.topic == topic);
            if has(ours("manifest")) && has(ours("sensor")) {
                return found;
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    })
    .await;
    assert!(found.iter().all(|publisher| publisher.topic != ours("add")), "{found:?}");
    let manifest =
        found.iter().find(|publisher| publisher.topic == ours("manifest")).expect("there");
    assert_eq!(manifest.type_name, "std_msgs/msg/String");
    assert_eq!(manifest.qos, Qos { depth: 0, ..Qos::LATCHED });
    assert_eq!(manifest.gid, latched.gid());
    assert_eq!(manifest.deadline_ns, None);
    let other = found.iter().find(|publisher| publisher.topic == ours("sensor")).expect("there");
    assert_eq!((other.qos.reliable, other.qos.transient_local), (false, false));
    assert_eq!(other.gid, sensor.gid());

    let qos = manifest.qos.with_depth(20_000);
    let mut raw = recorder
        .handle()
        .raw_subscription(&manifest.topic, &manifest.type_name, qos)
        .expect("raw subscription");
    let sample = soon("the latched sample", raw.next()).await;
    // Encoding, length with the terminating zero, the text, the zero, and what
    // fills it up to a multiple of four.
    assert_eq!(sample.bytes, b"\0\x01\0\0\x03\0\0\0ab\0\0");
    assert_eq!(sample.info.publisher, latched.gid());
    assert!(sample.info.source_time.expect("stamped") <= sample.info.reception_time);

    let again = recorder
        .handle()
        .raw_publisher("again", "std_msgs/msg/String", Qos::LATCHED)
        .expect("raw publisher");
    assert!(again.publish(&sample.bytes));
    assert!(!again.publish(b"\0"), "no encoding");
    let mut reader = node.handle().subscription::<Text>("again", Qos::LATCHED).expect("reader");
    assert_eq!(soon("the replay", reader.next()).await.0.data, "ab");

    drop((latched, sensor, raw, again, reader));
    node.stop().await;
    recorder.stop().await;
}
