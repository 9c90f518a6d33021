//! Manual operations during a tool change, and that the run continues from where it stopped and from
//! nowhere else.

use axis_driver::codes::error_code;
use axis_driver::driver::{
    Command, DriverConfig, Input, JogFrame, JogRequest, OffsetRequest, ProbeRequest, RunOutcome,
};
use axis_driver::encoder::EncoderConfig;
use cnc_msgs::contour::{Action, CoolantMode, Source, SpindleMode};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::machine::Mode;
use cnc_msgs::path::{CompensatedPath, PathEvent};
use kerf_tests::line::{Line, straight};
use std::sync::Arc;
use std::time::Duration;
use virtual_controller::{Build, Firmware, Settings};

const START: [f64; 3] = [-300.0, -200.0, -50.0];
const Z: AxisSet = AxisSet::from_bits(0b100);

fn event(at_element: usize, action: Action) -> PathEvent {
    let line = at_element as u32;
    PathEvent { at_element, action, source: Source { line, ..Source::default() } }
}

/// Along X at Z5, a tool change after the third element, then down to Z-2 and on.
fn with_change() -> CompensatedPath {
    let mut path = straight(6, 10.0);
    path.assumed_axes = AxisSet::NONE;
    for (index, element) in path.elements.iter_mut().enumerate() {
        element.end[2] = if index < 3 { 5.0 } else { -2.0 };
        element.axes = element.axes.with(2);
    }
    path.events = vec![
        event(0, Action::SpindleSpeed { rpm: 6_000.0 }),
        event(0, Action::Spindle(SpindleMode::Clockwise)),
        event(0, Action::Coolant(CoolantMode::Flood)),
        event(3, Action::ChangeTool { tool: 2 }),
        event(3, Action::Spindle(SpindleMode::Clockwise)),
    ];
    path
}

fn zero(axes: AxisSet, position: [f64; 3]) -> Command {
    Command::SetWorkOffset(OffsetRequest {
        further: FurtherAxes::NONE,
        system: 1,
        axes,
        position,
        is_origin: false,
    })
}

fn jog(frame: JogFrame, axes: AxisSet, target: [f64; 3]) -> Command {
    Command::Jog(JogRequest {
        further: FurtherAxes::NONE,
        frame,
        axes,
        target,
        feed_mm_per_min: 2_000.0,
    })
}

fn probe(distance_mm: f64, may_miss: bool) -> Command {
    Command::Probe(ProbeRequest {
        further: FurtherAxes::NONE,
        axes: Z,
        distance: [0.0, 0.0, distance_mm],
        feed_mm_per_min: 300.0,
        away: false,
        may_miss,
    })
}

fn block(path: CompensatedPath) -> Command {
    Command::ExecuteMdi { path: Arc::new(path), tool_diameters_mm: Default::default() }
}

const CONFIRM: Command = Command::ConfirmToolChange { objection: None };

