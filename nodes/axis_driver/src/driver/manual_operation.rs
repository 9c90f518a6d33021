//! What the machine does by hand: homing, a jog, a probe, an unlock, an offset.
//!
//! One at a time, from a machine that stands: a few lines, each sent when the one
//! before is answered, and for what moves the wait until the machine stands again.
//! Which lines those are `manual_lines` says.

use super::config::{ANSWER, REPORTS_PER_HOLD, STANDSTILL};
use super::{Driver, LogLevel, Origin, Output, Phase, Refusal, RunOutcome};
use crate::codes::{self, error_code};
use crate::link::{LineKind, realtime};
use crate::report::ControllerState;
use cnc_msgs::geometry::{AXIS_LETTERS, Position};
use cnc_msgs::machine::Mode;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::time::Duration;

/// Asks for all offsets.
pub(super) const OFFSETS: &str = "$#";
/// How far from its target a jog may end, mm: steps, and three decimals.
const JOG_TOLERANCE_MM: f64 = 0.02;

/// Something with a line or a few that is no program.
#[derive(Debug)]
pub(super) struct ManualOperation {
    /// The command that began it.
    pub(super) id: u64,
    pub(super) task: Task,
    /// Lines to be sent, each when the one before is answered.
    lines: VecDeque<String>,
    kind: LineKind,
    step: Step,
    until: Option<Duration>,
    /// Why it is to end before it is done.
    stop: Option<Refusal>,
    /// It was refused; one more line makes the controller listen again.
    refused: Option<Refusal>,
}

/// What is done.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Task {
    Home,
    Unlock,
    Sleep,
    /// What was called what.
    SetWorkOffset {
        done: String,
    },
    /// The mask of the report that was written, and what that gives.
    Configure {
        wanted: u32,
        done: String,
    },
    /// To here, machine frame, mm.
    Jog {
        target: Position,
    },
    /// Until something is found, here in the machine frame, mm.
    Probe {
        may_miss: bool,
        heard: Option<(Position, bool)>,
    },
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Step {
    /// A line is under way.
    Asked,
    /// All is answered; the axes move until the machine reports that it stands.
    Answered { reports: u32 },
}

/// How a jog or a probe ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MoveResult {
    /// The command that began it.
    pub id: u64,
    pub outcome: RunOutcome,
    /// 0 when it succeeded; see [`error_code`].
    pub error_code: u16,
    pub message: String,
    /// Where the tool stands after a jog, or where the probe touched; machine frame, mm.
    pub machine_position: Option<Position>,
    /// The same in the work frame.
    pub work_position: Option<Position>,
    /// Whether the probe touched, or let go.
    pub found: bool,
}

impl Task {
    pub(super) fn moves(&self) -> bool {
        matches!(self, Self::Jog { .. } | Self::Probe { .. })
    }

    const fn name(&self) -> &'static str {
        match self {
            Self::Home => "homing",
            Self::Unlock => "an unlock",
            Self::Sleep => "going to sleep",
            Self::SetWorkOffset { .. } => "setting an offset",
            Self::Configure { .. } => "configuring the controller",
            Self::Jog { .. } => "a jog",
            Self::Probe { .. } => "a probe",
        }
    }
}

impl ManualOperation {
    pub(super) fn until(&self) -> Option<Duration> {
        self.until
    }

    pub(super) fn is_homing(&self) -> bool {
        self.task == Task::Home
    }

    /// `homing is under way`
    pub(super) fn describe(&self) -> String {
        format!("{} is under way", self.task.name())
    }

    /// The mode where the controller still calls itself idle.
    pub(super) fn mode(&self, reported: Mode) -> Mode {
        match (&self.task, reported) {
            (Task::Home, _) => Mode::Home,
            (Task::Jog { .. }, Mode::Idle) => Mode::Jog,
            (Task::Probe { .. }, Mode::Idle) => Mode::Run,
            _ => reported,
        }
    }
}

impl Driver {
    /// Sends the first of these lines; the others follow.
    pub(super) fn begin_manual(
        &mut self,
        id: u64,
        task: Task,
        kind: LineKind,
        lines: impl IntoIterator<Item = String>,
    ) {
        let until = match task {
            Task::Home => {
                let limit = Duration::from_secs(u64::from(self.config.homing_s_max));
                Some(self.now + limit)
            }
            // It lasts as long as the way does; a controller that is gone is noticed.
            Task::Jog { .. } | Task::Probe { .. } => None,
            _ => Some(self.now + ANSWER),
        };
        self.pause_run();
        let lines = lines.into_iter().collect();
        let operation = ManualOperation {
            id,
            task,
            lines,
            kind,
            step: Step::Asked,
            until,
            stop: None,
            refused: None,
        };
        self.phase = Phase::Manual(Box::new(operation));
        // A hold that is still looked for was meant for what went before.
        self.hold = None;
        self.send_manual_line();
    }

