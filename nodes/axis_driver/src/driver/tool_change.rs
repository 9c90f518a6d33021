//! What is done by hand while a tool is changed, and the way back into the run.
//!
//! While M6 waits the tool is lifted, taken out, put in and touched off: jogs, probes, work
//! offsets and single blocks are taken, one at a time. The run stands aside meanwhile. It
//! goes on from the place in the machine frame where it stopped and with the words that
//! were in force there, and from nowhere else. What was set on purpose counts: a work
//! offset, and a tool length that a block has set.

use super::command::{Answer, RunRequest, done, refused};
use super::config::RETURN_TOLERANCE_MM;
use super::run::{Run, Stage, Then};
use super::run_progress::RECORD_NOT_WHOLE;
use super::{Driver, LogLevel, Output, Phase, Refusal, RunOutcome, RunResult};
use crate::codes::error_code;
use crate::link::realtime;
use crate::report::ControllerState;
use cnc_msgs::contour::Action;
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet, Position};
use cnc_msgs::machine::{MachineState, Mode};
use cnc_msgs::path::CompensatedPath;

/// A run that stands aside while something is done by hand.
#[derive(Debug)]
pub(super) struct Paused {
    pub(super) run: Box<Run>,
    /// It was canceled; it ends when what is done by hand has ended.
    is_canceled: bool,
    /// What G92 shifted by before.
    shift: Position,
    /// Axes of the work frame that are being set.
    pub(super) frame: AxisSet,
}

/// Where the tool change began.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ToolChange {
    pub(super) tool: u32,
    pub(super) source_line: u32,
    /// In the machine frame; `None` when it was not known.
    pub(super) stood_at: Option<Position>,
    /// Something was done by hand: the words in force are no longer certain.
    pub(super) is_touched: bool,
}

/// How the run gets back to where it stopped.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Way {
    There,
    /// The place, and where the tool is.
    Back(Position, Position),
}

impl Driver {
    /// Whether something may be done by hand now although a run is under way.
    pub(super) fn is_tool_awaited(&self) -> bool {
        let Phase::Running(run) = &self.phase else { return false };
        let is_free = run.is_changing_tool() && run.rest.is_none() && !run.is_held();
        is_free && self.machine.mode() == Mode::Idle && self.leaving.is_none()
    }

    /// The run that waits for its tool stands aside.
    pub(super) fn pause_run(&mut self) {
        if !matches!(&self.phase, Phase::Running(run) if run.is_changing_tool()) {
            return;
        }
        if let Phase::Running(mut run) = std::mem::replace(&mut self.phase, Phase::Ready) {
            if let Stage::ToolChange(change) = &mut run.stage {
                change.is_touched = true;
            }
            let (shift, frame) = (self.machine.shift(), AxisSet::NONE);
            self.paused = Some(Paused { run, is_canceled: false, shift, frame });
        }
    }

    /// Whether a block may be run while a tool is changed.
    pub(super) fn check_block(path: &CompensatedPath) -> Result<(), Refusal> {
        let is_out_of_place = |action: &Action| {
            matches!(
                action,
                Action::ChangeTool { .. }
                    | Action::ProgramEnd { .. }
                    | Action::Stop { .. }
                    | Action::Home { .. }
                    | Action::Auxiliary { .. }
            )
        };
        match path.events.iter().find(|event| is_out_of_place(&event.action)) {
            None => Ok(()),
            Some(event) => {
                let text = format!(
                    "{} is not possible while a tool is changed: confirm_tool_change or cancel first",
                    event.action.text()
                );
                Err(Refusal::new(error_code::BUSY, text))
            }
        }
    }

    /// Goes on with the run that stands aside, or ends it, when nothing else is under way.
    pub(super) fn settle_paused(&mut self) {
        let reason = match (&self.paused, &self.phase) {
            (None, _) | (_, Phase::Manual(_) | Phase::Running(_) | Phase::Connecting(_)) => return,
            (Some(_), Phase::Ready) => return self.return_to_run(),
            (Some(_), Phase::Closed { reason } | Phase::Adrift { reason }) => reason.clone(),
        };
        let code = match self.phase {
            Phase::Closed { .. } => error_code::LINK_LOST,
            _ => error_code::NO_ANSWER,
        };
        self.end_paused(code, &reason);
    }

