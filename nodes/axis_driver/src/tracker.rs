//! Which element is being cut.
//!
//! What was sent is ahead of what is cut by the receive buffer and the planner. The
//! answers give bounds, the reported position decides between them, and progress
//! never goes back: on a path that returns on itself the place along the element
//! counts as well. A controller that reports line numbers decides by itself, where the
//! lines carry them; it is not needed.

use crate::encoder::line_number;
use crate::vectors::{dot, minus, norm, sweep};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::path::{CompensatedPath, PathElement};
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// A position counts as on an element within this, mm: steps, and three decimals.
const ON_ELEMENT_MM: f64 = 0.02;
/// Positions may fall back by this along an element, mm.
const JITTER_MM: f64 = 0.02;

/// Follows the tool along a path.
#[derive(Debug, Clone)]
pub struct Tracker {
    planner_blocks: usize,
    /// The elements of the last answered motion lines; the planner holds no others.
    answered: VecDeque<usize>,
    element: usize,
    /// Part of the element that is done, 0 to 1.
    part: f64,
    /// The part that is not done, mm, as far as it is known.
    rest_mm: f64,
    /// Where the run began, for axes that the path does not give before these elements.
    began: Option<(Position, [usize; 3])>,
    /// What the controller said last, until the position is looked at.
    reported: Option<usize>,
}

impl Tracker {
    /// The tool is at the start of this element.
    pub fn new(first_element: usize, planner_blocks: u16) -> Self {
        let planner_blocks = usize::from(planner_blocks);
        let answered = VecDeque::with_capacity(planner_blocks + 2);
        Self {
            planner_blocks,
            answered,
            element: first_element,
            part: 0.0,
            rest_mm: f64::INFINITY,
            began: None,
            reported: None,
        }
    }

    /// The element that is being cut.
    pub fn element(&self) -> usize {
        self.element
    }

    /// The part of that element that has been cut, 0 to 1.
    pub fn part(&self) -> f64 {
        self.part
    }

    /// Whether that element has been cut to its end.
    pub fn is_at_end(&self) -> bool {
        self.part >= 1.0
    }

    /// Whether all elements before this one have been cut.
    pub fn has_reached(&self, element: usize) -> bool {
        let is_next = self.element + 1 == element;
        self.element >= element || is_next && (self.is_at_end() || self.rest_mm <= ON_ELEMENT_MM)
    }

    /// The tool is here before the first element, in the work frame; a path that does not
    /// rely on its start may begin anywhere. Only the first call counts.
    pub fn begin_at(&mut self, path: &CompensatedPath, position: Position) {
        if self.began.is_some() {
            return;
        }
        let given_from = std::array::from_fn(|axis| {
            let gives = |element: &PathElement| {
                element.axes.contains(axis) || element.end[axis] != path.start[axis]
            };
            match path.assumed_axes.contains(axis) {
                true => 0,
                false => path.elements.iter().position(gives).map_or(usize::MAX, |at| at + 1),
            }
        });
        self.began = Some((position, given_from));
    }

    /// Where an element begins and ends.
    fn ends(&self, path: &CompensatedPath, index: usize) -> (Position, Position) {
        let mut ends = [path.start_of(index), path.elements[index].end];
        if let Some((position, given_from)) = self.began {
            for (end, number) in ends.iter_mut().zip(index..) {
                for axis in 0..3 {
                    if number < given_from[axis] {
                        end[axis] = position[axis];
                    }
                }
            }
        }
        ends.into()
    }

    /// A line that cuts this element was answered: it is in the planner.
    pub fn on_answer(&mut self, element: usize) {
        // One more than the planner holds: the line that is being read has no answer yet.
        if self.answered.len() > self.planner_blocks {
            self.answered.pop_front();
        }
        self.answered.push_back(element);
    }

    /// Whether a line that cuts anything was answered.
    pub fn has_begun(&self) -> bool {
        !self.answered.is_empty()
    }

    /// Whether anything can have been cut, or is to be cut next.
    pub fn is_under_way(&self) -> bool {
        self.has_begun() || self.part > 0.0
    }

    /// The controller says itself which line it cuts; `next` is the element of the
    /// oldest unanswered line.
    pub fn on_line_number(&mut self, number: u32, next: Option<usize>) {
        let highest = next.or(self.answered.back().copied()).unwrap_or(self.element);
        let is_it = |element: &usize| line_number(*element) == number as usize;
        if let Some(element) = (self.element..=highest).find(is_it) {
            self.go_to(element, 0.0);
            // No other can be meant by the position.
            self.reported = Some(element);
        }
    }

