//! A, B, C, U, V and W as words of the line of their block, or of a line of their own.
//!
//! Boards differ in how fast they move a line in which an axis turns: some count its degrees as
//! millimetres, others leave them out. What such a line takes does not depend on that, so it is
//! sent as a time (G93). Where axes turn alone, all of them count degrees.

use super::words::{to_grid, write_word};
use super::{EncodeProblem, Encoder};
use crate::link::LineKind;
use cnc_msgs::contour::{Action, Source};
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes, FurtherMode, FurtherMove, further_distance};
use cnc_msgs::path::{CompensatedPath, FurtherPlace};

/// The largest angle, degrees, either sign: beyond it the 32 bit numbers of the controllers are
/// more than 0.005 degrees apart.
pub(crate) const DEGREES_MAX: f64 = 65_536.0;
/// The shortest time of a move that is sent, as moves of a minute.
const PER_MINUTE_MAX: f64 = 1e6;

/// Axes that wait for the line of their block.
#[derive(Debug, Clone)]
pub(super) struct HeldFurther {
    axes: FurtherAxes,
    pub(super) source: Source,
}

/// Where the axes A to W must stand when a run begins in the middle.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StartFurther {
    /// In the work frame.
    pub at: FurtherAxes,
    /// A line has taken them there: a board that counts within one turn shows another angle.
    pub is_sent: bool,
}

/// The axes that a path names, and never with anything but 0: posts write A0 for machines that
/// may have an axis A. A controller without the axis does what is asked of it.
pub(super) fn idle_axes(path: &CompensatedPath) -> u8 {
    let (mut named, mut moved) = (0, 0);
    for event in &path.events {
        if let Action::Further(FurtherMove { axes, .. }) = event.action {
            named |= axes.bits();
            let moving = axes.iter().filter(|(_, value)| *value != 0.0);
            moved |= moving.fold(0, |bits, (axis, _)| bits | 1 << axis);
        }
    }
    named & !moved
}

impl Encoder {
    pub(super) fn encode_further(
        &mut self,
        further: FurtherMove,
        source: Source,
    ) -> Result<(), EncodeProblem> {
        let FurtherMove { axes: named, mode } = further;
        let axes = self.checked_further(named)?;
        if let FurtherMode::Along = mode {
            self.further = Some(HeldFurther { axes, source });
            return Ok(());
        }
        if axes.is_empty() {
            return Ok(());
        }
        let from = self.modal.further_at;
        let mut text = String::new();
        match mode {
            FurtherMode::Feed(rate) => {
                self.write_motion(&mut text, 1);
                self.write_further(&mut text, axes);
                let turns = axes.iter().any(|(axis, _)| FurtherAxes::is_rotary(axis));
                if !turns || axes.only_turns() {
                    self.write_feed(&mut text, Some(rate))?;
                } else if axes.iter().all(|(axis, _)| from.get(axis).is_some()) {
                    self.write_inverse_time(&mut text, further_distance(from, axes), rate)?;
                } else {
                    let words = axes.words().trim_start().to_owned();
                    return Err(EncodeProblem::UnknownRate { words });
                }
            }
            FurtherMode::Rapid | FurtherMode::Along => {
                self.write_motion(&mut text, 0);
                self.write_further(&mut text, axes);
            }
        }
        self.push_action(text, LineKind::Motion, false, source)
    }

    /// Whether an axis is not sent: the controller does not have it, and the path leaves it at 0.
    pub(super) fn leaves_out(&self, axis: usize) -> bool {
        !self.config.board.has_further(axis) && self.idle_axes >> axis & 1 == 1
    }

    /// The axes that are sent anywhere in the path, as the bits of [`FurtherAxes`].
    pub(crate) fn sent_further(&self) -> u8 {
        self.path.events.iter().fold(0, |bits, event| match event.action {
            Action::Further(FurtherMove { axes, .. }) => {
                let sent = axes.iter().filter(|(axis, _)| !self.leaves_out(*axis));
                sent.fold(bits, |bits, (axis, _)| bits | 1 << axis)
            }
            _ => bits,
        })
    }

