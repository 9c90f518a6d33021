//! A reader of its own gets the geometry back from what was written.

use super::*;
use proptest::prelude::*;
use std::f64::consts::TAU;

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
            let EncoderStep::Line(line) = step else { panic!() };
            prop_assert!(line.text.len() <= 79);
            prop_assert!(line.text.bytes().all(|b| b.is_ascii_graphic() && !b"!?~".contains(&b)));
            let index = line.element.unwrap();
            let start = path.start_of(index);
            let one = &path.elements[index];
            prop_assert_eq!(line.source, one.source);
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
            let mut ends = one.end.iter().zip(reader.position);
            let is_last = ends.all(|(wanted, is)| (wanted - is).abs() <= 1e-4);
            let is_between = matches!(one.shape, Shape::Arc(_));
            prop_assert!(is_last || is_between, "{} ends elsewhere", line.text);
        }
        for (index, drawn) in drawn.iter().enumerate() {
            let start = path.start_of(index);
            let wanted =
                crate::vectors::length_mm(&path.elements[index].shape, start, path.elements[index].end);
            // No circle too many or too few. 64 chords are 0.04 % short of an arc.
            prop_assert!((drawn - wanted).abs() <= 1e-3 + wanted * 2e-3, "{drawn} of {wanted}");
        }
        let end = path.elements.last().unwrap().end;
        for (wanted, is) in end.iter().zip(reader.position) {
            prop_assert!((wanted - is).abs() <= 1.01e-4);
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
