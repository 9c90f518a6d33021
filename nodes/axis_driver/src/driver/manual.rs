//! The phase `Manual`: homing, a jog, a probe, an unlock, an offset.
//!
//! One at a time, from a machine that stands: a few lines, each sent when the one
//! before is answered, and for a move the wait until the machine stands again.
//! `lines` says which lines those are, `outcome` how the operation ended.

pub(super) mod configure;
pub(super) mod lines;
mod outcome;

pub(super) use lines::ManualOrder;

use super::answer::Refusal;
use super::context::config::{ANSWER, REPORTS_PER_HOLD, STANDSTILL};
use super::context::{Context, Origin};
use super::next::Next;
use super::output::LogLevel;
use crate::codes::{self, error_code};
use crate::link::{LineKind, realtime};
use crate::report::ControllerState;
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::Position;
use cnc_msgs::machine::Mode;
use std::collections::VecDeque;
use std::time::Duration;

/// Asks for all offsets.
const OFFSETS: &str = "$#";

/// Owns a manual operation: the lines that are left of it, what it waits for, and why it
/// is being stopped.
#[derive(Debug)]
pub(super) struct ManualOperation {
    /// The command that began it.
    pub(super) id: u64,
    pub(super) task: Task,
    /// Lines to be sent, each when the one before is answered.
    lines: VecDeque<String>,
    kind: LineKind,
    step: ManualStep,
    until: Option<Duration>,
    /// Why it is to end before it is done.
    stop: Option<Refusal>,
    /// It was refused; one more line makes the controller listen again.
    refused: Option<Refusal>,
}

/// The end of a manual operation, and the phase that follows.
#[derive(Debug)]
pub(super) struct ManualEnd {
    pub(super) result: Result<String, Refusal>,
    pub(super) next: Next,
    /// The controller is reset once the end is reported.
    pub(super) is_reset: bool,
}

/// What a manual operation does.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Task {
    Home,
    Unlock,
    Sleep,
    /// The message when it is done.
    SetWorkOffset {
        done: String,
    },
    /// The mask of the report that was written, and what the report has with it.
    Configure {
        wanted: u32,
        done: String,
    },
    /// To here, machine frame, mm; and the further axes that move.
    Jog {
        target: Position,
        further: FurtherAxes,
    },
    /// Until something is found, here in the machine frame, mm.
    Probe {
        may_miss: bool,
        touch: Option<Touch>,
    },
}

