//! Runs that begin after A to W have moved.

use super::*;

/// What is sent of a program from a line on; `height`: the tool comes from above.
fn started_at(
    events: &[(usize, u32, Action)],
    (line, height): (u32, Option<f64>),
) -> Result<Vec<String>, String> {
    let ends = [[10.0, 0.0, 0.0], [20.0, 0.0, -1.0], [30.0, 0.0, -1.0]];
    let elements = ends.iter().zip([10, 20, 30]).map(|(end, line)| PathElement {
        axes: AxisSet::ALL,
        role: Role::None,
        side: None,
        ..element(Shape::Line, *end, Some(200.0), line)
    });
    let mut path = path([0.0; 3], elements.collect());
    let event =
        |&(at_element, line, action)| PathEvent { at_element, action, source: source(line) };
    path.events = events.iter().map(event).collect();
    let board = Board { further_axes: 0b1011, ..Board::default() };
    let config = EncoderConfig { board, approach_z_mm: height, ..EncoderConfig::default() };
    let started = start_at(sync::Arc::new(path), config, (line, 0), StartInSpan::Refused);
    let (mut encoder, _) = started.map_err(|problem| problem.to_string())?;
    let at = encoder.start_further();
    let steps = std::iter::from_fn(|| encoder.next_step()).map(|step| text_of(&step.unwrap()));
    let mut steps: Vec<String> = steps.collect();
    if !at.at.is_empty() && !at.is_sent {
        steps.insert(0, format!("at{}", at.at.words()));
    }
    Ok(steps)
}

#[test]
fn a_start_in_the_middle_turns_further_axes_at_the_safe_height_or_needs_them_there() {
    let rapid = |axes: &[(usize, f64)]| further(FurtherMode::Rapid, axes);
    let along = |axes: &[(usize, f64)]| further(FurtherMode::Along, axes);
    let to = |z| Action::MachineMove {
        target: [0.0, 0.0, z],
        axes: AxisSet::NONE.with(2),
        rapid: true,
        feed_mm_per_min: 0.0,
    };
    let zero = Action::SetWorkOffset {
        system: 1,
        axes: AxisSet::NONE.with(0),
        origin: [5.0, 0.0, 0.0],
        by_position: false,
    };
    let turned = [(0, 5, rapid(&[(0, 30.0), (3, 2.0)])), (1, 20, along(&[(0, 90.0)]))];
    let above = Some(-2.0);
    let down = ["G0X20Y0", "G1Z-1F200", "(start)", "X30Y0Z-1"];
    for (events, start, expected) in [
        // At the height, before anything else moves; the angle is that before the line.
        (
            &turned[..],
            (30, above),
            Ok(&["G53G0Z-2", "G0A90U2", down[0], down[1], down[2], down[3]][..]),
        ),
        (
            &turned,
            (20, above),
            Ok(&[
                "G53G0Z-2",
                "G0A30U2",
                "G0X10Y0",
                "G1Z0F200",
                "(start)",
                "X20Y0Z-1A90G93F19.9007",
                "X30Y0Z-1G94F200",
            ]),
        ),
        (&turned, (30, None), Ok(&["at A90 U2", "G1X30Y0Z-1F200"])),
        // A line of its own before the first element is not repeated.
        (&[(2, 25, rapid(&[(0, 45.0)]))], (26, None), Ok(&["at A45", "G1X30Y0Z-1F200"])),
        (&[(2, 25, rapid(&[(0, 45.0)]))], (25, None), Ok(&["G0A45", "G1X30Y0Z-1F200"])),
        // Its words belong to the offset that is stored again.
        (
            &[(0, 5, along(&[(0, 7.0)])), (0, 5, zero), (1, 20, along(&[(0, 1.0)]))],
            (30, None),
            Ok(&["at A1", "G10L2P1X5A7", "(start)", "G1X30Y0Z-1F200"]),
        ),
        (
            &[(0, 5, rapid(&[(0, 30.0)])), (1, 15, Action::WorkOffset { system: 2 })],
            (30, above),
            Err(
                "line 30 begins where A has not been given since G55: begin after a line that gives A",
            ),
        ),
        (
            &[(0, 5, rapid(&[(0, 30.0)])), (1, 15, Action::WorkOffset { system: 2 })],
            (30, None),
            Err("begins where A has not been given since G55"),
        ),
        // The tool stays up: A may come from anywhere to where the line takes it.
        (
            &[(1, 15, along(&[(0, 0.0)])), (1, 15, to(-1.0)), (1, 20, along(&[(0, 5.0)]))],
            (20, above),
            Ok(&["G53G0Z-2", "G0X10Y0", "G1X20Y0Z-1A5G93F19.9007", "X30Y0Z-1G94F200"]),
        ),
        (
            &[(1, 15, along(&[(0, 0.0)])), (1, 15, to(-1.0)), (2, 30, along(&[(0, 5.0)]))],
            (20, above),
            Err("begins where A has not been given since G53"),
        ),
        (&[(0, 5, rapid(&[(2, 30.0)]))], (30, above), Err("no axis C: its axes are X Y Z A B U")),
        (&[(0, 5, rapid(&[(2, 30.0)]))], (30, None), Err("no axis C: its axes are X Y Z A B U")),
        // Named and never turned, on a board without it.
        (&[(0, 5, rapid(&[(2, 0.0)]))], (30, None), Ok(&["G1X30Y0Z-1F200"])),
    ] {
        match (started_at(events, start), expected) {
            (Ok(steps), Ok(expected)) => assert_eq!(steps, expected, "{start:?}"),
            (Err(why), Err(expected)) => assert!(why.contains(expected), "{why}"),
            (steps, _) => panic!("{start:?}: {steps:?} and not {expected:?}"),
        }
    }
}

#[test]
fn a_start_in_a_run_of_lines_that_turn_begins_with_the_line_that_was_asked_for() {
    let turn = |angle| further(FurtherMode::Feed(360.0), &[(0, angle)]);
    let events = [(1, 11, turn(30.0)), (1, 12, turn(60.0)), (1, 13, turn(90.0))];
    for (line, before, turns) in [
        (11, None, &["A30", "A60", "A90"][..]),
        (12, Some("A30"), &["A60", "A90"]),
        (13, Some("A60"), &["A90"]),
        (14, Some("A90"), &[]),
    ] {
        let steps = started_at(&events, (line, Some(-2.0))).expect("a start");
        let start = steps.iter().position(|step| step == "(start)").expect("the place is checked");
        let of_turns = |steps: &[String]| {
            let words = steps.iter().filter_map(|step| step.find('A').map(|at| &step[at..]));
            let end = |word: &str| {
                word[1..].find(|c: char| c.is_ascii_alphabetic()).map_or(word.len(), |at| at + 1)
            };
            words.map(|word| word[..end(word)].to_owned()).collect::<Vec<_>>()
        };
        assert_eq!(
            of_turns(&steps[..start]),
            before.into_iter().collect::<Vec<_>>(),
            "{line}: {steps:?}"
        );
        assert_eq!(of_turns(&steps[start..]), turns, "{line}: {steps:?}");
    }
}
