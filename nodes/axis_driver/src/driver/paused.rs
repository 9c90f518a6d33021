//! A run that waits for its tool during a manual operation.
//!
//! While M6 waits the tool is lifted, taken out, put in and touched off: jogs, probes, work
//! offsets and single blocks are taken, one at a time. The run is paused meanwhile, and goes
//! on with what was set on purpose: a work offset, and a tool length that a block has set.
//! How it gets back to where it stopped is in `run/tool_change.rs`.

use super::answer::{Answer, Refusal, done, refused};
use super::context::offsets::Shift;
use super::output::{Output, RunOutcome, RunResult};
use super::run::ProgramRun;
use super::run::exit::RunVerdict;
use super::run::progress::miss_record;
use super::run::tool_change::{NO_CHANGE, ToolChange};
use super::{Driver, Phase};
use crate::codes::error_code;
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::machine::{MachineState, Mode};

/// Owns the run that is paused, and what changed in its frame meanwhile.
#[derive(Debug)]
pub(super) struct Paused {
    pub(super) run: Box<ProgramRun>,
    /// It was canceled; it ends when the manual operation has ended.
    is_canceled: bool,
    /// The shift of G92 before.
    shift: Shift,
    /// Axes of the work frame that are being set.
    pub(super) frame: AxisSet,
}

impl Driver {
    /// Whether a manual operation may begin now although a run is under way.
    pub(super) fn is_tool_awaited(&self) -> bool {
        let Phase::Running(run) = &self.phase else { return false };
        let is_free = run.is_changing_tool() && run.rest.is_none() && !run.is_held();
        is_free && self.context.machine.mode() == Mode::Idle && self.leaving.is_none()
    }

    /// Pauses the run that waits for its tool.
    pub(super) fn pause_run(&mut self) {
        match std::mem::replace(&mut self.phase, Phase::Ready) {
            Phase::Running(mut run) if run.is_changing_tool() => {
                run.touch();
                let (shift, frame) = (self.context.machine.whole_shift(), AxisSet::NONE);
                self.paused = Some(Paused { run, is_canceled: false, shift, frame });
            }
            phase => self.phase = phase,
        }
    }

    /// Goes on with the run that is paused, or ends it, when nothing else is under way.
    pub(super) fn settle_paused(&mut self) {
        if self.paused.is_none() {
            return;
        }
        let (code, reason) = match &self.phase {
            Phase::Ready => return self.return_to_run(),
            Phase::Closed { reason } => (error_code::LINK_LOST, reason.clone()),
            Phase::Adrift { reason } => (error_code::NO_ANSWER, reason.clone()),
            Phase::Manual(_) | Phase::Running(_) | Phase::Stopping(_) | Phase::Connecting(_) => {
                return;
            }
        };
        self.end_paused(code, &reason);
    }

    fn return_to_run(&mut self) {
        let Some(Paused { mut run, is_canceled, shift, frame }) = self.paused.take() else {
            return;
        };
        let machine = &mut self.context.machine;
        machine.program_id.clone_from(&run.job.request.program_id);
        machine.line = run.job.line();
        run.encoder.forget_frame(frame);
        run.encoder.take_board(machine.board());
        // Nobody sets further axes during a tool change.
        let now = machine.whole_shift();
        let has_moved =
            frame.is_empty() && now.position != shift.position || shift.is_further_other(&now);
        self.phase = Phase::Running(run);
        if is_canceled {
            return self.stop_run(RunVerdict::canceled("canceled while the tool was changed"));
        }
        if has_moved {
            let text = "a reset while the tool was changed has dropped G92: the work frame has \
                        moved; set it again, then start at the first line after the tool change";
            self.stop_run(RunVerdict::aborted(error_code::START_POSITION, text));
        }
    }

