//! The driver on a virtual controller: commands, faults and time in any order.
//!
//! Every command is answered once and every goal that was accepted ends once, in time;
//! nothing is sent without an order except `?`, `!` and a reset; and a machine that is
//! not reachable is never idle.

use crate::mutate::Random;
use crate::orders::Orders;
use axis_driver::driver::{
    Command, Driver, DriverConfig, Input, JogFrame, JogRequest, OffsetRequest, OnCommanderLoss,
    Output, Overrides, ProbeRequest, ReplanRequest, RunOutcome, RunRequest,
};
use cnc_msgs::contour::{Action, CoolantMode, Probe, Source, SpindleMode};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::machine::Mode;
use cnc_msgs::path::{CompensatedPath, PathEvent, StartInSpan};
use kerf_tests::line::straight;
use std::sync::Arc;
use std::time::Duration;
use virtual_controller::{
    Build, ByteFault, Controller, Direction, FaultAction, FaultInjector, Firmware, LineTiming,
    PacedLine, Settings,
};

const X: AxisSet = AxisSet::from_bits(0b001);
const Z: AxisSet = AxisSet::from_bits(0b100);
/// After this long without a report, the reported state does not count any more.
const SILENCE: Duration = Duration::from_millis(1500);
/// Everything that was begun has ended by then: homing may take three minutes.
const TIMEOUT: Duration = Duration::from_secs(300);

/// What came of the goals of a case.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Goals {
    pub(crate) accepted: u64,
    pub(crate) finished: u64,
    pub(crate) succeeded: u64,
}

struct Bench {
    driver: Driver,
    controller: PacedLine<FaultInjector>,
    orders: Orders,
    paths: Vec<Arc<CompensatedPath>>,
    now: Duration,
    is_open: bool,
    /// When the last bytes of a report came.
    received_at: Duration,
    next_id: u64,
    succeeded: u64,
    story: Vec<String>,
}

/// One case.
pub(crate) fn check(random: &mut Random) -> Goals {
    let firmware = *random.of(&Firmware::ALL);
    let start_in_machine = Some([-300.0, -200.0, -50.0]);
    let build = Build { start_in_machine, ..Build::new(Settings::small_router_of(firmware)) };
    let losses = OnCommanderLoss::WORDS.map(|(_, on_loss)| on_loss);
    let config = DriverConfig {
        reset_on_connect: !random.once_in(4),
        check_in_controller: random.once_in(3),
        on_commander_loss: *random.of(&losses),
        ..DriverConfig::default()
    };
    let device = FaultInjector::new(Controller::with_build(build), Vec::new(), 1);
    let mut bench = Bench {
        driver: Driver::new(config.clone()),
        controller: PacedLine::new(device, LineTiming::default()),
        orders: Orders::new(&config),
        paths: vec![Arc::new(path()), Arc::new(straight(40, 0.3))],
        now: Duration::ZERO,
        is_open: false,
        received_at: Duration::ZERO,
        next_id: 1,
        succeeded: 0,
        story: vec![format!("{firmware:?} {config:?}")],
    };
    bench.open(true);
    // Mostly from a machine that waits for orders.
    let begin = if random.once_in(5) { 0.0 } else { 4.0 };
    bench.wait(begin);
    for _ in 0..5 + random.below(40) {
        bench.act(random);
        let seconds = *random.of(&[0.0, 0.0, 0.003, 0.02, 0.2, 0.9, 2.5, 7.0]);
        bench.wait(seconds);
    }
    bench.end();
    let Orders { accepted, finished, .. } = bench.orders;
    Goals { accepted, finished, succeeded: bench.succeeded }
}

/// With everything that may interrupt a run.
fn path() -> CompensatedPath {
    let mut path = straight(60, 1.0);
    let events = [
        (0, Action::SpindleSpeed { rpm: 5_000.0 }),
        (0, Action::Spindle(SpindleMode::Clockwise)),
        (5, Action::Coolant(CoolantMode::Flood)),
        (12, Action::Dwell { seconds: 0.4 }),
        (20, Action::ChangeTool { tool: 2 }),
        (30, Action::Probe(Probe { away: false, may_miss: true })),
        (60, Action::ProgramEnd { rewind: true }),
    ];
    path.events = events
        .into_iter()
        .map(|(at_element, action)| {
            let line = match action {
                // It is of the block of its motion.
                Action::Probe(_) => at_element + 1,
                _ => at_element,
            };
            let source = Source { line: line as u32, ..Source::default() };
            PathEvent { at_element, action, source }
        })
        .collect();
    path
}

