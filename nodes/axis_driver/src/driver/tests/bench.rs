//! A driver, a scripted controller and a clock that only the test moves.
//!
//! The controller is as small as it can be and still be grbl: a ring of 128 bytes, a
//! planner of fifteen blocks of which one is done every 100 ms, hold, reset, alarm.

use super::super::*;
use super::replan::Rests;
use crate::journal::{Entry, EntryKind, Journal, replay};
use cnc_msgs::contour::{Action, Source};
use cnc_msgs::geometry::{AxisSet, Position, Shape};
use cnc_msgs::machine::Mode;
use cnc_msgs::path::{CompensatedPath, PathElement, PathEvent, Role, StartInSpan};
use std::collections::VecDeque;
use std::sync::Arc;

pub(super) const BANNER: &str = "\r\nGrbl 1.1h ['$' for help]\r\n";
const STEP: Duration = Duration::from_millis(10);
const BLOCK: Duration = Duration::from_millis(100);
const PLANNER_BLOCKS: usize = 15;

#[derive(Debug, Default)]
pub(super) struct Firmware {
    line: Vec<u8>,
    ring: VecDeque<String>,
    planner: VecDeque<String>,
    block_done_at: Duration,
    dwell_until: Option<Duration>,
    position: Position,
    /// Hold: 2 decelerates, 1 stands; 0 none.
    hold: u8,
    is_locked: bool,
    /// Hears nothing but a reset.
    is_deaf: bool,
    /// Answers nothing at all.
    pub(super) is_dead: bool,
    /// Holds this many holds for noise.
    pub(super) holds_ignored: u32,
    pub(super) never_stands: bool,
    /// This line is refused.
    pub(super) refuse: Option<(&'static str, u16)>,
    /// This line raises an alarm in place of its answer.
    pub(super) alarm: Option<(&'static str, u16)>,
    /// This line is never answered.
    pub(super) ignore: Option<&'static str>,
    /// The next answer is this.
    pub(super) answer_with: Option<&'static str>,
    /// What `$$` says.
    pub(super) settings: &'static str,
    reported_offset: bool,
    /// Where the zero of G55 is; that of G54 is the machine's.
    pub(super) second_zero: Position,
    zero: Position,
    /// Lines that ran, with their order.
    pub(super) executed: Vec<String>,
    pub(super) most_held: usize,
    pub(super) out: Vec<u8>,
    now: Duration,
}

impl Firmware {
    fn say(&mut self, text: &str) {
        if !self.is_dead {
            self.out.extend_from_slice(text.as_bytes());
            self.out.extend_from_slice(b"\r\n");
        }
    }

    pub(super) fn raw(&mut self, bytes: &[u8]) {
        self.out.extend_from_slice(bytes);
    }

    pub(super) fn restart(&mut self) {
        if self.hold != 1 && !self.planner.is_empty() {
            self.say("ALARM:3");
            self.is_locked = true;
        }
        self.ring.clear();
        self.planner.clear();
        self.line.clear();
        (self.hold, self.dwell_until, self.is_deaf) = (0, None, false);
        self.reported_offset = false;
        self.raw(if self.is_dead { b"" } else { BANNER.as_bytes() });
    }

    fn state(&self) -> &'static str {
        match self.hold {
            _ if self.never_stands => "Run",
            _ if self.is_locked => "Alarm",
            2 => "Hold:1",
            1 => "Hold:0",
            _ if !self.planner.is_empty() => "Run",
            _ => "Idle",
        }
    }

    fn receive(&mut self, byte: u8) {
        match byte {
            0x18 => self.restart(),
            _ if self.is_deaf || self.is_dead => {}
            b'?' => {
                let [x, y, z] = self.position;
                let mut text = format!("<{}|MPos:{x:.3},{y:.3},{z:.3}|FS:0,0", self.state());
                if !self.reported_offset {
                    self.reported_offset = true;
                    let [x, y, z] = self.zero;
                    text += &format!("|WCO:{x:.3},{y:.3},{z:.3}");
                }
                self.say(&(text + ">"));
            }
            b'!' if self.holds_ignored > 0 => self.holds_ignored -= 1,
            b'!' if self.hold == 0 => self.hold = if self.planner.is_empty() { 1 } else { 2 },
            b'!' => {}
            b'~' => self.hold = 0,
            b'\n' => {
                let line = String::from_utf8(std::mem::take(&mut self.line)).unwrap();
                self.ring.push_back(line);
            }
            _ => self.line.push(byte),
        }
        let held: usize = self.ring.iter().map(|line| line.len() + 1).sum();
        self.most_held = self.most_held.max(held + self.line.len());
    }

    fn run(&mut self, now: Duration) {
        self.now = now;
        if self.hold == 2 && now >= self.block_done_at {
            self.hold = 1;
        }
        if self.hold == 0 && !self.planner.is_empty() && now >= self.block_done_at {
            let line = self.planner.pop_front().unwrap();
            self.block_done_at = now + BLOCK;
            for axis in 0..3 {
                if let Some(value) = word(&line, ['X', 'Y', 'Z'][axis]) {
                    self.position[axis] = value;
                }
            }
        }
        while self.hold == 0 && !self.is_deaf && !self.is_dead {
            let Some(line) = self.ring.front().cloned() else { break };
            if let Some(until) = self.dwell_until {
                if now < until {
                    break;
                }
                self.dwell_until = None;
            } else if line.starts_with("G4P") || line == "M0" {
                if !self.planner.is_empty() {
                    break;
                }
                if line == "M0" {
                    self.ring.pop_front();
                    self.executed.push(line);
                    self.say("ok");
                    self.hold = 1;
                    break;
                }
                let seconds: f64 = line[3..].parse().unwrap();
                self.dwell_until = Some(now + Duration::from_secs_f64(seconds));
                continue;
            } else if self.planner.len() >= PLANNER_BLOCKS {
                break;
            }
            self.ring.pop_front();
            self.execute(line);
        }
    }

    fn execute(&mut self, line: String) {
        if self.ignore == Some(line.as_str()) {
            return;
        }
        if let Some((_, code)) = self.refuse.filter(|(text, _)| line == *text) {
            return self.say(&format!("error:{code}"));
        }
        if let Some((_, code)) = self.alarm.filter(|(text, _)| line == *text) {
            self.say(&format!("ALARM:{code}"));
            self.say("[MSG:Reset to continue]");
            (self.is_locked, self.is_deaf) = (true, code <= 2);
            return;
        }
        match line.as_str() {
            "$I" => {
                self.say("[VER:1.1h.20190830:]");
                self.say("[OPT:V,15,128]");
            }
            "$$" => self.raw(self.settings.as_bytes()),
            "$G" => self.say("[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]"),
            "$#" => self.say("[TLO:0.000]"),
            "$X" => {
                self.is_locked = false;
                self.say("[MSG:Caution: Unlocked]");
            }
            "$H" => (self.is_locked, self.position) = (false, [0.0; 3]),
            _ if self.is_locked => return self.say("error:9"),
            _ => {
                let zero = match line.as_str() {
                    "G55" => Some(self.second_zero),
                    _ => line.ends_with("G54").then_some([0.0; 3]),
                };
                if let Some(zero) = zero.filter(|zero| *zero != self.zero) {
                    (self.zero, self.reported_offset) = (zero, false);
                }
                if line.contains(['X', 'Y', 'Z']) {
                    if self.planner.is_empty() {
                        self.block_done_at = self.now + BLOCK;
                    }
                    self.planner.push_back(line.clone());
                }
                self.executed.push(line);
            }
        }
        let answer = self.answer_with.take().unwrap_or("ok");
        self.say(answer);
    }
}

fn word(line: &str, letter: char) -> Option<f64> {
    let rest = &line[line.find(letter)? + 1..];
    let end = rest.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(rest.len());
    rest[..end].parse().ok()
}

/// All that a scenario needs; what came out is kept.
pub(super) struct Bench {
    pub(super) driver: Driver,
    pub(super) firmware: Firmware,
    pub(super) now: Duration,
    pub(super) replies: Vec<(u64, Result<String, Refusal>)>,
    pub(super) states: Vec<MachineState>,
    pub(super) lines_cut: Vec<u32>,
    pub(super) finished: Option<RunResult>,
    pub(super) is_ready_to_close: bool,
    pub(super) log: String,
    pub(super) sent: Vec<u8>,
    /// Every path that was run, by revision.
    paths: Vec<Arc<CompensatedPath>>,
    config: DriverConfig,
    journal: Journal,
    entries: Vec<Entry>,
    outputs: Vec<(Duration, Output)>,
    rests: Rests,
}

impl Bench {
    /// No port yet.
    pub(super) fn new(config: DriverConfig) -> Self {
        // It goes nowhere and says the same words always; tests/tests/path_watch has axes.
        let config = DriverConfig { on_path_deviation: OnPathDeviation::Off, ..config };
        let firmware = Firmware {
            settings: "$13=0\r\n$22=1\r\n$110=60000.000\r\n$130=0\r\n$131=0\r\n$132=0\r\n",
            ..Firmware::default()
        };
        Self {
            driver: Driver::new(config.clone()),
            firmware,
            now: Duration::from_secs(1),
            replies: Vec::new(),
            states: Vec::new(),
            lines_cut: Vec::new(),
            finished: None,
            is_ready_to_close: false,
            log: String::new(),
            sent: Vec::new(),
            paths: Vec::new(),
            config,
            journal: Journal::default(),
            entries: Vec::new(),
            outputs: Vec::new(),
            rests: Rests::default(),
        }
    }

