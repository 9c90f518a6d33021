//! What every ROS node offers: parameters, lifecycle, log, health and the descriptions of its types.
//!
//! Uses all folders below it: `process`, `parameters`, `command_line`, `rustdds` and `endpoints`.
//! Belongs here: a topic or service that tools expect of a node, whatever the node does. Does not
//! belong here: the endpoints themselves, and what one node alone offers.

pub mod command_log;
pub(crate) mod diagnostics;
pub mod lifecycle;
mod log_throttle;
pub(crate) mod logger_services;
pub(crate) mod logging;
mod node_parameters;
pub(crate) mod parameter_services;
mod parameter_topic;
mod sim_time;
pub(crate) mod type_description;
