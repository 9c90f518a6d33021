//! The shell all nodes share; the only crate that knows ros2-client.

pub mod action;
pub mod arguments;
mod cancel;
mod client;
pub mod environment;
mod graph;
pub mod names;
mod node;
mod parameter_file;
pub mod parameters;
mod publisher;
mod qos;
mod raw;
mod service;
mod subscription;
mod time;
mod wire;
mod yaml;

pub use cnc_msgs::interface;

pub use cancel::Shutdown;
pub use client::{ANSWER_WITHIN, CallError, Client, SERVER_WITHIN};
pub use graph::LOOPBACK_PARTICIPANTS_MAX;
pub use node::{Handle, NodeError, Session};
pub use publisher::Publisher;
pub use qos::Qos;
pub use raw::{DiscoveredPublisher, RawPublisher, RawSample, RawSubscription};
pub use service::RequestInfo;
pub use subscription::{SampleInfo, Subscription};
pub use time::RosTime;
pub use wire::{Gid, ServiceMapping};
pub use yaml::{FileError, from_yaml_file, from_yaml_str};
