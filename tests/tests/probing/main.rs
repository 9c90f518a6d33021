//! Probes of a program: the run goes on from where they touch, and from nowhere else.

mod failed;
mod judged;
mod ports;
mod refused;
mod stretches;

use axis_driver::codes::error_code;
use axis_driver::driver::{
    CheckTravel, Command, DriverConfig, OffsetRequest, OnPathDeviation, ReplanRequest, RunOutcome,
    RunRequest,
};
use axis_driver::encoder::{EncoderConfig, start_at};
use cnc_msgs::finding::Finding;
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::keep_out::{Frame, KeepOut, KeepOutBox};
use cnc_msgs::machine::Mode;
use cnc_msgs::path::{CompensatedPath, StartInSpan};
use kerf_tests::line::Line;
use kerf_tests::planned;
use std::sync::Arc;
use virtual_controller::{Build, Firmware, Settings};

const START: [f64; 3] = [-300.0, -200.0, -50.0];

/// Touches the part, makes its top the zero, and cuts.
const TOUCH_OFF: &str = "G21 G90 G94 G54
G0 Z2
G38.2 Z-30 F100
G10 L20 P1 Z0
G0 Z5
G0 X20 Y10
G1 Z-2 F600
G1 X40
G0 Z10
M2
";

/// As machinists write it: twice, with a way back by so much in between.
const TWICE: &str = "G21 G91
G38.2 Z-30 F600
G0 Z2
G38.2 Z-4 F60
G90
G10 L20 P0 Z0
G91 G0 Z5
G90 G0 X20
M2
";

#[track_caller]
fn path(program: &str) -> CompensatedPath {
    planned(program).unwrap_or_else(|findings| panic!("{program}: {findings:#?}"))
}

/// A machine whose work zero is where it stands, above a part with its top at this height.
fn machine(firmware: Firmware, top: f64) -> Line {
    let (start_in_machine, probe_surface_z_mm) = (Some(START), Some(top));
    let settings = Settings::small_router_of(firmware);
    let build = Build { start_in_machine, probe_surface_z_mm, ..Build::new(settings) };
    let mut line = Line::connected(build);
    line.zero_here();
    line
}

fn near(line: &Line, at: [f64; 3]) -> bool {
    line.axes().iter().zip(at).all(|(is, at)| (is - at).abs() < 0.03)
}

fn has_said(line: &Line, text: &str) -> bool {
    line.log.iter().any(|said| said.contains(text))
}

/// The next line with these words has others when it comes to the controller.
fn spoil(line: &mut Line, sent: &'static str, read: &'static str) {
    line.spoil_next(move |bytes| {
        let text = String::from_utf8_lossy(bytes);
        text.contains(sent).then(|| text.replace(sent, read).into_bytes())
    });
}

#[test]
fn a_run_goes_on_from_where_its_probe_has_touched() {
    for firmware in Firmware::ALL {
        let mut line = machine(firmware, -62.0);
        let then = line.now;
        let result = line.run(path(TOUCH_OFF));
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware}: {result:?}");
        // Z0 is the top of the part now.
        assert!(near(&line, [-260.0, -190.0, -52.0]), "{firmware}: {:?}", line.axes());
        let said = "line 3: the probe touched at X-300.000 Y-200.000 Z-62.0";
        assert!(has_said(&line, said), "{firmware}: {:#?}", line.log);
        let sent = line.said_since(then);
        let lines: Vec<&str> = sent.lines().filter(|line| line.contains("G38.2")).collect();
        assert_eq!(lines.len(), 1, "{firmware}: {sent}");
        assert!(lines[0].ends_with("G38.2Z-30F100"), "{firmware}: {sent}");
        assert!(!has_said(&line, "PATH_DEVIATION"), "{firmware}: {:#?}", line.log);
    }
}

#[test]
fn a_zero_that_is_set_where_a_probe_has_touched_says_where_the_tool_is() {
    for firmware in Firmware::ALL {
        let mut line = machine(firmware, -62.0);
        let then = line.now;
        // A plate of 15 mm lies on the part.
        let program = "G21 G90\nG0 X0 Y0 Z2\nG38.2 Z-30 F100\nG10 L20 P1 Z15\nG91 G0 Z5\nX20\nG2 X10 I5\n\
                       G90 G18 G2 X40 Z20 I5\nG92 Z0\nG0 Z5\nM2\n";
        let result = line.run(path(program));
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware}: {result:?}");
        assert!(near(&line, [-260.0, -200.0, -52.0]), "{firmware}: {:?}", line.axes());
        let sent = line.said_since(then);
        let after = sent.split_once("G10L20P1Z15\n").expect("the zero is set").1;
        assert!(after.starts_with("G0Z20\n"), "{firmware}: {sent}");
        assert!(!has_said(&line, "PATH_DEVIATION"), "{firmware}: {:#?}", line.log);
    }
}

