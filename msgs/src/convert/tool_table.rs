//! The tool table.

use super::WireError;
use crate::tool_table::{Offset, Tool, ToolTable, ToolTableError};
use crate::units::{m_from_mm, mm_from_m};
use crate::wire::cnc_msgs::msg as wire;

impl From<&ToolTable> for wire::ToolTable {
    fn from(table: &ToolTable) -> Self {
        Self {
            tools: table
                .tools
                .iter()
                .map(|(&number, tool)| wire::Tool {
                    number,
                    diameter: m_from_mm(tool.diameter_mm),
                    wear_diameter: m_from_mm(tool.wear_diameter_mm),
                    length: m_from_mm(tool.length_mm),
                    nose_radius: m_from_mm(tool.nose_radius_mm),
                    tip_direction: tool.tip_direction,
                })
                .collect(),
            offsets: table
                .offsets
                .iter()
                .map(|(&number, offset)| wire::ToolOffset {
                    number,
                    radius: m_from_mm(offset.radius_mm),
                    wear: m_from_mm(offset.wear_mm),
                    length: m_from_mm(offset.length_mm),
                    tip_direction: offset.tip_direction,
                })
                .collect(),
            ..Self::default()
        }
    }
}

impl TryFrom<&wire::ToolTable> for ToolTable {
    type Error = WireError;

    fn try_from(table: &wire::ToolTable) -> Result<Self, WireError> {
        let tools = table.tools.iter().map(|tool| {
            let row = Tool {
                diameter_mm: mm_from_m(tool.diameter),
                wear_diameter_mm: mm_from_m(tool.wear_diameter),
                length_mm: mm_from_m(tool.length),
                nose_radius_mm: mm_from_m(tool.nose_radius),
                tip_direction: tool.tip_direction,
            };
            (tool.number, row)
        });
        let offsets = table.offsets.iter().map(|offset| {
            let row = Offset {
                radius_mm: mm_from_m(offset.radius),
                wear_mm: mm_from_m(offset.wear),
                length_mm: mm_from_m(offset.length),
                tip_direction: offset.tip_direction,
            };
            (offset.number, row)
        });
        let mut checked = Self::default();
        for (number, row) in tools {
            if checked.tools.insert(number, row).is_some() {
                return Err(ToolTableError::Twice { row: format!("T{number}") }.into());
            }
        }
        for (number, row) in offsets {
            if checked.offsets.insert(number, row).is_some() {
                return Err(ToolTableError::Twice { row: format!("D{number}") }.into());
            }
        }
        checked.check()?;
        Ok(checked)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_that_is_there_twice_is_refused() {
        let tool = |number| wire::Tool { number, ..wire::Tool::default() };
        let offset = |number| wire::ToolOffset { number, ..wire::ToolOffset::default() };
        for (tools, offsets, says) in [
            (vec![tool(1), tool(2), tool(1)], vec![], Some("T1 is in the table twice")),
            (vec![], vec![offset(4), offset(4)], Some("D4 is in the table twice")),
            (vec![tool(1)], vec![offset(1)], None),
        ] {
            let table = wire::ToolTable { tools, offsets, ..wire::ToolTable::default() };
            let refusal = ToolTable::try_from(&table).err().map(|error| error.to_string());
            assert_eq!(refusal.is_some(), says.is_some(), "{refusal:?}");
            assert!(refusal.unwrap_or_default().contains(says.unwrap_or_default()));
        }
    }
}
