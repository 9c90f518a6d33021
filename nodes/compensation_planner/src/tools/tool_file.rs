//! Changes one row of a tool file, and keeps everything else as its owner wrote it.
//!
//! Text in, text out. `yaml-edit` finds the row in any style and leaves all other characters alone
//! (docs/decisions/tool-file-editing.md). The caller reads the result again before it writes the
//! file. If that is not the intended table, only [`whole`] is left.

use crate::tools::set_tool::{ToolTableChange, ToolTableRow};
use cnc_msgs::tool_table::ToolTable;
use std::fmt::Write as _;
use yaml_edit::{Mapping, YamlFile};

/// The text with the changed row. `None` if the row has no place in it, or a comment would be lost.
pub fn edited(text: &str, change: &ToolTableChange) -> Option<String> {
    let (section, number) = match change.row {
        ToolTableRow::Tool(number) => ("tools", number),
        ToolTableRow::Offset(number) => ("offsets", number),
    };
    let file: YamlFile = text.parse().ok()?;
    let root = file.document()?.as_mapping()?;
    if let Some(rows) = root.get_mapping(section) {
        match rows.get_mapping(number) {
            Some(row) => set_values(&row, change),
            None => rows.set(number, new_row(change)),
        }
    } else {
        let rows = Mapping::new();
        rows.set(number, new_row(change));
        root.set(section, rows);
    }
    let edited = file.to_string();
    let comments = |text: &str| text.matches('#').count();
    (comments(&edited) == comments(text)).then_some(edited)
}

/// `{key: value, ...}`
fn new_row(change: &ToolTableChange) -> Mapping {
    let row = Mapping::new_flow();
    set_values(&row, change);
    row
}

fn set_values(row: &Mapping, change: &ToolTableChange) {
    for &(key, value) in &change.values {
        if key == "tip_direction" {
            // A whole number; all else has a point.
            row.set(key, value as u32);
        } else {
            row.set(key, value);
        }
    }
}

/// A table as a new file.
pub fn whole(tools: &ToolTable) -> String {
    let mut text =
        String::from("# Written by the planner: set_tool has changed it, millimetres.\n");
    let writes = "a text takes everything";
    text += "tools:\n";
    for (number, tool) in &tools.tools {
        writeln!(
            text,
            "  {number}: {{diameter_mm: {:?}, wear_diameter_mm: {:?}, length_mm: {:?}, nose_radius_mm: {:?}, tip_direction: {}}}",
            tool.diameter_mm, tool.wear_diameter_mm, tool.length_mm, tool.nose_radius_mm, tool.tip_direction
        )
        .expect(writes);
    }
    if tools.tools.is_empty() {
        text = text.replace("tools:\n", "tools: {}\n");
    }
    text += "offsets:";
    text += if tools.offsets.is_empty() { " {}\n" } else { "\n" };
    for (number, offset) in &tools.offsets {
        writeln!(
            text,
            "  {number}: {{radius_mm: {:?}, wear_mm: {:?}, length_mm: {:?}, tip_direction: {}}}",
            offset.radius_mm, offset.wear_mm, offset.length_mm, offset.tip_direction
        )
        .expect(writes);
    }
    text
}
