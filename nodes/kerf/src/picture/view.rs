//! Projects work coordinates onto the paper.
//!
//! The view is from the positive end of the plane's normal; for turning in front of the centre of
//! rotation with X downwards, as the operator sees it (S02).

use cnc_msgs::contour::{ContourEventKind, ProgrammedContour};
use cnc_msgs::geometry::{Plane, Position, Shape};
use cnc_msgs::profile::Profile;

/// A point on the paper, y downwards.
pub(crate) type Point = [f64; 2];

/// The plane that is shown, and whether its X points down.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View {
    pub(crate) plane: Plane,
    pub(crate) is_mirrored: bool,
}

impl View {
    /// The main plane of the program; mirrored for turning if the profile says so.
    pub(crate) fn of(contour: &ProgrammedContour, profile: &Profile) -> Self {
        let plane = main_plane(contour);
        Self { plane, is_mirrored: profile.display.mirror_x && plane == Plane::Zx }
    }

    pub(crate) fn project(self, position: Position) -> Point {
        let [first, second, _] = self.plane.axes();
        [position[first], if self.is_mirrored { position[second] } else { -position[second] }]
    }

    /// The direction of an arc on the paper.
    pub(crate) fn turns_clockwise(self, clockwise: bool) -> bool {
        clockwise != self.is_mirrored
    }
}

/// The plane of the first compensation, else of the first arc, else the last one selected.
fn main_plane(contour: &ProgrammedContour) -> Plane {
    let mut plane = Plane::default();
    let mut arc_plane = None;
    for event in &contour.events {
        match event.kind {
            ContourEventKind::Plane(selected) => plane = selected,
            ContourEventKind::Select { .. } => return plane,
            ContourEventKind::Motion(motion) => {
                if let (Shape::Arc(arc), None) = (motion.shape, arc_plane) {
                    arc_plane = Some(arc.plane);
                }
            }
            _ => {}
        }
    }
    arc_plane.unwrap_or(plane)
}
