//! Goldens of what is written.
#![allow(clippy::result_large_err, reason = "errors are compared as they are")]

mod arcs;
mod further_starts;
mod ports;
mod read_back;

use super::*;
use cnc_msgs::contour::{Action, CoolantMode};
use cnc_msgs::further::{FurtherMode, FurtherMove};
use cnc_msgs::geometry::Arc;
use cnc_msgs::path::{NoEntry, PathEvent, StartInSpan};
use cnc_msgs::text::Words;

fn source(line: u32) -> Source {
    Source { line, ..Source::default() }
}

fn element(shape: Shape, end: Position, feed: Option<f64>, line: u32) -> PathElement {
    PathElement {
        side: None,
        shape,
        end,
        feed_mm_per_min: feed,
        role: Role::Contour,
        axes: AxisSet::NONE,
        source: source(line),
    }
}

fn arc(center: Position, plane: Plane, clockwise: bool, turns: u16) -> Shape {
    Shape::Arc(Arc { center, plane, clockwise, turns })
}

fn path(start: Position, elements: Vec<PathElement>) -> CompensatedPath {
    CompensatedPath { start, elements, ..Default::default() }
}

fn steps_with(
    path: CompensatedPath,
    config: EncoderConfig,
) -> Result<Vec<EncoderStep>, EncodeError> {
    let mut encoder = Encoder::new(sync::Arc::new(path), config);
    std::iter::from_fn(|| encoder.next_step()).collect()
}

fn encode(path: CompensatedPath) -> Vec<String> {
    let steps = steps_with(path, EncoderConfig::default()).expect("a path that can be encoded");
    steps.iter().map(text_of).collect()
}

fn text_of(step: &EncoderStep) -> String {
    match step {
        EncoderStep::Line(line) => line.text.clone(),
        EncoderStep::ToolChange { tool, .. } => format!("(T{tool})"),
        EncoderStep::CheckStart => "(start)".into(),
        EncoderStep::Stretch { .. } => "(stretch)".into(),
        EncoderStep::UserFunction { function, .. } => format!("({function})"),
        EncoderStep::ReadInput { line } | EncoderStep::Probe { line, .. } => {
            format!("({})", line.text)
        }
        EncoderStep::ControllerChange { tool, .. } => format!("(T{tool} by the controller)"),
        EncoderStep::CheckReturn { .. } => "(return)".into(),
        EncoderStep::AllowOverrides { allowed, .. } => format!("(allows {allowed})"),
        EncoderStep::Home { text, .. } => format!("({text})"),
    }
}

#[test]
fn each_change_of_what_may_be_overridden_is_a_step() {
    let word = |number: f64, words: &str| {
        let words = Words::new(words).expect("short");
        Action::Auxiliary { letter: 'M', number, words }
    };
    let path = actions(&[
        word(50.0, "P0"),
        word(51.0, "P0"),
        word(50.0, "P0"),
        word(53.0, "P1"),
        word(50.0, "P1"),
    ]);
    let steps = ["(allows spindle)", "(allows none)", "(allows feed and rapid)"];
    assert_eq!(encode(path), steps);
    let refused = problem(actions(&[word(53.0, "P0")]));
    let text = "line 7: M53 P0 is not done: a feed hold has to work at any time; delete the word";
    assert!(refused.starts_with(text), "{refused}");
}

fn problem(path: CompensatedPath) -> String {
    steps_with(path, EncoderConfig::default()).expect_err("a refusal").to_string()
}

fn actions(actions: &[Action]) -> CompensatedPath {
    let event = |action: &Action| PathEvent { at_element: 0, action: *action, source: source(7) };
    CompensatedPath { events: actions.iter().map(event).collect(), ..Default::default() }
}

