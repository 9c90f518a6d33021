//! How a run leaves its phase.

use crate::codes::error_code;
use crate::driver::answer::Refusal;
use crate::driver::next::Next;
use crate::driver::output::RunOutcome;

/// How a run ended, or will have ended when the machine stands.
#[derive(Debug, Clone)]
pub(in crate::driver) struct RunVerdict {
    pub(in crate::driver) outcome: RunOutcome,
    pub(in crate::driver) error_code: u16,
    pub(in crate::driver) message: String,
}

/// How a run leaves its phase.
#[derive(Debug)]
pub(in crate::driver) enum Exit {
    /// It is over.
    Over { verdict: RunVerdict, next: Next },
    /// The machine is brought to a standstill first.
    Stop(RunVerdict),
}

impl RunVerdict {
    pub(in crate::driver) fn aborted(error_code: u16, message: impl Into<String>) -> Self {
        Self { outcome: RunOutcome::Aborted, error_code, message: message.into() }
    }

    pub(in crate::driver) fn canceled(message: impl Into<String>) -> Self {
        let (outcome, error_code) = (RunOutcome::Canceled, error_code::CANCELED);
        Self { outcome, error_code, message: message.into() }
    }

    pub(in crate::driver) fn succeeded(message: impl Into<String>) -> Self {
        Self { outcome: RunOutcome::Succeeded, error_code: 0, message: message.into() }
    }

    /// Whether the reset is left to the operator: which lines the controller has still to
    /// answer, and what it did with those after a refused one, is unknown.
    pub(in crate::driver) fn needs_operator(&self) -> bool {
        matches!(
            self.error_code,
            error_code::CONTROLLER_ERROR
                | error_code::PROTOCOL
                | error_code::NO_ANSWER
                | error_code::RESTARTED
        )
    }

    pub(in crate::driver) fn refusal(&self) -> Refusal {
        Refusal::new(self.error_code, self.message.clone())
    }
}

impl From<Refusal> for RunVerdict {
    fn from(refusal: Refusal) -> Self {
        Self::aborted(refusal.error_code, refusal.message)
    }
}

impl Exit {
    /// Over, and the driver waits for commands.
    pub(in crate::driver) fn over(verdict: RunVerdict) -> Self {
        Self::Over { verdict, next: Next::Ready }
    }

    /// Stops the run as aborted.
    pub(in crate::driver) fn abort(error_code: u16, message: impl Into<String>) -> Self {
        Self::Stop(RunVerdict::aborted(error_code, message))
    }
}
