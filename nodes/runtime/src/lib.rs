//! The shell all nodes share; the only crate that knows ros2-client.

pub mod action;
mod cancel;
mod client;
pub mod environment;
mod graph;
pub mod names;
mod node;
mod publisher;
mod qos;
mod service;
mod subscription;
mod time;
mod wire;

pub use cnc_msgs::interface;

pub use cancel::Shutdown;
pub use client::{ANSWER_WITHIN, CallError, Client, SERVER_WITHIN};
pub use graph::LOOPBACK_PARTICIPANTS_MAX;
pub use node::{Handle, NodeError, Session};
pub use publisher::Publisher;
pub use qos::Qos;
pub use service::RequestInfo;
pub use subscription::{SampleInfo, Subscription};
pub use time::RosTime;
pub use wire::{Gid, ServiceMapping};
