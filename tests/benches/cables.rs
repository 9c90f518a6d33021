//! Measures how long a feed hold takes over each cable, in one run.
//!
//! ```text
//! cargo bench -p kerf_tests --bench cables                  300 holds over each, in turn
//! cargo bench -p kerf_tests --bench cables -- --holds 1000
//! cargo bench -p kerf_tests --bench cables -- --test        5
//! ```
//!
//! A driver without its ROS side streams a long program to a virtual controller (grblHAL, real time) over
//! a pseudo-terminal of 115 200 Bd, TCP, a WebSocket and RFC 2217 (a serial line of 115 200 Bd). The time
//! runs from the command to the board's reading of `!`, which is in the same process. At p99 no cable may take
//! 2 ms more than the pseudo-terminal.

#![allow(clippy::print_stdout)]

use axis_driver::driver::{Command, DriverConfig, Output, RunRequest};
use axis_driver::serial::{Event, Reopen, Serial, SerialConfig};
use cnc_msgs::contour::Source;
use cnc_msgs::geometry::{AxisSet, Shape};
use cnc_msgs::machine::{MachineState, Mode};
use cnc_msgs::path::{CompensatedPath, PathElement, Role};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};
use std::time::{Duration, Instant};
use virtual_controller::{
    Build, Controller, Device, Firmware, LineEvents, LineTiming, Settings, StopHandle,
    serve_device, serve_device_on, stop_pair,
};

/// The requirement: at p99 a hold takes at most this much longer than over the pseudo-terminal, ms.
const BEYOND_TERMINAL_MS_MAX: f64 = 2.0;
const PATIENCE: Duration = Duration::from_secs(30);

/// A controller that says when it reads a hold.
struct Watched {
    controller: Controller,
    holds: Sender<Instant>,
}

impl Device for Watched {
    fn receive(&mut self, now: Duration, bytes: &[u8]) {
        if bytes.contains(&b'!') {
            let _ = self.holds.send(Instant::now());
        }
        self.controller.receive(now, bytes);
    }

    fn advance(&mut self, now: Duration) {
        self.controller.advance(now);
    }

    fn transmit(&mut self, to: &mut Vec<u8>) {
        self.controller.transmit(to);
    }

    fn next_event(&self, now: Duration) -> Option<Duration> {
        self.controller.next_event(now)
    }

    fn take_line_events(&mut self) -> LineEvents {
        LineEvents::default()
    }
}

/// A driver that runs a program on a board, over one cable.
struct Line {
    name: &'static str,
    serial: Serial,
    events: Receiver<Event>,
    state: MachineState,
    holds: Receiver<Instant>,
    next_id: u64,
    times_ms: Vec<f64>,
    _board: (StopHandle, tempfile::TempDir),
}

impl Line {
    fn start(name: &'static str, listen: Option<&str>) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let link = folder.path().join("port");
        let (holds_in, holds) = channel();
        let settings = Settings::small_router_of(Firmware::GrblHal);
        let controller = Controller::with_build(Build::new(settings));
        let device = Watched { controller, holds: holds_in };
        let is_networked = matches!(name, "TCP" | "WebSocket");
        let baud = (!is_networked).then_some(115_200);
        let timing = LineTiming { baud, ..LineTiming::default() };
        let (handle, stop) = stop_pair().expect("a pipe");
        let (ready, url) = channel();
        let listen = listen.map(|url| url.parse().expect("a URL"));
        std::thread::spawn(move || {
            let often = Duration::from_secs(1);
            let served = match listen {
                Some(listen) => serve_device_on(device, timing, listen, often, &stop, |at| {
                    ready.send(at.to_string()).expect("it is waited for");
                }),
                None => serve_device(device, timing, &link, often, &stop, || {
                    ready.send(link.display().to_string()).expect("it is waited for");
                }),
            };
            served.expect("it serves to its end");
        });
        let path = url.recv_timeout(PATIENCE).expect("a board");
        let (events_in, events) = sync_channel(100_000);
        let (journal, _) = sync_channel(1);
        let driver = DriverConfig { is_networked, ..DriverConfig::default() };
        let config = SerialConfig { path, dtr: None, rts: None, reopen: Reopen::WhenTold, driver };
        let serial = Serial::start(config, events_in, journal).expect("threads");
        serial.open().expect("room");
        let state = MachineState::default();
        let times_ms = Vec::new();
        let _board = (handle, folder);
        let mut line = Self { name, serial, events, state, holds, next_id: 1, times_ms, _board };
        line.until(Mode::Idle);
        let request = RunRequest {
            program_id: "part".into(),
            revision: 0,
            path: Arc::new(zigzag(400_000)),
            start_line: 0,
            occurrence: 0,
            in_span: Default::default(),
            check_only: false,
            tool_diameters_mm: Default::default(),
        };
        line.command(Command::RunProgram(request));
        line.until(Mode::Run);
        line
    }

