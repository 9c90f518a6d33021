//! Hold, door, resume, reset: what acts at once, in any state that listens.

use super::command::{Answer, done, refused};
use super::stop::HoldWatch;
use super::{Driver, Phase, Refusal, RunOutcome};
use crate::codes::error_code;
use crate::link::realtime;
use crate::report::ControllerState;

/// Why a resume is refused for the moment.
pub const STILL_STOPPING: &str = "the machine is still coming to a stop: try again";

impl Driver {
    pub(super) fn feed_hold(&mut self) -> Answer {
        if let Phase::Closed { reason } = &self.phase {
            return refused(error_code::NOT_CONNECTED, reason.clone());
        }
        self.send_hold();
        if let Phase::Running(run) = &mut self.phase {
            run.set_held(true);
        }
        let is_homing = match &self.phase {
            Phase::Running(run) => run.is_homing(),
            Phase::Manual(operation) => operation.is_homing(),
            _ => false,
        };
        if is_homing {
            let text = "the machine is homing and does not hold: only soft_reset stops it";
            return refused(error_code::BUSY, text);
        }
        done("feed hold was sent")
    }

    pub(super) fn door_hold(&mut self) -> Answer {
        if let Phase::Closed { reason } = &self.phase {
            return refused(error_code::NOT_CONNECTED, reason.clone());
        }
        self.link.send_realtime(realtime::SAFETY_DOOR);
        self.hold = Some(HoldWatch::door());
        if let Phase::Running(run) = &mut self.phase {
            run.set_held(true);
        }
        done("what an opened door does was sent: machine_state shows DOOR; resume goes on")
    }

    pub(super) fn resume(&mut self) -> Answer {
        if self.is_shutting_down() {
            return refused(error_code::SHUTDOWN, "the driver is shutting down");
        }
        let is_held = self.machine.is_held();
        if self.machine.is_state(&ControllerState::Hold) && !is_held {
            // The controller passes over a resume then.
            return refused(error_code::BUSY, STILL_STOPPING);
        }
        if let Some(refusal) = self.machine.door_obstacle() {
            return Some(Err(refusal));
        }
        if self.machine.is_state(&ControllerState::Tool)
            && let Phase::Running(run) = &mut self.phase
            && !run.is_stopping()
        {
            // A cycle start would say that the tool is in.
            let was_held = run.is_held();
            run.set_held(false);
            run.hold_reason = None;
            self.hold = None;
            let text = "the controller waits for a tool: confirm_tool_change goes on";
            return match was_held {
                true => done(
                    "the hold has ended; the controller waits for a tool: confirm_tool_change goes on",
                ),
                false => refused(error_code::NOTHING_TO_DO, text),
            };
        }
        match &mut self.phase {
            Phase::Ready | Phase::Manual(_) if is_held => {}
            Phase::Running(run) if run.is_stopping() => {
                return refused(error_code::BUSY, "the run is being stopped");
            }
            Phase::Running(run) if run.rest.is_some() => {
                let text = "the rest of the program is being checked: try again";
                return refused(error_code::BUSY, text);
            }
            Phase::Running(run) if is_held || run.is_held() => {
                run.set_held(false);
                run.hold_reason = None;
            }
            Phase::Running(run) if run.is_at_block_end() => {
                run.go_on();
                return done("the run goes on with the next block");
            }
            Phase::Running(run) if run.is_changing_tool() => {
                let text = "a tool is being changed: confirm_tool_change goes on";
                return refused(error_code::NOTHING_TO_DO, text);
            }
            Phase::Ready | Phase::Running(_) => {
                return refused(error_code::NOTHING_TO_DO, "the machine does not hold");
            }
            _ => return self.obstacle().map(Err),
        }
        self.hold = None;
        self.link.send_realtime(realtime::RESUME);
        done("resume was sent")
    }

    pub(super) fn soft_reset(&mut self, id: u64) -> Answer {
        if let Phase::Closed { reason } = &self.phase {
            return refused(error_code::NOT_CONNECTED, reason.clone());
        }
        self.machine.needs_acknowledgement = false;
        let interrupted = Refusal::new(error_code::SOFT_RESET, "interrupted by a soft reset");
        match &self.phase {
            Phase::Running(run) if run.is_proving() => {
                let Refusal { error_code, message } = interrupted;
                self.end_run(RunOutcome::Aborted, error_code, message, Phase::Ready);
            }
            Phase::Running(_) => {
                self.reset_run(id);
                return None;
            }
            Phase::Manual(_) => self.end_manual(Err(interrupted), Phase::Ready),
            Phase::Connecting(connecting) => {
                if let Some(id) = connecting.reply_to() {
                    self.reply(id, Err(interrupted.clone()));
                }
                self.end_paused(interrupted.error_code, &interrupted.message);
            }
            _ => {}
        }
        if self.machine.is_moving() {
            self.machine.is_homed = false;
        }
        self.begin_reset(Some(id));
        None
    }
}
