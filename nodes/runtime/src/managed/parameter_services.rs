//! The parameter interface for other nodes: six services and an event topic.
//!
//! Written here because ros2-client has only one service mapping, and no descriptions, ranges
//! or read-only parameters. `parameters` validates values.

use crate::endpoints::error::NodeError;
use crate::endpoints::node::Handle;
use crate::endpoints::publisher::Publisher;
use crate::parameters::live::LiveParameters;
use crate::parameters::{Declared, ParameterValue, Parameters, Range, USE_SIM_TIME};
use crate::process::lock;
use crate::samples::qos::Qos;
use cnc_msgs::convert::{parameter_from_wire, parameter_to_wire};
use cnc_msgs::wire::rcl_interfaces::msg as wire;
use cnc_msgs::wire::rcl_interfaces::srv;
use std::collections::BTreeSet;
use std::future::ready;
use std::sync::Arc;

/// Offers the services of a node and announces its parameters.
pub(crate) fn serve(handle: &Handle, live: &Arc<LiveParameters>) -> Result<(), NodeError> {
    let events = Arc::new(handle.publisher("/parameter_events", Qos::EVENTS)?);

    let all = Arc::clone(live);
    handle.service::<srv::GetParameters, _, _>("~/get_parameters", move |request, _| {
        let parameters = lock(&all.parameters);
        let values =
            request.names.iter().map(|name| parameter_to_wire(parameters.get(name))).collect();
        ready(srv::GetParametersResponse { values })
    })?;

    let all = Arc::clone(live);
    handle.service::<srv::GetParameterTypes, _, _>(
        "~/get_parameter_types",
        move |request, _| {
            let parameters = lock(&all.parameters);
            let types = request
                .names
                .iter()
                .map(|name| parameter_to_wire(parameters.get(name)).type_)
                .collect();
            ready(srv::GetParameterTypesResponse { types })
        },
    )?;

    let all = Arc::clone(live);
    handle.service::<srv::ListParameters, _, _>("~/list_parameters", move |request, _| {
        ready(srv::ListParametersResponse { result: list(&lock(&all.parameters), &request) })
    })?;

    let all = Arc::clone(live);
    handle.service::<srv::DescribeParameters, _, _>(
        "~/describe_parameters",
        move |request, _| {
            let parameters = lock(&all.parameters);
            let descriptors =
                request.names.iter().map(|name| describe(&parameters, name)).collect();
            ready(srv::DescribeParametersResponse { descriptors })
        },
    )?;

    let setter = Setter { handle: handle.clone(), live: Arc::clone(live), events };
    setter.announce();
    let all = setter.clone();
    handle.service::<srv::SetParameters, _, _>("~/set_parameters", move |request, _| {
        let results = request.parameters.into_iter().map(|one| all.set(vec![one])).collect();
        ready(srv::SetParametersResponse { results })
    })?;
    handle.service::<srv::SetParametersAtomically, _, _>(
        "~/set_parameters_atomically",
        move |request, _| {
            let result = setter.set(request.parameters);
            ready(srv::SetParametersAtomicallyResponse { result })
        },
    )
}

#[derive(Clone)]
struct Setter {
    handle: Handle,
    live: Arc<LiveParameters>,
    events: Arc<Publisher<wire::ParameterEvent>>,
}

impl Setter {
    /// Says which parameters there are.
    fn announce(&self) {
        let parameters = lock(&self.live.parameters);
        let new_parameters =
            parameters.iter().map(|(declared, value)| row_to_wire(declared, value)).collect();
        self.publish(wire::ParameterEvent { new_parameters, ..Default::default() });
    }

    fn set(&self, given: Vec<wire::Parameter>) -> wire::SetParametersResult {
        if given.is_empty() {
            let reason = "no parameter was given".to_owned();
            return wire::SetParametersResult { successful: false, reason };
        }
        let mut changes = Vec::with_capacity(given.len());
        for one in &given {
            match parameter_from_wire(&one.value) {
                Some(value) => {
                    let value = lock(&self.live.parameters).as_meant(&one.name, value);
                    changes.push((one.name.clone(), value));
                }
                None => {
                    let reason = format!("parameter \"{}\" cannot be removed", one.name);
                    return wire::SetParametersResult { successful: false, reason };
                }
            }
        }
        if let Err(reason) = self.live.set(&changes) {
            tracing::warn!("a change of parameters is refused: {reason}");
            return wire::SetParametersResult { successful: false, reason };
        }
        for (name, value) in &changes {
            tracing::info!("parameter \"{name}\" is set to {value}");
        }
        if let Some(ParameterValue::Bool(is_simulated)) = self.live.get(USE_SIM_TIME) {
            self.handle.simulate_time(is_simulated);
        }
        self.publish(wire::ParameterEvent { changed_parameters: given, ..Default::default() });
        wire::SetParametersResult { successful: true, reason: String::new() }
    }

    fn publish(&self, mut event: wire::ParameterEvent) {
        event.stamp = self.handle.now().into();
        event.node = self.handle.names().fully_qualified();
        self.events.publish(event);
    }
}

