//! The phases of the driver.

use super::connect::Connecting;
use super::manual::ManualOperation;
use super::next::Next;
use super::run::ProgramRun;
use super::run::job::Job;
use super::stop::Stopping;
use std::time::Duration;

/// What the driver is doing. Each phase owns the state that is meaningful in it alone.
#[derive(Debug)]
pub(super) enum Phase {
    /// No port.
    Closed { reason: String },
    /// Identifying the controller on the port.
    Connecting(Connecting),
    /// Which lines the controller has still to answer is unknown: only a soft reset helps.
    Adrift { reason: String },
    /// Waits for commands.
    Ready,
    /// A manual operation is under way.
    Manual(Box<ManualOperation>),
    /// A run is under way.
    Running(Box<ProgramRun>),
    /// A run is being brought to a standstill.
    Stopping(Box<Stopping>),
}

impl Phase {
    /// The run that is under way or being stopped.
    pub(super) fn job(&self) -> Option<&Job> {
        match self {
            Self::Running(run) => Some(&run.job),
            Self::Stopping(stopping) => Some(&stopping.job),
            _ => None,
        }
    }

    /// The same, to be changed.
    pub(super) fn job_mut(&mut self) -> Option<&mut Job> {
        match self {
            Self::Running(run) => Some(&mut run.job),
            Self::Stopping(stopping) => Some(&mut stopping.job),
            _ => None,
        }
    }

    /// Whether a run is under way or being stopped.
    pub(super) fn is_run(&self) -> bool {
        self.job().is_some()
    }

    /// Whether a run or a manual operation is under way or being stopped.
    pub(super) fn is_at_work(&self) -> bool {
        self.is_run() || matches!(self, Self::Manual(_))
    }

    /// Whether the axes go to their switches.
    pub(super) fn is_homing(&self) -> bool {
        match self {
            Self::Running(run) => run.is_homing(),
            Self::Manual(operation) => operation.is_homing(),
            _ => false,
        }
    }

    /// Whether reports do not count yet: the controller is being reset or identified, or which
    /// lines it has still to answer is unknown.
    pub(super) fn is_unsettled(&self) -> bool {
        match self {
            Self::Stopping(stopping) => stopping.is_resetting(),
            Self::Running(_) | Self::Ready | Self::Manual(_) => false,
            Self::Closed { .. } | Self::Connecting(_) | Self::Adrift { .. } => true,
        }
    }

    /// Whether a path is being encoded for its errors, which goes on at once.
    pub(super) fn is_encoding(&self) -> bool {
        match self {
            Self::Running(run) => run.is_encoding() || run.is_judging() || run.rest.is_some(),
            _ => false,
        }
    }

    pub(super) fn deadline(&self) -> Option<Duration> {
        match self {
            Self::Connecting(connecting) => Some(connecting.until()),
            Self::Manual(operation) => operation.until(),
            Self::Running(run) => run.deadline(),
            Self::Stopping(stopping) => Some(stopping.until()),
            Self::Closed { .. } | Self::Adrift { .. } | Self::Ready => None,
        }
    }
}

impl From<Next> for Phase {
    fn from(next: Next) -> Self {
        match next {
            Next::Ready => Self::Ready,
            Next::Adrift { reason } => Self::Adrift { reason },
            Next::Closed { reason } => Self::Closed { reason },
        }
    }
}
