//! What sends and receives: the node's handle, topics, services, actions and their bytes.
//!
//! Uses `process`, `parameters`, `command_line`, `samples`, `rustdds` and `zenoh`, the last two behind
//! `middleware.rs`. Belongs here: what makes an endpoint or carries a message. Does not belong here: what an endpoint of ROS itself means
//! (`managed`), and how a participant joins a domain (`session.rs` at the top).

pub mod action;
pub mod chunks;
pub(crate) mod client;
pub(crate) mod dds;
pub(crate) mod error;
pub(crate) mod graph;
pub(crate) mod middleware;
pub(crate) mod node;
mod other_middleware;
pub(crate) mod publisher;
pub(crate) mod qos;
pub(crate) mod raw;
mod requests;
pub(crate) mod service;
pub(crate) mod subscription;
mod tasks;
pub(crate) mod warning_rate_limit;
pub(crate) mod wire;
