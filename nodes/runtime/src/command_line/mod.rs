//! What a node reads before it starts: arguments, environment variables and files.
//!
//! Uses `process` and `parameters`. Belongs here: how `--ros-args`, `ROS_*` and `RMW_*` variables,
//! parameter files and keystores are read, and the [`configuration`] that they add up to, so that
//! every error is reported before the node appears. Does not belong here: what starts, sends or
//! logs.

pub mod arguments;
pub mod configuration;
pub mod environment;
pub(crate) mod log_levels;
pub mod names;
mod parameter_file;
pub mod security;
pub mod stack_parameters;
pub mod zenoh_settings;
