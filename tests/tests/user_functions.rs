//! M100 to M199: the machine stands until the function is done, and the run goes on only then.

use axis_driver::codes::error_code;
use axis_driver::driver::{Command, DriverConfig, RunOutcome, UserFunctionCall};
use axis_driver::encoder::UserFunction;
use cnc_msgs::machine::Mode;
use cnc_msgs::path::CompensatedPath;
use kerf_tests::line::Line;
use kerf_tests::planned;
use std::sync::Arc;
use virtual_controller::{Build, Firmware, Settings};

const PROGRAM: &str = "G21 G90 G94 G54 F1200\nG1 X20\nM101 P2 Q-0.5\nG1 X40\nM102\nG1 X60\nM30\n";

fn path() -> CompensatedPath {
    planned(PROGRAM).expect("a path")
}

fn ready() -> Line {
    let build = Build {
        start_in_machine: Some([-300.0, -200.0, -50.0]),
        ..Build::new(Settings::small_router_of(Firmware::Grbl))
    };
    let mut line = Line::new(DriverConfig::default(), build, &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.zero_here();
    line
}

/// Waits in the first function.
fn calling() -> Line {
    let mut line = ready();
    line.start(path(), 0);
    line.until("the call", |line| !line.calls.is_empty());
    line
}

fn done(line: &mut Line, answer: Result<&str, &str>) {
    let UserFunctionCall { run, call, .. } = *line.calls.last().expect("a call");
    let answer = answer.map(str::to_owned).map_err(str::to_owned);
    line.ask(Command::UserFunctionEnded { run, call, answer }).expect("heard");
}

/// Where the tool stands along X, in the work frame.
fn x(line: &Line) -> f64 {
    line.state().work_position.expect("a position")[0]
}

#[test]
fn the_machine_stands_while_a_function_is_done_and_goes_on_after_it() {
    let mut line = calling();
    let called = line.calls[0].clone();
    assert_eq!(called.function, UserFunction { number: 101, p: Some(2.0), q: Some(-0.5) });
    assert_eq!((called.program_id.as_str(), called.line), ("part", 3));
    line.wait(10.0);
    assert!((x(&line) - 20.0).abs() < 0.01, "{}", x(&line));
    let state = line.state();
    assert_eq!(state.mode, Mode::Run);
    assert_eq!(state.reason, "FUNCTION: M101 P2 Q-0.5 is being done (line 3)");
    done(&mut line, Ok("the part is out"));
    assert!(line.log.iter().any(|it| it == "line 3: M101 P2 Q-0.5 is done: the part is out"));
    line.until("the second call", |line| line.calls.len() == 2);
    assert!((x(&line) - 40.0).abs() < 0.01, "{}", x(&line));
    assert_eq!(line.calls[1].function, UserFunction { number: 102, p: None, q: None });
    done(&mut line, Ok(""));
    let result = line.result();
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
    assert!((x(&line) - 60.0).abs() < 0.01, "{}", x(&line));
}

#[test]
fn a_function_that_is_not_done_ends_the_run_where_it_stands() {
    for (end, says) in [
        (Some(Err("the gripper is empty")), "the gripper is empty"),
        (None, "no answer within 60 s (user_function_s_max)"),
    ] {
        let mut line = calling();
        match end {
            Some(answer) => done(&mut line, answer),
            None => line.wait(75.0),
        }
        let result = line.result();
        assert_eq!(
            (result.outcome, result.error_code),
            (RunOutcome::Aborted, error_code::USER_FUNCTION)
        );
        let next = "to go on, begin at line 3 to have it done, or after it if it was done";
        assert_eq!(result.message, format!("line 3: M101 P2 Q-0.5: {says}; {next}"));
        assert_eq!(result.blamed_line, 3);
        line.until("idle", |line| line.mode() == Mode::Idle);
        assert!((x(&line) - 20.0).abs() < 0.01, "{}", x(&line));
        assert_eq!(line.calls.len(), 1);
    }
}

#[test]
fn a_hold_lasts_beyond_the_end_of_the_function() {
    let mut line = calling();
    line.ask(Command::FeedHold).expect("a hold");
    line.until("the hold", |line| line.mode() == Mode::Hold);
    let reason = line.state().reason;
    assert!(reason.ends_with("FUNCTION: M101 P2 Q-0.5 is being done (line 3)"), "{reason}");
    // Its node may wait, too.
    line.wait(200.0);
    assert!(line.finished.is_none(), "{:?}", line.finished);
    done(&mut line, Ok(""));
    line.wait(5.0);
    assert!((x(&line) - 20.0).abs() < 0.01, "{}", x(&line));
    assert!(line.ask_resume());
    line.until("the second call", |line| line.calls.len() == 2);
    assert!((x(&line) - 40.0).abs() < 0.01, "{}", x(&line));
}

#[test]
fn a_canceled_run_waits_for_no_answer_and_takes_none_for_the_next_run() {
    let mut line = calling();
    let of_before = line.calls[0].clone();
    line.ask(Command::CancelRun { run: None }).expect("a cancel");
    assert_eq!(line.result().outcome, RunOutcome::Canceled);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.finished = None;
    line.start(path(), 0);
    line.until("the call of the next run", |line| line.calls.len() == 2);
    let UserFunctionCall { run, call, .. } = of_before;
    let says = "line 3: M101 P2 Q-0.5 was called, and may go on";
    assert!(line.log.iter().any(|it| it == says), "{:?}", line.log);
    let late = line.ask(Command::UserFunctionEnded { run, call, answer: Ok(String::new()) });
    assert_eq!(late.expect_err("too late").message, "no run waits for it any more");
    line.wait(5.0);
    assert_eq!(line.calls.len(), 2);
    assert!((x(&line) - 20.0).abs() < 0.01, "{}", x(&line));
}

#[test]
fn without_the_ros_side_nobody_knows_whether_it_was_done() {
    let mut line = calling();
    let _ = line.ask(Command::RosFace { is_there: false });
    let result = line.result();
    assert_eq!(result.error_code, error_code::USER_FUNCTION, "{result:?}");
    assert!(result.message.contains("whether it was done is not known"), "{result:?}");
}

#[test]
fn a_run_from_the_middle_does_not_call_what_comes_before() {
    let mut line = ready();
    let _ = line.run(planned("G21 G90 G94 G54 F1200\nG1 X20\nM30\n").expect("a path"));
    line.finished = None;
    line.start(path(), 4);
    line.until("the call", |line| !line.calls.is_empty());
    assert_eq!(line.calls[0].function.number, 102);
}

#[test]
fn a_function_is_a_block_of_single_block_mode() {
    let mut line = ready();
    line.ask(Command::SetSingleBlock(true)).expect("a mode");
    line.start(path(), 0);
    let mut seen = Vec::new();
    while line.finished.is_none() {
        let called = line.calls.len();
        line.until("a block, a call or the end", |line| {
            line.mode() == Mode::Hold || line.calls.len() > called || line.finished.is_some()
        });
        if line.calls.len() > called {
            seen.push(line.calls[called].function.to_string());
            done(&mut line, Ok(""));
        } else if line.finished.is_none() {
            let reason = line.state().reason;
            seen.push(reason.replace("SINGLE_BLOCK: resume to go on ", ""));
            assert!(line.ask_resume());
        }
    }
    let wanted = [
        "(line 1)",
        "(line 2)",
        "M101 P2 Q-0.5",
        "(line 3)",
        "(line 4)",
        "M102",
        "(line 5)",
        "(line 6)",
    ];
    assert_eq!(seen, wanted);
}

#[test]
fn a_function_is_not_called_while_a_hold_waits_nor_without_the_ros_side() {
    let mut line = ready();
    line.start(path(), 0);
    line.until("the end of the first move", |line| x(line) > 19.0);
    line.ask(Command::FeedHold).expect("a hold");
    line.wait(10.0);
    assert!(line.calls.is_empty());
    let _ = line.ask(Command::RosFace { is_there: false });
    assert!(line.ask_resume());
    let result = line.result();
    assert_eq!(result.error_code, error_code::USER_FUNCTION, "{result:?}");
    assert!(result.message.contains("it was not called"), "{result:?}");
    assert!(line.calls.is_empty());
}

#[test]
fn none_is_called_where_none_may_take_any_time() {
    let build = Build::new(Settings::small_router_of(Firmware::Grbl));
    let config = DriverConfig { user_function_s_max: 0, ..DriverConfig::default() };
    let mut line = Line::new(config, build, &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    let refused = line
        .ask(Command::ExecuteMdi { path: Arc::new(path()), tool_diameters_mm: Default::default() })
        .expect_err("a refusal");
    assert_eq!(refused.error_code, error_code::NOT_ENCODABLE, "{refused:?}");
    assert!(refused.message.contains("user_function_s_max is 0"), "{refused:?}");
    assert!(line.calls.is_empty());
}
