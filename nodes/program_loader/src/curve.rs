//! Rational B-splines in the plane, as lines and arcs within a tolerance.
//!
//! Knows points and numbers, not words. G5, G5.1 and G5.2 are all such curves: the first two have
//! one span. Each span is divided until two arcs that touch each other and the ends of the span
//! follow it.

/// A point or a direction, mm.
pub(crate) type Point = [f64; 2];

/// How far the lines and arcs are from the curve at most, mm: less than the step of a machine.
pub(crate) const TOLERANCE_MM: f64 = 0.001;
/// What counts as straight, mm.
const STRAIGHT_MM: f64 = TOLERANCE_MM / 10.0;
/// How often a span is halved at most. So small a part of any curve is a point.
const HALVINGS_MAX: u32 = 48;
/// Lines and arcs of one curve at most.
pub(crate) const PIECES_MAX: usize = 100_000;
/// Points at which two arcs are compared with the curve, for each of its order: a polynomial has no
/// bends between them.
const SAMPLES: usize = 6;
/// The largest ratio of two weights of one curve.
pub(crate) const WEIGHT_RATIO_MAX: f64 = 1000.0;
/// The same within a part that arcs may follow: so the curve does not hurry from one sample to the
/// next.
const PART_RATIO_MAX: f64 = 4.0;

/// A line or an arc from where the piece before it ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Piece {
    pub(crate) end: Point,
    /// Of an arc of less than half a turn: its centre, and whether it is clockwise.
    pub(crate) arc: Option<(Point, bool)>,
}

/// A control point and its weight.
pub(crate) type ControlPoint = (Point, f64);

/// A clamped B-spline with uniform knots; `order` is at least 2, and no more than its points.
#[derive(Debug)]
pub(crate) struct Curve<'c> {
    pub(crate) points: &'c [ControlPoint],
    pub(crate) order: usize,
}

