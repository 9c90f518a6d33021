//! Parameters as values: how they are declared, checked, set and watched.
//!
//! Uses `process` alone. Belongs here: types, ranges, defaults and the values of a running node.
//! Does not belong here: how files and arguments spell a value (`command_line`) and the services
//! by which other nodes read and set it (`managed`).

pub(crate) mod common;
mod declared;
pub(crate) mod live;
mod values;

pub use cnc_msgs::parameter::ParameterValue;
pub use common::USE_SIM_TIME;
pub use declared::{Declared, Range};
pub use values::{Origin, Override, ParameterError, Parameters};
