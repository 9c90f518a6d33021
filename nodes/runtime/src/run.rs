//! A node as a process: from the command line to the exit status.
//!
//! SIGINT, SIGTERM and SIGHUP request a shutdown; a second signal ends the process at
//! once. The node has thirty seconds to end (it may have to stop a machine or close a
//! bag). Then everything is torn down in the order that DDS needs.
//!
//! A node exits at once, without a shutdown, when its DDS layer no longer serves it, when it
//! takes too much memory, or when a thread panics. `supervision` is the protocol between a
//! node and its supervisor.
//!
//! Exit status: 0 success, 1 failure, 2 wrong arguments, environment or files, 70 deaf,
//! 71 too much memory, 101 panic, 130 second signal.

use crate::command_line::configuration::Configuration;
use crate::endpoints::node::Handle;
use crate::managed::lifecycle::{self, Managed};
use crate::parameters::common::{MEMORY_MB_MAX, autostart, of_process};
use crate::parameters::{Declared, ParameterValue};
use crate::process::console::write;
use crate::process::panic_guard::end_on_panic;
use crate::process::shutdown::Error;
use crate::process::supervision::Notifier;
use crate::process::watchdog::EndOfProcess;
use crate::rustdds::memory_bound::MemoryBound;
use crate::session::Session;
use futures::FutureExt;
use intake::text::lines;
use std::fmt::Display;
use std::panic::AssertUnwindSafe;
use std::process::ExitCode;
use std::time::Duration;
use tokio::signal::unix::{SignalKind, signal};

/// How long a node may take to end by itself.
const END_WITHIN: Duration = Duration::from_secs(30);

/// Runs a node with the command line of the process: the whole `main` of a node.
///
/// `node` is called with the started node and should return when
/// [`Handle::shutdown`] is requested.
pub fn run<F, Fut, E>(name: &str, declared: Vec<Declared>, node: F) -> ExitCode
where
    F: FnOnce(Handle) -> Fut,
    Fut: Future<Output = Result<(), E>>,
    E: Display,
{
    main_with(name, |words| run_with(name, declared, &words, node))
}

/// Calls `main` with the words of the command line: the whole `main` of a node.
///
/// A word that is not UTF-8 ends the process with status 2.
pub fn main_with(name: &str, main: impl FnOnce(Vec<String>) -> ExitCode) -> ExitCode {
    match intake::arguments::words() {
        Ok(words) => main(words),
        Err(error) => {
            complain(name, &error);
            ExitCode::from(2)
        }
    }
}

