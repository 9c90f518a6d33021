//! A, B, C, U, V and W: where a block takes them, with its motion or alone.
//!
//! A, B and C count in degrees in both units, U, V and W in lengths. F is along X, Y and Z where
//! one of them moves, else along U, V and W, else degrees a minute (LinuxCNC). An axis is known
//! once a block has named it absolutely: what relies on it before is refused, because only the
//! machine knows where it is.

use super::axes::Cause;
use super::{Interpreter, Scene};
use crate::dialect::{Distance, FeedMode, Letters, Mode};
use crate::limits::{COORDINATE_MM_MAX, FEED_MM_PER_MIN_MAX};
use cnc_msgs::contour::{Action, MotionClass};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes, FurtherMode, FurtherMove, further_distance};

/// The words of these axes, in the order of their letters.
pub(super) const FURTHER_WORDS: [u8; 6] = *b"ABCUVW";

/// A move of no length under G93 has this rate, degrees/min or mm/min: it must not be 0.
const RATE_MIN: f64 = 0.1;

/// Where the further axes are, in the work frame.
#[derive(Debug, Clone, Default)]
pub(super) struct Further {
    /// Those that are known.
    position: FurtherAxes,
    /// Those that are not known because of an error that has been reported, as bits.
    poisoned: u8,
    /// Since when the others are not known.
    causes: [Option<Cause>; FURTHER_WORDS.len()],
    /// The zero of the program in the work system (G52, G92), and what G92.3 restores.
    pub(super) shift: FurtherAxes,
    pub(super) kept_shift: FurtherAxes,
    /// Where the block takes them together with its motion.
    along: FurtherAxes,
}

impl Further {
    /// The place of an axis as the program would write it; `None` where it is not known.
    pub(super) fn programmed(&self, axis: usize) -> Option<f64> {
        Some(self.position.get(axis)? - self.shift.get(axis).unwrap_or(0.0))
    }

    /// Whether a block of the program has named any of the axes.
    pub(super) fn is_used(&self) -> bool {
        !self.position.is_empty() || self.causes.iter().any(Option::is_some) || self.poisoned != 0
    }

    pub(super) fn poison(&mut self, axes: FurtherAxes) {
        self.poisoned |= axes.bits();
        self.position = axes.iter().fold(self.position, |all, (axis, _)| all.without(axis));
    }

    /// Axes that were known are unknown: a line that may have moved them was not read.
    pub(super) fn poison_known(&mut self) {
        self.poison(self.position);
    }

    /// These axes are somewhere else, or in another frame.
    pub(super) fn lose(&mut self, axes: FurtherAxes, cause: Cause) {
        for (axis, _) in axes.iter() {
            self.position = self.position.without(axis);
            self.causes[axis] = Some(cause);
        }
    }

    /// All axes that the program has moved are in another frame.
    pub(super) fn lose_known(&mut self, cause: Cause) {
        self.lose(self.position, cause);
    }

    pub(super) fn arrive(&mut self, end: FurtherAxes) {
        self.position = end.or(self.position);
        self.poisoned &= !end.bits();
    }
}

