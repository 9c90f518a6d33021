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

/// For who asks for help and does not have it.
const SUMMARY: &str = "\
Store, replay and query bags of many machines

Usage: kerf fleet <push|replay|report|bisect> [ARGS]";
const MISSING: &str = "kerf-fleet is not installed: run `cargo install --path nodes/fleet --locked` \
                       in a checkout of Kerf";

/// What `kerf fleet` takes: the words of `kerf-fleet`.
#[derive(Debug, Args)]
#[command(disable_help_flag = true)]
pub(crate) struct FleetArgs {
    /// push, replay, report or bisect, with its arguments; `kerf fleet --help` lists them
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGS")]
    words: Vec<String>,
}

/// Becomes `kerf-fleet`; returns only if that is not possible.
pub(crate) fn run(args: &FleetArgs) -> CommandResult {
    let program = runtime::program_beside(PROGRAM);
    let error = Command::new(&program).args(&args.words).exec();
    if error.kind() != ErrorKind::NotFound {
        return Err(Failure::usage(format_args!("{}: {error}", program.display())));
    }
    let asks_for_help =
        args.words.first().is_some_and(|word| ["--help", "-h", "help"].contains(&word.as_str()));
    if asks_for_help {
        println!("{SUMMARY}\n\n{MISSING}");
        return Ok(());
    }
    Err(Failure::usage(MISSING))
}
