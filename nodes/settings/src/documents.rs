//! Tool tables and control profiles as text.
//!
//! A table is a file. A profile travels with the contour that was read with
//! it, so that planner and replay apply the same rules, built in or not.

use crate::yaml::{FileError, from_foreign_yaml, from_yaml_str, line_of, read_text};
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::{ToolTable, ToolTableError};
use std::path::Path;

/// Why a tool table cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ToolTableFileError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{file}{}: {error}", line.map(|line| format!(":{line}")).unwrap_or_default())]
    Content {
        file: String,
        /// Line of the row that is wrong, 1-based, if it can be found.
        line: Option<usize>,
        error: ToolTableError,
    },
}

/// Reads and checks a tool table.
///
/// # Errors
/// The file cannot be read, is not a tool table, or has an invalid tool.
pub fn load_tool_table(path: &Path) -> Result<ToolTable, ToolTableFileError> {
    tool_table_from_yaml(&read_text(path)?, &path.display().to_string())
}

/// Reads and checks a tool table from its text; `file` names it in errors.
///
/// # Errors
/// It is not a tool table, or has an invalid tool.
pub fn tool_table_from_yaml(text: &str, file: &str) -> Result<ToolTable, ToolTableFileError> {
    let table: ToolTable =
        from_yaml_str(text, file).map_err(|error: FileError| error.reworded(not_a_tool_table))?;
    table.check().map_err(|error| {
        let line = line_of(text, &place_of(&error));
        ToolTableFileError::Content { file: file.to_owned(), line, error }
    })?;
    Ok(table)
}

/// What the text lacks to be a tool table, where it is not even in the form of one.
fn not_a_tool_table(reason: &str) -> Option<String> {
    const TOOL: &str = "{diameter_mm: 10.0}";
    const OFFSET: &str = "{radius_mm: 5.0}";
    let (place, expected) = reason.split_once("invalid type: ")?;
    let (_, expected) = expected.rsplit_once(", expected ")?;
    let place = place.trim_end_matches(": ");
    let row = |name: &str| place.rsplit_once('.').map_or(name, |(_, number)| number).to_owned();
    match (place, expected) {
        ("", "struct ToolTable") => {
            Some("not a tool table; it begins with `tools:` or `offsets:`".to_owned())
        }
        ("tools", "a map") => Some(format!("`tools` needs rows such as `1: {TOOL}`")),
        ("offsets", "a map") => Some(format!("`offsets` needs rows such as `1: {OFFSET}`")),
        (_, "struct Tool") => Some(format!("write T{} as `{0}: {TOOL}`", row("1"))),
        (_, "struct Offset") => Some(format!("write D{} as `{0}: {OFFSET}`", row("1"))),
        _ => None,
    }
}

/// The keys that lead to the number that is wrong, the outermost first.
fn place_of(error: &ToolTableError) -> Vec<String> {
    let path =
        |list: &str, number: &str, what: &str| [list, number, what].map(String::from).to_vec();
    let of_row = |row: &str, what: &str| match row.split_at_checked(1) {
        Some(("D", number)) => path("offsets", number, what),
        Some((_, number)) => path("tools", number, what),
        None => Vec::new(),
    };
    match error {
        ToolTableError::NotFinite { row, what, .. }
        | ToolTableError::TooLarge { row, what, .. } => of_row(row, what),
        ToolTableError::TipDirection { row, .. } => of_row(row, "tip_direction"),
        ToolTableError::WearTurnsSide { row, wear, .. } => of_row(row, wear),
        // A text with a duplicate row is refused earlier.
        ToolTableError::Twice { .. } => Vec::new(),
        ToolTableError::NegativeDiameter { tool, .. } => {
            path("tools", &tool.to_string(), "diameter_mm")
        }
        ToolTableError::NegativeNoseRadius { tool, .. } => {
            path("tools", &tool.to_string(), "nose_radius_mm")
        }
    }
}

/// Encodes a profile as YAML.
pub fn profile_to_yaml(profile: &Profile) -> String {
    serde_yaml::to_string(profile).expect("a profile holds names, numbers and lists only")
}

