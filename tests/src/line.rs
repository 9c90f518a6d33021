//! A driver and a virtual controller on one serial line, in time that only the test moves.
//!
//! Both cores, the bytes between them at their baud rate, and nothing else: no port, no
//! thread, no clock. An hour of machine time takes as long as its events do.

use axis_driver::driver::{
    Command, Driver, DriverConfig, Input, MoveResult, OffsetRequest, Output, ProbesOfRun, Refusal,
    RunRequest, RunResult, UserFunctionCall,
};
use cnc_msgs::contour::{Action, Source};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{AxisSet, Shape};
use cnc_msgs::machine::{MachineState, Mode};
use cnc_msgs::path::{CompensatedPath, PathElement, PathEvent, Role};
use std::sync::Arc;
use std::time::Duration;
use virtual_controller::{Build, Controller, Fault, FaultInjector, LineTiming, PacedLine};

/// The longest that a test waits for anything, machine time.
const TIMEOUT: Duration = Duration::from_secs(6 * 3_600);

/// A slow Wi-Fi, as the driver takes it to be.
const NETWORK_BAUD: u32 = 2_000_000;

/// Changes what the driver writes on its way to the controller, once: `None` leaves it, and waits
/// for what comes next.
pub struct Spoil(Box<Change>);

type Change = dyn FnMut(&[u8]) -> Option<Vec<u8>>;

impl std::fmt::Debug for Spoil {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Spoil")
    }
}

/// Both ends of a line.
#[derive(Debug)]
pub struct Line {
    pub driver: Driver,
    pub controller: PacedLine<FaultInjector>,
    pub now: Duration,
    /// Every answer to a command.
    pub replies: Vec<(u64, Result<String, Refusal>)>,
    pub finished: Option<RunResult>,
    /// The mode that was published last when the run ended.
    pub finished_in: Option<Mode>,
    /// Every state that was published, with its time.
    pub states: Vec<(Duration, MachineState)>,
    pub moved: Option<MoveResult>,
    pub settings: Option<axis_driver::driver::ControllerSettings>,
    /// What probes have found, where a run waited for its plan.
    pub probes: Vec<ProbesOfRun>,
    /// Functions of the user that runs have called.
    pub calls: Vec<UserFunctionCall>,
    /// What the driver wrote, with the time it wrote it.
    pub written: Vec<(Duration, Vec<u8>)>,
    pub log: Vec<String>,
    /// The time that was left of the run, s, and when that was said.
    pub time_left: Option<(Duration, f64)>,
    keeps_written: bool,
    /// A feed hold was written since somebody asked.
    has_held: bool,
    wrote_at: Duration,
    next_id: u64,
    spoil: Option<Spoil>,
}

impl Line {
    /// A driver that opens the port of this controller now.
    pub fn new(config: DriverConfig, build: Build, faults: &[&str]) -> Self {
        let faults = faults.iter().map(|text| text.parse::<Fault>().expect("a fault")).collect();
        let baud = if config.is_networked { NETWORK_BAUD } else { config.baud };
        let timing = LineTiming { baud: Some(baud), ..LineTiming::default() };
        let device = FaultInjector::new(Controller::with_build(build), faults, 1);
        let mut line = Self {
            driver: Driver::new(config),
            controller: PacedLine::new(device, timing),
            now: Duration::ZERO,
            replies: Vec::new(),
            finished: None,
            finished_in: None,
            states: Vec::new(),
            moved: None,
            settings: None,
            probes: Vec::new(),
            calls: Vec::new(),
            written: Vec::new(),
            log: Vec::new(),
            time_left: None,
            keeps_written: true,
            has_held: false,
            wrote_at: Duration::ZERO,
            next_id: 1,
            spoil: None,
        };
        line.handle(Input::PortOpened);
        line
    }

    /// The same, connected and idle.
    pub fn connected(build: Build) -> Self {
        let mut line = Self::new(DriverConfig::default(), build, &[]);
        line.until("idle", |line| line.mode() == Mode::Idle);
        line
    }

    /// For long runs: what was written is not kept.
    pub fn forget_written(&mut self) {
        self.keeps_written = false;
        self.written = Vec::new();
    }

