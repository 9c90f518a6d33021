//! The interface definitions of ROS 2, as its `rosidl` packages read them.
//!
//! [`types`] and [`syntax`] read the text of a definition. [`schema_text`] cuts the text that a
//! bag carries into definitions, [`schema`] lays out the message that it defines. With that,
//! [`decode`] and [`encode`] go between CDR and a [`value`], whose parts a [`field_path`] names.

pub mod decode;
pub mod encode;
pub mod field_path;
pub mod schema;
pub mod schema_text;
pub mod syntax;
pub mod types;
pub mod value;
