//! Profiles, tool tables, machine files and keep-out boxes: YAML with places, bounds and limits.
//!
//! What a control does is data: `config/controls/*.yaml`, each compiled in, or a file of the operator.
//! An error names file and line. No ROS: tests and benches read profiles here too.

mod documents;
mod machine;
mod profiles;
pub mod yaml;

pub use documents::{
    ToolTableFileError, load_tool_table, profile_from_yaml, profile_to_yaml, tool_table_from_yaml,
};
pub use machine::{KeepOutFileError, MachineText, keep_out_from_yaml, load_keep_out};
pub use profiles::{Control, ProfileError, load_foreign_profile, load_profile};
