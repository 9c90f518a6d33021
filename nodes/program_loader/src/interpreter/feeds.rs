//! G93, G94 and G95: what F means.
//!
//! Every motion has a feed in mm/min: G93 and G95 are computed from its length and from S, and are
//! never faster than F may be under G94. Under compensation G93 counts the programmed length.

use super::{Interpreter, Scene};
use crate::dialect::{FeedMode, GWord, Group};
use crate::limits::FEED_MM_PER_MIN_MAX;
use cnc_msgs::contour::MotionClass;
use cnc_msgs::finding::Code;

/// A move of no length under G93 has this feed, mm/min: it must not be 0.
const FEED_MM_PER_MIN_MIN: f64 = 0.1;

impl Interpreter<'_> {
    /// Takes the feed mode of the block. F of another mode means nothing here.
    pub(super) fn feed_mode(&mut self) {
        if let Some((GWord::FeedMode(mode), _)) = self.request.g(Group::Feed)
            && mode != self.modal.feed_mode
        {
            self.modal.feed_mode = mode;
            (self.modal.feed_mm_per_min, self.modal.programmed_feed) = (0.0, 0.0);
            self.modal.programmed_feed_mm = 0.0;
            self.modal.feed_is_poisoned = false;
        }
    }

    /// Computes the feed after a new F or S.
    #[inline]
    pub(super) fn feed_in_mode(&mut self) {
        match self.modal.feed_mode {
            FeedMode::PerMinute => {}
            FeedMode::PerRevolution => {
                let feed = self.modal.programmed_feed_mm * self.rpm_here();
                self.modal.feed_mm_per_min = feed.min(FEED_MM_PER_MIN_MAX);
            }
            // Each move has one of its own.
            FeedMode::InverseTime => self.modal.feed_mm_per_min = 0.0,
        }
    }

    /// Under G93, computes the feed from the length of the move, mm.
    #[inline]
    pub(super) fn feed_of_length(&mut self, class: MotionClass, length: impl FnOnce() -> f64) {
        if self.modal.feed_mode == FeedMode::InverseTime && class == MotionClass::Feed {
            let feed = length() * self.modal.programmed_feed;
            self.modal.feed_mm_per_min = feed.clamp(FEED_MM_PER_MIN_MIN, FEED_MM_PER_MIN_MAX);
        }
    }

    /// The feed of a move that keeps pace with the spindle, mm/min.
    pub(super) fn feed_of_pitch(&self, pitch_mm: f64) -> f64 {
        (pitch_mm * self.modal.rpm).min(FEED_MM_PER_MIN_MAX)
    }

    /// Whether a move at feed has one under G93 or G95; reports its absence once.
    #[cold]
    pub(super) fn has_unusual_feed(&mut self, scene: &mut Scene<'_>) -> bool {
        let is_inverse = self.modal.feed_mode == FeedMode::InverseTime;
        if is_inverse && self.request.present.contains(b'F') && self.modal.programmed_feed > 0.0 {
            return true;
        }
        if self.modal.feed_is_poisoned {
            return false;
        }
        let (message, help) = if is_inverse {
            (
                "this move has no F, and G93 is in force",
                "under G93 write F into each block that cuts: moves of this kind in a minute",
            )
        } else if self.modal.programmed_feed > 0.0 {
            self.modal.feed_is_poisoned = true;
            (
                "this move has a feed per revolution (G95), and no spindle speed is in force",
                "write S before it (after G97 too), or G94 and F with mm/min",
            )
        } else {
            self.modal.feed_is_poisoned = true;
            (
                "this move needs a feed per revolution (G95), and none has been programmed",
                "write F with mm per revolution into this block or before it",
            )
        };
        let known = !self.request.is_damaged;
        self.report_block(scene, Code::MissingWord, message.to_owned(), help);
        self.request.is_damaged = !known;
        false
    }
}
