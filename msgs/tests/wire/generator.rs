//! The generator of the build script, for tests.
#![allow(dead_code, reason = "some of it only the build script uses")]
#![allow(unreachable_pub, reason = "seen by the tests next to it")]

use std::path::Path;

#[path = "../../generator/mod.rs"]
mod source;

pub use source::*;

use rosidl::interface_file::InterfaceFile;

/// All interface files of this crate, its own and those in `share`.
pub fn all_files() -> Vec<InterfaceFile> {
    files::read_all(Path::new(env!("CARGO_MANIFEST_DIR")), "cnc_msgs").expect("built with them")
}

/// The messages that every service and action needs without naming them.
pub fn protocol() -> Vec<InterfaceFile> {
    let needed = [
        "builtin_interfaces/msg/Time",
        "service_msgs/msg/ServiceEventInfo",
        "unique_identifier_msgs/msg/UUID",
    ];
    let mut files = all_files();
    files.retain(|file| needed.contains(&file.name.to_string().as_str()));
    assert_eq!(files.len(), needed.len());
    files
}
