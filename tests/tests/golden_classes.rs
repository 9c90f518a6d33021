//! That no class of things that can happen is without its golden run.
//!
//! A new code of a finding, or another class below, fails here until a run of it is recorded
//! with `tests/golden_runs/record`.

use cnc_msgs::cdr;
use cnc_msgs::finding::Code;
use cnc_msgs::interface::Message;
use cnc_msgs::schema::TypeInfo;
use cnc_msgs::wire::action_msgs::msg::{GoalStatus, GoalStatusArray};
use cnc_msgs::wire::cnc_msgs::msg::{
    Command, CompensatedPath, CompensationReport, ControllerTraffic, MachineState,
    ProgrammedContour, TrafficEntry,
};
use kerf_tests::root;
use replay::{completed, with_names_of_today};
use rosidl::decode::decode;
use rosidl::encode::encode;
use rosidl::schema::MessageSchema;
use rosidl::value::Value;
use run_recorder::bag_reader::BagMessage;
use run_recorder::files::open_bag;
use settings::Control;
use std::collections::BTreeSet;

/// Codes that no program alone brings about.
const NOT_OF_A_PROGRAM: [Code; 6] = [
    // Of the machine that a program is to run on.
    Code::Travel,
    Code::KeepOut,
    Code::MachineSetting,
    // Of the place where a run is to begin.
    Code::Restart,
    // A fault of the planner itself, found by its audit.
    Code::PathMismatch,
    // The planner and its audit disagree.
    Code::InternalError,
];

/// Where a word is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum In {
    /// The controls of loaded programs.
    Control,
    /// Codes of findings of the planner.
    Code,
    /// The state of the machine and its reason: `HOLD FEED_HOLD`.
    State,
    /// Services and actions that were asked for, and whether they were granted.
    Asked,
    /// How goals of `run_program` ended.
    Goal,
    /// What the planner went on from: another plan in the middle of a run.
    Plan,
    /// What the driver was ordered.
    Order,
}

/// Everything that is said in the golden runs.
fn said() -> BTreeSet<(In, String)> {
    let mut said = BTreeSet::new();
    for bag in std::fs::read_dir(root().join("bags")).expect("bags/ is there") {
        let path = bag.expect("its entries can be read").path();
        if path.is_dir() {
            let mut bag = open_bag(&path).expect("a bag");
            for message in bag.messages() {
                collect(&mut said, &message.expect("it can be read"));
            }
        }
    }
    said
}

fn collect(said: &mut BTreeSet<(In, String)>, message: &BagMessage) {
    // What was recorded with an older definition is read as replay reads it.
    fn of<M: Message>(message: &BagMessage) -> Option<M> {
        let today = TypeInfo::of::<M>().schema_text;
        let then = message.channel.schema.as_ref()?;
        let then = std::str::from_utf8(&then.text).expect("a definition is text");
        if then == today {
            return Some(cdr::decode(&message.data).expect("a message of its type"));
        }
        let schema = |text| MessageSchema::parse(M::TYPE_NAME, text).expect("a definition");
        let then = with_names_of_today(M::TYPE_NAME, schema(then));
        let today = schema(today);
        let value = decode(&then, &message.data).expect("a message of its type");
        let now = encode(&today, &completed(&today, &value)).expect("a message of today");
        Some(cdr::decode(&now).expect("a message of today"))
    }
    match message.channel.type_name() {
        ProgrammedContour::TYPE_NAME => {
            let contour = of::<ProgrammedContour>(message);
            said.extend(contour.map(|contour| (In::Control, contour.control)));
        }
        CompensationReport::TYPE_NAME => {
            for row in of::<CompensationReport>(message).into_iter().flat_map(|it| it.findings) {
                said.insert((In::Code, row.code));
            }
        }
        MachineState::TYPE_NAME => {
            let (state, reason) = state_of(message);
            let name = match state {
                MachineState::STATE_HOLD => "HOLD",
                MachineState::STATE_ALARM => "ALARM",
                MachineState::STATE_DOOR => "DOOR",
                MachineState::STATE_TOOL_CHANGE => "TOOL_CHANGE",
                MachineState::STATE_RUN => "RUN",
                MachineState::STATE_UNKNOWN => "UNKNOWN",
                _ => "",
            };
            said.insert((In::State, format!("{name} {reason}")));
        }
        Command::TYPE_NAME => {
            let Some(command) = of::<Command>(message) else { return };
            let answer = if command.success { "granted" } else { "refused" };
            let asked = format!("{}: {answer}: {}", command.endpoint, command.message);
            said.insert((In::Asked, asked));
        }
        GoalStatusArray::TYPE_NAME if message.channel.topic.contains("run_program") => {
            for goal in of::<GoalStatusArray>(message).into_iter().flat_map(|it| it.status_list) {
                let end = match goal.status {
                    GoalStatus::STATUS_SUCCEEDED => "succeeded",
                    GoalStatus::STATUS_CANCELED => "canceled",
                    GoalStatus::STATUS_ABORTED => "aborted",
                    _ => continue,
                };
                said.insert((In::Goal, end.into()));
            }
        }
        ControllerTraffic::TYPE_NAME => {
            for entry in of::<ControllerTraffic>(message).into_iter().flat_map(|it| it.entries) {
                if entry.kind == TrafficEntry::KIND_COMMAND {
                    said.insert((In::Order, String::from_utf8_lossy(&entry.data).into_owned()));
                }
            }
        }
        CompensatedPath::TYPE_NAME => {
            let path = of::<CompensatedPath>(message);
            if path.is_some_and(|path| path.continues_revision > 0) {
                said.insert((In::Plan, "the rest of a run".into()));
            }
        }
        _ => {}
    }
}

