//! The shell on a pseudo-terminal, with a controller of a few lines at the other end.

use axis_driver::codes::error_code;
use axis_driver::driver::{
    Command, DriverConfig, OnPathDeviation, Output, Refusal, RunOutcome, RunRequest, RunResult,
};
use axis_driver::journal::{Entry, EntryKind, replay};
use axis_driver::serial::{Event, Reopen, Serial, SerialConfig};
use cnc_msgs::contour::Source;
use cnc_msgs::geometry::{AxisSet, Shape};
use cnc_msgs::machine::{MachineState, Mode};
use cnc_msgs::path::{CompensatedPath, PathElement, Role};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Far more than anything takes; only a failure waits this long.
const PATIENCE: Duration = Duration::from_secs(30);

/// A controller on the master side. It does every line at once.
#[derive(Default)]
struct Behaviour {
    is_over: AtomicBool,
    stops_reading: AtomicBool,
    /// Says this to everything.
    garbage: Option<&'static [u8]>,
    /// Answers this many lines and then no more, and says it is running.
    lines_answered: Option<usize>,
    lines: AtomicUsize,
    received: Mutex<Vec<u8>>,
}

struct Controller {
    behaviour: Arc<Behaviour>,
    path: String,
    thread: Option<JoinHandle<()>>,
}

impl Controller {
    fn start(behaviour: Behaviour) -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let path = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        let behaviour = Arc::new(behaviour);
        let to = behaviour.clone();
        let thread = Some(std::thread::spawn(move || control(&master, &to)));
        Self { behaviour, path, thread }
    }

    /// The cable is pulled: the master side is closed.
    fn unplug(&mut self) {
        self.behaviour.is_over.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap();
    }

    fn received(&self) -> Vec<u8> {
        self.behaviour.received.lock().unwrap().clone()
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        self.behaviour.is_over.store(true, Ordering::Relaxed);
    }
}

fn control(master: &OwnedFd, behaviour: &Behaviour) {
    let mut line = Vec::new();
    let mut buffer = [0; 4096];
    while !behaviour.is_over.load(Ordering::Relaxed) {
        let patience = Timespec { tv_sec: 0, tv_nsec: 5_000_000 };
        let mut ready = [PollFd::new(master, PollFlags::IN)];
        let is_ready = poll(&mut ready, Some(&patience)).unwrap_or(0) > 0;
        if behaviour.stops_reading.load(Ordering::Relaxed) || !is_ready {
            std::thread::sleep(Duration::from_millis(1));
            continue;
        }
        // Nobody has the other side open.
        let Ok(count) = rustix::io::read(master, &mut buffer) else {
            std::thread::sleep(Duration::from_millis(5));
            continue;
        };
        behaviour.received.lock().unwrap().extend_from_slice(&buffer[..count]);
        for &byte in &buffer[..count] {
            let answer = answer(byte, &mut line, behaviour);
            let _ = rustix::io::write(master, answer.as_slice());
        }
    }
}

fn answer(byte: u8, line: &mut Vec<u8>, behaviour: &Behaviour) -> Vec<u8> {
    if let Some(garbage) = behaviour.garbage {
        return garbage.to_vec();
    }
    let lines = behaviour.lines.load(Ordering::Relaxed);
    let is_stuck = behaviour.lines_answered.is_some_and(|most| lines >= most);
    match byte {
        b'?' => {
            let state = if is_stuck { "Run" } else { "Idle" };
            let text = format!("<{state}|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>\r\n");
            text.into_bytes()
        }
        0x18 => b"\r\nGrbl 1.1h ['$' for help]\r\n".to_vec(),
        b'!' | b'~' => Vec::new(),
        b'\n' if is_stuck => Vec::new(),
        b'\n' => {
            behaviour.lines.fetch_add(1, Ordering::Relaxed);
            match std::mem::take(line).as_slice() {
                b"$I" => b"[VER:1.1h.20190830:]\r\n[OPT:V,15,128]\r\nok\r\n".to_vec(),
                b"$$" => SETTINGS.to_vec(),
                b"$G" => b"[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]\r\nok\r\n".to_vec(),
                _ => b"ok\r\n".to_vec(),
            }
        }
        _ => {
            line.push(byte);
            Vec::new()
        }
    }
}

struct Shell {
    serial: Serial,
    events: Receiver<Event>,
    journal: Receiver<Entry>,
    state: MachineState,
    replies: Vec<(u64, Result<String, Refusal>)>,
    finished: Option<RunResult>,
    entries: Vec<Entry>,
    is_ready_to_close: bool,
}

/// The controller here has no axes to be compared with a path.
/// What the controller answers to `$$`.
const SETTINGS: &[u8] =
    b"$13=0\r\n$22=1\r\n$110=5000\r\n$111=5000\r\n$112=5000\r\n$120=500\r\n$121=500\r\n\
    $122=500\r\n$130=0\r\n$131=0\r\n$132=0\r\nok\r\n";

