//! What travels between Kerf's nodes.
//!
//! The checked types of the field come first: [`contour`], [`path`],
//! [`machine`], [`finding`], [`tool_table`], [`profile`]. Cores use these
//! and nothing else; they are in millimetres, as part programs are.
//!
//! [`wire`] holds what ROS 2 sends, in SI units, made of the interface files;
//! [`interface`] what all of it has in common; [`schema`] what bags and peers
//! want to know of it. [`convert`] goes between the two, [`units`] holds the
//! only place where millimetres meet metres, and [`chunk`] cuts what is too long
//! for a message.

pub mod cdr;
pub mod chunk;
pub mod contour;
pub mod convert;
pub mod finding;
pub mod geometry;
pub mod interface;
pub mod machine;
pub mod numbers;
pub mod path;
pub mod profile;
pub mod radius;
pub mod schema;
pub mod tool_table;
mod unique;
pub mod units;
pub mod wire;
