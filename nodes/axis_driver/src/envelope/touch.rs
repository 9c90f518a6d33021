//! Whether a tool touches a box in a move of which not everything is known.
//!
//! Where an axis may be anywhere between two places, a move touches for certain where it does so
//! from every one of them, and possibly where it does so from some. The tool stands free before each
//! move, wherever it is. So a move in Z alone that ends above the top of a box never touches it.

use super::distance::{Bounds, Nearest, of_arc, of_line};
use cnc_msgs::geometry::{Arc, AxisSet, Plane, Position};

/// What counts as touching, mm.
const TOUCH_MM: f64 = 1e-6;
/// Farther than any machine reaches, mm: where nothing bounds an axis.
const FAR_MM: f64 = 1e7;

/// Where an axis may be, mm: the least and the greatest coordinate; the same where it is known.
pub(super) type Span = [f64; 2];
/// An axis that nothing bounds.
pub(super) const ANYWHERE: Span = [-FAR_MM, FAR_MM];

/// One move of the tip, as far as it is known.
#[derive(Debug, Clone, Copy)]
pub(super) struct ToolMove<'a> {
    pub(super) from: [Span; 3],
    pub(super) to: [Span; 3],
    /// Its centre has the tool length taken off.
    pub(super) arc: Option<&'a Arc>,
    /// The axes that the move gives: the others stay where they are.
    pub(super) moved: AxisSet,
}

/// What a move does to a box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Touch {
    No,
    /// From some of the places where the tool may be, or with some of the tools that it may be.
    Possible,
    /// Whatever is not known; where it does so, from one of these places.
    Certain(Nearest),
    /// An arc in a plane whose axes are not known.
    Unclear,
}