    /// All that was answered has been cut.
    pub fn on_all_done(&mut self) {
        if let Some(&last) = self.answered.back() {
            self.go_to(last, 1.0);
        }
    }

    /// Takes a reported position, in the work frame, and the planner blocks in use
    /// where they are reported; `next` is the element of the oldest unanswered line.
    pub fn on_position(
        &mut self,
        path: &CompensatedPath,
        position: Option<Position>,
        blocks_in_use: Option<usize>,
        next: Option<usize>,
    ) {
        let in_planner = blocks_in_use.unwrap_or(self.planner_blocks).min(self.planner_blocks);
        // Each line took one block or more, and one may just have been finished.
        let back = (in_planner + 1).min(self.answered.len());
        if let Some(&lowest) = self.answered.get(self.answered.len() - back) {
            self.go_to(lowest, 0.0);
        }
        let highest = next.or(self.answered.back().copied()).unwrap_or(self.element);
        let highest = self.reported.take().map_or(highest, |reported| reported.max(self.element));
        let Some(position) = position else { return };
        let mut best: Option<(f64, usize, f64, f64)> = None;
        for index in self.element..=highest.min(path.elements.len().saturating_sub(1)) {
            let Some(element) = path.elements.get(index) else { return };
            let (start, end) = self.ends(path, index);
            let (distance, part, length) =
                nearest(&element.shape, start, end, position, self.part_on(index));
            let fell_back = (self.part_on(index) - part) * length > JITTER_MM;
            if !fell_back && best.is_none_or(|(least, ..)| distance < least) {
                best = Some((distance, index, part, (1.0 - part) * length));
            }
            if best.is_some_and(|(least, ..)| least <= ON_ELEMENT_MM) {
                break;
            }
        }
        if let Some((_, index, part, rest_mm)) = best {
            self.go_to(index, part);
            if index == self.element {
                self.rest_mm = rest_mm;
            }
        }
    }

    fn part_on(&self, index: usize) -> f64 {
        if index == self.element { self.part } else { 0.0 }
    }

    fn go_to(&mut self, element: usize, part: f64) {
        if element > self.element {
            (self.element, self.part, self.rest_mm) = (element, part, f64::INFINITY);
        } else if element == self.element {
            self.part = self.part.max(part);
        }
    }
}