    pub fn handle(&mut self, input: Input) {
        self.driver.handle(self.now, input);
        while let Some(output) = self.driver.poll_output() {
            match output {
                Output::Transmit(bytes) => {
                    self.wrote_at = self.now;
                    self.has_held |= bytes.contains(&b'!');
                    let spoilt = self.spoil.as_mut().and_then(|spoil| spoil.0(&bytes));
                    if spoilt.is_some() {
                        self.spoil = None;
                    }
                    self.controller.receive(self.now, spoilt.as_ref().unwrap_or(&bytes));
                    if self.keeps_written {
                        self.written.push((self.now, bytes));
                    }
                }
                Output::Reply { id, result } => self.replies.push((id, result)),
                Output::RunFinished(result) => {
                    self.finished = Some(result);
                    self.finished_in = self.states.last().map(|(_, state)| state.mode);
                }
                Output::MoveFinished(result) => self.moved = Some(result),
                Output::Probes(found) => self.probes.push(found),
                Output::UserFunction(call) => self.calls.push(call),
                Output::Settings(settings) => self.settings = Some(settings),
                Output::Log { message, .. } => self.log.push(message),
                Output::State(state) => {
                    if !self.keeps_written {
                        self.states.clear();
                    }
                    self.states.push((self.now, state));
                }
                Output::Progress { time_left_s, .. } => {
                    self.time_left = Some((self.now, time_left_s));
                }
                Output::ReadyToClose => {}
            }
        }
    }

    /// Lets a fault happen now; of lines the next one suffers.
    #[track_caller]
    pub fn inject(&mut self, fault: &str) {
        self.controller.advance(self.now);
        let action = fault.parse().expect("a fault");
        self.controller.device_mut().inject(self.now, action);
    }

    /// Whether a feed hold was written since this was asked last.
    pub fn has_held(&mut self) -> bool {
        std::mem::take(&mut self.has_held)
    }

    /// Changes what the driver writes next, once.
    pub fn spoil_next(&mut self, spoil: impl FnMut(&[u8]) -> Option<Vec<u8>> + 'static) {
        self.spoil = Some(Spoil(Box::new(spoil)));
    }

    /// Whether what was to be changed has not come yet.
    pub fn is_spoil_due(&self) -> bool {
        self.spoil.is_some()
    }

    /// Lets bytes of another sender reach the controller, which answers that sender alone.
    pub fn other_sender(&mut self, text: &str) {
        // Not in the middle of a line of the driver.
        let quiet = Duration::from_millis(20);
        self.until("the wire is free", |line| line.now >= line.wrote_at + quiet);
        self.inject("mute:ok");
        let now = self.now;
        self.controller.device_mut().controller_mut().receive(now, text.as_bytes());
    }

    /// Lets a real-time byte of a pendant reach the controller.
    pub fn pendant(&mut self, byte: u8) {
        let now = self.now;
        self.controller.device_mut().controller_mut().receive(now, &[byte]);
    }

    /// Where the axes really are in the controller's own count, mm.
    pub fn axes(&self) -> [f64; 3] {
        self.controller.device().controller().position()
    }

    /// The same of all axes; degrees where one turns.
    pub fn all_axes(&self) -> [f64; 6] {
        self.controller.device().controller().axes()
    }

    /// When either end has something to do.
    fn next_event(&self) -> Option<Duration> {
        self.driver.next_deadline().into_iter().chain(self.controller.next_event()).min()
    }

    /// Goes to the next event of either end, but no farther than this.
    pub fn step_within(&mut self, most: Duration) {
        if self.next_event().is_some_and(|next| next <= self.now + most) {
            return self.step();
        }
        self.now += most;
        self.controller.advance(self.now);
    }

    /// Goes to the next event of either end.
    pub fn step(&mut self) {
        let next = self.next_event().unwrap_or(self.now);
        self.now = self.now.max(next) + Duration::from_nanos(1);
        self.controller.advance(self.now);
        let mut bytes = Vec::new();
        self.controller.transmit(self.now, &mut bytes);
        if !bytes.is_empty() {
            self.handle(Input::Received(bytes));
        }
        if self.driver.next_deadline().is_some_and(|deadline| deadline <= self.now) {
            self.handle(Input::Timer);
        }
    }

    /// Lets time pass until a condition holds.
    ///
    /// # Panics
    /// It never does.
    #[track_caller]
    pub fn until(&mut self, what: &str, condition: impl Fn(&Self) -> bool) {
        let end = self.now + TIMEOUT;
        while !condition(self) {
            assert!(self.now < end, "never: {what}; {:?}\n{}", self.state(), self.log.join("\n"));
            self.step();
        }
    }

