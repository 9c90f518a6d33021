//! How much of a line of 115 200 Bd short segments use, on a pseudo-terminal.
//!
//! ```text
//! cargo bench -p kerf --bench streaming                      10 000 segments, grbl and grblHAL
//! cargo bench -p kerf --bench streaming -- --lines 50000     more of them
//! cargo bench -p kerf --bench streaming -- --runs 5          five of each, in turn
//! cargo bench -p kerf --bench streaming -- --test            300
//! ```
//!
//! The driver's own threads and port stream to a virtual controller. The same lines are then sent
//! in two other ways, each a loop in one thread: counting characters, with the driver's window; and
//! waiting for the answer to each line. The first shows what the terminal, the controller and the
//! load of the host allow; the second shows a common alternative. In the first table the machine is
//! fast enough for the line to be the bottleneck. In the second the line could carry a quarter more
//! than the machine takes, and the planner should never run empty. Rates are those of the middle
//! eight tenths. `tests/tests/streaming.rs` shows the same in exact time.

#![allow(clippy::print_stdout)]

mod rig;

use axis_driver::driver::{Command, DriverConfig, Output, RunOutcome, RunRequest};
use axis_driver::journal::{Entry, EntryKind};
use axis_driver::serial::{Event, Reopen, Serial, SerialConfig};
use cnc_msgs::machine::Mode;
use cnc_msgs::path::CompensatedPath;
use kerf_tests::line::short_segments;
use rig::Arguments;
use rig::controller::{InThread, fast};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode as Permissions, OFlags, open};
use std::collections::VecDeque;
use std::os::fd::OwnedFd;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::{Duration, Instant};
use virtual_controller::Firmware;

/// Ten bits to a byte.
const LINE_BYTES_PER_S: f64 = 11_520.0;
/// The longest wait for anything except the program itself.
const TIMEOUT: Duration = Duration::from_secs(30);

/// The time of each line where the machine is the bottleneck.
const BLOCK: Duration = Duration::from_millis(2);
const LENGTH_MM: f64 = 0.4;

fn main() {
    let arguments = Arguments::read();
    let lines: u32 = arguments.value("--lines", 10_000, 300);
    let runs: u32 = arguments.value("--runs", 1, 1);
    let slow = LENGTH_MM / BLOCK.as_secs_f64() * 60.0;
    println!("{lines} segments of {LENGTH_MM} mm; {}", rig::load());
    for (what, feed_mm_per_min, lines_per_s) in [
        ("the line is the bottleneck", 24_000.0, None),
        ("the machine is the bottleneck", slow, Some(1.0 / BLOCK.as_secs_f64())),
    ] {
        let of = if lines_per_s.is_some() { "% of machine" } else { "% of line" };
        println!("\n{what:<38} {:>9} {:>9} {of:>13} {:>12}", "bytes/s", "lines/s", "ran empty");
        for firmware in [Firmware::Grbl, Firmware::GrblHal] {
            let row = |method: &str, sent: &Sent, controller: InThread| {
                print(&format!("{firmware}: {method}"), sent, lines_per_s, controller);
            };
            for run in 0..runs {
                let controller = InThread::start(fast(firmware));
                let (window, sent) = with_driver(&controller.port, path(lines, feed_mm_per_min));
                row(&format!("driver, {window} B under way"), &sent, controller);
                let text: Vec<Vec<u8>> = sent.into_iter().map(|(_, line)| line).collect();
                // Waiting for each answer is always slower; once is enough to show it.
                let peers = [("counting, one thread", window), ("send and wait", 0)];
                for (method, window) in &peers[..if run == 0 { 2 } else { 1 }] {
                    let controller = InThread::start(fast(firmware));
                    let sent = in_one_thread(&controller.port, &text, *window);
                    row(method, &sent, controller);
                }
            }
        }
    }
    println!("\n{}", rig::load());
}

fn path(lines: u32, feed_mm_per_min: f64) -> CompensatedPath {
    let mut path = short_segments(lines, LENGTH_MM);
    for element in &mut path.elements {
        element.feed_mm_per_min = Some(feed_mm_per_min);
    }
    path
}

/// Lines with the time at which each was written.
type Sent = Vec<(Duration, Vec<u8>)>;

/// One row; `lines_per_s` is the rate of the machine, where it is slower than the line.
fn print(method: &str, sent: &Sent, lines_per_s: Option<f64>, controller: InThread) {
    let middle = &sent[sent.len() / 10..=sent.len() * 9 / 10];
    let seconds = (middle[middle.len() - 1].0 - middle[0].0).as_secs_f64();
    // Bytes written at the end of that time are still in transit.
    let lines = &middle[..middle.len() - 1];
    let bytes: usize = lines.iter().map(|(_, line)| line.len()).sum();
    let (rate, lines) = (bytes as f64 / seconds, lines.len() as f64 / seconds);
    let percent = 100.0 * lines_per_s.map_or(rate / LINE_BYTES_PER_S, |most| lines / most);
    let ran_empty = &controller.counts()["underruns"];
    println!("{method:<38} {rate:>9.0} {lines:>9.1} {percent:>13.2} {ran_empty:>12}");
}

