//! A line or an answer that is lost or comes twice, in the middle of a run: held within the
//! bounds that docs/faults.md states, on each firmware and with each `$10`; and no false
//! alarm where nothing is wrong.

use axis_driver::codes::error_code;
use axis_driver::driver::{
    Command, DriverConfig, OnPathDeviation, ProbeRequest, RunOutcome, RunResult,
};
use cnc_msgs::contour::{Action, SpindleMode};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{Arc, AxisSet, Plane, Shape};
use cnc_msgs::machine::{LinkWatch, Mode};
use cnc_msgs::path::CompensatedPath;
use kerf_tests::line::{Line, events, short_segments, straight};
use std::time::Duration;
use virtual_controller::{Build, ByteFault, Direction, FaultAction, Firmware, Settings};

/// docs/faults.md: from the damage to the hold, where lines take no longer than 50 ms.
const BOUND_S: f64 = 1.0;

/// What `$10` may be: without a buffer field, and with.
fn masks(firmware: Firmware) -> [(u16, LinkWatch); 2] {
    match firmware {
        Firmware::Grbl => [(1, LinkWatch::Lines), (3, LinkWatch::LinesAndBuffer)],
        // All but bit 1, and all of the default.
        Firmware::GrblHal => [(509, LinkWatch::Lines), (511, LinkWatch::LinesAndBuffer)],
        // It reports no size that its field could be compared with.
        Firmware::FluidNc => [(1, LinkWatch::Lines), (3, LinkWatch::Lines)],
    }
}

const DAMAGES: [FaultAction; 4] =
    [FaultAction::LoseOk, FaultAction::ExtraOk, FaultAction::LoseLine, FaultAction::ExtraLine];