    fn return_to_run(&mut self) {
        let Some(Paused { mut run, is_canceled, shift, frame }) = self.paused.take() else {
            return;
        };
        self.machine.program_id.clone_from(&run.request.program_id);
        self.machine.line = run.line();
        run.encoder.forget_frame(frame);
        run.encoder.take_board(self.machine.board());
        self.phase = Phase::Running(run);
        if is_canceled {
            let (outcome, code) = (RunOutcome::Canceled, error_code::CANCELED);
            return self.stop_run(outcome, code, "canceled while the tool was changed".into());
        }
        if frame.is_empty() && self.machine.shift() != shift {
            let text = "a reset while the tool was changed has dropped G92: the work frame has \
                        moved; set it again, then start at the first line after the tool change";
            self.stop_run(RunOutcome::Aborted, error_code::START_POSITION, text.into());
        }
    }

    /// Ends the run that stands aside: it cannot go on after this.
    pub(super) fn end_paused(&mut self, error_code: u16, message: &str) {
        let Some(Paused { run, .. }) = self.paused.take() else { return };
        self.machine.program_id.clone_from(&run.request.program_id);
        self.machine.line = run.line();
        self.outputs.push_back(Output::RunFinished(RunResult {
            id: run.id,
            outcome: RunOutcome::Aborted,
            error_code,
            message: format!("{message} (while the tool was changed)"),
            last_line: run.line(),
            blamed_line: 0,
        }));
    }

    /// What is done by hand has ended: whether the run that stands aside ends with it.
    pub(super) fn end_paused_with(&mut self, refusal: Option<(u16, &str)>) {
        let Some((code, message)) = refusal else { return };
        let is_over = matches!(
            code,
            error_code::RESTARTED
                | error_code::SOFT_RESET
                | error_code::LINK_LOST
                | error_code::SHUTDOWN
                | error_code::NOT_ACTIVE
                | error_code::COMMANDER_LOST
        );
        if is_over || !matches!(self.phase, Phase::Ready) {
            self.end_paused(code, message);
        }
    }

    /// Cancels the run that stands aside; what is done by hand is stopped first.
    pub(super) fn cancel_paused(&mut self, run: Option<u64>) -> Option<Answer> {
        let paused = self.paused.as_mut()?;
        if run.is_some_and(|run| run != paused.run.id()) {
            return None;
        }
        paused.is_canceled = true;
        let refusal = Refusal::new(error_code::CANCELED, "canceled");
        match &self.phase {
            Phase::Manual(operation) if operation.task.moves() => self.stop_move(refusal),
            Phase::Running(_) => {
                self.stop_run(RunOutcome::Canceled, refusal.error_code, refusal.message);
            }
            _ => {}
        }
        Some(done("what is done by hand and the run are being stopped"))
    }

    /// The record of the run that stands aside misses something: where it is required, the
    /// run waits for a resume too.
    pub(super) fn miss_record_of_paused(&mut self, reason: &str) {
        let Some(paused) = &mut self.paused else { return };
        let text = format!("the record of this run is not whole: {reason}");
        if self.config.require_recording {
            paused.run.set_held(true);
            paused.run.hold_reason = Some(format!("{RECORD_NOT_WHOLE}: {text}; resume goes on"));
        }
        self.log(LogLevel::Warn, text);
    }

