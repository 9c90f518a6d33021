//! The commands that talk to running nodes over ROS 2: run, abort and the machine's buttons.
//! `kerf load` and `kerf status` have their own files.
//!
//! Each call starts one short-lived node. It shows what the nodes answer and decides nothing.

use crate::ctrl_c::CtrlC;
use crate::exit::{CommandResult, Failure, Status};
use crate::load::load_file;
use crate::local;
use crate::node_message::with_commands;
use crate::resume;
use crate::waiting::Waits;
use crate::words::from_one;
use axis_driver::protocol::Wish;
use clap::{ArgGroup, Args};
use cnc_msgs::convert::mode_from_wire;
use cnc_msgs::interface::Action;
use cnc_msgs::wire::cnc_msgs::action::{RunProgram, RunProgramGoal, RunProgramResult};
use cnc_msgs::wire::cnc_msgs::msg::{Command, MachineState};
use cnc_msgs::wire::std_srvs::srv::{Trigger, TriggerRequest};
use indicatif::{ProgressBar, ProgressStyle};
use runtime::action::{ActionClient, CancelAnswer, GoalError, GoalHandle};
use runtime::{CallError, Handle, NodeError, Qos, Session, Subscription};
use std::path::PathBuf;
use std::time::Duration;
use tokio::time::{Instant, sleep_until, timeout};

/// A driver that runs a program is never silent for this long.
const SILENCE: Duration = Duration::from_secs(3);
/// No program runs longer than this.
const RUN_WITHIN: Duration = Duration::from_secs(7 * 24 * 3600);

/// What `kerf run` takes.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("place").args(["start_line", "resume"]).multiple(true))]
pub(crate) struct RunArgs {
    /// Load this program first
    file: Option<PathBuf>,
    /// Control profile [default: the loader's parameter]
    #[arg(
        long,
        value_name = "NAME|FILE",
        default_value = "",
        hide_default_value = true,
        requires = "file"
    )]
    control: String,
    /// Reaction to a contour that the tool does not fit: alarm, trim or ignore [default: the
    /// profile's]
    #[arg(
        long,
        value_name = "REACTION",
        default_value = "",
        hide_default_value = true,
        requires = "file"
    )]
    interference: String,
    /// Only check that the path can be sent to this controller; nothing moves
    #[arg(long)]
    check_only: bool,
    /// Start at this line of the program
    #[arg(long, value_name = "LINE", value_parser = from_one)]
    pub(crate) start_line: Option<u32>,
    /// Where loops or calls run that line several times: which time, counted from 1
    #[arg(long, value_name = "NUMBER", value_parser = from_one, requires = "place")]
    pub(crate) occurrence: Option<u32>,
    /// Continue a run that ended early: show where and how it would start, then ask
    #[arg(long, conflicts_with = "check_only")]
    resume: bool,
    /// Start without asking
    #[arg(long, requires = "resume")]
    pub(crate) yes: bool,
    /// Draw where the run would start, on a page for a browser
    #[arg(long, value_name = "FILE", requires = "resume")]
    pub(crate) html: Option<PathBuf>,
}

/// A service without arguments.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Button {
    Hold,
    Resume,
    Confirm,
    Unlock,
    Reset,
    DoorHold,
    Sleep,
}

impl Button {
    const fn service(self) -> &'static str {
        match self {
            Self::Hold => "feed_hold",
            Self::Resume => "resume",
            Self::Confirm => "confirm_tool_change",
            Self::Unlock => "unlock",
            Self::Reset => "soft_reset",
            Self::DoorHold => "door_hold",
            Self::Sleep => "sleep",
        }
    }

    /// The same request over the local socket, for the buttons that stop a machine.
    const fn local_wish(self) -> Option<Wish> {
        match self {
            Self::Hold => Some(Wish::FeedHold),
            Self::Reset => Some(Wish::SoftReset),
            Self::Resume | Self::Confirm | Self::Unlock | Self::DoorHold | Self::Sleep => None,
        }
    }
}

impl From<CallError> for Failure {
    fn from(error: CallError) -> Self {
        match error {
            CallError::NoServer { service, waited } => no_answer(&service, waited),
            error => Self::new(Status::NoAnswer, error.to_string()),
        }
    }
}

