//! What travels between Kerf's nodes.
//!
//! The checked types of the field come first: [`contour`], [`path`],
//! [`machine`], [`finding`], [`tool_table`], [`profile`], [`keep_out`]. Cores use these
//! and nothing else; they are in millimetres, as part programs are.
//!
//! [`wire`] has the structs that ROS 2 sends, in SI units, generated from the
//! interface files. [`interface`] has their traits, [`schema`] their schema texts
//! and hashes. [`convert`] translates between checked types and wire structs,
//! [`units`] is the only place where millimetres meet metres, and [`chunk`] cuts
//! what is too long for a message.

pub mod calls;
pub mod cdr;
pub mod chunk;
pub mod contour;
pub mod convert;
pub mod count;
pub mod finding;
pub mod further;
pub mod geometry;
pub mod interface;
pub mod keep_out;
pub mod machine;
pub mod machine_file;
pub mod numbers;
pub mod parameter;
pub mod path;
pub mod port_word;
pub mod probing;
pub mod profile;
pub mod radius;
pub mod schema;
pub mod text;
pub mod tool_table;
mod unique;
pub mod units;
pub mod wire;
