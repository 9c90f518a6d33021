//! An independent check of cutter radius compensation.
//!
//! [`draw`] makes programs for the shipped profiles and writes down what they mean while it
//! writes them. [`product`] lets the loader and the planner judge them. [`judge`](mod@judge)
//! decides whether that verdict is right, with the geometry of [`piece`] and nothing else: no
//! cut without a finding, no refusal of what fits.

pub mod draw;
pub mod fit;
pub mod judge;
pub mod piece;
pub mod program;
pub mod random;
pub mod tally;

use crate::judge::ProductResult;
use crate::program::{CONTROLS, Program};
use cnc_msgs::profile::Profile;
use compensation_planner::Planning;
use program_loader::{LoadOptions, load};
use settings::Control;

/// The shipped profiles, in the order of [`CONTROLS`].
///
/// # Panics
/// One of them cannot be read.
pub fn profiles() -> Vec<Profile> {
    let read = |control: Control| control.profile().expect("a shipped profile");
    CONTROLS.into_iter().map(read).collect()
}

/// What loader and planner say of a program.
///
/// # Panics
/// There is no profile for its control.
pub fn product(program: &Program, profiles: &[Profile]) -> ProductResult {
    let profile = profiles.iter().find(|profile| profile.name == program.control.name());
    let profile = profile.expect("a profile for each control");
    let loaded = load(program.text.as_bytes(), profile, &LoadOptions::default());
    if !loaded.is_accepted() {
        return ProductResult {
            findings: loaded.findings,
            is_unread: true,
            ..ProductResult::default()
        };
    }
    let judged =
        compensation_planner::judge(&loaded.contour, profile, &program.tools, Planning::default());
    let plan = judged.plan;
    ProductResult {
        path: plan.path,
        findings: plan.findings,
        refused: plan.refused,
        is_unread: false,
    }
}