    /// Lets some time pass.
    pub fn wait(&mut self, seconds: f64) {
        let end = self.now + Duration::from_secs_f64(seconds);
        while self.now < end {
            self.step();
        }
    }

    /// Gives a command and its answer.
    #[track_caller]
    pub fn ask(&mut self, command: Command) -> Result<String, Refusal> {
        let id = self.begin(command);
        self.until("an answer", |line| line.replies.iter().any(|(of, _)| *of == id));
        let index = self.replies.iter().position(|(of, _)| *of == id).unwrap_or_default();
        self.replies.remove(index).1
    }

    /// Gives a command; its number.
    pub fn begin(&mut self, command: Command) -> u64 {
        let id = self.next_id;
        self.next_id += 1;
        self.handle(Input::Command { id, command });
        id
    }

    /// Resumes; false while the machine still comes to a stop.
    pub fn ask_resume(&mut self) -> bool {
        self.ask(Command::Resume).is_ok() || {
            self.step();
            false
        }
    }

    /// The place of the tool is the zero of G54.
    pub fn zero_here(&mut self) {
        let (axes, position, further) = (AxisSet::ALL, [0.0; 3], FurtherAxes::NONE);
        let request = OffsetRequest { system: 1, axes, position, is_origin: false, further };
        self.ask(Command::SetWorkOffset(request)).expect("the zero is set");
    }

    /// Runs a path to its end.
    #[track_caller]
    pub fn run(&mut self, path: CompensatedPath) -> RunResult {
        self.start(path, 0);
        self.result()
    }

    /// Begins a run from a source line.
    #[track_caller]
    pub fn start(&mut self, path: CompensatedPath, start_line: u32) {
        let request = RunRequest {
            program_id: "part".into(),
            revision: 1,
            path: Arc::new(path),
            start_line,
            occurrence: 0,
            in_span: Default::default(),
            check_only: false,
            tool_diameters_mm: Default::default(),
        };
        self.finished = None;
        self.ask(Command::RunProgram(request)).expect("the run is accepted");
    }

    /// How the run ended.
    #[track_caller]
    pub fn result(&mut self) -> RunResult {
        self.until("the run ends", |line| line.finished.is_some());
        self.finished.take().expect("it has ended")
    }

    /// How the jog or probe ended.
    #[track_caller]
    pub fn move_result(&mut self) -> MoveResult {
        self.until("the move ends", |line| line.moved.is_some());
        self.moved.take().expect("it has ended")
    }

    pub fn state(&self) -> MachineState {
        self.driver.state(self.now)
    }

    pub fn mode(&self) -> Mode {
        self.state().mode
    }

    /// What was written since then, without status requests.
    pub fn said_since(&self, then: Duration) -> String {
        let bytes = self.written.iter().filter(|(at, _)| *at >= then);
        let bytes = bytes.flat_map(|(_, bytes)| bytes).filter(|byte| **byte != b'?');
        bytes.map(|byte| char::from(*byte)).collect()
    }
}

/// Lines of so many millimetres along X from where the tool is, source lines 1, 2, 3...
pub fn straight(count: u32, length_mm: f64) -> CompensatedPath {
    let element = |line: u32| PathElement {
        side: None,
        shape: Shape::Line,
        end: [length_mm * f64::from(line), 0.0, 0.0],
        feed_mm_per_min: Some(1_200.0),
        role: Role::None,
        axes: AxisSet::NONE.with(0),
        source: Source { line, ..Source::default() },
    };
    CompensatedPath { elements: (1..=count).map(element).collect(), ..Default::default() }
}

/// Events at these elements, in order.
pub fn events(events: &[(usize, Action)]) -> Vec<PathEvent> {
    let event = |&(at_element, action)| PathEvent { at_element, action, source: Source::default() };
    events.iter().map(event).collect()
}

/// A spiral of short lines, as a free-form surface is posted; source lines 1, 2, 3...
pub fn short_segments(count: u32, length_mm: f64) -> CompensatedPath {
    let element = |line: u32| {
        let (radius, angle) = (40.0, f64::from(line) * length_mm / 40.0);
        PathElement {
            side: None,
            shape: Shape::Line,
            end: [radius * angle.cos() - radius, radius * angle.sin(), 0.0],
            feed_mm_per_min: Some(24_000.0),
            role: Role::None,
            axes: AxisSet::NONE,
            source: Source { line, ..Source::default() },
        }
    };
    CompensatedPath { elements: (1..=count).map(element).collect(), ..Default::default() }
}
