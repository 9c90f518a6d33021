//! `kerf bag`: inspects and repairs bags.

use crate::exit::{CommandResult, Failure, Status, printed};
use crate::output_file::OutputFile;
use crate::replay_command::{failure, report_page};
use clap::Subcommand;
use replay::run_result;
use replay::trim::trim;
use run_recorder::files::{FileBag, open_bag, recover_bag};
use run_recorder::info::BagInfo;
use run_recorder::stored_bags::{mark, mark_of, unmark};
use std::path::PathBuf;

/// What `kerf bag` takes.
#[derive(Debug, Subcommand)]
pub(crate) enum BagCommand {
    /// Show what a bag holds, and whether it is complete
    Info {
        /// Bag directory or .mcap file
        bag: PathBuf,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
    },
    /// Copy everything readable from a damaged bag into a new one
    Recover {
        /// Bag directory or .mcap file
        bag: PathBuf,
        /// Directory of the new bag; must not exist yet
        out: PathBuf,
    },
    /// Copy what replay needs from a bag into a new, small one that replays the same
    Trim {
        /// Bag directory or .mcap file
        bag: PathBuf,
        /// Directory of the new bag; must not exist yet
        out: PathBuf,
        /// Another topic to keep, with all its messages; may be repeated
        #[arg(long, value_name = "TOPIC")]
        keep: Vec<String>,
    },
    /// Protect a bag from the recorder's clean-up, or end the protection
    Mark {
        /// Bag directory
        bag: PathBuf,
        /// The reason, shown by `kerf bag info`
        #[arg(long, value_name = "TEXT", conflicts_with = "unmark")]
        because: Option<String>,
        /// Remove the mark
        #[arg(long)]
        unmark: bool,
    },
    /// Write a page for a browser: path, states, feed, dialogue and alarms of a run
    Report {
        /// Bag directory or .mcap file
        bag: PathBuf,
        /// The page to write
        #[arg(value_name = "FILE")]
        html: PathBuf,
    },
}

/// Runs one of the subcommands.
pub(crate) fn run(command: &BagCommand) -> CommandResult {
    match command {
        BagCommand::Info { bag: path, json } => {
            let mut bag = open_bag(path).map_err(Failure::usage)?;
            bag.verify().map_err(Failure::usage)?;
            let mut info = BagInfo::new(&path.display().to_string(), &bag);
            info.result = run_result::of_bag(&mut bag);
            info.kept = mark_of(path);
            if *json {
                let info = serde_json::to_value(&info).map_err(Failure::usage)?;
                printed(report::json::print(&info))?;
            } else {
                println!("{info}");
            }
            must_be_undamaged(&bag)?;
            if info.complete { Ok(()) } else { Err(Failure::said(Status::Refused)) }
        }
        BagCommand::Recover { bag, out } => {
            let recovered = recover_bag(bag, out).map_err(Failure::usage)?;
            println!("{}: {} messages", out.display(), recovered.summary.message_count);
            for problem in &recovered.problems {
                println!("  {problem}");
            }
            for (topic, why) in &recovered.left_out {
                println!("  topic {topic} is left out: {why}");
            }
            Ok(())
        }
        BagCommand::Trim { bag, out, keep } => {
            println!("{}", trim(bag, out, keep).map_err(Failure::usage)?);
            Ok(())
        }
        BagCommand::Mark { bag, because, unmark: is_off } => {
            let failed = |error| Failure::usage(format_args!("{}: {error}", bag.display()));
            let name = bag.display();
            if !is_off {
                mark(bag, because.as_deref().unwrap_or_default()).map_err(failed)?;
                println!("{name} is marked: it is kept");
            } else if unmark(bag).map_err(failed)? {
                println!("{name} is no longer marked");
            } else {
                println!("{name} was not marked");
            }
            Ok(())
        }
        BagCommand::Report { bag, html } => {
            let file = OutputFile::claim(html, &[bag])?;
            let page = report_page(bag).map_err(|error| failure(&error, bag))?;
            file.write(|to| page.write_html(to))?;
            // The page says it, too; but a script may look at the status only.
            let mut bag = open_bag(bag).map_err(Failure::usage)?;
            bag.verify().map_err(Failure::usage)?;
            must_be_undamaged(&bag)
        }
    }
}

/// Fails with the first damaged record.
fn must_be_undamaged(bag: &FileBag) -> CommandResult {
    match bag.problems().iter().find(|problem| problem.is_damage()) {
        Some(problem) => Err(Failure::usage(problem)),
        None => Ok(()),
    }
}
