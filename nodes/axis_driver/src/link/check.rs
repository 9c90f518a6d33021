//! Whether lines and answers still belong to each other, in the middle of a stream.
//!
//! The protocol numbers nothing: an `ok` does not say which line it answers. One line does.
//! The answer to `$G` is `[GC:...]` and then `ok`, in its place among the answers, and all
//! three firmwares read it while the axes move without stopping them. So a `$G` goes among
//! the lines from time to time. Where the `ok` that is counted for it does not follow a
//! `[GC:...]`, a line or an answer before it was lost or came twice.
//!
//! Such a check is read in its turn, after the lines that were under way. So it notices
//! damage when those have been read. A check follows every few lines where lines are slow, so
//! that this is before the tool gets to the place wherever the planner is full; where lines
//! are fast, checks keep to their interval, so that their answers leave the line to others.
//!
//! grblHAL passes over all lines after one that it refuses, until it takes one; and it takes a
//! `$G`. What follows the check would be cut without the refused line. So nothing is sent after
//! a check there until all lines before it are answered. The planner is full meanwhile, or the
//! lines are so fast that this takes no longer than the way there and back.

use super::LinkFault;
use std::time::Duration;

/// What a check is on the wire.
pub(super) const CHECK: &str = "$G";
/// Lines after which a check is sent before its interval is over: half a planner of grbl.
const LINES_PER_CHECK: u32 = 8;
/// Checks that may go ahead of their intervals, when many lines go at once.
const CHECKS_AHEAD: u32 = 4;

#[derive(Debug)]
pub(super) struct LineCheck {
    /// `None`: none are sent.
    interval: Option<Duration>,
    sent_at: Duration,
    /// When the checks that were sent would have been sent, one in an interval.
    earned_at: Duration,
    lines_since: u32,
    /// A `[GC:...]` came, and no answer since.
    is_announced: bool,
    /// Nothing may be sent after a check before it is the oldest that is not answered.
    must_be_first: bool,
}

impl LineCheck {
    pub(super) fn new(interval_ms: u32) -> Self {
        Self {
            interval: (interval_ms > 0).then(|| Duration::from_millis(u64::from(interval_ms))),
            sent_at: Duration::ZERO,
            earned_at: Duration::ZERO,
            lines_since: 0,
            is_announced: false,
            must_be_first: false,
        }
    }

    /// A stream begins now. `passes_over`: a check ends the passing over of lines after an error.
    pub(super) fn begin(&mut self, now: Duration, passes_over: bool) {
        (self.sent_at, self.earned_at, self.lines_since) = (now, now, 0);
        self.must_be_first = passes_over;
    }

    pub(super) fn must_be_first(&self) -> bool {
        self.must_be_first
    }

    /// All that was under way is forgotten.
    pub(super) fn forget(&mut self) {
        self.is_announced = false;
    }

    pub(super) fn is_due(&self, now: Duration) -> bool {
        self.interval.is_some_and(|interval| {
            let is_wanted = now >= self.sent_at + interval || self.lines_since >= LINES_PER_CHECK;
            is_wanted && self.earned_at <= now + interval * CHECKS_AHEAD
        })
    }

    pub(super) fn on_line_sent(&mut self) {
        self.lines_since = self.lines_since.saturating_add(1);
    }

    pub(super) fn on_sent(&mut self, now: Duration) {
        (self.sent_at, self.lines_since) = (now, 0);
        self.earned_at = self.earned_at.max(now) + self.interval.unwrap_or_default();
    }

    /// The words in force were reported.
    pub(super) fn on_words(&mut self) {
        self.is_announced = true;
    }

    /// An answer came; `is_check` when it is counted for a check.
    pub(super) fn on_answer(&mut self, is_check: bool, error: Option<u16>) -> Option<LinkFault> {
        let is_announced = std::mem::take(&mut self.is_announced);
        match (is_check, error, is_announced) {
            (true, Some(code), _) => Some(LinkFault::CheckRefused { code }),
            (true, None, false) => Some(LinkFault::OutOfStep),
            (true, None, true) | (false, ..) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    /// When checks are sent among so many lines, one every so many milliseconds.
    fn sent(lines: u64, every_ms: u64) -> Vec<u64> {
        let mut check = LineCheck::new(200);
        check.begin(ms(0), false);
        let mut times = Vec::new();
        for at in (0..lines).map(|line| line * every_ms) {
            if check.is_due(ms(at)) {
                check.on_sent(ms(at));
                times.push(at);
            }
            check.on_line_sent();
        }
        times
    }

    #[test]
    fn a_check_follows_every_slow_line_and_keeps_to_its_interval_among_fast_ones() {
        assert_eq!(sent(5, 1_000), [1_000, 2_000, 3_000, 4_000]);
        // All at once: after every eight lines, and no more than five.
        assert_eq!(sent(60, 0), [0, 0, 0, 0, 0]);
        // A second of five hundred lines: those five, and one in an interval.
        let fast = sent(500, 2);
        assert_eq!(fast.len(), 9, "{fast:?}");
        assert_eq!(sent(6, 150), [300, 600], "at the first line after the interval");
    }

    #[test]
    fn only_the_answer_after_the_words_in_force_is_that_of_a_check() {
        // `w` words, `o` an answer of a line, `c` one that is counted for a check.
        for (story, fault) in [
            ("owcowc", None),
            // Words that nobody asked for.
            ("wowowc", None),
            // An answer before it was lost: its own is taken for that of the line before.
            ("owoc", Some(LinkFault::OutOfStep)),
            // One came twice: it is taken for that of the check.
            ("oc", Some(LinkFault::OutOfStep)),
        ] {
            let mut check = LineCheck::new(200);
            let mut found = None;
            for step in story.chars() {
                match step {
                    'w' => check.on_words(),
                    kind => found = check.on_answer(kind == 'c', None).or(found),
                }
            }
            assert_eq!(found, fault, "{story}");
        }
        let mut check = LineCheck::new(200);
        let refused = check.on_answer(true, Some(8));
        assert_eq!(refused, Some(LinkFault::CheckRefused { code: 8 }));
    }
}
