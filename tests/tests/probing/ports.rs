//! M62 to M68: outputs that a program switches, and inputs that it waits for and computes with.

use super::stretches::to_the_end;
use super::*;
use virtual_controller::Switched;

fn board(ports: [u8; 4]) -> Line {
    let settings = Settings::small_router_of(Firmware::GrblHal);
    let build = Build { ports, start_in_machine: Some(START), ..Build::new(settings) };
    let mut line = Line::connected(build);
    line.zero_here();
    line
}

/// What was switched, with X of the work frame: `P1=1 at 30`.
fn switched(line: &Line) -> Vec<String> {
    let controller = line.controller.device().controller();
    let text = |it: &Switched| {
        let letter = if it.is_analog { 'E' } else { 'P' };
        format!("{letter}{}={} at {:.3}", it.port, it.value, it.at[0] - START[0])
    };
    controller.switched().iter().map(text).collect()
}

fn has_said(line: &Line, text: &str) -> bool {
    line.log.iter().any(|said| said.contains(text))
}

#[test]
fn outputs_are_switched_where_the_program_says() {
    let mut line = board([0, 2, 0, 1]);
    let program = "G21 G90 G94
G0 X10
G1 X20 F600
M62 P0
G1 X30
M63 P0
M64 P1
G1 X40
M68 E0 Q25
G2 X50 I5
M67 E0 Q-1
G53 G0 X-240
M65 P1
M2
";
    let result = line.run(path(program));
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?} {:#?}", line.log);
    let expected = [
        "P0=1 at 20.000",
        "P1=1 at 30.000",
        "P0=0 at 30.000",
        "E0=25 at 40.000",
        "E0=-1 at 50.000",
        "P1=0 at 60.000",
    ];
    assert_eq!(switched(&line), expected);
    assert!(!has_said(&line, "PATH_DEVIATION"), "{:#?}", line.log);
}

#[test]
fn a_run_waits_for_an_input_and_says_what_it_has_read() {
    let mut line = board([2, 0, 1, 0]);
    line.inject("input:E0=512");
    line.start(
        path("G21 G90 G94\nG1 X5 F600\nM66 P1 L1 Q60\nM66 E0\nM66 P0 L3 Q1\nG0 X7\nM2\n"),
        0,
    );
    line.until("it waits", |line| line.state().reason == "INPUT: M66L1P1Q60 (line 3)");
    line.wait(20.0);
    assert_eq!((line.mode(), line.axes()[0]), (Mode::Run, START[0] + 5.0));
    line.inject("input:1=1");
    let result = line.result();
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?} {:#?}", line.log);
    for said in [
        "line 3: M66L1P1Q60 has read 1",
        "line 4: M66E0L0 has read 512",
        "line 5: M66L3P0Q1 has waited in vain",
    ] {
        assert!(has_said(&line, said), "{said}: {:#?}", line.log);
    }
}

#[test]
fn a_wait_can_be_held_and_cancelled() {
    let mut line = board([1, 0, 0, 0]);
    line.start(path("G21 G90\nG0 X5\nM66 P0 L3 Q600\nG0 X7\nM2\n"), 0);
    line.until("it waits", |line| line.state().reason.starts_with("INPUT"));
    line.ask(Command::FeedHold).expect("a hold is taken");
    line.until("it is held", |line| line.mode() == Mode::Hold);
    line.inject("input:0=1");
    line.wait(2.0);
    assert_eq!(line.axes()[0], START[0] + 5.0, "nothing goes on in a hold");
    line.ask(Command::Resume).expect("it is resumed");
    assert_eq!(line.result().outcome, RunOutcome::Succeeded, "{:#?}", line.log);
    line.inject("input:0=0");
    line.start(path("G21 G90\nM66 P0 L3 Q600\nG0 X9\nM2\n"), 0);
    line.until("it waits", |line| line.state().reason.starts_with("INPUT"));
    line.begin(Command::CancelRun { run: None });
    assert_eq!(line.result().outcome, RunOutcome::Canceled, "{:#?}", line.log);
    assert_eq!(line.axes()[0], START[0] + 7.0);
}