impl Bench {
    fn handle(&mut self, input: Input) {
        if let Input::Command { id, command } = &input {
            self.orders.on_command(*id, command);
        }
        self.driver.handle(self.now, input);
        while let Some(output) = self.driver.poll_output() {
            match output {
                Output::Transmit(bytes) => {
                    assert!(self.is_open, "bytes to a port that is closed");
                    self.orders.check_sent(&bytes);
                    self.controller.receive(self.now, &bytes);
                }
                Output::Reply { id, result } => {
                    self.record(format!("reply {id} {result:?}"));
                    self.orders.on_reply(id, result.is_ok());
                }
                // Nobody plans what follows, or does the function: the run ends after a minute.
                Output::Probes(found) => self.record(format!("{found:?}")),
                Output::UserFunction(call) => self.record(format!("{call:?}")),
                Output::RunFinished(result) => {
                    self.record(format!("{result:?}"));
                    self.succeeded += u64::from(result.outcome == RunOutcome::Succeeded);
                    self.orders.on_finished(result.id);
                }
                Output::MoveFinished(result) => {
                    self.record(format!("{result:?}"));
                    self.succeeded += u64::from(result.outcome == RunOutcome::Succeeded);
                    self.orders.on_finished(result.id);
                }
                Output::ReadyToClose => self.orders.on_ready_to_close(),
                Output::Log { message, .. } => self.record(message),
                Output::State(_) | Output::Progress { .. } | Output::Settings(_) => {}
            }
        }
        self.orders.on_handled();
        self.look();
    }

    fn look(&self) {
        let mode = self.driver.state(self.now).mode;
        if !self.is_open {
            assert!(matches!(mode, Mode::Disconnected | Mode::Unknown), "{mode:?} without a port");
        } else if self.now > self.received_at + SILENCE {
            assert_ne!(mode, Mode::Idle, "nothing was received since {:?}", self.received_at);
        }
    }

    fn record(&mut self, what: String) {
        self.story.push(format!("{:.3} {what}", self.now.as_secs_f64()));
    }

    fn open(&mut self, is_open: bool) {
        self.record(format!("open {is_open}"));
        self.is_open = is_open;
        self.received_at = self.now;
        self.handle(match is_open {
            true => Input::PortOpened,
            false => Input::PortClosed { reason: "unplugged".into() },
        });
    }

    fn step(&mut self, end: Duration) {
        let timer = self.driver.next_deadline();
        let event = self.controller.next_event();
        let next = timer.into_iter().chain(event).min().unwrap_or(end).min(end);
        self.now = self.now.max(next) + Duration::from_nanos(1);
        self.controller.advance(self.now);
        let mut bytes = Vec::new();
        self.controller.transmit(self.now, &mut bytes);
        if self.is_open && !bytes.is_empty() {
            if bytes.contains(&b'>') {
                self.received_at = self.now;
            }
            self.handle(Input::Received(bytes));
        }
        if self.driver.next_deadline().is_some_and(|deadline| deadline <= self.now) {
            self.handle(Input::Timer);
        }
    }

    fn wait(&mut self, seconds: f64) {
        let end = self.now + Duration::from_secs_f64(seconds);
        while self.now < end {
            self.step(end);
        }
    }

    fn command(&mut self, command: Command) {
        let id = self.next_id;
        self.next_id += 1;
        let name: String = format!("{command:?}").chars().take(60).collect();
        self.record(format!("command {id} {name}"));
        self.handle(Input::Command { id, command });
    }

    /// A peer sends a command, or an event happens.
    fn act(&mut self, random: &mut Random) {
        match random.below(12) {
            0 => self.happen(random),
            1 if random.once_in(4) => {
                let is_open = !self.is_open || random.once_in(3);
                self.open(is_open);
            }
            2 if self.is_open && random.once_in(4) => {
                let noise = (0..random.below(30)).map(|_| random.next() as u8).collect();
                self.record("noise".into());
                self.handle(Input::Received(noise));
            }
            _ => {
                let command = self.any_command(random);
                self.command(command);
            }
        }
    }