    /// False when there is none left.
    fn send_manual_line(&mut self) -> bool {
        let Phase::Manual(operation) = &mut self.phase else { return false };
        let Some(text) = operation.lines.pop_front() else { return false };
        if text == OFFSETS {
            // What was told before has changed.
            self.machine.offsets.clear();
        }
        if operation.until.is_some() && !operation.is_homing() {
            operation.until = Some(self.now + ANSWER);
        }
        self.link.send_line(&text, operation.kind, Origin::Manual);
        true
    }

    pub(super) fn on_manual_answer(&mut self, error: Option<u16>) {
        let firmware = self.machine.firmware;
        if let Some(code) = error {
            let text = codes::describe_error(firmware, code);
            let refusal = Refusal::new(
                error_code::CONTROLLER_ERROR,
                format!("the controller refused: {text}"),
            );
            let Phase::Manual(operation) = &mut self.phase else { return };
            if !firmware.traits().error_lasts || operation.refused.is_some() {
                return self.end_manual(Err(refusal), Phase::Ready);
            }
            // It answers every further line with the same error until it reads an empty one.
            operation.refused = Some(refusal);
            operation.until = Some(self.now + ANSWER);
            return self.link.send_line("", LineKind::Slow, Origin::Manual);
        }
        if let Phase::Manual(operation) = &mut self.phase
            && let Some(refusal) = operation.refused.take()
        {
            return self.end_manual(Err(refusal), Phase::Ready);
        }
        if self.send_manual_line() {
            return;
        }
        let Phase::Manual(operation) = &mut self.phase else { return };
        // What it has done shows in the next report; whoever asked can rely on it then.
        operation.step = Step::Answered { reports: 0 };
        match &operation.task {
            Task::Home => {
                self.machine.is_homed = true;
                operation.until = Some(self.now + ANSWER);
            }
            // Before its answer a cancel would have left the line to be run.
            Task::Jog { .. } if operation.stop.is_some() => {
                self.link.send_realtime(realtime::JOG_CANCEL);
            }
            _ => {}
        }
        self.link.ask_status(self.now);
    }

    pub(super) fn on_manual_status(&mut self) {
        let state = self.machine.mode();
        let is_jog = self.machine.is_state(&ControllerState::Jog);
        let is_held = self.machine.is_held();
        let Phase::Manual(operation) = &mut self.phase else { return };
        if is_held && let Some(stop) = operation.stop.take() {
            // What is left of the move is dropped.
            self.end_manual(Err(stop), Phase::Ready);
            return self.begin_reset(None);
        }
        let Step::Answered { reports } = &mut operation.step else { return };
        let is_over = match operation.task {
            Task::Jog { .. } | Task::Probe { .. } => state == Mode::Idle,
            _ => true,
        };
        if is_over {
            let result = self.judge();
            return self.end_manual(result, Phase::Ready);
        }
        *reports += 1;
        let is_deaf_to_cancel = operation.stop.is_some() && is_jog;
        if is_deaf_to_cancel && *reports % REPORTS_PER_HOLD == 0 {
            self.link.send_realtime(realtime::JOG_CANCEL);
        }
    }

    /// How it ended: all is answered, and the machine stands.
    fn judge(&mut self) -> Result<String, Refusal> {
        let is_alarm = self.machine.mode() == Mode::Alarm;
        let at = self.machine.machine_position();
        let Phase::Manual(operation) = &mut self.phase else { return Ok(String::new()) };
        if let Some(stop) = operation.stop.take() {
            return Err(stop);
        }
        match &operation.task {
            Task::Home | Task::Unlock if is_alarm => {
                let text = "the controller took it and is still in alarm";
                Err(Refusal::new(error_code::ALARM, text))
            }
            Task::Home => Ok("homed".into()),
            Task::Unlock => {
                Ok("unlocked; the position may be wrong until the machine is homed".into())
            }
            Task::Sleep => Ok("the controller sleeps; soft_reset wakes it".into()),
            Task::SetWorkOffset { done } => {
                let done = done.clone();
                self.publish_settings();
                Ok(done)
            }
            Task::Configure { wanted, done } => {
                let (wanted, done) = (*wanted, done.clone());
                self.publish_settings();
                self.judge_mask(wanted, &done)
            }
            Task::Jog { target } => {
                let at = at.unwrap_or(*target);
                if (0..3).all(|axis| (at[axis] - target[axis]).abs() <= JOG_TOLERANCE_MM) {
                    return Ok("done".into());
                }
                let show = |place: &Position| {
                    let words =
                        (0..3).map(|axis| format!("{}{:.3}", AXIS_LETTERS[axis], place[axis]));
                    words.collect::<Vec<_>>().join(" ")
                };
                let text = format!(
                    "the jog ended at {} and not at {} in the machine frame: it was held, or cut \
                     short by the controller at the end of its travel",
                    show(&at),
                    show(target)
                );
                Err(Refusal::new(error_code::STOPPED_SHORT, text))
            }
            Task::Probe { heard: Some((_, true)), .. } => Ok("done".into()),
            Task::Probe { heard: Some((_, false)), may_miss: true } => {
                Ok("nothing was found on the way".into())
            }
            Task::Probe { .. } => {
                let text = "the controller did not say where the probe touched";
                Err(Refusal::new(error_code::PROBE_FAILED, text))
            }
        }
    }

