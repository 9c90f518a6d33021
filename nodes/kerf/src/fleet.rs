//! `kerf fleet`: another program.
//!
//! Stores and Parquet are not part of `kerf`, so that it builds as fast as before.

use crate::exit::{CommandResult, Failure};
use clap::Args;
use std::io::ErrorKind;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// The program.
const PROGRAM: &str = "kerf-fleet";

/// What `kerf fleet` takes: the words of `kerf-fleet`.
#[derive(Debug, Args)]
#[command(disable_help_flag = true)]
pub(crate) struct FleetArgs {
    /// push, replay, report and bisect; `kerf fleet --help` lists them
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGS")]
    words: Vec<String>,
}

/// Becomes `kerf-fleet`; returns only if that is not possible.
pub(crate) fn run(args: &FleetArgs) -> CommandResult {
    let program = runtime::program_beside(PROGRAM);
    let error = Command::new(&program).args(&args.words).exec();
    Err(Failure::usage(match error.kind() {
        ErrorKind::NotFound => format!(
            "{PROGRAM} is neither beside kerf nor on PATH; `cargo install --path nodes/fleet --locked` \
             or `cargo build --release -p fleet` in a checkout of Kerf makes it"
        ),
        _ => format!("{}: {error}", program.display()),
    }))
}
