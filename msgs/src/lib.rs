//! What travels between Kerf's nodes.
//!
//! The checked types of the field come first: [`contour`], [`path`],
//! [`machine`], [`diagnostic`], [`tool_table`], [`profile`]. Cores use these
//! and nothing else; they are in millimetres, as part programs are.

pub mod contour;
pub mod diagnostic;
pub mod geometry;
pub mod machine;
pub mod path;
pub mod profile;
pub mod tool_table;