/// Runs the segments through the driver; returns its window and what it sent.
fn with_driver(port: &Path, path: CompensatedPath) -> (usize, Sent) {
    let config = SerialConfig {
        path: port.display().to_string(),
        dtr: None,
        rts: None,
        reopen: Reopen::WhenTold,
        driver: DriverConfig::default(),
    };
    let (events_in, events) = sync_channel(16_384);
    let (journal_in, journal) = sync_channel(16_384);
    let serial = Serial::start(config, events_in, journal_in).expect("threads");
    serial.open().expect("nothing waits yet");
    let keeping = std::thread::spawn(move || journal.iter().collect::<Vec<Entry>>());
    let is_idle = |event: &Event| matches!(&event.output, Output::State(s) if s.mode == Mode::Idle);
    until(&events, TIMEOUT, is_idle);
    // A longer run would be far from any goal.
    let most = TIMEOUT + Duration::from_millis(10) * path.elements.len() as u32;
    let request = RunRequest {
        program_id: "part".into(),
        revision: 1,
        path: Arc::new(path),
        start_line: 0,
        occurrence: 0,
        in_span: Default::default(),
        check_only: false,
        tool_diameters_mm: Default::default(),
    };
    serial.command(1, Command::RunProgram(request)).expect("nothing waits yet");
    let end = until(&events, most, |event| matches!(&event.output, Output::RunFinished(_)));
    let Output::RunFinished(result) = end.output else { unreachable!("it was looked for") };
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{}", result.message);
    assert_eq!(serial.dropped(), Default::default(), "the journal is not whole");
    drop(serial);
    let entries = keeping.join().expect("it only collects");
    sent(&entries)
}

fn until(events: &Receiver<Event>, within: Duration, is_it: impl Fn(&Event) -> bool) -> Event {
    let end = Instant::now() + within;
    loop {
        let left = end.saturating_duration_since(Instant::now());
        let event = events.recv_timeout(left).expect("the driver reports the awaited event");
        if is_it(&event) {
            return event;
        }
    }
}

/// The lines of the segments, and the largest number of bytes without an answer.
fn sent(entries: &[Entry]) -> (usize, Sent) {
    let (mut lines, mut line) = (Sent::new(), Vec::new());
    let (mut under_way, mut window) = (VecDeque::new(), 0);
    let mut received = Vec::new();
    for entry in entries {
        match entry.kind {
            EntryKind::Tx => {
                // Status requests and the like are not part of a line.
                for &byte in entry.data.iter().filter(|byte| !matches!(byte, b'?' | 0x18)) {
                    line.push(byte);
                    if byte == b'\n' {
                        under_way.push_back(line.len());
                        if line.contains(&b'X') || line.contains(&b'Y') {
                            lines.push((Duration::from_nanos(entry.monotonic_ns), line.clone()));
                        }
                        line.clear();
                    }
                }
                window = window.max(under_way.iter().sum());
            }
            EntryKind::Rx => {
                for &byte in &entry.data {
                    received.push(byte);
                    if byte == b'\n' {
                        if received == b"ok\r\n" {
                            under_way.pop_front();
                        }
                        received.clear();
                    }
                }
            }
            _ => {}
        }
    }
    (window, lines)
}

/// Sends lines from one thread: as many bytes without an answer as fit into the window, at least
/// one line.
fn in_one_thread(port: &Path, lines: &[Vec<u8>], window: usize) -> Sent {
    let port = open(port, OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK, Permissions::empty())
        .expect("the controller's port can be opened");
    let begin = Instant::now();
    let mut answers = Answers { port: &port, unread: Vec::new() };
    let write = |line: &[u8]| {
        let count = rustix::io::write(&port, line).expect("a port that has room");
        assert_eq!(count, line.len(), "a terminal takes a line at once");
    };
    let (mut sent, mut under_way) = (Sent::new(), VecDeque::new());
    let mut bytes = 0;
    for line in lines {
        while !under_way.is_empty() && bytes + line.len() > window {
            for _ in 0..answers.wait(1) {
                bytes -= under_way.pop_front().expect("as many answers as lines");
            }
        }
        write(line);
        sent.push((begin.elapsed(), line.clone()));
        bytes += line.len();
        under_way.push_back(line.len());
    }
    while !under_way.is_empty() {
        let count = answers.wait(1);
        under_way.drain(..count);
    }
    sent
}

/// The controller's answers, read from the port.
struct Answers<'a> {
    port: &'a OwnedFd,
    unread: Vec<u8>,
}

impl Answers<'_> {
    /// Waits for at least this many answers; takes all that have arrived.
    fn wait(&mut self, least: usize) -> usize {
        let end = Instant::now() + TIMEOUT;
        let mut count = 0;
        while count < least {
            assert!(Instant::now() < end, "no answer: {}", self.unread.escape_ascii());
            let timeout = Timespec { tv_sec: 1, tv_nsec: 0 };
            let mut fds = [PollFd::new(self.port, PollFlags::IN)];
            poll(&mut fds, Some(&timeout)).expect("the port can be waited for");
            let mut buffer = [0; 1024];
            let read = match rustix::io::read(self.port, &mut buffer) {
                Ok(read) => read,
                Err(rustix::io::Errno::AGAIN) => continue,
                Err(error) => panic!("the port cannot be read: {error}"),
            };
            self.unread.extend_from_slice(&buffer[..read]);
            while let Some(end) = self.unread.iter().position(|byte| *byte == b'\n') {
                let line: Vec<u8> = self.unread.drain(..=end).collect();
                assert!(!line.starts_with(b"error"), "{}", line.escape_ascii());
                count += usize::from(line == b"ok\r\n");
            }
        }
        count
    }
}
