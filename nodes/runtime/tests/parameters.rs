//! Parameters, time and health of a node, through its services and topics.

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
        assert!(response.results[1].reason.contains("not between 1 and 100"));
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
        let described = describe.expect("client").call(request).await.expect("answer").descriptors;
        assert_eq!(described[0].floating_point_range[0].to_value, 100.0);
        assert!(described[1].read_only);
        drop((events, set, all));
        node.stop().await;
        user.stop().await;
    }
}

/// The output of `ros2 param dump`: groups are nested, and every value has its form.
fn dumped(node: &str, values: &[(String, ParameterValue)]) -> String {
    use serde_yaml::{Mapping, Value, to_value};
    let mut root = Mapping::new();
    for (name, value) in values {
        let written = match value.type_ {
            1 => to_value(value.bool_value),
            2 => to_value(value.integer_value),
            3 => to_value(value.double_value),
            4 => to_value(&value.string_value),
            7 => to_value(&value.integer_array_value),
            8 => to_value(&value.double_array_value),
            9 => to_value(&value.string_array_value),
            other => panic!("type {other}"),
        };
        let mut group = &mut root;
        let (path, last) = name.rsplit_once('.').unwrap_or(("", name));
        for part in path.split('.').filter(|part| !part.is_empty()) {
            let below = group.entry(part.into()).or_insert_with(|| Mapping::new().into());
            group = below.as_mapping_mut().expect("a group");
        }
        group.insert(last.into(), written.expect("YAML"));
    }
    let root = Mapping::from_iter([("ros__parameters".into(), root.into())]);
    let root = Mapping::from_iter([(Value::from(node), root.into())]);
    serde_yaml::to_string(&root).expect("YAML")
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_dumped_is_loaded_again_as_a_file_and_over_the_network() {
    let declared = || {
        vec![
            Declared::new("port", "on", "a string that looks like a bool").read_only(),
            Declared::new("number", "115200", "one that looks like a number"),
            Declared::new("empty", "", "one of nothing"),
            Declared::new("limits.x.feed", 1e-9, "small, mm"),
            Declared::new("limits.x.far", 1e22, "large, mm"),
            Declared::new("limits.whole", 2.0, "whole, mm").read_only(),
            Declared::new("count", -7, "an integer"),
            Declared::new("is_on", true, "a bool").read_only(),
            Declared::new("axes", Vec::<i64>::new(), "none"),
            Declared::new("names", vec!["a b".to_owned(), "5".to_owned()], "two strings"),
            Declared::new("feeds", vec![1.0, 2.5], "two doubles"),
        ]
    };
    let mapping = ServiceMapping::Enhanced;
    let node = start_declared("driver", domain(84), mapping, declared());
    let user = start("user", domain(84));
    let list = user.handle().client::<srv::ListParameters>("driver/list_parameters").expect("c");
    let names = list.call(Default::default()).await.expect("answer").result.names;
    assert_eq!(names.len(), declared().len() + 1);
    let get = user.handle().client::<srv::GetParameters>("driver/get_parameters").expect("c");
    let request = srv::GetParametersRequest { names: names.clone() };
    let values = get.call(request).await.expect("answer").values;
    let values: Vec<_> = names.into_iter().zip(values).collect();

    let full = node.handle().names().fully_qualified();
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("driver.yaml");
    std::fs::write(&file, dumped(&full, &values)).expect("written");
    let namespace = format!("__ns:={}", common::namespace());
    let file = file.display().to_string();
    let words = ["--ros-args", "-r", &namespace, "--params-file", &file].map(str::to_owned);
    let empty = std::collections::BTreeMap::new();
    let read = runtime::configuration::Configuration::read("driver", declared(), &words, &empty)
        .expect("a dumped file is a parameter file");
    assert_eq!(read.warnings, [""; 0]);
    for declared in declared() {
        assert_eq!(read.parameters.get(&declared.name), Some(&declared.default));
    }

    // As `ros2 param load` does, which takes an empty list for one of bools.
    let set = user.handle().client::<srv::SetParameters>("driver/set_parameters").expect("c");
    let mut parameters: Vec<_> =
        values.into_iter().map(|(name, value)| Parameter { name, value }).collect();
    for parameter in parameters.iter_mut().filter(|parameter| parameter.name == "axes") {
        parameter.value = ParameterValue { type_: 6, ..ParameterValue::default() };
    }
    let response = set.call(srv::SetParametersRequest { parameters }).await.expect("answer");
    let refused: Vec<_> = response.results.iter().filter(|result| !result.successful).collect();
    assert!(refused.is_empty(), "{refused:?}");
    drop((list, get, set));
    node.stop().await;
    user.stop().await;
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
async fn a_node_publishes_its_health_on_the_absolute_topic() {
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
    node.handle().diagnostics(look).expect("findings");
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
