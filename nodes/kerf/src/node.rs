//! `kerf node NAME`: one node in this process.

use crate::end_signals::EndSignals;
use crate::exit::{CommandResult, Failure, Status, conclude};
use crate::stack::{Stack, leave_with_parent};
use clap::Args;
use std::process::ExitCode;

/// Runs a node with its arguments.
type Entry = fn(Vec<String>) -> ExitCode;

/// Every node, by the name that `kerf node` takes.
const NODES: [(&str, Entry); 5] = [
    ("program_loader", program_loader::node::main),
    ("compensation_planner", compensation_planner::node::main),
    ("axis_driver", |args| axis_driver::node::main(&["node", "axis_driver"], args)),
    ("run_recorder", run_recorder::node::main),
    ("virtual_controller", |args| {
        virtual_controller::cli(std::iter::once("virtual_controller".to_owned()).chain(args))
    }),
];

/// The parameters of a ROS node.
pub(crate) fn parameters_of(name: &str) -> Vec<runtime::Declared> {
    match name {
        "program_loader" => program_loader::node::parameters(),
        "compensation_planner" => compensation_planner::node::parameters(),
        "axis_driver" => axis_driver::node::parameters(),
        "run_recorder" => run_recorder::node::parameters(),
        other => panic!("{other} is not a node of the stack"),
    }
}

/// What `kerf node` takes.
#[derive(Debug, Args)]
pub(crate) struct NodeArgs {
    /// program_loader, compensation_planner, axis_driver, run_recorder or virtual_controller
    name: String,
    /// Exit when standard input ends
    #[arg(long, hide = true)]
    leave_with_parent: bool,
    /// Run the node in a child process, and restart it when it fails or stops responding
    #[arg(long)]
    watch: bool,
    /// Arguments of the node itself; those of ROS follow --ros-args
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    args: Vec<String>,
}

/// Runs it until it is shut down.
pub(crate) fn run(args: &NodeArgs, ros_args: Vec<String>) -> ExitCode {
    let Some((name, entry)) = NODES.iter().find(|(name, _)| *name == args.name) else {
        let names: Vec<&str> = NODES.iter().map(|(name, _)| *name).collect();
        return conclude(Err(Failure::usage(format_args!(
            "there is no node {}; use {}",
            args.name,
            names.join(", ")
        ))));
    };
    if args.leave_with_parent
        && let Err(error) = leave_with_parent()
    {
        return conclude(Err(Failure::usage(error)));
    }
    let mut all = args.args.clone();
    all.extend(ros_args);
    if args.watch { conclude(watch(name, &all)) } else { entry(all) }
}

/// Keeps one node running, as `kerf up` keeps all: for supervisors that would also restart a node
/// that was shut down on purpose, and that cannot detect a node that stops responding.
fn watch(name: &'static str, args: &[String]) -> CommandResult {
    let executor = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(Failure::usage)?;
    executor.block_on(async {
        let mut end = EndSignals::listen()?;
        let mut stack = Stack::new().map_err(Failure::usage)?;
        stack.start(name, args).map_err(Failure::usage)?;
        tokio::select! {
            () = end.next() => {}
            trouble = stack.supervise() => return match trouble {
                Some(trouble) => Err(Failure::new(Status::Usage, trouble)),
                None => Ok(()),
            },
        }
        match &stack.stop().await[..] {
            [] => Ok(()),
            troubles => Err(Failure::new(Status::NodeRefused, troubles.join("; "))),
        }
    })
}
