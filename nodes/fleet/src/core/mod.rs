//! What is decided, as functions of values: no file, clock, thread or store.

pub mod bisection;
pub mod condition;
pub mod groups;
pub mod key;
mod like;
pub mod schema;
pub mod shard;
pub mod todo;
pub mod unpacked;
mod words;
