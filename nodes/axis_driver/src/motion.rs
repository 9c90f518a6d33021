//! The motion process: it owns the serial line, the driver and its journal.
//!
//! It speaks no DDS, opens no connection but the one to the controller, and reads no file that
//! a peer names. Its ROS side is a child process, which may die, hang or be stopped: then it is
//! started again, and goes on where the last one was, while the line is served. A local
//! operator can stop the machine and read its state over a socket with a name, without ROS.

// This is where the clock, the threads and the processes are.
#![allow(clippy::disallowed_methods, clippy::disallowed_types)]

mod connection;
mod face;
mod hub;
mod memory;
mod operator;
mod reading;

pub(crate) use face::FACE_VARIABLE;
pub use operator::{OperatorError, ask_operator};

use crate::driver::Command;
use crate::node::{check_approach, declared, keep_out, serial_config};
use crate::serial::Serial;
use face::{Ended, Face};
use hub::Hub;
use runtime::configuration::Configuration;
use runtime::supervision::Notifier;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::sync_channel;
use std::time::{Duration, Instant};

/// Events and entries that may wait for the hub.
const WAITING_MAX: usize = 16_384;
/// How often the face is looked after.
const TICK: Duration = Duration::from_millis(50);
/// How many ticks lie between two signs of life for the supervisor of this process.
const ALIVE_TICKS: u32 = 10;
/// A driver that does not come round for so long hangs, and is not said to be alive.
const TURN_WITHIN: Duration = Duration::from_secs(3);
/// How long the face may take to bring everything to an end: it gives the machine 25 s.
const FACE_ENDS_WITHIN: Duration = Duration::from_secs(28);
/// The same with what this process does without a face. `kerf up` and systemd kill it after 40 s.
pub const ALL_ENDS_WITHIN: Duration = Duration::from_secs(38);

/// Runs the driver until it is asked to stop.
///
/// `program` are the words with which this executable becomes this node: none for a program
/// of its own, `node axis_driver` for `kerf`.
pub fn main(program: &[&str], args: &[String]) -> ExitCode {
    let configuration = match Configuration::of_process("axis_driver", declared(), args) {
        Ok(configuration) => configuration,
        Err(error) => return complain(&error, 2),
    };
    runtime::end_command_on_panic();
    // What it says goes to the console; the face has a topic for what it says itself.
    configuration.logs.install_console();
    let signals = Arc::new(AtomicUsize::new(0));
    for signal in [SIGTERM, SIGINT, SIGHUP] {
        if let Err(error) = count_signal(signal, &signals) {
            return complain(&error, 1);
        }
    }
    let parameter = |name: &str| {
        configuration
            .parameters
            .get(name)
            .cloned()
            .expect("every parameter that is asked for is declared")
    };
    let mut config = serial_config(parameter);
    if let Err(error) = check_approach(parameter) {
        return complain(&error, 2);
    }
    match keep_out(parameter) {
        Ok(boxes) => config.driver.keep_out = boxes,
        Err(error) => return complain(&format!("keep_out: {error}"), 2),
    }
    let (event_sender, events) = sync_channel(WAITING_MAX);
    let (entry_sender, entries) = sync_channel(WAITING_MAX);
    let hub = Serial::start(config, event_sender, entry_sender)
        .and_then(|serial| Hub::start(serial, events, entries, memory::Collected::checked));
    let hub = match hub {
        Ok(hub) => hub,
        Err(error) => return complain(&error, 1),
    };
    // The core would begin at once what it is asked for; the lifecycle activates it.
    hub.order(&Command::Deactivate);
    let listens = operator::listen(&hub, &configuration);
    if let Err(error) = &listens {
        tracing::warn!("a local operator cannot stop the machine without ROS: {error}");
    }
    let words: Vec<String> =
        program.iter().map(|word| (*word).to_owned()).chain(args.iter().cloned()).collect();
    let code = supervise(&hub, &words, &signals);
    // Another driver's socket is left alone.
    if listens.is_ok() {
        operator::forget(&configuration);
    }
    ExitCode::from(code)
}

