//! Straight moves to a point at an angle and a distance from a pole (840C G10, G11).
//!
//! X, Y and Z of the plane are the pole: absolute at first, and under G91 relative to the last
//! pole. B or U is the distance, without a sign. A is the angle from the first axis of the plane,
//! under G91 from the last angle. All of them are modal.

use super::moves::{AXIS_WORDS, End};
use super::{Interpreter, Scene};
use crate::dialect::Distance;
use crate::limits::COORDINATE_MM_MAX;
use cnc_msgs::contour::MotionClass;
use cnc_msgs::finding::Code;
use cnc_msgs::geometry::{AxisSet, Plane, Shape};

/// Largest angle, degrees: more turns than any real program has.
const ANGLE_MAX: f64 = 36_000.0;

/// What stays in force from one polar block to the next.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct Polar {
    /// In the plane in which it was programmed, mm.
    pole: Option<(Plane, [f64; 2])>,
    radius_mm: Option<f64>,
    angle_deg: Option<f64>,
}

impl Interpreter<'_> {
    #[cold]
    pub(super) fn polar(&mut self, scene: &mut Scene<'_>, class: MotionClass) {
        let plane = self.modal.plane;
        let [u, v, w] = plane.axes();
        let scale = self.scale();
        let is_relative = self.modal.distance == Distance::Incremental;
        let mut state = self.modal.polar;
        // A pole of another plane does not count.
        let last = state.pole.filter(|(of, _)| *of == plane).map(|(_, pole)| pole);
        let mut pole = [last.map(|pole| pole[0]), last.map(|pole| pole[1])];
        for (index, axis) in [u, v].into_iter().enumerate() {
            let value = self.take_within(scene, AXIS_WORDS[axis], scale, COORDINATE_MM_MAX, "mm");
            if let Some(value) = value {
                let base = if is_relative { pole[index].unwrap_or(0.0) } else { 0.0 };
                pole[index] = Some(base + value);
            }
        }
        for letter in [b'B', b'U'] {
            if let Some(radius) = self.take_within(scene, letter, scale, COORDINATE_MM_MAX, "mm") {
                if radius < 0.0 {
                    self.negative(scene, letter);
                }
                state.radius_mm = Some(radius);
            }
        }
        if let Some(angle) = self.take_within(scene, b'A', 1.0, ANGLE_MAX, "degrees") {
            let base = if is_relative { state.angle_deg.unwrap_or(0.0) } else { 0.0 };
            state.angle_deg = Some(base + angle);
        }
        let mut end = End {
            position: self.axes.position,
            named: AxisSet::NONE.with(u).with(v),
            relative: AxisSet::NONE,
        };
        if let Some(value) = self.take_within(scene, AXIS_WORDS[w], scale, COORDINATE_MM_MAX, "mm")
        {
            end.position[w] = if is_relative { end.position[w] + value } else { value };
            end.named = end.named.with(w);
            if is_relative {
                end.relative = end.relative.with(w);
            }
        }
        let known = match (pole, state.radius_mm, state.angle_deg) {
            ([Some(a), Some(b)], Some(radius_mm), Some(angle_deg)) => {
                Some(([a, b], radius_mm, angle_deg))
            }
            _ => None,
        };
        let Some((pole, radius_mm, angle_deg)) = known else {
            self.axes.poison(end.named);
            let message = "a polar move without its pole, radius and angle".to_owned();
            let help = "write the pole in both axes of the plane, the radius after B or U, and the angle after A";
            return self.report_block(scene, Code::MissingWord, message, help);
        };
        state.pole = Some((plane, pole));
        self.modal.polar = state;
        let (sin, cos) = angle_deg.to_radians().sin_cos();
        end.position[u] = pole[0] + radius_mm * cos;
        end.position[v] = pole[1] + radius_mm * sin;
        let is_sound = self.relies(scene, end.relative) & self.has_feed(scene, class);
        if self.arrive(&end) && is_sound {
            self.add_to_bounds(end.position, Shape::Line, end.position, end.named);
            self.emit_motion(Shape::Line, end.position, class, end.named);
        }
    }

    /// G16: the plane of the two axes that it names first.
    #[cold]
    pub(super) fn free_plane(&mut self, scene: &mut Scene<'_>, at: usize) -> Option<Plane> {
        let axes = self.take_axis_names(scene);
        let planes = [Plane::Xy, Plane::Zx, Plane::Yz];
        let plane = planes.into_iter().find(|plane| axes.starts_with(&plane.axes()[..2]));
        if plane.is_none() {
            let message = format!(
                "{} does not name a plane of this machine: X Y, Z X or Y Z",
                scene.quote(at)
            );
            let help = "write G17, G18 or G19, or the axes in that order";
            self.report_at(scene, at, Code::Plane, message, help);
        }
        plane
    }
}
