//! What the lines that were sent ask for: where they take the tool, and which words are in
//! force after them.

use super::frame::Frame;
use super::further::Turn;
use super::moves::{ArcWay, Way};
use super::words::LineWords;
use cnc_msgs::contour::SpindleMode;
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{Plane, Position};

/// The words that the lines have put in force; `None` where they have not said.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct WordsInForce {
    /// 0 to 3.
    pub(super) motion: Option<u8>,
    pub(super) plane: Option<Plane>,
    /// 1 to 9.
    pub(super) work_system: Option<u8>,
    pub(super) is_relative: Option<bool>,
    pub(super) is_metric: Option<bool>,
    /// F counts moves of a minute (G93); such an F is of one line.
    pub(super) is_inverse_time: Option<bool>,
    pub(super) feed: Option<f64>,
    pub(super) speed: Option<f64>,
    pub(super) spindle: Option<SpindleMode>,
}

/// Follows the lines in the order in which they are sent.
#[derive(Debug, Clone, Default)]
pub(super) struct Sent {
    pub(super) frame: Frame,
    /// What the lines are read with.
    pub(super) words: WordsInForce,
    /// What the controller has to have in force: what was said since that was last certain.
    pub(super) said: WordsInForce,
    /// Where the last line ends, machine frame, mm; `None` where that is not known.
    pub(super) place: Option<Position>,
    /// The same of the further axes, as far as they are known.
    pub(super) further: FurtherAxes,
    /// How often the lines have changed what is in force.
    pub(super) frame_changes: usize,
}

/// What one line asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Asked {
    pub(super) way: Option<Way>,
    /// `None`: as fast as X, Y and Z go; infinite: not known.
    pub(super) feed_mm_per_min: Option<f64>,
    pub(super) turn: Turn,
}

/// How much faster than S asks for a spindle may turn: its override goes to 200 %, and it is not exact.
const THREAD_FEED_SHARE: f64 = 2.2;

impl Sent {
    /// Takes the next line.
    pub(super) fn take(&mut self, text: &str) -> Asked {
        let Some(words) = LineWords::read(text) else {
            // It may have gone anywhere, and said anything.
            (self.place, self.further) = (None, FurtherAxes::NONE);
            (self.words, self.said) = Default::default();
            self.forget_frame();
            return Asked { way: Some(Way::Anywhere), ..Asked::NOTHING };
        };
        self.take_modal(&words);
        if words.has_g(100) {
            self.store_offset(&words);
            return Asked::NOTHING;
        }
        let from = self.further;
        let asked = self.take_move(&words);
        Asked { turn: Turn { from, to: self.further }, ..asked }
    }

    /// Takes a line that stores no offset.
    fn take_move(&mut self, words: &LineWords) -> Asked {
        if words.has_g(431) {
            self.frame.set_tool_length(words.axes[2].unwrap_or_default());
            return Asked::NOTHING;
        }
        for (tenths, index) in [(281, 0), (301, 1)] {
            if words.has_g(tenths) {
                self.frame.references[index] = self.place;
                return Asked::NOTHING;
            }
        }
        if words.has_m(2) || words.has_m(30) {
            // What else it puts back differs between firmwares.
            (self.words, self.said) = Default::default();
            self.forget_frame();
        }
        if words.has_m(6) {
            // The controller may go to its changer, measure the tool and set its length.
            self.said = WordsInForce::default();
            self.frame.forget_tool_length();
            (self.place, self.further) = (None, FurtherAxes::NONE);
            return Asked { way: Some(Way::Anywhere), ..Asked::NOTHING };
        }
        self.further = self.frame.further.target(words, self.words.is_relative, self.further);
        if !words.has_axes() {
            // Other axes move: how fast says nothing of X, Y and Z, which stay.
            let stays = self.place.map_or(Way::Anywhere, |at| Way::Line { from: at, to: at });
            return match words.further.is_empty() {
                true => Asked::NOTHING,
                false => Asked {
                    way: Some(stays),
                    feed_mm_per_min: Some(f64::INFINITY),
                    ..Asked::NOTHING
                },
            };
        }
        let reference = [280, 300].into_iter().position(|tenths| words.has_g(tenths));
        let target = match reference {
            Some(index) => self.reference_target(words, index),
            None => self.target(words),
        };
        let way = self.way(words, target, reference.is_some());
        self.place = target;
        let is_rapid = reference.is_some() || self.words.motion == Some(0);
        let feed_mm_per_min = match words.further.is_empty() {
            // The spindle says how fast.
            true if words.is_thread() => {
                let per_turn = words.center[2].zip(self.words.speed);
                Some(per_turn.map_or(f64::INFINITY, |(pitch, rpm)| THREAD_FEED_SHARE * pitch * rpm))
            }
            true => self.words.feed.filter(|_| !is_rapid),
            // Boards count degrees as millimetres, or do not.
            false => Some(f64::INFINITY),
        };
        Asked { way: Some(way), feed_mm_per_min, ..Asked::NOTHING }
    }

    fn forget_frame(&mut self) {
        self.frame_changes += 1;
        self.frame.forget();
    }

