//! `kerf up`: runs every node, supervised, until Ctrl-C.

use crate::exit::{CommandResult, Failure, Status};
use crate::node::parameters_of;
use crate::stack::{Stack, remove_dead_link};
use clap::Args;
use runtime::arguments::Arguments;
use runtime::lifecycle::AUTOSTART;
use runtime::parameters::ParameterValue;
use runtime::stack_parameters::StackParameters;
use std::path::PathBuf;
use tokio::signal::unix::{SignalKind, signal};
use virtual_controller::{AxisLetters, Firmware, Listen, Scenario, read_scenario};

/// The order in which the nodes are stopped: the machine first, its recorder last.
pub(crate) const STOP_ORDER: [&str; 4] =
    ["axis_driver", "compensation_planner", "program_loader", "run_recorder"];

/// What `kerf up` takes.
#[derive(Debug, Args)]
pub(crate) struct UpArgs {
    /// ROS 2 parameter file for all nodes
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Also start a virtual controller, and connect the driver to it
    #[arg(long)]
    virtual_controller: bool,
    /// Run the virtual controller this many times faster than real time [default: 1]
    #[arg(long, value_name = "N", value_parser = time_factor, requires = "virtual_controller")]
    time_factor: Option<f64>,
    /// Firmware of the virtual controller: grbl, grblhal or fluidnc
    #[arg(long, value_name = "NAME", requires = "virtual_controller")]
    firmware: Option<Firmware>,
    /// Axes of the virtual controller: XYZ and up to three of A, B, C, U, V and W
    #[arg(long, value_name = "LETTERS", requires = "virtual_controller")]
    axes: Option<AxisLetters>,
    /// Scenario of the virtual controller: its build, settings and faults
    #[arg(long, value_name = "FILE", requires = "virtual_controller")]
    scenario: Option<PathBuf>,
    /// Let the virtual controller listen on a network: tcp://127.0.0.1:7023, ws://127.0.0.1:7081 or
    /// rfc2217://127.0.0.1:7217
    #[arg(long, value_name = "URL", value_parser = listen, requires = "virtual_controller")]
    listen: Option<Listen>,
}

/// The folders in which the loader looks up files: its parameters', and the current one, so that
/// commands typed in this folder can name its files.
fn folders(read: &StackParameters) -> Vec<String> {
    let Some(here) =
        std::env::current_dir().ok().and_then(|here| here.into_os_string().into_string().ok())
    else {
        // Such a file cannot be named over ROS.
        return Vec::new();
    };
    let mut words = vec!["--ros-args".to_owned()];
    for name in ["program_directories", "subroutine_directories", "control_directories"] {
        let given = read.nodes["program_loader"].get(name).cloned();
        let mut all: Vec<String> =
            given.and_then(|folders| folders.try_into().ok()).unwrap_or_default();
        all.push(here.clone());
        words.push("-p".to_owned());
        // JSON is YAML.
        words.push(format!("program_loader:{name}:={}", serde_json::json!(all)));
    }
    words.push("--".to_owned());
    words
}

/// A valid time factor of the virtual controller.
fn time_factor(text: &str) -> Result<f64, String> {
    let factor = text.parse().ok().filter(|factor| (0.001..=10_000.0).contains(factor));
    factor.ok_or_else(|| format!("{text:?} is not a factor from 0.001 to 10000"))
}

/// Where the virtual controller listens, with a port number that the driver can be given.
fn listen(text: &str) -> Result<Listen, String> {
    let listen: Listen = text.parse()?;
    match listen.address.port() {
        0 => Err(format!("{text:?} names no port: choose a number from 1 to 65535, such as 7023")),
        _ => Ok(listen),
    }
}

/// Reads the tool table once before the planner does, which would be started again and again
/// without it. A planner that others configure later may get its table later, too.
fn check_tool_table(read: &StackParameters) -> CommandResult {
    let of_planner = |name: &str| read.nodes["compensation_planner"].get(name).cloned();
    let is_read_now = of_planner(AUTOSTART) == Some(ParameterValue::Bool(true));
    match of_planner("tool_table") {
        Some(ParameterValue::String(path)) if is_read_now && !path.is_empty() => {
            let read = settings::load_tool_table(path.as_ref());
            read.map(|_| ()).map_err(|error| Failure::usage(format_args!("tool_table: {error}")))
        }
        _ => Ok(()),
    }
}

/// Starts the nodes, restarts those that fail, stops all in order.
pub(crate) fn run(args: &UpArgs, ros_args: &[String]) -> CommandResult {
    let executor = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .map_err(Failure::usage)?;
    executor.block_on(supervise(args, ros_args))
}

