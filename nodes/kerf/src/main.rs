//! The `kerf` command; it also runs any node.
//!
//! This file knows the subcommands, but not what they do. Arguments between `--ros-args` and `--`
//! are for ROS; they are removed before anything else is read.

#[macro_use]
mod terminal;

mod bag;
mod check;
mod controller;
mod ctrl_c;
mod demo;
mod end_signals;
mod exit;
mod files;
mod fleet;
mod latched;
mod load;
mod local;
mod manual;
mod mdi;
mod node;
mod node_message;
mod operate;
mod output_file;
mod page;
mod picture;
mod plan;
mod plan_machine;
mod replay_command;
mod resume;
mod router;
mod stack;
mod stack_replay;
mod status;
mod up;
mod waiting;
mod words;

use clap::{Parser, Subcommand};
use exit::{CommandResult, Failure, conclude};
use operate::Button;
use std::process::ExitCode;

/// A ROS 2 CNC machine node stack: part program in, compensated path out, every run on record.
///
/// This is not a safety function. Wire the emergency stop to the drives; Kerf does not replace it.
#[derive(Debug, Parser)]
#[command(name = "kerf", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run the whole stack on the virtual controller: load, plan, run, record, replay
    Demo(demo::DemoArgs),
    /// Start every node and keep it running; arguments for ROS after --ros-args
    Up(up::UpArgs),
    /// Run one node
    Node(node::NodeArgs),
    /// Run the router that nodes need under RMW_IMPLEMENTATION=rmw_zenoh_cpp
    Router,
    /// Compensate a program; no ROS needed
    Plan(plan::PlanArgs),
    /// Compare how each control reads a program
    Check(check::CheckArgs),
    /// Load a program into the running nodes
    Load(load::LoadArgs),
    /// Run the loaded program, or load one and run it
    Run(operate::RunArgs),
    /// Feed hold: decelerate and stop; the spindle keeps turning
    Hold,
    /// Resume after a hold
    Resume,
    /// Cancel the run, block, jog or probe: hold, then drop the rest
    Abort,
    /// Confirm that the requested tool is in the spindle, and resume
    Confirm,
    /// Home the axes. While homing, only a reset stops them; Ctrl-C sends it
    Home,
    /// Jog the axes: kerf jog X10 Y-2.5 --feed 500; Ctrl-C stops them
    Jog(manual::JogArgs),
    /// Move until a probe touches: kerf probe Z-20
    Probe(manual::ProbeArgs),
    /// Set the work offset so that the current position reads X0 Y0: kerf zero X0 Y0 --system G54
    Zero(manual::ZeroArgs),
    /// Set feed, rapid and spindle overrides: kerf override --feed 80
    Override(manual::OverrideArgs),
    /// Unlock the controller after an alarm, without homing
    Unlock,
    /// Soft-reset the controller at once; a moving machine loses its position
    Reset,
    /// Hold like an opened safety door: spindle and coolant off until `kerf resume`
    DoorHold,
    /// Put the controller to sleep; `kerf reset` wakes it
    Sleep,
    /// Turn single-block mode on or off: stop after every block until `kerf resume`
    SingleBlock(mdi::SingleBlockArgs),
    /// Run one block at standstill; Ctrl-C cancels it
    Mdi(mdi::MdiArgs),
    /// Change one tool or offset register: kerf tool T1 --wear -0.5
    Tool(mdi::ToolArgs),
    /// Settings of the controller's firmware
    #[command(subcommand)]
    Controller(controller::ControllerCommand),
    /// Show the state of the machine
    Status,
    /// Run today's code on recorded runs and compare
    Replay(replay_command::ReplayArgs),
    /// Inspect and repair bags
    #[command(subcommand)]
    Bag(bag::BagCommand),
    /// Store, replay and query bags of many machines; runs the program `kerf-fleet`
    Fleet(fleet::FleetArgs),
}

fn main() -> ExitCode {
    let words = match intake::arguments::words() {
        Ok(words) => words,
        Err(error) => return conclude(Err(Failure::usage(error))),
    };
    let (args, ros_args) = split_ros_args(words);
    let args = help_on_help(args);
    if let Some(renamed) = renamed_flag(&args) {
        return conclude(Err(Failure::usage(renamed)));
    }
    let cli = Cli::parse_from(std::iter::once("kerf".to_owned()).chain(args));
    if let Command::Node(args) = cli.command {
        return node::run(&args, ros_args);
    }
    // A node installs its own handler, once its log is set up.
    runtime::end_command_on_panic();
    conclude(run(cli.command, &ros_args))
}

