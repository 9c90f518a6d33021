//! A machine whose line, controller and commander are in the hands of a test.

use super::cable::Cable;
use super::commander::{Commander, Running};
use super::controller::Controller;
use super::machine::{Machine, SLOW_POLLING, Turn, domain, until};
use super::wire::{Reset, Wire, Writer};
use cnc_msgs::convert::mode_from_wire;
use cnc_msgs::wire::cnc_msgs::action::RunProgramResult;
use cnc_msgs::wire::cnc_msgs::msg::MachineState;
use std::path::Path;
use std::process::Command;

/// Where the passes begin in X and Y, mm: within the travel of a machine that was homed.
const ORIGIN_MM: i32 = -100;
/// The line of the first step.
const FIRST_LINE: u32 = 3;
/// What the controller rounds a position to, mm.
const ROUNDING_MM: f64 = 0.01;

/// Passes to and fro at 20 mm/s, so that a position determines its line.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Serpentine {
    pub(crate) passes: i32,
    /// Steps of a pass, each a line.
    pub(crate) steps: i32,
    pub(crate) step_mm: i32,
}

impl Serpentine {
    /// Many lines: twenty a second, all buffers full of them; a minute.
    pub(crate) const SHORT_LINES: Self = Self { passes: 24, steps: 50, step_mm: 1 };
    /// A line in two seconds: what is buffered takes a minute.
    pub(crate) const LONG_LINES: Self = Self { passes: 8, steps: 10, step_mm: 40 };

    fn text(self) -> String {
        let mut text = format!("G21 G90 G94 G17\nG0 X{ORIGIN_MM} Y{ORIGIN_MM}\n");
        for pass in 0..self.passes {
            for step in 1..=self.steps {
                let step = if pass % 2 == 0 { step } else { self.steps - step };
                let feed = if text.contains('F') { "" } else { " F1200" };
                text += &format!("G1 X{}{feed}\n", ORIGIN_MM + step * self.step_mm);
            }
            text += &format!("G1 Y{}\n", ORIGIN_MM + 1 + pass);
        }
        text + "M30\n"
    }

    /// The line in which the tool is there.
    fn line_at(self, [x, y]: [f64; 2]) -> u32 {
        let (across, along) = (y - f64::from(ORIGIN_MM), x - f64::from(ORIGIN_MM));
        let pass = (across + ROUNDING_MM).floor().max(0.0);
        let steps = |mm: f64| ((mm - ROUNDING_MM) / f64::from(self.step_mm)).floor().max(0.0);
        let step = match pass as i32 % 2 {
            _ if across - pass > ROUNDING_MM => f64::from(self.steps),
            0 => steps(along),
            _ => steps(f64::from(self.steps * self.step_mm) - along),
        };
        FIRST_LINE + (pass as i32 * (self.steps + 1) + step as i32) as u32
    }
}

/// A moment on the line and in what is reported.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moment {
    pub(crate) wire: usize,
    pub(crate) states: usize,
}

/// A whole machine. What is declared first goes first.
#[derive(Debug)]
pub(crate) struct Cell {
    pub(crate) commander: Commander,
    pub(crate) wire: Wire,
    pub(crate) controller: Controller,
    pub(crate) machine: Machine,
    program: Serpentine,
    time_factor: u32,
}

/// How a cell is made.
pub(crate) struct Plan<'a> {
    /// How much faster than real time the controller lives.
    pub(crate) time_factor: u32,
    pub(crate) controller: &'a [&'a str],
    pub(crate) ros: &'a [&'a str],
    /// Whether the board is reset by a rising DTR.
    pub(crate) resets_when_opened: bool,
    /// How the nodes are started.
    pub(crate) surround: &'a dyn Fn(Command, &Path) -> Command,
    /// The program that is loaded.
    pub(crate) program: Serpentine,
    pub(crate) cable: Cable,
}

impl Default for Plan<'_> {
    fn default() -> Self {
        Self {
            time_factor: 4,
            controller: &[],
            ros: &[],
            resets_when_opened: false,
            surround: &|command, _| command,
            program: Serpentine::SHORT_LINES,
            cable: Cable::wanted(),
        }
    }
}

