//! What is wrong with the way of the tool along a span, and what it is good for.
//!
//! `reach` says what the tool does not fit into, `walls` what bounds it (`meeting`: where the
//! contour meets itself; `copies`: what it cuts more than once), `interference` where it cuts into
//! that, `lead` what the leads do. `trim` leaves out what does not fit, and `uncut` says what that
//! leaves; `certificate` finds the radii that would do. `finding` puts it into words.
//! Nothing is put out here.

pub(crate) mod certificate;
pub(crate) mod finding;
pub(crate) mod interference;
pub(crate) mod lead;
pub(crate) mod reach;
mod retraced_runs;
mod self_meeting;
pub(crate) mod trim;
pub(crate) mod uncut;
pub(crate) mod walls;