/// Where a probe has ended, machine frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Touch {
    position: Position,
    further: FurtherAxes,
    found: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum ManualStep {
    /// A line is under way.
    Asked,
    /// All is answered; the axes move until the machine reports that it stands.
    Answered { reports: u32 },
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
    /// Begins with the first of these lines; the others follow.
    pub(super) fn begin(context: &mut Context, id: u64, order: ManualOrder) -> Self {
        let ManualOrder { task, kind, lines } = order;
        let until = match task {
            Task::Home => {
                let limit = Duration::from_secs(u64::from(context.config.homing_s_max));
                Some(context.now + limit)
            }
            // It lasts as long as the way does; a controller that is gone is noticed.
            Task::Jog { .. } | Task::Probe { .. } => None,
            _ => Some(context.now + ANSWER),
        };
        let lines = lines.into();
        let (step, stop, refused) = (ManualStep::Asked, None, None);
        let mut operation = Self { id, task, lines, kind, step, until, stop, refused };
        // A hold that is still looked for was meant for what went before.
        context.hold = None;
        operation.send_line(context);
        operation
    }

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

    /// False when there is none left.
    fn send_line(&mut self, context: &mut Context) -> bool {
        let Some(text) = self.lines.pop_front() else { return false };
        if text == OFFSETS {
            // What was reported before has changed.
            context.machine.offsets.clear();
        }
        if self.until.is_some() && !self.is_homing() {
            self.until = Some(context.now + ANSWER);
        }
        context.machine.on_line(&text);
        context.link.send_line(&text, self.kind, Origin::Manual);
        true
    }

    pub(super) fn on_answer(
        &mut self,
        context: &mut Context,
        error: Option<u16>,
    ) -> Option<ManualEnd> {
        let firmware = context.machine.firmware;
        if let Some(code) = error {
            let text = codes::describe_error(firmware, code);
            let refusal = Refusal::new(
                error_code::CONTROLLER_ERROR,
                format!("the controller refused: {text}"),
            );
            if !firmware.traits().error_lasts || self.refused.is_some() {
                return Some(ManualEnd::refused(refusal, Next::Ready));
            }
            // It answers every further line with the same error until it reads an empty one.
            self.refused = Some(refusal);
            self.until = Some(context.now + ANSWER);
            context.link.send_line("", LineKind::Slow, Origin::Manual);
            return None;
        }
        if let Some(refusal) = self.refused.take() {
            return Some(ManualEnd::refused(refusal, Next::Ready));
        }
        if self.send_line(context) {
            return None;
        }
        // What it has done shows in the next report; whoever asked can rely on it then.
        self.step = ManualStep::Answered { reports: 0 };
        match &self.task {
            Task::Home => {
                context.machine.is_homed = true;
                self.until = Some(context.now + ANSWER);
            }
            // Before its answer a cancel would have left the line to be run.
            Task::Jog { .. } if self.stop.is_some() => {
                context.link.send_realtime(realtime::JOG_CANCEL);
            }
            _ => {}
        }
        context.link.ask_status(context.now);
        None
    }

    /// Takes a status report, which is in the machine model already.
    pub(super) fn on_status(&mut self, context: &mut Context) -> Option<ManualEnd> {
        if context.machine.is_held()
            && let Some(stop) = self.stop.take()
        {
            // What is left of the move is dropped.
            return Some(ManualEnd::refused(stop, Next::Ready).with_reset());
        }
        let ManualStep::Answered { reports } = &mut self.step else { return None };
        let is_over = match self.task {
            Task::Jog { .. } | Task::Probe { .. } => context.machine.mode() == Mode::Idle,
            _ => true,
        };
        if is_over {
            return Some(ManualEnd {
                result: self.judge(context),
                next: Next::Ready,
                is_reset: false,
            });
        }
        *reports += 1;
        let is_deaf_to_cancel =
            self.stop.is_some() && context.machine.is_state(&ControllerState::Jog);
        if is_deaf_to_cancel && *reports % REPORTS_PER_HOLD == 0 {
            context.link.send_realtime(realtime::JOG_CANCEL);
        }
        None
    }

    /// Takes what the controller reports about a probe.
    pub(super) fn on_probe(&mut self, position: Position, further: FurtherAxes, found: bool) {
        if let Task::Probe { touch, .. } = &mut self.task {
            *touch = Some(Touch { position, further, found });
        }
    }

    /// Stops a jog or a probe; it ends when the machine stands.
    pub(super) fn stop(&mut self, context: &mut Context, why: Refusal) {
        if self.stop.replace(why).is_some() {
            return;
        }
        self.until = Some(context.now + STANDSTILL);
        match (&self.task, self.step) {
            (Task::Jog { .. }, ManualStep::Answered { .. }) => {
                context.link.send_realtime(realtime::JOG_CANCEL);
            }
            (Task::Probe { .. }, _) => context.link.send_realtime(realtime::FEED_HOLD),
            _ => {}
        }
    }

    pub(super) fn on_timeout(&mut self, context: &mut Context) -> ManualEnd {
        let text = match (self.is_homing(), self.stop.is_some()) {
            (true, _) => "the axes did not find their switches in time; the controller was reset",
            (_, true) => "the controller did not come to a standstill; motion may continue",
            _ => "the controller did not answer in time; soft_reset to go on",
        };
        context.log(LogLevel::Error, text);
        let end = ManualEnd::refused(Refusal::new(error_code::NO_ANSWER, text), Next::adrift(text));
        if self.is_homing() { end.with_reset() } else { end }
    }
}

impl ManualEnd {
    /// It was refused or interrupted.
    pub(super) fn refused(refusal: Refusal, next: Next) -> Self {
        Self { result: Err(refusal), next, is_reset: false }
    }

    /// The controller is reset after it.
    pub(super) fn with_reset(self) -> Self {
        Self { is_reset: true, ..self }
    }
}
