//! Whether a reported feed can be true.

use super::tolerances::{FEED_MM_PER_MIN, FEED_REPORTS, FEED_SHARE};
use cnc_msgs::geometry::Position;

/// The fastest of each axis, mm/min (`$110` to `$112`); infinite where unknown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rates(pub Position);

/// Counts reports of a feed that no line asks for.
#[derive(Debug, Clone, Copy)]
pub(super) struct SpeedWatch {
    /// All axes at their fastest.
    fastest_mm_per_min: f64,
    /// The highest override that was seen: the axes may still be slowing down from it.
    override_seen: f64,
    last: f64,
    reports: u32,
}

impl SpeedWatch {
    pub(super) fn new(rates: Rates) -> Self {
        let Rates([x, y, z]) = rates;
        let fastest_mm_per_min = x.hypot(y).hypot(z);
        Self { fastest_mm_per_min, override_seen: 1.0, last: 0.0, reports: 0 }
    }

    /// What is allowed, if it was exceeded in so many reports in a row that it is believed.
    /// `feeds` are those of the lines that may be under way, `None` for a rapid.
    pub(super) fn judge(
        &mut self,
        feed: f64,
        feed_override: f64,
        feeds: impl Iterator<Item = Option<f64>>,
    ) -> Option<f64> {
        self.override_seen = self.override_seen.max(feed_override);
        let most = feeds
            .map(|feed| feed.map_or(self.fastest_mm_per_min, |feed| feed * self.override_seen));
        let asked = most.fold(0.0, f64::max);
        // Axes whose fastest is not known here may move along.
        let allowed =
            if asked == f64::INFINITY { asked } else { asked.min(self.fastest_mm_per_min) };
        let is_slowing = feed < self.last;
        self.last = feed;
        let is_above = feed > allowed * FEED_SHARE + FEED_MM_PER_MIN && !is_slowing;
        self.reports = if is_above { self.reports + 1 } else { 0 };
        (self.reports >= FEED_REPORTS).then_some(allowed)
    }
}
