//! When commands are due, and what is rejected, for runs that are written down here.

use super::*;
use axis_driver::driver::{ReplanRequest, RunRequest};
use axis_driver::report::{ReportUnits, parse};
use cnc_msgs::geometry::Shape;
use cnc_msgs::path::{CompensatedPath, PathElement};
use cnc_msgs::units::point_from_position;
use cnc_msgs::wire::action_msgs::msg::GoalStatus;

const RUN: u8 = MachineState::STATE_RUN;
const HOLD: u8 = MachineState::STATE_HOLD;
const TOOL: u8 = MachineState::STATE_TOOL_CHANGE;
const IDLE: u8 = MachineState::STATE_IDLE;

fn received(line: &str) -> Happened {
    Happened::Received(parse(line.as_bytes(), ReportUnits::Millimetres))
}

fn state(state: u8, line: u32, path_revision: u64) -> MachineState {
    let machine_position = point_from_position([0.0, 0.0, 5.0]);
    let tool_wanted = u32::from(state == TOOL) * 2;
    MachineState {
        state,
        line,
        path_revision,
        tool_wanted,
        position_known: true,
        machine_position,
        ..MachineState::default()
    }
}

/// A run from X0 to X100 and back with one event a second after the goal, and states by the second
/// in which they were published.
fn script_of(
    happened: Vec<Happened>,
    states: &[(i64, MachineState)],
) -> Result<Vec<Cue>, ReplayError> {
    script_from(0, happened, states)
}

/// The same, started at a line of the program.
fn script_from(
    start_line: u32,
    happened: Vec<Happened>,
    states: &[(i64, MachineState)],
) -> Result<Vec<Cue>, ReplayError> {
    let element = |x: f64| PathElement {
        shape: Shape::Line,
        end: [x, 0.0, 0.0],
        feed_mm_per_min: Some(600.0),
        role: Default::default(),
        side: None,
        axes: Default::default(),
        source: Default::default(),
    };
    let elements = [100.0, 0.0].map(element).to_vec();
    let path = Arc::new(CompensatedPath { elements, ..CompensatedPath::default() });
    let goal = RunRequest {
        program_id: "part".into(),
        revision: 1,
        path,
        start_line,
        occurrence: 0,
        in_span: Default::default(),
        check_only: false,
        tool_diameters_mm: Default::default(),
    };
    let ns = |second: usize| second as i64 * 1_000_000_000;
    let events = happened.into_iter().enumerate();
    let run = RunHistory {
        id: 1,
        goal,
        began_ns: 0,
        events: events.map(|(at, what)| Event { stamp_ns: ns(at + 1), what }).collect(),
        states: states.iter().map(|(at, state)| (*at * 1_000_000_000, state)).collect(),
        status: Some(GoalStatus::STATUS_SUCCEEDED),
        is_single_block: false,
    };
    script(&Recording::default(), &run).map(|script| script.cues)
}

