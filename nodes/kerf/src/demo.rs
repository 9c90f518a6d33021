//! `kerf demo`: the whole stack on this host, without hardware.
//!
//! Starts the nodes as separate processes and the virtual controller on a pseudo-terminal, loads
//! the SINUMERIK contour with G41, runs it through the action, waits for its bag, stops everything
//! and replays the bag. It uses the same commands as a user.

use crate::exit::{CommandResult, Failure, Status};
use crate::output_file::OutputFile;
use crate::plan::Planned;
use crate::stack::{Stack, remove_dead_link};
use crate::up::STOP_ORDER;
use crate::{files, load, operate};
use clap::Args;
use cnc_msgs::wire::cnc_msgs::action::RunProgramGoal;
use cnc_msgs::wire::cnc_msgs::msg::{MachineState, Recording};
use program_loader::LoadOptions;
use runtime::{Handle, Qos, Session, Subscription};
use std::path::{Path, PathBuf};
use std::time::Duration;
use tokio::signal::unix::{SignalKind, signal};
use tokio::time::timeout;

const PROGRAM: &str = include_str!("../../../config/demo/contour.mpf");
const TOOLS: &str = include_str!("../../../config/demo/tools.yaml");
const CONTROL: &str = "sinumerik_840c";
/// How much faster than a real machine the axes move.
const TIME_FACTOR: &str = "10";
/// How long the nodes and the controller may take to start.
const READY_WITHIN: Duration = Duration::from_secs(30);
/// How long the recorder may take to close the bag after the run.
const CLOSED_WITHIN: Duration = Duration::from_secs(30);

/// What `kerf demo` takes.
#[derive(Debug, Args)]
pub(crate) struct DemoArgs {
    /// Directory for the bag and the picture
    #[arg(long, value_name = "DIR", default_value = "kerf-demo")]
    out: PathBuf,
}

/// Runs the demo and prints three lines at the end.
pub(crate) fn run(args: &DemoArgs, ros_args: &[String]) -> CommandResult {
    let out = prepare(&args.out)?;
    let executor = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(Failure::usage)?;
    let bag = executor.block_on(with_stack(&out, ros_args))?;

    let picture = out.join("contour.svg");
    draw(&picture)?;
    let (reproduced, report) = replay::check(&bag)
        .map_err(|error| Failure::new(Status::Refused, format!("replay failed: {error}")))?;
    if !reproduced {
        eprint!("{report}");
        return Err(Failure::new(Status::Refused, "the replay did not reproduce the run"));
    }
    println!("bag:     {}", bag.display());
    println!("picture: {}", picture.display());
    println!("replay:  reproduced the run");
    Ok(())
}

/// Makes the directory of the results and puts the demo's inputs into it.
fn prepare(out: &Path) -> Result<PathBuf, Failure> {
    std::fs::create_dir_all(out)
        .map_err(|error| Failure::usage(format_args!("cannot make {}: {error}", out.display())))?;
    let out = std::path::absolute(out).map_err(Failure::usage)?;
    files::place(&out.join("contour.mpf"), PROGRAM)?;
    files::place(&out.join("tools.yaml"), TOOLS)?;
    Ok(out)
}

/// Starts everything, does the job, and stops everything in any case.
async fn with_stack(out: &Path, ros_args: &[String]) -> Result<PathBuf, Failure> {
    let mut interrupt = signal(SignalKind::interrupt()).map_err(Failure::usage)?;
    let mut terminate = signal(SignalKind::terminate()).map_err(Failure::usage)?;
    let mut controller = Stack::new().map_err(Failure::usage)?;
    let mut nodes = Stack::new().map_err(Failure::usage)?;
    let link = std::env::temp_dir().join(format!("kerf-demo-{}", std::process::id()));

    let done = tokio::select! {
        done = job(out, ros_args, &link, &mut controller, &mut nodes) => done,
        _ = interrupt.recv() => Err(Failure::new(Status::NodeRefused, "interrupted")),
        _ = terminate.recv() => Err(Failure::new(Status::NodeRefused, "terminated")),
    };
    let mut troubles = nodes.stop().await;
    troubles.extend(controller.stop().await);
    remove_dead_link(&link);
    let bag = done?;
    if troubles.is_empty() {
        Ok(bag)
    } else {
        Err(Failure::new(
            Status::NodeRefused,
            format!("the stack did not stop cleanly: {}", troubles.join("; ")),
        ))
    }
}