/// Keeps a face alive until it is time to stop; the exit status of this process.
fn supervise(hub: &Arc<Hub>, words: &[String], signals: &AtomicUsize) -> u8 {
    let mut face = Face::new(words.to_vec());
    let mut stopping: Option<Instant> = None;
    let notifier = Notifier::from_environment();
    let mut is_ready = false;
    let mut ticks = 0_u32;
    let (mut turns, mut turned) = (hub.serial().turns(), Instant::now());
    let mut last_tick = Instant::now();
    loop {
        std::thread::sleep(TICK);
        // A tick that came late says that this process was held up, not the face.
        let is_on_time = last_tick.elapsed() < TICK * 4;
        last_tick = Instant::now();
        ticks = ticks.wrapping_add(1);
        let now = hub.serial().turns();
        if ticks.is_multiple_of(ALIVE_TICKS) {
            // The driver itself has to live: it comes round once a second at least.
            if now != turns {
                (turns, turned) = (now, Instant::now());
            }
            if turned.elapsed() < TURN_WITHIN {
                notifier.alive();
            }
        }
        let asked = signals.load(Ordering::Relaxed);
        if asked > 1 {
            face.kill();
            return 130;
        }
        if asked > 0 && stopping.is_none() {
            stopping = Some(Instant::now());
            notifier.stopping();
            face.terminate();
        }
        if !is_ready && face.was_ready() {
            is_ready = true;
            notifier.ready();
        }
        match face.look(hub, is_on_time, stopping.is_some()) {
            Ended::No => {}
            Ended::AsAsked(code) => {
                let since = stopping.unwrap_or_else(Instant::now);
                return if shut_down(hub, since + ALL_ENDS_WITHIN) { code } else { 1 };
            }
        }
        if let Some(since) = stopping
            && since.elapsed() > FACE_ENDS_WITHIN
        {
            tracing::error!("the ROS side did not end within {} s", FACE_ENDS_WITHIN.as_secs());
            face.kill();
            return if shut_down(hub, since + ALL_ENDS_WITHIN) { 1 } else { 130 };
        }
    }
}

/// Brings the machine to a stop, where the face has not.
fn shut_down(hub: &Hub, until: Instant) -> bool {
    if hub.is_closed() {
        return true;
    }
    hub.order(&Command::Shutdown);
    while Instant::now() < until {
        if hub.is_closed() {
            return true;
        }
        std::thread::sleep(TICK);
    }
    tracing::error!("the machine was not brought to a stop; it may still move");
    false
}

fn count_signal(signal: i32, count: &Arc<AtomicUsize>) -> std::io::Result<()> {
    let (receiver, sender) = std::os::unix::net::UnixStream::pair()?;
    signal_hook::low_level::pipe::register(signal, sender)?;
    let count = Arc::clone(count);
    std::thread::Builder::new().name("signals".into()).spawn(move || {
        let mut byte = [0];
        while std::io::Read::read(&mut &receiver, &mut byte).is_ok_and(|read| read > 0) {
            match signal {
                // A terminal that goes says so more than once.
                SIGHUP => count.fetch_max(1, Ordering::Relaxed),
                _ => count.fetch_add(1, Ordering::Relaxed),
            };
        }
    })?;
    Ok(())
}

/// Before there is a log.
fn complain(error: &dyn std::fmt::Display, code: u8) -> ExitCode {
    runtime::complain("axis_driver", error);
    ExitCode::from(code)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_driver_ends_before_systemd_kills_it_with_time_for_a_stop_without_a_face() {
        let service = include_str!("../../../config/systemd/kerf-node@.service");
        let allowed = service.lines().find_map(|line| line.strip_prefix("TimeoutStopSec="));
        let allowed = Duration::from_secs(allowed.expect("a bound").parse().expect("seconds"));
        assert!(ALL_ENDS_WITHIN + Duration::from_secs(1) < allowed);
        assert!(FACE_ENDS_WITHIN + Duration::from_secs(10) <= ALL_ENDS_WITHIN);
    }
}
