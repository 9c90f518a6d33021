//! The driver's configuration as the parameters of its node give it.

use super::commander::OnCommanderLoss;
use super::config::DriverConfig;
use super::limits::CheckTravel;
use super::path_deviation::OnPathDeviation;
use super::ros_loss::OnRosLoss;
use crate::address::is_networked;
use crate::encoder::EncoderConfig;
use cnc_msgs::parameter::ParameterValue;

impl DriverConfig {
    /// The driver's configuration, from parameters wherever they come from.
    ///
    /// `get` is asked for parameters that the node declares; a value that does not fit its type leaves
    /// the default.
    pub fn from_parameters(get: impl Fn(&str) -> ParameterValue) -> Self {
        let default = Self::default();
        let integer = |name: &str, default: u32| match get(name) {
            ParameterValue::Integer(value) => u32::try_from(value).unwrap_or(default),
            _ => default,
        };
        let double = |name: &str, default: f64| match get(name) {
            ParameterValue::Double(value) => value,
            _ => default,
        };
        let bool = |name: &str, default: bool| match get(name) {
            ParameterValue::Bool(value) => value,
            _ => default,
        };
        Self {
            baud: integer("baud", default.baud),
            is_networked: matches!(
                get("port"), ParameterValue::String(port) if is_networked(&port)
            ),
            hold_latency_ms_max: integer("hold_latency_ms_max", default.hold_latency_ms_max),
            receive_buffer_bytes: match integer("receive_buffer_bytes", 0) {
                0 => None,
                bytes => Some(u16::try_from(bytes).unwrap_or(u16::MAX)),
            },
            poll_interval_ms: integer("poll_interval_ms", default.poll_interval_ms),
            // A node of before, whose parameters are in a bag, had neither.
            busy_poll_interval_ms: integer("busy_poll_interval_ms", 0),
            line_check_interval_ms: integer("line_check_interval_ms", 0),
            reset_on_connect: bool("reset_on_connect", default.reset_on_connect),
            homing_s_max: integer("homing_s_max", default.homing_s_max),
            check_in_controller: bool("check_in_controller", default.check_in_controller),
            require_recording: bool("require_recording", default.require_recording),
            tool_change_return: bool("tool_change_return", default.tool_change_return),
            // A node of before, whose parameters are in a bag, called none.
            user_function_s_max: integer("user_function_s_max", 0),
            on_commander_loss: word(&get("on_commander_loss"), &OnCommanderLoss::WORDS)
                .unwrap_or(default.on_commander_loss),
            commander_timeout_ms: integer("commander_timeout_ms", default.commander_timeout_ms),
            rate_margin: double("rate_margin", default.rate_margin),
            on_ros_loss: word(&get("on_ros_loss"), &OnRosLoss::WORDS)
                .unwrap_or(default.on_ros_loss),
            ros_loss_timeout_ms: integer("ros_loss_timeout_ms", default.ros_loss_timeout_ms),
            on_path_deviation: match get("on_path_deviation") {
                it @ ParameterValue::String(_) => {
                    word(&it, &OnPathDeviation::WORDS).unwrap_or(default.on_path_deviation)
                }
                // A node of before, whose parameters are in a bag, had no watch.
                _ => OnPathDeviation::Off,
            },
            check_travel: match get("check_travel") {
                it @ ParameterValue::String(_) => {
                    word(&it, &CheckTravel::WORDS).unwrap_or(default.check_travel)
                }
                // A node of before, whose parameters are in a bag, had no check.
                _ => CheckTravel::Off,
            },
            // The boxes are in a file; who starts the driver reads it.
            keep_out: default.keep_out,
            encoder: EncoderConfig {
                position_mm_max: double("position_mm_max", default.encoder.position_mm_max),
                feed_mm_per_min_max: double(
                    "feed_mm_per_min_max",
                    default.encoder.feed_mm_per_min_max,
                ),
                optional_stop: bool("optional_stop", default.encoder.optional_stop),
                line_numbers: bool("line_numbers", default.encoder.line_numbers),
                controller_changes_tools: matches!(
                    get("tool_change"),
                    ParameterValue::String(word) if word == "controller"
                ),
                approach_z_mm: match (get("approach"), get("approach_z_mm")) {
                    (ParameterValue::String(word), ParameterValue::Double(height_mm))
                        if word == "lift" =>
                    {
                        Some(height_mm)
                    }
                    _ => None,
                },
                ..default.encoder
            },
        }
    }
}

/// What a word stands for; `None` for another word, or none.
fn word<T: Copy>(value: &ParameterValue, words: &[(&str, T)]) -> Option<T> {
    let ParameterValue::String(word) = value else { return None };
    words.iter().find(|(name, _)| name == word).map(|(_, means)| *means)
}
