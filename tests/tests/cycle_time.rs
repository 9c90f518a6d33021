//! The time that the driver gives, against the virtual controller, whose planner is its own.

use axis_driver::cycle_time::CycleTime;
use axis_driver::driver::{
    Command, DriverConfig, JogFrame, JogRequest, OffsetRequest, Overrides, RunOutcome,
};
use axis_driver::encoder::EncoderConfig;
use axis_driver::machine_limits::MachineLimits;
use cnc_msgs::contour::{Action, Source, SpindleMode};
use cnc_msgs::further::{FurtherAxes, FurtherMode, FurtherMove};
use cnc_msgs::geometry::{Arc, AxisSet, Plane, Shape};
use cnc_msgs::machine::Mode;
use cnc_msgs::path::{CompensatedPath, PathElement, Role};
use kerf_tests::line::{Line, events, short_segments, straight};
use std::time::Duration;
use virtual_controller::{Build, Firmware, Settings};

/// How far the time may be off.
const SHARE_MAX: f64 = 0.01;
/// How finely motion is looked at.
const LOOK: Duration = Duration::from_micros(500);

fn element(end: [f64; 3], feed_mm_per_min: Option<f64>, shape: Shape) -> PathElement {
    PathElement {
        side: None,
        shape,
        end,
        feed_mm_per_min,
        role: Role::None,
        axes: AxisSet::ALL,
        source: Source::default(),
    }
}

fn lines(ends: &[[f64; 3]], feed: Option<f64>) -> CompensatedPath {
    let elements = ends.iter().map(|end| element(*end, feed, Shape::Line)).collect();
    CompensatedPath { elements, ..CompensatedPath::default() }
}

fn arcs(radius: f64, count: u32, feed: f64) -> CompensatedPath {
    // Half circles, alternately up and down.
    let half = |number: u32| {
        let start = 2.0 * radius * f64::from(number);
        let clockwise = number.is_multiple_of(2);
        let arc = Arc { center: [start + radius, 0.0, 0.0], plane: Plane::Xy, clockwise, turns: 0 };
        element([start + 2.0 * radius, 0.0, 0.0], Some(feed), Shape::Arc(arc))
    };
    CompensatedPath { elements: (0..count).map(half).collect(), ..CompensatedPath::default() }
}

/// Pockets with everything: rapids, plunges, circles, corners, spindle, dwell.
fn part() -> CompensatedPath {
    let mut path = CompensatedPath::default();
    for pocket in 0..4 {
        let x = 40.0 * f64::from(pocket);
        path.elements.push(element([x, 0.0, 5.0], None, Shape::Line));
        path.elements.push(element([x, 0.0, -1.0], Some(200.0), Shape::Line));
        for [dx, dy] in [[20.0, 0.0], [20.0, 15.0], [8.0, 22.0], [0.0, 15.0], [0.0, 0.0]] {
            path.elements.push(element([x + dx, dy, -1.0], Some(1_800.0), Shape::Line));
        }
        let arc =
            Arc { center: [x + 6.0, 0.0, -1.0], plane: Plane::Xy, clockwise: false, turns: 1 };
        path.elements.push(element([x, 0.0, -3.0], Some(900.0), Shape::Arc(arc)));
        path.elements.push(element([x, 0.0, 5.0], None, Shape::Line));
    }
    path.events = events(&[
        (1, Action::SpindleSpeed { rpm: 8_000.0 }),
        (1, Action::Spindle(SpindleMode::Clockwise)),
        (1, Action::Dwell { seconds: 1.5 }),
        (20, Action::SpindleSpeed { rpm: 9_000.0 }),
    ]);
    path
}

/// Lines along which A turns, slower and faster than it can, and A alone.
fn turning() -> CompensatedPath {
    let mut path = CompensatedPath::default();
    let turn = |mode, a: f64| {
        let axes = FurtherAxes::NONE.with(0, a);
        Action::Further(FurtherMove { axes, mode })
    };
    let mut turns = vec![(0, turn(FurtherMode::Rapid, 0.0)), (0, turn(FurtherMode::Rapid, 30.0))];
    for number in 1..=20usize {
        let x = 4.0 * number as f64;
        turns.push((path.elements.len(), turn(FurtherMode::Along, 30.0 + 5.0 * number as f64)));
        path.elements.push(element([x, 0.0, 0.0], Some(1_200.0), Shape::Line));
    }
    turns.push((20, turn(FurtherMode::Feed(1_500.0), 10.0)));
    turns.push((20, turn(FurtherMode::Feed(1_500.0), -80.0)));
    turns.push((20, turn(FurtherMode::Along, 500.0)));
    path.elements.push(element([120.0, 10.0, 0.0], Some(4_000.0), Shape::Line));
    turns.push((21, turn(FurtherMode::Along, 0.0)));
    path.elements.push(element([0.0, 0.0, 0.0], None, Shape::Line));
    path.events = events(&turns);
    path
}

