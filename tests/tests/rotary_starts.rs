//! Runs that begin in the middle after A to W have moved: aborted, and gone on with.

use axis_driver::codes::error_code;
use axis_driver::driver::{
    Command, DriverConfig, JogFrame, JogRequest, OffsetRequest, RunOutcome, RunRequest,
};
use axis_driver::encoder::EncoderConfig;
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::machine::Mode;
use cnc_msgs::path::CompensatedPath;
use kerf_tests::line::Line;
use kerf_tests::planned;
use std::sync::Arc;
use virtual_controller::{Build, Firmware, Settings};

/// Machine frame, mm: the work zero, and the height at which everything is clear.
const ORIGIN: [f64; 3] = [-300.0, -200.0, -50.0];
const CLEAR_Z: f64 = -2.0;
/// The controller counts in steps, mm and degrees.
const NEAR: f64 = 0.05;

const PART: &str = "G21 G90 G54
G0 Z5
G0 X0 Y0 A0 B10
G1 Z-1 F600
G1 X30 A90 F600
G1 A180 F3600
G1 Y20 B-20 F600
G91 G1 X-10 A-30
G90 G1 X0 F600
G0 Z5
M2
";
/// Where PART ends, work frame, with A and B.
const END: [f64; 5] = [0.0, 20.0, 5.0, 150.0, -20.0];

fn path(program: &str) -> CompensatedPath {
    planned(program).unwrap_or_else(|findings| panic!("{program}: {findings:#?}"))
}

/// A board of six axes, homed, with its work zero set; `lift`: a run from the middle comes from above.
fn board(firmware: Firmware, lift: bool) -> Line {
    let mut settings =
        Settings::small_router_of(firmware).with_axes("XYZABC".parse().expect("axes"));
    settings.set_line("$22=1").expect("a setting");
    let approach_z_mm = lift.then_some(CLEAR_Z);
    let encoder = EncoderConfig { approach_z_mm, ..EncoderConfig::default() };
    let config = DriverConfig { encoder, ..DriverConfig::default() };
    let mut line = Line::new(config, Build::new(settings), &[]);
    // grbl locks itself until it is homed; grblHAL does where a bit of $22 says so.
    line.until("connected", |line| matches!(line.mode(), Mode::Alarm | Mode::Idle));
    line.ask(Command::Home).expect("it homes");
    let further = FurtherAxes::NONE.with(0, 7.0).with(1, 0.0).with(2, 0.0);
    let (axes, is_origin, position) = (AxisSet::ALL, true, ORIGIN);
    let offset = OffsetRequest { system: 1, axes, position, is_origin, further };
    line.ask(Command::SetWorkOffset(offset)).expect("an offset");
    line
}

fn in_work(line: &Line) -> [f64; 6] {
    let at = line.all_axes();
    let zero = [ORIGIN[0], ORIGIN[1], ORIGIN[2], 7.0, 0.0, 0.0];
    std::array::from_fn(|axis| at[axis] - zero[axis])
}

fn request(path: &CompensatedPath, start_line: u32, check_only: bool) -> Command {
    Command::RunProgram(RunRequest {
        program_id: "part".into(),
        revision: 1,
        path: Arc::new(path.clone()),
        start_line,
        in_span: Default::default(),
        occurrence: Default::default(),
        check_only,
        tool_diameters_mm: Default::default(),
    })
}

/// Cuts the part until this line is under way, aborts the run, and puts all axes elsewhere.
fn broken_off(line: &mut Line, path: &CompensatedPath, at_line: u32) -> u32 {
    line.ask(request(path, 0, false)).expect("the run begins");
    line.until("the line", |line| line.state().line >= at_line);
    line.wait(0.2);
    line.ask(Command::CancelRun { run: None }).expect("it is canceled");
    let result = line.result();
    assert_eq!(result.outcome, RunOutcome::Canceled, "{result:?}");
    let further = FurtherAxes::NONE.with(0, -50.0).with(1, 33.0);
    for (axes, target, further) in [
        (AxisSet::NONE.with(2), [0.0, 0.0, 40.0], FurtherAxes::NONE),
        (AxisSet::from_bits(0b011), [50.0, 50.0, 0.0], FurtherAxes::NONE),
        (AxisSet::NONE, [0.0; 3], further),
    ] {
        jog(line, axes, target, further);
    }
    result.last_line
}

