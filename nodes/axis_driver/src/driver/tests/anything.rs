//! Whatever comes in whatever order: no panic, no motion without a run, the same again.

use super::bench::{straight, with_event};
use super::replan::Rests;
use super::*;
use crate::journal::{Journal, replay};
use cnc_msgs::contour::{Action, Probe};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::path::CompensatedPath;
use proptest::prelude::*;
use std::sync::Arc;

const LINES: [&str; 24] = [
    "ok",
    "ok",
    "ok",
    "error:20",
    "ALARM:1",
    "ALARM:3",
    "ALARM:9",
    "Grbl 1.1h ['$' for help]",
    "<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>",
    "<Idle|MPos:0.000,0.000,0.000|FS:0,0>",
    "<Run|MPos:5.000,0.000,0.000|Bf:12,90|FS:600,0>",
    "<Hold:1|MPos:5.000,0.000,0.000|FS:0,0>",
    "<Hold:0|MPos:5.000,0.000,0.000|FS:0,0>",
    "<Alarm|MPos:0.000,0.000,0.000|FS:0,0>",
    "<Door:2|MPos:0.000,0.000,0.000|FS:0,0>",
    "<Sleep|MPos:0.000,0.000,0.000|FS:0,0>",
    "[OPT:V,15,128]",
    "[OPT:V,0,0]",
    "$13=1",
    "okok",
    "[PRB:5.000,0.000,0.000:1]",
    "[PRB:5.000,0.000,0.000:0]",
    "garbage",
    "\u{fffd}\u{0}",
];

#[derive(Debug, Clone)]
enum FuzzStep {
    Line(usize),
    Fragment(Vec<u8>),
    Command(usize),
    Wait(u64),
    Open,
    Close,
}

fn step() -> impl Strategy<Value = FuzzStep> {
    prop_oneof![
        8 => (0..LINES.len()).prop_map(FuzzStep::Line),
        1 => prop::collection::vec(any::<u8>(), 0..40).prop_map(FuzzStep::Fragment),
        4 => (0usize..26).prop_map(FuzzStep::Command),
        4 => (0u64..3000).prop_map(FuzzStep::Wait),
        1 => Just(FuzzStep::Open),
        1 => Just(FuzzStep::Close),
    ]
}

