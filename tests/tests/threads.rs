//! G33 and G76 on a board whose spindle has an encoder, and on boards without one.

use axis_driver::codes::error_code;
use axis_driver::driver::{Command, RunOutcome, RunRequest};
use cnc_msgs::machine::Mode;
use cnc_msgs::path::{CompensatedPath, StartInSpan};
use kerf_tests::line::Line;
use kerf_tests::planned;
use std::sync::Arc;
use virtual_controller::{Build, Firmware, Settings};

const START: [f64; 3] = [-300.0, -200.0, -50.0];

const THREAD: &str = "G21 G90 G18
S500 M3
G0 X10 Z2
G1 X9 F300
G33 Z-20 K1.27
G0 X12
Z2
G76 P1.5 Z-18 I-1 J0.4 K0.9 Q29.5
G1 X11 F300
M5
M2
";

fn path(program: &str) -> CompensatedPath {
    planned(program).unwrap_or_else(|findings| panic!("{program}: {findings:#?}"))
}

fn machine(firmware: Firmware, has_spindle_encoder: bool) -> Line {
    let settings = Settings::small_router_of(firmware);
    let start_in_machine = Some(START);
    let mut line =
        Line::connected(Build { has_spindle_encoder, start_in_machine, ..Build::new(settings) });
    line.zero_here();
    line
}

#[test]
fn a_thread_is_cut_at_the_pace_of_the_spindle() {
    let mut line = machine(Firmware::GrblHal, true);
    let then = line.now;
    let result = line.run(path(THREAD));
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?} {:#?}", line.log);
    let said = line.said_since(then);
    let threads: Vec<&str> = said.lines().filter(|line| line.contains("G33")).collect();
    assert_eq!(threads.len(), 4, "{said}");
    assert!(threads[0].ends_with("G33Z-20K1.27"), "{said}");
    assert!(threads.iter().all(|line| !line.contains('F')), "{said}");
    // What comes after them says its word; the feed of before is still in force.
    assert!(said.contains("G0X12\n") && said.contains("G1X11\n"), "{said}");
    assert!(!has_said(&line, "PATH_DEVIATION"), "{:#?}", line.log);
    let at = line.axes();
    let wanted = [-289.0, -200.0, -68.0];
    assert!(at.iter().zip(wanted).all(|(is, at)| (is - at).abs() < 0.01), "{at:?}");
}

const SLOW: &str = "G21 G90\nG0 Z2\nS60 M3\nG33 Z-20 K1\nG0 Z2\nM5\nM2\n";

fn has_said(line: &Line, text: &str) -> bool {
    line.log.iter().any(|said| said.contains(text))
}

#[test]
fn a_hold_waits_for_the_end_of_a_thread() {
    let mut line = machine(Firmware::GrblHal, true);
    line.start(path(SLOW), 0);
    line.until("it threads", |line| line.axes()[2] < START[2] - 1.0);
    line.ask(Command::FeedHold).expect("a hold is taken");
    line.wait(10.0);
    assert_eq!(line.mode(), Mode::Run, "{:?}", line.state());
    line.until("it holds", |line| line.mode() == Mode::Hold);
    assert!((line.axes()[2] - (START[2] - 20.0)).abs() < 0.01, "{:?}", line.axes());
    assert!(has_said(&line, "waits for the end of the thread"), "{:#?}", line.log);
    assert!(!has_said(&line, "does not hold"), "{:#?}", line.log);
    assert!(line.ask_resume());
    let result = line.result();
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
}

#[test]
fn a_hold_while_the_spindle_is_waited_for_holds_before_the_thread() {
    let mut line = machine(Firmware::GrblHal, true);
    let then = line.now;
    line.start(path(SLOW), 0);
    // The wait takes two seconds, without a report.
    line.until("the thread is sent", |line| line.said_since(then).contains("G33"));
    line.wait(1.0);
    line.ask(Command::FeedHold).expect("a hold is taken");
    line.until("it holds", |line| line.mode() == Mode::Hold);
    assert!((line.axes()[2] - START[2] - 2.0).abs() < 0.1, "{:?}", line.axes());
    line.wait(60.0);
    assert!(line.ask_resume());
    let result = line.result();
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?} {:#?}", line.log);
}

#[test]
fn a_cancelled_run_ends_where_its_pass_ends() {
    let mut line = machine(Firmware::GrblHal, true);
    line.start(path(SLOW), 0);
    line.until("it threads", |line| line.axes()[2] < START[2] - 1.0);
    line.ask(Command::CancelRun { run: None }).expect("it is taken");
    let result = line.result();
    assert_eq!(result.outcome, RunOutcome::Canceled, "{result:?}");
    assert!((line.axes()[2] - (START[2] - 20.0)).abs() < 0.01, "{:?}", line.axes());
}

#[test]
fn a_thread_that_leaves_its_way_or_its_pace_is_stopped_at_once() {
    for (sent, read) in [("G33Z-20K1", "G33Z-45X9K1"), ("G33Z-20K1", "G33Z-20K9")] {
        let mut line = machine(Firmware::GrblHal, true);
        line.spoil_next(move |bytes| {
            let text = String::from_utf8_lossy(bytes);
            text.contains(sent).then(|| text.replace(sent, read).into_bytes())
        });
        line.start(path(SLOW), 0);
        let result = line.result();
        assert_eq!(result.outcome, RunOutcome::Aborted, "{read}: {result:?}");
        assert_eq!(result.error_code, error_code::PATH_DEVIATION, "{read}: {result:?}");
        assert!(line.axes()[2] > START[2] - 15.0, "{read}: {:?}", line.axes());
    }
}

#[test]
fn a_board_that_cannot_thread_refuses_the_program_before_anything_moves() {
    for (firmware, has_encoder, program, part) in [
        (Firmware::Grbl, true, THREAD, "line 5: G33 K1.27 needs a spindle"),
        (Firmware::FluidNc, true, THREAD, "line 5: G33 K1.27 needs a spindle"),
        (Firmware::GrblHal, false, THREAD, "SS in [NEWOPT:]"),
        (
            Firmware::GrblHal,
            true,
            "G21 G90\nS4000 M3\nG0 Z5\nG33 Z-10 K2\nM2\n",
            "line 4: G33 K2 feeds 8000 mm/min",
        ),
        (Firmware::GrblHal, true, "G21 G90\nS20 M3\nG0 Z5\nG33 Z-10 K2\nM2\n", "above 24"),
    ] {
        let mut line = machine(firmware, has_encoder);
        let then = line.now;
        let request = RunRequest {
            program_id: "part".into(),
            revision: 1,
            path: Arc::new(path(program)),
            start_line: 0,
            occurrence: 0,
            in_span: StartInSpan::default(),
            check_only: false,
            tool_diameters_mm: Default::default(),
        };
        let refusal = line.ask(Command::RunProgram(request)).expect_err("a refusal");
        assert!(refusal.message.contains(part), "{firmware}: {refusal:?}");
        assert_eq!(refusal.error_code, error_code::NOT_ENCODABLE, "{firmware}");
        assert!(!line.said_since(then).contains("G33"), "{firmware}");
        assert_eq!(line.axes(), START, "{firmware}");
    }
}