/// Flags that had another name in earlier versions.
const RENAMED_FLAGS: [(&str, &str); 2] =
    [("--controller", "--control"), ("--all-controllers", "--all-controls")];

/// The message for the first flag that has another name now.
fn renamed_flag(args: &[String]) -> Option<String> {
    let flags = args.iter().take_while(|word| *word != "--");
    let names = flags.map(|word| word.split_once('=').map_or(word.as_str(), |(name, _)| name));
    names
        .filter_map(|name| RENAMED_FLAGS.iter().find(|(before, _)| *before == name))
        .map(|(before, now)| format!("{before} is called {now} now"))
        .next()
}

/// `kerf help --help` is `kerf --help`: to clap, `--help` would be a subcommand there.
fn help_on_help(args: Vec<String>) -> Vec<String> {
    match &args[..] {
        [help, flag] if help == "help" && ["--help", "-h"].contains(&flag.as_str()) => {
            vec![flag.clone()]
        }
        _ => args,
    }
}

fn run(command: Command, ros_args: &[String]) -> CommandResult {
    match command {
        Command::Demo(args) => demo::run(&args, ros_args),
        Command::Up(args) => up::run(&args, ros_args),
        Command::Node(_) => unreachable!("nodes have an exit code of their own"),
        Command::Router => router::run(),
        Command::Plan(args) => plan::run(&args),
        Command::Check(args) => check::run(&args),
        Command::Load(args) => load::load(&args, ros_args),
        Command::Run(args) => operate::run(&args, ros_args),
        Command::Hold => operate::press(Button::Hold, ros_args),
        Command::Resume => operate::press(Button::Resume, ros_args),
        Command::Abort => operate::abort(ros_args),
        Command::Confirm => operate::press(Button::Confirm, ros_args),
        Command::Home => manual::home(ros_args),
        Command::Jog(args) => manual::jog(&args, ros_args),
        Command::Probe(args) => manual::probe(&args, ros_args),
        Command::Zero(args) => manual::zero(&args, ros_args),
        Command::Override(args) => manual::set_overrides(&args, ros_args),
        Command::DoorHold => operate::press(Button::DoorHold, ros_args),
        Command::Sleep => operate::press(Button::Sleep, ros_args),
        Command::Unlock => operate::press(Button::Unlock, ros_args),
        Command::Reset => operate::press(Button::Reset, ros_args),
        Command::SingleBlock(args) => mdi::single_block(&args, ros_args),
        Command::Mdi(args) => mdi::mdi(&args, ros_args),
        Command::Tool(args) => mdi::tool(&args, ros_args),
        Command::Controller(command) => controller::run(&command, ros_args),
        Command::Status => status::run(ros_args),
        Command::Replay(args) => replay_command::run(&args),
        Command::Bag(command) => bag::run(&command),
        Command::Fleet(args) => fleet::run(&args),
    }
}

/// Removes every range from `--ros-args` to `--` or to the end; returns the rest and the ranges.
fn split_ros_args(all: Vec<String>) -> (Vec<String>, Vec<String>) {
    let (mut own, mut ros) = (Vec::new(), Vec::new());
    let mut is_ros = false;
    for arg in all {
        match (is_ros, arg.as_str()) {
            (_, "--ros-args") => {
                is_ros = true;
                ros.push(arg);
            }
            (true, "--") => {
                is_ros = false;
                ros.push(arg);
            }
            (true, _) => ros.push(arg),
            (false, _) => own.push(arg),
        }
    }
    (own, ros)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
    }

    #[test]
    fn arguments_for_ros_are_cut_out_anywhere() {
        let words = |text: &str| text.split(' ').map(String::from).collect::<Vec<_>>();
        let (own, ros) =
            split_ros_args(words("kerf load --ros-args -r __ns:=/mill -- part.ngc --ros-args"));
        assert_eq!(own, words("kerf load part.ngc"));
        assert_eq!(ros, words("--ros-args -r __ns:=/mill -- --ros-args"));
    }
}