impl Cell {
    /// A machine that is connected to its controller and has a serpentine loaded.
    pub(crate) fn new(plan: &Plan<'_>) -> Self {
        let turn = Turn::wait();
        let controller = Controller::start(plan.time_factor, plan.controller);
        let orders = controller.orders();
        let reset: Reset = Box::new(move || orders.inject("reset"));
        let reset = plan.resets_when_opened.then_some(reset);
        // Next to the device, whose number is unique.
        let number = controller.port().file_name().expect("a number").to_string_lossy();
        let name = format!("kerf-line-{}-{number}", std::process::id());
        let link = std::env::temp_dir().join(name);
        let wire = Wire::new(&link, controller.port(), reset, plan.cable);
        let port = format!("axis_driver:port:={}", wire.port().display());
        let mut ros = vec!["-p", &port];
        ros.extend(SLOW_POLLING);
        ros.extend(plan.ros);
        let machine =
            Machine::start_as(&domain(), "cell", &[], &ros, Some(turn), |command, folder| {
                (plan.surround)(command, folder)
            });
        let commander = Commander::join(&machine);
        let Plan { program, time_factor, .. } = *plan;
        let cell = Self { commander, wire, controller, machine, program, time_factor };
        cell.commander.until("the first report", |state| state.position_known);
        cell.machine.folder.file("serpentine.ngc", program.text());
        cell.machine.kerf(&["load", "serpentine.ngc"]).expect(0);
        cell
    }

    /// Begins a run and waits until it is in the midst of its lines.
    #[track_caller]
    pub(crate) fn run_into_the_midst(&self) -> Running {
        let run = self.commander.run().expect("the driver takes the run");
        self.until_in_the_midst();
        run
    }

    /// Waits until a run is in the midst of its lines.
    #[track_caller]
    pub(crate) fn until_in_the_midst(&self) {
        self.commander.until("the midst of the run", |state| {
            mode_from_wire(state.state).name() == "RUN" && state.line > FIRST_LINE
        });
    }

    /// Connects another controller through another device.
    pub(crate) fn replace_controller(&mut self, args: &[&str]) {
        self.controller = Controller::start(self.time_factor, args);
        self.wire.plug_into(self.controller.port());
    }

    /// Now.
    pub(crate) fn moment(&self) -> Moment {
        Moment { wire: self.wire.mark(), states: self.commander.mark() }
    }

    /// Waits for the end of a run.
    #[track_caller]
    pub(crate) fn result(&self, run: Running) -> RunProgramResult {
        self.commander.result(run).expect("a goal ends with a result")
    }

    /// Waits until the controller itself says that it is in this state.
    #[track_caller]
    pub(crate) fn until_controller(&self, state: &str) {
        until(&format!("a controller in {state}"), || {
            self.wire.say_to_controller(b"?");
            let report = self.wire.last_report()?;
            report.trim_start_matches('<').starts_with(state).then_some(())
        });
    }

    /// Waits until a run can be taken.
    #[track_caller]
    pub(crate) fn until_ready(&self) -> MachineState {
        self.commander.until("an idle machine", |state| {
            state.state == MachineState::STATE_IDLE && state.reason.is_empty()
        })
    }

    /// What the driver has written since then, without its questions for status.
    pub(crate) fn sent_since(&self, moment: Moment) -> String {
        self.wire.sent_since(moment.wire)
    }

    /// Waits until the driver has written this since then.
    #[track_caller]
    pub(crate) fn until_sent(&self, moment: Moment, what: &str) {
        until(what, || self.sent_since(moment).contains(what).then_some(()));
    }

    /// Waits for a state that was published after this moment.
    #[track_caller]
    pub(crate) fn until_after(
        &self,
        moment: Moment,
        what: &str,
        is_so: impl Fn(&MachineState) -> bool,
    ) -> MachineState {
        until(what, || self.commander.states_since(moment.states).into_iter().rev().find(&is_so))
    }

    /// What the driver has written since then, after the first feed hold.
    #[track_caller]
    pub(crate) fn sent_after_hold(&self, moment: Moment) -> String {
        let sent = self.sent_since(moment);
        // A hold that does not show in time is sent again.
        let after = sent.split_once('!').map(|(_, after)| after.trim_start_matches('!'));
        after.unwrap_or_else(|| panic!("no hold in {sent:?}")).to_owned()
    }

