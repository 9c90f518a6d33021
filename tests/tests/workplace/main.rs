//! A program against the machine that it would run on: the driver and the virtual controller.

mod boxes;
mod unreadable;

use axis_driver::codes::error_code;
use axis_driver::driver::{
    CheckTravel, Command, DriverConfig, OffsetRequest, Refusal, ReplanRequest, RunOutcome,
    RunRequest,
};
use cnc_msgs::contour::{Action, Source};
use cnc_msgs::further::{FurtherAxes, FurtherMode, FurtherMove};
use cnc_msgs::geometry::{AxisSet, Shape};
use cnc_msgs::keep_out::{Frame, KeepOut, KeepOutBox};
use cnc_msgs::machine::Mode;
use cnc_msgs::path::{CompensatedPath, PathElement, PathEvent, Role};
use kerf_tests::line::{Line, straight};
use std::sync::Arc;
use virtual_controller::{Build, Firmware, Settings};

/// A router of 600 × 400 × 100 mm, homed, whose G54 lies at X-500 Y-300 Z-60.
fn homed(firmware: Firmware, config: DriverConfig) -> Line {
    homed_as(Settings::small_router_of(firmware), config)
}

fn homed_as(mut settings: Settings, config: DriverConfig) -> Line {
    settings.set_line("$22=1").unwrap();
    settings.set_line("$20=1").unwrap();
    let mut line = Line::new(config, Build::new(settings), &[]);
    line.until("locked or idle", |line| matches!(line.mode(), Mode::Alarm | Mode::Idle));
    line.ask(Command::Home).unwrap();
    set_zero(&mut line, [-500.0, -300.0, -60.0]);
    line
}

/// For a machine on which the warnings were seen to be right.
fn refusing() -> DriverConfig {
    DriverConfig { check_travel: CheckTravel::Refuse, ..DriverConfig::default() }
}

fn set_zero(line: &mut Line, position: [f64; 3]) {
    let request = OffsetRequest {
        further: FurtherAxes::NONE,
        system: 1,
        axes: AxisSet::ALL,
        position,
        is_origin: true,
    };
    line.ask(Command::SetWorkOffset(request)).unwrap();
}

/// To these places in a row, from line 1 on.
fn path(ends: &[[f64; 3]]) -> CompensatedPath {
    let element = |(end, line): (&[f64; 3], u32)| PathElement {
        side: None,
        shape: Shape::Line,
        end: *end,
        feed_mm_per_min: Some(1_200.0),
        role: Role::None,
        axes: AxisSet::ALL,
        source: Source { line, block: Some(10 * line), ..Source::default() },
    };
    CompensatedPath { elements: ends.iter().zip(1..).map(element).collect(), ..Default::default() }
}

fn request(path: CompensatedPath) -> RunRequest {
    RunRequest {
        program_id: "part".into(),
        revision: 1,
        path: Arc::new(path),
        start_line: 0,
        occurrence: 0,
        in_span: Default::default(),
        check_only: false,
        tool_diameters_mm: [(1, 6.0)].into(),
    }
}

#[track_caller]
fn refused(line: &mut Line, request: RunRequest) -> Refusal {
    let (then, stands) = (line.now, line.axes());
    let refusal = line.ask(Command::RunProgram(request)).expect_err("it is refused");
    line.wait(1.0);
    // The stored positions may be old: they are asked for, and nothing else is sent.
    assert_eq!(line.said_since(then).replace("$#\n", ""), "");
    assert_eq!((line.axes(), line.mode()), (stands, Mode::Idle));
    refusal
}