impl ToolMove<'_> {
    /// Compares with a box. The radius of the tool is between two values, mm.
    pub(super) fn touch(&self, bounds: &Bounds, [least_mm, most_mm]: [f64; 2]) -> Touch {
        if !self.may_reach(bounds, most_mm) {
            return Touch::No;
        }
        let is_known = |axis: usize| is_point(self.from[axis]) && is_point(self.to[axis]);
        let is_flat_known = is_known(0) && is_known(1);
        let reaches = |nearest: Option<Nearest>, radius_mm: f64| {
            nearest.filter(|it| it.distance_mm <= radius_mm + TOUCH_MM)
        };
        if is_flat_known && is_known(2) {
            let nearest = self.nearest(self.corner([0; 3]), bounds);
            return match (reaches(nearest, least_mm), reaches(nearest, most_mm)) {
                (Some(nearest), _) => Touch::Certain(nearest),
                (None, Some(_)) => Touch::Possible,
                (None, None) => Touch::No,
            };
        }
        let top = bounds.max[2] + TOUCH_MM;
        let stays = [0, 1].iter().all(|axis| !self.moved.contains(*axis));
        let (is_above, is_never_low) =
            (self.to[2][0] > top, self.from[2][0].min(self.to[2][0]) > top);
        if is_never_low || stays && (is_above || !self.moved.contains(2)) {
            return Touch::No;
        }
        if let Some(arc) = self.arc
            && (!is_flat_known || arc.plane != Plane::Xy)
        {
            return Touch::Unclear;
        }
        if let Some(nearest) = self.for_certain(bounds, least_mm) {
            return Touch::Certain(nearest);
        }
        let may_touch = match is_flat_known {
            true => reaches(self.nearest(self.corner([0; 3]), bounds), most_mm).is_some(),
            false => true,
        };
        if may_touch { Touch::Possible } else { Touch::No }
    }

    /// Where it touches from every place, with the highest Z; `None` where it may pass.
    fn for_certain(&self, bounds: &Bounds, radius_mm: f64) -> Option<Nearest> {
        let is_open = |axis: &usize| !(is_point(self.from[*axis]) && is_point(self.to[*axis]));
        let open: Vec<usize> = [0, 1].into_iter().filter(is_open).collect();
        let is_fading = open.iter().any(|axis| self.moved.contains(*axis));
        // From nowhere to nowhere, all ways are possible.
        if open.iter().any(|axis| self.moved.contains(*axis) && !is_point(self.to[*axis])) {
            return None;
        }
        // A box has no holes: what is touched from each corner is touched from between them. Where the
        // tool moves to a known place from an unknown one, that holds while it is low all the way.
        let is_low = self.from[2][1].max(self.to[2][1]) <= bounds.max[2] + TOUCH_MM;
        let is_end_alone = is_fading && !is_low;
        let mut worst: Option<Nearest> = None;
        for corner in 0..1usize << open.len() {
            let mut ends = [0, 0, 1];
            for (bit, axis) in open.iter().enumerate() {
                ends[*axis] = corner >> bit & 1;
            }
            let [from, to] = self.corner(ends);
            let from = if is_end_alone { to } else { from };
            let nearest = self.nearest([from, to], bounds);
            let nearest = nearest.filter(|it| it.distance_mm <= radius_mm + TOUCH_MM)?;
            if worst.is_none_or(|worst| nearest.distance_mm > worst.distance_mm) {
                worst = Some(nearest);
            }
        }
        worst
    }

    /// Whether the room that the move may take comes as near to the box as this.
    fn may_reach(&self, bounds: &Bounds, radius_mm: f64) -> bool {
        let apart = |axis: usize| {
            let room = self.room(axis);
            (bounds.min[axis] - room[1]).max(room[0] - bounds.max[axis]).max(0.0)
        };
        apart(0).hypot(apart(1)) <= radius_mm + TOUCH_MM
    }

    /// All coordinates that an axis may pass.
    fn room(&self, axis: usize) -> Span {
        let (from, to) = (self.from[axis], self.to[axis]);
        let [least, most] = [from[0].min(to[0]), from[1].max(to[1])];
        let Some(arc) = self.arc else { return [least, most] };
        let [a, b, normal] = arc.plane.axes();
        if axis == normal {
            return [least, most];
        }
        // It goes no farther from its centre than its ends are.
        let farthest = |axis: usize| {
            let ends = [self.from[axis], self.to[axis]].concat();
            ends.into_iter().map(|it| (it - arc.center[axis]).abs()).fold(0.0, f64::max)
        };
        let reach = farthest(a).hypot(farthest(b));
        [least.min(arc.center[axis] - reach), most.max(arc.center[axis] + reach)]
    }

    /// Both ends, with the least (0) or the greatest (1) coordinate of each axis.
    fn corner(&self, pick: [usize; 3]) -> [Position; 2] {
        let at = |spans: &[Span; 3]| std::array::from_fn(|axis| spans[axis][pick[axis]]);
        [at(&self.from), at(&self.to)]
    }

    /// The nearest place between two ends.
    fn nearest(&self, [from, to]: [Position; 2], bounds: &Bounds) -> Option<Nearest> {
        match self.arc {
            Some(arc) if from != to || arc.turns > 0 => of_arc(from, to, arc, bounds),
            _ => of_line(from, to, bounds),
        }
    }
}