    fn happen(&mut self, random: &mut Random) {
        let directions = [Direction::ToController, Direction::FromController];
        let spoils = [ByteFault::Drop, ByteFault::Duplicate, ByteFault::Corrupt];
        let actions = [
            FaultAction::Byte(*random.of(&directions), *random.of(&spoils)),
            FaultAction::LoseOk,
            FaultAction::ExtraOk,
            FaultAction::Silent { seconds: Some(random.between(0.1, 9.0)) },
            FaultAction::Silent { seconds: random.once_in(2).then_some(3.0) },
            FaultAction::Delay {
                direction: *random.of(&directions),
                seconds: random.between(0.01, 1.0),
            },
            FaultAction::Alarm(1 + random.below(9) as u8),
            FaultAction::Reset,
            FaultAction::Limit(random.below(3)),
            FaultAction::Release(random.below(3)),
            FaultAction::Door,
            FaultAction::CloseDoor,
        ];
        let action = random.of(&actions).clone();
        self.record(format!("{action:?}"));
        self.controller.advance(self.now);
        let then = self.controller.device_time(self.now);
        self.controller.device_mut().inject(then, action);
    }

    fn any_command(&self, random: &mut Random) -> Command {
        let percent = |random: &mut Random| random.once_in(2).then(|| random.below(256) as u8);
        match random.below(31) {
            0..6 => {
                let revision = random.below(self.paths.len());
                Command::RunProgram(RunRequest {
                    program_id: "part".into(),
                    revision: revision as u64,
                    path: self.paths[revision].clone(),
                    start_line: if random.once_in(6) { random.below(70) as u32 } else { 0 },
                    occurrence: 0,
                    in_span: *random.of(&[
                        StartInSpan::Refused,
                        StartInSpan::Standing,
                        StartInSpan::FromAbove,
                    ]),
                    check_only: random.once_in(5),
                    tool_diameters_mm: Default::default(),
                })
            }
            6 => Command::CancelRun { run: random.once_in(3).then_some(self.next_id - 1) },
            7 | 8 => Command::FeedHold,
            9..12 => Command::Resume,
            12 | 13 => Command::SoftReset,
            14 => Command::Unlock,
            15 => Command::Home,
            16 | 17 => {
                let objection = random.once_in(4).then(|| "another tool".to_owned());
                Command::ConfirmToolChange { objection }
            }
            18 => Command::ExecuteMdi {
                path: self.paths[1].clone(),
                tool_diameters_mm: Default::default(),
            },
            19 => Command::SetSingleBlock(random.once_in(3)),
            20 | 21 => Command::Jog(JogRequest {
                further: FurtherAxes::NONE,
                frame: *random.of(&[JogFrame::Relative, JogFrame::Work, JogFrame::Machine]),
                axes: X,
                target: [random.between(-320.0, 20.0), 0.0, f64::NAN],
                feed_mm_per_min: *random.of(&[1_000.0, 60.0, 0.0, f64::NAN]),
            }),
            22 => Command::Probe(ProbeRequest {
                further: FurtherAxes::NONE,
                axes: Z,
                distance: [0.0, 0.0, -3.0],
                feed_mm_per_min: 200.0,
                away: random.once_in(4),
                may_miss: random.once_in(2),
            }),
            23 => Command::SetWorkOffset(OffsetRequest {
                further: FurtherAxes::NONE,
                system: *random.of(&[1, 2, 6, 7, 92]),
                axes: X,
                position: [random.between(-5.0, 5.0), 0.0, 0.0],
                is_origin: random.once_in(3),
            }),
            24 => Command::SetOverrides(Overrides {
                feed: percent(random),
                rapid: random.once_in(3).then(|| *random.of(&[25, 50, 100, 77])),
                spindle: percent(random),
            }),
            25 => Command::DoorHold,
            26 if random.once_in(4) => Command::Sleep,
            27 if random.once_in(6) => Command::Shutdown,
            28 => Command::Replan(ReplanRequest {
                program_id: "part".into(),
                of: random.below(2) as u64,
                revision: 7,
                path: self.paths[random.below(2)].clone(),
            }),
            29 => {
                let is_whole = !random.once_in(3);
                Command::Recorder { is_whole, reason: String::new() }
            }
            30 if random.once_in(3) => Command::Deactivate,
            30 => Command::Activate,
            _ => Command::Heartbeat,
        }
    }

    /// All that was begun ends.
    fn end(&mut self) {
        self.command(Command::CancelRun { run: None });
        self.wait(0.5);
        self.command(Command::Shutdown);
        let end = self.now + TIMEOUT;
        while self.now < end && !self.orders.owed().is_empty() {
            self.step(end);
        }
        let owed = self.orders.owed();
        assert!(owed.is_empty(), "without an answer or an end: {owed:?}");
    }
}

/// The last things that happened, when a case fails.
impl Drop for Bench {
    #[allow(clippy::print_stderr)]
    fn drop(&mut self) {
        if std::thread::panicking() {
            let from = self.story.len().saturating_sub(40);
            eprintln!("{}\n{}", self.story[0], self.story[from..].join("\n"));
        }
    }
}
