//! Hold, door, resume, reset: what acts at once, in every phase with a port.

use super::answer::{Answer, Refusal, done, refused};
use super::manual::ManualEnd;
use super::next::Next;
use super::{Driver, Phase};
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
        self.context.send_hold();
        if let Phase::Running(run) = &mut self.phase {
            run.set_held();
        }
        if self.phase.is_homing() {
            let text = "the machine is homing and does not hold: only soft_reset stops it";
            return refused(error_code::BUSY, text);
        }
        done("feed hold was sent")
    }

    pub(super) fn door_hold(&mut self) -> Answer {
        if let Phase::Closed { reason } = &self.phase {
            return refused(error_code::NOT_CONNECTED, reason.clone());
        }
        self.context.send_door_hold();
        if let Phase::Running(run) = &mut self.phase {
            run.set_held();
        }
        done("door hold was sent: machine_state shows DOOR; resume to go on")
    }

    pub(super) fn resume(&mut self) -> Answer {
        if self.is_shutting_down() {
            return refused(error_code::SHUTDOWN, "the driver is shutting down");
        }
        let is_held = self.context.machine.is_held();
        if self.context.machine.is_state(&ControllerState::Hold) && !is_held {
            // The controller passes over a resume then.
            return refused(error_code::BUSY, STILL_STOPPING);
        }
        if let Some(refusal) = self.context.machine.door_obstacle() {
            return Some(Err(refusal));
        }
        if self.context.machine.is_state(&ControllerState::Tool)
            && let Phase::Running(run) = &mut self.phase
        {
            // A cycle start would say that the tool is in.
            let was_held = run.is_held();
            run.release();
            self.context.hold = None;
            let text = "the controller waits for a tool: confirm_tool_change to go on";
            return match was_held {
                true => done(
                    "the hold has ended; the controller waits for a tool: confirm_tool_change to \
                     go on",
                ),
                false => refused(error_code::NOTHING_TO_DO, text),
            };
        }
        match &mut self.phase {
            Phase::Ready | Phase::Manual(_) if is_held => {}
            Phase::Stopping(_) => {
                return refused(error_code::BUSY, "the run is being stopped");
            }
            Phase::Running(run) if run.rest.is_some() => {
                let text = "the rest of the program is being checked: try again";
                return refused(error_code::BUSY, text);
            }
            Phase::Running(run) if is_held || run.is_held() => run.release(),
            Phase::Running(run) if run.is_at_block_end() => {
                run.go_on();
                return done("the run goes on with the next block");
            }
            Phase::Running(run) if run.is_changing_tool() => {
                let text = "a tool is being changed: confirm_tool_change to go on";
                return refused(error_code::NOTHING_TO_DO, text);
            }
            Phase::Ready | Phase::Running(_) => {
                return refused(error_code::NOTHING_TO_DO, "the machine is not in a hold");
            }
            _ => return self.obstacle().map(Err),
        }
        self.context.hold = None;
        self.context.link.send_realtime(realtime::RESUME);
        done("resume was sent")
    }

    pub(super) fn soft_reset(&mut self, id: u64) -> Answer {
        if let Phase::Closed { reason } = &self.phase {
            return refused(error_code::NOT_CONNECTED, reason.clone());
        }
        self.context.machine.needs_acknowledgement = false;
        let interrupted = Refusal::new(error_code::SOFT_RESET, "interrupted by a soft reset");
        match &self.phase {
            Phase::Running(run) if run.is_proving() => {
                self.end_run(interrupted.into(), Next::Ready);
            }
            Phase::Running(_) | Phase::Stopping(_) => {
                self.reset_run(id);
                return None;
            }
            Phase::Manual(_) => self.end_manual(ManualEnd::refused(interrupted, Next::Ready)),
            Phase::Connecting(connecting) => {
                if let Some(id) = connecting.reply_to() {
                    self.context.reply(id, Err(interrupted.clone()));
                }
                self.end_paused(interrupted.error_code, &interrupted.message);
            }
            Phase::Closed { .. } | Phase::Adrift { .. } | Phase::Ready => {}
        }
        if self.context.machine.is_moving() {
            self.context.machine.is_homed = false;
        }
        self.begin_reset(Some(id));
        None
    }
}
