//! Lines and arcs in the plane of compensation: where they meet, how near they come.
//!
//! Knows no span, no profile and no program. Every tolerance of the planner is in `tolerance`.

pub(crate) mod bounds;
pub(crate) mod chains;
pub(crate) mod contact;
pub(crate) mod distance;
pub(crate) mod element;
pub(crate) mod frame;
pub(crate) mod intersect;
pub mod tessellate;
pub(crate) mod tolerance;
pub(crate) mod tree;
