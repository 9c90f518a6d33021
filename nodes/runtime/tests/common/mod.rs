//! Shared by the tests on a real loopback network: message types of their own,
//! nodes in a domain of this process, and timeouts.
#![allow(dead_code, unreachable_pub)]

use runtime::configuration::Configuration;
use runtime::environment::DiscoveryRange;
use runtime::interface::{Action, Message, Service};
use runtime::parameters::Declared;
use runtime::{Publisher, Qos, ServiceMapping, Session, Subscription};
use std::collections::BTreeMap;
use std::future::Future;
use std::time::Duration;

macro_rules! message {
    ($name:ident, $type_name:literal { $($field:ident: $kind:ty),* }) => {
        #[derive(Debug, Clone, Default, PartialEq)]
        pub struct $name { $(pub $field: $kind),* }
        cnc_msgs::cdr_struct!($name { $($field),* });
        impl Message for $name { const TYPE_NAME: &'static str = $type_name; }
    };
}

message!(Text, "std_msgs/msg/String" { data: String });
message!(Count, "std_msgs/msg/UInt32" { data: u32 });
message!(Sum, "example_interfaces/srv/AddTwoInts_Response" { sum: i64 });
message!(Terms, "example_interfaces/srv/AddTwoInts_Request" { a: i64, b: i64 });
message!(Order, "example_interfaces/action/Fibonacci_Goal" { order: i32 });
message!(Sequence, "example_interfaces/action/Fibonacci_Result" { sequence: Vec<i32> });
message!(Partial, "example_interfaces/action/Fibonacci_Feedback" { sequence: Vec<i32> });

pub struct AddTwoInts;
impl Service for AddTwoInts {
    type Request = Terms;
    type Response = Sum;
    const TYPE_NAME: &'static str = "example_interfaces/srv/AddTwoInts";
}

pub struct Fibonacci;
impl Action for Fibonacci {
    type Goal = Order;
    type Result = Sequence;
    type Feedback = Partial;
    const TYPE_NAME: &'static str = "example_interfaces/action/Fibonacci";
}

/// Long enough that only a broken build reaches it.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// A domain of this test process; `offset` keeps the tests of one process apart.
pub fn domain(offset: u16) -> u16 {
    1 + ((std::process::id() * 7 + u32::from(offset) * 13) % 100) as u16
}

/// The namespace of this test process.
pub fn namespace() -> String {
    format!("/test{}", std::process::id())
}

pub fn start(name: &str, domain_id: u16) -> Session {
    start_with(name, domain_id, ServiceMapping::Enhanced)
}

pub fn start_with(name: &str, domain_id: u16, mapping: ServiceMapping) -> Session {
    start_declared(name, domain_id, mapping, Vec::new())
}

pub fn start_in(range: DiscoveryRange, name: &str, domain_id: u16) -> Session {
    let mut configuration = configuration(name, Vec::new());
    configuration.environment.domain_id = domain_id;
    configuration.environment.range = range;
    Session::start(configuration).expect("a node")
}

fn configuration(name: &str, declared: Vec<Declared>) -> Configuration {
    // Other tests may have hit upon the same domain: keep out of their names.
    let namespace = format!("__ns:={}", namespace());
    let words = ["--ros-args", "-r", &namespace].map(str::to_owned);
    Configuration::read(name, declared, &words, &BTreeMap::new()).expect("a valid configuration")
}

pub fn start_declared(
    name: &str,
    domain_id: u16,
    mapping: ServiceMapping,
    declared: Vec<Declared>,
) -> Session {
    let mut configuration = configuration(name, declared);
    configuration.environment.domain_id = domain_id;
    configuration.environment.mapping = mapping;
    Session::start(configuration).expect("a node")
}

/// Fails the test, instead of hanging, when something never comes.
pub async fn soon<T>(what: &str, future: impl Future<Output = T>) -> T {
    match tokio::time::timeout(PATIENCE, future).await {
        Ok(value) => value,
        Err(_) => panic!("{what} did not come within {PATIENCE:?}"),
    }
}

/// A hundred samples and a big one pass in order, each with its sender, number and times.
pub async fn samples_pass(
    left: &Session,
    right: &Session,
    big: usize,
) -> (Publisher<Text>, Subscription<Text>) {
    let publisher = left.handle().publisher::<Text>("chatter", Qos::DEFAULT).expect("publisher");
    let qos = Qos::DEFAULT.with_depth(1000);
    let mut subscription = right.handle().subscription::<Text>("chatter", qos).expect("reader");
    assert!(soon("a match", publisher.wait_for_subscriber(PATIENCE)).await);
    tokio::time::sleep(Duration::from_millis(200)).await;
    for index in 0..100 {
        assert!(publisher.publish(Text { data: format!("{index}") }));
    }
    for index in 0..100 {
        let (text, info) = soon("a sample", subscription.next()).await;
        assert_eq!(text.data, format!("{index}"));
        assert_eq!(info.publisher, publisher.gid());
        assert_eq!(info.sequence, index + 1);
        assert!(info.source_time.expect("stamped") <= info.reception_time);
    }
    let big = "x".repeat(big);
    assert!(publisher.publish(Text { data: big.clone() }));
    assert_eq!(soon("the big one", subscription.next()).await.0.data, big);
    (publisher, subscription)
}