impl Curve<'_> {
    /// Whether its weights are near enough to each other.
    pub(crate) fn has_fair_weights(&self) -> bool {
        ratio(self.points.iter().map(|it| it.1)) <= WEIGHT_RATIO_MAX
    }

    /// The curve as lines and arcs, within [`TOLERANCE_MM`]; `None` if it has too many bends.
    pub(crate) fn pieces(&self) -> Option<Vec<Piece>> {
        let mut pieces = Vec::new();
        let spans = self.points.len() + 1 - self.order;
        let mut from = self.points[0].0;
        for span in 0..spans {
            // The ends of the curve are the first and the last point without rounding.
            let is_last = span + 1 == spans;
            let to =
                if is_last { self.points[self.points.len() - 1].0 } else { self.at(span, 1.0).0 };
            self.divide(span, [0.0, 1.0], [from, to], 0, &mut pieces)?;
            from = to;
        }
        Some(pieces)
    }

    /// Adds a part of a span, from `ends[0]` to `ends[1]`; `None` if that takes too many pieces.
    fn divide(
        &self,
        span: usize,
        part: [f64; 2],
        ends: [Point; 2],
        halvings: u32,
        pieces: &mut Vec<Piece>,
    ) -> Option<()> {
        if pieces.len() >= PIECES_MAX {
            return None;
        }
        let controls = self.controls(span, part);
        if is_straight(&controls, ends) {
            pieces.push(Piece { end: ends[1], arc: None });
            return Some(());
        }
        if let Some(both) = self.two_arcs(span, part, ends, &controls) {
            pieces.extend(both);
            return Some(());
        }
        if halvings == HALVINGS_MAX {
            return None;
        }
        let middle = f64::midpoint(part[0], part[1]);
        let at = self.at(span, middle).0;
        self.divide(span, [part[0], middle], [ends[0], at], halvings + 1, pieces)?;
        self.divide(span, [middle, part[1]], [at, ends[1]], halvings + 1, pieces)
    }

    /// De Boor's scheme with a place of its own for each level: the point and its weight, and the
    /// slope, before the division by the weight.
    fn polar_form(&self, span: usize, place: impl Fn(usize) -> f64) -> ([f64; 3], [f64; 3]) {
        let degree = self.order - 1;
        let last = self.points.len() - self.order + 1;
        let knot = |number: usize| (number.saturating_sub(degree)).min(last) as f64;
        let mut row: Vec<[f64; 3]> = self.points[span..=span + degree]
            .iter()
            .map(|&([x, y], weight)| [x * weight, y * weight, weight])
            .collect();
        let mut slope = [0.0; 3];
        for level in 1..=degree {
            if level == degree {
                // The knots at both ends of the span are 1 apart.
                slope = [0, 1, 2].map(|i| degree as f64 * (row[1][i] - row[0][i]));
            }
            let u = span as f64 + place(level);
            for j in 0..=degree - level {
                let (low, high) = (knot(span + j + level), knot(span + j + degree + 1));
                let share = (u - low) / (high - low);
                row[j] = [0, 1, 2].map(|i| row[j][i] + share * (row[j + 1][i] - row[j][i]));
            }
        }
        (row[0], slope)
    }

    /// The point and the direction at a place of a span, from 0 to 1.
    fn at(&self, span: usize, place: f64) -> (Point, Point) {
        let ([x, y, weight], slope) = self.polar_form(span, |_| place);
        let point = [x / weight, y / weight];
        let slope = [0, 1].map(|i| (slope[i] - slope[2] * point[i]) / weight);
        (point, slope)
    }

    /// The control points of a part of a span alone. As all weights are positive, the part is
    /// within their hull, and goes on along a direction if they do.
    fn controls(&self, span: usize, [from, to]: [f64; 2]) -> Vec<ControlPoint> {
        let control = |number: usize| {
            let place = |level: usize| if level <= number { to } else { from };
            let ([x, y, weight], _) = self.polar_form(span, place);
            ([x / weight, y / weight], weight)
        };
        (0..self.order).map(control).collect()
    }

    /// The direction of the curve at one end of a part, of length 1; where it has none, the way to
    /// a point near it.
    fn direction(&self, span: usize, part: [f64; 2], at_end: bool) -> Option<Point> {
        const NEAR: f64 = 1e-4;
        let [from, to] = part;
        let place = if at_end { to } else { from };
        let (point, slope) = self.at(span, place);
        unit(slope).or_else(|| {
            let inside = if at_end { to - NEAR * (to - from) } else { from + NEAR * (to - from) };
            let near = self.at(span, inside).0;
            unit(if at_end { minus(point, near) } else { minus(near, point) })
        })
    }

    fn samples(&self, span: usize, [from, to]: [f64; 2]) -> impl Iterator<Item = Point> {
        let count = SAMPLES * self.order;
        let share = move |sample: usize| sample as f64 / (count + 1) as f64;
        (1..=count).map(move |sample| self.at(span, from + share(sample) * (to - from)).0)
    }

    /// Two arcs along a part of the curve, if they follow it.
    fn two_arcs(
        &self,
        span: usize,
        part: [f64; 2],
        ends: [Point; 2],
        controls: &[ControlPoint],
    ) -> Option<[Piece; 2]> {
        let [start, end] = ends;
        let (out, into) = (self.direction(span, part, false)?, self.direction(span, part, true)?);
        let way = minus(end, start);
        // Each arc then turns by less than a right angle.
        let turns_little = |direction| dot(direction, way) > 0.5 * length(way);
        if !turns_little(out) || !turns_little(into) {
            return None;
        }
        let goes_on = controls.windows(2).all(|pair| {
            dot(minus(pair[1].0, pair[0].0), way) >= -STRAIGHT_MM / 100.0 * length(way)
        });
        if !goes_on || ratio(controls.iter().map(|it| it.1)) > PART_RATIO_MAX {
            return None;
        }
        let reach = reach(way, out, into)?;
        let joint =
            [0, 1].map(|i| f64::midpoint(start[i], end[i]) + reach / 2.0 * (out[i] - into[i]));
        let first = arc(start, joint, out, joint);
        let second = arc(end, joint, into, end);
        let follows = self.samples(span, part).all(|at| {
            let (piece, from) = match dot(minus(at, joint), way) < 0.0 {
                true => (&first, start),
                false => (&second, joint),
            };
            let off = match piece.arc {
                Some((center, _)) => length(minus(at, center)) - length(minus(from, center)),
                None => unit(minus(piece.end, from)).map_or(0.0, |u| cross(u, minus(at, from))),
            };
            off.abs() <= TOLERANCE_MM * 0.9
        });
        follows.then_some([first, second])
    }
}

/// Whether a part with these control points goes straight on from one end to the other, or is as
/// good as a point.
fn is_straight(controls: &[ControlPoint], [start, end]: [Point; 2]) -> bool {
    if controls.iter().all(|it| length(minus(it.0, start)) <= STRAIGHT_MM) {
        return true;
    }
    let way = minus(end, start);
    let Some(along) = unit(way) else { return false };
    let mut last = -STRAIGHT_MM;
    controls.iter().all(|&(at, _)| {
        let (on, off) = (dot(minus(at, start), along), cross(along, minus(at, start)));
        let goes_on = on >= last - STRAIGHT_MM / 100.0 && on <= length(way) + STRAIGHT_MM;
        last = on;
        goes_on && off.abs() <= STRAIGHT_MM
    })
}

/// The largest of some weights by the smallest.
fn ratio(weights: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = weights.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), weight| {
        (low.min(weight), high.max(weight))
    });
    high / low
}

