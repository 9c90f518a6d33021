//! Reads everything that comes from outside, with limits: files, YAML and names.
//!
//! [`yaml`] bounds what a text may cost before the parser sees it. [`text`] makes a text
//! safe to show. `file` opens only regular files and stops at a limit. `line_pieces` reads one without holding it.
//! `folders` looks up a name from a peer in configured folders. `replace` writes a file back, whole or not at all.
//! `file`, `line_pieces`, `folders` and `replace` need the feature `files`, which cores do not enable.

#[cfg(feature = "files")]
pub mod arguments;
#[cfg(feature = "files")]
pub mod file;
#[cfg(feature = "files")]
pub mod folders;
#[cfg(feature = "files")]
pub mod line_pieces;
pub mod nearest;
#[cfg(feature = "files")]
pub mod replace;
pub mod text;
pub mod yaml;
