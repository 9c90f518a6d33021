//! What counts from a place that nobody knows, and checks, which probe nothing.

use super::*;
use cnc_msgs::contour::Action;

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
    // With one less, a result would be taken for that of the probe before.
    let computes = "G21 G90\nG0 X0 Y0 Z5\nG0 X2\nG38.2 Z-30 F100\nG0 Z5\nG0 X9\nG38.2 Z-30\nG0 Z[#5063+5]\nM2\n";
    let refusal = start(computes, 6).expect_err("it is refused").to_string();
    assert!(refusal.contains("line 6 comes after the probe or M66 in line 4"), "{refusal}");
    // Of line 8 nothing is planned before the run.
    let refusal = start(computes, 8).expect_err("it is refused").to_string();
    assert!(refusal.contains("begin at line 4 or before"), "{refusal}");
    start(computes, 3).expect("both probes come after it");
    start(computes, 4).expect("the probe itself is not skipped");
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
fn what_a_probe_cannot_give_is_refused_with_its_place() {
    let probe = "G21 G90 F100\nG0 X0 Y0 Z5\nG38.2 Z-30\n";
    for (after, said) in [
        ("G41 D1 G1 X10 Y10\n#1=#5063", "cannot be read under cutter radius compensation"),
        ("G38.2 X5 A5", "A cannot move in a probe"),
        ("G38.2", "G38.2 without X, Y or Z"),
        ("G38.2 X0 Y0", "G38.2 ends where it begins"),
        ("T1 M6\nG91 G0 Z5", "where Z is, which is not known since M6 in line 4"),
        ("T1 M6\nG92 Z5", "where Z is, which is not known since M6 in line 4"),
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
    // The zero of another work system says nothing of this one.
    let waits = planned(&other.replace("Z5\nM2", "Z5\nG92 Z0\nM2")).expect("a stretch");
    assert!(matches!(waits.events.last().expect("it").action, Action::Stretch { .. }));
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

pub(super) fn check() -> RunRequest {
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
fn what_is_left_is_not_planned_again_while_an_axis_has_no_place() {
    // The probe of X says nothing of Z.
    let program =
        "G21 G91\nG38.2 Z-30 F600\nG0 Z2\nG38.3 X5\nG0 X-1\nG90 G0 X0\nG10 L20 P1 Z0\nG0 Z5\nM2\n";
    let mut line = machine(Firmware::GrblHal, -62.0);
    line.ask(Command::SetSingleBlock(true)).expect("it is set");
    line.start(path(program), 0);
    for number in [2, 3, 4, 5] {
        let reason = format!("(line {number})");
        line.until(&reason, |line| line.state().reason.contains(&reason));
        let (program_id, path) = ("part".into(), Arc::new(path(program)));
        let request = ReplanRequest { program_id, of: 1, revision: 2, path };
        let refusal = line.ask(Command::Replan(request)).expect_err("it is refused");
        assert_eq!(refusal.error_code, error_code::BUSY, "{number}: {refusal}");
        assert!(refusal.message.contains("counts from a place"), "{number}: {refusal}");
        while !line.ask_resume() {}
    }
}
