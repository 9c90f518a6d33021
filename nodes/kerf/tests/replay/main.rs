//! `kerf replay` on bags that are not as they were recorded: of others, changed, broken.

#[path = "../support/bag.rs"]
mod bag;
mod chain;
mod damage;
mod differences;
mod foreign;
mod guards;
mod outputs;
mod pages;
#[path = "../support/mod.rs"]
mod support;
mod updates;

use std::path::Path;
use support::{Ran, kerf, run};

/// Replays a bag.
#[track_caller]
fn replay(bag: &Path, more: &[&str]) -> Ran {
    run(kerf().arg("replay").arg(bag).args(more))
}