    /// The letters of the axes that only events from here on move, and the line that does so first: until
    /// then they stay where they are.
    pub(crate) fn awaited_further(&self) -> Option<(String, u32)> {
        let FurtherPlace { at, lost, .. } = self.further_place();
        let before = at.or(lost);
        let mut moved = FurtherAxes::NONE;
        let mut first = None;
        for event in &self.path.events[self.next_event..] {
            let Action::Further(FurtherMove { axes, .. }) = event.action else { continue };
            for (axis, value) in axes.without_all(before).iter().filter(|it| !self.leaves_out(it.0))
            {
                moved = moved.with(axis, value);
                first.get_or_insert(event.source.line);
            }
        }
        first.map(|line| (moved.letters(), line))
    }

    /// The axes that are sent; refuses those that the controller does not have.
    pub(super) fn checked_further(&self, named: FurtherAxes) -> Result<FurtherAxes, EncodeProblem> {
        let board = &self.config.board;
        let mut axes = FurtherAxes::NONE;
        for (axis, value) in named.iter() {
            let letter = FURTHER_LETTERS[axis];
            if self.leaves_out(axis) {
                continue;
            }
            if !board.has_further(axis) {
                return Err(EncodeProblem::NoAxis { letter, axes: board.axis_letters() });
            }
            if !FurtherAxes::is_rotary(axis) {
                self.checked_position(letter, value)?;
            } else if !(-DEGREES_MAX..=DEGREES_MAX).contains(&value) {
                return Err(EncodeProblem::Turns { letter, value, max: DEGREES_MAX });
            }
            axes = axes.with(axis, value);
        }
        Ok(axes)
    }

    /// Takes the axes that wait for the line of a block; none where none wait.
    pub(super) fn take_further(&mut self, source: Source) -> Result<FurtherAxes, EncodeProblem> {
        match self.further.take() {
            Some(held) if held.source == source => Ok(held.axes),
            None => Ok(FurtherAxes::NONE),
            held => {
                self.further = held;
                self.refuse_held_further().map(|()| FurtherAxes::NONE)
            }
        }
    }

    /// Refuses axes that wait, where something else comes than the line of their block.
    pub(super) fn refuse_held_further(&mut self) -> Result<(), EncodeProblem> {
        match self.further.take() {
            None => Ok(()),
            Some(HeldFurther { axes, .. }) => {
                Err(EncodeProblem::NoMotion { words: axes.words().trim_start().to_owned() })
            }
        }
    }

    pub(super) fn write_further(&mut self, text: &mut String, axes: FurtherAxes) {
        for (axis, value) in axes.iter() {
            write_word(text, FURTHER_LETTERS[axis], to_grid(value));
        }
        self.modal.further_at = axes.or(self.modal.further_at);
    }

    /// These axes are in another frame, or their frame is another.
    pub(super) fn forget_further(&mut self, axes: FurtherAxes) {
        let known = self.modal.further_at;
        self.modal.further_at = axes.iter().fold(known, |known, (axis, _)| known.without(axis));
    }

    /// Writes how long the line takes: so far at this rate a minute.
    pub(super) fn write_inverse_time(
        &mut self,
        text: &mut String,
        distance: f64,
        rate: f64,
    ) -> Result<(), EncodeProblem> {
        self.checked_feed(rate)?;
        let per_minute = (rate / distance).min(PER_MINUTE_MAX);
        if to_grid(per_minute) <= 0 {
            return Err(EncodeProblem::Feed { value: rate, max: self.config.feed_mm_per_min_max });
        }
        if !std::mem::replace(&mut self.modal.is_inverse_time, true) {
            *text += "G93";
        }
        // It is of this line alone.
        self.modal.feed = None;
        write_word(text, 'F', to_grid(per_minute));
        Ok(())
    }
}
