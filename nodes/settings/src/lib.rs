//! Profiles and tool tables: YAML with places, bounds and limits.
//!
//! What a control does is data: `config/controls/*.yaml`, each compiled in, or a file of the operator.
//! An error names file and line. No ROS: tests and benches read profiles here too.

mod documents;
mod profiles;
pub mod yaml;

pub use documents::{
    ToolTableFileError, load_tool_table, profile_from_yaml, profile_to_yaml, tool_table_from_yaml,
};
pub use profiles::{Control, ProfileError, load_foreign_profile, load_profile};