#[test]
fn a_program_that_homes_first_is_placed_where_homing_puts_it() {
    let mut settings = Settings::small_router();
    settings.set_line("$22=1").unwrap();
    let mut line = Line::new(refusing(), Build::new(settings), &[]);
    line.until("locked", |line| line.mode() == Mode::Alarm);
    line.ask(Command::Unlock).unwrap();
    line.until("idle", |line| line.mode() == Mode::Idle);
    let homing = |ends: &[[f64; 3]]| {
        let action = Action::Home { axes: AxisSet::ALL };
        let source = Source { line: 1, ..Source::default() };
        let events = vec![PathEvent { at_element: 0, action, source }];
        request(CompensatedPath { events, ..path(ends) })
    };
    // G54 is the machine zero, which homing puts at the top right end of the travel.
    let refusal = refused(&mut line, homing(&[[-10.0, -10.0, -5.0], [10.0, -10.0, -5.0]]));
    assert_eq!(refusal.error_code, error_code::TRAVEL, "{refusal:?}");
    assert!(refusal.message.contains("10.000 mm beyond the travel"), "{refusal:?}");
    line.ask(Command::RunProgram(homing(&[[-10.0, -10.0, -5.0]]))).expect("it fits");
}

#[test]
fn a_program_that_homes_later_is_placed_from_there_on() {
    for firmware in [Firmware::Grbl, Firmware::GrblHal] {
        let mut settings = Settings::small_router_of(firmware);
        settings.set_line("$22=1").unwrap();
        let mut line = Line::new(refusing(), Build::new(settings), &[]);
        line.until("locked or idle", |line| matches!(line.mode(), Mode::Alarm | Mode::Idle));
        if line.mode() == Mode::Alarm {
            line.ask(Command::Unlock).unwrap();
        }
        line.until("idle", |line| line.mode() == Mode::Idle);
        let start = line.axes()[0];
        // X and where it begins are in another frame than what follows.
        let homing = |before: f64, after: f64| {
            let action = Action::Home { axes: AxisSet::NONE };
            let source = Source { line: 2, ..Source::default() };
            let events = vec![PathEvent { at_element: 1, action, source }];
            let ends = [[start + before, -10.0, -5.0], [after, -10.0, -5.0]];
            request(CompensatedPath { events, ..path(&ends) })
        };
        for (before, after, words) in [
            (601.0, -10.0, "needs 601.000 mm in X"),
            (40.0, 10.0, "10.000 mm beyond the travel"),
            (40.0, -610.0, "10.000 mm beyond the travel"),
        ] {
            let refusal = refused(&mut line, homing(before, after));
            assert_eq!(refusal.error_code, error_code::TRAVEL, "{firmware}: {refusal:?}");
            assert!(refusal.message.contains(words), "{firmware}: {refusal:?}");
        }
        let check = RunRequest { check_only: true, ..homing(590.0, -590.0) };
        line.ask(Command::RunProgram(check)).expect("both parts fit, each for itself");
    }
}

const OUT: [[f64; 3]; 3] = [[10.0, 0.0, 5.0], [512.5, 0.0, 5.0], [10.0, 0.0, 5.0]];

#[test]
fn a_program_that_leaves_the_travel_is_refused_before_the_first_byte() {
    for firmware in [Firmware::Grbl, Firmware::GrblHal] {
        let mut line = homed(firmware, refusing());
        let refusal = refused(&mut line, request(path(&OUT)));
        assert_eq!(refusal.error_code, error_code::TRAVEL, "{refusal}");
        let said = "line 2 (N20): the move goes to X12.500 in the machine frame (X512.500 in G54), \
                    12.500 mm beyond the travel from X-600.000 to X0.000; move the work zero of G54 \
                    by at least 12.500 mm towards X-";
        assert!(refusal.message.starts_with(said), "{firmware}: {refusal}");
        // A check says the same, and a single block is no exception.
        let check = RunRequest { check_only: true, ..request(path(&OUT)) };
        assert_eq!(refused(&mut line, check).error_code, error_code::TRAVEL);
        let block = Arc::new(path(&OUT[1..2]));
        let refusal = line
            .ask(Command::ExecuteMdi { path: block, tool_diameters_mm: Default::default() })
            .unwrap_err();
        assert_eq!(refusal.error_code, error_code::TRAVEL, "{refusal}");
        // What the help says helps.
        set_zero(&mut line, [-512.5, -300.0, -60.0]);
        assert_eq!(line.run(path(&OUT)).outcome, RunOutcome::Succeeded);
    }
}

