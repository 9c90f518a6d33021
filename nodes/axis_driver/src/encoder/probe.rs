//! Probes, and the moves from where they have ended.
//!
//! Where that is, the path does not say: such a move is sent as how far it goes (G91), and G90 again
//! after it.

use super::words::{to_grid, write_word};
use super::{EncodeProblem, Encoder, EncoderStep, axis_words};
use crate::link::LineKind;
use cnc_msgs::contour::{Action, Probe, Source};
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet, Position};

impl Encoder {
    /// The element after it is the way of the probe, and nothing stands in between.
    pub(super) fn encode_probe(
        &mut self,
        probe: Probe,
        source: Source,
    ) -> Result<(), EncodeProblem> {
        let index = self.next_element;
        let Some(element) = self.next_of_block(source).filter(|it| it.feed_mm_per_min.is_some())
        else {
            return Err(EncodeProblem::NoMotion { words: probe.word().into() });
        };
        self.next_element += 1;
        let start = self.path.start_of(index);
        self.check_ends(start, element.end)?;
        let relative = std::mem::take(&mut self.relative);
        let (axes, words) = motion_words(element.axes, start, element.end, relative);
        let mut text = self.line_number(index);
        text += if relative.is_empty() { "" } else { "G91" };
        text = text + probe.word() + &words;
        self.write_feed(&mut text, element.feed_mm_per_min)?;
        self.modal.motion = None;
        self.modal.forget(axes, probe.word());
        self.push_motion(text, LineKind::Slow, index, &element)?;
        if let Some(EncoderStep::Line(line)) = self.pending.pop_back() {
            self.pending.push_back(EncoderStep::Probe { line, probe });
        }
        self.push_absolute(relative, source)
    }

    /// The stretch that begins here is in the path now: a rapid of its block says where
    /// the axes are that nobody knew, and moves nothing.
    pub(crate) fn begin_stretch(&mut self) {
        let last = self.next_event.checked_sub(1).map(|event| self.path.events[event].action);
        if let Some(Action::Stretch { axes }) =
            last.filter(|_| self.next_element < self.path.elements.len())
            && !axes.is_empty()
        {
            self.next_element += 1;
            self.modal.unknown = self.modal.unknown.without(axes);
        }
    }

    /// G90 again, after a line that has moved axes from wherever they were.
    pub(super) fn push_absolute(
        &mut self,
        relative: AxisSet,
        source: Source,
    ) -> Result<(), EncodeProblem> {
        match relative.is_empty() {
            true => Ok(()),
            false => self.push_action("G90".into(), LineKind::Motion, false, source),
        }
    }
}

/// Axes that are to move from wherever they are, and nothing that moves them so.
pub(super) fn no_motion(relative: AxisSet) -> EncodeProblem {
    EncodeProblem::NoMotion { words: Action::Relative { axes: relative }.text() }
}

/// The words of a motion: where it ends, or how far it goes where axes are `relative`.
pub(super) fn motion_words(
    named: AxisSet,
    start: Position,
    end: Position,
    relative: AxisSet,
) -> (AxisSet, String) {
    if relative.is_empty() {
        return axis_words(named, start, end);
    }
    let (axes, _) = axis_words(named, start, end);
    let mut text = String::new();
    for axis in (0..3).filter(|&axis| axes.contains(axis)) {
        write_word(&mut text, AXIS_LETTERS[axis], to_grid(end[axis]) - to_grid(start[axis]));
    }
    (axes, text)
}
