//! Stops a machine, and shows its state, when its driver does not answer over ROS.
//!
//! On the machine's own computer the driver's motion process listens on a local socket. ROS is
//! tried first, because it reaches every computer; if it does not answer soon, the socket is used.

use crate::exit::{CommandResult, Failure, Status};
use crate::node_message::with_commands;
use crate::operate::with_node;
use axis_driver::motion::{OperatorError, ask_operator};
use axis_driver::protocol::{Answer, Wish};
use runtime::Handle;
use runtime::arguments::Arguments;
use runtime::environment::Environment;
use runtime::names::Names;
use std::time::Duration;

/// How long ROS may take before the socket is tried as well: a running driver answers sooner.
const HEAD_START: Duration = Duration::from_millis(2_500);
/// The same for a hold, because the machine is moving meanwhile.
const HOLD_HEAD_START: Duration = Duration::from_millis(600);

/// Does something over ROS, or over the local socket when ROS does not answer; `show` gets the
/// driver's answer from the socket.
pub(crate) fn over_ros_or_locally<F>(
    ros_args: &[String],
    wish: Wish,
    over_ros: F,
    show: impl FnOnce(Answer) -> CommandResult,
) -> CommandResult
where
    F: AsyncFnOnce(&Handle) -> CommandResult,
{
    let mut answer = None;
    let mut is_joined = false;
    let outcome = with_node(ros_args, async |node| {
        is_joined = true;
        let mut exchange = std::pin::pin!(over_ros(node));
        let head_start = if wish == Wish::FeedHold { HOLD_HEAD_START } else { HEAD_START };
        if let Ok(outcome) = tokio::time::timeout(head_start, &mut exchange).await {
            return outcome;
        }
        match ask_locally(ros_args, wish) {
            Ok(local) => {
                // ROS may reach another machine of this name, if slowly.
                let rest = HEAD_START.saturating_sub(head_start);
                if let Ok(Ok(())) = tokio::time::timeout(rest, &mut exchange).await {
                    return Ok(());
                }
                answer = Some(local);
                Ok(())
            }
            // A computer on which no driver runs has no socket either.
            Err(error) if error.is_absent() => exchange.await,
            Err(error) => exchange.await.map_err(|failure| {
                let message = format!("{}; {error}", failure.message);
                Failure::new(failure.status, message)
            }),
        }
    });
    // The DDS layer of this command may be the cause.
    let has_no_ros =
        !is_joined || matches!(&outcome, Err(failure) if failure.status == Status::NoAnswer);
    if answer.is_none() && outcome.is_err() && has_no_ros {
        answer = ask_locally(ros_args, wish).ok();
    }
    match answer {
        Some(answer) => {
            eprintln!(
                "kerf: the driver does not answer over ROS{}; using its local socket",
                if answer.has_face { "" } else { " (its ROS side is being restarted)" }
            );
            show(answer)
        }
        None => outcome,
    }
}

/// Asks the driver of this computer that has the names given by the arguments.
fn ask_locally(ros_args: &[String], wish: Wish) -> Result<Answer, LocalError> {
    let unnamed = |error: &dyn std::fmt::Display| LocalError::Unnamed(error.to_string());
    let arguments = Arguments::parse(ros_args).map_err(|error| unnamed(&error))?;
    let variables = std::env::vars_os()
        .filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)))
        .collect();
    let environment = Environment::read(&variables).map_err(|error| unnamed(&error))?;
    let names = Names::new("axis_driver", &arguments.remaps).map_err(|error| unnamed(&error))?;
    Ok(ask_operator(&environment, &names, wish)?)
}

/// Why the local socket does not help.
#[derive(Debug, thiserror::Error)]
enum LocalError {
    #[error(transparent)]
    Operator(#[from] OperatorError),
    /// Names and domain cannot be read, which ROS reports too.
    #[error("{0}")]
    Unnamed(String),
}

impl LocalError {
    /// Whether there is no driver on this computer.
    fn is_absent(&self) -> bool {
        use std::io::ErrorKind::{ConnectionRefused, NotFound};
        match self {
            Self::Operator(OperatorError::Nobody { problem, .. }) => {
                [ConnectionRefused, NotFound].contains(&problem.kind())
            }
            _ => false,
        }
    }
}

/// Prints the driver's answer; a refusal is a failure.
pub(crate) fn say(answer: Answer) -> CommandResult {
    match answer.result {
        Ok(message) => {
            println!("{}", with_commands(&message));
            Ok(())
        }
        Err(refusal) => Err(Failure::of_node(&refusal.message)),
    }
}
