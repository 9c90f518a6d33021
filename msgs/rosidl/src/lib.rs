//! The interface definitions of ROS 2, as its `rosidl` packages read them.
//!
//! [`types`] and [`syntax`] read the lines of a definition, [`definition`] all of it with its
//! comments. A [`registry`] holds the definitions of many files, with those that ROS derives
//! from services and actions; [`type_hash`] and [`schema_text`] are computed from it.
//!
//! [`schema`] lays out a message from the schema text that a bag carries. With that, [`decode`]
//! and [`encode`] go between CDR and a [`value`], whose parts a [`field_path`] names.

pub mod decode;
pub mod definition;
pub mod encode;
pub mod field_path;
mod interface_error;
pub mod interface_file;
pub mod name;
pub mod registry;
pub mod schema;
pub mod schema_text;
pub mod syntax;
pub mod type_hash;
pub mod types;
pub mod value;

pub use interface_error::InterfaceError;
