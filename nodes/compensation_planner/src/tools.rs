//! What users ask of a plan: a proof of its path, and what changes with another tool, another
//! start, a single block or the rest of a run.

pub mod mdi;
pub(crate) mod parts;
pub mod replan;
pub mod report;
pub(crate) mod restart;
pub mod set_tool;
#[cfg(feature = "node")]
pub mod tool_file;
pub mod verdict;
