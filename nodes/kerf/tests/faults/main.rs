//! What the driver does when something else fails, each row on a real pseudo-terminal:
//! what the machine was sent, what is reported, and how to continue.
//!
//! The nodes are processes, and so is the controller; the line between them is in the
//! hands of the test, and so is everybody's clock, disk and life.

#[path = "../support/cable.rs"]
#[allow(dead_code, reason = "each test program uses its part")]
mod cable;
#[path = "../support/commander.rs"]
#[allow(dead_code, reason = "each test program uses its part")]
mod commander;
#[path = "../support/controller.rs"]
mod controller;
#[path = "../support/machine.rs"]
#[allow(dead_code, reason = "each test program uses its part")]
mod machine;
#[path = "../support/port.rs"]
mod port;
#[path = "../support/mod.rs"]
mod support;
#[path = "../support/wire.rs"]
#[allow(dead_code, reason = "each test program uses its part")]
mod wire;

mod answers;
mod cell;
mod clock;
mod commander_lost;
mod controller_fails;
mod disk;
mod fleet_store;
mod lifecycle;
mod nodes;
mod restart;
mod ros_face;
mod tuning;
mod vanish;
