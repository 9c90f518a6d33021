//! Ten thousand messages a second on everything that the nodes listen to.

use super::commander::Commander;
use super::machine::{Machine, SLOW_POLLING, until};
use super::stranger::{Stranger, encoded, resident_mb};
use super::support::{CONTOUR, TIMEOUT};
use cnc_msgs::wire::cnc_msgs::msg::{
    CompensatedPath, CompensationReport, MachineState, Program, ProgrammedContour, Recording, Tool,
    ToolTable,
};
use cnc_msgs::wire::cnc_msgs::srv::{GetPathChunks, GetPathChunksRequest};
use cnc_msgs::wire::geometry_msgs::msg::Point;
use cnc_msgs::wire::rcl_interfaces::msg::{Parameter, ParameterType, ParameterValue};
use cnc_msgs::wire::rcl_interfaces::srv::{SetParameters, SetParametersRequest};
use cnc_msgs::wire::rosgraph_msgs::msg::Clock;
use cnc_msgs::wire::std_msgs::msg::{Bool, Header};
use cnc_msgs::wire::std_srvs::srv::{Trigger, TriggerRequest};
use runtime::interface::{Message, Service};
use runtime::{Client, Gid, Handle, Qos};
use rustix::process::Pid;
use std::time::{Duration, Instant};

/// Messages of each storm, and how many go out in a millisecond.
const STORM: u64 = 10_000;
const A_MILLISECOND: u64 = 10;
/// States that the driver publishes while it lasts.
const STATES: usize = 5;
/// What a storm may leave in the memory of a node, MB: what waits on both sides, and no more.
const LEFT_MB: f64 = 64.0;

/// What is sent in a storm, in turn.
struct Storm {
    topic: &'static str,
    messages: Vec<Vec<u8>>,
    /// Whether a node that cannot use it says so.
    is_logged: bool,
}

fn storms() -> Vec<Storm> {
    let nan = Point { x: f64::NAN, y: 0.0, z: 0.0 };
    let string = [&[0, 1, 0, 0], &u32::MAX.to_le_bytes()[..], b"a text of 4 GB"].concat();
    let storm = |topic, messages: Vec<Vec<u8>>| Storm { topic, messages, is_logged: true };
    let quiet = |topic, messages| Storm { topic, messages, is_logged: false };
    let billion = CompensatedPath {
        program_id: "billion".into(),
        revision: 1,
        element_count: 1_000_000_000,
        chunk_count: 4_000_000,
        ..CompensatedPath::default()
    };
    let foreign = CompensatedPath {
        program_id: "foreign".into(),
        revision: 7,
        element_count: 1000,
        chunk_count: 4,
        start: nan.clone(),
        ..CompensatedPath::default()
    };
    let events = ProgrammedContour {
        program_id: "billion".into(),
        event_count: 1_000_000_000,
        chunk_count: 4_000_000,
        ..ProgrammedContour::default()
    };
    let tool = Tool { number: 1, diameter: f64::NAN, ..Tool::default() };
    let table = ToolTable { revision: 9, tools: vec![tool], ..ToolTable::default() };
    let moves = MachineState { machine_position: nan.clone(), ..MachineState::default() };
    vec![
        storm("feed_hold", vec![string.clone()]),
        quiet("feed_hold", vec![encoded(&Bool { data: true }), encoded(&Bool { data: false })]),
        storm("commander_heartbeat", vec![string.clone()]),
        quiet("commander_heartbeat", vec![encoded(&Header::default())]),
        storm("compensated_path", vec![string.clone()]),
        storm("compensated_path", vec![encoded(&billion)]),
        storm("compensated_path", vec![encoded(&foreign)]),
        storm("programmed_contour", vec![string.clone()]),
        storm("programmed_contour", vec![encoded(&events)]),
        storm("tool_table", vec![encoded(&table)]),
        storm("compensation_report", vec![string.clone()]),
        quiet("compensation_report", vec![encoded(&CompensationReport::default())]),
        quiet("program", vec![encoded(&Program::default())]),
        quiet("recording", vec![encoded(&Recording::default())]),
        quiet("machine_state", vec![encoded(&moves)]),
        quiet("/clock", vec![encoded(&Clock::default()), string]),
    ]
}

/// The type of a topic: an endpoint of another one is not heard at all.
fn type_of(topic: &str) -> &'static str {
    match topic {
        "feed_hold" => Bool::TYPE_NAME,
        "commander_heartbeat" => Header::TYPE_NAME,
        "compensated_path" => CompensatedPath::TYPE_NAME,
        "programmed_contour" => ProgrammedContour::TYPE_NAME,
        "tool_table" => ToolTable::TYPE_NAME,
        "compensation_report" => CompensationReport::TYPE_NAME,
        "program" => Program::TYPE_NAME,
        "recording" => Recording::TYPE_NAME,
        "machine_state" => MachineState::TYPE_NAME,
        "/clock" => Clock::TYPE_NAME,
        other => unreachable!("no storm on {other}"),
    }
}

/// What is watched while it storms.
struct Watch<'a> {
    commander: &'a Commander,
    nodes: Vec<(&'static str, Pid, f64)>,
}