    /// Connected and idle.
    pub(super) fn connected() -> Self {
        let mut bench = Self::new(DriverConfig::default());
        bench.handle(Input::PortOpened);
        bench.until("idle", |bench| bench.mode() == Mode::Idle);
        bench
    }

    /// Connected, and this path is being cut.
    pub(super) fn running(path: CompensatedPath) -> Self {
        let mut bench = Self::connected();
        bench.start(path);
        bench.until("a few lines are cut", |bench| bench.state().line >= 3);
        bench
    }

    pub(super) fn start(&mut self, path: CompensatedPath) {
        self.run_program(path, 0, false);
    }

    pub(super) fn run_program(&mut self, path: CompensatedPath, start_line: u32, check_only: bool) {
        let path = Arc::new(path);
        let (program_id, revision) = ("part".to_owned(), self.paths.len() as u64);
        self.paths.push(path.clone());
        let in_span = StartInSpan::Refused;
        let tool_diameters_mm = Default::default();
        let request = RunRequest {
            program_id,
            revision,
            path,
            start_line,
            occurrence: 0,
            in_span,
            check_only,
            tool_diameters_mm,
        };
        self.command(100, Command::RunProgram(request));
    }

    /// Keeps a path for the replay; gives its revision.
    pub(super) fn keep(&mut self, path: &Arc<CompensatedPath>) -> u64 {
        self.paths.push(Arc::clone(path));
        self.paths.len() as u64 - 1
    }

