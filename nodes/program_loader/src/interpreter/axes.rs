//! Where the tool is, and which axes of that are really known.
//!
//! Knows nothing of blocks. An axis is known once an absolute straight move
//! has named it; after a move in machine coordinates, to a reference position,
//! or a change of offset it is not, until it is named again.

use cnc_msgs::contour::Source;
use cnc_msgs::geometry::{AxisSet, Position};

/// Why an axis is not known.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Cause {
    pub(super) source: Source,
    /// `G28`.
    pub(super) word: &'static str,
}

#[derive(Debug)]
pub(super) struct Axes {
    /// mm in the work frame; the last known value where an axis is not known.
    pub(super) position: Position,
    unknown: AxisSet,
    poisoned: AxisSet,
    /// Never named since the start.
    unnamed: AxisSet,
    causes: [Cause; 3],
}

/// Whether a motion may rely on where some axes are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reliance {
    Known,
    /// These still have their value of the start.
    Assumed(AxisSet),
    /// Not known because of an error that has been reported.
    Poisoned,
    /// These are not known.
    Unknown(AxisSet),
}

impl Axes {
    pub(super) fn new(start: Position) -> Self {
        Self {
            position: start,
            unknown: AxisSet::NONE,
            poisoned: AxisSet::NONE,
            unnamed: AxisSet::ALL,
            causes: [Cause::default(); 3],
        }
    }

    #[inline]
    pub(super) fn rely_on(&self, axes: AxisSet) -> Reliance {
        let doubtful = self.unknown.union(self.poisoned).union(self.unnamed);
        if (axes.bits() & doubtful.bits()) == 0 {
            return Reliance::Known;
        }
        let among = |set: AxisSet| AxisSet::from_bits(axes.bits() & set.bits());
        if !among(self.poisoned).is_empty() {
            Reliance::Poisoned
        } else if !among(self.unknown).is_empty() {
            Reliance::Unknown(among(self.unknown))
        } else {
            Reliance::Assumed(among(self.unnamed))
        }
    }

    /// Some axes are named by an absolute move, or their start value is relied on.
    #[inline]
    pub(super) fn know(&mut self, axes: AxisSet) {
        self.unknown = self.unknown.without(axes);
        self.poisoned = self.poisoned.without(axes);
        self.unnamed = self.unnamed.without(axes);
    }

    /// Some axes are elsewhere in the work frame.
    pub(super) fn lose(&mut self, axes: AxisSet, cause: Cause) {
        self.unknown = self.unknown.union(axes);
        self.unnamed = self.unnamed.without(axes);
        for axis in (0..3).filter(|&axis| axes.contains(axis)) {
            self.causes[axis] = cause;
        }
    }

    /// An error has been reported that leaves some axes unknown.
    pub(super) fn poison(&mut self, axes: AxisSet) {
        self.poisoned = self.poisoned.union(axes);
    }

    pub(super) fn cause(&self, axis: usize) -> Cause {
        self.causes[axis]
    }
}
