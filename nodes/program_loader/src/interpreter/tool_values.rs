//! `#5401` to `#5413`: the tool in the spindle, as the program or the tool table has it.
//!
//! The table is the planner's; its rows come with the text of a program that reads them.

use super::Interpreter;
use super::compensation::TIPS;
use super::tool_lengths::Length;
use crate::expression::Trouble;
use crate::tool_rows::{ToolRow, ToolRows};

impl Interpreter<'_> {
    /// Takes the rows of the tool table.
    pub(crate) fn take_tools(&mut self, rows: Option<ToolRows>) {
        self.tool_rows = rows;
    }

    /// Whether a row of the tool table was read, or missed.
    pub(crate) fn has_read_tools(&self) -> bool {
        self.has_read_tools.get()
    }

    /// Whether a row was read from a table that is not here.
    #[inline]
    pub(crate) fn misses_tools(&self) -> bool {
        self.has_read_tools.get() && self.tool_rows.is_none()
    }

    /// Lengths in millimetres; the table has them along Z only, and no angles.
    pub(super) fn tool_value(&self, number: u32) -> Result<f64, Trouble> {
        let unknown = || Trouble::NotHere {
            what: "a value of the tool in the spindle, which is known only after M6".to_owned(),
        };
        let tool = self.modal.spindle_tool.ok_or_else(unknown)?;
        match number {
            _ if tool == 0 => Ok(0.0),
            5403 => {
                let length = self.length_of(tool);
                self.length_mm(length)
            }
            5410 => match self.tool_entries.get(&tool).and_then(|entry| entry.radius_mm) {
                Some(radius_mm) => Ok(2.0 * radius_mm),
                None => Ok(self.tool_row(tool)?.diameter_mm),
            },
            5413 => {
                let tip = self.tool_row(tool)?.tip_direction;
                // The other way round of the table it is the same.
                Ok(f64::from(TIPS.iter().position(|it| *it == tip).unwrap_or(0) as u8))
            }
            _ => Ok(0.0),
        }
    }

    /// A length offset in millimetres.
    fn length_mm(&self, length: Length) -> Result<f64, Trouble> {
        let tools = [length.tool, length.second].into_iter().flatten();
        let rows: Result<Vec<_>, _> = tools.map(|tool| self.tool_row(tool)).collect();
        Ok(rows?.iter().map(|row| row.length_mm).sum::<f64>() + length.added_mm)
    }

    /// Where Z is in the work system, mm, if no more than the tool length has changed since it was known.
    pub(super) fn z_by_length(&self) -> Option<Result<f64, Trouble>> {
        let mm = |length: Option<Length>| length.map_or(Ok(0.0), |length| self.length_mm(length));
        let before = self.axes.counted_with()?;
        let longer_mm = mm(self.modal.length).and_then(|now| Ok(now - mm(before)?));
        Some(longer_mm.map(|longer_mm| self.axes.position[2] - longer_mm))
    }

    fn tool_row(&self, tool: u32) -> Result<ToolRow, Trouble> {
        self.has_read_tools.set(true);
        let Some(rows) = &self.tool_rows else {
            let what = "a value of the tool table, which is not here".to_owned();
            return Err(Trouble::NotHere { what });
        };
        rows.get(&tool).copied().ok_or(Trouble::NoTool { tool })
    }
}
