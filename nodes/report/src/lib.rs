//! What scripts read of a plan: JSON.
//!
//! A crate of its own, because a plan of a million elements is half a gigabyte of JSON: this is compiled for speed,
//! and the command around it for a short build. It decides nothing and prints nothing but JSON.

pub mod json;
pub mod plan;