fn config() -> DriverConfig {
    DriverConfig { on_path_deviation: OnPathDeviation::Off, ..DriverConfig::default() }
}

impl Shell {
    fn new(path: &str, reopen: Reopen) -> Self {
        let config = SerialConfig {
            path: path.into(),
            dtr: Some(true),
            rts: Some(true),
            reopen,
            driver: config(),
        };
        let (events_in, events) = sync_channel(1024);
        let (journal_in, journal) = sync_channel(100_000);
        let serial = Serial::start(config, events_in, journal_in).unwrap();
        serial.open().unwrap();
        Self {
            serial,
            events,
            journal,
            state: MachineState::default(),
            replies: Vec::new(),
            finished: None,
            entries: Vec::new(),
            is_ready_to_close: false,
        }
    }

    fn until(&mut self, what: &str, condition: impl Fn(&Self) -> bool) {
        let begin = Instant::now();
        while !condition(self) {
            assert!(begin.elapsed() < PATIENCE, "never: {what}; {:?}", self.state);
            if let Ok(event) = self.events.recv_timeout(Duration::from_millis(20)) {
                match event.output {
                    Output::State(state) => self.state = state,
                    Output::Reply { id, result } => self.replies.push((id, result)),
                    Output::RunFinished(result) => self.finished = Some(result),
                    Output::ReadyToClose => self.is_ready_to_close = true,
                    Output::Progress { .. }
                    | Output::MoveFinished(_)
                    | Output::Probes(_)
                    | Output::UserFunction(_)
                    | Output::Settings(_)
                    | Output::Log { .. }
                    | Output::Transmit(_) => {}
                }
            }
            self.entries.extend(self.journal.try_iter());
        }
    }

    fn until_mode(&mut self, mode: Mode) {
        self.until(mode.name(), |shell| shell.state.mode == mode);
    }

    fn command(&mut self, id: u64, command: Command) -> Result<String, Refusal> {
        self.serial.command(id, command).unwrap();
        self.until("a reply", |shell| shell.replies.iter().any(|(to, _)| *to == id));
        let index = self.replies.iter().position(|(to, _)| *to == id).unwrap();
        self.replies.remove(index).1
    }

    fn run(&mut self, count: u32) -> Arc<CompensatedPath> {
        let path = Arc::new(straight(count));
        let request = RunRequest {
            program_id: "part".into(),
            revision: 0,
            path: path.clone(),
            start_line: 0,
            occurrence: 0,
            in_span: Default::default(),
            check_only: false,
            tool_diameters_mm: Default::default(),
        };
        self.command(1, Command::RunProgram(request)).unwrap();
        path
    }
}

fn straight(count: u32) -> CompensatedPath {
    let element = |line: u32| PathElement {
        side: None,
        shape: Shape::Line,
        end: [f64::from(line % 100), 0.0, 0.0],
        feed_mm_per_min: Some(600.0),
        role: Role::None,
        axes: AxisSet::NONE.with(0),
        source: Source { line, ..Source::default() },
    };
    CompensatedPath { elements: (1..=count).map(element).collect(), ..Default::default() }
}

#[test]
fn a_run_over_a_terminal_succeeds_and_its_journal_plays_again_to_the_same_bytes() {
    let controller = Controller::start(Behaviour::default());
    let mut shell = Shell::new(&controller.path, Reopen::WhenTold);
    shell.until_mode(Mode::Idle);
    let path = shell.run(2000);
    shell.until("the end", |shell| shell.finished.is_some());
    assert_eq!(shell.finished.clone().unwrap().outcome, RunOutcome::Succeeded);
    // Four questions, that for the offsets by which the path is judged, the words before the path, the path, its end,
    // and the checks among them.
    let received = controller.received();
    let parser_states = received.split(|byte| *byte == b'\n').filter(|line| line.ends_with(b"$G"));
    let checks = parser_states.count() - 1;
    assert!(checks > 0, "the link is watched");
    let lines = controller.behaviour.lines.load(Ordering::Relaxed);
    assert_eq!(lines, 4 + 1 + 1 + 2000 + 1 + checks);
    let reply = shell.command(2, Command::Shutdown);
    assert_eq!(reply, Ok("stopped".into()));
    shell.until("ready to close", |shell| shell.is_ready_to_close);
    shell.until_mode(Mode::Disconnected);
    shell.until("all entries", |shell| {
        shell.entries.last().is_some_and(|entry| entry.kind == EntryKind::Closed)
    });
    let entries = &shell.entries;
    let again = replay(entries, &|_, _| Some(path.clone()), config()).unwrap();
    assert_eq!(again.first_difference(entries), None);
    let written: Vec<u8> = entries
        .iter()
        .filter(|entry| entry.kind == EntryKind::Tx)
        .flat_map(|entry| entry.data.clone())
        .collect();
    assert_eq!(written, controller.received());
    assert_eq!(shell.serial.dropped(), Default::default());
}

