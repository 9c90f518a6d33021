//! Keep-out boxes where the path alone does not say where the tool is, or which.

use super::*;

/// One box, named `clamp`.
fn boxed(frame: Frame, min_mm: [f64; 3], max_mm: [f64; 3]) -> DriverConfig {
    let it = KeepOutBox { frame, min_mm, max_mm };
    let keep_out = KeepOut { keep_out: [("clamp".to_owned(), it)].into() };
    DriverConfig { keep_out, ..DriverConfig::default() }
}

/// From line 1 on: homes, and then goes to these places in X alone.
fn after_homing(ends: &[f64]) -> CompensatedPath {
    let ends: Vec<_> = ends.iter().map(|x| [*x, 0.0, 0.0]).collect();
    let mut path = path(&ends);
    path.elements.iter_mut().for_each(|it| it.axes = AxisSet::NONE.with(0));
    let source = Source { line: 1, ..Source::default() };
    path.events.push(PathEvent {
        at_element: 0,
        action: Action::Home { axes: AxisSet::ALL },
        source,
    });
    path
}

#[test]
fn where_homing_leaves_the_tool_is_known_before_the_run_or_looked_at_after_it() {
    // Homing ends near X0 Y0 Z0 of the machine: the way along X goes past the box, or over it.
    let at = |top: f64| boxed(Frame::Machine, [-200.0, -50.0, -90.0], [-150.0, 0.0, top]);
    for firmware in Firmware::ALL {
        let mut line = homed(firmware, at(-10.0));
        assert_eq!(line.run(after_homing(&[200.0])).outcome, RunOutcome::Succeeded, "{firmware}");
        assert!(!line.log.iter().any(|text| text.contains("clamp")), "{:?}", line.log);
        let mut line = homed(firmware, at(0.0));
        let then = line.now;
        let answer = line.ask(Command::RunProgram(request(after_homing(&[200.0]))));
        let message = match (firmware, answer) {
            // It does not report where homing ends: the run homes, and does not begin to cut.
            (Firmware::FluidNc, answer) => {
                answer.expect("it may fit");
                let result = line.result();
                assert_eq!(result.error_code, error_code::KEEP_OUT, "{result:?}");
                assert!(line.said_since(then).contains("$H"));
                result.message
            }
            (_, answer) => {
                let refusal = answer.expect_err("it does not fit");
                assert_eq!(refusal.error_code, error_code::KEEP_OUT, "{refusal}");
                assert!(!line.said_since(then).contains("$H"));
                refusal.message
            }
        };
        assert!(message.contains("touches the keep-out \"clamp\""), "{firmware}: {message}");
        assert!(!line.said_since(then).contains("X200"), "{firmware}");
    }
}

#[test]
fn a_switch_that_was_moved_shows_when_the_axes_are_home() {
    // By its settings homing ends 1 mm off the switch; someone has put 40 mm in between.
    let mut line =
        homed(Firmware::Grbl, boxed(Frame::Machine, [-200.0, -50.0, -90.0], [-150.0, 0.0, -20.0]));
    pendant(&mut line, "$27=30");
    // The driver knows the old pull-off: by that the tool would pass 19 mm above the clamp.
    line.start(after_homing(&[200.0]), 0);
    let result = line.result();
    assert_eq!(result.error_code, error_code::KEEP_OUT, "{result:?}");
    assert!(result.message.contains("Z-30.000 in the machine frame"), "{result:?}");
}

/// Along X past the box, 2 mm from its side.
fn beside() -> CompensatedPath {
    path(&[[10.0, 0.0, 5.0], [200.0, 0.0, 5.0]])
}

fn block(tools: &[(u32, f64)]) -> Command {
    Command::ExecuteMdi {
        path: Arc::new(beside()),
        tool_diameters_mm: tools.iter().copied().collect(),
    }
}