    pub(super) fn command(&mut self, id: u64, command: Command) {
        self.handle(Input::Command { id, command });
    }

    /// The answer to a command that is answered at once.
    pub(super) fn ask(&mut self, command: Command) -> Result<String, Refusal> {
        self.command(9, command);
        self.replies.iter().rev().find(|(id, _)| *id == 9).expect("an answer").1.clone()
    }

    pub(super) fn handle(&mut self, input: Input) {
        if matches!(input, Input::Command { .. }) {
            self.rests.mark(&self.driver, self.now, self.entries.len(), self.outputs.len());
        }
        self.entries.push(self.journal.input(self.now, &input));
        self.driver.handle(self.now, input);
        while let Some(output) = self.driver.poll_output() {
            match output.clone() {
                Output::Transmit(bytes) => {
                    self.entries.push(self.journal.transmitted(self.now, &bytes));
                    self.sent.extend_from_slice(&bytes);
                    bytes.into_iter().for_each(|byte| self.firmware.receive(byte));
                    continue;
                }
                Output::Reply { id, result } => self.replies.push((id, result)),
                Output::State(state) => {
                    if self.lines_cut.last() != Some(&state.line) {
                        self.lines_cut.push(state.line);
                    }
                    self.states.push(state);
                }
                Output::Progress { .. }
                | Output::MoveFinished(_)
                | Output::Probes(_)
                | Output::UserFunction(_)
                | Output::Settings(_) => {}
                Output::RunFinished(result) => self.finished = Some(result),
                Output::ReadyToClose => self.is_ready_to_close = true,
                Output::Log { message, .. } => self.log = self.log.clone() + &message + "\n",
            }
            self.outputs.push((self.now, output));
        }
    }

