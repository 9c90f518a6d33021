//! What a controller reports about itself, as a file.
//!
//! `kerf controller dump` writes it, `kerf plan --machine` reads it. Settings have the numbers
//! and the units of the firmware; offsets are in millimetres, of A, B and C in degrees. What they
//! mean for a machine is the business of the driver.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Settings and stored offsets of one controller.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MachineFile {
    /// The family: grbl, grblHAL or FluidNC.
    pub firmware: String,
    /// In its own words.
    #[serde(default)]
    pub version: String,
    /// The letters of `[OPT:]`.
    #[serde(default)]
    pub options: String,
    /// Blocks of its planner, where it reports them.
    #[serde(default)]
    pub planner_blocks: Option<u16>,
    /// `$number=value`.
    #[serde(deserialize_with = "crate::unique::map")]
    pub settings: BTreeMap<u32, SettingValue>,
    /// `XYZA`: its axes in the order of the settings; empty: X, Y and Z.
    #[serde(default)]
    pub axes: String,
    /// G54 to G59.3, G28, G30, G92 and TLO, as `$#` reports them: X, Y and Z, or all axes.
    #[serde(default, deserialize_with = "crate::unique::map")]
    pub offsets_mm: BTreeMap<String, Vec<f64>>,
    /// Whether the axes can keep pace with the spindle (`SS` in `[NEWOPT:]` of grblHAL), where it is known.
    #[serde(default)]
    pub spindle_sync: Option<bool>,
    /// Digital inputs and outputs, then analog ones, as `[AUX IO:]` of grblHAL counts them, where it is known.
    #[serde(default)]
    pub aux_io: Option<[u8; 4]>,
}

/// The value of a setting. Some settings of grblHAL are words.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum SettingValue {
    Number(f64),
    Word(String),
}

impl SettingValue {
    /// As the firmware prints it, or near enough to be read again.
    pub fn text(&self) -> String {
        match self {
            Self::Number(value) => value.to_string(),
            Self::Word(word) => word.clone(),
        }
    }
}
