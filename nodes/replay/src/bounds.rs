//! Bounds of a program in old and new bags.

use cnc_msgs::wire::cnc_msgs::msg::ProgrammedContour;
use cnc_msgs::wire::geometry_msgs::msg::Point;

/// The same with a number for bounds that are none: an axis that the program does not name has
/// NaN, which no comparison takes as equal. Older bags have an infinity there.
pub fn comparable(manifest: &ProgrammedContour) -> ProgrammedContour {
    let known = |value: f64| if value.is_finite() { value } else { f64::MAX };
    let corner = |Point { x, y, z }: &Point| Point { x: known(*x), y: known(*y), z: known(*z) };
    ProgrammedContour {
        bounds_min: corner(&manifest.bounds_min),
        bounds_max: corner(&manifest.bounds_max),
        ..manifest.clone()
    }
}
