//! How far a run is, and how long it still takes.
//!
//! The planner model runs along with the tool. A change of the overrides scales the rest at once;
//! the rest is then planned anew in slices, so that nothing else waits. A hold moves nothing on.

use crate::cycle_time::{CycleTime, Speeds};
use cnc_msgs::path::CompensatedPath;

/// Blocks that are planned in one go: about two milliseconds.
pub(in crate::driver) const BLOCKS_PER_SLICE: usize = 2_000;

/// Follows the time of a run.
#[derive(Debug)]
pub(super) struct TimeLeft {
    /// All that was done.
    done: CycleTime,
    speeds: Speeds,
    total_s: f64,
    /// The whole once more, from a change of the overrides on.
    recount: Option<CycleTime>,
    /// What is under way, and when it ends.
    under_way: Option<(UnderWay, f64)>,
}

impl TimeLeft {
    /// Nothing done yet. How long all of it takes is not known before it is proved.
    pub(super) fn new(start: CycleTime) -> Self {
        let speeds = Speeds::default();
        Self { done: start, speeds, total_s: 0.0, recount: None, under_way: None }
    }

    /// All of it takes so long without overrides.
    pub(super) fn set_total(&mut self, total_s: f64) {
        self.total_s = total_s;
    }

    /// How long all of it takes.
    pub(super) fn total_s(&self) -> f64 {
        self.total_s
    }

    /// Follows the overrides, and plans a slice of the rest where they have changed.
    pub(super) fn follow(&mut self, path: &CompensatedPath, speeds: Speeds) {
        if speeds != self.speeds {
            let ratio = self.speeds.feed / speeds.feed.max(0.01);
            let done = self.done.seconds();
            self.total_s = done + (self.total_s - done).max(0.0) * ratio;
            self.speeds = speeds;
            self.done.set_speeds(speeds);
            self.recount = Some(self.done.clone());
            self.under_way = None;
        }
        let Some(recount) = &mut self.recount else { return };
        if recount.advance_within(path, path.elements.len(), BLOCKS_PER_SLICE) {
            self.total_s = recount.seconds();
            self.recount = None;
        }
    }

    /// This part of what is under way is done, 0 to 1: what of the whole is done, 0 to 1, and the seconds
    /// that are left.
    pub(super) fn at(&mut self, path: &CompensatedPath, at: UnderWay, part: f64) -> (f64, f64) {
        let begun = at.begins(&mut self.done, path);
        let ends = match self.under_way.filter(|(of, _)| *of == at) {
            Some((_, ends)) => ends,
            None => at.ends(&mut self.done.clone(), path),
        };
        self.under_way = Some((at, ends));
        let done = begun + (ends - begun).max(0.0) * part.clamp(0.0, 1.0);
        let fraction = if self.total_s > 0.0 { (done / self.total_s).min(1.0) } else { 0.0 };
        (fraction, (self.total_s - done).max(0.0))
    }
}

/// What is under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum UnderWay {
    Element(usize),
    /// A line that turns A to W alone before an element: this event.
    Turn {
        before: usize,
        event: usize,
    },
}

impl UnderWay {
    fn begins(self, time: &mut CycleTime, path: &CompensatedPath) -> f64 {
        match self {
            // Nothing has an element, and nothing has turned yet.
            Self::Element(_) if path.elements.is_empty() => time.seconds(),
            Self::Element(element) => time.advance_to_cut(path, element),
            Self::Turn { before, event } => time.advance_to_turn(path, (before, event)),
        }
    }

    fn ends(self, time: &mut CycleTime, path: &CompensatedPath) -> f64 {
        match self {
            Self::Element(element) => time.advance_to_turn(path, (element + 1, 0)),
            Self::Turn { before, event } => time.advance_to_turn(path, (before, event + 1)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::firmware::Firmware;
    use crate::machine_limits::{MachineLimits, tests::settings};
    use cnc_msgs::geometry::{AxisSet, Shape};
    use cnc_msgs::path::{PathElement, Role};

    #[test]
    fn an_override_scales_the_rest_at_once_and_is_planned_slice_by_slice() {
        // Half in feed, half in rapids, which the feed override leaves alone.
        let element = |number: u32| PathElement {
            side: None,
            shape: Shape::Line,
            end: [f64::from(number), 0.0, 0.0],
            feed_mm_per_min: number.is_multiple_of(2).then_some(600.0),
            role: Role::None,
            axes: AxisSet::NONE,
            source: Default::default(),
        };
        let elements = (1..=6_000).map(element).collect();
        let path = CompensatedPath { elements, ..CompensatedPath::default() };
        let limits = MachineLimits::of(&settings(Firmware::Grbl, "V", &[])).expect("a machine");
        let time = |speeds: Speeds| {
            let mut time = CycleTime::new(&limits, &path, 0, None);
            time.set_speeds(speeds);
            time.advance_to(&path, path.elements.len())
        };
        let half = Speeds { feed: 0.5, rapid: 1.0 };
        let (whole, slower) = (time(Speeds::default()), time(half));
        let mut left = TimeLeft::new(CycleTime::new(&limits, &path, 0, None));
        left.set_total(whole);
        assert_eq!(left.at(&path, UnderWay::Element(0), 0.0), (0.0, whole));
        left.follow(&path, half);
        assert!((left.total_s() - 2.0 * whole).abs() < 1e-6, "scaled at once");
        let slices = path.elements.len() / BLOCKS_PER_SLICE + 1;
        (0..slices).for_each(|_| left.follow(&path, half));
        assert!((left.total_s() - slower).abs() < 1e-6, "{} s, {slower} s", left.total_s());
        // In the middle of an element a part of it is done.
        let (_, at_its_start) = left.at(&path, UnderWay::Element(3_001), 0.0);
        let (_, in_its_middle) = left.at(&path, UnderWay::Element(3_001), 0.5);
        let (fraction, at_its_end) = left.at(&path, UnderWay::Element(3_002), 0.0);
        let middle = (at_its_start + at_its_end) / 2.0;
        assert!((in_its_middle - middle).abs() < 1e-6, "{in_its_middle} s, {middle} s");
        assert!((fraction - 0.5).abs() < 0.01, "{fraction}");
        assert_eq!(left.at(&path, UnderWay::Element(path.elements.len()), 1.0), (1.0, 0.0));
    }
}