/// How far the tangents of two arcs of equal tangent lengths reach before they meet.
fn reach(way: Point, out: Point, into: Point) -> Option<f64> {
    let sum = [out[0] + into[0], out[1] + into[1]];
    let turn = 2.0 * (1.0 - dot(out, into));
    let (square, along) = (dot(way, way), dot(way, sum));
    let reach = if turn < 1e-9 {
        square / (2.0 * along)
    } else {
        ((along * along + turn * square).sqrt() - along) / turn
    };
    (reach.is_finite() && reach > 0.0).then_some(reach)
}

/// The arc that touches `direction` at one end, and has its other end at `joint`.
fn arc(touched: Point, joint: Point, direction: Point, end: Point) -> Piece {
    let (chord, normal) = (minus(joint, touched), [-direction[1], direction[0]]);
    let height = dot(normal, chord);
    // Of a chord so short, or an arc so flat, a line is as good.
    let sagitta = height.abs() / 4.0;
    if sagitta <= STRAIGHT_MM / 10.0 {
        return Piece { end, arc: None };
    }
    let radius = dot(chord, chord) / (2.0 * height);
    let center = [0, 1].map(|i| touched[i] + radius * normal[i]);
    // Backwards from its end, an arc turns the other way.
    Piece { end, arc: Some((center, radius < 0.0)) }
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn length(a: Point) -> f64 {
    a[0].hypot(a[1])
}

/// The direction of a vector; `None` if it is too short to have one.
fn unit(a: Point) -> Option<Point> {
    let length = length(a);
    (length > 1e-9).then(|| [a[0] / length, a[1] / length])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The part of a piece that is nearest to a point: how far it is away, mm.
    fn distance(from: Point, piece: &Piece, at: Point) -> f64 {
        let Some((center, clockwise)) = piece.arc else {
            let way = minus(piece.end, from);
            let share = (dot(minus(at, from), way) / dot(way, way).max(1e-300)).clamp(0.0, 1.0);
            return length(minus(at, [from[0] + share * way[0], from[1] + share * way[1]]));
        };
        let [a, b, p] = [from, piece.end, at].map(|it| minus(it, center));
        let side = if clockwise { -1.0 } else { 1.0 };
        let within = side * cross(a, p) >= 0.0 && side * cross(p, b) >= 0.0;
        match within {
            true => (length(p) - length(a)).abs(),
            false => length(minus(at, from)).min(length(minus(at, piece.end))),
        }
    }

    /// The Bernstein form of a curve of one span, another way to a point.
    fn bernstein(points: &[ControlPoint], u: f64) -> Point {
        let n = points.len() - 1;
        let mut sum = [0.0; 3];
        let mut binomial = 1.0;
        for (i, &([x, y], w)) in points.iter().enumerate() {
            let share = binomial * u.powi(i as i32) * (1.0 - u).powi((n - i) as i32) * w;
            (sum[0], sum[1], sum[2]) = (sum[0] + share * x, sum[1] + share * y, sum[2] + share);
            binomial *= (n - i) as f64 / (i + 1) as f64;
        }
        [sum[0] / sum[2], sum[1] / sum[2]]
    }

    #[track_caller]
    fn check(points: &[ControlPoint], order: usize, most: usize) {
        let curve = Curve { points, order };
        let pieces = curve.pieces().expect("few pieces");
        assert!(pieces.len() <= most, "{} pieces", pieces.len());
        assert_eq!(pieces.last().map(|it| it.end), points.last().map(|it| it.0));
        let spans = points.len() + 1 - order;
        let mut starts = vec![points[0].0];
        starts.extend(pieces.iter().map(|piece| piece.end));
        for (piece, start) in pieces.iter().zip(&starts) {
            if let Some((center, _)) = piece.arc {
                let radii = [length(minus(*start, center)), length(minus(piece.end, center))];
                assert!((radii[0] - radii[1]).abs() < 1e-7 * (1.0 + radii[0]), "{radii:?}");
            }
        }
        // Closer at the ends of a span, where large weights beside small ones hurry.
        let even = (0..500_u32).map(|n| f64::from(n) / 500.0);
        let near = (0..200_u32).map(|n| 0.5 * 0.93_f64.powi(n as i32));
        let places: Vec<f64> = even.chain(near.flat_map(|near| [near, 1.0 - near])).collect();
        for (span, &place) in (0..spans).flat_map(|span| places.iter().map(move |it| (span, it))) {
            let at = curve.at(span, place).0;
            let off = pieces.iter().zip(&starts).map(|(piece, start)| distance(*start, piece, at));
            let off = off.fold(f64::INFINITY, f64::min);
            assert!(off <= TOLERANCE_MM, "{off} mm at {place} of span {span}");
            if spans == 1 {
                let other = bernstein(points, place);
                assert!(length(minus(at, other)) < 1e-9 * (1.0 + length(at)), "{at:?} {other:?}");
            }
        }
    }

    fn plain(points: &[Point]) -> Vec<ControlPoint> {
        points.iter().map(|&point| (point, 1.0)).collect()
    }

    #[test]
    fn curves_of_one_span_are_followed_within_the_tolerance_by_few_pieces() {
        for (points, most) in [
            (vec![[0.0, 0.0], [0.0, 3.0], [1.0, -2.0], [1.0, 1.0]], 50),
            (vec![[0.0, 0.0], [2.0, 1.0], [4.0, 4.0]], 24),
            (vec![[0.0, 0.0], [50.0, 100.0], [100.0, -100.0], [200.0, 0.0]], 200),
            // Straight, back on itself, with a cusp, a loop, and points that coincide.
            (vec![[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]], 1),
            (vec![[0.0, 0.0], [10.0, 0.0], [0.0, 0.0]], 120),
            (vec![[0.0, 0.0], [10.0, 10.0], [0.0, 10.0], [10.0, 0.0]], 180),
            (vec![[0.0, 0.0], [20.0, 10.0], [-10.0, 10.0], [10.0, 0.0]], 180),
            (vec![[0.0, 0.0], [0.0, 0.0], [5.0, 5.0], [10.0, 0.0]], 100),
            (vec![[0.0, 0.0], [0.0, 0.0], [0.0, 0.0]], 1),
            // Straight, but beyond its end and back again.
            (vec![[0.0, 0.0], [50.0, 0.0], [105.0, 0.0], [100.0, 0.0]], 60),
            (vec![[0.0, 0.0], [500.0, 0.0], [1050.0, 0.0], [1000.0, 0.0]], 60),
            (vec![[0.0, 0.0], [-50.0, 0.0], [500.0, 0.0], [1000.0, 0.0]], 60),
            (vec![[1e5, 1e5], [1e5 + 3.0, 1e5], [1e5 + 3.0, 1e5 + 3.0]], 24),
        ] {
            let order = points.len();
            check(&plain(&points), order, most);
        }
    }

    #[test]
    fn weights_make_a_quarter_of_a_circle() {
        let points = [([10.0, 0.0], 1.0), ([10.0, 10.0], 0.5_f64.sqrt()), ([0.0, 10.0], 1.0)];
        let curve = Curve { points: &points, order: 3 };
        for place in [0.1, 0.5, 0.77] {
            assert!((length(curve.at(0, place).0) - 10.0).abs() < 1e-12);
        }
        check(&points, 3, 4);
    }

    #[test]
    fn curves_of_many_spans_are_followed_and_meet_their_own_knots() {
        let zigzag: Vec<Point> =
            (0..12_u32).map(|n| [f64::from(n) * 5.0, f64::from(n % 2) * 8.0]).collect();
        for order in 2..=5 {
            check(&plain(&zigzag), order, 400);
        }
        let mut points = plain(&[[0.0, 0.0], [0.0, 1.0], [2.0, 2.0], [2.0, 0.0], [0.0, 0.0]]);
        points[4].1 = 2.0;
        points[2].1 = 7.0;
        check(&points, 3, 120);
    }

    #[test]
    fn curves_of_any_points_and_weights_are_followed_within_the_tolerance() {
        let mut state = 0x9e37_79b9_7f4a_7c15_u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        for round in 0..60 {
            let order = 2 + (random() * 9.0) as usize;
            let count = order + (random() * 4.0) as usize;
            let size = [1.0, 30.0, 300.0][round % 3];
            // Every fourth is straight, and goes back and forth.
            let height = if round % 4 == 0 { 0.0 } else { size };
            let mut point = || [size * random(), height * random()];
            let points: Vec<Point> = (0..count).map(|_| point()).collect();
            let mut weight = || match round % 5 {
                0 => WEIGHT_RATIO_MAX.powf(random()),
                1 => [1.0, WEIGHT_RATIO_MAX][(random() * 2.0) as usize],
                _ => 1.0,
            };
            let points: Vec<ControlPoint> = points.into_iter().map(|it| (it, weight())).collect();
            assert!(Curve { points: &points, order }.has_fair_weights());
            check(&points, order, 10_000);
        }
    }

    #[test]
    fn weights_may_differ_by_a_thousand() {
        let mut points = [([0.0, 0.0], 1.0), ([5.0, 9.0], 1000.0), ([9.0, 0.0], 1.0)];
        assert!(Curve { points: &points, order: 3 }.has_fair_weights());
        check(&points, 3, 200);
        points[1].1 = 1001.0;
        assert!(!Curve { points: &points, order: 3 }.has_fair_weights());
    }
}