fn connected(firmware: Firmware, mask: u16, config: DriverConfig) -> Line {
    let mut settings = Settings::small_router_of(firmware);
    settings.set_line(&format!("$10={mask}")).unwrap();
    let start_in_machine = Some([-300.0, -200.0, -50.0]);
    let build = Build { start_in_machine, probe_surface_z_mm: Some(-55.0), ..Build::new(settings) };
    let mut line = Line::new(config, build, &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.zero_here();
    line
}

/// Runs the path, does the damage so long after its start, and says how it ended and how
/// many seconds after the damage the driver wrote a hold.
fn damaged(
    line: &mut Line,
    path: CompensatedPath,
    after_s: f64,
    damage: FaultAction,
) -> (RunResult, Option<f64>) {
    line.start(path, 0);
    line.wait(after_s);
    let then = line.now;
    line.controller.device_mut().inject(then, damage);
    let result = line.result();
    let is_hold = |(at, bytes): &&(Duration, Vec<u8>)| *at >= then && bytes.contains(&b'!');
    let hold = line.written.iter().find(is_hold);
    (result, hold.map(|(at, _)| at.saturating_sub(then).as_secs_f64()))
}

#[test]
fn what_is_lost_or_comes_twice_is_held_within_the_bound_wherever_it_happens() {
    let mut worst = 0.0_f64;
    for firmware in Firmware::ALL {
        for (mask, watch) in masks(firmware) {
            for damage in DAMAGES {
                for place in 0..5 {
                    let mut line = connected(firmware, mask, DriverConfig::default());
                    assert_eq!(line.state().link_watch, watch, "{firmware:?} {mask}");
                    let after_s = 0.4 + 0.61 * f64::from(place);
                    let path = short_segments(1_200, 1.0);
                    let (result, held) = damaged(&mut line, path, after_s, damage.clone());
                    let place = format!("{firmware:?} $10={mask} {damage:?} after {after_s} s");
                    assert_eq!(result.error_code, error_code::PROTOCOL, "{place}: {result:?}");
                    assert!(line.state().needs_reset, "{place}");
                    let held = held.expect("a hold was written");
                    worst = worst.max(held);
                    assert!(held <= BOUND_S, "{place}: held after {held:.2} s: {result:?}");
                }
            }
        }
    }
    // The bound is a promise with room, not a guess far off.
    assert!(worst > BOUND_S / 4.0, "the slowest hold came {worst:.2} s after the damage");
}

#[test]
fn with_a_full_planner_the_hold_comes_before_the_tool_gets_to_the_place() {
    for firmware in [Firmware::Grbl, Firmware::GrblHal] {
        for (mask, _) in masks(firmware) {
            for damage in [FaultAction::LoseLine, FaultAction::ExtraLine] {
                // Half a second a line; the planner is full from the beginning to near the end.
                let mut line = connected(firmware, mask, DriverConfig::default());
                let mut path = straight(260, 1.0);
                for element in &mut path.elements {
                    element.feed_mm_per_min = Some(120.0);
                }
                line.start(path, 0);
                line.wait(20.25);
                let then = line.now;
                line.controller.device_mut().inject(then, damage.clone());
                // The next line is the one that suffers, or a check is.
                let said = line.said_since(Duration::ZERO);
                let is_of_the_path = |line: &&str| line.contains('X');
                let suffers = said.lines().filter(is_of_the_path).count() as u32 + 1;
                let result = line.result();
                let place = format!("{firmware:?} $10={mask} {damage:?} of line {suffers}");
                assert_eq!(result.error_code, error_code::PROTOCOL, "{place}: {result:?}");
                assert!(result.last_line < suffers, "{place}: {result:?}");
            }
        }
    }
}

#[test]
fn without_checks_and_without_a_buffer_field_the_state_says_that_standstill_is_awaited() {
    let config = DriverConfig { line_check_interval_ms: 0, ..DriverConfig::default() };
    for (firmware, mask, watch) in [
        (Firmware::Grbl, 1, LinkWatch::Standstill),
        (Firmware::Grbl, 3, LinkWatch::Buffer),
        (Firmware::GrblHal, 511, LinkWatch::Buffer),
        (Firmware::FluidNc, 3, LinkWatch::Standstill),
    ] {
        let mut line = connected(firmware, mask, config.clone());
        assert_eq!(line.state().link_watch, watch, "{firmware:?} {mask}");
        let path = short_segments(300, 1.0);
        let (result, _) = damaged(&mut line, path, 0.4, FaultAction::LoseOk);
        assert_eq!(result.error_code, error_code::PROTOCOL, "{firmware:?} {mask}: {result:?}");
    }
}

#[test]
fn the_controller_is_configured_when_asked_and_in_nothing_else() {
    for (firmware, mask, wanted) in [
        (Firmware::Grbl, 1, Some(3)),
        (Firmware::GrblHal, 509, Some(511)),
        (Firmware::FluidNc, 1, None),
    ] {
        let mut line = connected(firmware, mask, DriverConfig::default());
        let settings = |line: &Line| -> Vec<String> {
            line.controller.device().controller().settings().listing().collect()
        };
        let before = settings(&line);
        let then = line.now;
        let plan = line.ask(Command::Configure { write: false });
        assert_eq!(line.said_since(then), "", "{firmware:?}: a question writes nothing");
        let Some(wanted) = wanted else {
            for write in [false, true] {
                let refusal = line.ask(Command::Configure { write }).unwrap_err();
                assert_eq!(refusal.error_code, error_code::NOTHING_TO_DO, "{firmware:?}");
            }
            continue;
        };
        let change = format!("$10={wanted}, was $10={mask}: adds Bf");
        assert!(plan.clone().unwrap().contains(&change), "{plan:?}");
        let done = line.ask(Command::Configure { write: true }).unwrap();
        assert!(done.starts_with(&format!("written and read back: {change}")), "{done}");
        let changed: Vec<String> =
            settings(&line).into_iter().filter(|it| !before.contains(it)).collect();
        assert_eq!(changed.len(), 1, "{changed:?}");
        assert!(changed[0].contains(&format!("$10={wanted}")), "{changed:?}");
        line.wait(1.0);
        assert_eq!(line.state().link_watch, LinkWatch::LinesAndBuffer);
        let again = line.ask(Command::Configure { write: true }).unwrap_err();
        assert_eq!(again.error_code, error_code::NOTHING_TO_DO, "{again}");
        line.start(straight(20, 10.0), 0);
        let refusal = line.ask(Command::Configure { write: true }).unwrap_err();
        assert_eq!(refusal.error_code, error_code::BUSY, "it is not written during a run");
    }
}

/// Lines, arcs of a quarter of a minute, dwells, a spindle, a tool change.
fn slow_things() -> CompensatedPath {
    let mut path = straight(60, 2.0);
    for index in (5..60).step_by(9) {
        let from = path.elements[index - 1].end;
        let center = [from[0], from[1] + 40.0, 0.0];
        path.elements[index].shape =
            Shape::Arc(Arc { center, plane: Plane::Xy, clockwise: false, turns: 1 });
        path.elements[index].end = from;
    }
    path.events = events(&[
        (0, Action::SpindleSpeed { rpm: 5_000.0 }),
        (0, Action::Spindle(SpindleMode::Clockwise)),
        (10, Action::Dwell { seconds: 3.0 }),
        (20, Action::ChangeTool { tool: 2 }),
        (20, Action::Spindle(SpindleMode::Clockwise)),
        (30, Action::ExactStop),
        (40, Action::Dwell { seconds: 0.2 }),
        (60, Action::ProgramEnd { rewind: true }),
    ]);
    path
}

#[test]
fn nothing_is_noticed_where_nothing_is_wrong() {
    for firmware in Firmware::ALL {
        for (mask, _) in masks(firmware) {
            // A line of before the year 2000 too: reports take as long as the interval.
            for baud in [115_200, 19_200] {
                let config = DriverConfig { baud, ..DriverConfig::default() };
                let mut line = connected(firmware, mask, config);
                let place = format!("{firmware:?} $10={mask} at {baud} baud");
                let probe = Command::Probe(ProbeRequest {
                    further: FurtherAxes::NONE,
                    axes: AxisSet::NONE.with(2),
                    distance: [0.0, 0.0, -10.0],
                    feed_mm_per_min: 100.0,
                    away: false,
                    may_miss: false,
                });
                line.ask(probe).unwrap();
                assert_eq!(line.move_result().outcome, RunOutcome::Succeeded, "{place}");
                line.start(slow_things(), 0);
                line.until("the tool change", |line| line.mode() == Mode::ToolChange);
                line.wait(7.0);
                line.ask(Command::ConfirmToolChange { objection: None }).unwrap();
                // The line stalls now and then; all comes, in order.
                for _ in 0..6 {
                    line.wait(4.0);
                    let stall = |direction| FaultAction::Delay { direction, seconds: 0.25 };
                    let now = line.now;
                    for direction in [Direction::FromController, Direction::ToController] {
                        line.controller.device_mut().inject(now, stall(direction));
                    }
                }
                let result = line.result();
                assert_eq!(result.outcome, RunOutcome::Succeeded, "{place}: {result:?}");
                let mut path = short_segments(1_500, 0.5);
                let at = line.state().work_position.unwrap();
                for element in &mut path.elements {
                    element.end.iter_mut().zip(at).for_each(|(end, at)| *end += at);
                }
                path.start = at;
                let result = line.run(path);
                assert_eq!(result.outcome, RunOutcome::Succeeded, "{place}: {result:?}");
                let checks = line.said_since(Duration::ZERO).matches("$G\n").count();
                assert!(checks > 10, "{place}: {checks} checks");
            }
        }
    }
}

#[test]
fn a_check_whose_answer_is_lost_names_that_as_well() {
    let mut line = connected(Firmware::Grbl, 1, DriverConfig::default());
    line.start(short_segments(1_200, 1.0), 0);
    line.wait(0.4);
    line.inject("mute:[GC:");
    let result = line.result();
    assert_eq!(result.error_code, error_code::PROTOCOL, "{result:?}");
    assert!(result.message.contains("the answer to the check was damaged"), "{result:?}");
}

#[test]
fn nothing_after_a_refused_line_is_drawn_where_the_firmware_skips_it() {
    let mut refused = 0;
    for mask in [509, 511] {
        for place in 0..40 {
            // A line that is executed wrongly is another matter.
            let on_path_deviation = OnPathDeviation::Off;
            let config = DriverConfig { on_path_deviation, ..DriverConfig::default() };
            let mut line = connected(Firmware::GrblHal, mask, config);
            let zero = line.axes();
            line.controller.device_mut().controller_mut().keep_drawn();
            let path = straight(200, 1.0);
            let ends: Vec<_> = path.elements.iter().map(|element| element.end).collect();
            let after_s = 0.002 * f64::from(place);
            let spoilt = FaultAction::Byte(Direction::ToController, ByteFault::Corrupt);
            let (result, _) = damaged(&mut line, path, after_s, spoilt);
            if result.error_code != error_code::CONTROLLER_ERROR {
                continue;
            }
            refused += 1;
            line.wait(1.0);
            let drawn = line.controller.device_mut().controller_mut().take_drawn();
            let is_at = |at: [f64; 3], end: &[f64; 3]| {
                (0..3).all(|axis| (end[axis] + zero[axis] - at[axis]).abs() < 1e-3)
            };
            let last = drawn
                .last()
                .and_then(|last| ends.iter().position(|end| is_at(last.end_in_machine, end)));
            let drawn = last.map_or(0, |index| index as u32 + 1);
            assert!(drawn < result.blamed_line.max(1), "line {drawn} is drawn: {result:?}");
        }
    }
    assert!(refused > 20, "{refused} lines were refused");
}
