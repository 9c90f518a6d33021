//! `kerf controller`: the settings of the controller's firmware.
//!
//! `configure` writes the one that improves the watch over the link: the driver decides which; this
//! command shows it, and asks before writing. `dump` writes a machine file.

mod dump;

use crate::exit::{CommandResult, Failure, Status};
use crate::operate::{said, with_node};
use clap::{Args, Subcommand};
use cnc_msgs::wire::cnc_msgs::srv::{
    ConfigureController, ConfigureControllerRequest, ConfigureControllerResponse,
};
use std::io::{IsTerminal, Write};

/// Commands for the controller itself.
#[derive(Debug, Subcommand)]
pub(crate) enum ControllerCommand {
    /// Show the setting that lets the driver notice lost lines sooner; write it when confirmed
    Configure(ConfigureArgs),
    /// Print settings and stored positions as a file for `kerf plan --machine`
    Dump,
}

/// What `kerf controller configure` takes.
#[derive(Debug, Args)]
pub(crate) struct ConfigureArgs {
    /// Write without asking
    #[arg(long)]
    yes: bool,
}

/// `kerf controller`
pub(crate) fn run(command: &ControllerCommand, ros_args: &[String]) -> CommandResult {
    let ControllerCommand::Configure(args) = command else {
        return with_node(ros_args, dump::dump);
    };
    with_node(ros_args, async |node| {
        let client = node.client::<ConfigureController>("configure_controller")?;
        let plan = client.call(ConfigureControllerRequest { write: false }).await?;
        if plan.error_code == ConfigureControllerResponse::NOTHING_TO_DO {
            println!("{}", plan.message);
            return Ok(());
        }
        said(plan.success, plan.message)?;
        if !args.yes && !is_confirmed()? {
            println!("nothing was written");
            return Ok(());
        }
        let answer = client.call(ConfigureControllerRequest { write: true }).await?;
        said(answer.success, answer.message)
    })
}

/// Asks at the terminal; without a terminal it is an error.
fn is_confirmed() -> Result<bool, Failure> {
    if !std::io::stdin().is_terminal() {
        let text = "no terminal for the confirmation; use --yes to write without asking";
        return Err(Failure::new(Status::Usage, text));
    }
    print!("write it? [y/N] ");
    // Reads an answer even if the question could not be shown.
    let _ = std::io::stdout().flush();
    let mut answer = String::new();
    std::io::stdin().read_line(&mut answer).map_err(Failure::usage)?;
    Ok(matches!(answer.trim(), "y" | "Y" | "yes"))
}
