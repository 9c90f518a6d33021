//! What stays in force from block to block.

use crate::axes::{Axes, add};

/// Group 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Motion {
    /// G0.
    #[default]
    Rapid,
    /// G1.
    Line,
    /// G2.
    ArcClockwise,
    /// G3.
    ArcCounterclockwise,
    /// G38.2 to G38.5.
    Probe {
        /// G38.4, G38.5: until contact is lost.
        away: bool,
        /// G38.3, G38.5: a miss is no alarm.
        miss_is_fine: bool,
    },
    /// G33.
    Thread,
    /// G80.
    None,
}

impl Motion {
    /// Is a laser on along this motion?
    pub(crate) fn cuts(self) -> bool {
        matches!(self, Self::Line | Self::ArcClockwise | Self::ArcCounterclockwise)
    }
}

/// Group 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Plane {
    /// G17.
    #[default]
    Xy,
    /// G18.
    Zx,
    /// G19.
    Yz,
}

impl Plane {
    /// The two axes of the plane, in the order in which G3 turns, and the third.
    pub(crate) fn axes(self) -> (usize, usize, usize) {
        match self {
            Self::Xy => (0, 1, 2),
            Self::Zx => (2, 0, 1),
            Self::Yz => (1, 2, 0),
        }
    }
}

/// Group 3.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Distance {
    /// G90.
    #[default]
    Absolute,
    /// G91.
    Incremental,
}

/// Group 5.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum FeedMode {
    /// G94.
    #[default]
    UnitsPerMinute,
    /// G93.
    InverseTime,
}

/// Group 6.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Units {
    /// G21.
    #[default]
    Millimetres,
    /// G20.
    Inches,
}

/// M3, M4, M5.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Spindle {
    /// M5.
    #[default]
    Off,
    /// M3.
    Clockwise,
    /// M4.
    Counterclockwise,
}

/// M7, M8, M9.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Coolant {
    /// M8.
    pub(crate) flood: bool,
    /// M7.
    pub(crate) mist: bool,
}

/// The modal groups.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Modal {
    /// Group 1.
    pub(crate) motion: Motion,
    /// Group 2.
    pub(crate) plane: Plane,
    /// Group 3.
    pub(crate) distance: Distance,
    /// Group 5.
    pub(crate) feed_mode: FeedMode,
    /// Group 6.
    pub(crate) units: Units,
    /// Group 12: 0 for G54 to 5 for G59, then G59.1 and on.
    pub(crate) coordinate_system: usize,
    /// Group 7 of M.
    pub(crate) spindle: Spindle,
    /// Group 8 of M.
    pub(crate) coolant: Coolant,
}

/// Offsets that survive a reset.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct CoordinateSystems {
    /// G54 to G59 and G59.1 to G59.3, millimetres in machine coordinates.
    pub(crate) work: [Axes; 9],
    /// G28, millimetres in machine coordinates.
    pub(crate) g28: Axes,
    /// G30, millimetres in machine coordinates.
    pub(crate) g30: Axes,
}

/// What the parser remembers until a reset.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct ParserState {
    /// The modal groups.
    pub(crate) modal: Modal,
    /// F, mm/min; moves per minute in G93.
    pub(crate) feed: f64,
    /// S, rpm.
    pub(crate) spindle_rpm: f64,
    /// T.
    pub(crate) tool: u32,
    /// N of the last block that had one, else 0.
    pub(crate) line_number: u32,
    /// End of the last queued move, millimetres in machine coordinates.
    pub(crate) position_in_machine: Axes,
    /// G92, millimetres.
    pub(crate) g92: Axes,
    /// G43.1, millimetres along Z.
    pub(crate) tool_length: f64,
}

/// Returns the name of a coordinate system.
pub(crate) fn system_name(system: usize) -> String {
    match system {
        0..=5 => format!("G{}", 54 + system),
        _ => format!("G59.{}", system - 5),
    }
}

impl ParserState {
    /// Returns the sum of all offsets: machine = work + this.
    pub(crate) fn work_offset(&self, systems: &CoordinateSystems) -> Axes {
        let mut offset = add(systems.work[self.modal.coordinate_system], self.g92);
        offset[2] += self.tool_length;
        offset
    }
}