#[test]
fn a_command_is_due_at_a_place_of_a_moving_machine_and_in_a_state_of_a_standing_one() {
    let cues = script_of(
        vec![
            received("ok"),
            received("<Run|MPos:30.000,0.000,5.000|FS:600,0>"),
            Happened::Asked(Command::FeedHold),
            Happened::Acted(b'!'),
            received("ok"),
            received("<Hold:1|MPos:31.000,0.000,5.000|FS:100,0>"),
            received("<Hold:0|MPos:31.500,0.000,5.000|FS:0,0>"),
            Happened::Asked(Command::Resume),
            received("<Run|MPos:70.000,0.000,5.000|FS:600,0>"),
            received("<Run|MPos:60.000,0.000,5.000|FS:600,0>"),
            Happened::Asked(Command::SetOverrides(Overrides::default())),
            received("<Idle|MPos:0.000,0.000,5.000|FS:0,0>"),
            Happened::Asked(Command::ConfirmToolChange { objection: None }),
            Happened::Asked(Command::Heartbeat),
            // After the end of the run.
            Happened::Asked(Command::Resume),
        ],
        &[
            (0, state(RUN, 3, 1)),
            (7, state(HOLD, 4, 1)),
            (9, state(RUN, 5, 1)),
            (12, state(TOOL, 6, 1)),
            (14, state(IDLE, 7, 0)),
        ],
    )
    .unwrap();
    let [hold, resume, overrides, confirm] = &cues[..] else { panic!("{cues:?}") };

    let When::Moving(watch) = &hold.when else { panic!("{hold:?}") };
    assert_eq!(watch.place, WatchPlace::StopsAt([31.5, 0.0, 5.0]));
    assert_eq!((watch.along_mm, watch.answers, watch.state), (Some(31.5), 1, RUN));
    assert!(hold.stops() && hold.line == 3);
    assert_eq!(
        hold.when.text(),
        "to stop at X31.500 Y0.000 Z5.000 (machine), 31.500 mm along its path, after 1 lines"
    );

    let stand = |state, tool_wanted, answers| {
        When::Standing(Stand { state, tool_wanted, answers, paths: 1 })
    };
    // An answer may have been in transit when it stopped.
    assert_eq!(resume.when, stand(HOLD, 0, 0));

    let When::Moving(watch) = &overrides.when else { panic!("{overrides:?}") };
    assert_eq!(watch.place, WatchPlace::Passes([60.0, 0.0, 5.0]));
    assert_eq!(watch.along_mm, Some(140.0), "on its way back");
    assert!(!overrides.stops());

    assert_eq!(confirm.when, stand(TOOL, 2, 0));
    assert_eq!(confirm.when.text(), "in TOOL_CHANGE for T2, after 0 lines");
}

#[test]
fn a_controller_that_reports_work_positions_is_followed_as_well() {
    let mut began = state(RUN, 1, 1);
    began.machine_position = point_from_position([-200.0, 0.0, 0.0]);
    began.work_position = point_from_position([0.0; 3]);
    let cues = script_of(
        vec![
            received("<Run|WPos:30.000,0.000,0.000|FS:600,0>"),
            Happened::Asked(Command::CancelRun { run: Some(1) }),
            received("<Hold:0|WPos:31.000,0.000,0.000|FS:0,0>"),
        ],
        &[(0, began)],
    )
    .unwrap();
    let When::Moving(watch) = &cues[0].when else { panic!("{cues:?}") };
    assert_eq!(watch.place, WatchPlace::StopsAt([-169.0, 0.0, 0.0]));
    assert_eq!(watch.along_mm, Some(31.0));
    assert_eq!(cues[0].act, Act::CancelGoal);
}

#[test]
fn a_tool_was_set_before_the_rest_was_planned_with_it() {
    let event = |second: i64, what| Event { stamp_ns: second, what };
    let rest = |of| {
        Happened::Asked(Command::Replan(ReplanRequest {
            program_id: "part".into(),
            of,
            revision: of + 1,
            path: Arc::default(),
        }))
    };
    let events = [
        event(1, Happened::Asked(Command::FeedHold)),
        event(2, rest(1)),
        event(5, Happened::Asked(Command::Resume)),
        event(6, Happened::Asked(Command::FeedHold)),
        event(7, received("ok")),
        event(8, rest(2)),
        event(9, received("ok")),
    ];
    for (after, answered, before) in [
        (0, 3, (2, 1)),
        (0, 4, (2, 1)),
        (3, 4, (4, 2)),
        (0, 7, (7, 5)),
        (0, 9, (8, 5)),
        (7, 99, (8, 5)),
        (8, 99, (99, 7)),
    ] {
        assert_eq!(before_its_rest(&events, after, answered), before, "{after} {answered}");
    }
    assert_eq!(before_its_rest(&[], 0, 3), (3, 0));
    // What was planned from the result of a probe has nothing to do with a tool; a rest of it does.
    let answer = Ok("part".to_owned());
    let events = [
        event(1, Happened::Asked(Command::ProgramContinued { of: 1, answer })),
        event(2, rest(1)),
        event(3, Happened::Asked(Command::FeedHold)),
        event(4, rest(2)),
    ];
    assert_eq!(before_its_rest(&events, 0, 2), (2, 2));
    assert_eq!(before_its_rest(&events, 0, 5), (4, 3));
}

