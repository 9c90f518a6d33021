//! Stops accepting commands: deactivate and shutdown.
//!
//! Both bring whatever is under way to a stop as a cancel does. If the machine does not
//! come to a standstill, a deactivate fails and the driver stays active.

use super::answer::{Answer, Refusal, done, refused};
use super::context::config::STANDSTILL;
use super::manual::ManualEnd;
use super::next::Next;
use super::{Driver, Output, Phase};
use crate::codes::error_code;
use std::time::Duration;

/// Why nothing begins.
pub(super) const NOT_ACTIVE: &str = "the driver is not active: activate it first";
/// The reason in the state of an idle machine whose driver is not active.
pub(super) const INACTIVE: &str = "INACTIVE: the driver begins nothing until it is activated";

/// Owns the wish to stop everything: whose it is, and how long it may take.
#[derive(Debug)]
pub(super) struct Leaving {
    id: u64,
    pub(super) until: Duration,
    wish: Wish,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wish {
    Deactivate,
    Shutdown,
}

impl Wish {
    /// The refusal for a command that it interrupts.
    fn refusal(self, text: &str) -> Refusal {
        match self {
            Self::Deactivate => {
                Refusal::new(error_code::NOT_ACTIVE, format!("{text} the driver was deactivated"))
            }
            Self::Shutdown => {
                Refusal::new(error_code::SHUTDOWN, format!("{text} the driver shuts down"))
            }
        }
    }
}

impl Driver {
    pub(super) fn is_shutting_down(&self) -> bool {
        self.leaving.as_ref().is_some_and(|leaving| leaving.wish == Wish::Shutdown)
    }

    pub(super) fn activate(&mut self) -> Answer {
        match &self.leaving {
            Some(Leaving { wish: Wish::Shutdown, .. }) => {
                refused(error_code::SHUTDOWN, "the driver is shutting down")
            }
            Some(_) => refused(error_code::BUSY, "the driver is being deactivated"),
            None => {
                self.is_active = true;
                done("active")
            }
        }
    }

    pub(super) fn deactivate(&mut self, id: u64) -> Answer {
        if self.leaving.is_some() {
            return refused(error_code::BUSY, "the driver is already being stopped");
        }
        self.is_active = false;
        self.leave(id, Wish::Deactivate);
        None
    }

    pub(super) fn shut_down(&mut self, id: u64) -> Answer {
        if self.is_shutting_down() {
            return refused(error_code::BUSY, "the driver is already shutting down");
        }
        if let Some(Leaving { id, .. }) = self.leaving.take() {
            let refusal = Wish::Shutdown.refusal("interrupted because");
            self.context.reply(id, Err(refusal));
        }
        self.leave(id, Wish::Shutdown);
        None
    }

    fn leave(&mut self, id: u64, wish: Wish) {
        if let Some(check) = self.check.take() {
            self.context.reply(check.id, Err(wish.refusal("interrupted because")));
        }
        match &mut self.phase {
            Phase::Running(_) => self.stop_run(wish.refusal("stopped because").into()),
            Phase::Manual(operation) => {
                let refusal = wish.refusal("interrupted because");
                if operation.is_homing() {
                    // Homing does not react to a hold.
                    self.end_manual(ManualEnd::refused(refusal, Next::Ready).with_reset());
                } else if operation.task.moves() {
                    operation.stop(&mut self.context, refusal);
                } else {
                    self.end_manual(ManualEnd::refused(refusal, Next::Ready));
                }
            }
            Phase::Closed { .. } | Phase::Stopping(_) => {}
            Phase::Connecting(_) | Phase::Adrift { .. } | Phase::Ready => {
                if self.context.machine.is_moving() {
                    self.context.send_hold();
                }
            }
        }
        if !self.phase.is_at_work() {
            // The controller is being reset after a probe, and the run would come back.
            let Refusal { error_code, message } = wish.refusal("stopped because");
            self.end_paused(error_code, &message);
        }
        self.leaving = Some(Leaving { id, until: self.context.now + STANDSTILL * 2, wish });
    }

    /// Answers when nothing is under way any more, or it takes too long.
    pub(super) fn step_leaving(&mut self) {
        let Some(Leaving { id, until, wish }) = self.leaving else { return };
        let is_stopping = match &self.phase {
            Phase::Running(_) | Phase::Stopping(_) | Phase::Manual(_) => true,
            Phase::Connecting(connecting) => connecting.is_resetting(),
            _ => false,
        };
        let is_busy = is_stopping || (self.is_open() && self.context.machine.is_moving());
        if is_busy && self.context.now < until {
            return;
        }
        self.leaving = None;
        let text = match is_busy {
            true => "not stopped: motion may continue",
            false if self.context.machine.is_lost => {
                "stopped, as far as is known: motion may continue"
            }
            false => "stopped",
        };
        match wish {
            Wish::Shutdown => {
                self.context.reply(id, Ok(text.into()));
                self.context.outputs.push_back(Output::ReadyToClose);
            }
            Wish::Deactivate if is_busy => {
                self.is_active = true;
                self.context.reply(id, Err(Refusal::new(error_code::LINK_LOST, text)));
            }
            Wish::Deactivate => self.context.reply(id, Ok(text.into())),
        }
    }
}