/// No node answers under this name.
pub(crate) fn no_answer(name: &str, waited: Duration) -> Failure {
    let seconds = waited.as_secs_f64();
    let text = format!(
        "no answer from {name} within {seconds} s. Start the nodes (`kerf up`), or set \
         ROS_DOMAIN_ID and namespace as they have"
    );
    Failure::new(Status::NoAnswer, text)
}

/// Why there is no result of a goal.
pub(crate) fn no_result(error: GoalError) -> Failure {
    let text = match error {
        GoalError::Forgotten { .. } => {
            "the driver was restarted and has lost what it ran; it holds a machine that it finds \
             moving: look at the machine, then `kerf reset`"
                .to_owned()
        }
        error => error.to_string(),
    };
    Failure::new(Status::NodeRefused, text)
}

impl From<NodeError> for Failure {
    fn from(error: NodeError) -> Self {
        Self::usage(error)
    }
}

/// Runs one exchange with a node of this command, and shuts the node down.
pub(crate) fn with_node<F>(ros_args: &[String], exchange: F) -> CommandResult
where
    F: AsyncFnOnce(&Handle) -> CommandResult,
{
    with_lasting_node(ros_args, async |node| unless_dds_fails(node, exchange(node)).await)
}

/// Ends an exchange when the DDS layer of this command has failed: no answer could arrive.
pub(crate) async fn unless_dds_fails<R>(
    node: &Handle,
    exchange: impl Future<Output = Result<R, Failure>>,
) -> Result<R, Failure> {
    tokio::select! {
        outcome = exchange => outcome,
        reason = node.deaf() => Err(Failure::new(
            Status::NoAnswer,
            format!("{reason}; the request may not have arrived, check with `kerf status`"),
        )),
    }
}

/// Starts the node of this command again, after its DDS layer has failed.
pub(crate) fn reconnect(failed: &Handle, reason: &str) -> Result<Session, Failure> {
    eprintln!("kerf: {reason}; reconnecting");
    Session::again(failed).map_err(|error| {
        Failure::new(
            Status::NoAnswer,
            format!(
                "cannot reconnect ({error}); the machine may be moving, check with `kerf status`"
            ),
        )
    })
}

/// As [`with_node`], for an exchange that reconnects by itself.
pub(crate) fn with_lasting_node<F>(ros_args: &[String], exchange: F) -> CommandResult
where
    F: AsyncFnOnce(&Handle) -> CommandResult,
{
    let executor = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(|error| Failure::usage(format_args!("cannot start threads: {error}")))?;
    executor.block_on(async {
        let session = client_session(ros_args)?;
        let outcome = exchange(session.handle()).await;
        session.stop().await;
        outcome
    })
}

/// A node for a client: a unique name, in the namespace of the arguments.
pub(crate) fn client_session(ros_args: &[String]) -> Result<Session, Failure> {
    runtime::client_session(&format!("kerf_{}", std::process::id()), ros_args)
        .map_err(Failure::usage)
}

/// `kerf run`
pub(crate) fn run(args: &RunArgs, ros_args: &[String]) -> CommandResult {
    with_lasting_node(ros_args, async |node| {
        let program_id = match &args.file {
            Some(file) => {
                let loading = load_file(node, file, &args.control, &args.interference);
                unless_dds_fails(node, loading).await?
            }
            None => String::new(),
        };
        let goal = match args.resume {
            true => unless_dds_fails(node, resume::confirmed(node, args)).await?,
            false => RunProgramGoal {
                program_id,
                start_line: args.start_line.unwrap_or_default(),
                check_only: args.check_only,
                occurrence: args.occurrence.unwrap_or_default(),
                ..RunProgramGoal::default()
            },
        };
        let result = run_goal(node, goal, &progress_bar()).await?;
        println!("{}", result.message);
        Ok(())
    })
}

/// `kerf hold`, `resume`, `confirm`, `unlock`, `reset`, `door-hold`, `sleep`
pub(crate) fn press(button: Button, ros_args: &[String]) -> CommandResult {
    let over_ros = async |node: &Handle| {
        let client = node.client::<Trigger>(button.service())?;
        let answer = client.call(TriggerRequest::default()).await?;
        said(answer.success, answer.message)
    };
    match button.local_wish() {
        Some(wish) => local::over_ros_or_locally(ros_args, wish, over_ros, local::say),
        None => with_node(ros_args, over_ros),
    }
}