    /// The states since then, each mode once.
    pub(crate) fn modes_since(&self, moment: Moment) -> Vec<&'static str> {
        let states = self.commander.states_since(moment.states);
        let mut modes: Vec<_> = states.iter().map(|it| mode_from_wire(it.state).name()).collect();
        modes.dedup();
        modes
    }

    /// The position of the tool in the driver's last report, mm.
    #[track_caller]
    pub(crate) fn place(&self) -> [f64; 2] {
        let passed = self.wire.passed_since(0).into_iter().rev();
        let mut reports = passed
            .filter(|passed| passed.from == Writer::Controller && passed.arrived.starts_with(b"<"));
        let report = reports.next().expect("a report was received").arrived;
        let report = String::from_utf8_lossy(&report).into_owned();
        let place = report.split_once("MPos:").expect("a position").1;
        let mut axes = place.split([',', '|', '>']).map(|axis| axis.parse::<f64>());
        [(); 2].map(|()| axes.next().expect("an axis").expect("a number"))
    }

    /// Fails unless the tool is in this line.
    #[track_caller]
    pub(crate) fn is_at_line(&self, line: u32) {
        let place = self.place();
        let there = self.program.line_at(place);
        assert!(
            line.abs_diff(there) <= 1,
            "line {line} was reported, line {there} is at {place:?}"
        );
    }

    /// Fails unless this names a line of the program and shows its text.
    #[track_caller]
    pub(crate) fn names_its_block(&self, message: &str) {
        let after = message.split_once("line ").map(|(_, after)| after);
        let number = after.and_then(|text| text.split(|c: char| !c.is_ascii_digit()).next());
        let line = number.and_then(|number| number.parse::<usize>().ok());
        let text = self.program.text();
        let block = line.and_then(|line| text.lines().nth(line - 1));
        let block = block.unwrap_or_else(|| panic!("no line of the program in {message:?}"));
        assert!(message.contains(block), "{block:?} is not in {message:?}");
    }

    /// Fails unless a run is refused, with these words.
    #[track_caller]
    pub(crate) fn refuses_to_run(&self, words: &str) {
        let why = self.commander.run().expect_err("a run is refused");
        assert!(why.contains(words), "{words:?} is not in {why:?}");
    }

    /// Fails unless a run is taken, and ends it.
    #[track_caller]
    pub(crate) fn runs_again(&self) {
        self.until_ready();
        let run = self.run_into_the_midst();
        self.commander.cancel();
        let result = self.result(run);
        assert_eq!(result.outcome, RunProgramResult::OUTCOME_CANCELED, "{result:?}");
        self.until_ready();
    }
}

/// Settings of a controller, as a file.
pub(crate) fn settings(lines: &str) -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().expect("a file");
    std::fs::write(file.path(), lines).expect("written");
    file
}

/// Fails if any of these is said to be idle.
#[track_caller]
pub(crate) fn never_idle(states: &[MachineState]) {
    let idle = states.iter().find(|state| state.state == MachineState::STATE_IDLE);
    assert!(idle.is_none(), "that is not known: {idle:?}");
}

#[test]
fn a_place_of_a_serpentine_determines_its_line() {
    let check = |program: Serpentine, place: [f64; 2], line: u32, words: &str| {
        assert_eq!(program.line_at(place), line, "{place:?}");
        assert_eq!(program.text().lines().nth(line as usize - 1), Some(words));
    };
    let short = Serpentine::SHORT_LINES;
    check(short, [-99.5, -100.0], 3, "G1 X-99 F1200");
    check(short, [-99.0, -100.0], 3, "G1 X-99 F1200");
    check(short, [-98.8, -100.0], 4, "G1 X-98");
    check(short, [-50.0, -99.5], 53, "G1 Y-99");
    check(short, [-50.5, -99.0], 54, "G1 X-51");
    check(short, [-100.0, -98.5], 104, "G1 Y-98");
    check(short, [-99.5, -98.0], 105, "G1 X-99");
    let long = Serpentine::LONG_LINES;
    check(long, [-70.0, -100.0], 3, "G1 X-60 F1200");
    check(long, [300.0, -99.8], 13, "G1 Y-99");
    check(long, [290.0, -99.0], 14, "G1 X260");
}