fn jog(line: &mut Line, axes: AxisSet, target: [f64; 3], further: FurtherAxes) {
    let (frame, feed_mm_per_min) = (JogFrame::Work, 3_000.0);
    line.moved = None;
    line.ask(Command::Jog(JogRequest { frame, axes, target, feed_mm_per_min, further }))
        .expect("the jog begins");
    assert_eq!(line.move_result().outcome, RunOutcome::Succeeded);
}

#[track_caller]
fn is_at(line: &Line, place: [f64; 5]) {
    let at = in_work(line);
    let is_near = place.iter().zip(at).all(|(wanted, is)| (wanted - is).abs() < NEAR);
    assert!(is_near, "{at:?} and not {place:?}");
}

#[test]
fn a_run_goes_on_where_it_was_broken_off_with_each_axis_turned_at_the_safe_height() {
    let path = path(PART);
    for firmware in [Firmware::GrblHal, Firmware::FluidNc, Firmware::Grbl] {
        // The axes before each line, as the program has them.
        for (at_line, before) in [
            (5, [0.0, 0.0, -1.0, 0.0, 10.0]),
            // It turns A alone.
            (6, [30.0, 0.0, -1.0, 90.0, 10.0]),
            (7, [30.0, 0.0, -1.0, 180.0, 10.0]),
            (8, [30.0, 20.0, -1.0, 180.0, -20.0]),
            (9, [20.0, 20.0, -1.0, 150.0, -20.0]),
        ] {
            let mut line = board(firmware, true);
            let last_line = broken_off(&mut line, &path, at_line);
            assert_eq!(last_line, at_line, "{firmware}");
            line.ask(request(&path, last_line, false)).expect("it begins there");
            let mut places = vec![in_work(&line)];
            while line.finished.is_none() {
                line.step();
                places.push(in_work(&line));
            }
            let result = line.result();
            assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware} {at_line}: {result:?}");
            is_at(&line, END);
            // Up first; then A and B, alone and up there; then X and Y; then down.
            let clear = CLEAR_Z - ORIGIN[2];
            let down = places.iter().position(|at| (at[2] - before[2]).abs() < NEAR);
            let down = down.expect("it comes down");
            let is_there = |at: &[f64; 6], axes: std::ops::Range<usize>| {
                axes.into_iter().all(|axis| (at[axis] - before[axis]).abs() < NEAR)
            };
            assert!(is_there(&places[down], 0..5), "{firmware} {at_line}: {:?}", places[down]);
            for pair in places[..=down].windows(2) {
                let [from, to] = [pair[0], pair[1]];
                let moves = |axes: std::ops::Range<usize>| {
                    axes.into_iter().any(|axis| (from[axis] - to[axis]).abs() > 1e-9)
                };
                let is_up = (from[2] - clear).abs() < NEAR && (to[2] - clear).abs() < NEAR;
                assert!(!moves(3..6) || is_up, "{firmware} {at_line}: {from:?} {to:?}");
                let is_turned = is_there(&from, 3..5);
                assert!(
                    !moves(0..2) || is_up && is_turned,
                    "{firmware} {at_line}: {from:?} {to:?}"
                );
            }
        }
    }
}

#[test]
fn without_a_height_each_axis_has_to_stand_where_the_program_has_it() {
    let path = path(PART);
    let a = |a: f64, b: f64| FurtherAxes::NONE.with(0, a).with(1, b);
    for firmware in [Firmware::GrblHal, Firmware::FluidNc, Firmware::Grbl] {
        let mut line = board(firmware, false);
        assert_eq!(broken_off(&mut line, &path, 8), 8, "{firmware}");
        jog(&mut line, AxisSet::from_bits(0b011), [30.0, 20.0, 0.0], FurtherAxes::NONE);
        // A whole turn off is not there: the next line would turn back by it.
        jog(&mut line, AxisSet::NONE.with(2), [0.0, 0.0, -1.0], FurtherAxes::NONE);
        jog(&mut line, AxisSet::NONE, [0.0; 3], a(540.0, -20.0));
        let refusal = line.ask(request(&path, 8, false)).map(|_| ());
        let refused = match refusal {
            Err(refusal) => (refusal.error_code, refusal.message),
            Ok(()) => {
                let result = line.result();
                (result.error_code, result.message)
            }
        };
        assert_eq!(refused.0, error_code::START_POSITION, "{firmware}: {}", refused.1);
        let wanted = "the path begins at A180.000 but A is at 540.000 in the work frame: move it \
                      there first (kerf jog)";
        assert_eq!(refused.1, wanted, "{firmware}");
        // The advice helps.
        jog(&mut line, AxisSet::NONE, [0.0; 3], a(180.0, -20.0));
        line.finished = None;
        line.ask(request(&path, 8, false)).expect("it begins there");
        let result = line.result();
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware}: {result:?}");
        is_at(&line, END);
    }
}

