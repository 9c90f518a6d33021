//! The words in force, as `$G` reports them: `G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0`.

use super::number::{parse_number, parse_work_system};
use cnc_msgs::contour::SpindleMode;
use serde::{Deserialize, Serialize};

/// What the words in force say, where they say it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ModalWords {
    /// 1 to 6 for G54 to G59, 7 to 9 for G59.1 to G59.3.
    pub work_system: Option<u8>,
    /// G43, G43.1 or G43.2 instead of G49; grbl and FluidNC do not report it.
    pub has_tool_length: Option<bool>,
    pub spindle: Option<SpindleMode>,
    pub flood: bool,
    pub mist: bool,
    pub tool: Option<u32>,
    /// G93: F is a time and goes with its line.
    pub is_inverse_time: bool,
    /// G0 is the motion in force.
    pub is_rapid: bool,
    /// In the unit of reports.
    pub feed_per_min: Option<f64>,
    pub spindle_rpm: Option<f64>,
}

impl ModalWords {
    /// Reads what follows `GC:`; unknown words are skipped.
    pub fn read(words: &str) -> Self {
        let mut modal = Self::default();
        for word in words.split_ascii_whitespace() {
            modal.work_system = parse_work_system(word).or(modal.work_system);
            match word {
                "G49" => modal.has_tool_length = Some(false),
                "G43" | "G43.1" | "G43.2" => modal.has_tool_length = Some(true),
                "M3" => modal.spindle = Some(SpindleMode::Clockwise),
                "M4" => modal.spindle = Some(SpindleMode::CounterClockwise),
                "M5" => modal.spindle = Some(SpindleMode::Off),
                "G0" => modal.is_rapid = true,
                "G93" => modal.is_inverse_time = true,
                "M7" => modal.mist = true,
                "M8" => modal.flood = true,
                _ => match word.split_at_checked(1) {
                    Some(("T", number)) => modal.tool = number.parse().ok(),
                    Some(("F", number)) => modal.feed_per_min = parse_number(number),
                    Some(("S", number)) => modal.spindle_rpm = parse_number(number),
                    _ => {}
                },
            }
        }
        modal
    }
}