/// Waits for T and its confirmation.
fn changing(line: &mut Line, tool: u32) {
    let mut path = path(&[[200.0, 0.0, 5.0]]);
    let action = Action::ChangeTool { tool };
    path.events.push(PathEvent { at_element: 0, action, source: Source::default() });
    line.finished = None;
    line.ask(Command::RunProgram(request(path))).expect("it begins");
    line.until("the tool change", |line| line.mode() == Mode::ToolChange);
}

#[test]
fn a_block_by_hand_is_compared_with_the_tool_that_was_changed_to_last() {
    let clamp = boxed(Frame::Work(1), [100.0, 2.0, -20.0], [120.0, 20.0, 15.0]);
    let mut line = homed(Firmware::GrblHal, clamp);
    line.finished = None;
    assert_eq!(line.run(path(&[[10.0, 0.0, 5.0]])).outcome, RunOutcome::Succeeded);
    let tools = [(1, 6.0), (2, 0.2), (9, 50.0)];
    let refused = |line: &mut Line, tools: &[(u32, f64)], words: &str| {
        let (then, stands) = (line.now, line.axes());
        let refusal = line.ask(block(tools)).expect_err("it is refused");
        assert_eq!(refusal.error_code, error_code::KEEP_OUT, "{refusal}");
        assert!(refusal.message.contains(words), "{refusal}");
        line.wait(0.5);
        assert_eq!(line.said_since(then).replace("$#\n", ""), "");
        assert_eq!(line.axes(), stands);
    };
    // Nobody has said which one is in: the largest has to pass.
    refused(&mut line, &tools, "which tool is in the spindle is not known: T9 (radius 25.000 mm)");
    // If all of them pass it runs.
    let passes = |line: &mut Line, tools: &[(u32, f64)], said: &str| {
        line.finished = None;
        line.ask(block(tools)).expect("it passes");
        let result = line.result();
        assert_eq!((result.outcome, result.message.as_str()), (RunOutcome::Succeeded, said));
    };
    passes(&mut line, &[(1, 3.9), (2, 0.2)], "done");
    // Without a table the answer says what was compared.
    let axis = "done; not checked: the diameter of the tool in the spindle at keep-outs: it is not \
                in the tool table, so that only its axis was compared";
    passes(&mut line, &[], axis);
    changing(&mut line, 1);
    line.ask(Command::ConfirmToolChange { objection: None }).expect("it is in");
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    refused(&mut line, &tools, "T1 (radius 3.000 mm) touches the keep-out \"clamp\"");
    // With its wear it is smaller.
    passes(&mut line, &[(1, 3.9), (2, 0.2), (9, 50.0)], "done");
    changing(&mut line, 2);
    // What is in while it is changed, nobody knows.
    line.ask(Command::CancelRun { run: None }).expect("it ends");
    line.until("the run ends", |line| line.finished.is_some() && line.mode() == Mode::Idle);
    refused(&mut line, &tools, "which tool is in the spindle is not known");
    changing(&mut line, 2);
    line.ask(Command::ConfirmToolChange { objection: None }).expect("it is in");
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    passes(&mut line, &tools, "done");
    // A start after a change asks for that tool.
    let mut twice = path(&[[200.0, 0.0, 5.0], [200.0, 0.0, 5.0], [201.0, 0.0, 5.0]]);
    let action = Action::ChangeTool { tool: 1 };
    twice.events.push(PathEvent { at_element: 1, action, source: Source::default() });
    line.finished = None;
    line.ask(Command::RunProgram(RunRequest { start_line: 3, ..request(twice) }))
        .expect("it begins");
    line.until("the tool change", |line| line.mode() == Mode::ToolChange);
    line.ask(Command::ConfirmToolChange { objection: None }).expect("it is in");
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    refused(&mut line, &tools, "T1 (radius 3.000 mm) touches the keep-out \"clamp\"");
    changing(&mut line, 2);
    line.ask(Command::ConfirmToolChange { objection: None }).expect("it is in");
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    // A tool that is not in the table.
    let axis = axis.replace("the tool in the spindle at", "T2 at");
    passes(&mut line, &[(1, 6.0)], &axis);
}
