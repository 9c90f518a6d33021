//! The messages as they travel: one serde struct per ROS 2 message.
//!
//! Generated at build time from the files in `msg`, `srv` and `action` and, for
//! what other packages define, in `share`: `wire::<package>::<folder>::<Type>`,
//! as in [`cnc_msgs::msg::MachineState`] or [`std_msgs::msg::Header`]. The
//! request of a service is `LoadProgramRequest`; the service itself, and an
//! action, is an empty type that names its parts.
//!
//! A wire struct may hold anything that fits its types. Bounds of strings and
//! sequences are documented, not enforced; the checked types enforce them.
#![allow(
    clippy::all,
    rustdoc::bare_urls,
    rustdoc::broken_intra_doc_links,
    rustdoc::invalid_html_tags,
    reason = "the comments and names of interface files are written for ROS"
)]

include!(concat!(env!("OUT_DIR"), "/wire.rs"));
include!(concat!(env!("OUT_DIR"), "/every_message.rs"));