/// A serial line that is no limit, to a board with A.
fn line(firmware: Firmware) -> Line {
    let config = DriverConfig { baud: 2_000_000, ..DriverConfig::default() };
    let settings = Settings::small_router_of(firmware).with_axes("XYZA".parse().expect("axes"));
    let mut line = Line::new(config, Build::new(settings), &[]);
    line.until("idle", |line| line.mode() == cnc_msgs::machine::Mode::Idle);
    line
}

fn modelled(line: &Line, path: &CompensatedPath) -> f64 {
    let mut settings = line.settings.clone().expect("the controller has reported itself");
    let usual = settings.firmware.traits().unreported_planner_blocks;
    settings.planner_blocks = usual.unwrap_or(settings.planner_blocks);
    let limits = MachineLimits::of(&settings).expect("a machine");
    let start = line.state().machine_position;
    CycleTime::new(&limits, path, 0, start).advance_to(path, path.elements.len())
}

/// Seconds from the first step to the last.
fn moved(line: &mut Line, path: CompensatedPath) -> f64 {
    moved_from(line, path, 0).0
}

/// The same from a source line on, and the seconds that the driver has given first.
fn moved_from(line: &mut Line, path: CompensatedPath, start_line: u32) -> (f64, f64) {
    let (mut before, mut first, mut last) = (line.all_axes(), None, line.now);
    line.start(path, start_line);
    let mut said = None;
    while line.finished.is_none() {
        let was = line.now;
        line.step_within(LOOK);
        said = said.or(line.time_left.map(|(_, left)| left));
        let at = line.all_axes();
        if at != before {
            first.get_or_insert(was);
            (before, last) = (at, line.now);
        }
    }
    let result = line.finished.take().expect("it has ended");
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{}", result.message);
    let took = last - first.expect("it has moved");
    (took.as_secs_f64(), said.expect("the driver has given a time"))
}

#[test]
fn the_time_of_lines_arcs_and_short_segments_is_that_of_the_controller() {
    let zigzag: Vec<_> = (1..=60)
        .map(|number| [f64::from(number) * 3.0, f64::from(number % 2) * 7.0, 0.0])
        .collect();
    let mut table = String::new();
    let mut worst = 0f64;
    for firmware in Firmware::ALL {
        for (name, path) in [
            ("one line", straight(1, 150.0)),
            ("straight blocks of 0.3 mm", straight(600, 0.3)),
            ("zigzag at 1500 mm/min", lines(&zigzag, Some(1_500.0))),
            ("zigzag at 5000 mm/min", lines(&zigzag, Some(5_000.0))),
            ("zigzag of rapids", lines(&zigzag, None)),
            ("half circles of 8 mm", arcs(8.0, 8, 1_500.0)),
            ("half circles of 0.8 mm", arcs(0.8, 40, 3_000.0)),
            ("half circles of 30 mm at full speed", arcs(30.0, 4, 5_000.0)),
            ("a spiral of 0.5 mm", short_segments(600, 0.5)),
            ("a spiral of 0.1 mm", short_segments(1_500, 0.1)),
            ("pockets", part()),
            ("an axis that turns", turning()),
        ] {
            let mut line = line(firmware);
            let expected = modelled(&line, &path);
            let found = moved(&mut line, path);
            let off = expected / found - 1.0;
            table += &format!("{firmware}, {name}: {found:.3} s, {:+.2} %\n", 100.0 * off);
            worst = worst.max(off.abs());
        }
    }
    assert!(worst <= SHARE_MAX, "{table}");
}

