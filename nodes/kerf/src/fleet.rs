//! `kerf fleet`: another program, found as git and cargo find theirs.
//!
//! Stores and Parquet are not part of `kerf`, so that it builds as fast as before.

use crate::exit::{CommandResult, Failure};
use clap::Args;
use std::env;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
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
    let beside = env::current_exe().ok().and_then(|it| Some(it.parent()?.to_owned()));
    let path = env::var_os("PATH").unwrap_or_default();
    let folders = beside.into_iter().chain(env::split_paths(&path));
    let found = folders.map(|folder| folder.join(PROGRAM)).find(|it: &PathBuf| it.is_file());
    let Some(program) = found else {
        return Err(Failure::usage(format!(
            "{PROGRAM} is neither beside kerf nor on PATH; `cargo install --path nodes/fleet --locked` \
             or `cargo build --release -p fleet` in a checkout of Kerf makes it"
        )));
    };
    let error = Command::new(&program).args(&args.words).exec();
    Err(Failure::usage(format!("{}: {error}", program.display())))
}
