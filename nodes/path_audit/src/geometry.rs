//! Lines and arcs in the plane, how near they come to each other, and how to find those that do.
//!
//! Written for the audit alone: a proof must not rest on the code that it judges. Knows no contour
//! and no path.

pub(crate) mod direction_ranges;
pub(crate) mod distance_bounds;
pub(crate) mod pieces;
pub(crate) mod planar;
pub(crate) mod strip_tree;
