//! Programmed contour and tool table to compensated path.
//!
//! [`judge`] is the whole interface: a contour, the rules of a control and the
//! tools go in; the path of the tool centre, proved by [`path_audit`], or the reasons against it
//! come out.
//! It does not read programs.
//!
//! Folders are layers, and each imports only those before it:
//!
//! - `geometry`: lines, arcs and the plane; it knows no span and no profile.
//! - `span`: what lies between a lead-on and the next lead-off, as runs whose offsets are joined.
//! - `check`: what the tool does not fit into, and where it cuts; it puts nothing out.
//! - `walk`: reads the events once, applies the rules of the control and writes the path.
//! - `tools`: what is asked of a plan: a verdict, a new tool, a start in the middle.
//! - `node`: the shell.

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
pub use tools::restart::{NoStart, Start, start};
pub use tools::verdict::{Verdict, judge};
pub use tools::{mdi, replan, set_tool, tool_file, verdict};
pub use walk::plan::{
    Alone, Plan, Planning, SpanSummary, Workers, plan, plan_certified, plan_with,
};