#[test]
fn words_are_given_once_and_only_for_axes_that_change() {
    let lines = encode(path(
        [0.0, 0.0, 5.0],
        vec![
            element(Shape::Line, [10.0, 0.0, 5.0], None, 1),
            element(Shape::Line, [10.0, 0.0, -1.5], Some(100.0), 2),
            element(Shape::Line, [20.0, 10.0, -1.5], Some(400.0), 3),
            element(Shape::Line, [20.0, 10.00001, -1.5], Some(400.0), 4),
            element(Shape::Line, [20.0, 20.5, -1.5], Some(400.0), 5),
            element(Shape::Line, [20.0, 20.5, 5.0], None, 6),
        ],
    ));
    assert_eq!(lines, ["G0X10", "G1Z-1.5F100", "X20Y10F400", "Y20.5", "G0Z5"]);
}

#[test]
fn axes_that_a_block_names_are_given_whether_they_change_or_not() {
    let mut named = element(Shape::Line, [0.0, 0.0, 0.0], None, 1);
    named.axes = AxisSet::from_bits(0b011);
    assert_eq!(encode(path([0.0; 3], vec![named])), ["G0X0Y0"]);
}

#[test]
fn actions_are_the_words_of_grbl() {
    let length = |offset, length_mm| Action::ToolLength { offset, length_mm, second: None };
    let machine_move = |rapid| Action::MachineMove {
        target: [0.0, 1.0, -2.5],
        axes: AxisSet::from_bits(0b100),
        rapid,
        feed_mm_per_min: 120.0,
    };
    let set_work_offset = |by_position| Action::SetWorkOffset {
        system: 2,
        axes: AxisSet::from_bits(0b101),
        origin: [-1.5, 9.0, 4.0],
        by_position,
    };
    let lines = encode(actions(&[
        Action::SelectTool { tool: 3 },
        Action::ChangeTool { tool: 3 },
        Action::SpindleSpeed { rpm: 12_000.0 },
        Action::Spindle(SpindleMode::Clockwise),
        Action::Spindle(SpindleMode::CounterClockwise),
        Action::Spindle(SpindleMode::Off),
        Action::Coolant(CoolantMode::Flood),
        Action::Coolant(CoolantMode::Off),
        length(Some(3), 60.25),
        length(None, 0.0),
        Action::WorkOffset { system: 6 },
        set_work_offset(false),
        set_work_offset(true),
        Action::StoreReference { second: false },
        Action::StoreReference { second: true },
        Action::Dwell { seconds: 0.5 },
        Action::Stop { optional: false },
        Action::Stop { optional: true },
        Action::Reference { axes: AxisSet::from_bits(0b100), second: false },
        Action::Reference { axes: AxisSet::from_bits(0b011), second: true },
        machine_move(true),
        machine_move(false),
        Action::ProgramEnd { rewind: true },
    ]));
    assert_eq!(
        lines,
        [
            "M5",
            "(T3)",
            "S12000",
            "M3",
            "M4",
            "M5",
            "M8",
            "M9",
            "G43.1Z60.25",
            "G49",
            "G59",
            "G10L2P2X-1.5Z4",
            "G10L20P2X-1.5Z4",
            "G28.1",
            "G30.1",
            "G4P.5",
            "M0",
            "G91G28Z0",
            "G90",
            "G91G30X0Y0",
            "G90",
            "G53G0Z-2.5",
            "G53G1Z-2.5F120",
            "M30",
        ]
    );
}

