//! Reads ROS 2 interface files and makes Rust, schema texts and type hashes of them.
//!
//! The way of a file: [`syntax`] reads one section with the help of [`value`]
//! and [`name`]; [`registry`] holds all definitions, adds what ROS derives
//! from services and actions, and checks that every name leads somewhere;
//! [`description`] hashes, [`schema`] writes the text that bags carry, [`rust`]
//! writes the code. Everything here maps text to text: the build script reads
//! and writes the files, and the tests run the same modules.
#![allow(unreachable_pub, reason = "included by the build script and by tests, which see it all")]

pub mod description;
pub mod files;
pub mod model;
pub mod name;
pub mod registry;
pub mod rust;
pub mod schema;
pub mod syntax;
pub mod value;

use std::fmt;

/// Why a file is refused, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// Path from the package folder.
    pub file: String,
    /// Line in it, from 1; 0 when it is about the file as a whole.
    pub line: usize,
    /// What is wrong and what to do.
    pub message: String,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => write!(f, "{}: {}", self.file, self.message),
            line => write!(f, "{}:{line}: {}", self.file, self.message),
        }
    }
}