#[test]
fn an_axis_that_turns_beyond_its_travel_is_refused_where_it_is_homed() {
    let turned = |firmware, masks: &[&str], degrees| {
        let settings = Settings::small_router_of(firmware);
        let mut settings = settings.with_axes("XYZA".parse().expect("axes"));
        settings.set_line("$133=180").unwrap();
        masks.iter().for_each(|mask| settings.set_line(mask).unwrap());
        let mut line = homed_as(settings, refusing());
        let axes = FurtherAxes::NONE.with(0, degrees);
        let action = Action::Further(FurtherMove { axes, mode: FurtherMode::Rapid });
        let source = Source { line: 7, ..Source::default() };
        let mut path = path(&[[10.0, 0.0, 5.0]]);
        path.events = vec![PathEvent { at_element: 1, action, source }];
        match line.ask(Command::RunProgram(request(path))) {
            Ok(_) => String::new(),
            Err(refusal) => refusal.message,
        }
    };
    let homed = ["$46=8"];
    let said = "line 7: the move goes to A30.000 in the machine frame (A30.000 in G54), 30.000 \
                degrees beyond the travel from A-180.000 to A0.000";
    let refusal = turned(Firmware::GrblHal, &homed, 30.0);
    assert!(refusal.starts_with(said), "{refusal}");
    assert_eq!(turned(Firmware::GrblHal, &homed, -170.0), "");
    // What is not homed may turn without an end.
    assert_eq!(turned(Firmware::GrblHal, &[], 3_600.0), "");
    assert_eq!(turned(Firmware::Grbl, &[], 3_600.0), "");
}

#[test]
fn the_new_rest_of_a_run_is_judged_like_a_run() {
    let mut line = homed(Firmware::GrblHal, refusing());
    // More than the controller takes in.
    let ends: Vec<_> = (1..=400).map(|number| [f64::from(number), 0.0, 5.0]).collect();
    let old = path(&ends);
    line.ask(Command::RunProgram(request(old.clone()))).expect("it fits");
    line.wait(5.0);
    line.ask(Command::FeedHold).expect("a hold");
    line.until("it stands", |line| line.state().settled_elements > 0);
    let settled = line.state().settled_elements as usize;
    assert!(settled < ends.len(), "one element is left");
    let mut rest = |end: f64, revision| {
        let mut path = old.clone();
        path.elements[399].end[0] = end;
        let path = Arc::new(path);
        let of = line.state().path_revision;
        let request = ReplanRequest { program_id: "part".into(), of, revision, path };
        line.ask(Command::Replan(request))
    };
    let refusal = rest(512.5, 2).expect_err("it leaves the travel");
    assert_eq!(refusal.error_code, error_code::TRAVEL, "{refusal}");
    assert!(refusal.message.starts_with("line 400 (N4000): the move goes to X12.500"), "{refusal}");
    rest(480.0, 3).expect("it fits");
    line.ask(Command::Resume).expect("a resume");
    line.until("the run ends", |line| line.finished.is_some());
    assert!((line.axes()[0] + 20.0).abs() < 0.01, "{:?}", line.axes());
}

