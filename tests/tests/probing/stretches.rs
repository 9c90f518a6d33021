//! Runs of programs that compute with what their probes have found.

use super::*;
use axis_driver::driver::{ProbesOfRun, RunResult};
use program_loader::probe_results::with_results;
use std::time::Duration;

/// Makes what loader and planner make of what the probes have found, and lets the run go on with it.
fn go_on(line: &mut Line, program: &str, found: &ProbesOfRun) -> Result<String, String> {
    let text = with_results(program.as_bytes(), &found.measured);
    let text = String::from_utf8(text).expect("text");
    let of = found.revision;
    let count = found.measured.probes.len() + found.measured.inputs.len();
    let program_id = format!("part with {count} results");
    let answer = Ok(program_id.clone());
    line.ask(Command::ProgramContinued { of, answer }).expect("it is heard");
    let path = Arc::new(path(&text));
    let request = ReplanRequest { program_id, of, revision: of + 1, path };
    line.ask(Command::Replan(request)).map_err(|refusal| refusal.to_string())
}

/// Runs a program to its end; returns the lines that it has waited in.
fn run(line: &mut Line, program: &str) -> (RunResult, Vec<u32>) {
    line.start(path(program), 0);
    to_the_end(line, program)
}

/// The same of a program that is running.
pub(super) fn to_the_end(line: &mut Line, program: &str) -> (RunResult, Vec<u32>) {
    let mut waited = Vec::new();
    loop {
        line.until("it waits or ends", |line| line.finished.is_some() || !line.probes.is_empty());
        let Some(found) = line.probes.pop() else {
            return (line.finished.take().expect("it has ended"), waited);
        };
        let reason = line.state().reason;
        let wanted =
            format!(": what follows is being planned from its result (line {}", found.line);
        assert!(reason.contains(&wanted), "{reason}");
        waited.push(found.line);
        go_on(line, program, &found).expect("it is taken");
    }
}

#[test]
fn a_run_goes_on_with_what_is_computed_from_its_probe() {
    for firmware in Firmware::ALL {
        let mut line = machine(firmware, -62.0);
        // Twelve millimetres below; the middle between there and the start.
        let program = "G21 G90 G94 G54\nG0 Z2\nG38.2 Z-30 F100\nG0 Z[#5063+5]\nG0 X20 Y10\nG1 Z[#5063/2] F600\nM2\n";
        let (result, waited) = run(&mut line, program);
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware}: {result:?}");
        assert_eq!(waited, [4], "{firmware}");
        assert!(near(&line, [-280.0, -190.0, -56.0]), "{firmware}: {:?}", line.axes());
        assert!(!has_said(&line, "PATH_DEVIATION"), "{firmware}: {:#?}", line.log);
        assert_eq!(line.state().program_id, "part", "{firmware}");
    }
}

#[test]
fn a_block_that_needs_the_place_is_waited_for_as_a_reading_is() {
    for (program, wanted, line_awaited) in [
        // Plasma: 12 mm below, and up by 2; that is the zero, and from there to 5.
        ("G91 G1 Z2\nG90 G92 Z0\nG0 Z5\nX20\n", [-280.0, -200.0, -55.0], 5),
        ("G91 G18 G2 X4 Z0 I2 K0 F900\nG90 G17\n", [-296.0, -200.0, -62.0], 4),
        // X of the program is Y of the machine.
        ("G10 L2 P1 R[90+0*#5063]\nG0 Z5\nX20 Y0\n", [-300.0, -180.0, -45.0], 4),
    ] {
        for firmware in Firmware::ALL {
            let mut line = machine(firmware, -62.0);
            let program = format!("G21 G90 G94 G54\nG0 X0 Y0 Z2\nG38.2 Z-30 F100\n{program}M2\n");
            let (result, waited) = run(&mut line, &program);
            assert_eq!(result.outcome, RunOutcome::Succeeded, "{firmware}: {result:?}");
            assert_eq!(waited, [line_awaited], "{firmware}: {program}");
            assert!(near(&line, wanted), "{firmware}: {program} {:?}", line.axes());
            assert!(!has_said(&line, "PATH_DEVIATION"), "{firmware}: {:#?}", line.log);
        }
    }
}

