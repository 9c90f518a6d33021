//! Probes that miss, lines that are damaged, results that do not come.

use super::*;

#[test]
fn a_probe_that_the_controller_has_not_run_ends_the_run() {
    // The line becomes a comment, and what is known of a probe is of the one before.
    for (first, damaged) in [("G91G38.2Z-4", "(91G38.2Z-4"), ("G91G38.2Z-30", "(91G38.2Z-30")] {
        let mut line = machine(Firmware::GrblHal, -62.0);
        line.start(
            path(&TWICE.replace("G21 G91", "G21 G90\nG0 Z1\nG38.2 Z-30 F600\nG91 G0 Z3")),
            0,
        );
        spoil(&mut line, first, damaged);
        let result = line.result();
        assert_eq!(result.error_code, error_code::PROBE_FAILED, "{damaged}: {result:?}");
        assert!(result.message.contains("is not on the way of the tool"), "{damaged}: {result:?}");
    }
    // One that may miss has to be at the end of its way then.
    let mut line = machine(Firmware::GrblHal, -90.0);
    line.start(path("G21 G90\nG0 Z1\nG38.3 Z-5 F100\nG0 Z5\nM2\n"), 0);
    spoil(&mut line, "G38.3", "(38.3");
    line.until("a hold", |line| line.mode() == Mode::Hold || line.finished.is_some());
    let reason = line.state().reason;
    assert!(reason.contains("PATH_DEVIATION"), "{reason} {:?}", line.finished);
}

#[test]
fn a_damaged_way_back_from_a_probe_is_held() {
    let mut line = machine(Firmware::GrblHal, -62.0);
    line.start(path(TWICE), 0);
    spoil(&mut line, "G91Z2", "G91Z9");
    line.until("a hold", |line| line.mode() == Mode::Hold);
    let reason = line.state().reason;
    assert!(reason.contains("PATH_DEVIATION"), "{reason}");
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
fn a_line_that_is_damaged_after_a_probe_is_held() {
    let mut line = machine(Firmware::GrblHal, -62.0);
    line.start(path(TOUCH_OFF), 0);
    spoil(&mut line, "X20Y10", "X29Y10");
    line.until("a hold", |line| line.mode() == Mode::Hold);
    let reason = line.state().reason;
    assert!(reason.contains("PATH_DEVIATION"), "{reason}");
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
        spoil(&mut line, is, damaged);
        line.until("a hold", |line| line.mode() == Mode::Hold);
        let reason = line.state().reason;
        assert!(reason.contains("PATH_DEVIATION"), "{damaged}: {reason}");
        assert!(reason.contains("line 3"), "{damaged}: {reason}");
    }
}
