//! Topics and services over Zenoh, with the conventions of rmw_zenoh_cpp.
//!
//! Uses `process`, `command_line` and `samples`. Belongs here: what only
//! Zenoh has. `names`, `attachment` and `table` are pure. Does not belong here: messages, handlers
//! and calls (`endpoints`).

pub(crate) mod attachment;
pub(crate) mod client;
pub(crate) mod discovery;
pub(crate) mod error;
pub(crate) mod inbox;
pub(crate) mod link;
pub(crate) mod names;
pub(crate) mod node;
pub(crate) mod publisher;
pub(crate) mod router;
pub(crate) mod server;
pub(crate) mod session;
pub(crate) mod settings;
mod table;