#[test]
fn each_probe_of_a_loop_is_waited_for() {
    let program = "G21 G90 G94 G54\n#<_sum>=0\no1 repeat [3]\nG38.2 Z-30 F400\n#<_sum>=[#<_sum>+#5063]\nG91 G0 Z4\nX10\n\
                   G90\no1 endrepeat\nG0 Z5\nG1 Z[#<_sum>/3] F600\nM2\n";
    let mut line = machine(Firmware::GrblHal, -62.0);
    let (result, waited) = run(&mut line, program);
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
    assert_eq!(waited, [5, 5, 5]);
    let not_checked = line.log.iter().filter(|it| it.contains("not checked")).count();
    assert_eq!(not_checked, 1, "it is said once: {:#?}", line.log);
    assert!(near(&line, [-270.0, -200.0, -62.0]), "{:?}", line.axes());
    assert!(!has_said(&line, "PATH_DEVIATION"), "{:#?}", line.log);
}

#[test]
fn what_does_not_fit_ends_the_run_with_the_reason() {
    let program = "G21 G90 G94 G54\nG0 Z2\nG38.2 Z-30 F100\nG0 Z[#5063+5]\nM2\n";
    for (program, change, wanted) in [
        (program.to_owned(), 0.1, "Z is 0.100 mm from where what follows begins"),
        (program.replace("Z2", "Z3"), 0.0, "differs in blocks that were sent already"),
    ] {
        let mut line = machine(Firmware::Grbl, -62.0);
        line.start(path(&program.replace("Z3", "Z2")), 0);
        line.until("it waits", |line| !line.probes.is_empty());
        let mut found = line.probes.pop().expect("something");
        found.measured.probes[0].stands[2] += change;
        let refusal = go_on(&mut line, &program, &found).expect_err(wanted);
        assert!(refusal.contains(wanted), "{refusal}");
        let result = line.result();
        assert_eq!(result.error_code, error_code::PROBE_FAILED, "{result:?}");
        assert!(result.message.starts_with("line 4: what follows was not planned"), "{result:?}");
        assert!(result.message.contains(wanted), "{result:?}");
    }
}

#[test]
fn what_follows_is_judged_by_travel_and_home_as_a_whole_program_is() {
    let config = DriverConfig { check_travel: CheckTravel::Refuse, ..DriverConfig::default() };
    let program = |depth: i32| {
        format!(
            "G21 G90 G94 G54\nG0 X0 Y0 Z2\nG38.2 Z-70 F400\n#1=#5063\nG0 Z2\nG1 Z[#1-{depth}]\nM2\n"
        )
    };
    // The surface is 20 mm above the end of the travel.
    let (result, _) = run(&mut judged::homed(config.clone()), &program(15));
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
    let refused = |line: &mut Line, program: &str| {
        line.start(path(program), 0);
        line.until("it waits", |line| !line.probes.is_empty());
        let found = line.probes.pop().expect("something");
        go_on(line, program, &found).expect_err("it is refused");
        line.result().message
    };
    let said = refused(&mut judged::homed(config), &program(25));
    assert!(said.contains("line 6") && said.contains("travel"), "{said}");
    // Where the machine's zero is not known, G53 goes anywhere.
    let mut settings = Settings::small_router();
    settings.set_line("$22=1").expect("a setting");
    let build = Build { probe_surface_z_mm: Some(-62.0), ..Build::new(settings) };
    let mut line = Line::new(DriverConfig::default(), build, &[]);
    line.until("locked", |line| line.mode() == Mode::Alarm);
    line.ask(Command::Unlock).expect("unlocked");
    line.until("idle", |line| line.mode() == Mode::Idle);
    let said = refused(&mut line, "G21 G90 G94 G54\nG38.2 Z-30 F100\n#1=#5063\nG53 G0 Z0\nM2\n");
    assert!(said.contains("G53 in line 4"), "{said}");
}

#[test]
fn another_path_than_that_of_the_results_changes_nothing() {
    let program = "G21 G90 G94 G54\nG0 Z2\nG38.2 Z-30 F100\nG0 Z[#5063+5]\nM2\n";
    let mut line = machine(Firmware::Grbl, -62.0);
    line.start(path(program), 0);
    line.until("it waits", |line| !line.probes.is_empty());
    let found = line.probes.pop().expect("something");
    let older = ProbesOfRun { revision: 7, ..found.clone() };
    go_on(&mut line, program, &older).expect_err("another run");
    let request = ReplanRequest {
        program_id: "another text".into(),
        of: found.revision,
        revision: 9,
        path: Arc::new(path(program)),
    };
    line.ask(Command::Replan(request)).expect_err("not what the loader has read");
    go_on(&mut line, program, &found).expect("the right one is still taken");
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
}

