//! Stops accepting commands: deactivate and shutdown.
//!
//! Both bring whatever is under way to a stop as a cancel does. Where the machine does
//! not come to a standstill the driver stays active, so that nobody takes it for done.

use super::command::{Answer, done, refused};
use super::config::STANDSTILL;
use super::{Driver, Output, Phase, Refusal, RunOutcome};
use crate::codes::error_code;
use std::time::Duration;

/// Why nothing begins.
pub(super) const NOT_ACTIVE: &str = "the driver is not active: activate it first";
/// The reason of a machine that would take orders, from a driver that gives none.
pub(super) const INACTIVE: &str = "INACTIVE: the driver begins nothing until it is activated";

/// Everything is being brought to a stop.
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
    /// For whom it stops.
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
            return refused(error_code::BUSY, "the driver is being stopped already");
        }
        self.is_active = false;
        self.leave(id, Wish::Deactivate);
        None
    }

    pub(super) fn shut_down(&mut self, id: u64) -> Answer {
        if self.is_shutting_down() {
            return refused(error_code::BUSY, "the driver is shutting down already");
        }
        if let Some(Leaving { id, .. }) = self.leaving.take() {
            let refusal = Wish::Shutdown.refusal("interrupted because");
            self.reply(id, Err(refusal));
        }
        self.leave(id, Wish::Shutdown);
        None
    }

    fn leave(&mut self, id: u64, wish: Wish) {
        if let Some(check) = self.check.take() {
            self.reply(check.id, Err(wish.refusal("interrupted because")));
        }
        match &self.phase {
            Phase::Running(_) => {
                let Refusal { error_code, message } = wish.refusal("stopped because");
                self.stop_run(RunOutcome::Aborted, error_code, message);
            }
            Phase::Manual(operation) => {
                let (is_homing, moves) = (operation.is_homing(), operation.task.moves());
                let refusal = wish.refusal("interrupted because");
                match (is_homing, moves) {
                    // Homing does not listen to a hold.
                    (true, _) => {
                        self.end_manual(Err(refusal), Phase::Ready);
                        self.begin_reset(None);
                    }
                    (_, true) => self.stop_move(refusal),
                    _ => self.end_manual(Err(refusal), Phase::Ready),
                }
            }
            Phase::Closed { .. } => {}
            _ if self.machine.is_moving() => self.send_hold(),
            _ => {}
        }
        if !matches!(self.phase, Phase::Running(_) | Phase::Manual(_)) {
            // The controller is being reset after a probe, and the run would come back.
            let Refusal { error_code, message } = wish.refusal("stopped because");
            self.end_paused(error_code, &message);
        }
        self.leaving = Some(Leaving { id, until: self.now + STANDSTILL * 2, wish });
    }

    /// Answers when nothing is under way any more, or it takes too long.
    pub(super) fn step_leaving(&mut self) {
        let Some(Leaving { id, until, wish }) = self.leaving else { return };
        let is_stopping = match &self.phase {
            Phase::Running(_) | Phase::Manual(_) => true,
            Phase::Connecting(connecting) => connecting.is_resetting(),
            _ => false,
        };
        let is_busy = is_stopping || (self.is_open() && self.machine.is_moving());
        if is_busy && self.now < until {
            return;
        }
        self.leaving = None;
        let text = match is_busy {
            true => "not stopped: motion may continue",
            false if self.machine.is_lost => "stopped, as far as is known: motion may continue",
            false => "stopped",
        };
        match wish {
            Wish::Shutdown => {
                self.reply(id, Ok(text.into()));
                self.outputs.push_back(Output::ReadyToClose);
            }
            Wish::Deactivate if is_busy => {
                self.is_active = true;
                self.reply(id, Err(Refusal::new(error_code::LINK_LOST, text)));
            }
            Wish::Deactivate => self.reply(id, Ok(text.into())),
        }
    }
}
