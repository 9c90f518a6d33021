//! The shell all nodes share; the only crate that knows ros2-client.

pub mod action;
pub mod arguments;
mod cancel;
mod client;
pub mod configuration;
mod diagnostics;
pub mod environment;
mod graph;
mod logging;
pub mod names;
mod node;
mod parameter_file;
mod parameter_services;
pub mod parameters;
mod profiles;
mod publisher;
mod qos;
mod raw;
mod run;
mod service;
mod subscription;
mod time;
mod wire;
mod yaml;

pub use cnc_msgs::interface;

pub use cancel::Shutdown;
pub use client::{ANSWER_WITHIN, CallError, Client, SERVER_WITHIN};
pub use diagnostics::{Health, HealthLevel};
pub use graph::LOOPBACK_PARTICIPANTS_MAX;
pub use logging::LogSettings;
pub use node::{Handle, NodeError, Session};
pub use profiles::{ProfileError, known_profiles, load_profile};
pub use publisher::Publisher;
pub use qos::Qos;
pub use raw::{DiscoveredPublisher, RawPublisher, RawSample, RawSubscription};
pub use run::{run, run_with};
pub use service::RequestInfo;
pub use subscription::{SampleInfo, Subscription};
pub use time::RosTime;
pub use wire::{Gid, ServiceMapping};
pub use yaml::{FileError, from_yaml_file, from_yaml_str};