#[test]
fn the_rest_begins_where_the_path_knows_that_the_tool_stands() {
    for (program, at) in [
        // A rapid of the program is no place that is said, and is sent.
        ("G0 Z2\nG38.2 Z-30 F100\nG0 Z10\nG0 X[#5063+20]\nG0 Y5\n", [-292.0, -195.0, -40.0]),
        // Axes that the program has not named yet.
        ("G38.2 Z-30 F100\nG0 Z[#5063+2]\n", [-300.0, -200.0, -60.0]),
        // Where Z is in the work frame, nobody knows after it.
        ("G38.2 Z-30 F100\nG53 G0 Z-45\n#1=#5063\nG0 X7\nG0 Z[#1+3]\n", [-293.0, -200.0, -59.0]),
        // It is the last block.
        ("G38.2 Z-30 F100\nG0 Z3\n#100=#5063\n", [-300.0, -200.0, -47.0]),
        // X has to stand where the program begins to count it.
        ("G38.2 Z-30 F100\n#1=#5063\nG91 G0 X4\n", [-296.0, -200.0, -62.0]),
    ] {
        let mut line = machine(Firmware::GrblHal, -62.0);
        let (result, _) = run(&mut line, &format!("G21 G90 G94 G54\n{program}"));
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{program}: {result:?}");
        assert!(near(&line, at), "{program}: {:?}", line.axes());
    }
    // The tool is not at the work zero, and the program has not said where it is.
    let mut line = machine(Firmware::Grbl, -62.0);
    line.run(path("G21 G90 G54\nG0 X30 Y-20\nM2\n"));
    let (result, _) =
        run(&mut line, "G21 G90 G94 G54\nG38.2 Z-30 F100\nG0 Z[#5063+2]\nG0 X0\nM2\n");
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
    assert!(near(&line, [-300.0, -220.0, -60.0]), "{:?}", line.axes());
}

#[test]
fn a_run_that_the_loader_refuses_ends_with_its_reason_and_a_hold_takes_its_time() {
    let program = "G21 G90 G94 G54\nG38.2 Z-30 F100\nG0 Z[#5063+5]\nM2\n";
    let mut line = machine(Firmware::Grbl, -62.0);
    line.start(path(program), 0);
    line.until("it waits", |line| !line.probes.is_empty());
    let found = line.probes.pop().expect("something");
    let refused = |of| Command::ProgramContinued { of, answer: Err("a division by zero".into()) };
    line.ask(refused(found.revision + 1)).expect("it is of another stretch");
    line.ask(Command::FeedHold).expect("it holds");
    let then = line.now;
    line.until("two minutes are over", |line| line.now > then + Duration::from_secs(120));
    assert_eq!(line.finished, None);
    while !line.ask_resume() {}
    line.ask(refused(found.revision)).expect("it is heard");
    let result = line.result();
    assert_eq!(
        (result.outcome, result.error_code),
        (RunOutcome::Aborted, error_code::PROBE_FAILED)
    );
    assert!(result.message.contains("line 3: what follows was not planned"), "{result:?}");
    assert!(result.message.contains("a division by zero"), "{result:?}");
}

#[test]
fn a_run_whose_plan_does_not_come_ends_with_its_line() {
    let program = "G21 G90 G94 G54\nG38.2 Z-30 F100\nG0 Z[#5063+5]\nM2\n";
    let mut line = machine(Firmware::Grbl, -62.0);
    line.start(path(program), 0);
    let result = line.result();
    assert_eq!(
        (result.outcome, result.error_code),
        (RunOutcome::Aborted, error_code::PROBE_FAILED)
    );
    assert!(
        result.message.contains(
            "line 3: what follows was not planned from what was measured: the loader has not"
        ),
        "{result:?}"
    );
    // It can be canceled, too.
    let mut line = machine(Firmware::Grbl, -62.0);
    line.start(path(program), 0);
    line.until("it waits", |line| !line.probes.is_empty());
    line.ask(Command::CancelRun { run: None }).expect("it is canceled");
    assert_eq!(line.result().outcome, RunOutcome::Canceled);
}

#[test]
fn no_run_begins_with_what_the_probes_of_another_have_found() {
    let program = "G21 G90 G94 G54\nG38.2 Z-30 F100\nG0 Z[#5063+5]\nM2\n";
    let mut line = machine(Firmware::Grbl, -62.0);
    line.start(path(program), 0);
    line.until("it waits", |line| !line.probes.is_empty());
    let found = line.probes.pop().expect("something");
    go_on(&mut line, program, &found).expect("it is taken");
    line.result();
    let text = with_results(program.as_bytes(), &found.measured);
    let request = RunRequest {
        path: Arc::new(path(std::str::from_utf8(&text).expect("text"))),
        check_only: false,
        ..refused::check()
    };
    let refusal = line.ask(Command::RunProgram(request)).expect_err("it is refused").to_string();
    assert!(refusal.contains("load the program again"), "{refusal}");
}
