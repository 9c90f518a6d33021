//! M62 to M68.

use super::*;

/// The lines of one word, before a move or without one, on a board with two ports of each kind.
fn lines(number: f64, words: &str, moves: bool) -> Result<Vec<String>, String> {
    let words = Words::new(words).expect("short");
    let mut path = actions(&[Action::Auxiliary { letter: 'M', number, words }]);
    if moves {
        path.elements = vec![element(Shape::Line, [1.0, 0.0, 0.0], None, 8)];
    }
    let board = Board { ports: [2; 4].into(), ..Board::default() };
    let config = EncoderConfig { board, ..EncoderConfig::default() };
    let steps = steps_with(path, config).map_err(|problem| problem.to_string())?;
    let lines = steps.iter().filter_map(EncoderStep::line).filter(|line| line.element.is_none());
    Ok(lines.map(|line| format!("{} {:?}", line.text, line.kind)).collect())
}

#[test]
fn what_is_switched_waits_for_the_motion_before() {
    const WAIT: &str = "G4P0 Dwell { milliseconds: 0 }";
    for (number, words, expected) in [
        (62.0, "P1", &[WAIT, "M64P1 Slow"][..]),
        (63.0, "P0", &[WAIT, "M65P0 Slow"]),
        (67.0, "E1 Q-5", &[WAIT, "M68E1Q-5 Slow"]),
        (64.0, "P1", &[WAIT, "M64P1 Slow"]),
        (65.0, "P1", &[WAIT, "M65P1 Slow"]),
        (68.0, "E0 Q25", &[WAIT, "M68E0Q25 Slow"]),
        (66.0, "L3 P0 Q2.5", &["M66L3P0Q2.5 Dwell { milliseconds: 2500 }"]),
        (66.0, "E1", &["M66E1L0 Dwell { milliseconds: 0 }"]),
    ] {
        let lines = lines(number, words, true).expect("it has them");
        assert_eq!(lines, expected, "M{number} {words}");
    }
}

#[test]
fn what_the_board_has_not_and_what_would_wait_for_ever_is_refused() {
    for (number, words, moves, expected) in [
        (64.0, "P2", true, "line 7: M64 P2 needs digital output 2, and this controller has 2"),
        (66.0, "L0 P2", true, "line 7: M66 L0 P2 needs digital input 2, and this controller"),
        (68.0, "E9 Q1", true, "line 7: M68 E9 Q1 needs analog output 9, and this controller"),
        (66.0, "E2 L0", true, "line 7: M66 E2 L0 needs analog input 2, and this controller"),
        (62.0, "P1", false, "line 7: M62 P1 switches when the next motion begins, and none"),
        (
            68.0,
            "E0 Q2.5",
            true,
            "line 7: M68 E0 Q2.5: grblHAL would set 2 instead: it sets whole numbers",
        ),
        (67.0, "E0 Q-1e10", true, "line 7: M67 E0 Q-1e10: grblHAL would set -2147483648 instead"),
        (62.0, "", true, "line 7: this controller has no M62"),
    ] {
        let refused = lines(number, words, moves).expect_err("a refusal");
        assert!(refused.starts_with(expected), "{refused}");
    }
    assert!(lines(64.0, "P1", false).is_ok());
}

#[test]
fn what_is_switched_with_a_motion_comes_right_before_it() {
    let port = |number: f64, words: &str| Action::Auxiliary {
        letter: 'M',
        number,
        words: Words::new(words).expect("short"),
    };
    let further =
        |mode| Action::Further(FurtherMove { axes: FurtherAxes::NONE.with(0, 5.0), mode });
    let elements = vec![
        element(Shape::Line, [1.0, 0.0, 0.0], Some(600.0), 1),
        element(Shape::Line, [2.0, 0.0, 0.0], Some(600.0), 6),
    ];
    let mut path = path([0.0; 3], elements);
    let event = |at_element, action, line| PathEvent { at_element, action, source: source(line) };
    path.events = vec![
        event(1, port(62.0, "P0"), 2),
        event(1, port(67.0, "E0 Q1"), 3),
        event(1, Action::Stop { optional: false }, 4),
        event(1, port(64.0, "P1"), 5),
        event(2, port(63.0, "P0"), 7),
        event(2, Action::Dwell { seconds: 1.0 }, 8),
        event(2, further(FurtherMode::Rapid), 9),
        event(2, port(65.0, "P1"), 10),
    ];
    let board = Board { ports: [2; 4].into(), further_axes: 1, ..Board::default() };
    let config = EncoderConfig { board, ..EncoderConfig::default() };
    let lines: Vec<String> = steps_with(path, config).expect("lines").iter().map(text_of).collect();
    let expected = [
        "G1X1F600", "M0", "G4P0", "M64P1", "G4P0", "M64P0", "M68E0Q1", "X2", "G4P1", "G4P0",
        "M65P0", "G0A5", "G4P0", "M65P1",
    ];
    assert_eq!(lines, expected);
}
