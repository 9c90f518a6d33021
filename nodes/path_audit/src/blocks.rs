//! What each motion of a contour means for compensation, and which elements of a path belong to it.
//!
//! `program` reads the contour, `tool_path` the path, `align` gives each element its block. `spans`
//! groups both, and `chains` has the lines and arcs of a span. Judges no distance.

pub(crate) mod align;
pub(crate) mod chains;
pub(crate) mod program;
pub(crate) mod spans;
pub(crate) mod tool_path;
