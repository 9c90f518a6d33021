//! What bounds the tool: the legs of a contour without its tails, each wall once.

pub(crate) mod passes;
pub(crate) mod retraced_legs;
