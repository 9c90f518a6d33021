//! Parameters, time and health of a node, as others see them.

mod common;

use cnc_msgs::wire::builtin_interfaces::msg::Time;
use cnc_msgs::wire::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus};
use cnc_msgs::wire::rcl_interfaces::msg::{Parameter, ParameterEvent, ParameterValue};
use cnc_msgs::wire::rcl_interfaces::srv;
use cnc_msgs::wire::rosgraph_msgs::msg::Clock;
use common::{domain, soon, start, start_declared};
use runtime::parameters::Declared;
use runtime::{Health, HealthLevel, Qos, RosTime, ServiceMapping};
use std::time::Duration;

fn double(name: &str, double_value: f64) -> Parameter {
    let value = ParameterValue { type_: 3, double_value, ..ParameterValue::default() };
    Parameter { name: name.into(), value }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn parameters_can_be_read_described_and_set_over_either_mapping() {
    for (offset, mapping) in [(80, ServiceMapping::Enhanced), (81, ServiceMapping::Cyclone)] {
        let declared = vec![
            Declared::new("rate_hz", 10.0, "how often, Hz").within(1.0, 100.0),
            Declared::new("port", "/dev/null", "the line").read_only(),
        ];
        let node = start_declared("driver", domain(offset), mapping, declared);
        let user = common::start_with("user", domain(offset), mapping);
        let qos = Qos::EVENTS;
        let mut events =
            user.handle().subscription::<ParameterEvent>("/parameter_events", qos).expect("sub");
        let mut changes = node.handle().parameter_changes();

        let set = user.handle().client::<srv::SetParameters>("driver/set_parameters").expect("c");
        let parameters = vec![double("rate_hz", 20.0), double("rate_hz", 0.5), double("port", 1.0)];
        let response = set.call(srv::SetParametersRequest { parameters }).await.expect("answer");
        let results: Vec<bool> = response.results.iter().map(|result| result.successful).collect();
        assert_eq!(results, [true, false, false]);
        assert!(response.results[1].reason.contains("not within 1 and 100"));
        assert!(response.results[2].reason.contains("read-only"));
        soon("the change", changes.changed()).await.expect("the node lives");
        assert_eq!(node.handle().parameter::<f64>("rate_hz"), 20.0);

        loop {
            let (event, _) = soon("an event", events.next()).await;
            if event.node == node.handle().names().fully_qualified()
                && !event.changed_parameters.is_empty()
            {
                assert_eq!(event.changed_parameters, [double("rate_hz", 20.0)]);
                break;
            }
        }

        let all = user
            .handle()
            .client::<srv::SetParametersAtomically>("driver/set_parameters_atomically")
            .expect("client");
        let parameters = vec![double("rate_hz", 30.0), double("nothing", 1.0)];
        let request = srv::SetParametersAtomicallyRequest { parameters };
        let result = all.call(request).await.expect("answer").result;
        assert!(!result.successful && result.reason.contains("nothing"), "{result:?}");
        assert_eq!(node.handle().parameter::<f64>("rate_hz"), 20.0);

        let list = user.handle().client::<srv::ListParameters>("driver/list_parameters");
        let names = list.expect("client").call(Default::default()).await.expect("answer");
        assert_eq!(names.result.names, ["port", "rate_hz", "use_sim_time"]);
        let names = vec!["rate_hz".to_owned(), "port".to_owned()];
        let get = user.handle().client::<srv::GetParameters>("driver/get_parameters");
        let request = srv::GetParametersRequest { names: names.clone() };
        let values = get.expect("client").call(request).await.expect("answer").values;
        assert_eq!((values[0].double_value, values[1].string_value.as_str()), (20.0, "/dev/null"));
        let types = user.handle().client::<srv::GetParameterTypes>("driver/get_parameter_types");
        let request = srv::GetParameterTypesRequest { names: names.clone() };
        assert_eq!(types.expect("client").call(request).await.expect("answer").types, [3, 4]);
        let describe =
            user.handle().client::<srv::DescribeParameters>("driver/describe_parameters");
        let request = srv::DescribeParametersRequest { names };
        let told = describe.expect("client").call(request).await.expect("answer").descriptors;
        assert_eq!(told[0].floating_point_range[0].to_value, 100.0);
        assert!(told[1].read_only);
        drop((events, set, all));
        node.stop().await;
        user.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn with_use_sim_time_the_node_s_time_is_that_of_the_clock_topic() {
    let (node, simulator) = (start("node", domain(82)), start("simulator", domain(82)));
    let clock = simulator.handle().publisher::<Clock>("/clock", Qos::DEFAULT).expect("clock");
    assert!(node.handle().now() > RosTime::from_parts(1_000_000_000, 0));
    let set = simulator.handle().client::<srv::SetParameters>("node/set_parameters").expect("c");
    let value = ParameterValue { type_: 1, bool_value: true, ..ParameterValue::default() };
    let parameters = vec![Parameter { name: "use_sim_time".into(), value }];
    let response = set.call(srv::SetParametersRequest { parameters }).await.expect("answer");
    assert!(response.results[0].successful);
    assert_eq!(node.handle().now(), RosTime::ZERO);
    soon("simulated time", async {
        while node.handle().now() != RosTime::from_parts(5, 7) {
            clock.publish(Clock { clock: Time { sec: 5, nanosec: 7 } });
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    })
    .await;
    drop((clock, set));
    node.stop().await;
    simulator.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_tells_its_health_on_the_absolute_topic() {
    let (node, monitor) = (start("node", domain(83)), start("monitor", domain(83)));
    let look = || {
        vec![Health {
            component: "serial link".into(),
            level: HealthLevel::Warn,
            message: "late".into(),
            hardware_id: "grbl 1.1h".into(),
            values: vec![("dropped".into(), "3".into())],
        }]
    };
    node.handle().diagnostics(look).expect("diagnostics");
    let mut health =
        monitor.handle().subscription::<DiagnosticArray>("/diagnostics", Qos::DEFAULT).expect("s");
    let name = format!("{}/node: serial link", &common::namespace()[1..]);
    let array = soon("health", async {
        loop {
            let (array, _) = health.next().await;
            if array.status[0].name == name {
                return array;
            }
        }
    })
    .await;
    let status = &array.status[0];
    assert_eq!(status.level, DiagnosticStatus::WARN);
    assert_eq!(
        (status.values[0].key.as_str(), status.hardware_id.as_str()),
        ("dropped", "grbl 1.1h")
    );
    assert!(array.header.stamp.sec > 0);
    drop(health);
    node.stop().await;
    monitor.stop().await;
}