    /// One step of time for both.
    pub(super) fn step(&mut self) {
        self.now += STEP;
        self.firmware.run(self.now);
        let bytes = std::mem::take(&mut self.firmware.out);
        if !bytes.is_empty() && self.driver.is_open() {
            self.handle(Input::Received(bytes));
        }
        if self.driver.next_deadline().is_some_and(|deadline| deadline <= self.now) {
            self.handle(Input::Timer);
        }
    }

    pub(super) fn wait(&mut self, milliseconds: u64) {
        (0..milliseconds / 10).for_each(|_| self.step());
    }

    pub(super) fn until(&mut self, what: &str, condition: impl Fn(&Self) -> bool) {
        for _ in 0..20_000 {
            if condition(self) {
                return;
            }
            self.step();
        }
        panic!("never: {what}; {:?}\n{}", self.state(), self.log);
    }

    pub(super) fn state(&self) -> MachineState {
        self.driver.state(self.now)
    }

    pub(super) fn mode(&self) -> Mode {
        self.state().mode
    }

    /// How the run ended.
    pub(super) fn result(&mut self) -> RunResult {
        self.until("the run ends", |bench| bench.finished.is_some());
        self.finished.clone().unwrap()
    }

    pub(super) fn sent_count(&self, byte: u8) -> usize {
        self.sent.iter().filter(|sent| **sent == byte).count()
    }
}

/// Every scenario ends in the proof that it can be played again.
impl Drop for Bench {
    fn drop(&mut self) {
        if std::thread::panicking() {
            return;
        }
        let paths = |_: &str, revision: u64| self.paths.get(revision as usize).cloned();
        let replay = replay(&self.entries, &paths, self.config.clone()).unwrap();
        assert_eq!(replay.first_difference(&self.entries), None);
        assert_eq!(replay.outputs, self.outputs);
        assert_eq!(self.rests.failures(&self.entries, &self.outputs, &paths), 0);
        assert!(
            self.entries.iter().any(|entry| entry.kind == EntryKind::Tx) || self.sent.is_empty()
        );
    }
}

/// Lines of 10 mm along X, source lines 1, 2, 3...
pub(super) fn straight(count: u32) -> CompensatedPath {
    let element = |line: u32| PathElement {
        side: None,
        shape: Shape::Line,
        end: [10.0 * f64::from(line), 0.0, 0.0],
        feed_mm_per_min: Some(600.0),
        role: Role::None,
        axes: AxisSet::NONE.with(0),
        source: source(line),
    };
    CompensatedPath { elements: (1..=count).map(element).collect(), ..Default::default() }
}

pub(super) fn source(line: u32) -> Source {
    Source { line, ..Source::default() }
}

/// The same with something happening before an element.
pub(super) fn with_event(mut path: CompensatedPath, at: usize, action: Action) -> CompensatedPath {
    path.events.push(PathEvent { at_element: at, action, source: source(at as u32) });
    path
}