#[test]
fn a_speed_goes_in_the_line_of_the_next_move_and_alone_only_before_something_else() {
    let line = |x: f64, feed, line| element(Shape::Line, [x, 0.0, 0.0], feed, line);
    let half = arc([1.5, 0.0, 0.0], Plane::Xy, true, 0);
    let mut path = path(
        [0.0; 3],
        vec![
            line(0.1, Some(1500.0), 1),
            line(0.1, Some(1500.0), 2),
            line(1.0, None, 3),
            element(half, [2.0, 0.0, 0.0], Some(900.0), 4),
        ],
    );
    let speed = |rpm| Action::SpindleSpeed { rpm };
    for (at_element, action) in [
        (0, speed(0.0)),
        (0, Action::Spindle(SpindleMode::CounterClockwise)),
        (0, speed(1.0)),
        (0, speed(100.0)),
        // Waits over a move that goes nowhere.
        (1, speed(200.0)),
        (3, speed(300.0)),
        (4, speed(400.0)),
        (4, Action::Dwell { seconds: 1.0 }),
        (4, speed(500.0)),
    ] {
        path.events.push(PathEvent { at_element, action, source: source(9) });
    }
    let steps = |is_laser| {
        let mut config = EncoderConfig::default();
        config.board.is_laser = is_laser;
        steps_with(path.clone(), config).expect("a path that can be encoded")
    };
    let lines: Vec<_> = steps(true).iter().map(text_of).collect();
    assert_eq!(
        lines,
        ["S0", "M4", "S1", "G1X.1F1500S100", "G0X1S200", "G2X2I.5F900S300", "S400", "G4P1", "S500",]
    );
    // Without a laser the firmware waits there until the spindle has its speed.
    let kinds = |is_laser| -> Vec<_> {
        let lines = steps(is_laser).into_iter().filter_map(|step| match step {
            EncoderStep::Line(line) if line.element.is_some() => Some(line.kind),
            _ => None,
        });
        lines.collect()
    };
    assert_eq!(kinds(true), [LineKind::Motion; 3]);
    assert_eq!(kinds(false), [LineKind::Slow; 3]);
}

#[test]
fn lines_that_read_the_eeprom_go_alone() {
    let path = actions(&[
        Action::WorkOffset { system: 2 },
        Action::Reference { axes: AxisSet::ALL, second: false },
        Action::Dwell { seconds: 1.0 },
    ]);
    let steps = steps_with(path, EncoderConfig::default()).unwrap();
    let alone: Vec<bool> =
        steps.iter().map(|step| matches!(step, EncoderStep::Line(line) if line.is_alone)).collect();
    assert_eq!(alone, [true, true, false, false]);
}

#[test]
fn what_the_build_or_the_operator_allows_is_sent() {
    let config = EncoderConfig { has_mist: true, optional_stop: true, ..EncoderConfig::default() };
    let path = actions(&[Action::Coolant(CoolantMode::Mist), Action::Stop { optional: true }]);
    let lines: Vec<_> = steps_with(path, config).unwrap().iter().map(text_of).collect();
    assert_eq!(lines, ["M7", "M0"]);
}

#[test]
fn what_grbl_cannot_do_is_refused_with_its_line() {
    for (action, wanted) in [
        (
            Action::Auxiliary { letter: 'M', number: 62.0, words: Words::EMPTY },
            "line 7: this controller has no M62",
        ),
        (
            Action::Coolant(CoolantMode::Mist),
            "line 7: this controller has no mist coolant (M7): its firmware is built without",
        ),
        (
            Action::SpindleSpeed { rpm: -1.0 },
            "line 7: the spindle speed -1 rpm is not between 0 and 200000 rpm",
        ),
        (
            Action::Dwell { seconds: f64::NAN },
            "line 7: the dwell of NaN s is not between 0 and 86400 s",
        ),
        (
            Action::WorkOffset { system: 7 },
            "line 7: this controller has no G59.1: it reports no offset of it ($#)",
        ),
        (
            Action::SetWorkOffset {
                system: 1,
                axes: AxisSet::ALL,
                origin: [0.0, f64::NAN, 0.0],
                by_position: false,
            },
            "line 7: YNaN is not between -10000 and 10000 mm, the limit of position_mm_max",
        ),
        (
            Action::ToolLength { offset: Some(1), length_mm: 1e6, second: None },
            "line 7: Z1000000 is not between -10000 and 10000 mm, the limit of position_mm_max",
        ),
    ] {
        assert_eq!(problem(actions(&[action])), wanted);
    }
}

