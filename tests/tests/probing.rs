//! Probes of a program: the run goes on from where they touch, and from nowhere else.

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
fn a_probe_that_the_controller_has_not_run_ends_the_run() {
    // The line becomes a comment, and what is known of a probe is of the one before.
    for (first, damaged) in [("G91G38.2Z-4", "(91G38.2Z-4"), ("G91G38.2Z-30", "(91G38.2Z-30")] {
        let mut line = machine(Firmware::GrblHal, -62.0);
        line.start(
            path(&TWICE.replace("G21 G91", "G21 G90\nG0 Z1\nG38.2 Z-30 F600\nG91 G0 Z3")),
            0,
        );
        line.spoil_next(move |bytes| {
            let text = String::from_utf8_lossy(bytes);
            text.contains(first).then(|| text.replace(first, damaged).into_bytes())
        });
        let result = line.result();
        assert_eq!(result.error_code, error_code::PROBE_FAILED, "{damaged}: {result:?}");
        assert!(result.message.contains("is not on the way of the tool"), "{damaged}: {result:?}");
    }
    // One that may miss has to be at the end of its way then.
    let mut line = machine(Firmware::GrblHal, -90.0);
    line.start(path("G21 G90\nG0 Z1\nG38.3 Z-5 F100\nG0 Z5\nM2\n"), 0);
    line.spoil_next(|bytes| {
        let text = String::from_utf8_lossy(bytes);
        text.contains("G38.3").then(|| text.replace("G38.3", "(38.3").into_bytes())
    });
    line.until("a hold", |line| line.mode() == Mode::Hold || line.finished.is_some());
    let reason = line.state().reason;
    assert!(reason.contains("PATH_DEVIATION"), "{reason} {:?}", line.finished);
}