#[test]
fn a_check_says_which_axes_are_turned_and_which_stay() {
    let part = path(PART);
    let mut line = board(Firmware::GrblHal, true);
    let said = line.ask(request(&part, 8, true)).expect("it may begin there");
    let wanted = "first come G53G0Z-2, G54, G0A180B-20, G0X30Y20, G1Z-1F600";
    assert!(said.contains(wanted), "{said}");
    let wanted = "AB are not homed: be sure that they stand at A-7.000 B0.000";
    assert!(said.contains(wanted), "{said}");
    // Before an axis has turned it is where it stands.
    let late = path("G21 G90\nG0 X1 Y0 Z0\nG1 X2 F100\nX3\nX4 A90\nM2\n");
    let said = line.ask(request(&late, 4, true)).expect("it may begin there");
    assert!(said.contains("; A is moved from line 5 on only: put it where"), "{said}");
    // Nobody knows where A is in G55: a later line gives it.
    let lost = path("G21 G90\nG0 X1 A5\nG55\nG0 X-2 Y0 Z0\nG1 X-3 F100\nX-4 A90\nX-5\nM2\n");
    let refused = line.ask(request(&lost, 5, true)).expect_err("a refusal");
    let wanted =
        "line 5 begins where A has not been given since G55: begin after a line that gives A";
    assert_eq!(refused.message, wanted);
    line.ask(request(&lost, 7, true)).expect("the advice helps");
    // Of an axis that stays at 0, and that the board does not have, nothing is to be restored.
    let mut line = Line::connected(Build::new(Settings::small_router()));
    line.zero_here();
    let idle = path("G21 G90\nG0 X1 A0\nG1 X2 F100\nX3\nM2\n");
    line.ask(request(&idle, 4, true)).expect("it may begin there");
}

/// Rings about A, then a retract: what is cut has no element.
const RINGS: &str = "G21 G90 G94 G54
G0 Z20
G0 X10 Y10 A0
G1 Z-1 F300
G1 A90 F3600
G1 A180
X20 F300
G1 A360 F3600
A720
A0
G0 Z20
M2
";

#[test]
fn the_tool_comes_down_at_the_feed_of_the_program_and_never_at_rapid() {
    let mut line = board(Firmware::GrblHal, true);
    for (program, start_line, wanted) in [
        // The rings before the retract, and the retract itself.
        (RINGS, 8, "G1Z-1F300"),
        (RINGS, 11, "G1Z-1F300"),
        // A time (G93) is no feed of the tool.
        (
            "G21 G90\nG0 X1 Y0 Z0\nG1 Z-1 F300\nG93 G1 X1.1 A3600 F2\nG94 G0 Z5\nM2\n",
            5,
            "G1Z-1F300",
        ),
    ] {
        let said = line.ask(request(&path(program), start_line, true)).expect("it may begin there");
        assert!(said.contains(wanted), "{program} {start_line}: {said}");
        let down = format!("down to Z-1.000 at {}", wanted.trim_start_matches("G1Z-1"));
        assert!(said.contains(&down), "{said}");
    }
    let rapids = "G21 G90\nG0 X1 Y0 Z0\nG0 Z-1\nG1 A90 F360\nG0 Z5\nM2\n";
    let refused = line.ask(request(&path(rapids), 5, true)).expect_err("a refusal");
    assert_eq!(refused.error_code, error_code::START_LINE, "{refused}");
    assert!(refused.message.contains("would come down to Z-1.000 at rapid"), "{refused}");
    // The advice helps.
    let written = rapids.replace("G0 Z-1", "G1 Z-1 F300");
    line.ask(request(&path(&written), 5, true)).expect("it may begin there");
}