    /// Takes what the controller says of a probe.
    pub(super) fn hear_probe(&mut self, position: Position, found: bool) {
        if let Phase::Manual(operation) = &mut self.phase
            && let Task::Probe { heard, .. } = &mut operation.task
        {
            *heard = Some((position, found));
        }
    }

    /// Stops a jog or a probe; it ends when the machine stands.
    pub(super) fn stop_move(&mut self, why: Refusal) {
        let Phase::Manual(operation) = &mut self.phase else { return };
        if operation.stop.replace(why).is_some() {
            return;
        }
        operation.until = Some(self.now + STANDSTILL);
        match (&operation.task, operation.step) {
            (Task::Jog { .. }, Step::Answered { .. }) => {
                self.link.send_realtime(realtime::JOG_CANCEL);
            }
            (Task::Probe { .. }, _) => self.link.send_realtime(realtime::FEED_HOLD),
            _ => {}
        }
    }

    pub(super) fn on_manual_timeout(&mut self) {
        let Phase::Manual(operation) = &self.phase else { return };
        let (is_homing, is_stopping) = (operation.is_homing(), operation.stop.is_some());
        let text = match (is_homing, is_stopping) {
            (true, _) => "the axes did not find their switches in time; the controller was reset",
            (_, true) => "the controller did not come to a standstill; motion may continue",
            _ => "no answer in time; soft_reset to go on",
        };
        self.log(LogLevel::Error, text.into());
        let refusal = Refusal::new(error_code::NO_ANSWER, text);
        self.end_manual(Err(refusal), Phase::Adrift { reason: text.into() });
        if is_homing {
            self.begin_reset(None);
        }
    }

    /// Ends what is done by hand, and says so to whoever asked for it.
    pub(super) fn end_manual(&mut self, result: Result<String, Refusal>, next: Phase) {
        let Phase::Manual(operation) = std::mem::replace(&mut self.phase, next) else {
            panic!("only a manual operation can end");
        };
        let ManualOperation { id, task, .. } = *operation;
        let refusal = result.as_ref().err().map(|it| (it.error_code, it.message.clone()));
        self.end_paused_with(refusal.as_ref().map(|(code, text)| (*code, text.as_str())));
        if self.machine.status.is_some() {
            // Whoever hears of the end finds the state of it.
            self.publish();
        }
        if !task.moves() {
            return self.reply(id, result);
        }
        let heard = match task {
            Task::Probe { heard, .. } => heard,
            _ => self.machine.machine_position().map(|at| (at, false)),
        };
        let found = heard.is_some_and(|(_, found)| found);
        // Only a machine that stands is where it was reported last.
        let stands = match &result {
            Ok(_) => true,
            Err(refusal) => {
                matches!(refusal.error_code, error_code::CANCELED | error_code::STOPPED_SHORT)
            }
        };
        let is_place = found || stands && matches!(task, Task::Jog { .. });
        let machine_position = heard.filter(|_| is_place).map(|(at, _)| at);
        let work_position = machine_position.and_then(|at| self.machine.in_work_frame(at));
        let (outcome, error_code, message) = match result {
            Ok(message) => (RunOutcome::Succeeded, 0, message),
            Err(Refusal { error_code: error_code::CANCELED, message }) => {
                (RunOutcome::Canceled, error_code::CANCELED, message)
            }
            Err(Refusal { error_code, message }) => (RunOutcome::Aborted, error_code, message),
        };
        self.outputs.push_back(Output::MoveFinished(MoveResult {
            id,
            outcome,
            error_code,
            message,
            machine_position,
            work_position,
            found,
        }));
    }
}