#[test]
fn motion_that_cannot_be_is_refused_with_its_line_and_numbers() {
    let line = |end, feed| path([0.0; 3], vec![element(Shape::Line, end, feed, 12)]);
    assert_eq!(
        problem(line([f64::NAN, 0.0, 0.0], None)),
        "line 12: XNaN is not between -10000 and 10000 mm, the limit of position_mm_max"
    );
    assert_eq!(
        problem(line([1.0, 0.0, 0.0], Some(0.0))),
        "line 12: the feed rate 0 mm/min is not between 0.0001 and 60000 mm/min"
    );
    assert!(problem(line([1.0, 0.0, 0.0], Some(f64::INFINITY))).contains("feed rate inf"));
    let shape = arc([0.0, 5.0, 0.0], Plane::Xy, true, 0);
    let rapid_arc = element(shape, [0.0, 10.0, 0.0], None, 3);
    assert!(problem(path([0.0; 3], vec![rapid_arc])).starts_with("line 3: a rapid along an arc"));
    let no_radius = arc([0.0; 3], Plane::Xy, true, 0);
    let no_radius = element(no_radius, [0.0, 10.0, 0.0], Some(1.0), 3);
    assert!(problem(path([0.0; 3], vec![no_radius])).ends_with("cannot be drawn"));
    let config = EncoderConfig { line_bytes_max: 10, ..EncoderConfig::default() };
    let long = line([-123.4567, -123.4567, 0.0], None);
    let refused = steps_with(long, config).unwrap_err().to_string();
    assert_eq!(
        refused,
        "line 12: the line \"G0X-123.4567Y-123.4567\" has 22 bytes; the controller accepts 10"
    );
}

#[test]
fn nothing_follows_the_end_of_the_program() {
    let mut path = actions(&[Action::ProgramEnd { rewind: false }]);
    path.elements = vec![element(Shape::Line, [1.0, 0.0, 0.0], None, 9)];
    assert_eq!(problem(path), "line 9: motion comes after the end of the program in line 7");
}

#[test]
fn m28_a_run_begins_under_compensation_where_its_control_does() {
    let with_role = |line: u32, role| PathElement {
        side: None,
        role,
        ..element(Shape::Line, [f64::from(line), 0.0, 0.0], Some(100.0), line)
    };
    let path = sync::Arc::new(path(
        [0.0; 3],
        vec![
            with_role(1, Role::None),
            with_role(2, Role::LeadOn),
            with_role(3, Role::Contour),
            with_role(4, Role::LeadOff),
            with_role(5, Role::None),
        ],
    ));
    let at = |line, in_span| {
        start_at(path.clone(), EncoderConfig::default(), (line, 0), in_span).map(|(_, index)| index)
    };
    let refused = |line| Err(StartProblem::UnderCompensation { line, before: 2, after: Some(5) });
    for (in_span, third, fourth) in [
        (StartInSpan::Refused, refused(3), refused(4)),
        (StartInSpan::Standing, Ok(2), Ok(3)),
        (StartInSpan::FromAbove, Ok(2), Ok(3)),
    ] {
        assert_eq!(at(2, in_span), Ok(1), "{in_span:?}");
        assert_eq!(at(3, in_span), third, "{in_span:?}");
        assert_eq!(at(4, in_span), fourth, "{in_span:?}");
        assert_eq!(at(5, in_span), Ok(4), "{in_span:?}");
        let past_end = Err(StartProblem::NoEntry(NoEntry::PastEnd { line: 6, last: 5 }));
        assert_eq!(at(6, in_span), past_end, "{in_span:?}");
    }
}

