//! One step along a path, in the machine frame.

use cnc_msgs::contour::{Source, work_system};
use cnc_msgs::further::{FurtherAxes, FurtherMode};
use cnc_msgs::geometry::{Arc, AxisSet};

/// A coordinate of each axis, where it is known.
pub(crate) type Known = [Option<f64>; 3];

/// Why nobody knows where an axis is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Lost {
    /// No move has named it yet.
    Start,
    /// Where homing leaves it is not known.
    Homing,
    /// A probe ends where it touches.
    Probe,
    /// Where its work system lies is not known.
    Frame,
}

/// What is known of an axis whose place is not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Somewhere {
    pub(crate) lost: Lost,
    /// Least and greatest coordinate; `None`: anywhere in the machine.
    pub(crate) within: Option<[f64; 2]>,
}

impl Somewhere {
    pub(super) const fn of(lost: Lost) -> Self {
        Self { lost, within: None }
    }
}

/// One move of the axes, mm; positions are those of the axes, with the tool length in them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct MachineMove {
    pub(crate) from: Known,
    pub(crate) to: Known,
    /// The same of axes that are not known in `from`, and in `to`.
    pub(crate) somewhere: [[Somewhere; 3]; 2],
    /// Its centre is in the machine frame.
    pub(crate) arc: Option<Arc>,
    /// `None` for a rapid.
    pub(crate) feed_mm_per_min: Option<f64>,
    pub(crate) source: Source,
    pub(crate) frame: MoveFrame,
    /// The axes that this move gives.
    pub(crate) axes: AxisSet,
    /// What of Z is the tool length.
    pub(crate) tool_length_mm: f64,
    /// `None`: nobody has said which one is in the spindle. 0 is an empty one.
    pub(crate) tool: Option<u32>,
}

/// What a move is written in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum MoveFrame {
    /// A work system, 1 to 9, and what is added to its coordinates, mm.
    Work { system: u8, offset: Known },
    /// `G53`, `G28`, `G30`.
    Machine(&'static str),
}

impl MoveFrame {
    /// `G54`, `G53`.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Work { system, .. } => work_system(*system),
            Self::Machine(word) => (*word).to_owned(),
        }
    }
}

/// A move of A, B, C, U, V or W: along with the next move, or alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FurtherStep {
    pub(crate) mode: FurtherMode,
    /// In the machine frame, as far as it is known.
    pub(crate) from: FurtherAxes,
    pub(crate) to: FurtherAxes,
    /// As the program gives them, in this frame.
    pub(crate) named: FurtherAxes,
    pub(crate) frame: MoveFrame,
    pub(crate) source: Source,
}