/// Waits in the tool change.
fn changing(firmware: Firmware, config: DriverConfig) -> Line {
    let build = Build {
        start_in_machine: Some(START),
        probe_surface_z_mm: Some(-70.0),
        ..Build::new(Settings::small_router_of(firmware))
    };
    let mut line = Line::new(config, build, &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.ask(zero(AxisSet::ALL, [0.0; 3])).unwrap();
    line.start(with_change(), 0);
    line.until("the tool change", |line| line.mode() == Mode::ToolChange);
    line
}

fn returning() -> DriverConfig {
    DriverConfig { tool_change_return: true, ..DriverConfig::default() }
}

#[track_caller]
fn moves(line: &mut Line, command: Command) {
    line.moved = None;
    line.ask(command).unwrap();
    let state = line.state();
    assert_eq!((state.tool_wanted, state.program_id.as_str()), (2, "part"), "{state:?}");
    assert!(state.reason.contains("TOOL_CHANGE: put in T2"), "{state:?}");
    let result = line.move_result();
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
    assert_eq!(line.mode(), Mode::ToolChange);
    assert_eq!(line.state().tool_wanted, 2);
}

#[test]
fn a_tool_is_lifted_touched_off_and_zeroed_and_the_rest_runs_in_the_new_frame() {
    for firmware in Firmware::ALL {
        let mut line = changing(firmware, DriverConfig::default());
        let stood = line.state().machine_position.unwrap();
        moves(&mut line, jog(JogFrame::Relative, Z, [0.0, 0.0, 20.0]));
        moves(&mut line, jog(JogFrame::Relative, AxisSet::from_bits(1), [-15.0, 0.0, 0.0]));
        moves(&mut line, probe(-60.0, false));
        // The block is 3 mm thick: its surface is Z3 for this tool.
        line.ask(zero(Z, [0.0, 0.0, 3.0])).unwrap();
        let touched = line.state().machine_position.unwrap();
        assert!((touched[2] + 70.0).abs() < 0.2, "{firmware:?}: {touched:?}");
        // Not from here.
        let refusal = line.ask(CONFIRM).unwrap_err();
        assert_eq!(refusal.error_code, error_code::START_POSITION);
        let place = format!("X{:.3} Y{:.3} Z{:.3}", stood[0], stood[1], stood[2]);
        assert!(refusal.message.contains(&place), "{refusal}");
        assert_eq!(line.mode(), Mode::ToolChange);
        moves(&mut line, jog(JogFrame::Machine, AxisSet::ALL, stood));
        let then = line.now;
        line.ask(CONFIRM).unwrap();
        let result = line.result();
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware:?}: {result:?}");
        // The probe left G91 and G38.2 in force.
        let said = line.said_since(then).replace("$G\n", "");
        let words = "G21G90G94G17G40G54\nG49\nM5\nS6000\nM8\nM3\nG1X40Z-2F1200\nX50Z-2\n";
        assert!(said.starts_with(words), "{firmware:?}: {said}");
        let at = line.state().machine_position.unwrap();
        // Z0 is some 73 mm below the machine's, where it was 50 mm.
        let wanted = [START[0] + 60.0, START[1], touched[2] - 3.0 - 2.0];
        let is_there = (0..3).all(|axis| (at[axis] - wanted[axis]).abs() < 0.02);
        assert!(is_there, "{firmware:?}: {at:?}, {wanted:?}");
    }
}

#[test]
fn the_tool_goes_back_by_itself_where_that_is_set_with_z_last() {
    for (lift, order) in [(20.0, ["G53G0X", "G53G1Z"]), (-10.0, ["G53G0Z", "G53G0X"])] {
        let mut line = changing(Firmware::Grbl, returning());
        let stood = line.state().machine_position.unwrap();
        moves(&mut line, jog(JogFrame::Relative, AxisSet::ALL, [-25.0, 7.0, lift]));
        let then = line.now;
        line.ask(CONFIRM).unwrap();
        line.until("back", |line| line.said_since(then).contains("M3\n"));
        let said = line.said_since(then);
        let places =
            order.map(|word| said.find(word).unwrap_or_else(|| panic!("{word} in {said}")));
        assert!(places.is_sorted(), "{said}");
        let at = line.state().machine_position.unwrap();
        assert!((0..3).all(|axis| (at[axis] - stood[axis]).abs() < 0.02), "{at:?}, {stood:?}");
        assert_eq!(line.result().outcome, RunOutcome::Succeeded);
        let at = line.state().work_position.unwrap();
        assert!((at[0] - 60.0).abs() < 0.02 && (at[2] + 2.0).abs() < 0.02, "{at:?}");
    }
}