#[test]
fn a_program_goes_on_by_what_an_input_says() {
    // A part is put in a moment later; the second look finds it.
    let program = "G21 G90 G94
o1 do
M66 P0 L3 Q2
G0 X[2 + #5399]
o1 while [#5399 EQ -1]
M66 E0 L0
G0 X[#5399 / 10]
M2
";
    let mut line = board([1, 0, 1, 0]);
    line.inject("input:E0=125");
    line.start(path(program), 0);
    line.until("it has waited in vain", |line| !line.probes.is_empty());
    line.inject("input:0=1");
    let (result, waited) = to_the_end(&mut line, program);
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?} {:#?}", line.log);
    assert_eq!(waited, [4, 4, 7]);
    assert!((line.axes()[0] - START[0] - 12.5).abs() < 0.01, "{:?}", line.axes());
    assert!(!has_said(&line, "PATH_DEVIATION"), "{:#?}", line.log);
}

#[test]
fn a_program_for_ports_that_the_board_has_not_does_not_begin() {
    for (firmware, ports, program, expected) in [
        (Firmware::GrblHal, [0; 4], "M64 P0", "line 2: M64 P0 needs digital output 0, and"),
        (Firmware::GrblHal, [4, 2, 4, 4], "M62 P2\nG0 X1", "line 2: M62 P2 needs digital output 2"),
        (Firmware::GrblHal, [1, 1, 0, 1], "M66 E0", "line 2: M66 E0 needs analog input 0, and"),
        (Firmware::Grbl, [4; 4], "M66 P0 L3 Q1", "line 2: M66 L3 P0 Q1 needs digital input 0"),
        (Firmware::FluidNc, [4; 4], "M68 E0 Q1", "line 2: M68 E0 Q1 needs analog output 0"),
        (Firmware::GrblHal, [4; 4], "G0 X1\nM62 P0\nM5", "line 3: M62 P0 switches when the next"),
    ] {
        let settings = Settings::small_router_of(firmware);
        let build = Build { ports, start_in_machine: Some(START), ..Build::new(settings) };
        let mut line = Line::connected(build);
        line.zero_here();
        let then = line.now;
        let request = RunRequest {
            program_id: "part".into(),
            revision: 1,
            path: Arc::new(path(&format!("G21 G90\n{program}\nM2\n"))),
            start_line: 0,
            occurrence: 0,
            in_span: StartInSpan::default(),
            check_only: false,
            tool_diameters_mm: Default::default(),
        };
        let refusal = line.ask(Command::RunProgram(request)).expect_err("a refusal").to_string();
        assert!(refusal.starts_with(expected), "{firmware}: {refusal}");
        assert!(!line.said_since(then).contains('G'), "{program}: something was sent");
    }
}

#[test]
fn a_start_in_the_middle_switches_the_outputs_as_they_would_be_there() {
    let mut line = board([1, 3, 0, 1]);
    let program = "G21 G90 G94
M64 P0
M64 P1
M66 P0 L0
M67 E0 Q3
G1 X5 F600
M65 P0
M62 P2
G1 X10
G1 X15
M2
";
    let whole = path(program);
    let (mut encoder, _) = start_at(
        Arc::new(whole.clone()),
        EncoderConfig {
            board: axis_driver::encoder::Board { ports: [1, 3, 0, 1].into(), ..Default::default() },
            ..EncoderConfig::default()
        },
        (10, 0),
        StartInSpan::Refused,
    )
    .expect("it may begin there");
    let first: Vec<String> = std::iter::from_fn(|| encoder.next_step())
        .take(9)
        .filter_map(|step| Some(step.expect("a line").line()?.text.clone()))
        .collect();
    let switches: Vec<&str> =
        first.iter().map(String::as_str).filter(|it| it.starts_with("M6")).collect();
    assert_eq!(switches, ["M65P0", "M64P1", "M64P2", "M68E0Q3"], "{first:?}");
    line.run(path("G21 G90\nG0 X10\nM2\n"));
    line.start(whole, 10);
    let result = line.result();
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?} {:#?}", line.log);
    let expected = ["P0=0 at 10.000", "P1=1 at 10.000", "P2=1 at 10.000", "E0=3 at 10.000"];
    assert_eq!(switched(&line), expected);
}

#[test]
fn what_is_switched_with_a_motion_may_wait_for_the_plan_and_never_gets_lost() {
    // The motion is in the next stretch.
    let program = "G21 G90\nG0 X1\nM66 P0 L0\nM62 P1\nG0 X[5+#5399]\nM63 P1\nG0 X7\nM2\n";
    let mut line = board([1, 2, 0, 0]);
    line.start(path(program), 0);
    let (result, waited) = to_the_end(&mut line, program);
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?} {:#?}", line.log);
    assert_eq!(waited, [5]);
    assert_eq!(switched(&line), ["P1=1 at 1.000", "P1=0 at 5.000"]);
    // An element that moves nothing is no motion.
    let board = axis_driver::encoder::Board { ports: [0, 1, 0, 0].into(), ..Default::default() };
    let config = EncoderConfig { board, ..EncoderConfig::default() };
    let program = "G21 G90\nG0 X1\nM62 P0\nG10 L20 P1 X0\nM2\n";
    let (mut encoder, _) =
        start_at(Arc::new(path(program)), config, (0, 0), StartInSpan::Refused).expect("a start");
    let refused = std::iter::from_fn(|| encoder.next_step()).find_map(Result::err);
    let refused = refused.expect("a refusal").to_string();
    assert!(refused.starts_with("line 3: M62 P0 switches when the next motion"), "{refused}");
}

#[test]
fn in_single_blocks_an_output_is_switched_in_the_block_of_its_motion() {
    let mut line = board([0, 1, 0, 0]);
    line.ask(Command::SetSingleBlock(true)).expect("it is set");
    line.start(path("G21 G90\nG0 X1\nM62 P0\nG0 X2\nM2\n"), 0);
    line.until("the first block has ended", |line| line.mode() == Mode::Hold);
    assert_eq!((line.axes()[0], switched(&line).len()), (START[0] + 1.0, 0));
    line.ask(Command::Resume).expect("it is resumed");
    line.until("the next block has ended", |line| {
        line.mode() == Mode::Hold && line.axes()[0] > START[0] + 1.99
    });
    assert_eq!(switched(&line), ["P0=1 at 1.000"]);
}

#[test]
fn a_check_in_the_controller_switches_nothing() {
    let settings = Settings::small_router_of(Firmware::GrblHal);
    let build =
        Build { ports: [1, 1, 0, 0], start_in_machine: Some(START), ..Build::new(settings) };
    let config = DriverConfig { check_in_controller: true, ..DriverConfig::default() };
    let mut line = Line::new(config, build, &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.zero_here();
    line.ask(Command::RunProgram(RunRequest {
        program_id: "part".into(),
        revision: 1,
        path: Arc::new(path("G21 G90\nG0 X1\nM64 P0\nG0 X2\nM2\n")),
        start_line: 0,
        occurrence: 0,
        in_span: StartInSpan::default(),
        check_only: true,
        tool_diameters_mm: Default::default(),
    }))
    .expect("it is checked");
    assert_eq!(line.result().outcome, RunOutcome::Succeeded, "{:#?}", line.log);
    assert!(switched(&line).is_empty());
}

#[test]
fn what_an_input_has_said_is_asked_for_again_if_it_was_lost() {
    let mut line = board([1, 0, 0, 0]);
    line.inject("input:0=1");
    line.inject("mute:|In:");
    let then = line.now;
    let result = line.run(path("G21 G90\nM66 P0 L3 Q1\nG0 X2\nM2\n"));
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?} {:#?}", line.log);
    assert!(has_said(&line, "line 2: M66L3P0Q1 has read 1"), "{:#?}", line.log);
    let asked = line.written.iter().filter(|(at, bytes)| *at >= then && bytes.contains(&0x87));
    assert_eq!(asked.count(), 1);
}