/// A homed machine that lifts the tool, or not, before it begins in the middle.
fn homed(firmware: Firmware, is_lifted: bool) -> Line {
    let approach_z_mm = is_lifted.then_some(-2.0);
    let encoder = EncoderConfig { approach_z_mm, ..EncoderConfig::default() };
    let config = DriverConfig { baud: 2_000_000, encoder, ..DriverConfig::default() };
    let mut settings = Settings::small_router_of(firmware);
    settings.set_line("$22=1").expect("a setting");
    let mut line = Line::new(config, Build::new(settings), &[]);
    line.until("at rest", |line| matches!(line.mode(), Mode::Alarm | Mode::Idle));
    line.ask(Command::Home).expect("it homes");
    let (axes, position, further) = (AxisSet::ALL, [-400.0, -250.0, -40.0], FurtherAxes::NONE);
    let zero = OffsetRequest { system: 1, axes, position, is_origin: true, further };
    line.ask(Command::SetWorkOffset(zero)).expect("a zero");
    line
}

#[test]
fn the_time_of_a_start_in_the_middle_counts_the_way_there_and_no_other() {
    let mut path = part();
    for (index, element) in path.elements.iter_mut().enumerate() {
        element.source.line = index as u32 + 1;
        // Longer than the look where the machine stands before the first line is cut.
        element.feed_mm_per_min = element.feed_mm_per_min.map(|feed| 0.4 * feed);
    }
    // The second pocket from its first line at depth on; or from the plunge before it.
    let lines = [12, 11];
    for firmware in Firmware::ALL {
        for start_line in lines {
            let first = start_line as usize - 1;
            let starts_at = path.start_of(first);
            for is_lifted in [true, false] {
                let mut line = homed(firmware, is_lifted);
                if !is_lifted {
                    let (frame, axes) = (JogFrame::Work, AxisSet::ALL);
                    let (feed_mm_per_min, further) = (3_000.0, FurtherAxes::NONE);
                    let target = starts_at;
                    let jog = JogRequest { frame, axes, target, feed_mm_per_min, further };
                    line.ask(Command::Jog(jog)).expect("it moves there");
                    line.move_result();
                }
                let (found, expected) = moved_from(&mut line, path.clone(), start_line);
                let off = expected / found - 1.0;
                let what = format!("{firmware}, line {start_line}, lifted: {is_lifted}");
                assert!(off.abs() <= SHARE_MAX, "{what}: {found:.3} s, {:+.2} %", 100.0 * off);
            }
        }
    }
}

#[test]
fn an_override_changes_the_time_left_at_once_and_a_hold_keeps_it() {
    for firmware in Firmware::ALL {
        let mut line = line(firmware);
        let path = straight(40, 5.0);
        let whole = modelled(&line, &path);
        line.start(path, 0);
        let (_, left) = line.time_left.expect("it was said when the run began");
        assert!((left - whole).abs() < 0.01 * whole, "{firmware}: {left} s of {whole} s");
        line.wait(3.0);
        line.ask(Command::SetOverrides(Overrides { feed: Some(50), rapid: None, spindle: None }))
            .expect("an override");
        // The report after it.
        line.wait(0.5);
        let (at, left) = line.time_left.expect("a time");
        line.ask(Command::FeedHold).expect("a hold");
        line.wait(5.0);
        let (_, held) = line.time_left.expect("a time");
        line.wait(5.0);
        assert_eq!(line.time_left.expect("a time").1, held, "{firmware}: it stands");
        line.until("it can be resumed", |line| line.mode() == cnc_msgs::machine::Mode::Hold);
        let stood = line.now;
        line.ask(Command::Resume).expect("a resume");
        line.until("the run ends", |line| line.finished.is_some());
        let took = (line.now - stood).as_secs_f64();
        // The end is seen in a report after the last dwell.
        assert!((took - held).abs() < 0.02 * held + 0.3, "{firmware}: {took} s, {held} s said");
        assert!(left > held && left < held + 2.0, "{firmware}: {left} s at {at:?}, then {held} s");
    }
}

#[test]
fn a_board_that_limits_jerk_is_named_once_in_each_run() {
    for jerk in [&[][..], &["$800=5000.000", "$801=5000.000", "$802=2000.000"]] {
        let mut line = line(Firmware::GrblHal);
        for setting in jerk {
            line.inject(&format!("push:{setting}"));
        }
        line.wait(1.0);
        for runs in 1..=2 {
            moved(&mut line, straight(4, 5.0));
            let said =
                line.log.iter().filter(|it| it.contains("the controller limits jerk")).count();
            assert_eq!(said, if jerk.is_empty() { 0 } else { runs }, "{:?}", line.log);
        }
    }
}
