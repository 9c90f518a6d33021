//! G33: lines along which the axes keep pace with the spindle.

use super::{EncodeProblem, Encoder, axis_words};
use crate::firmware::{THREAD_WAIT_S_MAX, thread_wait_s};
use crate::link::LineKind;
use cnc_msgs::contour::{Action, Source};

/// Decimals of a pitch, mm: the error of each turn adds up along a thread.
const PITCH_DECIMALS: usize = 6;
/// What its wait for the spindle may be longer than two turns, ms.
const WAIT_SPARE_MS: u32 = 1000;

impl Encoder {
    /// The element after it is the thread, and nothing stands in between.
    pub(super) fn encode_thread(
        &mut self,
        pitch_mm: f64,
        source: Source,
    ) -> Result<(), EncodeProblem> {
        let index = self.next_element;
        let word = Action::SpindleSync { pitch_mm }.text();
        let Some(element) = self.next_of_block(source) else {
            return Err(EncodeProblem::NoMotion { words: word });
        };
        let Some(feed) = element.feed_mm_per_min else {
            return Err(EncodeProblem::NoMotion { words: word });
        };
        let Some(max) = self.config.board.thread_mm_per_min_max else {
            return Err(EncodeProblem::NoSpindleSync { word });
        };
        if feed > max {
            return Err(EncodeProblem::ThreadFeed { word, feed, max });
        }
        let wait_s = thread_wait_s(feed / pitch_mm);
        if wait_s > THREAD_WAIT_S_MAX {
            return Err(EncodeProblem::SlowThread { word, max: THREAD_WAIT_S_MAX });
        }
        self.next_element += 1;
        let start = self.path.start_of(index);
        self.check_ends(start, element.end)?;
        let (axes, words) = axis_words(element.axes, start, element.end);
        let pitch = format!("{pitch_mm:.PITCH_DECIMALS$}");
        let pitch = pitch.trim_end_matches('0').trim_end_matches('.');
        let text = format!("{}G33{words}K{pitch}", self.line_number(index));
        self.modal.motion = None;
        self.modal.unknown = self.modal.unknown.without(axes);
        let milliseconds = (wait_s * 1e3) as u32 + WAIT_SPARE_MS;
        self.push_motion(text, LineKind::Thread { milliseconds }, index, &element)
    }
}
