//! What peers can do to a machine: storms, garbage, lies, and dying at the wrong moment.
//!
//! The nodes are processes on the loopback interface; the peers are nodes of this process,
//! or processes of this test program that are stopped and killed.

#[path = "../support/commander.rs"]
#[allow(dead_code, reason = "each test program uses its part")]
mod commander;
#[path = "../support/machine.rs"]
#[allow(dead_code, reason = "each test program uses its part")]
mod machine;
#[path = "../support/mod.rs"]
mod support;

mod files;
mod hanging;
mod loader;
mod planner;
mod storms;
mod stranger;