    /// Describes the run that stands aside in the state.
    pub(super) fn compose_paused(&self, state: &mut MachineState) {
        let Some(Paused { run, .. }) = &self.paused else { return };
        let Stage::ToolChange(ToolChange { tool, source_line, .. }) = run.stage else { return };
        state.tool_wanted = tool;
        state.program_id.clone_from(&run.request.program_id);
        state.path_revision = run.request.revision;
        state.settled_elements = 0;
        state.line = run.line();
        let what = match &self.phase {
            Phase::Manual(operation) => operation.describe(),
            Phase::Running(_) => "a block is under way".into(),
            _ => "the controller is being reset".into(),
        };
        let text = format!("TOOL_CHANGE: put in T{tool} (line {source_line}); {what}");
        match state.reason.is_empty() {
            true => state.reason = text,
            false => state.reason = format!("{}; {text}", state.reason),
        }
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
        let (mode, at) = (self.machine.mode(), self.machine.machine_position());
        let returns = self.config.tool_change_return;
        let Phase::Running(run) = &mut self.phase else {
            return refused(error_code::NOTHING_TO_DO, "no tool change was asked for");
        };
        let change = match &run.stage {
            Stage::ToolChange(change) => *change,
            Stage::Draining(Then::ControllerChange { .. }) => {
                if !self.machine.is_state(&ControllerState::Tool) {
                    let text = "the controller does not wait for a tool";
                    return refused(error_code::NOTHING_TO_DO, text);
                }
                if run.is_held() {
                    return refused(error_code::BUSY, "the run is held: resume first");
                }
                if let Some(objection) = objection {
                    return refused(error_code::TOOL, objection);
                }
                self.link.send_realtime(realtime::RESUME);
                return done("cycle start was sent: the controller finishes the tool change");
            }
            _ => return refused(error_code::NOTHING_TO_DO, "no tool change was asked for"),
        };
        if mode != Mode::Idle || run.is_held() {
            let text = format!("the machine is in {}: resume first", mode.name());
            return refused(error_code::BUSY, text);
        }
        if run.rest.is_some() {
            let text = "the rest of the program is being checked: try again";
            return refused(error_code::BUSY, text);
        }
        if let Some(objection) = objection {
            return refused(error_code::TOOL, objection);
        }
        let way = match way_back(change, at) {
            Ok(Way::Back(stood, at)) if !returns => {
                let text = format!(
                    "the run stopped at {} in the machine frame and the tool is at {}: jog it there \
                     in the machine frame and confirm again, or set tool_change_return",
                    show(stood),
                    show(at)
                );
                return refused(error_code::START_POSITION, text);
            }
            Ok(way) => way,
            Err(refusal) => return Some(Err(refusal)),
        };
        let pushed = match way {
            Way::There if !change.is_touched => Ok(()),
            Way::There => run.encoder.go_on_after_change(None),
            Way::Back(stood, at) => run.encoder.go_on_after_change(Some((stood, at))),
        };
        if let Err(problem) = pushed {
            return refused(error_code::NOT_ENCODABLE, problem.to_string());
        }
        run.go_on();
        done(match way {
            Way::There => "the run goes on",
            Way::Back(..) => "the tool goes back to where the run stopped, and the run goes on",
        })
    }

    /// After the way back: whether it ended where the run stopped.
    pub(super) fn check_return(&mut self, stood: Position) {
        let at = self.machine.machine_position();
        let is_there = at.is_some_and(|at| is_at(at, stood));
        let Phase::Running(run) = &mut self.phase else { return };
        if is_there {
            return run.go_on();
        }
        let at = at.map_or_else(|| "a place that is not known".into(), show);
        let text = format!(
            "the way back after the tool change ended at {at} and not at {} in the machine frame",
            show(stood)
        );
        self.end_run(RunOutcome::Aborted, error_code::START_POSITION, text, Phase::Ready);
    }
}

impl RunRequest {
    /// Whether it is a block by hand.
    pub(super) fn is_by_hand(&self) -> bool {
        !self.is_recorded()
    }
}

fn is_at(at: Position, stood: Position) -> bool {
    (0..3).all(|axis| (at[axis] - stood[axis]).abs() <= RETURN_TOLERANCE_MM)
}

fn way_back(change: ToolChange, at: Option<Position>) -> Result<Way, Refusal> {
    match (change.stood_at, at) {
        (Some(stood), Some(at)) if is_at(at, stood) => Ok(Way::There),
        (Some(stood), Some(at)) => Ok(Way::Back(stood, at)),
        // Nobody can have moved it by this driver, which needs the position too.
        _ if !change.is_touched => Ok(Way::There),
        _ => {
            let text = "where the tool is is not known, so neither is whether it stands where the \
                        run stopped: cancel, and start at the first line after the tool change";
            Err(Refusal::new(error_code::START_POSITION, text))
        }
    }
}

/// `X10.000 Y0.000 Z-5.000`
fn show(place: Position) -> String {
    let words = (0..3).map(|axis| format!("{}{:.3}", AXIS_LETTERS[axis], place[axis]));
    words.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_run_goes_on_where_it_stopped_and_a_position_that_is_not_known_is_not_there() {
        let change =
            |stood_at, is_touched| ToolChange { tool: 2, source_line: 5, stood_at, is_touched };
        let place = [10.0, -20.0, 5.0];
        let lifted = [10.0, -20.0, 25.0];
        for (change, at, wanted) in [
            (change(Some(place), true), Some([10.01, -20.0, 5.0]), Some(Way::There)),
            (change(Some(place), true), Some(lifted), Some(Way::Back(place, lifted))),
            // A hand wheel that the controller has of its own.
            (change(Some(place), false), Some(lifted), Some(Way::Back(place, lifted))),
            (change(None, false), None, Some(Way::There)),
            (change(Some(place), true), None, None),
            (change(None, true), Some(place), None),
        ] {
            assert_eq!(way_back(change, at).ok(), wanted, "{change:?} {at:?}");
        }
    }
}