async fn supervise(args: &UpArgs, ros_args: &[String]) -> CommandResult {
    let mut node_args = ros_args.to_vec();
    if let Some(config) = &args.config {
        // One error for a missing file, instead of one from every node.
        std::fs::metadata(config).map_err(|error| {
            Failure::usage(format_args!("cannot read {}: {error}", config.display()))
        })?;
        // First, because later arguments of the command line override it.
        let mut first = vec![
            "--ros-args".to_owned(),
            "--params-file".to_owned(),
            config.display().to_string(),
            "--".to_owned(),
        ];
        first.append(&mut node_args);
        node_args = first;
    }
    let mut interrupt = signal(SignalKind::interrupt()).map_err(Failure::usage)?;
    let mut terminate = signal(SignalKind::terminate()).map_err(Failure::usage)?;
    let mut stack = Stack::new().map_err(Failure::usage)?;
    let mut controller = Stack::new().map_err(Failure::usage)?;
    let link = std::env::temp_dir().join(format!("kerf-{}-controller", std::process::id()));
    if let Some(listen) = args.listen {
        // The driver would connect to whatever listens there already.
        let free = std::net::TcpListener::bind(listen.address).map_err(|error| {
            let what = match error.kind() {
                std::io::ErrorKind::AddrInUse => "the address is in use",
                _ => "nothing can listen there",
            };
            Failure::usage(format_args!(
                "--listen {listen}: {what}: {error}; a rehearsal must not reach what listens there"
            ))
        })?;
        drop(free);
    }
    if let Some(scenario) = &args.scenario {
        let replace = |it: &mut Scenario| {
            it.firmware = args.firmware.or(it.firmware);
            it.axes = args.axes.or(it.axes);
        };
        read_scenario(scenario, replace)
            .map_err(|why| Failure::usage(format_args!("--scenario: {why}")))?;
    }
    if args.virtual_controller {
        let (flag, port) = match args.listen {
            Some(listen) => ("--listen", listen.to_string()),
            None => ("--link", link.display().to_string()),
        };
        let mut controller_args = vec![flag.to_owned(), port.clone()];
        for (flag, value) in [
            ("--time-factor", args.time_factor.map(|factor| factor.to_string())),
            ("--firmware", args.firmware.map(|firmware| firmware.to_string())),
            ("--axes", args.axes.map(|axes| axes.all().iter().collect())),
            ("--scenario", args.scenario.as_ref().map(|file| file.display().to_string())),
        ] {
            controller_args.extend(value.into_iter().flat_map(|value| [flag.to_owned(), value]));
        }
        controller.start("virtual_controller", &controller_args).map_err(Failure::usage)?;
        if args.listen.is_none() {
            // The driver connects again and again to a network port.
            controller.wait_for_file(&link).await?;
        }
        let mut words =
            vec!["--ros-args".to_owned(), "-p".into(), format!("axis_driver:port:={port}")];
        if let Some(factor) = args.time_factor.filter(|factor| *factor > 1.0) {
            // The axes are faster than their settings say, by the time factor.
            words.extend(["-p".to_owned(), format!("axis_driver:rate_margin:={:?}", 5.0 * factor)]);
        }
        words.push("--".into());
        node_args.extend(words);
    }
    let declared = STOP_ORDER.map(|name| (name, parameters_of(name)));
    let read = StackParameters::read(declared.into(), &node_args).map_err(Failure::usage)?;
    for warning in &read.warnings {
        eprintln!("kerf: {warning}");
    }
    check_tool_table(&read)?;
    node_args.extend(folders(&read));
    let enclave = Arguments::parse(ros_args).map_err(Failure::usage)?.enclave;
    for name in STOP_ORDER {
        let mut args = node_args.clone();
        if let Some(enclave) = &enclave {
            // Each node has its own keys, below the given enclave.
            let own = format!("{}/{name}", enclave.trim_end_matches('/'));
            args.extend(["--ros-args", "--enclave", &own, "--"].map(String::from));
        }
        stack.start(name, &args).map_err(Failure::usage)?;
    }
    let trouble = tokio::select! {
        _ = interrupt.recv() => None,
        _ = terminate.recv() => None,
        // A stack whose children were all shut down waits for the other, or for a signal.
        Some(trouble) = stack.supervise() => Some(trouble),
        Some(trouble) = controller.supervise() => Some(trouble),
    };
    eprintln!("kerf: stopping");
    let mut troubles = stack.stop().await;
    troubles.extend(controller.stop().await);
    remove_dead_link(&link);
    match trouble {
        Some(trouble) => Err(Failure::new(Status::Usage, trouble)),
        None if troubles.is_empty() => Ok(()),
        None => Err(Failure::new(Status::NodeRefused, troubles.join("; "))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loader_reads_from_the_folders_of_its_parameters_and_from_this_one() {
        let words = ["--ros-args", "-p", "program_loader:program_directories:=[/parts]"];
        let words: Vec<String> = words.map(str::to_owned).into();
        let declared = || STOP_ORDER.map(|name| (name, parameters_of(name))).into();
        let read = StackParameters::read(declared(), &words).expect("valid");
        let read = StackParameters::read(declared(), &[words, folders(&read)].concat());
        let here = std::env::current_dir().expect("a folder").display().to_string();
        let loader = &read.expect("valid").nodes["program_loader"];
        let expected = vec!["/parts".to_owned(), here.clone()];
        assert_eq!(loader.get("program_directories"), Some(&expected.into()));
        assert_eq!(loader.get("control_directories"), Some(&vec![here].into()));
    }
}
