//! The tool table: what is in the spindle and in the offset registers.
//!
//! The YAML form is in millimetres. A table that was read has each number once,
//! only finite values, no negative diameter, and no wear that turns the side.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Tools by T number and offset registers by D number.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ToolTable {
    #[serde(deserialize_with = "crate::unique::map")]
    pub tools: BTreeMap<u32, Tool>,
    /// For controls that have D registers; a D without an entry means the tool of that number.
    #[serde(deserialize_with = "crate::unique::map")]
    pub offsets: BTreeMap<u32, Offset>,
}

/// One tool.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Tool {
    /// Nominal diameter, never negative.
    pub diameter_mm: f64,
    /// Added to the diameter: negative for a worn tool.
    pub wear_diameter_mm: f64,
    pub length_mm: f64,
    /// Of a turning tool.
    pub nose_radius_mm: f64,
    /// Of a turning tool, 0 to 9.
    pub tip_direction: u8,
}

/// One offset register.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Offset {
    /// May be negative: the side flips.
    pub radius_mm: f64,
    /// Added to the radius.
    pub wear_mm: f64,
    pub length_mm: f64,
    /// Of a turning tool, 0 to 9.
    pub tip_direction: u8,
}

/// A tool table that no machine could have.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ToolTableError {
    #[error("{what} of {row} is {value}, not a finite number")]
    NotFinite { row: String, what: &'static str, value: f64 },
    #[error(
        "diameter of T{tool} is {value_mm} mm; a diameter is never negative (put undersize into wear_diameter_mm)"
    )]
    NegativeDiameter { tool: u32, value_mm: f64 },
    #[error("nose radius of T{tool} is {value_mm} mm; a nose radius is never negative")]
    NegativeNoseRadius { tool: u32, value_mm: f64 },
    #[error("tip direction of {row} is {value}; it must be 0 to 9")]
    TipDirection { row: String, value: u8 },
    #[error("{what} of {row} is {value_mm} mm; at most {max_mm} mm is accepted")]
    TooLarge { row: String, what: &'static str, value_mm: f64, max_mm: f64 },
    #[error("{row} is in the table twice; leave out one of them")]
    Twice { row: String },
    #[error(
        "{wear} of {row} is {wear_mm} mm, more than its {what} of {value_mm} mm; wear alone never \
         changes the side"
    )]
    WearTurnsSide {
        row: String,
        what: &'static str,
        value_mm: f64,
        wear: &'static str,
        wear_mm: f64,
    },
}

/// No tool is larger than this, mm; a larger number is a mistake of units.
pub const SIZE_MM_MAX: f64 = 1e4;

/// Whether wear takes off more than the value, and so turns the side.
///
/// A value of 0 has no side: there wear alone is the difference to the tool
/// that a program was made for, and may be negative (M10).
pub fn wear_turns_side(value_mm: f64, wear_mm: f64) -> bool {
    value_mm * (value_mm + wear_mm) < 0.0
}

impl ToolTable {
    /// Checks every row, the first fault first.
    pub fn check(&self) -> Result<(), ToolTableError> {
        for (&number, tool) in &self.tools {
            let row = || format!("T{number}");
            check_numbers(
                row,
                &[
                    ("diameter_mm", tool.diameter_mm),
                    ("wear_diameter_mm", tool.wear_diameter_mm),
                    ("length_mm", tool.length_mm),
                    ("nose_radius_mm", tool.nose_radius_mm),
                ],
                tool.tip_direction,
            )?;
            if tool.diameter_mm < 0.0 {
                return Err(ToolTableError::NegativeDiameter {
                    tool: number,
                    value_mm: tool.diameter_mm,
                });
            }
            if tool.nose_radius_mm < 0.0 {
                return Err(ToolTableError::NegativeNoseRadius {
                    tool: number,
                    value_mm: tool.nose_radius_mm,
                });
            }
            // The corner radius of a mill has no wear of its own.
            let (what, value_mm, wear_mm) = match tool.diameter_mm {
                0.0 => ("nose_radius_mm", tool.nose_radius_mm, tool.wear_diameter_mm / 2.0),
                diameter_mm => ("diameter_mm", diameter_mm, tool.wear_diameter_mm),
            };
            if wear_turns_side(value_mm, wear_mm) {
                return Err(ToolTableError::WearTurnsSide {
                    row: row(),
                    what,
                    value_mm,
                    wear: "wear_diameter_mm",
                    wear_mm: tool.wear_diameter_mm,
                });
            }
        }
        for (&number, offset) in &self.offsets {
            check_numbers(
                || format!("D{number}"),
                &[
                    ("radius_mm", offset.radius_mm),
                    ("wear_mm", offset.wear_mm),
                    ("length_mm", offset.length_mm),
                ],
                offset.tip_direction,
            )?;
            if wear_turns_side(offset.radius_mm, offset.wear_mm) {
                return Err(ToolTableError::WearTurnsSide {
                    row: format!("D{number}"),
                    what: "radius_mm",
                    value_mm: offset.radius_mm,
                    wear: "wear_mm",
                    wear_mm: offset.wear_mm,
                });
            }
        }
        Ok(())
    }
}

fn check_numbers(
    row: impl Fn() -> String,
    values: &[(&'static str, f64)],
    tip_direction: u8,
) -> Result<(), ToolTableError> {
    for &(what, value) in values {
        if !value.is_finite() {
            return Err(ToolTableError::NotFinite { row: row(), what, value });
        }
        if value.abs() > SIZE_MM_MAX {
            return Err(ToolTableError::TooLarge {
                row: row(),
                what,
                value_mm: value,
                max_mm: SIZE_MM_MAX,
            });
        }
    }
    if tip_direction > 9 {
        return Err(ToolTableError::TipDirection { row: row(), value: tip_direction });
    }
    Ok(())
}
