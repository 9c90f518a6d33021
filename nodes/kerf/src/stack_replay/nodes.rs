//! The arguments of the nodes of a replay, which keep them away from every real machine.
//!
//! Three barriers, each enough by itself. The driver's port is the virtual controller's, whatever
//! the bag or the environment says. All names are in a unique namespace. And all nodes are in a
//! domain that was unused, on this computer alone: not on the network, and without the caller's ROS
//! variables. Pure.

use super::TIME_FACTOR;
use cnc_msgs::convert::parameter_from_wire;
use cnc_msgs::wire::cnc_msgs::msg::NodeParameters;
use runtime::parameters::ParameterValue;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// The domains for replays: above the ephemeral ports, and rarely used.
pub(super) const DOMAINS: std::ops::RangeInclusive<u16> = 215..=232;
/// Longer than the driver's usual interval, so that on a busy computer the controller is not taken
/// for silent.
const POLL_INTERVAL_MS: i64 = 500;
/// Parameters that depend on this computer, not on the recorded one.
const OWN: [&str; 15] = [
    "port",
    "dtr",
    "rts",
    "poll_interval_ms",
    "tool_table",
    // The program was accepted with it.
    "keep_out",
    "directory",
    "program_directories",
    // What was read from them is in the recorded program.
    "subroutine_directories",
    "parameter_file",
    "control_directories",
    "report_directory",
    "memory_mb_max",
    "rate_margin",
    // The only clock is this computer's.
    "use_sim_time",
];

/// The nodes, in the order in which they are stopped.
pub(super) const NODES: [&str; 4] =
    ["axis_driver", "compensation_planner", "program_loader", "run_recorder"];

/// A parameter file with the recorded parameters of a node that matter for the run.
///
/// A parameter that the node does not know any more has no effect there.
pub(super) fn parameter_file(node: &str, recorded: Option<&NodeParameters>) -> String {
    let mut text = format!("/**/{node}:\n  ros__parameters:\n    use_sim_time: false\n");
    let is_recorded =
        |name: &str| recorded.iter().flat_map(|it| &it.parameters).any(|row| row.name == name);
    // A driver of before watched no path, and asked nothing for it.
    if node == "axis_driver" && !is_recorded("on_path_deviation") {
        text.push_str("    on_path_deviation: \"off\"\n");
    }
    // Nor did it know the travel.
    if node == "axis_driver" && !is_recorded("check_travel") {
        text.push_str("    check_travel: \"off\"\n");
    }
    for row in recorded.iter().flat_map(|it| &it.parameters) {
        if OWN.contains(&row.name.as_str()) || node == "run_recorder" {
            continue;
        }
        if let Some(yaml) = parameter_from_wire(&row.value).as_ref().and_then(yaml) {
            writeln!(text, "    {}: {yaml}", quoted(&row.name)).expect("a text takes everything");
        }
    }
    text
}

fn quoted(text: &str) -> String {
    // JSON strings are YAML strings.
    serde_json::Value::from(text).to_string()
}

/// `None` for an empty list, whose type is unknown.
fn yaml(value: &ParameterValue) -> Option<String> {
    fn list<T>(values: &[T], one: impl Fn(&T) -> String) -> Option<String> {
        let values: Vec<String> = values.iter().map(one).collect();
        (!values.is_empty()).then(|| format!("[{}]", values.join(", ")))
    }
    Some(match value {
        ParameterValue::Bool(value) => value.to_string(),
        ParameterValue::Integer(value) => value.to_string(),
        ParameterValue::Double(value) => number(value),
        ParameterValue::String(value) => quoted(value),
        ParameterValue::BoolArray(values) => list(values, bool::to_string)?,
        ParameterValue::IntegerArray(values) => list(values, i64::to_string)?,
        ParameterValue::DoubleArray(values) => list(values, number)?,
        ParameterValue::StringArray(values) => list(values, |value| quoted(value))?,
    })
}

