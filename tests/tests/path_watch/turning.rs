//! A damaged word of an axis that turns.

use crate::damaged::spoil;
use crate::parts::{Part, Random, holding, number, random_part, turn_along, turning_router};
use axis_driver::driver::{Command, DriverConfig, RunOutcome};
use cnc_msgs::contour::Action;
use cnc_msgs::further::{FurtherAxes, FurtherMode, FurtherMove};
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::machine::Mode;
use cnc_msgs::path::CompensatedPath;
use kerf_tests::line::Line;
use std::time::Duration;
use virtual_controller::Firmware;

/// How far A is off where nobody notices it: a step, and what reports are rounded to.
const OFF_DEGREES: f64 = 0.1;

/// The board's own count of A.
fn angle(line: &Line) -> f64 {
    line.controller.device().controller().axes()[3]
}

fn turn(angle: f64, mode: FurtherMode) -> Action {
    Action::Further(FurtherMove { axes: FurtherAxes::NONE.with(0, angle), mode })
}

/// A goes to and fro with the lines and between them, and once each way differs from all others.
fn part(mode: FurtherMode) -> CompensatedPath {
    rounds(30, mode)
}

fn rounds(count: u32, mode: FurtherMode) -> CompensatedPath {
    let mut part = Part::new();
    part.event(turn(0.0, FurtherMode::Rapid));
    for round in 0..count {
        let x = 20.0 + f64::from(round % 2);
        part.event(turn(50.0 + f64::from(round), mode));
        part.line([x, 0.0, 0.0]);
        part.event(turn(10.0, mode));
        part.line([0.0, 5.0, 0.0]);
    }
    let mut path = part.path;
    // Words of a block have the place of the block.
    for event in &mut path.events {
        event.source = path.elements[event.at_element].source;
    }
    path
}

#[test]
fn a_damaged_angle_is_held() {
    for firmware in Firmware::ALL {
        for mode in [FurtherMode::Along, FurtherMode::Feed(3_000.0)] {
            for (from, to) in [("A50", "A20"), ("A56", "A57"), ("A10", "A310"), ("A10", "A")] {
                let what = format!("{firmware} {mode:?}: {from} as {to}");
                let config = DriverConfig { line_check_interval_ms: 0, ..holding() };
                let mut line = turning_router(firmware, &[], config);
                line.start(part(mode), 0);
                line.spoil_next(move |bytes| {
                    let text = String::from_utf8_lossy(bytes);
                    text.contains(from).then(|| text.replacen(from, to, 1).into_bytes())
                });
                line.until("held", |line| {
                    line.finished.is_some() || matches!(line.mode(), Mode::Hold)
                });
                assert!(!line.is_spoil_due(), "{what}");
                line.wait(0.5);
                let verdict = match &line.finished {
                    Some(result) => format!("{}: {}", result.error_code, result.message),
                    None => line.state().reason,
                };
                if to == "A" {
                    // No number: the controller refuses it.
                    assert!(verdict.starts_with("309"), "{what}: {verdict}");
                    continue;
                }
                let named = verdict.starts_with("PATH_DEVIATION: at line ");
                assert!(named && verdict.contains(" A is at "), "{what}: {verdict}");
                line.ask(Command::CancelRun { run: None }).expect("canceled");
                assert_eq!(line.result().outcome, RunOutcome::Canceled, "{what}");
            }
        }
    }
}

/// Boards that report machine positions, and those that report work positions.
const MASKS: [(Firmware, [&str; 2]); 3] = [
    (Firmware::Grbl, ["$10=1", "$10=0"]),
    (Firmware::GrblHal, ["$10=509", "$10=508"]),
    (Firmware::FluidNc, ["$10=1", "$10=0"]),
];

#[test]
fn a_zero_of_an_axis_that_nobody_asked_for_is_held() {
    for (firmware, mask) in MASKS.into_iter().flat_map(|(is, masks)| masks.map(|it| (is, it))) {
        let what = format!("{firmware} {mask}");
        // Room for what the other sends; no check notices that its answers are not counted.
        let config =
            DriverConfig { receive_buffer_bytes: Some(90), line_check_interval_ms: 0, ..holding() };
        let mut line = turning_router(firmware, &[mask], config);
        // More than a planner holds.
        line.start(rounds(90, FurtherMode::Along), 0);
        line.until("the line is reached", |line| line.state().line >= 3);
        line.other_sender("G92A4\n");
        line.until("the board has read it", |line| {
            line.mode() == Mode::Hold || zero_shown(line).abs() > OFF_DEGREES
        });
        let begin = line.now;
        line.until("held", |line| line.finished.is_some() || line.mode() == Mode::Hold);
        let verdict = line.finished.as_ref().map(|it| it.message.clone());
        let verdict = verdict.unwrap_or_else(|| line.state().reason);
        let is_offset = verdict.contains("the controller has the work offset A")
            && verdict.starts_with("PATH_DEVIATION: at line ");
        // Where the axis moves in it first, its place may be seen first.
        assert!(is_offset || verdict.contains(" A is at "), "{what}: {verdict}");
        // After another report, and the way to a stop.
        let held_s = (line.now - begin).as_secs_f64();
        assert!(held_s < 1.0, "{what}: held after {held_s:.3} s");
    }
}