/// `kerf abort`
pub(crate) fn abort(ros_args: &[String]) -> CommandResult {
    let over_ros = async |node: &Handle| {
        let client: ActionClient<RunProgram> = node.action_client("run_program")?;
        let answer = client.cancel_all().await?;
        match answer {
            CancelAnswer::Canceling(count) if count > 0 => {
                println!("the run is canceled: the machine is held, then the rest is dropped");
                Ok(())
            }
            // It may be a block, a jog or a probe of any commander.
            _ => {
                let client = node.client::<Trigger>("cancel")?;
                let answer = client.call(TriggerRequest::default()).await?;
                said(answer.success, answer.message)
            }
        }
    };
    local::over_ros_or_locally(ros_args, Wish::Cancel, over_ros, local::say)
}

/// The progress bar of a run.
pub(crate) fn progress_bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{msg:14} [{bar:40}] {percent:>3} % {elapsed} ");
    ProgressBar::new(1000)
        .with_style(style.expect("the template is a constant").progress_chars("=> "))
}

/// Sends a goal; a rejection is an error with its reason.
pub(crate) async fn begin<A: Action + 'static>(
    node: &Handle,
    name: &str,
    goal: A::Goal,
) -> Result<GoalHandle<A>, Failure> {
    Ok(begin_or_refused(node, name, goal).await?)
}

/// Why a node does not do something.
pub(crate) struct Refused {
    /// The node's own; 0 where it is not known.
    pub(crate) error_code: u16,
    pub(crate) failure: Failure,
}

impl From<Failure> for Refused {
    fn from(failure: Failure) -> Self {
        Self { error_code: 0, failure }
    }
}

impl From<Refused> for Failure {
    fn from(refused: Refused) -> Self {
        refused.failure
    }
}

/// [`begin`] with the error code of a rejection.
pub(crate) async fn begin_or_refused<A: Action + 'static>(
    node: &Handle,
    name: &str,
    goal: A::Goal,
) -> Result<GoalHandle<A>, Refused> {
    let client: ActionClient<A> = node.action_client(name).map_err(Failure::from)?;
    // The action has no field for the reason of a rejection.
    let mut commands: Subscription<Command> =
        node.subscription("command_log", Qos::EVENTS).map_err(Failure::from)?;
    match client.send_goal(goal).await {
        Ok(handle) => Ok(handle),
        Err(GoalError::Call(error)) => Err(Failure::from(error).into()),
        Err(error @ GoalError::Rejected { .. }) => {
            let reason = timeout(Duration::from_secs(1), async {
                loop {
                    let (command, _) = commands.next().await;
                    if command.endpoint.ends_with(name) && !command.success {
                        break (command.message, command.error_code);
                    }
                }
            });
            let (reason, error_code) = reason.await.unwrap_or_else(|_| (error.to_string(), 0));
            Err(Refused { error_code, failure: Failure::of_node(&reason) })
        }
        Err(error) => Err(Failure::new(Status::NodeRefused, error.to_string()).into()),
    }
}

/// Prints that a goal is being canceled; fails if it has ended before.
pub(crate) async fn canceled(
    answer: impl Future<Output = Result<CancelAnswer, CallError>>,
) -> Result<(), Failure> {
    match answer.await? {
        CancelAnswer::Canceling(_) | CancelAnswer::AlreadyEnded => Ok(()),
        CancelAnswer::UnknownGoal => {
            Err(Failure::new(Status::NodeRefused, "the driver does not know this goal any more"))
        }
        CancelAnswer::Refused => Err(Failure::new(Status::NodeRefused, "the driver refused")),
    }
}

/// Prints a node's answer; a refusal is a failure.
pub(crate) fn said(success: bool, message: String) -> CommandResult {
    match success {
        true => {
            println!("{}", with_commands(&message));
            Ok(())
        }
        false => Err(Failure::of_node(&message)),
    }
}