/// State and reason of a machine, by the definition in the bag: later ones have more fields.
fn state_of(message: &BagMessage) -> (u8, String) {
    let schema = message.channel.schema.as_ref().expect("a definition").parse().expect("it is one");
    let state = decode(&schema, &message.data).expect("a message of its type");
    let number = state.get("state").and_then(Value::as_u64).expect("a state");
    let reason = state.get("reason").and_then(Value::as_str).expect("a reason");
    (u8::try_from(number).expect("a state fits"), reason.to_owned())
}

/// What has to be there besides a program of each control: a word, and where.
const CLASSES: &[(In, &str)] = &[
    (In::State, "HOLD FEED_HOLD"),
    (In::State, "TOOL_CHANGE"),
    (In::State, "DOOR"),
    (In::State, "ALARM ALARM:1 "),
    (In::State, "ALARM ALARM:2 "),
    (In::State, "ALARM ALARM:17 "),
    (In::State, "HOLD LINK_LOST"),
    (In::State, "LINK_LOST: "),
    (In::State, "RESTARTED: "),
    (In::State, "does not answer"),
    (In::State, "an answer was lost"),
    (In::State, ": error:"),
    (In::Asked, "/resume: granted"),
    (In::Asked, "/confirm_tool_change: granted"),
    (In::Asked, "/set_tool: granted"),
    (In::Asked, "/set_tool: refused"),
    (In::Goal, "succeeded"),
    (In::Goal, "canceled"),
    (In::Goal, "aborted"),
    (In::Plan, "the rest of a run"),
    (In::Order, r#""in_span":"from_above""#),
];

#[test]
fn every_class_has_a_golden_run() {
    let said = said();
    let has =
        |place: In, word: &str| said.iter().any(|(at, text)| *at == place && text.contains(word));
    let controls = Control::ALL.map(|control| (In::Control, control.name()));
    let wanted = controls.iter().chain(CLASSES);
    let missing: Vec<_> = wanted.filter(|(place, word)| !has(*place, word)).collect();
    assert!(missing.is_empty(), "no golden run has {missing:#?} among {said:#?}");
}

#[test]
fn every_code_of_a_finding_has_a_golden_run() {
    let said = said();
    // What the loader refuses is on record by the name of its file.
    let is_refused_by_the_loader = |code: &Code| {
        let file = format!("/load_program: refused: {}.", code.name());
        said.iter().any(|(at, text)| *at == In::Asked && text.starts_with(&file))
    };
    let missing: Vec<_> = Code::ALL
        .iter()
        .filter(|code| !NOT_OF_A_PROGRAM.contains(code))
        .filter(|code| !said.contains(&(In::Code, code.name().to_owned())))
        .filter(|code| !is_refused_by_the_loader(code))
        .collect();
    assert!(missing.is_empty(), "no golden run has {missing:?}");
}