async fn job(
    out: &Path,
    ros_args: &[String],
    link: &Path,
    controller: &mut Stack,
    nodes: &mut Stack,
) -> Result<PathBuf, Failure> {
    let step = |what: &str| eprintln!("kerf: {what}");
    step("starting the virtual controller");
    let port = link.display().to_string();
    controller
        .start(
            "virtual_controller",
            &["--link", &port, "--time-factor", TIME_FACTOR].map(String::from),
        )
        .map_err(Failure::usage)?;
    controller.wait_for_file(link).await?;

    step("starting the nodes");
    let namespace = format!("__ns:=/kerf_demo_{}", std::process::id());
    let own = |extra: &[String]| {
        let mut args = ros_args.to_vec();
        args.extend(["--ros-args", "-r", &namespace].map(String::from));
        args.extend_from_slice(extra);
        args.push("--".to_owned());
        args
    };
    let parameters = [
        ("axis_driver", "port", port),
        // The axes are faster than their settings say, by the time factor.
        ("axis_driver", "rate_margin", "50.0".to_owned()),
        ("compensation_planner", "tool_table", out.join("tools.yaml").display().to_string()),
        ("run_recorder", "directory", out.display().to_string()),
    ]
    .iter()
    .flat_map(|(node, name, value)| ["-p".to_owned(), format!("{node}:{name}:={value}")])
    .collect::<Vec<_>>();
    for name in STOP_ORDER {
        nodes.start(name, &own(&parameters)).map_err(Failure::usage)?;
    }

    let session = operate::client_session(&own(&[]))?;
    let done = tokio::select! {
        done = commission(&session, out) => done,
        name = died(nodes) => Err(Failure::new(Status::NodeRefused, format!("{name} ended by itself"))),
    };
    session.stop().await;
    done
}

/// Waits for the first node that ends.
async fn died(nodes: &mut Stack) -> String {
    loop {
        if let Some((name, status)) = nodes.ended() {
            return format!("{name} ({status})");
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
}

/// The commander's part: waits for the machine, loads, runs, waits for the bag.
async fn commission(session: &Session, out: &Path) -> Result<PathBuf, Failure> {
    let node: &Handle = session.handle();
    let mut recordings: Subscription<Recording> = node.subscription("recording", Qos::LATCHED)?;
    let mut states: Subscription<MachineState> =
        node.subscription("machine_state", Qos::LATCHED)?;
    let ready =
        wait_until(&mut states, READY_WITHIN, |state| state.state == MachineState::STATE_IDLE);
    ready.await.map_err(|state| {
        let found = state.map_or("no machine_state was received".to_owned(), |state| state.reason);
        Failure::new(Status::NoAnswer, format!("the machine is not ready: {found}"))
    })?;
    // The demo needs the recorder: it shows the recorded run.
    wait_until(&mut recordings, READY_WITHIN, |_| true)
        .await
        .map_err(|_| Failure::new(Status::NoAnswer, "the recorder does not answer"))?;

    let program_id = load::load_file(node, &out.join("contour.mpf"), CONTROL, "").await?;
    let goal = RunProgramGoal { program_id, ..RunProgramGoal::default() };
    let result = operate::run_goal(node, goal, &operate::progress_bar()).await?;
    eprintln!("kerf: {}", result.message);

    let closed = wait_until(&mut recordings, CLOSED_WITHIN, |recording| {
        !recording.is_recording && !recording.run_id.is_empty()
    });
    let recording = closed.await.map_err(|_| {
        Failure::new(Status::NoAnswer, "the recorder did not close the bag of the run")
    })?;
    if !recording.complete {
        return Err(Failure::new(
            Status::NodeRefused,
            format!("{} is not complete: {}", recording.uri, recording.reason),
        ));
    }
    Ok(PathBuf::from(recording.uri))
}

/// The first message that fulfils the condition, or the last one that does not.
async fn wait_until<M: cnc_msgs::interface::Message>(
    subscription: &mut Subscription<M>,
    within: Duration,
    is_wanted: impl Fn(&M) -> bool,
) -> Result<M, Option<M>> {
    let mut last = None;
    let wanted = timeout(within, async {
        loop {
            let (message, _) = subscription.next().await;
            if is_wanted(&message) {
                break message;
            }
            last = Some(message);
        }
    });
    match wanted.await {
        Ok(message) => Ok(message),
        Err(_) => Err(last),
    }
}

fn draw(path: &Path) -> Result<(), Failure> {
    let profile = files::profile(CONTROL)?;
    let tools = settings::yaml::from_yaml_str(TOOLS, "tools.yaml").map_err(Failure::usage)?;
    let planned = Planned::new(
        PROGRAM.as_bytes(),
        &profile,
        &tools,
        &LoadOptions::default(),
        compensation_planner::Planning::default(),
    );
    let title = "contour.mpf, G41, radius 5 mm";
    OutputFile::claim(path, &[])?.write(|to| planned.write_svg(to, title, &profile))
}
