//! Turns a programmed contour and a tool table into a compensated path.
//!
//! [`judge`] is the whole interface. In: a contour, the rules of a control and the tools. Out: the
//! path of the tool centre, proved by [`path_audit`], or the reasons why there is none. This crate
//! does not read programs.
//!
//! Folders are layers, and each imports only those before it:
//!
//! - `geometry`: lines and arcs in the plane.
//! - `span`: what lies between a lead-on and the next lead-off, as runs with joined offsets.
//! - `check`: what the tool does not fit into, and where it cuts.
//! - `walk`: reads the events once, applies the rules of the control and writes the path.
//! - `tools`: what users ask of a plan: a verdict, another tool, a start in the middle.
//! - `node`: the ROS shell.

mod check;
mod geometry;
#[cfg(feature = "node")]
pub mod node;
mod span;
mod tools;
mod walk;

pub use check::certificate::{Certificate, CertificateLimit};
pub use check::uncut::{OutlinePiece, UncutRegion};
pub use geometry::tessellate;
pub use tools::parts::{ContourPart, PartCutter, PartPlanner, PartProof};
pub use tools::restart::{NoStart, Start, start};
#[cfg(feature = "node")]
pub use tools::tool_file;
pub use tools::verdict::{Verdict, judge};
pub use tools::{mdi, replan, report, set_tool, verdict};
pub use walk::plan::{
    Alone, Plan, Planning, SpanSummary, Workers, certificates, plan, plan_certified, plan_with,
};