/// As [`run`], with the given words.
pub fn run_with<F, Fut, E>(
    name: &str,
    declared: Vec<Declared>,
    words: &[String],
    node: F,
) -> ExitCode
where
    F: FnOnce(Handle) -> Fut,
    Fut: Future<Output = Result<(), E>>,
    E: Display,
{
    // Variables that are not UTF-8 are not ours.
    let variables = std::env::vars_os()
        .filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)))
        .collect();
    let mut declared = declared;
    declared.extend(of_process());
    let configuration = match Configuration::read(name, declared, words, &variables) {
        Ok(configuration) => configuration,
        Err(error) => {
            complain(name, &error);
            return ExitCode::from(2);
        }
    };
    if let [word, ..] = &configuration.rest[..] {
        complain(name, &format!("argument \"{word}\" is not known; see --ros-args"));
        return ExitCode::from(2);
    }
    let executor = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .thread_name(name)
        .enable_all()
        .build();
    let executor = match executor {
        Ok(executor) => executor,
        Err(error) => {
            complain(name, &format!("cannot start threads: {error}"));
            return ExitCode::FAILURE;
        }
    };
    let is_good = executor.block_on(live(name, configuration, node));
    executor.shutdown_timeout(Duration::from_secs(1));
    if is_good { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Runs a managed node with the given words.
///
/// `start` makes the endpoints of the node, which are kept for life, and returns
/// what the node does when its state changes. A node that fails here, or that
/// cannot make itself active with `autostart`, ends.
pub fn run_managed<M, F, Fut>(
    name: &str,
    mut declared: Vec<Declared>,
    words: &[String],
    start: F,
) -> ExitCode
where
    M: Managed,
    F: FnOnce(Handle) -> Fut,
    Fut: Future<Output = Result<M, Error>>,
{
    declared.push(autostart());
    run_with(name, declared, words, |node| async move {
        let managed = start(node.clone()).await?;
        lifecycle::live(&node, managed).await
    })
}

/// Start, life and end; false when the node failed.
async fn live<F, Fut, E>(name: &str, configuration: Configuration, node: F) -> bool
where
    F: FnOnce(Handle) -> Fut,
    Fut: Future<Output = Result<(), E>>,
    E: Display,
{
    let lines = configuration.logs.install();
    let logger = configuration.logs.logger.clone();
    end_on_panic(&logger);
    for warning in &configuration.warnings {
        tracing::warn!("{warning}");
    }
    let memory = match configuration.parameters.get(MEMORY_MB_MAX) {
        Some(ParameterValue::Integer(megabytes)) => MemoryBound::of(*megabytes),
        _ => MemoryBound::usual(),
    };
    memory.enforce();
    let exceeded = Box::new(move || memory.exceeded());
    let end = EndOfProcess { logger, when_deaf: true, exceeded };
    let session = match Session::start_ruled(configuration, Some(end)) {
        Ok(session) => session,
        Err(error) => {
            complain(name, &error);
            return false;
        }
    };
    let handle = session.handle().clone();
    let notifier = Notifier::from_environment();
    session.report_to(notifier.clone());
    let prepared = lines.publish(&handle).map_err(|error| error.to_string());
    let prepared = prepared.and_then(|()| handle.announce_parameters().map_err(|e| e.to_string()));
    let prepared = prepared.and_then(|()| obey_signals(&handle).map_err(|e| e.to_string()));
    if let Err(error) = prepared {
        tracing::error!("{error}");
        session.stop().await;
        return false;
    }
    tracing::info!("{} started", handle.names().fully_qualified());
    notifier.ready();

    let ended = {
        let life = AssertUnwindSafe(node(handle.clone())).catch_unwind();
        let mut life = std::pin::pin!(life);
        tokio::select! {
            ended = &mut life => Some(ended),
            () = handle.shutdown().requested() => {
                notifier.stopping();
                tokio::time::timeout(END_WITHIN, &mut life).await.ok()
            }
        }
    };
    let is_good = match ended {
        Some(Ok(Ok(()))) => !handle.shutdown().is_failure(),
        Some(Ok(Err(error))) => {
            tracing::error!("{error}");
            false
        }
        // The panic itself is in the log already.
        Some(Err(_)) => false,
        None => {
            tracing::error!("did not stop within {} s; it is ended by force", END_WITHIN.as_secs());
            false
        }
    };
    // Also when the node ended by itself.
    notifier.stopping();
    let reason = handle.shutdown().reason().unwrap_or_else(|| "its work is done".to_owned());
    tracing::info!("{} stops: {reason}", handle.names().fully_qualified());
    drop(handle);
    session.stop().await;
    is_good
}

fn obey_signals(handle: &Handle) -> std::io::Result<()> {
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    // The terminal of the node was closed.
    let mut hangup = signal(SignalKind::hangup())?;
    let shutdown = handle.shutdown().clone();
    // Not a task of the node: it has to live until the process ends.
    tokio::spawn(async move {
        loop {
            let name = tokio::select! {
                _ = interrupt.recv() => "SIGINT",
                _ = terminate.recv() => "SIGTERM",
                _ = hangup.recv() => "SIGHUP",
            };
            if shutdown.is_requested() {
                std::process::exit(130);
            }
            shutdown.request(name);
        }
    });
    Ok(())
}

/// Writes an error to the console, before there is a log.
pub fn complain(name: &str, error: &dyn Display) {
    let text = format!("{name}: {error}\n");
    write(&lines(&text));
}