pub(super) fn is_point(span: Span) -> bool {
    span[0] == span[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 10 to 20 in X and Y, up to Z5.
    const BLOCK: Bounds = Bounds { min: [10.0, 10.0, -9.0], max: [20.0, 20.0, 5.0] };

    /// What is said of a move agrees with many moves of which all is known.
    #[test]
    fn certain_is_from_everywhere_and_no_is_from_nowhere() {
        const PLACES: u32 = 60;
        // Certain, possible, no; and moves of which the last is said although some place touches.
        let mut seen = [0; 3];
        for number in 0..6_000u32 {
            // Numbers that are spread evenly and never repeat.
            let spread = |share: f64| (f64::from(number + 1) * share).fract();
            let bits = number.wrapping_mul(2_654_435_761) >> 16;
            let place = |a: f64, b: f64, c: f64| {
                [30.0 * spread(a), 30.0 * spread(b), 16.0 * spread(c) - 4.0]
            };
            let known = [place(0.618_034, 0.754_878, 0.569_840), place(0.819_173, 0.671_044, 0.38)];
            let width = 14.0 * spread(0.438_579);
            let mut moved = AxisSet::NONE;
            let mut spans = known.map(|at| at.map(|at| [at; 2]));
            for axis in [0, 1, 2] {
                match bits >> (3 * axis) & 7 {
                    // Unknown, and it stays where it is.
                    0 => spans[0][axis] = [spans[0][axis][0], spans[0][axis][0] + width],
                    // From somewhere to a known place.
                    1 => {
                        moved = moved.with(axis);
                        spans[0][axis] = [spans[0][axis][0], spans[0][axis][0] + width];
                        continue;
                    }
                    2 | 3 => {}
                    _ => {
                        moved = moved.with(axis);
                        continue;
                    }
                }
                spans[1][axis] = spans[0][axis];
            }
            let [from, to] = spans;
            let radius = 4.0 * spread(0.880_272);
            let said = ToolMove { from, to, arc: None, moved }.touch(&BLOCK, [radius; 2]);
            let mut touches = 0;
            let mut free = 0;
            for sample in 0..PLACES {
                let at = |span: Span, axis: u32| {
                    // The ends first, then between them.
                    let part = match sample < 8 {
                        true => f64::from(sample >> axis & 1),
                        false => (f64::from(sample * 3 + axis + 1) * 0.618_034).fract(),
                    };
                    span[0] + (span[1] - span[0]) * part
                };
                let start: Position = [0, 1, 2].map(|axis| at(from[axis], axis as u32));
                let end: Position = [0, 1, 2].map(|axis| match moved.contains(axis) {
                    true => to[axis][0],
                    false => start[axis],
                });
                let reaches = |found: Option<Nearest>| {
                    found.is_some_and(|it| it.distance_mm <= radius + TOUCH_MM)
                };
                let is_open = from.iter().any(|it| !is_point(*it));
                // A tool stands free before it moves.
                if is_open && reaches(of_line(start, start, &BLOCK)) {
                    continue;
                }
                free += 1;
                touches += u32::from(reaches(of_line(start, end, &BLOCK)));
            }
            let words = format!("{number}: {said:?} {from:?} {to:?} {moved:?} {touches} of {free}");
            match said {
                Touch::No => assert_eq!(touches, 0, "{words}"),
                Touch::Certain(_) => assert_eq!(touches, free, "{words}"),
                Touch::Possible => assert!(
                    from.iter().zip(&to).any(|(a, b)| !is_point(*a) || !is_point(*b)),
                    "{words}"
                ),
                Touch::Unclear => panic!("{words}"),
            }
            seen[match said {
                Touch::Certain(_) => 0,
                Touch::Possible | Touch::Unclear => 1,
                Touch::No => 2,
            }] += 1;
        }
        assert!(seen.iter().all(|count| *count > 300), "{seen:?}");
    }

    #[test]
    fn an_arc_whose_plane_is_not_known_is_neither() {
        let arc = Arc { center: [15.0, 0.0, 0.0], plane: Plane::Xy, clockwise: true, turns: 0 };
        let point = |at: Position| at.map(|at| [at; 2]);
        let (from, to) = (point([5.0, 0.0, 0.0]), point([25.0, 0.0, 0.0]));
        let way = |from, to| ToolMove { from, to, arc: Some(&arc), moved: AxisSet::ALL };
        // Over the top of the circle: Y10.
        assert!(matches!(way(from, to).touch(&BLOCK, [1.0; 2]), Touch::Certain(_)));
        let low = |from: [Span; 3]| [from[0], from[1], [-4.0, 4.0]];
        assert!(matches!(way(low(from), low(to)).touch(&BLOCK, [1.0; 2]), Touch::Certain(_)));
        let any = |from: [Span; 3]| [from[0], from[1], [-4.0, 9.0]];
        assert_eq!(way(any(from), any(to)).touch(&BLOCK, [1.0; 2]), Touch::Possible);
        let high = |from: [Span; 3]| [from[0], from[1], [5.1, 9.0]];
        assert_eq!(way(high(from), high(to)).touch(&BLOCK, [1.0; 2]), Touch::No);
        let somewhere = [[0.0, 9.0], from[1], from[2]];
        assert_eq!(way(somewhere, to).touch(&BLOCK, [1.0; 2]), Touch::Unclear);
    }
}