/// The names below the prefixes, as rclcpp lists them: `depth` 0 is all, 1 the
/// names without a further dot.
fn list(
    parameters: &Parameters,
    request: &srv::ListParametersRequest,
) -> wire::ListParametersResult {
    let is_shallow = |rest: &str| {
        let dots = rest.matches('.').count() as u64;
        request.depth == srv::ListParametersRequest::DEPTH_RECURSIVE || dots < request.depth
    };
    let is_listed = |name: &str| {
        request.prefixes.is_empty() && is_shallow(name)
            || request.prefixes.iter().any(|prefix| {
                name == prefix
                    || name
                        .strip_prefix(prefix.as_str())
                        .and_then(|rest| rest.strip_prefix('.'))
                        .is_some_and(is_shallow)
            })
    };
    let names: Vec<String> = parameters
        .iter()
        .map(|(declared, _)| declared.name.clone())
        .filter(|name| is_listed(name))
        .collect();
    let prefixes: BTreeSet<String> = names
        .iter()
        .filter_map(|name| name.rsplit_once('.').map(|(prefix, _)| prefix.to_owned()))
        .collect();
    wire::ListParametersResult { names, prefixes: prefixes.into_iter().collect() }
}

fn describe(parameters: &Parameters, name: &str) -> wire::ParameterDescriptor {
    let mut descriptor = wire::ParameterDescriptor { name: name.to_owned(), ..Default::default() };
    // Not one of ours: the type says "not set".
    let Some(declared) = parameters.declared(name) else { return descriptor };
    descriptor.type_ = parameter_to_wire(Some(&declared.default)).type_;
    descriptor.description.clone_from(&declared.description);
    descriptor.read_only = declared.read_only;
    if !declared.choices.is_empty() {
        descriptor.additional_constraints = format!("one of {}", declared.choices.join(", "));
    }
    match declared.range {
        Some(Range::Double { from, to }) => {
            let range = wire::FloatingPointRange { from_value: from, to_value: to, step: 0.0 };
            descriptor.floating_point_range = vec![range];
        }
        Some(Range::Integer { from, to }) => {
            let range = wire::IntegerRange { from_value: from, to_value: to, step: 1 };
            descriptor.integer_range = vec![range];
        }
        None => {}
    }
    descriptor
}

/// A parameter with its value, as a message.
pub fn row_to_wire(declared: &Declared, value: &ParameterValue) -> wire::Parameter {
    wire::Parameter { name: declared.name.clone(), value: parameter_to_wire(Some(value)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::Declared;

    fn parameters() -> Parameters {
        let declared = vec![
            Declared::new("port", "", "the line").read_only(),
            Declared::new("limits.feed", 1.0, "m/s").within(0.0, 2.0),
            Declared::new("limits.x.travel", 5, "m").integer_within(0, 9),
            Declared::new("limiter", "a", "kind").one_of(&["a", "b"]),
        ];
        Parameters::declare(declared).expect("valid")
    }

    fn listed(prefixes: &[&str], depth: u64) -> (Vec<String>, Vec<String>) {
        let prefixes = prefixes.iter().map(|prefix| (*prefix).to_owned()).collect();
        let request = srv::ListParametersRequest { prefixes, depth };
        let result = list(&parameters(), &request);
        (result.names, result.prefixes)
    }

    #[test]
    fn parameters_are_listed_by_prefix_and_depth() {
        let all = ["limiter", "limits.feed", "limits.x.travel", "port", "use_sim_time"];
        assert_eq!(
            listed(&[], 0),
            (all.map(str::to_owned).to_vec(), vec!["limits".into(), "limits.x".into()])
        );
        assert_eq!(listed(&[], 1).0, ["limiter", "port", "use_sim_time"]);
        assert_eq!(listed(&["limits"], 0).0, ["limits.feed", "limits.x.travel"]);
        assert_eq!(listed(&["limits"], 1).0, ["limits.feed"]);
        assert_eq!(listed(&["port", "limits.x"], 1).0, ["limits.x.travel", "port"]);
        assert!(listed(&["lim"], 0).0.is_empty());
    }

    #[test]
    fn a_descriptor_has_all_that_is_declared() {
        let parameters = parameters();
        let feed = describe(&parameters, "limits.feed");
        assert_eq!((feed.type_, feed.read_only), (wire::ParameterType::PARAMETER_DOUBLE, false));
        assert_eq!(feed.floating_point_range[0].to_value, 2.0);
        assert_eq!(feed.description, "m/s");
        assert!(describe(&parameters, "port").read_only);
        assert_eq!(describe(&parameters, "limits.x.travel").integer_range[0].to_value, 9);
        assert_eq!(describe(&parameters, "limiter").additional_constraints, "one of a, b");
        assert_eq!(describe(&parameters, "nothing").type_, wire::ParameterType::PARAMETER_NOT_SET);
    }

    #[test]
    fn values_go_to_the_wire_and_back() {
        let values: Vec<ParameterValue> = vec![
            true.into(),
            7.into(),
            1.5.into(),
            "x".into(),
            vec![true].into(),
            vec![1, 2].into(),
            vec![0.5].into(),
            vec!["a".to_owned()].into(),
        ];
        for value in values {
            assert_eq!(parameter_from_wire(&parameter_to_wire(Some(&value))), Some(value));
        }
        assert_eq!(parameter_from_wire(&parameter_to_wire(None)), None);
    }
}