/// Sends a goal and follows it to its end; anything but success is a failure.
pub(crate) async fn run_goal(
    node: &Handle,
    goal: RunProgramGoal,
    bar: &ProgressBar,
) -> Result<RunProgramResult, Failure> {
    let mut ctrl_c = CtrlC::listen()?;
    // While a program is checked, the machine may wait in another run.
    let is_check = goal.check_only;
    let states_of = |node: &Handle| if is_check { None } else { states_of(node) };
    let beginning = begin::<RunProgram>(node, "run_program", goal);
    let mut handle = unless_dds_fails(node, beginning).await?;
    let (mut node, mut session) = (node.clone(), None::<Session>);
    let mut end = Box::pin(handle.result(RUN_WITHIN));
    let (mut states, mut waits) = (states_of(&node), Waits::default());
    let (mut is_silent, mut heard_at) = (false, Instant::now());
    let (_, result) = loop {
        tokio::select! {
            reason = node.deaf() => {
                let again = bar.suspend(|| reconnect(&node, &reason))?;
                node = again.handle().clone();
                handle = node.action_client::<RunProgram>("run_program")?.follow(handle.id());
                end = Box::pin(handle.result(RUN_WITHIN));
                ctrl_c.reconnect(canceled(handle.cancel()));
                (states, heard_at) = (states_of(&node), Instant::now());
                session = Some(again);
            }
            asked = ctrl_c.next() => {
                asked.inspect_err(|_| bar.abandon())?;
                bar.suspend(|| ctrl_c.cancel(canceled(handle.cancel())));
            }
            () = sleep_until(heard_at + SILENCE), if !is_silent => {
                // A restarted driver does not know the goal, so the status has to be requested.
                is_silent = true;
                end = Box::pin(handle.result(RUN_WITHIN));
            }
            ended = &mut end => {
                break ended.map_err(no_result)?;
            }
            state = next_of(&mut states) => {
                if let Some(text) = waits.take(&state) {
                    bar.suspend(|| eprintln!("kerf: {text}"));
                }
            }
            feedback = handle.feedback() => {
                let Some(feedback) = feedback else { continue };
                (is_silent, heard_at) = (false, Instant::now());
                bar.set_position((feedback.fraction * 1000.0) as u64);
                bar.set_message(format!(
                    "{} line {}", mode_from_wire(feedback.state).name(), feedback.line
                ));
            }
        }
    };
    if let Some(session) = session {
        drop((handle, node));
        session.stop().await;
    }
    if result.outcome == RunProgramResult::OUTCOME_SUCCEEDED {
        bar.set_position(1000);
        bar.finish();
        Ok(result)
    } else {
        bar.abandon();
        Err(Failure::of_node(&end_text(&result)))
    }
}

/// The states of the machine; none where the keys of this command do not let it read them.
fn states_of(node: &Handle) -> Option<Subscription<MachineState>> {
    node.subscription("machine_state", Qos::LATCHED).ok()
}

/// The next state; never comes where there are none.
async fn next_of(states: &mut Option<Subscription<MachineState>>) -> MachineState {
    match states {
        Some(states) => states.next().await.0,
        None => std::future::pending().await,
    }
}

/// How a run ended that was not cut to its end: where, and the code of an error.
fn end_text(result: &RunProgramResult) -> String {
    let RunProgramResult { outcome, error_code, message, last_line } = result;
    match (*outcome, last_line) {
        (RunProgramResult::OUTCOME_CANCELED, 0) => message.clone(),
        (RunProgramResult::OUTCOME_CANCELED, line) => format!("{message} at line {line}"),
        (_, 0) => format!("{message} (error {error_code})"),
        (_, line) => format!("{message} (line {line}, error {error_code})"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_the_driver_has_lost_is_reported_with_what_to_do() {
        let failure = no_result(GoalError::Forgotten { action: "/run_program".into() });
        assert_eq!(failure.status, Status::NodeRefused);
        let says = |part: &str| failure.message.contains(part);
        assert!(says("the driver was restarted") && says("`kerf reset`"), "{}", failure.message);
    }

    #[test]
    fn a_cancel_is_no_error_and_an_error_has_its_code() {
        use RunProgramResult as R;
        for (outcome, error_code, message, last_line, expected) in [
            (R::OUTCOME_CANCELED, 313, "canceled", 6, "canceled at line 6"),
            (R::OUTCOME_CANCELED, 313, "canceled", 0, "canceled"),
            (R::OUTCOME_ABORTED, 309, "error:20", 6, "error:20 (line 6, error 309)"),
            (R::OUTCOME_ABORTED, 330, "out of travel", 0, "out of travel (error 330)"),
        ] {
            let message = message.to_owned();
            let result = R { outcome, error_code, message, last_line };
            assert_eq!(end_text(&result), expected);
        }
    }
}