    fn command(&mut self, command: Command) {
        self.serial.command(self.next_id, command).expect("room");
        self.next_id += 1;
    }

    /// Takes a state, if one comes soon.
    fn take(&mut self) {
        let Ok(event) = self.events.recv_timeout(Duration::from_millis(20)) else { return };
        if let Output::State(state) = event.output {
            self.state = state;
        }
    }

    fn until(&mut self, mode: Mode) {
        let begin = Instant::now();
        while self.state.mode != mode {
            assert!(begin.elapsed() < PATIENCE, "{}: not {mode:?}: {:?}", self.name, self.state);
            self.take();
        }
    }

    /// Asks until the axes have come to a stop, and the run goes on.
    fn resume(&mut self) {
        let begin = Instant::now();
        while self.state.mode != Mode::Run {
            assert!(begin.elapsed() < PATIENCE, "{}: held: {:?}", self.name, self.state);
            self.command(Command::Resume);
            let asked = Instant::now();
            while self.state.mode != Mode::Run && asked.elapsed() < Duration::from_millis(100) {
                self.take();
            }
        }
    }

    fn hold(&mut self) {
        let begin = Instant::now();
        self.command(Command::FeedHold);
        let at = self.holds.recv_timeout(PATIENCE).expect("a hold arrives");
        self.times_ms.push((at - begin).as_secs_f64() * 1e3);
        self.until(Mode::Hold);
        self.resume();
        // The buffers are full again, and each hold comes at another moment of the stream.
        std::thread::sleep(Duration::from_millis(60 + 7 * (self.next_id % 13)));
        while let Ok(event) = self.events.try_recv() {
            if let Output::State(state) = event.output {
                self.state = state;
            }
        }
        while self.holds.try_recv().is_ok() {}
    }
}

/// Segments of 0.4 mm, as fast as the machine takes them.
fn zigzag(count: u32) -> CompensatedPath {
    let element = |line: u32| PathElement {
        side: None,
        shape: Shape::Line,
        end: [f64::from(line % 500) * 0.4, f64::from(line % 2) * 0.1, 0.0],
        feed_mm_per_min: Some(5000.0),
        role: Role::None,
        axes: AxisSet::NONE.with(0).with(1),
        source: Source { line, ..Source::default() },
    };
    CompensatedPath { elements: (1..=count).map(element).collect(), ..Default::default() }
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let given = words.iter().position(|word| word == "--holds").and_then(|at| words.get(at + 1));
    let is_test = words.iter().any(|word| word == "--test");
    let holds =
        given.map_or(if is_test { 5 } else { 300 }, |holds| holds.parse().expect("a number"));
    let cables = [
        ("pseudo-terminal", None),
        ("TCP", Some("tcp://127.0.0.1:0")),
        ("WebSocket", Some("ws://127.0.0.1:0")),
        ("RFC 2217", Some("rfc2217://127.0.0.1:0")),
    ];
    println!("{holds} holds over each cable; ms from the command to the board's reading of `!`\n");
    println!("| | p50 | p90 | p99 | most |\n|---|---|---|---|---|");
    let mut terminal_ms = None;
    let mut is_met = true;
    let mut lines = cables.map(|(name, listen)| Line::start(name, listen));
    for _ in 0..holds {
        lines.iter_mut().for_each(Line::hold);
    }
    for line in &mut lines {
        line.times_ms.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let last = line.times_ms.len() - 1;
            line.times_ms[((last as f64) * share).round() as usize]
        };
        let terminal_ms = *terminal_ms.get_or_insert(at(0.99));
        is_met &= is_test || at(0.99) <= terminal_ms + BEYOND_TERMINAL_MS_MAX;
        let (name, most) = (line.name, at(1.0));
        println!("| {name} | {:.2} | {:.2} | {:.2} | {most:.2} |", at(0.5), at(0.9), at(0.99));
    }
    if is_met { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