#[test]
fn the_new_rest_is_judged_by_the_zero_that_the_program_has_set() {
    let mut line = homed(Firmware::GrblHal, refusing());
    let ends: Vec<_> = (0..400).map(|number| [40.0 + f64::from(number), 0.0, 5.0]).collect();
    let mut old = path(&ends);
    old.elements[0].end[0] = 100.0;
    // X100 is X40 from there on: the zero is 60 mm farther.
    let action = Action::SetWorkOffset {
        system: 1,
        axes: AxisSet::NONE.with(0),
        origin: [40.0, 0.0, 0.0],
        by_position: true,
    };
    let source = Source { line: 1, ..Source::default() };
    old.events = vec![PathEvent { at_element: 1, action, source }];
    line.ask(Command::RunProgram(request(old.clone()))).expect("it fits");
    line.until("the zero is set", |line| line.state().line >= 10);
    line.ask(Command::FeedHold).expect("a hold");
    line.until("it stands", |line| line.state().settled_elements > 0);
    for (end, fits) in [(430.0, true), (445.0, false)] {
        let mut path = old.clone();
        path.elements[399].end[0] = end;
        let of = line.state().path_revision;
        let (program_id, revision, path) = ("part".into(), of + 1, Arc::new(path));
        let request = ReplanRequest { program_id, of, revision, path };
        match line.ask(Command::Replan(request)) {
            Ok(_) => assert!(fits, "{end}"),
            Err(refusal) => {
                assert!(!fits && refusal.message.contains("X5.000"), "{end}: {refusal}")
            }
        }
    }
}

#[test]
fn a_program_that_just_fits_runs_to_both_ends() {
    for firmware in [Firmware::Grbl, Firmware::GrblHal] {
        let mut line = homed(firmware, refusing());
        let corners = [[500.0, 300.0, 60.0], [-100.0, -100.0, 60.0], [-100.0, -100.0, -40.0]];
        let result = line.run(path(&corners));
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware}: {}", result.message);
    }
}

#[test]
fn without_homing_only_a_program_that_is_longer_than_the_machine_is_refused() {
    for firmware in Firmware::ALL {
        let build = Build::new(Settings::small_router_of(firmware));
        let connected = || {
            let mut line = Line::new(refusing(), build.clone(), &[]);
            line.until("idle", |line| line.mode() == Mode::Idle);
            line
        };
        let mut line = connected();
        assert_eq!(line.run(straight(1, 590.0)).outcome, RunOutcome::Succeeded);
        assert!(
            line.log.iter().any(|text| text.contains("only its length was compared")),
            "{:?}",
            line.log
        );
        let mut line = connected();
        let refusal = refused(&mut line, request(straight(1, 601.0)));
        assert_eq!(refusal.error_code, error_code::TRAVEL, "{refusal}");
        assert!(refusal.message.contains("needs 601.000 mm in X"), "{refusal}");
    }
}

#[test]
fn who_wants_it_is_warned_or_left_alone() {
    // Without soft limits, which would stop the machine.
    let run = |check_travel| {
        let config = DriverConfig { check_travel, ..DriverConfig::default() };
        let mut line = homed(Firmware::Grbl, config);
        line.ask(Command::SoftReset).unwrap();
        line.until("idle", |line| line.mode() == Mode::Idle || line.mode() == Mode::Alarm);
        let request = RunRequest { check_only: true, ..request(path(&OUT)) };
        line.ask(Command::RunProgram(request)).expect("it is accepted");
        line.log.iter().any(|text| text.contains("beyond the travel") || text.contains("needs"))
    };
    assert!(run(CheckTravel::Warn));
    assert!(!run(CheckTravel::Off));
}

#[test]
fn a_tool_that_would_touch_a_clamp_is_refused_with_the_name_of_the_clamp() {
    let it = KeepOutBox {
        frame: Frame::Work(1),
        min_mm: [100.0, 2.0, -20.0],
        max_mm: [120.0, 20.0, 15.0],
    };
    let keep_out = KeepOut { keep_out: [("left clamp".to_owned(), it)].into() };
    let config = DriverConfig { keep_out, check_travel: CheckTravel::Off, ..Default::default() };
    let mut line = homed(Firmware::Grbl, config);
    let cut = |y: f64| {
        let mut path = path(&[[10.0, y, 30.0], [10.0, y, 5.0], [200.0, y, 5.0]]);
        let action = Action::ChangeTool { tool: 1 };
        path.events.push(PathEvent { at_element: 0, action, source: Source::default() });
        path
    };
    let refusal = refused(&mut line, request(cut(0.0)));
    assert_eq!(refusal.error_code, error_code::KEEP_OUT, "{refusal}");
    for part in
        ["line 3 (N30): T1 (radius 3.000 mm) touches", "\"left clamp\"", "2.000 mm from the side"]
    {
        assert!(refusal.message.contains(part), "{refusal}");
    }
    let accepted = line.ask(Command::RunProgram(request(cut(-1.5))));
    accepted.expect("it passes with 0.5 mm");
}

