//! Tool tables and controller profiles as text.
//!
//! A table is a file; a profile travels with the contour that was read under
//! it, so that planner and replay apply the same rules, built in or not.

use crate::yaml::{FileError, from_yaml_file, from_yaml_str};
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::{ToolTable, ToolTableError};
use std::path::Path;

/// Why a tool table cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ToolTableFileError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{file}: {error}")]
    Content { file: String, error: ToolTableError },
}

/// Reads and checks a tool table.
///
/// # Errors
/// The file cannot be read, is not a tool table, or holds a tool that cannot be.
pub fn load_tool_table(path: &Path) -> Result<ToolTable, ToolTableFileError> {
    let table: ToolTable = from_yaml_file(path)?;
    let content = |error| ToolTableFileError::Content { file: path.display().to_string(), error };
    table.check().map_err(content)?;
    Ok(table)
}

/// A profile as it travels.
pub fn profile_to_yaml(profile: &Profile) -> String {
    serde_yaml::to_string(profile).expect("a profile holds names, numbers and lists only")
}

/// A profile that has travelled.
///
/// # Errors
/// It is not a profile, or not one that this build knows.
pub fn profile_from_yaml(text: &str) -> Result<Profile, FileError> {
    from_yaml_str(text, "the profile that came with the contour")
}
