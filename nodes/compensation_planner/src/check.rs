//! Finds what is wrong with the path of the tool along a span, and the radii that would do.
//!
//! `reach` finds what the tool does not fit into, `walls` what bounds it (`self_meeting`: where the
//! contour meets itself, `retraced_runs`: what it cuts more than once), `interference` where the
//! tool cuts into that, and `lead` the same for leads. `trim` leaves out what does not fit, and
//! `uncut` outlines what that leaves. `certificate` finds the valid radii. `finding` puts it all
//! into words.
//!
//! Nothing here writes a path.

pub(crate) mod certificate;
pub(crate) mod finding;
pub(crate) mod interference;
pub(crate) mod lead;
pub(crate) mod reach;
mod repeated_passes;
mod retraced_runs;
mod self_meeting;
pub(crate) mod trim;
pub(crate) mod uncut;
pub(crate) mod walls;
