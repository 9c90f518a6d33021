//! Arcs: words, halves of circles, helices, and what goes as lines.

use super::*;

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
fn a_full_circle_goes_in_two_halves_and_more_turns_in_pieces_that_are_no_circles() {
    let circle = |turns| {
        let shape = arc([0.0, 0.0, 0.0], Plane::Xy, true, turns);
        element(shape, [10.0, 0.0, 0.0], Some(300.0), 1)
    };
    assert_eq!(encode(path([10.0, 0.0, 0.0], vec![circle(1)])), ["G2X-10I-10F300", "X10I10"]);
    let three = encode(path([10.0, 0.0, 0.0], vec![circle(3)]));
    assert_eq!(three, ["G2X0Y10I-10F300", "X-10Y0J-10", "X0Y-10I10", "X10Y0J10"]);
}

#[test]
fn a_helix_of_several_turns_goes_down_evenly() {
    let shape = arc([0.0, 0.0, 0.0], Plane::Xy, false, 2);
    let helix = element(shape, [0.0, 10.0, -9.0], Some(300.0), 1);
    assert_eq!(
        encode(path([10.0, 0.0, 0.0], vec![helix])),
        ["G3X0Y-10Z-3I-10F300", "X-10Y0Z-6J10", "X0Y10Z-9I10"]
    );
}

#[test]
fn a_helix_of_thousands_of_turns_is_encoded_a_part_at_a_time() {
    let (turns, depth) = (3_000, 300.0);
    let shape = arc([0.0; 3], Plane::Xy, false, turns);
    let helix = element(shape, [100.0, 0.0, -depth], Some(300.0), 1);
    let mut encoder =
        Encoder::new(path([100.0, 0.0, 0.0], vec![helix]).into(), EncoderConfig::default());
    let mut lines = Vec::new();
    while let Some(step) = encoder.next_step() {
        let waiting = encoder.pending.len();
        assert!(waiting < 200, "{waiting} lines were made at once");
        lines.push(text_of(&step.expect("a helix")));
    }
    // 30 parts of 100 turns, each in pieces of three quarters of a turn.
    assert_eq!(lines.len(), 30 * 134);
    let height = |line: &String| -> f64 {
        let words = line.split_once('Z').expect("it goes down").1;
        words.split('I').next().expect("a word").parse().expect("a number")
    };
    for (number, line) in (1..).zip(&lines) {
        let expected = -depth * f64::from(number) / (30.0 * 134.0);
        assert!((height(line) - expected).abs() <= 1.01e-4, "{number}: {line}");
    }
    assert!(lines.last().is_some_and(|line| line.starts_with("X100Y0Z-300I")), "{lines:?}");
}

#[test]
fn an_arc_that_would_take_too_many_lines_is_refused_with_their_number() {
    // Radii this far apart are no arc to the firmware.
    let shape = arc([0.0; 3], Plane::Xy, false, 60_000);
    let spiral = element(shape, [120.0, 0.0, -10.0], Some(300.0), 4);
    let said = problem(path([100.0, 0.0, 0.0], vec![spiral]));
    assert!(said.starts_with("line 4: the arc from [100.0, 0.0, 0.0]"), "{said}");
    assert!(said.contains("lines; at most 100000 are sent: split it"), "{said}");
}

#[test]
fn an_arc_that_would_be_drawn_wrongly_is_cut_up_and_a_place_that_is_too_coarse_refused() {
    let half = |offset| {
        let shape = arc([0.0, 0.0, 0.0], Plane::Xy, false, 0);
        let path = path([10.0, 0.0, 0.0], vec![element(shape, [-10.0, 0.0, 0.0], Some(9.0), 4)]);
        let mut config = EncoderConfig::default();
        config.board.work_offsets[0] = [offset, 0.0, 0.0];
        steps_with(path, config).map(|steps| steps.iter().map(text_of).collect::<Vec<_>>())
    };
    assert_eq!(half(-300.0).unwrap(), ["G3X-10I-10F9"]);
    // There the numbers are 4 µm apart: too coarse for an arc, not for lines.
    let lines = half(40_000.0).unwrap();
    assert!(lines.len() > 50 && lines.iter().all(|line| !line.contains('I')), "{lines:?}");
    assert_eq!(
        half(70_000.0).unwrap_err().to_string(),
        "line 4: X-10 is at 69990 mm in the machine frame, where the controller's 32 bit numbers are 0.0078125 mm apart: move the work offset nearer to the machine zero"
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
fn a_full_circle_is_one_wherever_its_ends_fall_on_the_grid() {
    // Both ends are the same but for what floats lose, on either side of half a step.
    let start = [10.000_05 - 1e-10, 0.0, 0.0];
    let circle =
        element(arc([0.0; 3], Plane::Xy, false, 1), [10.000_05 + 1e-10, 0.0, 2.0], Some(300.0), 1);
    let lines = encode(path(start, vec![circle]));
    assert_eq!(lines, ["G3X-10.0001Z1I-10F300", "X10.0001Z2I10.0001"]);
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
fn an_arc_from_where_the_program_does_not_know_is_refused() {
    let shape = arc([0.0, 5.0, 0.0], Plane::Xy, true, 0);
    let mut both = element(Shape::Line, [0.0, 0.0, 0.0], Some(100.0), 8);
    both.axes = AxisSet::from_bits(0b011);
    let turn = element(shape, [0.0, 10.0, 0.0], Some(100.0), 9);
    let mut unknown = actions(&[Action::WorkOffset { system: 2 }]);
    unknown.elements = vec![turn];
    assert_eq!(
        problem(unknown.clone()),
        "line 9: the arc starts at a position of XY that is not known since G55: move XY before it"
    );
    unknown.elements = vec![both, turn];
    assert_eq!(encode(unknown), ["G55", "G1X0Y0F100", "G2Y10J5"]);
}