#[test]
fn a_start_that_leaves_the_retract_of_the_program_out_lifts_the_tool() {
    let part =
        path("G21 G90 G54\nG53 G0 Z-5\nG0 X10 Y10 A10\nG0 Z5\nG1 Z-1 F300\nX60 A20\nG0 Z5\nM2\n");
    let mut line = board(Firmware::GrblHal, true);
    for (axes, target) in
        [(AxisSet::from_bits(0b011), [90.0, 10.0, 0.0]), (AxisSet::NONE.with(2), [0.0, 0.0, -1.0])]
    {
        jog(&mut line, axes, target, FurtherAxes::NONE);
    }
    let said = line.ask(request(&part, 3, true)).expect("it may begin there");
    for wanted in
        ["the approach from X90.000 Y10.000 Z-1.000, up to Z48.000", "first come G53G0Z-2"]
    {
        assert!(said.contains(wanted), "{wanted}: {said}");
    }
    line.ask(request(&part, 3, false)).expect("it begins there");
    let clear = CLEAR_Z - ORIGIN[2];
    while line.finished.is_none() {
        let before = in_work(&line);
        line.step();
        let at = in_work(&line);
        let crosses = (before[0] - at[0]).abs() > 1e-9 && at[0] > 10.0 + NEAR;
        let is_first = line.state().line < 4;
        assert!(!(crosses && is_first) || (at[2] - clear).abs() < NEAR, "{at:?}");
    }
    let result = line.result();
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
}

#[test]
fn lines_that_turn_a_alone_are_followed_and_gone_on_with() {
    let rings = path(RINGS);
    let mut line = board(Firmware::GrblHal, true);
    line.ask(request(&rings, 0, false)).expect("the run begins");
    line.until("the second ring", |line| in_work(line)[3] > 457.0);
    line.wait(0.3);
    assert_eq!(line.state().line, 9);
    let (then, left) = line.time_left.expect("the time that is left");
    line.until("the way back", |line| line.state().line == 10);
    let back = in_work(&line)[3];
    assert!((600.0..721.0).contains(&back), "line 10 begins at A{back}");
    line.until("the end", |line| line.finished.is_some());
    let took = (line.now - then).as_secs_f64();
    assert!((took - left).abs() < 1.0, "{left} s were left, and it took {took} s");
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    // It goes on with the ring that was broken off.
    assert_eq!(broken_off(&mut line, &rings, 9), 9);
    let said = line.ask(request(&rings, 9, true)).expect("it may begin there");
    for wanted in
        ["G0A360, G0X20Y10, G1Z-1F300", "the program goes on with A720F3600 (line 9), A0 (line 10)"]
    {
        assert!(said.contains(wanted), "{wanted}: {said}");
    }
}

#[test]
fn a_program_of_a_alone_has_lines_and_begins_at_its_start() {
    let turned = path("G21 G90 G94\nG0 A10\nG1 A90 F360\nG1 A180\nG1 A270\nM2\n");
    let mut line = board(Firmware::GrblHal, true);
    line.ask(request(&turned, 0, false)).expect("the run begins");
    line.until("line 4", |line| in_work(line)[3] > 120.0);
    line.wait(0.3);
    assert_eq!(line.state().line, 4);
    let (_, left) = line.time_left.expect("the time that is left");
    assert!(left > 15.0, "{left} s are left of 25 s");
    line.ask(Command::CancelRun { run: None }).expect("it is canceled");
    assert_eq!(line.result().last_line, 4);
    let refused = line.ask(request(&turned, 4, true)).expect_err("a refusal");
    assert_eq!(refused.error_code, error_code::START_LINE, "{refused}");
    assert!(refused.message.contains("turns A to W alone"), "{refused}");
    assert!(refused.message.ends_with("begin at the start of the program (kerf run)"), "{refused}");
    line.ask(request(&turned, 1, true)).expect("the advice helps");
}
