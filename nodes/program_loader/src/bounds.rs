//! The box around a programmed contour.

use cnc_msgs::geometry::{Arc, AxisSet, Position};

/// The box that holds every programmed motion, in the work frame, mm.
///
/// It does not include the move from the start to the first programmed position, moves in machine
/// coordinates, and moves to reference positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    pub min: Position,
    pub max: Position,
    /// Axes that the program names; the values of the others mean nothing.
    pub axes: AxisSet,
}

impl Default for Bounds {
    fn default() -> Self {
        Self { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3], axes: AxisSet::NONE }
    }
}

impl Bounds {
    /// Extends the box by the end of a motion.
    #[inline]
    pub(crate) fn add_end(&mut self, end: Position, axes: AxisSet) {
        for (axis, value) in end.into_iter().enumerate() {
            if axes.contains(axis) {
                self.add(axis, value);
            }
        }
        self.axes = self.axes.union(axes);
    }

    /// Extends the box by an arc: its start and the outermost points that it passes.
    pub(crate) fn add_arc(&mut self, start: Position, end: Position, arc: &Arc) {
        let [first, second, _] = arc.plane.axes();
        for axis in [first, second] {
            self.add(axis, start[axis]);
        }
        for (axis, value) in arc.outermost(start, end) {
            self.add(axis, value);
        }
        self.axes = self.axes.with(first).with(second);
    }

    #[inline]
    fn add(&mut self, axis: usize, value: f64) {
        self.min[axis] = self.min[axis].min(value);
        self.max[axis] = self.max[axis].max(value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::geometry::Plane;

    #[track_caller]
    fn check(clockwise: bool, end: Position, turns: u16, min: [f64; 2], max: [f64; 2]) {
        let arc = Arc { center: [0.0; 3], plane: Plane::Xy, clockwise, turns };
        let mut bounds = Bounds::default();
        bounds.add_arc([10.0, 0.0, 0.0], end, &arc);
        bounds.add_end(end, AxisSet::ALL);
        for axis in 0..2 {
            assert!((bounds.min[axis] - min[axis]).abs() < 1e-9, "{bounds:?}");
            assert!((bounds.max[axis] - max[axis]).abs() < 1e-9, "{bounds:?}");
        }
    }

    #[test]
    fn an_arc_reaches_out_where_it_passes_a_quadrant() {
        check(false, [0.0, 10.0, 0.0], 0, [0.0, 0.0], [10.0, 10.0]);
        check(true, [0.0, 10.0, 0.0], 0, [-10.0, -10.0], [10.0, 10.0]);
        check(false, [-10.0, 0.0, 0.0], 0, [-10.0, 0.0], [10.0, 10.0]);
        check(true, [-10.0, 0.0, 0.0], 0, [-10.0, -10.0], [10.0, 0.0]);
        check(false, [8.0, 6.0, 0.0], 0, [8.0, 0.0], [10.0, 6.0]);
        check(true, [10.0, 0.0, 0.0], 1, [-10.0, -10.0], [10.0, 10.0]);
    }
}
