//! The door for everything that comes from outside: files, YAML and names.
//!
//! [`yaml`] bounds what a text may cost before the parser sees it. [`text`] makes a text
//! safe to show. `file` opens regular files only and stops at a limit; `folders` looks up
//! a name from a peer in configured folders. The last two need the feature `files`, which
//! cores do not have.

#[cfg(feature = "files")]
pub mod arguments;
#[cfg(feature = "files")]
pub mod file;
#[cfg(feature = "files")]
pub mod folders;
pub mod nearest;
pub mod text;
pub mod yaml;