#[test]
fn a_damaged_way_back_from_a_probe_is_held() {
    let mut line = machine(Firmware::GrblHal, -62.0);
    line.start(path(TWICE), 0);
    line.spoil_next(|bytes| {
        let text = String::from_utf8_lossy(bytes);
        text.contains("G91Z2").then(|| text.replace("G91Z2", "G91Z9").into_bytes())
    });
    line.until("a hold", |line| line.mode() == Mode::Hold);
    let reason = line.state().reason;
    assert!(reason.contains("PATH_DEVIATION"), "{reason}");
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
fn a_probe_that_fails_ends_the_run_with_its_line() {
    for (top, program, said) in [
        (-90.0, TOUCH_OFF, "line 3"),
        // It touches before it moves.
        (-40.0, TOUCH_OFF, "line 3"),
        // It touches nothing that it could leave.
        (-90.0, "G21 G90\nG1 Z-5 F600\nG38.4 Z5 F100\nG0 X5\nM2\n", "line 3"),
    ] {
        for firmware in Firmware::ALL {
            let mut line = machine(firmware, top);
            let result = line.run(path(program));
            let found = (result.outcome, result.error_code);
            let failed = (RunOutcome::Aborted, error_code::PROBE_FAILED);
            assert_eq!(found, failed, "{firmware}: {result:?}");
            assert!(result.message.contains(said), "{firmware}: {result:?}");
            assert_eq!(result.blamed_line, 3, "{firmware}: {result:?}");
            let stood = line.axes();
            line.wait(5.0);
            assert_eq!(line.axes(), stood, "{firmware}: nothing moves afterwards");
        }
    }
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
fn the_result_of_a_probe_is_asked_for_where_it_does_not_come() {
    let mut line = machine(Firmware::Grbl, -62.0);
    line.start(path(TOUCH_OFF), 0);
    line.until("it probes", |line| line.state().reason.starts_with("PROBE"));
    line.inject("mute:PRB");
    let result = line.result();
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
    assert!(has_said(&line, "line 3: the probe touched at"), "{:#?}", line.log);
}

#[test]
fn a_probe_whose_result_is_lost_ends_the_run() {
    let mut line = machine(Firmware::Grbl, -62.0);
    line.start(path(TOUCH_OFF), 0);
    line.until("it probes", |line| line.state().reason.starts_with("PROBE"));
    line.inject("mute:PRB");
    line.inject("mute:PRB");
    let result = line.result();
    assert_eq!(result.error_code, error_code::PROBE_FAILED, "{result:?}");
    assert!(result.message.contains("did not say where the probe touched"), "{result:?}");
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
fn a_line_that_is_damaged_after_a_probe_is_held() {
    let mut line = machine(Firmware::GrblHal, -62.0);
    line.start(path(TOUCH_OFF), 0);
    line.spoil_next(|bytes| {
        let text = String::from_utf8_lossy(bytes);
        text.contains("X20Y10").then(|| text.replace("X20Y10", "X29Y10").into_bytes())
    });
    line.until("a hold", |line| line.mode() == Mode::Hold);
    let reason = line.state().reason;
    assert!(reason.contains("PATH_DEVIATION"), "{reason}");
}

/// Homed, with its work zero 20 mm below the top of the travel, which ends 80 mm below that.
fn homed(config: DriverConfig) -> Line {
    let mut settings = Settings::small_router();
    settings.set_line("$22=1").expect("a setting");
    let build = Build { probe_surface_z_mm: Some(-80.0), ..Build::new(settings) };
    let mut line = Line::new(config, build, &[]);
    line.until("locked or idle", |line| matches!(line.mode(), Mode::Alarm | Mode::Idle));
    line.ask(Command::Home).expect("it homes");
    line.ask(zero([-300.0, -200.0, -20.0])).expect("the zero is set");
    line
}

fn zero(position: [f64; 3]) -> Command {
    let (axes, further) = (AxisSet::ALL, FurtherAxes::NONE);
    Command::SetWorkOffset(OffsetRequest { further, system: 1, axes, position, is_origin: true })
}

/// Two touches, and then so deep.
fn to_depth(depth: i32) -> CompensatedPath {
    let touch = "G38.2 Z-70 F120\nG10 L20 P1 Z0\nG0 Z5\n";
    path(&format!(
        "G21 G90 G94 G54\nG0 X0 Y0 Z2\n{touch}{}G1 Z-{depth} F600\nG0 Z5\nM2\n",
        touch.replace("-70", "-6")
    ))
}

#[test]
fn what_follows_a_probe_is_judged_where_it_has_touched() {
    for on_path_deviation in [OnPathDeviation::Hold, OnPathDeviation::Off] {
        let check_travel = CheckTravel::Refuse;
        let config = DriverConfig { check_travel, on_path_deviation, ..DriverConfig::default() };
        let mut line = homed(config);
        // The travel ends at -100. From where the probe may go to at most, 12 mm would be too much.
        let result = line.run(to_depth(12));
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{on_path_deviation:?}: {result:?}");
        line.ask(zero([-300.0, -200.0, -20.0])).expect("the zero is set");
        let result = line.run(to_depth(25));
        let found = (result.outcome, result.error_code);
        assert_eq!(found, (RunOutcome::Aborted, error_code::TRAVEL), "{on_path_deviation:?}");
        assert!(result.message.starts_with("line 9"), "{on_path_deviation:?}: {result:?}");
        let at = line.axes();
        assert!((at[2] - -80.0).abs() < 0.1, "it stays where it touched: {at:?}");
    }
}

#[test]
fn a_way_back_from_where_a_probe_has_touched_stays_in_the_travel() {
    let config = DriverConfig { check_travel: CheckTravel::Refuse, ..DriverConfig::default() };
    let back = |mm: i32| {
        path(&format!("G21 G90\nG0 X0 Y0 Z0\nG38.2 Z-70 F600\nG91 G0 Z{mm}\nX5\nG90 G0 X0\nM2\n"))
    };
    // It touches 80 mm below the top.
    let result = homed(config.clone()).run(back(75));
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
    let mut line = homed(config);
    let result = line.run(back(85));
    assert_eq!(result.error_code, error_code::TRAVEL, "{result:?}");
    assert!(result.message.starts_with("line 4"), "{result:?}");
    assert!((line.axes()[2] - -80.0).abs() < 0.5, "{:?}", line.axes());
}

#[test]
fn a_box_stays_where_it_was_when_the_run_began_whatever_a_probe_sets() {
    let it = |min: f64, max: f64| {
        let frame = Frame::Work(1);
        let (min_mm, max_mm) = ([-10.0, -10.0, min], [10.0, 10.0, max]);
        let it = KeepOutBox { frame, min_mm, max_mm };
        let keep_out = KeepOut { keep_out: [("clamp".to_owned(), it)].into() };
        let check_travel = CheckTravel::Off;
        homed(DriverConfig { keep_out, check_travel, ..DriverConfig::default() })
    };
    // Zero is at the top, the part 60 mm below: a box from there to the end of the travel.
    let result = it(-80.0, -70.5).run(to_depth(8));
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
    let result = it(-80.0, -70.5).run(to_depth(12));
    assert_eq!(result.error_code, error_code::KEEP_OUT, "{result:?}");
}

#[test]
fn a_probe_that_has_missed_sets_no_zero() {
    let mut line = machine(Firmware::GrblHal, -90.0);
    let missing = TOUCH_OFF.replace("G38.2", "G38.3");
    let result = line.run(path(&missing));
    assert_eq!(result.error_code, error_code::PROBE_FAILED, "{result:?}");
    assert!(result.message.contains("line 4 would set the zero where it has ended"), "{result:?}");
    // By so much is not where the program says.
    let mut line = machine(Firmware::GrblHal, -62.0);
    let result = line.run(path(&TWICE.replace("-4", "-1").replace(".2 Z-1", ".3 Z-1")));
    assert_eq!(result.error_code, error_code::PROBE_FAILED, "{result:?}");
    // Another axis has touched since.
    let mut line = machine(Firmware::GrblHal, -90.0);
    let corner = "G21 G91\nG38.3 Z-5 F600\nG0 Z2\nG38.3 X5\nG90\nG10 L20 P1 X0 Z0\nG0 Z5\nM2\n";
    let result = line.run(path(corner));
    assert_eq!(result.error_code, error_code::PROBE_FAILED, "{result:?}");
    assert!(
        result.message.starts_with("line 2") && result.message.contains("line 6"),
        "{result:?}"
    );
    // An axis that it has moved since is.
    let mut line = machine(Firmware::GrblHal, -90.0);
    let moved = missing.replace("G10", "G0 Z5\nG10");
    assert_eq!(line.run(path(&moved)).outcome, RunOutcome::Succeeded);
}

#[test]
fn a_tool_that_stops_beyond_its_touch_is_a_warning_where_that_becomes_the_zero() {
    for (feed, warns) in [("F100", false), ("F900", true)] {
        let mut line = machine(Firmware::Grbl, -62.0);
        let result = line.run(path(&TOUCH_OFF.replace("F100", feed)));
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
        assert_eq!(has_said(&line, "mm beyond the place where"), warns, "{:#?}", line.log);
    }
}

#[test]
fn a_damaged_line_of_a_probe_is_held() {
    for (is, damaged) in [("Z-30F100", "X-30F100"), ("F100", "F900")] {
        let mut line = machine(Firmware::GrblHal, -75.0);
        line.start(path(TOUCH_OFF), 0);
        line.spoil_next(move |bytes| {
            let text = String::from_utf8_lossy(bytes);
            text.contains(is).then(|| text.replace(is, damaged).into_bytes())
        });
        line.until("a hold", |line| line.mode() == Mode::Hold);
        let reason = line.state().reason;
        assert!(reason.contains("PATH_DEVIATION"), "{damaged}: {reason}");
        assert!(reason.contains("line 3"), "{damaged}: {reason}");
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

#[test]
fn what_is_left_is_not_planned_again_between_a_probe_and_its_zero() {
    let mut line = machine(Firmware::GrblHal, -62.0);
    line.ask(Command::SetSingleBlock(true)).expect("it is set");
    line.start(path(TOUCH_OFF), 0);
    for _ in 0..2 {
        line.until("a block ends", |line| line.mode() == Mode::Hold);
        while !line.ask_resume() {}
        line.wait(0.5);
    }
    line.until("it has probed", |line| line.state().reason.contains("(line 3)"));
    let (program_id, path) = ("part".into(), Arc::new(path(TOUCH_OFF)));
    let request = ReplanRequest { program_id, of: 1, revision: 2, path };
    let refusal = line.ask(Command::Replan(request)).expect_err("it is refused");
    assert_eq!(refusal.error_code, error_code::BUSY, "{refusal}");
}

#[test]
fn a_check_in_the_controller_stores_no_zero() {
    for firmware in Firmware::ALL {
        let config = DriverConfig { check_in_controller: true, ..DriverConfig::default() };
        let build = Build::new(Settings::small_router_of(firmware));
        let mut line = Line::new(config, build, &[]);
        line.until("idle", |line| line.mode() == Mode::Idle);
        line.zero_here();
        let then = line.now;
        line.ask(Command::RunProgram(check())).expect("it can be sent");
        line.until("an end", |line| line.finished.is_some());
        assert!(!line.said_since(then).contains("G10"), "{firmware}");
        assert!(has_said(&line, "G38.2 in line 3 probes nothing there"), "{:#?}", line.log);
    }
}

fn check() -> RunRequest {
    RunRequest {
        program_id: "part".into(),
        revision: 1,
        path: Arc::new(path(TOUCH_OFF)),
        start_line: 0,
        occurrence: 0,
        in_span: StartInSpan::default(),
        check_only: true,
        tool_diameters_mm: Default::default(),
    }
}

#[test]
fn in_a_check_nothing_is_probed() {
    let mut line = machine(Firmware::Grbl, -62.0);
    let then = line.now;
    let answer = line.ask(Command::RunProgram(check())).expect("it can be sent");
    line.wait(2.0);
    assert!(!line.said_since(then).contains("G38"), "{answer}");
    assert!(near(&line, START), "{:?}", line.axes());
}

#[test]
fn a_run_begins_after_a_probe_only_where_the_program_says_where() {
    let start = |program: &str, line| {
        let config = EncoderConfig::default();
        start_at(Arc::new(path(program)), config, (line, 0), StartInSpan::Refused).map(|_| ())
    };
    let refusal = start(TOUCH_OFF, 6).expect_err("it is refused").to_string();
    assert!(refusal.contains("G10 L20") && refusal.contains("begin before it"), "{refusal}");
    let program = "G21 G90\nG0 X0 Y0 Z5\nG38.2 Z-30 F100\nG1 X5 F600\nG0 Z5\nG1 X20\nM2\n";
    let refusal = start(program, 4).expect_err("it is refused").to_string();
    assert!(refusal.contains("Z has not been given since G38.2"), "{refusal}");
    start(program, 6).expect("Z is given");
    let lifted = |program: &str, line| {
        let config = EncoderConfig { approach_z_mm: Some(-1.0), ..EncoderConfig::default() };
        start_at(Arc::new(path(program)), config, (line, 0), StartInSpan::Refused).map(|_| ())
    };
    let by_so_much = "G21 G90\nG0 X0 Y0 Z5\nG38.2 X50 F100\nG53 G0 Z0\nG91 G0 X-2\nG90 G10 L20 P1 X0\nG0 X10\nG0 Z5\nM2\n";
    let refusal = lifted(by_so_much, 5).expect_err("it is refused").to_string();
    assert!(refusal.contains("X has not been given"), "{refusal}");
    let stored = "G21 G90\nG0 X0 Y0 Z5\nG38.2 Z-30 F100\nG0 X5\nG10 L20 P1 Z0\nG0 Z5\nM2\n";
    let refusal = lifted(stored, 4).expect_err("it is refused").to_string();
    assert!(refusal.contains("Z has not been given since G38.2"), "{refusal}");
    lifted(&stored.replace("G10 L20 P1 Z0\n", ""), 4).expect("Z is given later");
    let program = "G21 G90\nG0 X0 Y0 Z5\nG38.2 Z-30 F100\nG91 G0 Z5\nX5\nG90 G1 X20 F600\nM2\n";
    let refusal = start(program, 6).expect_err("it is refused").to_string();
    assert!(refusal.contains("Z has not been given since G38.2"), "{refusal}");
}

#[test]
fn what_depends_on_the_result_of_a_probe_is_refused_with_its_place() {
    let probe = "G21 G90 F100\nG0 X0 Y0 Z5\nG38.2 Z-30\n";
    for (after, said) in [
        ("G18 G91 G2 X2 Z1 R2", "starts from where Z is, which is not known since G38.2 in line 3"),
        ("G91 G81 X5 Z-1 R1", "where Z is, which is not known since G38.2 in line 3"),
        ("G43.1 Z5\nG91 G0 Z1", "where Z is, which is not known since G43.1 in line 4"),
        ("G92 Z0", "not known since G38.2 in line 3"),
        ("#1=#5063", "is the result of a probe, which is known only while the machine runs"),
        ("G0 Z#<_z>", "Z"),
        ("G38.2 X5 A5", "A cannot move in a probe"),
        ("G38.2", "G38.2 without X, Y or Z"),
        ("G38.2 X0 Y0", "G38.2 ends where it begins"),
        ("G93 G1 Z5 F10", "where Z is, which is not known since G38.2 in line 3"),
        ("T1 M6\nG91 G0 Z5", "where Z is, which is not known since G38.2 in line 3"),
        ("G93 G38.2 X5 F1", "G94 is not in force"),
        ("G95 S100\nG38.2 X5 F1", "G94 is not in force"),
        ("G38.2 X5 F0", "needs a feed rate"),
        ("G38.6 X5", "G38.6"),
        ("T1 M6\nG41 D1 G1 X10 Y10\nG38.2 X20", "under cutter radius compensation"),
    ] {
        let program = format!("{probe}{after}\nM2\n");
        let findings: Vec<Finding> = planned(&program).expect_err(after);
        let first = &findings[0];
        assert!(first.source.line >= 4, "{after}: {findings:#?}");
        assert!(first.message.contains(said), "{after}: {findings:#?}");
    }
    // And what is said to do instead does it.
    for remedy in ["G10 L20 P0 Z0\nG91 G0 Z5", "G0 Z5\nG91 Z5", "G10 L20 P0 Z0\nG92 Z1\nG0 Z#<_z>"]
    {
        planned(&format!("{probe}{remedy}\nM2\n")).expect("it is known then");
    }
    let other = format!("{probe}G10 L20 P2 Z0\nG91 G0 Z5\nM2\n");
    planned(&other).expect("by so much from where it is");
    planned(&other.replace("Z5\nM2", "Z5\nG92 Z0\nM2"))
        .expect_err("the zero of another work system says nothing of this one");
}
