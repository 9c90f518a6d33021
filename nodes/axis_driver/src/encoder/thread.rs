//! G33: lines along which the axes keep pace with the spindle.

use super::{EncodeProblem, EncodedLine, Encoder, axis_words};
use crate::firmware::{THREAD_WAIT_S_MAX, thread_wait_s};
use crate::link::LineKind;
use crate::vectors::{minus, norm};
use cnc_msgs::contour::{Action, Source};
use cnc_msgs::path::Role;

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
        let start = self.path.start_of(index);
        let way = minus(element.end, start);
        let rates =
            self.config.board.thread_mm_per_min_max.ok_or_else(|| no_spindle_sync(pitch_mm))?;
        // In a frame that was selected before it, where the thread begins is not known: then an axis
        // may go all of the way.
        let way = std::array::from_fn(|axis| match self.modal.unknown.contains(axis) {
            true => (!element.axes.contains(axis)).then_some(0.0),
            false => Some(way[axis]),
        });
        let shares = shares(way).map(|share| share.unwrap_or(1.0));
        let wait_s = check_pace(pitch_mm, shares, feed, rates)?;
        self.next_element += 1;
        self.check_ends(start, element.end)?;
        let (axes, words) = axis_words(element.axes, start, element.end);
        let pitch = format!("{pitch_mm:.PITCH_DECIMALS$}");
        let pitch = pitch.trim_end_matches('0').trim_end_matches('.');
        let text = format!("{}G33{words}K{pitch}", self.line_number(index));
        self.modal.motion = None;
        self.modal.unknown = self.modal.unknown.without(axes);
        let kind = LineKind::Thread { milliseconds: (wait_s * 1e3) as u32 + WAIT_SPARE_MS };
        self.push_motion(text, kind, index, &element)?;
        // Waits for the end of the thread, and nothing follows before: grblHAL does not come to rest in
        // a hold of a motion that follows on one without a stop, and the path watch has one line to judge.
        let (role, events) = (Role::None, self.next_event);
        let text = "G4P0".into();
        self.push(EncodedLine { text, kind, is_alone: true, element: None, source, role, events })
    }
}

/// Why a controller without an encoder at its spindle refuses a thread.
pub(crate) fn no_spindle_sync(pitch_mm: f64) -> EncodeProblem {
    EncodeProblem::NoSpindleSync { word: Action::SpindleSync { pitch_mm }.text() }
}

/// The share that each axis has in a way, from 0 to 1; `None` where that is not known.
pub(crate) fn shares(way: [Option<f64>; 3]) -> [Option<f64>; 3] {
    let stands = |mm: &Option<f64>| *mm == Some(0.0);
    if let [Some(x), Some(y), Some(z)] = way {
        let whole = norm([x, y, z]).max(f64::MIN_POSITIVE);
        return [x, y, z].map(|mm| Some(mm.abs() / whole));
    }
    let moves_alone = way.iter().filter(|mm| !stands(mm)).count() == 1;
    way.map(|mm| match stands(&mm) {
        true => Some(0.0),
        false => moves_alone.then_some(1.0),
    })
}

/// Whether the axes can keep pace; how long they wait for the spindle at the most, s.
///
/// `shares`: what each axis has of the way. `rates`: the fastest that X, Y and Z move at its pace, mm/min, as far as it is known.
///
/// # Errors
/// An axis is too slow: grblHAL refuses the line then, or falls behind. Or the spindle is.
pub(crate) fn check_pace(
    pitch_mm: f64,
    shares: [f64; 3],
    feed: f64,
    rates: [Option<f64>; 3],
) -> Result<f64, EncodeProblem> {
    let word = Action::SpindleSync { pitch_mm }.text();
    for (axis, max) in rates.into_iter().enumerate() {
        // That of Z counts along whatever axes.
        let share = if axis == 2 { 1.0 } else { shares[axis] };
        if share == 0.0 {
            continue;
        }
        let setting = 110 + axis;
        let Some(max) = max else { return Err(EncodeProblem::ThreadRate { word, setting }) };
        if feed * share > max {
            let feed = feed * share;
            return Err(EncodeProblem::ThreadFeed { word, feed, max, setting });
        }
    }
    let wait_s = thread_wait_s(feed / pitch_mm);
    match wait_s >= THREAD_WAIT_S_MAX {
        true => Err(EncodeProblem::SlowThread { word, max: THREAD_WAIT_S_MAX }),
        false => Ok(wait_s),
    }
}
