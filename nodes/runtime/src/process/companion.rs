//! Programs of this project that call each other, found as git and cargo find theirs.

use std::path::PathBuf;

/// A program next to this one, else its bare name, which the system looks up in PATH.
pub fn program_beside(name: &str) -> PathBuf {
    let beside = std::env::current_exe().ok().map(|it| it.with_file_name(name));
    beside.filter(|it| it.is_file()).unwrap_or_else(|| name.into())
}