/// A double that YAML does not read as an integer.
fn number(value: &f64) -> String {
    match value {
        value if value.is_nan() => ".nan".into(),
        value if value.is_infinite() && *value > 0.0 => ".inf".into(),
        value if value.is_infinite() => "-.inf".into(),
        value => format!("{value:?}"),
    }
}

/// The arguments of all nodes of a replay.
///
/// `folder` holds the parameter files, the tool table and the link to the controller.
pub(super) fn arguments(namespace: &str, folder: &Path, bags: &Path) -> Vec<String> {
    let shown = |name: &str| folder.join(name).display().to_string();
    let mut words: Vec<String> = ["--ros-args", "-r"].map(String::from).into_iter().collect();
    words.push(format!("__ns:={namespace}"));
    for node in NODES {
        words.extend(["--params-file".to_owned(), shown(&format!("{node}.yaml"))]);
    }
    // After the files, because the last value counts.
    for (node, name, value) in [
        ("axis_driver", "port", quoted(&shown(LINK))),
        ("axis_driver", "poll_interval_ms", POLL_INTERVAL_MS.to_string()),
        ("axis_driver", "rate_margin", format!("{:?}", 5.0 * TIME_FACTOR)),
        ("compensation_planner", "tool_table", quoted(&shown(TOOLS))),
        ("compensation_planner", "report_directory", quoted(&shown("reports"))),
        // The profile of the bag is there.
        ("program_loader", "control_directories", format!("[{}]", quoted(&shown(".")))),
        ("run_recorder", "directory", quoted(&bags.display().to_string())),
    ] {
        words.extend(["-p".to_owned(), format!("{node}:{name}:={value}")]);
    }
    words.push("--".to_owned());
    words
}

/// The link to the virtual controller's port, in the folder of the replay.
pub(super) const LINK: &str = "controller";
/// The tool table, in the folder of the replay.
pub(super) const TOOLS: &str = "tools.yaml";

/// The environment of the nodes: without ROS variables except the domain, on this computer alone.
pub(super) fn variables(
    inherited: BTreeMap<String, String>,
    domain: u16,
) -> BTreeMap<String, String> {
    let is_of_ros = |name: &str| {
        ["ROS_", "RMW_", "FASTRTPS_", "FASTDDS_", "CYCLONEDDS_"]
            .iter()
            .any(|prefix| name.starts_with(prefix))
    };
    let mut variables: BTreeMap<String, String> =
        inherited.into_iter().filter(|(name, _)| !is_of_ros(name)).collect();
    variables.insert("ROS_DOMAIN_ID".into(), domain.to_string());
    variables.insert("ROS_AUTOMATIC_DISCOVERY_RANGE".into(), "LOCALHOST".into());
    variables
}

/// The UDP ports that participants of a domain open on this computer, as defined by DDS.
fn ports(domain: u16) -> std::ops::Range<u32> {
    let first = 7400 + 250 * u32::from(domain);
    // Two for all, and two for each of the first hundred participants.
    first..first + 250
}

/// The first unused domain, starting at `first`; `None` if all are used.
///
/// `tables` are `/proc/net/udp` and `/proc/net/udp6`.
pub(super) fn free_domain(first: u16, tables: &[String]) -> Option<u16> {
    let count = DOMAINS.end() - DOMAINS.start() + 1;
    let taken: Vec<u32> = tables.iter().flat_map(|table| local_ports(table)).collect();
    let mut domains = (0..count).map(|turn| DOMAINS.start() + (first + turn) % count);
    domains.find(|&domain| !taken.iter().any(|port| ports(domain).contains(port)))
}