#[test]
fn an_unplugged_cable_in_a_run_is_unknown_and_nothing_resumes_when_it_is_back() {
    let behaviour = Behaviour { lines_answered: Some(40), ..Behaviour::default() };
    let mut controller = Controller::start(behaviour);
    let backoff =
        Reopen::Backoff { first: Duration::from_millis(20), most: Duration::from_millis(100) };
    let mut shell = Shell::new(&controller.path, backoff);
    shell.until_mode(Mode::Idle);
    shell.run(2000);
    shell.until("the run", |shell| shell.state.mode == Mode::Run);
    controller.unplug();
    shell.until("the end", |shell| shell.finished.is_some());
    let result = shell.finished.clone().unwrap();
    assert_eq!((result.outcome, result.error_code), (RunOutcome::Aborted, error_code::LINK_LOST));
    assert!(result.message.contains("motion may continue"), "{}", result.message);
    assert!(result.message.contains("unplugged"), "{}", result.message);
    shell.until_mode(Mode::Unknown);
    assert!(shell.state.reason.starts_with("LINK_LOST"), "{}", shell.state.reason);
    let refusal = shell.command(2, Command::Resume).unwrap_err();
    assert_eq!(refusal.error_code, error_code::NOT_CONNECTED);
}

#[test]
fn a_port_that_does_not_exist_is_named_and_tried_again_only_as_configured() {
    let mut shell = Shell::new("/dev/this-port-does-not-exist", Reopen::WhenTold);
    let wanted = "cannot open /dev/this-port-does-not-exist: No such file or directory";
    shell.until("a reason", |shell| shell.state.reason.starts_with(wanted));
    assert_eq!(shell.state.mode, Mode::Disconnected);
    let refusal = shell.command(1, Command::Home).unwrap_err();
    assert_eq!(refusal.error_code, error_code::NOT_CONNECTED);
    assert!(refusal.message.starts_with(wanted));
}

#[test]
fn a_port_that_somebody_else_has_is_refused_and_found_when_it_is_free() {
    let controller = Controller::start(Behaviour::default());
    let mut first = Shell::new(&controller.path, Reopen::WhenTold);
    first.until_mode(Mode::Idle);
    let backoff =
        Reopen::Backoff { first: Duration::from_millis(20), most: Duration::from_millis(100) };
    let mut second = Shell::new(&controller.path, backoff);
    second.until("a refusal", |shell| shell.state.reason.starts_with("cannot open"));
    first.serial.close().unwrap();
    first.until_mode(Mode::Disconnected);
    second.until_mode(Mode::Idle);
}

#[test]
fn a_port_that_answers_garbage_is_unknown_and_says_so() {
    let behaviour = Behaviour { garbage: Some(b"\xfe\x80 T:21\n"), ..Behaviour::default() };
    let controller = Controller::start(behaviour);
    let mut shell = Shell::new(&controller.path, Reopen::WhenTold);
    shell.until("a verdict", |shell| shell.state.reason.contains("is not a grbl-class controller"));
    assert_eq!(shell.state.mode, Mode::Unknown);
}

#[test]
fn a_controller_that_stops_reading_stops_nobody_here() {
    let controller = Controller::start(Behaviour::default());
    let mut shell = Shell::new(&controller.path, Reopen::WhenTold);
    shell.until_mode(Mode::Idle);
    controller.behaviour.stops_reading.store(true, Ordering::Relaxed);
    shell.until_mode(Mode::Unknown);
    assert!(shell.state.reason.starts_with("LINK_LOST"), "{}", shell.state.reason);
    // Far more than a terminal holds: the writer is stuck, the driver still answers.
    let mut id = 10;
    let mut is_closed = false;
    while !is_closed {
        assert!(id < 1_000_000, "a port that takes nothing is never given up");
        (0..200).for_each(|more| shell.serial.command(id + more, Command::FeedHold).unwrap());
        id += 200;
        shell.until("the last reply", |shell| shell.replies.iter().any(|(to, _)| *to == id - 1));
        is_closed = shell.replies.drain(..).any(|(_, result)| result.is_err());
    }
    shell.until_mode(Mode::Unknown);
    let refusal = shell.command(5, Command::Home).unwrap_err();
    assert_eq!(refusal.error_code, error_code::NOT_CONNECTED);
    assert!(refusal.message.contains("the controller does not read"), "{}", refusal.message);
}

#[test]
fn a_consumer_that_does_not_listen_stops_nobody() {
    let controller = Controller::start(Behaviour::default());
    let config = SerialConfig {
        path: controller.path.clone(),
        dtr: None,
        rts: None,
        reopen: Reopen::WhenTold,
        driver: DriverConfig::default(),
    };
    let (events_in, _events) = sync_channel(1);
    let (journal_in, _journal) = sync_channel(1);
    let serial = Serial::start(config, events_in, journal_in).unwrap();
    serial.open().unwrap();
    let begin = Instant::now();
    while controller.behaviour.lines.load(Ordering::Relaxed) < 4 {
        assert!(begin.elapsed() < PATIENCE, "the controller was never asked");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(serial.dropped().entries > 0);
}
