//! The parameters of the driver, its timeouts and its tolerances.

use super::commander::OnCommanderLoss;
use super::limits::CheckTravel;
use super::path_deviation::OnPathDeviation;
use super::ros_loss::OnRosLoss;
use crate::encoder::EncoderConfig;
use crate::link::LinkConfig;
use cnc_msgs::keep_out::KeepOut;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// The parameters of a driver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DriverConfig {
    /// Bits per second, of a serial line.
    pub baud: u32,
    /// Whether bytes travel over a network all the way to the board: no baud rate bounds what is
    /// under way, and a session that is opened restarts nothing.
    #[serde(default)]
    pub is_networked: bool,
    /// The longest that a feed hold may wait for what is already under way, ms.
    pub hold_latency_ms_max: u32,
    /// The size of the controller's receive buffer, bytes; the reported size counts if it is
    /// less.
    pub receive_buffer_bytes: Option<u16>,
    /// Time between two status requests, ms.
    pub poll_interval_ms: u32,
    /// The same while lines are under way, ms; 0: the same.
    #[serde(default)]
    pub busy_poll_interval_ms: u32,
    /// Time between two checks among the lines of a run, ms; 0: there are none.
    #[serde(default)]
    pub line_check_interval_ms: u32,
    /// Whether a controller that stands still is reset when the port is opened.
    pub reset_on_connect: bool,
    /// What may be sent. The controller reports `has_mist`.
    pub encoder: EncoderConfig,
    /// The longest that homing may take, s.
    pub homing_s_max: u32,
    /// Whether a run that is only checked goes through the controller's own check mode,
    /// which reads every line and ends in a reset, instead of being encoded alone.
    #[serde(default)]
    pub check_in_controller: bool,
    /// Whether a run begins only when a recorder has opened its bag, and holds when that bag
    /// misses something.
    #[serde(default)]
    pub require_recording: bool,
    /// Whether the tool is brought back to where the run stopped when a tool change is
    /// confirmed somewhere else; else the confirmation is refused.
    #[serde(default)]
    pub tool_change_return: bool,
    /// The longest that a function of the user may take, s; 0: none is called.
    #[serde(default)]
    pub user_function_s_max: u32,
    /// What is done when a commander's signs of life stay away during a run.
    #[serde(default)]
    pub on_commander_loss: OnCommanderLoss,
    /// After this long a commander that gave signs of life counts as lost, ms.
    #[serde(default = "commander_timeout_ms")]
    pub commander_timeout_ms: u32,
    /// How many times faster than their settings say the axes are taken to be able to move: with
    /// some kinematics the settings bound the motors, and a virtual machine may live faster than
    /// the clock.
    #[serde(default = "rate_margin")]
    pub rate_margin: f64,
    /// What is done while the driver cannot be reached over ROS.
    #[serde(default)]
    pub on_ros_loss: OnRosLoss,
    /// After this long without ROS the machine holds, where that is wanted, ms.
    #[serde(default = "ros_loss_timeout_ms")]
    pub ros_loss_timeout_ms: u32,
    /// What is done when the machine is not where the lines that were sent can have taken it.
    #[serde(default)]
    pub on_path_deviation: OnPathDeviation,
    /// What is done when a program leaves the travel of the machine.
    #[serde(default)]
    pub check_travel: CheckTravel,
    /// What the tool must not touch.
    #[serde(default, skip_serializing_if = "has_no_boxes")]
    pub keep_out: KeepOut,
}

fn has_no_boxes(keep_out: &KeepOut) -> bool {
    keep_out.keep_out.is_empty()
}

const fn rate_margin() -> f64 {
    5.0
}

const fn ros_loss_timeout_ms() -> u32 {
    5_000
}

const fn commander_timeout_ms() -> u32 {
    1_000
}

impl Default for DriverConfig {
    fn default() -> Self {
        Self {
            baud: 115_200,
            is_networked: false,
            hold_latency_ms_max: 20,
            receive_buffer_bytes: None,
            poll_interval_ms: 200,
            busy_poll_interval_ms: 50,
            line_check_interval_ms: 500,
            reset_on_connect: true,
            encoder: EncoderConfig::default(),
            homing_s_max: 180,
            check_in_controller: false,
            require_recording: false,
            tool_change_return: false,
            user_function_s_max: 60,
            on_commander_loss: OnCommanderLoss::default(),
            commander_timeout_ms: commander_timeout_ms(),
            rate_margin: rate_margin(),
            on_ros_loss: OnRosLoss::default(),
            ros_loss_timeout_ms: ros_loss_timeout_ms(),
            on_path_deviation: OnPathDeviation::Hold,
            check_travel: CheckTravel::Refuse,
            keep_out: KeepOut::default(),
        }
    }
}

impl DriverConfig {
    pub(in crate::driver) fn link(&self) -> LinkConfig {
        LinkConfig {
            baud: if self.is_networked { NETWORK_BITS_PER_SECOND } else { self.baud },
            hold_latency_ms_max: self.hold_latency_ms_max,
            receive_buffer_bytes: self.receive_buffer_bytes,
            poll_interval_ms: self.poll_interval_ms,
            busy_poll_interval_ms: self.busy_poll_interval_ms,
            line_check_interval_ms: self.line_check_interval_ms,
            watches_path: self.on_path_deviation != OnPathDeviation::Off,
        }
    }
}

/// What the slowest network of a board carries, a busy Wi-Fi. Its receive buffer is what bounds the
/// bytes under way then: a board is expected to take real-time bytes out as they arrive. That was
/// not measured on one.
const NETWORK_BITS_PER_SECOND: u32 = 2_000_000;

/// How far the tool may be from where the run stopped for a tool change, mm: steps, and
/// three decimals.
pub(in crate::driver) const RETURN_TOLERANCE_MM: f64 = 0.02;
/// How far the tool may be from where a path begins, mm.
pub(in crate::driver) const START_TOLERANCE_MM: f64 = 0.01;
/// A board that was reset by opening the port has said something by then.
pub(in crate::driver) const LISTEN: Duration = Duration::from_millis(2500);
/// From a reset to the banner, and from a short question to its answer.
pub(in crate::driver) const ANSWER: Duration = Duration::from_millis(2000);
/// From the end of a stretch to the answer of the loader, and from there to the plan of the next one.
pub(in crate::driver) const PLANNED: Duration = Duration::from_secs(60);
/// From the acceptance of a run to the message of the recorder that it records.
pub(in crate::driver) const RECORDER: Duration = Duration::from_secs(5);
/// An answer that came too early, in the place of that of the last dwell, has shown
/// itself by then: the dwell takes a fifth of it.
pub(in crate::driver) const SETTLED: Duration = Duration::from_millis(50);
/// A line that was on its way when the controller restarted is answered by then.
pub(in crate::driver) const CROSSING: Duration = Duration::from_millis(300);
/// From a feed hold to standstill.
pub(in crate::driver) const STANDSTILL: Duration = Duration::from_secs(10);
/// From the first words of a run to a work position.
pub(in crate::driver) const WORK_POSITION: Duration = Duration::from_secs(5);
/// Reports in which a hold must show before it is sent again.
pub(in crate::driver) const REPORTS_PER_HOLD: u32 = 2;
/// How often a hold is sent again.
pub(in crate::driver) const HOLDS_MAX: u32 = 5;
/// Lines that are proven in one go, so that nothing else waits long.
pub(in crate::driver) const LINES_PER_SLICE: usize = 1_000;