/// Distance from a position to an element, the part of the element before the nearest
/// point, and the element's length; `from_part` picks the turn of a helix.
fn nearest(
    shape: &Shape,
    start: Position,
    end: Position,
    position: Position,
    from_part: f64,
) -> (f64, f64, f64) {
    match shape {
        Shape::Line => {
            let (along, to) = (minus(end, start), minus(position, start));
            let squared = dot(along, along);
            let part = if squared > 0.0 { (dot(to, along) / squared).clamp(0.0, 1.0) } else { 1.0 };
            let off = [0, 1, 2].map(|axis| to[axis] - along[axis] * part);
            (norm(off), part, squared.sqrt())
        }
        Shape::Arc(arc) => {
            let [a, b, normal] = arc.plane.axes();
            let total = sweep(arc, start, end);
            let radius = (start[a] - arc.center[a]).hypot(start[b] - arc.center[b]);
            let length = (radius * total).hypot(end[normal] - start[normal]);
            let angle = |p: Position| (p[b] - arc.center[b]).atan2(p[a] - arc.center[a]);
            let turned = angle(position) - angle(start);
            let turned = if arc.clockwise { -turned } else { turned }.rem_euclid(TAU);
            let off_circle =
                (position[a] - arc.center[a]).hypot(position[b] - arc.center[b]) - radius;
            let mut best = (f64::INFINITY, 1.0, length);
            // The same angle comes once a turn; after the start it is the start.
            let mut candidates = vec![0.0, total];
            candidates.extend((0..=arc.turns).map(|turn| turned + TAU * f64::from(turn)));
            for swept in candidates.into_iter().filter(|swept| *swept <= total) {
                let part = if total > 0.0 { swept / total } else { 1.0 };
                let height = start[normal] + (end[normal] - start[normal]) * part;
                let gap = (swept - turned).rem_euclid(TAU);
                let around = 2.0 * radius * (gap / 2.0).sin().abs();
                let distance = off_circle.hypot(around).hypot(position[normal] - height);
                let is_ahead = (from_part - part) * length <= JITTER_MM;
                if is_ahead && distance < best.0 - 1e-9 {
                    best = (distance, part, length);
                }
            }
            best
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::geometry::{Arc, AxisSet, Plane};
    use cnc_msgs::path::Role;

    fn path(ends: &[Position]) -> CompensatedPath {
        let element = |end: &Position| PathElement {
            side: None,
            shape: Shape::Line,
            end: *end,
            feed_mm_per_min: Some(500.0),
            role: Role::None,
            axes: Default::default(),
            source: Default::default(),
        };
        CompensatedPath { elements: ends.iter().map(element).collect(), ..Default::default() }
    }

    #[test]
    fn the_position_decides_among_what_was_sent() {
        let path = path(&[[10.0, 0.0, 0.0], [10.0, 10.0, 0.0], [0.0, 10.0, 0.0]]);
        let mut tracker = Tracker::new(0, 15);
        (0..3).for_each(|element| tracker.on_answer(element));
        for (position, wanted) in
            [([4.0, 0.0, 0.0], 0), ([10.0, 3.0, 0.0], 1), ([2.0, 10.0, 0.0], 2)]
        {
            tracker.on_position(&path, Some(position), None, None);
            assert_eq!(tracker.element(), wanted);
        }
    }

    #[test]
    fn a_first_move_from_anywhere_is_the_first_move() {
        // On its way there it passes places of later elements.
        let mut path =
            path(&[[0.0, 0.0, 0.0], [0.0, 5.0, 0.0], [30.0, 5.0, 0.0], [30.0, 0.0, 0.0]]);
        path.elements[0].axes = AxisSet::ALL;
        let mut tracker = Tracker::new(0, 15);
        tracker.begin_at(&path, [40.0, 5.0, 0.0]);
        (0..4).for_each(|element| tracker.on_answer(element));
        for (position, wanted) in [
            ([30.0, 3.75, 0.0], 0),
            ([8.0, 1.0, 0.0], 0),
            ([0.0, 2.0, 0.0], 1),
            ([9.0, 5.0, 0.0], 2),
        ] {
            tracker.on_position(&path, Some(position), None, None);
            assert_eq!(tracker.element(), wanted, "at {position:?}");
        }
    }

    #[test]
    fn a_path_that_comes_back_on_itself_is_followed_forth_and_back() {
        let path = path(&[[10.0, 0.0, 0.0], [0.0, 0.0, 0.0], [10.0, 0.0, 0.0]]);
        let mut tracker = Tracker::new(0, 15);
        (0..3).for_each(|element| tracker.on_answer(element));
        for (x, wanted) in [(3.0, 0), (8.0, 0), (6.0, 1), (2.0, 1), (5.0, 2), (9.0, 2)] {
            tracker.on_position(&path, Some([x, 0.0, 0.0]), None, None);
            assert_eq!(tracker.element(), wanted, "at X{x}");
        }
    }

    #[test]
    fn the_planner_bounds_what_can_be_cut_when_no_position_is_known() {
        let path = path(&[[1.0, 0.0, 0.0]; 40]);
        let mut tracker = Tracker::new(0, 15);
        (0..30).for_each(|element| tracker.on_answer(element));
        tracker.on_position(&path, None, None, Some(30));
        assert_eq!(tracker.element(), 14);
        tracker.on_position(&path, None, Some(2), Some(30));
        assert_eq!(tracker.element(), 27);
        tracker.on_all_done();
        assert_eq!(tracker.element(), 29);
    }

    #[test]
    fn a_full_circle_is_followed_to_its_end() {
        let mut path = path(&[[10.0, 0.0, 0.0], [20.0, 0.0, 0.0]]);
        path.start = [10.0, 0.0, 0.0];
        path.elements[0].shape = Shape::Arc(Arc {
            center: [0.0, 0.0, 0.0],
            plane: Plane::Xy,
            clockwise: false,
            turns: 1,
        });
        let mut tracker = Tracker::new(0, 15);
        (0..2).for_each(|element| tracker.on_answer(element));
        for (position, wanted) in [
            ([10.0, 0.0, 0.0], 0),
            ([0.0, 10.0, 0.0], 0),
            ([-10.0, 0.0, 0.0], 0),
            ([0.0, -10.0, 0.0], 0),
            ([15.0, 0.0, 0.0], 1),
        ] {
            tracker.on_position(&path, Some(position), None, None);
            assert_eq!(tracker.element(), wanted, "at {position:?}");
        }
    }
}