/// Lines from another port of the board, which answers there.
fn pendant(line: &mut Line, text: &str) {
    line.inject("mute:ok");
    let now = line.now;
    line.controller.device_mut().controller_mut().receive(now, format!("{text}\n").as_bytes());
    line.wait(0.01);
}

#[test]
fn what_fits_since_a_pendant_has_moved_the_zero_is_not_refused() {
    for firmware in [Firmware::Grbl, Firmware::GrblHal] {
        // Right before the goal, and long before it: then it is known.
        for (waits_s, asks) in [(0.0, 1), (3.0, 0)] {
            for is_check in [true, false] {
                let mut line = homed(firmware, refusing());
                line.wait(1.0);
                let then = line.now;
                pendant(&mut line, "G10L2P1X-520");
                line.wait(waits_s);
                assert_eq!(line.said_since(then).matches("$#").count(), 1 - asks, "{firmware}");
                let then = line.now;
                let check = RunRequest { check_only: is_check, ..request(path(&OUT)) };
                line.ask(Command::RunProgram(check)).expect("it fits");
                if is_check {
                    assert_eq!(line.said_since(then).matches("$#").count(), asks, "{firmware}");
                    continue;
                }
                line.until("the run ends", |line| line.finished.is_some());
                let result = line.finished.take().expect("it ends");
                assert_eq!(result.outcome, RunOutcome::Succeeded, "{}", result.message);
            }
        }
        // A work system that is not the one in force shows in no report.
        let mut line = homed(firmware, refusing());
        pendant(&mut line, "G10L2P2X-520Y-300Z-60");
        let mut other = path(&OUT);
        let action = Action::WorkOffset { system: 2 };
        other.events.push(PathEvent { at_element: 0, action, source: Source::default() });
        assert_eq!(line.run(other).outcome, RunOutcome::Succeeded, "{firmware}");
    }
}

#[test]
fn a_controller_that_does_not_say_its_offsets_leaves_the_refusal() {
    let mut line = homed(Firmware::Grbl, refusing());
    line.wait(1.0);
    line.inject("mute:ok");
    let refusal = line.ask(Command::RunProgram(request(path(&OUT)))).expect_err("it is refused");
    assert_eq!(refusal.error_code, error_code::TRAVEL, "{refusal}");
}

#[test]
fn a_zero_that_a_pendant_has_moved_counts_before_the_first_line() {
    for (x, fits) in [(-400, true), (-5, false)] {
        let mut line = homed(Firmware::Grbl, refusing());
        // The driver sees it when it asks for the offsets, after the check.
        line.wait(1.0);
        line.inject("mute:ok");
        let now = line.now;
        let text = format!("G10L2P1X{x}\n");
        line.controller.device_mut().controller_mut().receive(now, text.as_bytes());
        line.wait(0.01);
        let stands = line.axes();
        line.begin(Command::RunProgram(request(path(&OUT[2..]))));
        line.until("the run ends", |line| line.finished.is_some());
        let result = line.finished.take().expect("it ends");
        if fits {
            assert_eq!(result.outcome, RunOutcome::Succeeded, "{}", result.message);
            continue;
        }
        let found = (result.outcome, result.error_code);
        assert_eq!(found, (RunOutcome::Aborted, error_code::TRAVEL), "{}", result.message);
        assert!(result.message.contains("X5.000 in the machine frame"), "{}", result.message);
        assert_eq!(line.axes(), stands);
    }
}
