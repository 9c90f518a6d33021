//! The position of the tool, and which of its axes are known.
//!
//! An axis is known once an absolute straight move has named it. After a move in machine
//! coordinates or to a reference position, or a change of offset, it is unknown until it is named
//! again. It can be moved from wherever it is by so much (G91), until a tool change may leave it
//! elsewhere.

use super::tool_lengths::Length;
use cnc_msgs::contour::Source;
use cnc_msgs::geometry::{AxisSet, Position};

/// Why an axis is not known.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Cause {
    pub(super) source: Source,
    /// `G28`.
    pub(super) word: &'static str,
}

#[derive(Debug, Clone)]
pub(super) struct Axes {
    /// mm in the work frame; the last known value of an axis that is not known.
    pub(super) position: Position,
    /// In a rotated work system these sets are still about the axes of the machine: who relies on X there
    /// relies on both.
    unknown: AxisSet,
    /// Of the unknown ones, those that can be moved by so much from wherever they are.
    movable: AxisSet,
    /// Of these, those that stand where a probe has ended, or by so much from there.
    drifting: AxisSet,
    /// Those that stand where a probe has ended without a touch, or by so much from there.
    missed: AxisSet,
    poisoned: AxisSet,
    /// Axes that no move has named since the start.
    unnamed: AxisSet,
    causes: [Cause; 3],
    /// Of a Z that is not known because the tool length has changed: the length that `position` counts with.
    counted_with: Option<Option<Length>>,
}

/// Whether a motion may rely on the position of some axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reliance {
    Known,
    /// Yes; these axes still have their start value.
    Assumed(AxisSet),
    /// No, because of an error that has been reported.
    Poisoned,
    /// No; these axes are not known.
    Unknown(AxisSet),
}

impl Axes {
    pub(super) fn new(start: Position) -> Self {
        Self {
            position: start,
            unknown: AxisSet::NONE,
            movable: AxisSet::NONE,
            drifting: AxisSet::NONE,
            missed: AxisSet::NONE,
            poisoned: AxisSet::NONE,
            unnamed: AxisSet::ALL,
            causes: [Cause::default(); 3],
            counted_with: None,
        }
    }

    #[inline]
    pub(super) fn rely_on(&self, axes: AxisSet) -> Reliance {
        let doubtful = self.doubtful();
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

    /// Marks axes as known: an absolute move named them, or their start value is relied on.
    #[inline]
    pub(super) fn know(&mut self, axes: AxisSet) {
        self.unknown = self.unknown.without(axes);
        self.missed = self.missed.without(axes);
        self.poisoned = self.poisoned.without(axes);
        self.unnamed = self.unnamed.without(axes);
    }

    /// Marks axes as unknown: their position in the work frame has changed.
    pub(super) fn lose(&mut self, axes: AxisSet, cause: Cause) {
        self.unknown = self.unknown.union(axes);
        self.movable = self.movable.union(axes);
        self.drifting = self.drifting.without(axes);
        self.missed = self.missed.without(axes);
        self.unnamed = self.unnamed.without(axes);
        for axis in (0..3).filter(|&axis| axes.contains(axis)) {
            self.causes[axis] = cause;
        }
        if axes.contains(2) {
            self.counted_with = None;
        }
    }

    /// Marks Z as unknown because another tool length is in force.
    pub(super) fn lose_by_length(&mut self, before: Option<Length>, cause: Cause) {
        const Z: AxisSet = AxisSet::NONE.with(2);
        let counted_with = match self.rely_on(Z) {
            Reliance::Known => Some(before),
            // Since one before, if by that.
            Reliance::Unknown(_) => self.counted_with,
            _ => None,
        };
        self.lose(Z, cause);
        self.counted_with = counted_with;
    }

    /// The tool length that the last known place of Z counts with, where no more than the length has changed.
    pub(super) fn counted_with(&self) -> Option<Option<Length>> {
        self.counted_with
    }

    /// Marks axes as unknown because a probe ends wherever it touches.
    pub(super) fn drift(&mut self, axes: AxisSet, cause: Cause) {
        self.lose(axes, cause);
        self.drifting = self.drifting.union(axes);
    }

    /// The probe that these axes have moved in has ended without a touch.
    pub(super) fn miss(&mut self, axes: AxisSet) {
        self.missed = self.missed.union(axes);
    }

    /// Those of some axes that stand where a probe has ended without a touch, or by so much from there.
    pub(super) fn missed(&self, axes: AxisSet) -> AxisSet {
        AxisSet::from_bits(axes.bits() & self.missed.bits())
    }

    /// What happens now may leave them elsewhere, or in another frame: no axis can be moved by so much.
    pub(super) fn end_drift(&mut self, cause: Cause) {
        self.lose(self.drifting(AxisSet::ALL), cause);
        self.movable = AxisSet::NONE;
    }

    /// Those of some axes that can be moved by so much, wherever they are.
    pub(super) fn movable(&self, axes: AxisSet) -> AxisSet {
        let movable = axes.bits() & self.unknown.bits() & self.movable.bits();
        AxisSet::from_bits(movable).without(self.poisoned)
    }

    /// Those of some axes that stand where a probe has ended, or by so much from there.
    pub(super) fn drifting(&self, axes: AxisSet) -> AxisSet {
        AxisSet::from_bits(axes.bits() & self.unknown.bits() & self.drifting.bits())
    }

    /// Whether an axis stands where a probe has ended, or by so much from there.
    pub(super) fn is_drifting(&self, axis: usize) -> bool {
        !self.drifting(AxisSet::NONE.with(axis)).is_empty()
    }

    /// Marks axes as unknown because of an error that has been reported.
    pub(super) fn poison(&mut self, axes: AxisSet) {
        self.poisoned = self.poisoned.union(axes);
    }

    /// Axes whose position may be another than `position` says.
    pub(super) fn doubtful(&self) -> AxisSet {
        self.unknown.union(self.poisoned).union(self.unnamed)
    }

    pub(super) fn cause(&self, axis: usize) -> Cause {
        self.causes[axis]
    }
}