#[test]
fn a_start_in_the_middle_repeats_what_is_in_force_and_no_more() {
    let events = [
        (0, Action::ChangeTool { tool: 1 }),
        (0, Action::ToolLength { offset: Some(1), length_mm: 50.0, second: None }),
        (0, Action::SpindleSpeed { rpm: 100.0 }),
        (0, Action::Spindle(SpindleMode::Clockwise)),
        (0, Action::Coolant(CoolantMode::Flood)),
        (1, Action::Dwell { seconds: 1.0 }),
        (1, Action::SpindleSpeed { rpm: 200.0 }),
        (1, Action::Coolant(CoolantMode::Off)),
        (2, Action::Dwell { seconds: 2.0 }),
    ];
    let lines: Vec<PathElement> = (1u32..=3)
        .map(|line| PathElement {
            side: None,
            role: Role::None,
            ..element(Shape::Line, [f64::from(line), 0.0, 0.0], Some(9.0), line * 10)
        })
        .collect();
    let mut path = path([0.0; 3], lines);
    for (at_element, action) in events {
        let source = source(at_element as u32 * 10 + 9);
        path.events.push(PathEvent { at_element, action, source });
    }
    let (mut encoder, index) =
        start_at(sync::Arc::new(path), EncoderConfig::default(), (29, 0), StartInSpan::Refused)
            .unwrap();
    assert_eq!(index, 2);
    let steps: Vec<String> =
        std::iter::from_fn(|| encoder.next_step()).map(|step| text_of(&step.unwrap())).collect();
    assert_eq!(steps, ["M5", "(T1)", "G43.1Z50", "(start)", "S200", "M3", "G4P2", "G1X3F9"]);
}

#[test]
fn a_thread_keeps_pace_with_a_spindle_that_allows_it() {
    let board =
        Board { thread_mm_per_min_max: Some([Some(500.0), None, Some(900.0)]), ..Board::default() };
    let config = EncoderConfig { board, ..EncoderConfig::default() };
    let threaded = |pitch_mm: f64, feed, at_element, line| {
        let elements = vec![
            element(Shape::Line, [0.0, 0.0, -5.0], Some(200.0), 1),
            element(Shape::Line, [0.0, 0.0, -15.0], feed, 2),
            element(Shape::Line, [1.0, 0.0, -15.0], Some(200.0), 3),
        ];
        let action = Action::SpindleSync { pitch_mm };
        let events = vec![PathEvent { at_element, action, source: source(line) }];
        CompensatedPath { events, ..path([0.0; 3], elements) }
    };
    let lines = |path, config| {
        let steps = steps_with(path, config).map_err(|problem| problem.to_string())?;
        Ok::<_, String>(steps.iter().map(text_of).collect::<Vec<_>>())
    };
    // A thirteenth of an inch: each turn adds what its last digit is off.
    let thirteenth = 25.4 / 13.0;
    for (pitch_mm, feed, word) in [(1.5, 900.0, "K1.5"), (thirteenth, 600.0, "K1.953846")] {
        let sent = lines(threaded(pitch_mm, Some(feed), 1, 2), config).unwrap();
        assert_eq!(sent, ["G1Z-5F200", &format!("G33Z-15{word}"), "G4P0", "G1X1"]);
    }
    let mut across = threaded(1.0, Some(880.0), 1, 2);
    across.elements[1].end = [10.0, 0.0, -6.0];
    let mut unknown = across.clone();
    unknown.elements[1].end = [0.0, 1.0, -6.0];
    // Where X is in G55 nobody knows: it may go all of the way.
    let mut other_frame = threaded(1.0, Some(880.0), 1, 2);
    other_frame.elements[1].axes = AxisSet::NONE.with(0).with(2);
    let action = Action::WorkOffset { system: 2 };
    other_frame.events.insert(0, PathEvent { at_element: 1, action, source: source(1) });
    let mut z_alone = other_frame.clone();
    z_alone.elements[1].axes = AxisSet::NONE.with(2);
    assert!(lines(z_alone, config).is_ok());
    for (path, config, words) in [
        (threaded(1.5, Some(900.0), 1, 2), EncoderConfig::default(), "G33 K1.5 needs a spindle"),
        (threaded(1.5, Some(901.0), 1, 2), config, "line 2: G33 K1.5 feeds 901 mm/min"),
        (
            across,
            config,
            "G33 K1 feeds 876 mm/min at this spindle speed, and this controller takes at most 500 mm/min there (90 % of $110)",
        ),
        (unknown, config, "the controller has not reported $111"),
        (
            other_frame,
            config,
            "feeds 880 mm/min at this spindle speed, and this controller takes at most 500",
        ),
        (threaded(1.5, Some(36.0), 1, 2), config, "program an S above 24"),
        (threaded(1.5, None, 1, 2), config, "G33 K1.5 moves with a motion of its block"),
        (threaded(1.5, Some(9.0), 1, 1), config, "G33 K1.5 moves with a motion of its block"),
        (threaded(1.5, Some(9.0), 3, 3), config, "G33 K1.5 moves with a motion of its block"),
    ] {
        let problem = lines(path, config).unwrap_err();
        assert!(problem.contains(words), "{problem}");
    }
}

