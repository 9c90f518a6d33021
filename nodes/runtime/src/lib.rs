//! The shell all nodes share; the only crate that knows ros2-client, RustDDS and Zenoh.
//!
//! A node is one process with one participant. [`run`] reads arguments,
//! environment and parameter files, starts the node, logs to the console and
//! `/rosout`, and takes everything down in order on SIGINT or SIGTERM. Between
//! that, the node's own function has a [`Handle`], which makes the endpoints.
//!
//! The folders, each using only those before it: `process`, `parameters`, `command_line`, `samples`,
//! `rustdds`, `zenoh`, `endpoints`, `managed`. The first lines of each say what belongs there. The files
//! next to them use all folders: `session` joins a domain, `run` is a node from start to end.
//!
//! What holds everywhere:
//!
//! - Publishing returns at once. A sample that the transport cannot take is dropped and
//!   counted; the count is reported with a rate limit.
//! - Nothing longer than 16 MiB is sent, not even on request.
//! - A sample of another type than the topic's is counted, reported once per
//!   sender, and skipped. No input from outside makes a node panic.
//! - Every call has a deadline, and distinguishes "no server" from "no answer".
//! - A thread that panics ends the process, with its place in the log.
//! - A node exits at once, with a reason, when its middleware no longer serves it or when it
//!   takes too much memory; see [`supervision`].
//! - Every subscription has an explicit depth: samples that do not fit are lost
//!   silently, even when reliable. Number the samples that must not be lost.
//! - A latched topic may deliver older values first; the newest comes last.
//!
//! ```no_run
//! use cnc_msgs::wire::std_msgs::msg::String as Text;
//! use cnc_msgs::wire::std_srvs::srv::{Trigger, TriggerRequest, TriggerResponse};
//! use runtime::parameters::Declared;
//! use runtime::{Handle, NodeError, Qos};
//! use std::process::ExitCode;
//! use std::time::Duration;
//!
//! fn main() -> ExitCode {
//!     let declared = vec![
//!         Declared::new("port", "/dev/ttyUSB0", "serial device").read_only(),
//!         Declared::new("rate_hz", 10.0, "state messages a second").within(1.0, 100.0),
//!     ];
//!     runtime::run("axis_driver", declared, node)
//! }
//!
//! async fn node(handle: Handle) -> Result<(), NodeError> {
//!     let state = handle.publisher::<Text>("machine_state", Qos::LATCHED)?;
//!     let mut orders = handle.subscription::<Text>("orders", Qos::DEFAULT.with_depth(100))?;
//!     handle.service::<Trigger, _, _>("feed_hold", |_request, info| async move {
//!         tracing::info!("{} asks for a feed hold", info.writer);
//!         TriggerResponse { success: true, message: "holding".into() }
//!     })?;
//!     let unlock = handle.client::<Trigger>("unlock")?;
//!     let period = Duration::from_secs_f64(1.0 / handle.parameter::<f64>("rate_hz"));
//!     let mut ticks = tokio::time::interval(period);
//!     loop {
//!         tokio::select! {
//!             () = handle.shutdown().requested() => return Ok(()),
//!             _ = ticks.tick() => drop(state.publish(Text { data: "idle".into() })),
//!             (order, info) = orders.next() => {
//!                 tracing::info!("\"{}\" from {}", order.data, info.publisher);
//!                 if let Err(error) = unlock.call(TriggerRequest::default()).await {
//!                     tracing::warn!("{error}");
//!                 }
//!             }
//!         }
//!     }
//! }
//! ```

mod client_session;
mod command_line;
mod endpoints;
mod managed;
pub mod parameters;
mod participant;
mod process;
mod run;
mod rustdds;
mod samples;
mod session;
#[cfg(feature = "zenoh")]
mod zenoh;

pub use cnc_msgs::interface;

pub use client_session::{ClientSessionError, client_session};
pub use command_line::environment::ServiceMapping;
pub use command_line::log_levels::LogSettings;
pub use command_line::{
    arguments, configuration, environment, names, security, stack_parameters, zenoh_settings,
};
pub use endpoints::client::{ANSWER_WITHIN, CallError, Client, SERVER_WITHIN};
pub use endpoints::error::NodeError;
pub use endpoints::graph::LOOPBACK_PARTICIPANTS_MAX;
pub use endpoints::node::Handle;
pub use endpoints::publisher::Publisher;
pub use endpoints::raw::{DiscoveredPublisher, RawPublisher, RawSample, RawSubscription};
pub use endpoints::service::RequestInfo;
pub use endpoints::subscription::Subscription;
pub use endpoints::warning_rate_limit::WarningRateLimit;
pub use endpoints::{action, chunks};
pub use managed::command_log as commands;
pub use managed::diagnostics::{Health, HealthLevel};
pub use managed::lifecycle::{self, Managed, TransitionResult, Trouble};
pub use managed::parameter_services::row_to_wire as parameter_to_wire;
pub use parameters::Declared;
pub use process::memory::Memory;
pub use process::panic_guard::{catch, end_command_on_panic};
pub use process::program_beside;
pub use process::shutdown::{Error, NodeResult, Shutdown};
pub use process::supervision;
pub use process::time::RosTime;
pub use run::{complain, main_with, run, run_managed, run_with};
pub use samples::gid::Gid;
pub use samples::qos::Qos;
pub use samples::sample::SampleInfo;
pub use session::Session;
#[cfg(feature = "zenoh")]
pub use zenoh::{error::ZenohError, router::Router};