    fn take_modal(&mut self, words: &LineWords) {
        self.words.take(words);
        self.said.take(words);
        if self.words.is_inverse_time == Some(true) {
            // G93 was said before what is certain: F is of one line.
            self.said.feed = None;
        }
        if words.has_g(490) {
            self.frame.set_tool_length(0.0);
        }
        if words.work_system().is_some() {
            self.frame_changes += 1;
            self.frame.select(words.work_system());
        }
    }

    fn store_offset(&mut self, words: &LineWords) {
        let Some(system) = words.p.filter(|p| (1.0..=9.0).contains(p)) else { return };
        self.frame_changes += 1;
        self.frame.further.store(words, system as u8, self.frame.system, self.further);
        let length = self.frame.tool_length_mm;
        let origin = [0, 1, 2].map(|axis| {
            let value = words.axes[axis]?;
            match words.l == Some(20.0) {
                false => Some(value + self.frame.shift[axis]),
                // So that the tool is here.
                true => {
                    let length = if axis == 2 { length? } else { 0.0 };
                    Some(self.place?[axis] - value - length)
                }
            }
        });
        let is_known = (0..3).all(|axis| words.axes[axis].is_some() == origin[axis].is_some());
        let origin = if is_known { origin } else { [None; 3] };
        if !is_known && let Some(slot) = self.frame.systems.get_mut(system as usize - 1) {
            *slot = None;
        }
        self.frame.store(system as u8, origin);
    }

    fn target(&self, words: &LineWords) -> Option<Position> {
        if words.has_g(530) {
            return self.moved(words, Some([0.0; 3]));
        }
        match self.words.is_relative {
            Some(false) => self.moved(words, self.frame.in_force),
            // By so much from where the axes are.
            Some(true) => {
                let place = self.place?;
                Some([0, 1, 2].map(|axis| place[axis] + words.axes[axis].unwrap_or_default()))
            }
            None => None,
        }
    }

    /// Where the axes are after a move of those that are named.
    fn moved(&self, words: &LineWords, offset: Option<Position>) -> Option<Position> {
        let axes = [0, 1, 2].map(|axis| match words.axes[axis] {
            Some(value) => offset.map(|offset| value + offset[axis]),
            None => self.place.map(|place| place[axis]),
        });
        match axes {
            [Some(x), Some(y), Some(z)] => Some([x, y, z]),
            _ => None,
        }
    }

    fn reference_target(&self, words: &LineWords, index: usize) -> Option<Position> {
        let reference = self.frame.references[index];
        let axes = [0, 1, 2].map(|axis| match words.axes[axis] {
            Some(_) => reference.map(|reference| reference[axis]),
            None => self.place.map(|place| place[axis]),
        });
        match axes {
            [Some(x), Some(y), Some(z)] => Some([x, y, z]),
            _ => None,
        }
    }

    fn way(&self, words: &LineWords, target: Option<Position>, is_reference: bool) -> Way {
        let Some((from, to)) = self.place.zip(target) else { return Way::Anywhere };
        match self.words.motion {
            _ if is_reference || words.has_g(530) || words.is_probe() || words.is_thread() => {
                Way::Line { from, to }
            }
            Some(0 | 1) => Way::Line { from, to },
            Some(motion) => {
                let plane = self.words.plane.unwrap_or_default();
                let [a, b, _] = plane.axes();
                let center = [a, b].map(|axis| from[axis] + words.center[axis].unwrap_or(0.0));
                let arc = ArcWay::new(plane, motion == 2, [from, to], center);
                arc.map_or(Way::Anywhere, Way::Arc)
            }
            None => Way::Anywhere,
        }
    }
}

impl WordsInForce {
    fn take(&mut self, words: &LineWords) {
        if let Some(motion) = words.last_of(&[0, 10, 20, 30]) {
            self.motion = u8::try_from(motion).ok();
        }
        if words.is_probe() || words.is_thread() {
            self.motion = None;
        }
        if let Some(plane) = words.last_of(&[170, 180, 190]) {
            self.plane = Some([Plane::Xy, Plane::Zx, Plane::Yz][plane]);
        }
        if let Some(relative) = words.last_of(&[900, 910]) {
            self.is_relative = Some(relative == 1);
        }
        if let Some(metric) = words.last_of(&[200, 210]) {
            self.is_metric = Some(metric == 1);
        }
        self.work_system = words.work_system().or(self.work_system);
        if let Some(inverse) = words.last_of(&[940, 930]) {
            self.is_inverse_time = Some(inverse == 1);
        }
        self.feed = match self.is_inverse_time {
            Some(true) => None,
            _ => words.feed.or(self.feed),
        };
        self.speed = words.speed.or(self.speed);
        for (number, spindle) in
            [(3, SpindleMode::Clockwise), (4, SpindleMode::CounterClockwise), (5, SpindleMode::Off)]
        {
            if words.has_m(number) {
                self.spindle = Some(spindle);
            }
        }
    }
}

impl Asked {
    const NOTHING: Self = Self { way: None, feed_mm_per_min: None, turn: Turn::UNKNOWN };
}