    /// Ends the run that is paused: it cannot go on after this.
    pub(super) fn end_paused(&mut self, error_code: u16, message: &str) {
        let Some(Paused { run, .. }) = self.paused.take() else { return };
        let job = &run.job;
        self.context.machine.program_id.clone_from(&job.request.program_id);
        self.context.machine.line = job.line();
        self.context.outputs.push_back(Output::RunFinished(RunResult {
            id: job.id,
            outcome: RunOutcome::Aborted,
            error_code,
            message: format!("{message} (while the tool was changed)"),
            last_line: job.line(),
            blamed_line: 0,
            last_occurrence: job.occurrence(),
        }));
    }

    /// Ends the run that is paused, if the manual operation ended with a refusal after which
    /// it cannot go on.
    pub(super) fn end_paused_with(&mut self, refusal: &Refusal) {
        let is_over = matches!(
            refusal.error_code,
            error_code::RESTARTED
                | error_code::SOFT_RESET
                | error_code::LINK_LOST
                | error_code::SHUTDOWN
                | error_code::NOT_ACTIVE
                | error_code::COMMANDER_LOST
        );
        if is_over || !matches!(self.phase, Phase::Ready) {
            self.end_paused(refusal.error_code, &refusal.message);
        }
    }

    /// Cancels the run that is paused; the manual operation is stopped first.
    pub(super) fn cancel_paused(&mut self, run: Option<u64>) -> Option<Answer> {
        let paused = self.paused.as_mut()?;
        if run.is_some_and(|run| run != paused.run.job.id) {
            return None;
        }
        paused.is_canceled = true;
        match &mut self.phase {
            Phase::Manual(operation) if operation.task.moves() => {
                let refusal = Refusal::new(error_code::CANCELED, "canceled");
                operation.stop(&mut self.context, refusal);
            }
            Phase::Running(_) => self.stop_run(RunVerdict::canceled("canceled")),
            _ => {}
        }
        Some(done("the manual operation and the run are being stopped"))
    }

    /// Takes what the recorder says of the run that is under way or paused.
    pub(super) fn on_recorder(&mut self, is_whole: bool, reason: &str) -> Answer {
        let context = &mut self.context;
        match (&mut self.paused, &mut self.phase) {
            (Some(paused), _) if !is_whole => {
                if let Some(reason) = miss_record(context, reason) {
                    paused.run.set_hold_reason(&reason);
                }
            }
            (_, Phase::Running(run)) => {
                let exit = run.on_recorder(context, is_whole, reason);
                self.leave_run(exit);
            }
            (_, Phase::Stopping(stopping)) if !is_whole && stopping.job.request.is_recorded() => {
                miss_record(context, reason);
            }
            _ => {}
        }
        Some(Ok("heard".into()))
    }

    /// The tool is in: goes on from where the run stopped, if the tool stands there.
    pub(super) fn confirm_tool_change(&mut self, objection: Option<String>) -> Answer {
        if self.paused.is_some() {
            let what = match &self.phase {
                Phase::Manual(operation) => operation.describe(),
                _ => "a block is under way".into(),
            };
            return refused(error_code::BUSY, format!("{what}: confirm when it has ended"));
        }
        match &mut self.phase {
            Phase::Running(run) => run.confirm_tool_change(&mut self.context, objection),
            _ => refused(error_code::NOTHING_TO_DO, NO_CHANGE),
        }
    }

    /// Describes the run that is paused in the state.
    pub(super) fn compose_paused(&self, state: &mut MachineState) {
        let Some(Paused { run, .. }) = &self.paused else { return };
        let Some(ToolChange { tool, source, .. }) = run.tool_change() else { return };
        state.tool_wanted = *tool;
        state.program_id.clone_from(&run.job.request.program_id);
        state.path_revision = run.job.request.revision;
        state.settled_elements = 0;
        state.line = run.job.line();
        let what = match &self.phase {
            Phase::Manual(operation) => operation.describe(),
            Phase::Running(_) | Phase::Stopping(_) => "a block is under way".into(),
            _ => "the controller is being reset".into(),
        };
        let line = run.job.line_of(*source);
        let text = format!("TOOL_CHANGE: put in T{tool} ({line}); {what}");
        match state.reason.is_empty() {
            true => state.reason = text,
            false => state.reason = format!("{}; {text}", state.reason),
        }
    }
}