#[test]
fn events_that_cannot_be_played_are_rejected_by_name_line_and_time() {
    let opened = received("<Door:0|MPos:1.000,0.000,5.000|FS:0,0>");
    let banner = received("Grbl 1.1h ['$' for help]");
    for (happened, says) in [
        (vec![received("ALARM:2")], "an ALARM:2 at line 3, 1.000 s after the goal"),
        (
            vec![received("ok"), received("error:20")],
            "an error:20 of the controller at line 3, 2.000 s",
        ),
        (vec![banner.clone()], "a controller that restarted"),
        (vec![received("<Alarm|MPos:0,0,0|FS:0,0>")], "an alarm"),
        (vec![opened.clone()], "an opened door"),
        (vec![Happened::Acted(b'!')], "a hold that the driver gave by itself"),
        (
            vec![Happened::Asked(Command::FeedHold), Happened::Acted(b'~'), Happened::Acted(b'!')],
            "a hold that the driver gave by itself",
        ),
        (vec![Happened::Opened], "a port that was opened again"),
        (vec![Happened::Closed("pulled".into())], "a cut link (pulled)"),
        (vec![Happened::Asked(Command::Home)], "homing"),
        (vec![Happened::Asked(Command::Sleep)], "put to sleep"),
        (vec![Happened::Asked(Command::Unlock)], "an unlock"),
        (vec![Happened::Asked(Command::Deactivate)], "lifecycle"),
    ] {
        let refused = script_of(happened, &[(0, state(RUN, 3, 1))]).unwrap_err().to_string();
        assert!(refused.contains(says), "{refused:?} does not say {says:?}");
        assert!(refused.ends_with(", which the stack level does not play"), "{refused}");
    }
    for (reason, says) in [
        ("LINK_LOST: the controller does not answer", "a lost link at line 3"),
        (COMMANDER_LOST, "a lost commander at line 3"),
        (PATH_DEVIATION, "a deviation from the path at line 3"),
    ] {
        let lost = MachineState { reason: reason.into(), ..state(HOLD, 3, 1) };
        let refused = script_of(Vec::new(), &[(0, lost)]).unwrap_err().to_string();
        assert!(refused.contains(says), "{refused}");
    }

    // Stops on request are no trouble, nor are events after the run.
    for happened in
        [vec![Happened::Asked(Command::DoorHold), opened], vec![Happened::Acted(0x18), banner]]
    {
        script_of(happened, &[(0, state(RUN, 3, 1))]).unwrap();
    }
    let over = [(0, state(RUN, 3, 1)), (1, state(IDLE, 4, 0))];
    let cues = script_of(vec![received("ok"), received("ALARM:1")], &over).unwrap();
    assert_eq!(cues, []);
}

#[test]
fn a_start_in_the_middle_is_played_unless_the_tool_was_lifted_first() {
    let sent = |second: &str| {
        let lines = [PREAMBLE, "$G", second];
        lines.map(|text| Happened::Sent(text.into())).to_vec()
    };
    let states = [(0, state(RUN, 3, 1))];
    let refused = script_from(8, sent("G53G0Z60"), &states).unwrap_err().to_string();
    assert!(refused.contains("an approach (it needs a homed machine)"), "{refused}");
    script_from(8, sent("S80"), &states).unwrap();
    // A program that moves in the machine frame first was not started in the middle.
    script_from(0, sent("G53G0Z60"), &states).unwrap();
}

#[test]
fn a_run_without_a_machine_position_cannot_be_played() {
    let nowhere = MachineState { position_known: false, ..state(RUN, 3, 1) };
    let refused = script_of(Vec::new(), &[(0, nowhere)]).unwrap_err().to_string();
    assert!(refused.contains("a position of the machine"), "{refused}");
}