/// Where A is zero as reports show it, machine frame.
fn zero_shown(line: &Line) -> f64 {
    let places = line.state().further.unwrap_or_default();
    let both = places.machine.get(0).zip(places.work.get(0));
    both.map_or(0.0, |(machine, work)| machine - work)
}

/// Sets the zero of A where it stands, or to a place, in a work system.
fn zero(part: &mut Part, system: u8, value: f64, by_position: bool) {
    part.event(turn(value, FurtherMode::Along));
    let (axes, origin) = (AxisSet::NONE, [0.0; 3]);
    part.event(Action::SetWorkOffset { system, axes, origin, by_position });
}

#[test]
fn programs_that_move_the_zero_of_an_axis_are_followed() {
    for (firmware, mask) in MASKS.into_iter().flat_map(|(is, masks)| masks.map(|it| (is, it))) {
        let mut line = turning_router(firmware, &[mask], holding());
        for round in 0..3 {
            let mut part = Part::new();
            part.event(turn(20.0, FurtherMode::Rapid));
            part.line([10.0, 0.0, 0.0]);
            zero(&mut part, 1, 5.0, true);
            part.event(turn(50.0, FurtherMode::Along));
            part.line([20.0, 0.0, 0.0]);
            zero(&mut part, 2, 100.0 + f64::from(round), false);
            part.event(Action::WorkOffset { system: 2 });
            part.event(Action::ChangeTool { tool: 2 });
            part.event(turn(-30.0, FurtherMode::Along));
            part.line([0.0, 5.0, 0.0]);
            zero(&mut part, 2, 0.0, true);
            part.event(turn(3.0, FurtherMode::Feed(2_000.0)));
            part.line([5.0, 5.0, 0.0]);
            part.event(Action::WorkOffset { system: 1 });
            part.event(turn(15.0, FurtherMode::Along));
            part.line([5.0, 15.0, 0.0]);
            zero(&mut part, 1, 0.0, false);
            part.event(turn(-45.0, FurtherMode::Along));
            part.line([0.0, 15.0, 0.0]);
            let mut path = part.path;
            for event in &mut path.events {
                event.source = path.elements[event.at_element].source;
            }
            path.elements.iter_mut().for_each(|element| element.axes = AxisSet::ALL);
            line.start(path, 0);
            while line.finished.is_none() {
                if line.mode() == Mode::ToolChange {
                    line.wait(1.0);
                    let confirmed = Command::ConfirmToolChange { objection: None };
                    line.ask(confirmed).expect("the tool is in");
                }
                assert_ne!(line.mode(), Mode::Hold, "{firmware} {mask}: {:?}", line.log);
                line.wait(0.05);
            }
            let result = line.finished.take().expect("it has ended");
            let place = format!("{firmware} {mask}: {result:?}\n{}", line.log.join("\n"));
            assert_eq!(result.outcome, RunOutcome::Succeeded, "{place}");
            assert!(!line.log.iter().any(|text| text.contains("PATH_DEVIATION")), "{place}");
        }
    }
}

/// `KERF_WATCH_DAMAGES` and `KERF_WATCH_SEED` as for three axes.
#[test]
fn a_run_with_a_damage_that_ends_well_has_its_axis_where_it_belongs() {
    const PATIENCE: Duration = Duration::from_secs(600);
    let wanted = number("KERF_WATCH_DAMAGES", 150.0) as u64;
    let mut random = Random(number("KERF_WATCH_SEED", 1.0) as u64);
    let (mut damages, mut held, mut turned) = (0, 0, 0);
    while damages < wanted {
        let firmware = random.of(&Firmware::ALL);
        let mut line = turning_router(firmware, &[], holding());
        let elements = 20 + random.below(30) as usize;
        let mut path = random_part(&mut random, elements);
        let end = turn_along(&mut path, &mut random);
        line.forget_written();
        line.start(path, 0);
        line.wait(random.between(0.0, 3.0));
        let mut chance = Random(random.next());
        let begin = line.now;
        line.spoil_next(move |bytes| spoil(bytes, &mut chance));
        while line.finished.is_none() {
            let stands = matches!(line.mode(), Mode::Hold | Mode::Door | Mode::ToolChange);
            if stands || line.now > begin + PATIENCE {
                let reason = line.state().reason;
                held += u64::from(reason.starts_with("PATH_DEVIATION"));
                turned += u64::from(reason.contains(" A is at "));
                line.begin(Command::CancelRun { run: None });
                line.until("canceled", |line| line.finished.is_some());
                break;
            }
            line.wait(0.02);
        }
        damages += u64::from(!line.is_spoil_due());
        let result = line.finished.take().expect("it has ended");
        if result.outcome == RunOutcome::Succeeded {
            let off = (angle(&line) - end).abs();
            assert!(off < OFF_DEGREES, "{firmware}: A ends {off:.3} degrees off: {result:?}");
        }
    }
    assert!(held > 20 && turned > 3, "{held} of {damages} were held, {turned} for A");
}
