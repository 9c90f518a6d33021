//! Sets the commit of a release build, for the bags that it records.
//!
//! Without git, or outside of a checkout, it sets nothing. Neither does it for debug builds:
//! every commit would rebuild them.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "a build script is no core: it asks git"
)]

use std::process::Command;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var("PROFILE").as_deref() != Ok("release") {
        return;
    }
    let git = |args: &[&str]| {
        let output = Command::new("git").args(args).output().ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_owned())
    };
    let Some(commit) = git(&["describe", "--always", "--dirty", "--abbrev=12"]) else { return };
    println!("cargo:rustc-env=KERF_COMMIT={commit}");
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]) {
        println!("cargo:rerun-if-changed={log}");
    }
}