fn further(mode: FurtherMode, axes: &[(usize, f64)]) -> Action {
    let axes = axes.iter().fold(FurtherAxes::NONE, |all, (axis, at)| all.with(*axis, *at));
    Action::Further(FurtherMove { axes, mode })
}

#[test]
fn further_axes_have_their_motion_and_a_board_that_has_them() {
    let board = Board { further_axes: 0b1011, ..Board::default() };
    let config = EncoderConfig { board, ..EncoderConfig::default() };
    let lines = |path| {
        let steps = steps_with(path, config).map_err(|problem| problem.to_string())?;
        Ok::<_, String>(steps.iter().map(text_of).collect::<Vec<_>>())
    };
    let turned = |action: Action, at_element, line| {
        let ends = [[10.0, 0.0, 0.0], [20.0, 0.0, 0.0]];
        let lines = ends.iter().zip(1..);
        let elements = lines.map(|(end, line)| element(Shape::Line, *end, Some(200.0), line));
        let mut path = path([0.0; 3], elements.collect());
        path.events = vec![PathEvent { at_element, action, source: source(line) }];
        path
    };
    let along = further(FurtherMode::Along, &[(0, 90.0), (3, -2.5)]);
    assert_eq!(lines(turned(along, 0, 1)).unwrap(), ["G1X10A90U-2.5G93F20", "X20G94F200"]);
    assert_eq!(lines(turned(along, 1, 2)).unwrap(), ["G1X10F200", "X20A90U-2.5G93F20"]);
    for (path, words) in [
        (turned(along, 0, 2), "line 1: A90 U-2.5 moves with a motion of its block"),
        (turned(along, 2, 2), "line 2: A90 U-2.5 moves with a motion of its block"),
        (actions(&[along, Action::ExactStop]), "moves with a motion of its block"),
        (actions(&[along, along]), "moves with a motion of its block"),
        (
            actions(&[further(FurtherMode::Rapid, &[(2, 1.0)])]),
            "no axis C: its axes are X Y Z A B U",
        ),
        (actions(&[further(FurtherMode::Rapid, &[(0, 70_000.0)])]), "A70000 is not between"),
        (actions(&[further(FurtherMode::Rapid, &[(3, 20_000.0)])]), "U20000 is not between"),
        (actions(&[further(FurtherMode::Feed(0.0), &[(0, 1.0)])]), "the feed rate 0"),
        (
            actions(&[further(FurtherMode::Feed(10.0), &[(0, 1.0), (3, 1.0)])]),
            "how fast A1 U1 moves depends on where the axes are",
        ),
    ] {
        let refused = lines(path).expect_err(words);
        assert!(refused.contains(words), "{refused}");
    }
    let alone = [
        further(FurtherMode::Rapid, &[(0, 30.0), (3, 0.0)]),
        further(FurtherMode::Feed(600.0), &[(0, 60.0), (1, 4.0)]),
        further(FurtherMode::Feed(100.0), &[(0, 0.0), (3, 50.0)]),
        further(FurtherMode::Feed(600.0), &[(3, 0.0)]),
    ];
    assert_eq!(
        lines(actions(&alone)).unwrap(),
        ["G0A30U0", "G1A60B4F600", "A0U50G93F2", "U0G94F600"]
    );
    // A post that names an axis and never turns it.
    let idle = actions(&[further(FurtherMode::Rapid, &[(2, 0.0)])]);
    assert_eq!(lines(idle).unwrap(), [""; 0]);
}