/// The local ports in a table of the kernel.
fn local_ports(table: &str) -> impl Iterator<Item = u32> + '_ {
    table.lines().skip(1).filter_map(|line| {
        let address = line.split_whitespace().nth(1)?;
        u32::from_str_radix(address.rsplit(':').next()?, 16).ok()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::wire::rcl_interfaces::msg::{Parameter, ParameterType, ParameterValue as Wire};

    fn text(name: &str, value: &str) -> Parameter {
        let value = Wire {
            type_: ParameterType::PARAMETER_STRING,
            string_value: value.into(),
            ..Wire::default()
        };
        Parameter { name: name.into(), value }
    }

    #[test]
    fn the_driver_never_gets_the_recorded_port_or_paths() {
        let mut parameters = OWN.map(|name| text(name, "/dev/ttyUSB0")).to_vec();
        parameters.push(text("on_commander_loss", "hold: \"now\""));
        let recorded = NodeParameters { parameters, ..NodeParameters::default() };
        let file = parameter_file("axis_driver", Some(&recorded));
        assert!(!file.contains("ttyUSB0"), "{file}");
        assert!(file.ends_with("    \"on_commander_loss\": \"hold: \\\"now\\\"\"\n"), "{file}");
        assert!(!parameter_file("run_recorder", Some(&recorded)).contains("commander"));

        let folder = Path::new("/run/replay");
        let words = arguments("/alone", folder, Path::new("/bags"));
        let said = words.join(" ");
        assert!(said.contains("-r __ns:=/alone "), "{said}");
        let port = words.iter().rposition(|it| it.contains(":port:=")).unwrap();
        assert_eq!(words[port], "axis_driver:port:=\"/run/replay/controller\"");
        let files = words.iter().rposition(|it| it == "--params-file").unwrap();
        assert!(files < port, "the file comes first, so the argument overrides it: {said}");
    }

    #[test]
    fn numbers_stay_of_their_type() {
        for (value, yaml_text) in [
            (ParameterValue::Double(600.0), Some("600.0")),
            (ParameterValue::Double(f64::INFINITY), Some(".inf")),
            (ParameterValue::Integer(-3), Some("-3")),
            (ParameterValue::Bool(true), Some("true")),
            (ParameterValue::StringArray(vec!["a".into(), "no".into()]), Some("[\"a\", \"no\"]")),
            (ParameterValue::IntegerArray(Vec::new()), None),
        ] {
            assert_eq!(yaml(&value).as_deref(), yaml_text, "{value:?}");
        }
    }

    #[test]
    fn nothing_of_ros_is_inherited_and_everything_stays_on_this_computer() {
        let inherited = [
            ("PATH", "/bin"),
            ("ROS_DOMAIN_ID", "7"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"),
            ("ROS_SECURITY_ENABLE", "true"),
            ("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp"),
        ];
        let inherited = inherited.map(|(name, value)| (name.to_owned(), value.to_owned()));
        let given = variables(inherited.into_iter().collect(), 220);
        let given: Vec<String> =
            given.iter().map(|(name, value)| format!("{name}={value}")).collect();
        assert_eq!(
            given,
            ["PATH=/bin", "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST", "ROS_DOMAIN_ID=220"]
        );
    }

    #[test]
    fn a_used_domain_is_skipped() {
        // 7400 + 250 * 215 + 11 = 61161 = 0xEEE9, the unicast port of a first participant.
        let table = "  sl  local_address rem_address   st\n   1: 0100007F:EEE9 00000000:0000 07\n";
        let none = "  sl  local_address rem_address   st\n".to_owned();
        assert_eq!(free_domain(0, std::slice::from_ref(&none)), Some(215));
        assert_eq!(free_domain(20, &[none]), Some(217));
        assert_eq!(free_domain(0, &[table.into()]), Some(216));
        let all: String = DOMAINS
            .map(|domain| format!("   1: 00000000:{:04X} 00000000:0000\n", ports(domain).start))
            .collect();
        assert_eq!(free_domain(0, &[format!("head\n{all}")]), None);
        assert_eq!(free_domain(0, &["nonsense".into(), "\n x y\n".into()]), Some(215));
    }
}