/// Decodes a profile from YAML.
///
/// # Errors
/// It is not a profile that this build knows. The reason does not quote it.
pub fn profile_from_yaml(text: &str) -> Result<Profile, FileError> {
    from_foreign_yaml(text, "the profile that came with the contour")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_invalid_tool_is_reported_with_its_line() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("tools.yaml");
        let table = [
            ("tools:\n  1: {diameter_mm: 5.0}\n  2:\n    diameter_mm: -5.0\n", "tools.yaml:4: "),
            ("tools:\n  1: {diameter_mm: -5.0}\n", "tools.yaml:2: "),
            ("tools:\n  3: {nose_radius_mm: -0.8}\n", "tools.yaml:2: "),
            ("offsets:\n  1: {radius_mm: 1.0}\n  12:\n    radius_mm: .inf\n", "tools.yaml:4: "),
            ("offsets:\n  1: {radius_mm: 1.0}\n  2: {tip_direction: 11}\n", "tools.yaml:3: "),
            ("{tools: {1: {diameter_mm: 2.0e+4}}}\n", "tools.yaml: "),
            (
                "tools:\n  1: {diameter_mm: 5.0}\n  01: {diameter_mm: 6.0}\n",
                "tools.yaml:3:3: tools: duplicate entry: 1 is written twice",
            ),
            (
                "offsets:\n  2: {radius_mm: 5.0}\n  1: {}\n  2: {radius_mm: 5.0}\n",
                "tools.yaml:4:3: offsets: duplicate entry: 2 is written twice",
            ),
            (
                "tools:\n  1: {diameter_mm: 10.0, wear_diameter_mm: -20.0}\n",
                "tools.yaml:2: wear_diameter_mm of T1 is -20 mm, more than its diameter_mm of 10 mm",
            ),
            (
                "tools:\n  7:\n    nose_radius_mm: 0.4\n    wear_diameter_mm: -0.9\n",
                "tools.yaml:4: wear_diameter_mm of T7 is -0.9 mm, more than its nose_radius_mm",
            ),
            (
                "offsets:\n  1: {radius_mm: 5.0}\n  4: {radius_mm: -5.0, wear_mm: 6.0}\n",
                "tools.yaml:3: wear_mm of D4 is 6 mm, more than its radius_mm of -5 mm",
            ),
        ];
        for (text, place) in table {
            std::fs::write(&path, text).expect("written");
            let error = load_tool_table(&path).expect_err(text).to_string();
            assert!(error.contains(place), "{text}: {error}");
        }
    }

    #[test]
    fn what_is_not_in_the_form_of_a_tool_table_is_reported_with_that_form() {
        for (text, expected) in [
            (
                "G21 G90\nG41 X2 Y0\nM30\n",
                "t.yaml:1:1: not a tool table; it begins with `tools:` or `offsets:`",
            ),
            ("- 1\n", "t.yaml:1:1: not a tool table; it begins with `tools:` or `offsets:`"),
            (
                "tools: [10, 12]\n",
                "t.yaml:1:8: `tools` needs rows such as `1: {diameter_mm: 10.0}`",
            ),
            (
                "offsets:\n  - radius_mm: 5\n",
                "t.yaml:2:3: `offsets` needs rows such as `1: {radius_mm: 5.0}`",
            ),
            ("tools:\n  4: 10\n", "t.yaml:2:6: write T4 as `4: {diameter_mm: 10.0}`"),
            ("offsets:\n  12: 5\n", "t.yaml:2:7: write D12 as `12: {radius_mm: 5.0}`"),
        ] {
            let error = tool_table_from_yaml(text, "t.yaml").expect_err(text).to_string();
            assert_eq!(error, expected);
        }
    }

    #[test]
    fn wear_counts_alone_where_the_value_is_0_and_may_take_all_of_a_value() {
        for text in [
            "tools:\n  1: {wear_diameter_mm: -0.5}\n",
            "tools:\n  1: {diameter_mm: 10.0, wear_diameter_mm: -10.0}\n",
            // The corner radius of a mill.
            "tools:\n  1: {diameter_mm: 10.0, nose_radius_mm: 0.2, wear_diameter_mm: -0.5}\n",
            "offsets:\n  1: {wear_mm: -0.2}\n  2: {radius_mm: -0.2, wear_mm: -0.1}\n",
            "tools:\noffsets:\n",
        ] {
            tool_table_from_yaml(text, "tools.yaml").expect(text);
        }
    }
}
