//! `kerf node NAME`: one node in this process.

use crate::exit::{Failure, conclude};
use crate::stack::leave_with_parent;
use clap::Args;
use std::process::ExitCode;

/// What runs a node, given its arguments.
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

/// The parameters of a node that speaks ROS.
pub(crate) fn parameters_of(name: &str) -> Vec<runtime::Declared> {
    match name {
        "program_loader" => program_loader::node::parameters(),
        "compensation_planner" => compensation_planner::node::parameters(),
        "axis_driver" => axis_driver::node::parameters(),
        "run_recorder" => run_recorder::node::parameters(),
        other => panic!("{other} is no node of the stack"),
    }
}

/// What `kerf node` takes.
#[derive(Debug, Args)]
pub(crate) struct NodeArgs {
    /// program_loader, compensation_planner, axis_driver, run_recorder or virtual_controller
    name: String,
    /// Leave when standard input ends
    #[arg(long, hide = true)]
    leave_with_parent: bool,
    /// Arguments of the node itself; those of ROS follow --ros-args
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    args: Vec<String>,
}

/// Runs it until it is told to stop.
pub(crate) fn run(args: &NodeArgs, ros_args: Vec<String>) -> ExitCode {
    let Some((_, entry)) = NODES.iter().find(|(name, _)| *name == args.name) else {
        let names: Vec<&str> = NODES.iter().map(|(name, _)| *name).collect();
        return conclude(Err(Failure::usage(format_args!(
            "there is no node {}; there are {}",
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
    entry(all)
}
