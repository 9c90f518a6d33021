//! Hosts of their own, with networks of their own: what leaves a host, what comes in, and a
//! machine that is spread over two.
//!
//! A host is a network namespace, which needs the rights of root. Where the system refuses
//! that, these tests say so and prove nothing.

#[path = "../support/cable.rs"]
#[allow(dead_code, reason = "each test program uses its part")]
mod cable;
#[path = "../support/mod.rs"]
mod support;

mod alone;
mod board;
mod commander;
mod network;
mod two_hosts;
