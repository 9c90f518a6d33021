//! Goldens of what is written, and a reader of its own that gets the geometry back.

use super::*;
use cnc_msgs::contour::{Action, CoolantMode};
use cnc_msgs::path::PathEvent;
use proptest::prelude::*;
use std::f64::consts::TAU;

fn source(line: u32) -> Source {
    Source { line, ..Source::default() }
}

fn element(shape: Shape, end: Position, feed: Option<f64>, line: u32) -> PathElement {
    PathElement {
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

fn steps_with(path: CompensatedPath, config: EncoderConfig) -> Result<Vec<Step>, EncodeError> {
    let mut encoder = Encoder::new(sync::Arc::new(path), config);
    std::iter::from_fn(|| encoder.next_step()).collect()
}

fn encode(path: CompensatedPath) -> Vec<String> {
    let steps = steps_with(path, EncoderConfig::default()).expect("a path that can be encoded");
    steps.iter().map(text_of).collect()
}

fn text_of(step: &Step) -> String {
    match step {
        Step::Line(line) => line.text.clone(),
        Step::ToolChange { tool, .. } => format!("(T{tool})"),
    }
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
fn arcs_give_the_centre_from_their_start_in_every_plane() {
    let feed = Some(300.0);
    let lines = encode(path(
        [10.0, 0.0, 0.0],
        vec![
            element(arc([0.0, 0.0, 0.0], Plane::Xy, false, 0), [0.0, 10.0, 0.0], feed, 1),
            element(arc([0.0, 20.0, 0.0], Plane::Xy, true, 0), [-10.0, 20.0, 2.0], feed, 2),
            element(arc([0.0, 20.0, 2.0], Plane::Zx, true, 0), [0.0, 20.0, -8.0], feed, 3),
            element(arc([0.0, 30.0, -8.0], Plane::Yz, false, 0), [0.0, 30.0, -18.0], feed, 4),
            element(Shape::Line, [5.0, 30.0, -18.0], feed, 5),
            element(arc([5.0, 35.0, -18.0], Plane::Xy, false, 0), [5.0, 40.0, -18.0], feed, 6),
        ],
    ));
    assert_eq!(
        lines,
        [
            "G3X0Y10I-10F300",
            "G2X-10Y20Z2J10",
            "G18X0Z-8I10",
            "G19G3Y30Z-18J10",
            "G1X5",
            "G17G3Y40J5",
        ]
    );
}

#[test]
fn a_full_circle_has_equal_ends_and_a_word_of_its_plane() {
    let circle = |turns| {
        let shape = arc([0.0, 0.0, 0.0], Plane::Xy, true, turns);
        element(shape, [10.0, 0.0, 0.0], Some(300.0), 1)
    };
    assert_eq!(encode(path([10.0, 0.0, 0.0], vec![circle(1)])), ["G2X10Y0I-10F300"]);
    let three = encode(path([10.0, 0.0, 0.0], vec![circle(3)]));
    assert_eq!(three, ["G2X10Y0I-10F300", "X10Y0I-10", "X10Y0I-10"]);
}

#[test]
fn a_helix_of_several_turns_goes_down_turn_by_turn() {
    let shape = arc([0.0, 0.0, 0.0], Plane::Xy, false, 2);
    let helix = element(shape, [0.0, 10.0, -9.0], Some(300.0), 1);
    assert_eq!(
        encode(path([10.0, 0.0, 0.0], vec![helix])),
        ["G3X10Y0Z-4I-10F300", "X10Y0Z-8I-10", "X0Y10Z-9I-10"]
    );
}

#[test]
fn an_arc_that_is_almost_a_circle_goes_in_two_halves() {
    let shape = arc([0.0, 0.0, 0.0], Plane::Xy, false, 0);
    let end = [10.0, -0.001, 0.0];
    let lines = encode(path([10.0, 0.0, 0.0], vec![element(shape, end, Some(300.0), 1)]));
    assert_eq!(lines, ["G3X-10Y.0005I-10F300", "X10Y-.001I10J-.0005"]);
}

#[test]
fn an_arc_that_is_almost_nothing_is_a_line_and_never_a_circle() {
    let shape = arc([0.0, 0.0, 0.0], Plane::Xy, false, 0);
    let end = [10.0, 0.001, 0.0];
    let lines = encode(path([10.0, 0.0, 0.0], vec![element(shape, end, Some(300.0), 1)]));
    assert_eq!(lines, ["G1Y.001F300"]);
    // Below the grid it is nothing at all.
    let end = [10.0, 0.00001, 0.0];
    let lines = encode(path([10.0, 0.0, 0.0], vec![element(shape, end, Some(300.0), 1)]));
    assert!(lines.is_empty(), "{lines:?}");
}

#[test]
fn an_arc_whose_radii_differ_too_much_goes_as_lines() {
    let shape = arc([0.0, 0.0, 0.0], Plane::Xy, false, 0);
    let fits = element(shape, [0.0, 10.0035, 0.0], Some(300.0), 1);
    assert_eq!(encode(path([10.0, 0.0, 0.0], vec![fits])).len(), 1);
    let ragged = element(shape, [0.0, 10.012, 0.0], Some(300.0), 1);
    let lines = encode(path([10.0, 0.0, 0.0], vec![ragged]));
    assert!(lines.len() > 20 && lines[0].starts_with("G1X"), "{lines:?}");
    assert_eq!(lines.last().unwrap(), "X0Y10.012");
}

#[test]
fn arcs_too_small_or_too_large_for_the_firmwares_floats_go_as_lines() {
    let tiny = arc([0.005, 0.0, 0.0], Plane::Xy, false, 0);
    let lines = encode(path([0.0; 3], vec![element(tiny, [0.01, 0.0, 0.0], Some(9.0), 1)]));
    assert!(lines.iter().all(|line| !line.contains('I')), "{lines:?}");
    let huge = arc([0.0, 6000.0, 0.0], Plane::Xy, false, 0);
    let end = [6000.0 * 0.01_f64.sin(), 6000.0 - 6000.0 * 0.01_f64.cos(), 0.0];
    let lines = encode(path([0.0; 3], vec![element(huge, end, Some(9.0), 1)]));
    assert!(lines.len() > 5 && lines.iter().all(|line| !line.contains('J')), "{lines:?}");
}

#[test]
fn actions_are_the_words_of_grbl() {
    let length = |offset, length_mm| Action::ToolLength { offset, length_mm };
    let machine_move = |rapid| Action::MachineMove {
        target: [0.0, 1.0, -2.5],
        axes: AxisSet::from_bits(0b100),
        rapid,
        feed_mm_per_min: 120.0,
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
fn lines_that_read_the_eeprom_go_alone() {
    let path = actions(&[
        Action::WorkOffset { system: 2 },
        Action::Reference { axes: AxisSet::ALL, second: false },
        Action::Dwell { seconds: 1.0 },
    ]);
    let steps = steps_with(path, EncoderConfig::default()).unwrap();
    let alone: Vec<bool> =
        steps.iter().map(|step| matches!(step, Step::Line(line) if line.is_alone)).collect();
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
        (Action::Auxiliary { letter: 'M', number: 62.0 }, "line 7: this controller has no M62"),
        (
            Action::Coolant(CoolantMode::Mist),
            "line 7: this controller has no mist coolant (M7): its firmware is built without",
        ),
        (
            Action::SpindleSpeed { rpm: -1.0 },
            "line 7: the spindle speed -1 rpm is not within 0 and 200000 rpm",
        ),
        (
            Action::Dwell { seconds: f64::NAN },
            "line 7: the dwell of NaN s is not within 0 and 86400 s",
        ),
        (
            Action::WorkOffset { system: 7 },
            "line 7: work system 7 does not exist: 1 to 6 are G54 to G59",
        ),
        (
            Action::ToolLength { offset: Some(1), length_mm: 1e6 },
            "line 7: Z1000000 is not within 10000 either side of zero, the most that is sent",
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
        "line 12: XNaN is not within 10000 either side of zero, the most that is sent"
    );
    assert_eq!(
        problem(line([1.0, 0.0, 0.0], Some(0.0))),
        "line 12: the feed rate 0 mm/min is not above 0.0001 and within 60000 mm/min"
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
        "line 12: the line \"G0X-123.4567Y-123.4567\" has 22 bytes, the controller takes 10"
    );
}

#[test]
fn an_arc_from_where_the_program_does_not_know_is_refused() {
    let shape = arc([0.0, 5.0, 0.0], Plane::Xy, true, 0);
    let mut both = element(Shape::Line, [0.0, 0.0, 0.0], Some(100.0), 8);
    both.axes = AxisSet::from_bits(0b011);
    let turn = element(shape, [0.0, 10.0, 0.0], Some(100.0), 9);
    let mut unknown = actions(&[Action::WorkOffset { system: 2 }]);
    unknown.elements = vec![turn];
    assert_eq!(
        problem(unknown.clone()),
        "line 9: an arc starts where XY has not been given since G55: move XY there first"
    );
    unknown.elements = vec![both, turn];
    assert_eq!(encode(unknown), ["G55", "G1X0Y0F100", "G2Y10J5"]);
}

#[test]
fn nothing_follows_the_end_of_the_program() {
    let mut path = actions(&[Action::ProgramEnd { rewind: false }]);
    path.elements = vec![element(Shape::Line, [1.0, 0.0, 0.0], None, 9)];
    assert_eq!(problem(path), "line 9: motion stands after the end of the program in line 7");
}

#[test]
fn a_run_does_not_begin_under_compensation() {
    let with_role = |line: u32, role| PathElement {
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
    let at = |line| start_at(path.clone(), EncoderConfig::default(), line).map(|(_, index)| index);
    assert_eq!(at(2), Ok(1));
    assert_eq!(at(5), Ok(4));
    assert_eq!(at(3), Err(StartProblem::UnderCompensation { line: 3, before: 2 }));
    assert_eq!(at(6), Err(StartProblem::PastEnd { line: 6, last: 5 }));
}

#[test]
fn a_start_in_the_middle_repeats_what_is_in_force_and_no_more() {
    let events = [
        (0, Action::ChangeTool { tool: 1 }),
        (0, Action::ToolLength { offset: Some(1), length_mm: 50.0 }),
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
        start_at(sync::Arc::new(path), EncoderConfig::default(), 29).unwrap();
    assert_eq!(index, 2);
    let steps: Vec<String> =
        std::iter::from_fn(|| encoder.next_step()).map(|step| text_of(&step.unwrap())).collect();
    assert_eq!(steps, ["M5", "(T1)", "G43.1Z50", "S200", "M3", "G4P2", "G1X3F9"]);
}

/// Reads lines back as grbl would: points along what they draw.
#[derive(Default)]
struct Reader {
    position: Position,
    motion: u32,
    plane: usize,
    feed: f64,
}

impl Reader {
    /// The points of one line, its start not included, and the mismatch of an arc's radii.
    fn read(&mut self, line: &str) -> (Vec<Position>, f64) {
        let mut end = self.position;
        let mut offset = [0.0; 3];
        for word in words(line) {
            match word {
                ('G', value) if value < 4.0 => self.motion = value as u32,
                ('G', value) => self.plane = value as usize - 17,
                ('X', value) => end[0] = value,
                ('Y', value) => end[1] = value,
                ('Z', value) => end[2] = value,
                ('I', value) => offset[0] = value,
                ('J', value) => offset[1] = value,
                ('K', value) => offset[2] = value,
                ('F', value) => self.feed = value,
                other => panic!("{other:?} in {line}"),
            }
        }
        let start = std::mem::replace(&mut self.position, end);
        if self.motion < 2 {
            return (vec![end], 0.0);
        }
        let [a, b, normal] = [[0, 1, 2], [2, 0, 1], [1, 2, 0]][self.plane];
        let center = [start[a] + offset[a], start[b] + offset[b]];
        let radius = offset[a].hypot(offset[b]);
        let end_radius = (end[a] - center[0]).hypot(end[b] - center[1]);
        let from = (start[b] - center[1]).atan2(start[a] - center[0]);
        let to = (end[b] - center[1]).atan2(end[a] - center[0]);
        let mut sweep = to - from;
        // As the firmware decides between an arc and a full circle.
        if self.motion == 2 && sweep >= -5e-7 {
            sweep -= TAU;
        } else if self.motion == 3 && sweep <= 5e-7 {
            sweep += TAU;
        }
        let mut points = Vec::new();
        for step in 1..=64 {
            let part = f64::from(step) / 64.0;
            let mut point = start;
            let angle = from + sweep * part;
            point[a] = center[0] + radius * angle.cos();
            point[b] = center[1] + radius * angle.sin();
            point[normal] = start[normal] + (end[normal] - start[normal]) * part;
            points.push(point);
        }
        (points, (radius - end_radius).abs())
    }
}

fn words(line: &str) -> Vec<(char, f64)> {
    let starts: Vec<usize> = line
        .char_indices()
        .filter(|(_, character)| character.is_ascii_uppercase())
        .map(|(index, _)| index)
        .collect();
    let ends = starts.iter().copied().skip(1).chain([line.len()]);
    starts
        .iter()
        .zip(ends)
        .map(|(&start, end)| {
            let value = line[start + 1..end].parse().expect("a number");
            (line[start..].chars().next().unwrap(), value)
        })
        .collect()
}

/// How far a point is from an element.
fn distance(point: Position, shape: &Shape, start: Position, end: Position) -> f64 {
    match shape {
        Shape::Line => {
            let along = [0, 1, 2].map(|axis| end[axis] - start[axis]);
            let squared: f64 = along.iter().map(|value| value * value).sum();
            let to = [0, 1, 2].map(|axis| point[axis] - start[axis]);
            let dot: f64 = (0..3).map(|axis| to[axis] * along[axis]).sum();
            let part = if squared > 0.0 { (dot / squared).clamp(0.0, 1.0) } else { 0.0 };
            (0..3).map(|axis| (to[axis] - along[axis] * part).powi(2)).sum::<f64>().sqrt()
        }
        Shape::Arc(arc) => {
            let [a, b, _] = arc.plane.axes();
            let radius = |p: Position| (p[a] - arc.center[a]).hypot(p[b] - arc.center[b]);
            let (least, most) = (radius(start).min(radius(end)), radius(start).max(radius(end)));
            (least - radius(point)).max(radius(point) - most).max(0.0)
        }
    }
}

#[derive(Debug, Clone)]
enum Move {
    Line(Position),
    /// Plane, radius, start angle, sweep, clockwise, turns, rise.
    Arc(u8, f64, f64, f64, bool, u16, f64),
}

fn any_move() -> impl Strategy<Value = Move> {
    let position = prop::array::uniform3(-500.0..500.0);
    let radius = prop_oneof![0.02..0.2, 0.2..50.0, 50.0..2000.0];
    let sweep = prop_oneof![0.0..0.01, 0.01..6.0, 6.0..TAU];
    prop_oneof![
        position.prop_map(Move::Line),
        (0u8..3, radius, 0.0..TAU, sweep, any::<bool>(), 0u16..3, -5.0..5.0)
            .prop_map(|(p, r, a, s, c, t, z)| Move::Arc(p, r, a, s, c, t, z)),
    ]
}

fn build(moves: &[Move]) -> CompensatedPath {
    let mut at = [0.0; 3];
    let mut built = path(at, Vec::new());
    for (index, one) in moves.iter().enumerate() {
        let (shape, end) = match *one {
            Move::Line(end) => (Shape::Line, end),
            Move::Arc(plane, radius, angle, sweep, clockwise, turns, rise) => {
                let plane = [Plane::Xy, Plane::Zx, Plane::Yz][usize::from(plane)];
                let [a, b, normal] = plane.axes();
                let mut center = at;
                center[a] -= radius * angle.cos();
                center[b] -= radius * angle.sin();
                let last = if clockwise { angle - sweep } else { angle + sweep };
                let mut end = center;
                end[a] += radius * last.cos();
                end[b] += radius * last.sin();
                end[normal] = at[normal] + rise;
                (arc(center, plane, clockwise, turns), end)
            }
        };
        let feed = Some(100.0 + f64::from(index as u32 % 3));
        built.elements.push(element(shape, end, feed, index as u32 + 1));
        at = end;
    }
    built
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn what_is_written_reads_back_as_the_path(moves in prop::collection::vec(any_move(), 1..12)) {
        let path = build(&moves);
        let config = EncoderConfig { position_mm_max: 1e5, ..EncoderConfig::default() };
        let steps = match steps_with(path.clone(), config) {
            Ok(steps) => steps,
            // Ends that coincide without a whole turn contradict themselves.
            Err(EncodeError { problem: EncodeProblem::Arc { .. }, .. }) => return Ok(()),
            Err(other) => return Err(TestCaseError::fail(other.to_string())),
        };
        let mut reader = Reader::default();
        let mut drawn = vec![0.0; path.elements.len()];
        for step in steps {
            let Step::Line(line) = step else { panic!() };
            prop_assert!(line.text.len() <= 79);
            prop_assert!(line.text.bytes().all(|b| b.is_ascii_graphic() && !b"!?~".contains(&b)));
            let index = line.element.unwrap();
            let start = path.start_of(index);
            let one = &path.elements[index];
            prop_assert_eq!(line.source_line, one.source.line);
            let mut from = reader.position;
            let (points, mismatch) = reader.read(&line.text);
            prop_assert!(mismatch <= 0.005, "{} mismatches by {mismatch}", line.text);
            prop_assert_eq!(Some(reader.feed), one.feed_mm_per_min);
            for point in points {
                let off = distance(point, &one.shape, start, one.end);
                // Lines in place of an arc: both ends are on it, their middle within 1e-3.
                prop_assert!(off <= 3e-4, "{} is off by {off}", line.text);
                drawn[index] +=
                    (0..3).map(|a| (point[a] - from[a]).powi(2)).sum::<f64>().sqrt();
                from = point;
            }
            for axis in 0..3 {
                let is_last = (one.end[axis] - reader.position[axis]).abs() <= 1e-4;
                let is_between = matches!(one.shape, Shape::Arc(_));
                prop_assert!(is_last || is_between, "{} ends elsewhere", line.text);
            }
        }
        for (index, drawn) in drawn.iter().enumerate() {
            let start = path.start_of(index);
            let wanted =
                crate::estimate::length_mm(&path.elements[index].shape, start, path.elements[index].end);
            // No circle too many or too few. 64 chords are 0.04 % short of an arc.
            prop_assert!((drawn - wanted).abs() <= 1e-3 + wanted * 2e-3, "{drawn} of {wanted}");
        }
        let end = path.elements.last().unwrap().end;
        for axis in 0..3 {
            prop_assert!((reader.position[axis] - end[axis]).abs() <= 1.01e-4);
        }
    }

    #[test]
    fn no_numbers_whatever_are_a_panic(
        numbers in prop::array::uniform9(any::<f64>()),
        turns in any::<u16>(),
        clockwise in any::<bool>(),
    ) {
        let [a, b, c, d, e, f, g, h, feed] = numbers;
        let shape = arc([g, h, a], Plane::Xy, clockwise, turns % 8);
        let arc = path([a, b, c], vec![element(shape, [d, e, f], Some(feed), 1)]);
        let _ = steps_with(arc, EncoderConfig::default());
        let shape = Shape::Line;
        let line = path([a, b, c], vec![element(shape, [d, e, f], Some(feed), 1)]);
        let _ = steps_with(line, EncoderConfig::default());
    }
}
