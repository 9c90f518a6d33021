//! M48 to M51: what the program lets its operator override.

use super::*;
use kerf_tests::planned;

const PROGRAM: &str =
    "G21 G90 G94 G54 F1200\nG1 X20\nM49\nG1 X40\nM50 P1\nG1 X60\nM48\nG1 X80\nM30\n";

fn started(firmware: Firmware, program: &str, line: u32) -> Line {
    let build = Build {
        start_in_machine: Some([-300.0, -200.0, -50.0]),
        ..Build::new(Settings::small_router_of(firmware))
    };
    let mut it = Line::connected(build);
    it.zero_here();
    it.start(planned(program).expect("a path"), line);
    it
}

fn set(line: &mut Line, feed: Option<u8>, rapid: Option<u8>, spindle: Option<u8>) {
    line.ask(Command::SetOverrides(Overrides { feed, rapid, spindle })).expect("it is set");
}

fn until_line(line: &mut Line, number: u32) {
    line.until("the line", |line| line.state().line == number && line.mode() == Mode::Run);
}

#[test]
fn what_a_program_forbids_is_at_a_hundred_percent_and_comes_back_as_the_operator_had_it() {
    for firmware in Firmware::ALL {
        let mut line = started(firmware, PROGRAM, 0);
        until_line(&mut line, 2);
        set(&mut line, Some(150), Some(50), Some(80));
        until_line(&mut line, 4);
        line.wait(0.3);
        assert_eq!(line.state().overrides_percent, [100, 100, 100], "{firmware}");
        let refused = Overrides { feed: None, rapid: Some(25), spindle: None };
        let refusal = line.ask(Command::SetOverrides(refused)).expect_err("it is forbidden");
        assert_eq!(refusal.error_code, error_code::BUSY);
        let text = "line 3: the program has switched feed and rapid overrides off";
        assert!(refusal.message.starts_with(text), "{refusal:?}");
        until_line(&mut line, 6);
        line.wait(0.3);
        assert_eq!(line.state().overrides_percent, [150, 50, 100], "{firmware}");
        set(&mut line, Some(120), None, None);
        let refused = Overrides { feed: None, rapid: None, spindle: Some(90) };
        assert!(line.ask(Command::SetOverrides(refused)).is_err());
        until_line(&mut line, 8);
        line.wait(0.3);
        assert_eq!(line.state().overrides_percent, [120, 50, 80], "{firmware}");
        assert_eq!(line.result().outcome, RunOutcome::Succeeded, "{firmware}");
    }
}

#[test]
fn who_changes_a_forbidden_override_at_the_machine_gets_a_hundred_percent_again() {
    let mut line = started(Firmware::Grbl, PROGRAM, 0);
    until_line(&mut line, 4);
    // A pendant.
    line.pendant(0x91);
    line.until("it is seen", |line| {
        line.log
            .iter()
            .any(|it| it.contains("overrides off, and the controller reports feed 110 %"))
    });
    line.wait(0.5);
    assert_eq!(line.state().overrides_percent, [100; 3]);
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
}

#[test]
fn overrides_that_do_not_go_to_a_hundred_end_the_run_at_the_word() {
    let mut line = started(Firmware::Grbl, PROGRAM, 0);
    until_line(&mut line, 2);
    set(&mut line, Some(150), None, None);
    let is_override = |byte: &u8| (0x90..=0x9d).contains(byte);
    while line.finished.is_none() {
        if !line.is_spoil_due() {
            line.spoil_next(move |bytes| {
                let others = || bytes.iter().copied().filter(|byte| !is_override(byte)).collect();
                bytes.iter().any(is_override).then(others)
            });
        }
        line.step();
    }
    let result = line.result();
    assert_eq!((result.outcome, result.error_code), (RunOutcome::Aborted, error_code::NO_ANSWER));
    let text = "line 3: the program switches overrides off, and the controller reports feed 150 %";
    assert!(result.message.starts_with(text), "{result:?}");
    assert_eq!(result.blamed_line, 3);
}

#[test]
fn a_start_in_the_middle_has_what_the_lines_before_it_forbid() {
    let mut line =
        started(Firmware::GrblHal, "G21 G90 G94 G54 F1200\nG1 X0\nM51 P0\nG1 X0\nG1 X40\nM30\n", 5);
    until_line(&mut line, 5);
    let spindle = Overrides { feed: None, rapid: None, spindle: Some(90) };
    let refusal = line.ask(Command::SetOverrides(spindle)).expect_err("it is forbidden");
    assert!(
        refusal.message.starts_with("line 3: the program has switched the spindle override off")
    );
    set(&mut line, Some(150), None, None);
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
}

#[test]
fn the_end_of_the_run_ends_it() {
    let mut line = started(Firmware::Grbl, "G21 G90 G94 G54 F1200\nM49\nG1 X20\n", 0);
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    set(&mut line, Some(150), Some(25), Some(80));
}