impl Watch<'_> {
    /// Repeats this until enough was sent and the driver has published its state.
    #[track_caller]
    fn while_states_come(&self, what: &str, mut send: impl FnMut() -> u64) -> u64 {
        let (mark, end) = (self.commander.mark(), Instant::now() + TIMEOUT);
        let mut sent = 0;
        // States of the driver itself: its endpoint is not ours.
        let received = || {
            let states = self.commander.states_since(mark);
            states.iter().filter(|state| state.link_age > 0.0).count()
        };
        while sent < STORM || received() < STATES {
            assert!(Instant::now() < end, "{what}: {sent} sent, {} states received", received());
            sent += send();
            std::thread::sleep(Duration::from_millis(1));
        }
        for (name, pid, before) in &self.nodes {
            let grown = resident_mb(*pid) - before;
            assert!(grown < LEFT_MB, "{what}: {name} holds {grown} MB more");
        }
        sent
    }
}

#[test]
fn a_storm_on_any_topic_leaves_the_machine_its_state_and_one_line_in_the_log() {
    let mut args = SLOW_POLLING.to_vec();
    args.extend(["-p", "axis_driver:use_sim_time:=true"]);
    let machine = Machine::virtual_with(8, &args);
    let commander = Commander::join(&machine);
    let stranger = Stranger::join(&machine);
    let names = ["axis_driver", "compensation_planner", "program_loader"];
    let nodes = names.map(|name| {
        let pid = machine.node(name);
        (name, pid, resident_mb(pid))
    });
    let watch = Watch { commander: &commander, nodes: nodes.into() };
    commander.until("a state", |state| state.position_known);

    let mut senders: Vec<(&str, Gid)> = Vec::new();
    for storm in storms() {
        let topic = match storm.topic.starts_with('/') {
            true => storm.topic.to_owned(),
            false => format!("{}/{}", machine.namespace, storm.topic),
        };
        let publisher = stranger.inside(|node| {
            node.raw_publisher(&topic, type_of(storm.topic), Qos::LATCHED).expect("raw")
        });
        // It is received once it is matched.
        std::thread::sleep(Duration::from_millis(500));
        let mut messages = storm.messages.iter().cycle();
        watch.while_states_come(storm.topic, || {
            let batch = messages.by_ref().take(A_MILLISECOND as usize);
            batch.filter(|message| publisher.publish(message)).count() as u64
        });
        if storm.is_logged {
            senders.push((storm.topic, publisher.gid()));
        }
    }
    for (topic, gid) in senders {
        let gid = gid.to_string();
        let lines = until(&format!("a word about {topic}"), || {
            let log = machine.log();
            let count = log.lines().filter(|line| line.contains(&gid)).count();
            (count > 0).then_some(count)
        });
        // Driver, planner and recorder each may listen.
        assert!(lines <= 3, "{topic}: {lines} lines about {gid}\n{}", machine.log());
    }
    let log = machine.log();
    assert!(!log.contains("panicked"), "{log}");
    assert!(log.len() < 200_000, "{} bytes of log", log.len());
    runs(&machine, &commander);
}

/// Fails unless the machine, which a wish holds, does its work.
#[track_caller]
fn runs(machine: &Machine, commander: &Commander) {
    commander.until("the hold that was wished", |state| state.state == MachineState::STATE_HOLD);
    commander.press("resume").expect("it is held");
    commander.until("an idle machine", |state| state.state == MachineState::STATE_IDLE);
    machine.kerf(&["run", CONTOUR, "--control", "sinumerik_840c"]).expect(0).says(&["done"]);
}

/// Asks as fast as it can, with many calls at a time.
async fn ask<S: Service + 'static>(client: &Client<S>, request: S::Request) -> u64 {
    let mut calls = tokio::task::JoinSet::new();
    for _ in 0..50 {
        let (client, request) = (client.clone(), request.clone());
        calls.spawn(async move { client.call_within(request, TIMEOUT).await.is_ok() });
    }
    calls.join_all().await.into_iter().filter(|is_answered| *is_answered).count() as u64
}

#[test]
fn a_storm_on_any_service_leaves_the_machine_its_state() {
    let machine = Machine::virtual_one(8);
    let commander = Commander::join(&machine);
    let stranger = Stranger::join(&machine);
    let nodes = ["axis_driver", "compensation_planner"].map(|name| {
        let pid = machine.node(name);
        (name, pid, resident_mb(pid))
    });
    let watch = Watch { commander: &commander, nodes: nodes.into() };
    commander.until("a state", |state| state.position_known);

    let not_a_number = Parameter {
        name: "poll_interval_ms".into(),
        value: ParameterValue {
            type_: ParameterType::PARAMETER_DOUBLE,
            double_value: f64::NAN,
            ..ParameterValue::default()
        },
    };
    let change = SetParametersRequest { parameters: vec![not_a_number; 10] };
    let storm = |what: &str, ask: &dyn Fn() -> u64| watch.while_states_come(what, ask);
    let parameters = stranger.inside(|node| client(node, "axis_driver/set_parameters"));
    storm("set_parameters", &|| stranger.wait(ask::<SetParameters>(&parameters, change.clone())));
    let hold = stranger.inside(|node| client(node, "feed_hold"));
    storm("feed_hold", &|| stranger.wait(ask::<Trigger>(&hold, TriggerRequest::default())));
    let chunks = stranger.inside(|node| client(node, "compensated_path/get_chunks"));
    let request = GetPathChunksRequest { first: u32::MAX, ..Default::default() };
    storm("get_chunks", &|| stranger.wait(ask::<GetPathChunks>(&chunks, request.clone())));

    let log = machine.log();
    assert!(!log.contains("panicked"), "{log}");
    assert!(log.contains("lines like this were left out"), "{log}");
    assert!(log.len() < 200_000, "{} bytes of log", log.len());
    runs(&machine, &commander);
}

fn client<S: Service + 'static>(node: &Handle, name: &str) -> Client<S> {
    node.client(name).expect("a client")
}
