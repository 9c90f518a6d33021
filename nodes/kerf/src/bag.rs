//! `kerf bag`: looks into bags and mends them.

use crate::exit::{Failure, Outcome, Status};
use clap::Subcommand;
use run_recorder::files::{open_bag, recover_bag};
use run_recorder::info::BagInfo;
use std::path::PathBuf;

/// What `kerf bag` takes.
#[derive(Debug, Subcommand)]
pub(crate) enum BagCommand {
    /// What a bag holds, and whether it is whole
    Info {
        /// Bag directory or .mcap file
        bag: PathBuf,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
    },
    /// Copy all that can be read of a damaged bag into a new one
    Recover {
        /// Bag directory or .mcap file
        bag: PathBuf,
        /// Directory of the new bag; must not be there
        out: PathBuf,
    },
    /// Show a run on one page for a browser: path, state, feed, dialogue, alarms
    Report {
        /// Bag directory or .mcap file
        bag: PathBuf,
        /// The page
        #[arg(value_name = "FILE")]
        html: PathBuf,
    },
}

/// Prints or mends.
pub(crate) fn run(command: &BagCommand) -> Outcome {
    match command {
        BagCommand::Info { bag: path, json } => {
            let mut bag = open_bag(path).map_err(Failure::usage)?;
            bag.verify().map_err(Failure::usage)?;
            let info = BagInfo::new(&path.display().to_string(), &bag);
            if *json {
                let value = serde_json::to_value(&info).map_err(Failure::usage)?;
                println!("{value:#}");
            } else {
                println!("{info}");
            }
            if info.complete { Ok(()) } else { Err(Failure::said(Status::Refused)) }
        }
        BagCommand::Recover { bag, out } => {
            let recovered = recover_bag(bag, out).map_err(Failure::usage)?;
            println!("{}: {} messages", out.display(), recovered.summary.message_count);
            Ok(())
        }
        BagCommand::Report { bag, html } => {
            let page = crate::replay::report_page(bag)
                .map_err(|error| Failure::usage(format_args!("{}: {error}", bag.display())))?;
            crate::files::write(html, &page.to_html())
        }
    }
}
