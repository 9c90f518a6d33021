//! `kerf controller configure`: what the controller is to report, so that the link is watched
//! well. The driver decides; this asks, shows, and asks whoever types before it is written.

use crate::exit::{Failure, Outcome, Status};
use crate::operate::{said, with_node};
use clap::{Args, Subcommand};
use cnc_msgs::wire::cnc_msgs::srv::{
    ConfigureController, ConfigureControllerRequest, ConfigureControllerResponse,
};
use std::io::{IsTerminal, Write};

/// What is done with the controller itself.
#[derive(Debug, Subcommand)]
pub(crate) enum ControllerCommand {
    /// Show which setting would improve the watch over the serial line, and write it when
    /// confirmed; no other setting is touched
    Configure(ConfigureArgs),
}

/// What `kerf controller configure` takes.
#[derive(Debug, Args)]
pub(crate) struct ConfigureArgs {
    /// Write it without asking
    #[arg(long)]
    yes: bool,
}

/// `kerf controller`
pub(crate) fn run(command: &ControllerCommand, ros_args: &[String]) -> Outcome {
    let ControllerCommand::Configure(args) = command;
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

/// Asks at the terminal; without one nobody can have said yes.
fn is_confirmed() -> Result<bool, Failure> {
    if !std::io::stdin().is_terminal() {
        let text = "there is no terminal to confirm it at: give --yes to write it";
        return Err(Failure::new(Status::Usage, text));
    }
    print!("write it? [y/N] ");
    // An answer is read even where the question could not be shown.
    let _ = std::io::stdout().flush();
    let mut answer = String::new();
    std::io::stdin().read_line(&mut answer).map_err(Failure::usage)?;
    Ok(matches!(answer.trim(), "y" | "Y" | "yes"))
}