#[test]
fn blocks_by_hand_run_in_the_frame_in_force_and_their_words_do_not_last() {
    let mut line = changing(Firmware::GrblHal, returning());
    let mut lift = straight(1, 0.0);
    lift.start = line.state().work_position.unwrap();
    lift.assumed_axes = AxisSet::NONE;
    lift.elements[0].end = [lift.start[0], lift.start[1], 30.0];
    lift.elements[0].axes = Z;
    lift.events = vec![
        event(0, Action::SpindleSpeed { rpm: 500.0 }),
        event(0, Action::Spindle(SpindleMode::CounterClockwise)),
        event(0, Action::Coolant(CoolantMode::Off)),
    ];
    let then = line.now;
    line.finished = None;
    line.ask(block(lift)).unwrap();
    assert_eq!((line.state().tool_wanted, line.state().program_id.as_str()), (2, "part"));
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    assert!(line.said_since(then).starts_with("G21G90G94G17G40\n"), "{}", line.said_since(then));
    assert_eq!(line.mode(), Mode::ToolChange);
    assert!((line.state().work_position.unwrap()[2] - 30.0).abs() < 0.01);
    // What would end the program, or ask for another tool, is refused by name.
    for action in [
        Action::ProgramEnd { rewind: true },
        Action::ChangeTool { tool: 3 },
        Action::Home { axes: AxisSet::ALL },
    ] {
        let path = CompensatedPath { events: vec![event(0, action)], ..CompensatedPath::default() };
        let refusal = line.ask(block(path)).unwrap_err();
        assert!(refusal.message.contains(&action.text()), "{refusal}");
    }
    // A tool length that is set on purpose counts.
    let length = Action::ToolLength { offset: Some(2), length_mm: 12.5, second: None };
    let path = CompensatedPath { events: vec![event(0, length)], ..CompensatedPath::default() };
    line.ask(block(path)).unwrap();
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    let then = line.now;
    line.ask(CONFIRM).unwrap();
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    let said = line.said_since(then).replace("$G\n", "");
    assert!(said.starts_with("G21G90G94G17G40G54\nG43.1Z12.5\nM5\nS6000\nM8\nG53G1Z"), "{said}");
    let at = line.state().machine_position.unwrap();
    assert!((at[2] - (START[2] - 2.0 + 12.5)).abs() < 0.02, "{at:?}");
}

#[test]
fn one_thing_at_a_time_and_the_run_waits_for_its_end() {
    let mut line = changing(Firmware::Grbl, DriverConfig::default());
    line.ask(jog(JogFrame::Relative, Z, [0.0, 0.0, 30.0])).unwrap();
    line.until("it moves", |line| line.mode() == Mode::Jog);
    for command in [jog(JogFrame::Relative, Z, [0.0, 0.0, 1.0]), CONFIRM, zero(Z, [0.0; 3])] {
        let refusal = line.ask(command).unwrap_err();
        assert_eq!(refusal.error_code, error_code::BUSY);
        assert!(refusal.message.contains("a jog is under way"), "{refusal}");
    }
    // A hold ends a jog, and nothing else.
    line.ask(Command::FeedHold).unwrap();
    assert_eq!(line.move_result().error_code, error_code::STOPPED_SHORT);
    line.until("the change again", |line| line.mode() == Mode::ToolChange);
    assert!(line.finished.is_none());
    for command in [Command::Home, Command::Configure { write: true }] {
        assert_eq!(line.ask(command).unwrap_err().error_code, error_code::BUSY);
    }
}

#[test]
fn a_canceled_probe_leaves_the_run_waiting_with_its_words_said_again() {
    for firmware in Firmware::ALL {
        let mut line = changing(firmware, returning());
        line.moved = None;
        let id = line.begin(probe(-60.0, false));
        line.wait(1.0);
        line.ask(Command::CancelRun { run: Some(id) }).unwrap();
        assert_eq!(line.move_result().outcome, RunOutcome::Canceled, "{firmware:?}");
        line.until("the change again", |line| line.mode() == Mode::ToolChange);
        line.ask(CONFIRM).unwrap();
        let result = line.result();
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware:?}: {result:?}");
        let at = line.state().work_position.unwrap();
        assert!((at[0] - 60.0).abs() < 0.02 && (at[2] + 2.0).abs() < 0.02, "{at:?}");
    }
}