impl Interpreter<'_> {
    /// Whether the block has words of further axes.
    #[inline]
    pub(super) fn has_further(&self) -> bool {
        const ALL: Letters = Letters::of(&FURTHER_WORDS);
        let letters = self.rules.dialect.further_axes.intersection(ALL);
        !self.request.present.intersection(letters).is_empty()
    }

    /// Forgets what an earlier block wanted.
    #[inline]
    pub(super) fn begin_further(&mut self) {
        self.further.along = FurtherAxes::NONE;
    }

    /// Takes the words as they are written: degrees, and lengths in mm.
    pub(super) fn further_values(&mut self, scene: &mut Scene<'_>) -> FurtherAxes {
        let mut values = FurtherAxes::NONE;
        if !self.has_further() {
            return values;
        }
        for (axis, letter) in FURTHER_WORDS.into_iter().enumerate() {
            let (scale, unit) = match FurtherAxes::is_rotary(axis) {
                true => (1.0, "degrees"),
                false => (self.scale(), "mm"),
            };
            if let Some(value) = self.take_within(scene, letter, scale, COORDINATE_MM_MAX, unit) {
                values = values.with(axis, value);
            }
        }
        values
    }

    /// The further axes of a block with a motion word in force. Those that move with X, Y and Z
    /// wait for that motion; others move now. Returns whether the block goes on.
    #[cold]
    pub(super) fn further_motion(&mut self, scene: &mut Scene<'_>, has_motion: bool) -> bool {
        let from = self.further.position;
        let end = self.further_end(scene);
        self.further.arrive(end);
        if self.request.is_damaged || self.modal.mode_is_poisoned {
            self.request.is_damaged = true;
            return has_motion;
        }
        let letters = end.letters();
        let stays = end.iter().all(|(axis, value)| from.get(axis) == Some(value));
        match self.modal.mode {
            // Posts for three axes write A0 into each block.
            Some(
                Mode::Rapid | Mode::Feed | Mode::Arc { .. } | Mode::Thread | Mode::ThreadCycle,
            ) if has_motion && stays => true,
            Some(Mode::Rapid | Mode::Feed) if has_motion => {
                self.further.along = end;
                true
            }
            Some(Mode::Rapid) => self.act_further(end, FurtherMode::Rapid),
            Some(Mode::Feed) => {
                if self.has_feed(scene, MotionClass::Feed) {
                    self.further_alone(scene, from, end);
                }
                false
            }
            None if has_motion => true,
            None => {
                self.modal.mode_is_poisoned = true;
                let message = format!("{letters} is named, but neither G0 nor G1 is in force");
                let help = "write G0 or G1 into this block";
                self.report_block(scene, Code::MissingWord, message, help);
                false
            }
            Some(mode) => {
                let what = match mode {
                    Mode::Arc { .. } => "an arc",
                    Mode::Cycle(_) => "a drilling cycle",
                    Mode::Probe(_) => "a probe",
                    Mode::Thread | Mode::ThreadCycle => "a thread",
                    _ => "a curve",
                };
                let message = format!("{letters} cannot move in {what}");
                let help = match mode {
                    Mode::Thread | Mode::ThreadCycle => {
                        format!("move {letters} with G0 before the thread")
                    }
                    _ => format!("post the block as lines, or move {letters} with G0 or G1"),
                };
                self.report_block(scene, Code::Axes, message, &help);
                // Its other words belong to the motion that it does not have.
                self.request.has_refused_word = true;
                has_motion
            }
        }
    }

    /// Where the words take the axes. What is wrong with them has been reported, and is left out.
    fn further_end(&mut self, scene: &mut Scene<'_>) -> FurtherAxes {
        let is_relative = self.modal.distance == Distance::Incremental;
        let values = self.further_values(scene);
        if is_relative && !self.relies_on_further(scene, values) {
            self.further.poison(values);
            return FurtherAxes::NONE;
        }
        let base = if is_relative { self.further.position } else { self.further.shift };
        let mut end = FurtherAxes::NONE;
        for (axis, value) in values.iter() {
            let at = base.get(axis).unwrap_or(0.0) + value;
            if at.abs() <= COORDINATE_MM_MAX {
                end = end.with(axis, at);
                continue;
            }
            self.further.poison(FurtherAxes::NONE.with(axis, 0.0));
            if value.is_finite() {
                let unit = if FurtherAxes::is_rotary(axis) { "degrees" } else { "mm" };
                let message =
                    format!("{} leads beyond {COORDINATE_MM_MAX} {unit}", FURTHER_LETTERS[axis]);
                let help = "look for an incremental move that should be absolute";
                self.report(scene, FURTHER_WORDS[axis], Code::Limit, message, help);
            }
            self.request.is_damaged = true;
        }
        end
    }

    /// Whether all of these axes are known; reports the first that is not.
    pub(super) fn relies_on_further(&mut self, scene: &mut Scene<'_>, axes: FurtherAxes) -> bool {
        let is_unknown = |axis: &usize| self.further.position.get(*axis).is_none();
        let Some(axis) = axes.iter().map(|(axis, _)| axis).find(is_unknown) else { return true };
        self.request.is_damaged = true;
        if self.further.poisoned >> axis & 1 == 1 {
            return false;
        }
        let letter = FURTHER_LETTERS[axis];
        let cause = self.further.causes[axis];
        let since = match cause {
            Some(Cause { source, word }) => {
                format!("which is not known since {word} in line {}", source.line)
            }
            None => "which no block before it says".to_owned(),
        };
        let message = format!("this block relies on where {letter} is, {since}");
        let help = format!("move {letter} with G90 and G0 or G1 before it");
        let mut finding = Finding::error(Code::Axes, self.source, message).help(help);
        finding.other = cause.map(|cause| cause.source);
        scene.findings.push(finding);
        // Reported once.
        self.further.poison(FurtherAxes::NONE.with(axis, 0.0));
        false
    }

    /// Whether further axes wait for the motion of this block.
    #[inline]
    pub(super) fn has_further_along(&self) -> bool {
        !self.further.along.is_empty()
    }

    /// The motion of the block comes now: the axes that wait for it go with it.
    #[inline]
    pub(super) fn further_along(&mut self) {
        let axes = std::mem::take(&mut self.further.along);
        if !axes.is_empty() {
            self.act_further(axes, FurtherMode::Along);
        }
    }

    /// The block does not move X, Y and Z: the axes that wait for it move alone, at its feed.
    #[cold]
    pub(super) fn further_without_motion(&mut self, scene: &mut Scene<'_>, from: FurtherAxes) {
        let axes = std::mem::take(&mut self.further.along);
        self.further_alone(scene, from, axes);
    }

    /// The places before the axes of this block have moved.
    pub(super) fn further_position(&self) -> FurtherAxes {
        self.further.position
    }

    /// A move of further axes alone, at feed.
    fn further_alone(&mut self, scene: &mut Scene<'_>, from: FurtherAxes, to: FurtherAxes) {
        let stays = |axis: usize, at: f64| from.get(axis) == Some(at);
        let turns = to.iter().any(|(axis, _)| FurtherAxes::is_rotary(axis));
        let still = to
            .iter()
            .filter(|&(axis, at)| turns && !FurtherAxes::is_rotary(axis) && stays(axis, at));
        // F is degrees a minute where U, V and W do not move.
        let to = still.fold(to, |to, (axis, _)| to.without(axis));
        let is_mixed = turns && !to.only_turns();
        let is_inverse = self.modal.feed_mode == FeedMode::InverseTime;
        if is_inverse || is_mixed {
            // How far they go decides how fast each of them is.
            let known = self.further.position;
            self.further.position = from;
            let is_sound = self.relies_on_further(scene, to);
            self.further.position = known;
            if !is_sound {
                return;
            }
        }
        self.feed_at_surface(MotionClass::Feed, self.axes.position, self.axes.position, None);
        let rate = match self.modal.feed_mode {
            FeedMode::PerMinute if to.only_turns() => self.modal.programmed_feed,
            FeedMode::PerMinute => self.modal.feed_mm_per_min,
            FeedMode::PerRevolution if to.only_turns() => {
                self.modal.programmed_feed * self.rpm_here()
            }
            FeedMode::PerRevolution => self.modal.feed_mm_per_min,
            FeedMode::InverseTime => {
                (further_distance(from, to) * self.modal.programmed_feed).max(RATE_MIN)
            }
        };
        self.act_further(to, FurtherMode::Feed(rate.min(FEED_MM_PER_MIN_MAX)));
    }

    /// Emits the move; false, so that nothing more comes of the block.
    pub(super) fn act_further(&mut self, axes: FurtherAxes, mode: FurtherMode) -> bool {
        self.act(Action::Further(FurtherMove { axes, mode }));
        false
    }
}