#[test]
fn after_a_probe_the_tool_moves_by_so_much_from_where_it_has_touched() {
    for firmware in Firmware::ALL {
        let mut line = machine(firmware, -62.0);
        let then = line.now;
        let result = line.run(path(TWICE));
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware}: {result:?}");
        assert!(near(&line, [-280.0, -200.0, -57.0]), "{firmware}: {:?}", line.axes());
        let sent = line.said_since(then);
        let lines: Vec<&str> = sent.lines().map(|it| it.split('N').next_back().unwrap()).collect();
        let lines: Vec<&str> =
            lines.iter().map(|it| it.trim_start_matches(char::is_numeric)).collect();
        for wanted in ["G0G91Z2", "G91G38.2Z-4F60", "G90", "G10L20P1Z0", "G0Z5"] {
            assert!(lines.contains(&wanted), "{firmware}: {wanted}: {lines:?}");
        }
        assert!(!has_said(&line, "PATH_DEVIATION"), "{firmware}: {:#?}", line.log);
        assert!(!has_said(&line, "mm beyond"), "{firmware}: {:#?}", line.log);
    }
}

#[test]
fn a_line_that_names_a_place_again_after_a_probe_is_sent() {
    let mut line = machine(Firmware::GrblHal, -62.0);
    let then = line.now;
    let program = "G21 G90\nG1 Z-5 F600\nG38.3 Z-8\nG1 Z-8\nG38.2 Z-30 F100\nG1 Z-30\nX5\nM2\n";
    let result = line.run(path(program));
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
    let sent = line.said_since(then);
    assert!(sent.contains("G38.3Z-8") && sent.contains("G1Z-8"), "{sent}");
    assert!(near(&line, [-295.0, -200.0, -80.0]), "{:?}", line.axes());
    assert!(has_said(&line, "line 3: the probe touched nowhere on the way"), "{:#?}", line.log);
}

#[test]
fn a_probe_may_take_minutes() {
    for firmware in Firmware::ALL {
        let mut line = machine(firmware, -62.0);
        let then = line.now;
        let result = line.run(path("G21 G90\nG38.2 Z-30 F4\nG10 L20 P1 Z0\nG0 Z5\nM2\n"));
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware}: {result:?}");
        assert!((line.now - then).as_secs() > 170, "{firmware}");
    }
}

#[test]
fn a_probe_is_held_resumed_and_canceled() {
    for firmware in Firmware::ALL {
        let mut line = machine(firmware, -62.0);
        line.start(path(TOUCH_OFF), 0);
        line.until("it probes", |line| line.state().reason.starts_with("PROBE: G38.2 in line 3"));
        assert_eq!(line.mode(), Mode::Run, "{firmware}");
        line.wait(2.0);
        line.ask(Command::FeedHold).expect("it holds");
        line.until("a hold", |line| line.mode() == Mode::Hold);
        let stood = line.axes();
        line.wait(3.0);
        assert_eq!(line.axes(), stood, "{firmware}");
        while !line.ask_resume() {}
        let result = line.result();
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware}: {result:?}");
        assert!(near(&line, [-260.0, -190.0, -52.0]), "{firmware}: {:?}", line.axes());

        let mut line = machine(firmware, -62.0);
        line.start(path(TOUCH_OFF), 0);
        line.until("it probes", |line| line.state().reason.starts_with("PROBE"));
        line.wait(2.0);
        line.ask(Command::CancelRun { run: None }).expect("it is canceled");
        let result = line.result();
        assert_eq!(result.outcome, RunOutcome::Canceled, "{firmware}: {result:?}");
        line.until("it stands", |line| line.mode() == Mode::Idle);
        assert!(line.axes()[2] > -61.0, "{firmware}: {:?}", line.axes());
    }
}

#[test]
fn a_machine_that_stops_after_each_block_stops_before_a_probe_and_after_it() {
    let mut line = machine(Firmware::GrblHal, -62.0);
    line.ask(Command::SetSingleBlock(true)).expect("it is set");
    line.start(path(TOUCH_OFF), 0);
    for (line_number, z) in [(1, -50.0), (2, -48.0), (3, -62.0), (4, -62.0), (5, -57.0)] {
        let reason = format!("SINGLE_BLOCK: resume to go on (line {line_number})");
        line.until(&reason, |line| line.state().reason == reason);
        assert!((line.axes()[2] - z).abs() < 0.03, "line {line_number}: {:?}", line.axes());
        while !line.ask_resume() {}
    }
}

#[test]
fn the_feed_of_a_probe_is_in_force_after_it() {
    for (before, probe) in [("F100", "F400"), ("F600", "F100")] {
        let mut line = machine(Firmware::GrblHal, -62.0);
        let program =
            format!("G21 G90\nG1 Z2 {before}\nG38.2 Z-30 {probe}\nG10 L20 P1 Z0\nG1 Z5\nX20\nM2\n");
        let result = line.run(path(&program));
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
        assert!(!has_said(&line, "PATH_DEVIATION"), "{:#?}", line.log);
    }
}