#[test]
fn a_reset_in_the_change_that_drops_the_shift_of_an_axis_that_turns_ends_the_run() {
    let settings = Settings::small_router_of(Firmware::Grbl);
    let settings = settings.with_axes("XYZA".parse().expect("axes"));
    let build = Build { start_in_machine: Some(START), ..Build::new(settings) };
    let build = Build { probe_surface_z_mm: Some(-70.0), ..build };
    let mut line = Line::new(returning(), build, &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.ask(zero(AxisSet::ALL, [0.0; 3])).unwrap();
    let turned = Command::SetWorkOffset(OffsetRequest {
        further: FurtherAxes::NONE.with(0, 30.0),
        system: 92,
        axes: AxisSet::NONE,
        position: [0.0; 3],
        is_origin: false,
    });
    line.ask(turned).unwrap();
    line.start(with_change(), 0);
    line.until("the tool change", |line| line.mode() == Mode::ToolChange);
    let id = line.begin(probe(-60.0, false));
    line.wait(1.0);
    line.ask(Command::CancelRun { run: Some(id) }).unwrap();
    let result = line.result();
    assert_eq!(result.error_code, error_code::START_POSITION, "{result:?}");
    assert!(result.message.contains("has dropped G92"), "{result:?}");
}

#[test]
fn what_ends_the_work_by_hand_for_good_ends_the_run_and_says_so() {
    for (what, wanted) in [
        ("cancel", error_code::CANCELED),
        ("miss", error_code::PROBE_FAILED),
        ("cable", error_code::LINK_LOST),
        ("reset", error_code::SOFT_RESET),
        ("deactivate", error_code::NOT_ACTIVE),
    ] {
        let mut line = changing(Firmware::Grbl, DriverConfig::default());
        line.moved = None;
        line.ask(probe(if what == "miss" { -5.0 } else { -60.0 }, false)).unwrap();
        line.wait(0.5);
        match what {
            "cancel" => drop(line.ask(Command::CancelRun { run: None }).unwrap()),
            "cable" => line.handle(Input::PortClosed { reason: "unplugged".into() }),
            "reset" => drop(line.ask(Command::SoftReset)),
            "deactivate" => drop(line.ask(Command::Deactivate)),
            _ => {}
        }
        let moved = line.move_result();
        assert_ne!(moved.outcome, RunOutcome::Succeeded, "{what}");
        let result = line.result();
        assert_eq!(result.error_code, wanted, "{what}: {result:?}");
        assert!(result.message.contains("while the tool was changed"), "{what}: {result:?}");
        assert_eq!(line.state().tool_wanted, 0, "{what}");
    }
}

#[test]
fn a_block_with_m6_is_confirmed_as_a_program_is() {
    let mut line = Line::connected(Build::new(Settings::small_router_of(Firmware::Grbl)));
    let change = Action::ChangeTool { tool: 2 };
    let path = CompensatedPath { events: vec![event(0, change)], ..CompensatedPath::default() };
    line.ask(block(path)).unwrap();
    line.until("the tool change", |line| line.mode() == Mode::ToolChange);
    assert_eq!(line.state().program_id, "mdi");
    line.ask(CONFIRM).unwrap();
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
}

#[test]
fn grblhal_changes_the_tool_itself_where_that_is_set() {
    let encoder = EncoderConfig { controller_changes_tools: true, ..EncoderConfig::default() };
    let config = || DriverConfig { encoder, ..DriverConfig::default() };
    let mut line = changing(Firmware::GrblHal, config());
    let state = line.state();
    assert_eq!(state.tool_wanted, 2);
    assert!(state.reason.contains("the controller waits for T2"), "{state:?}");
    line.wait(5.0);
    let said = line.said_since(Duration::ZERO).replace("$G\n", "");
    assert!(said.contains("M5\nM6T2\nG4P0.01\n"), "{said}");
    assert_eq!(line.mode(), Mode::ToolChange, "nothing resumes by itself");
    let objection = Some("another tool".to_owned());
    let refusal = line.ask(Command::ConfirmToolChange { objection }).unwrap_err();
    assert_eq!(refusal.error_code, error_code::TOOL);
    line.ask(CONFIRM).unwrap();
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    // A cancel drops it; the machine is at rest.
    let mut line = changing(Firmware::GrblHal, config());
    line.ask(Command::CancelRun { run: None }).unwrap();
    assert_eq!(line.result().outcome, RunOutcome::Canceled);
    line.until("idle", |line| line.mode() == Mode::Idle);
    // A driver with an automatic changer, or set to ignore M6, does not wait.
    let mut settings = Settings::small_router_of(Firmware::GrblHal);
    settings.set_line("$341=4").unwrap();
    let build = Build { start_in_machine: Some(START), ..Build::new(settings) };
    let mut line = Line::new(config(), build, &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.ask(zero(AxisSet::ALL, [0.0; 3])).unwrap();
    assert_eq!(line.run(with_change()).outcome, RunOutcome::Succeeded);
    // grbl has no M6: the driver waits.
    let line = changing(Firmware::Grbl, config());
    assert!(line.state().reason.contains("put in T2"), "{:?}", line.state());
}

#[test]
fn a_resume_is_never_the_word_that_the_tool_is_in() {
    let encoder = EncoderConfig { controller_changes_tools: true, ..EncoderConfig::default() };
    let config = DriverConfig { encoder, ..DriverConfig::default() };
    let mut line = changing(Firmware::GrblHal, config);
    line.until("it waits", |line| line.driver.state(line.now).reason.contains("waits for T2"));
    line.wait(1.0);
    let then = line.now;
    assert_eq!(line.ask(Command::Resume).unwrap_err().error_code, error_code::NOTHING_TO_DO);
    line.ask(Command::FeedHold).unwrap();
    line.wait(1.0);
    let refusal = line.ask(CONFIRM).unwrap_err();
    assert_eq!(refusal.error_code, error_code::BUSY, "{refusal}");
    line.ask(Command::Resume).unwrap();
    line.wait(2.0);
    assert_eq!(line.mode(), Mode::ToolChange);
    assert!(!line.said_since(then).contains('~'), "{:?}", line.said_since(then));
    line.ask(CONFIRM).unwrap();
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
}

#[test]
fn what_ends_the_run_does_so_while_a_canceled_probe_is_being_reset() {
    for (command, wanted) in [
        (Command::Deactivate, error_code::NOT_ACTIVE),
        (Command::SoftReset, error_code::SOFT_RESET),
    ] {
        let mut line = changing(Firmware::Grbl, DriverConfig::default());
        line.moved = None;
        let id = line.begin(probe(-60.0, false));
        line.wait(1.0);
        line.ask(Command::CancelRun { run: Some(id) }).unwrap();
        assert_eq!(line.move_result().outcome, RunOutcome::Canceled);
        assert!(line.state().reason.contains("is being reset"), "{:?}", line.state());
        drop(line.ask(command));
        line.wait(2.0);
        let result = line.finished.take().expect("the run has ended");
        assert_eq!(result.error_code, wanted, "{result:?}");
        assert_eq!(line.state().tool_wanted, 0);
        let wanted = match wanted {
            error_code::NOT_ACTIVE => wanted,
            _ => error_code::NOTHING_TO_DO,
        };
        assert_eq!(line.ask(CONFIRM).unwrap_err().error_code, wanted);
    }
}

#[test]
fn the_way_back_by_hand_is_open_to_a_machine_that_was_only_unlocked() {
    let mut settings = Settings::small_router_of(Firmware::Grbl);
    settings.set_line("$22=1").unwrap();
    let build = Build { start_in_machine: Some(START), ..Build::new(settings) };
    let mut line = Line::new(DriverConfig::default(), build, &[]);
    line.until("alarm", |line| line.mode() == Mode::Alarm);
    line.ask(Command::Unlock).unwrap();
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.ask(zero(AxisSet::ALL, [0.0; 3])).unwrap();
    line.start(with_change(), 0);
    line.until("the tool change", |line| line.mode() == Mode::ToolChange);
    let stood = line.state().machine_position.unwrap();
    moves(&mut line, jog(JogFrame::Relative, Z, [0.0, 0.0, 20.0]));
    let refusal = line.ask(CONFIRM).unwrap_err();
    assert!(refusal.message.contains("jog it there in the machine frame"), "{refusal}");
    moves(&mut line, jog(JogFrame::Machine, AxisSet::ALL, stood));
    line.ask(CONFIRM).unwrap();
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
}