fn command(index: usize, path: &Arc<CompensatedPath>) -> Command {
    let request = |check_only| RunRequest {
        program_id: "part".into(),
        revision: 1,
        path: path.clone(),
        start_line: 0,
        occurrence: 0,
        in_span: Default::default(),
        check_only,
        tool_diameters_mm: Default::default(),
    };
    match index {
        0 | 1 => Command::RunProgram(request(index == 1)),
        2 => Command::CancelRun { run: None },
        3 => Command::FeedHold,
        4 => Command::Resume,
        5 => Command::SoftReset,
        6 => Command::Unlock,
        7 => Command::Home,
        8 => Command::ConfirmToolChange { objection: None },
        9 => Command::ExecuteMdi {
            path: Arc::new(straight(1)),
            tool_diameters_mm: Default::default(),
        },
        10 | 11 => Command::SetSingleBlock(index == 10),
        12 => Command::Jog(JogRequest {
            further: FurtherAxes::NONE,
            frame: JogFrame::Relative,
            axes: AxisSet::NONE.with(0),
            target: [5.0, 0.0, 0.0],
            feed_mm_per_min: 100.0,
        }),
        13 => Command::Probe(ProbeRequest {
            further: FurtherAxes::NONE,
            axes: AxisSet::NONE.with(2),
            distance: [0.0, 0.0, -5.0],
            feed_mm_per_min: 100.0,
            away: false,
            may_miss: false,
        }),
        14 => Command::SetWorkOffset(OffsetRequest {
            further: FurtherAxes::NONE,
            system: 1,
            axes: AxisSet::ALL,
            position: [0.0; 3],
            is_origin: false,
        }),
        15 => Command::SetOverrides(Overrides { feed: Some(83), ..Overrides::default() }),
        16 => Command::DoorHold,
        17 => Command::Sleep,
        18 => Command::Heartbeat,
        19 => Command::CancelRun { run: Some(12) },
        20 => Command::ConfirmToolChange { objection: Some("another tool".into()) },
        21 => Command::Activate,
        22 => Command::Deactivate,
        23 => Command::ForgetCommander,
        24 => Command::SetConfig(Box::new(DriverConfig {
            poll_interval_ms: 70,
            ..DriverConfig::default()
        })),
        _ => Command::Shutdown,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn no_sequence_of_inputs_is_a_panic_or_moves_without_a_run(
        connect in any::<bool>(),
        steps in prop::collection::vec(step(), 1..150),
    ) {
        let path = with_event(straight(30), 4, Action::ChangeTool { tool: 2 });
        let path = with_event(path, 6, Action::Home { axes: AxisSet::ALL });
        let mut path = with_event(path, 7, Action::Probe(Probe { away: false, may_miss: false }));
        path.events[2].source = path.elements[7].source;
        let path = Arc::new(path);
        let mut driver = Driver::new(DriverConfig::default());
        let mut journal = Journal::default();
        let (mut entries, mut outputs) = (Vec::new(), Vec::new());
        let mut now = Duration::ZERO;
        let mut open_requests = Vec::new();
        let mut inputs = Vec::new();
        let mut rests = Rests::default();
        if connect {
            inputs.push(Input::PortOpened);
            for line in [8, 7, 0, 0, 0, 0, 8] {
                inputs.push(Input::Received(format!("{}\r\n", LINES[line]).into_bytes()));
            }
        }
        for (id, step) in (0..).zip(steps) {
            inputs.push(match step {
                FuzzStep::Line(line) => Input::Received(format!("{}\r\n", LINES[line]).into_bytes()),
                FuzzStep::Fragment(bytes) => Input::Received(bytes),
                FuzzStep::Command(index) => Input::Command { id, command: command(index, &path) },
                FuzzStep::Wait(milliseconds) => {
                    now += Duration::from_millis(milliseconds);
                    Input::Timer
                }
                FuzzStep::Open => Input::PortOpened,
                FuzzStep::Close => Input::PortClosed { reason: "gone".into() },
            });
        }
        for input in inputs {
            now += Duration::from_millis(7);
            if let Input::Command { id, .. } = &input {
                open_requests.push(*id);
            }
            let was_running = matches!(driver.phase, Phase::Running(_));
            rests.mark(&driver, now, entries.len(), outputs.len());
            entries.push(journal.input(now, &input));
            driver.handle(now, input);
            let is_running = matches!(driver.phase, Phase::Running(_));
            while let Some(output) = driver.poll_output() {
                match output {
                    Output::Transmit(bytes) => {
                        let is_motion = bytes.contains(&b'X') && !bytes.windows(2).any(|b| b == b"$X");
                        let by_hand = matches!(driver.phase, Phase::Manual(_));
                        prop_assert!(!is_motion || was_running || is_running || by_hand);
                        prop_assert!(driver.is_open());
                        entries.push(journal.transmitted(now, &bytes));
                    }
                    output => {
                        if let Output::Reply { id, .. } = &output {
                            let index = open_requests.iter().position(|open| open == id);
                            prop_assert!(index.is_some(), "{id} was answered twice");
                            open_requests.remove(index.unwrap());
                        }
                        outputs.push((now, output));
                    }
                }
            }
            prop_assert!(driver.context.link.unanswered_bytes() <= driver.window().max(80));
        }
        let again = replay(&entries, &|_, _| Some(path.clone()), DriverConfig::default()).unwrap();
        prop_assert_eq!(again.first_difference(&entries), None);
        prop_assert!(again.outputs == outputs);
        let lookup = |_: &str, _| Some(path.clone());
        prop_assert_eq!(rests.failures(&entries, &outputs, &lookup), 0);
        // In time every command has its answer.
        for _ in 0..3000 {
            now += Duration::from_millis(200);
            driver.handle(now, Input::Timer);
            while let Some(output) = driver.poll_output() {
                if let Output::Reply { id, .. } = output {
                    open_requests.retain(|open| *open != id);
                }
            }
        }
        prop_assert!(open_requests.is_empty(), "never answered: {open_requests:?}");
    }
}
