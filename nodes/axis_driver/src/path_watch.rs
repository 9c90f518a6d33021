//! Watches that the tool is where the lines that were sent can have taken it.
//!
//! Every report of a run is looked at: the position lies on the part of the path that can be
//! under way, which begins at the place that the tool is sure to have reached and ends with the
//! newest line that was sent; the work offset is one that the lines have put in force; the
//! feed is no higher than they ask for. The words in force, which come among the answers, are
//! those that were sent up to there.
//!
//! It reads the lines as they were sent, not the path that they were made from, so that each
//! is compared with what a sound line would have done. Places are in the machine frame: a
//! wrong work offset takes the tool away from them. Progress never goes back: the tool is at
//! the first place within the tolerance or after it, never before. One report alone does not
//! say so: it may be the one that is wrong. Knows no ports and no time.

mod board;
mod bound;
mod deviation;
mod frame;
mod further;
mod moves;
mod parser_state;
mod sent;
mod speed;
#[cfg(test)]
mod tests;
mod tolerances;
mod words;

pub use board::Board;
pub use deviation::{Culprit, Deviation};
pub use frame::Frame;
pub(crate) use further::is_same_place;
pub use further::{FurtherFrame, Off};
pub use speed::Rates;

use crate::report::ReportUnits;
use bound::Bound;
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::Position;
use further::Turn;
use moves::{Nearest, Way};
use sent::{Sent, WordsInForce};
use speed::SpeedWatch;
use std::collections::VecDeque;
use tolerances::{BLOCKS_AT_THE_STEPS, PATH_MM, PLANNER_BLOCKS_UNKNOWN, SAME_MM, STEPS_OF_A_BLOCK};

/// What a status report says.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Seen {
    /// Machine frame, mm.
    pub position: Option<Position>,
    /// The report has the work position alone: the machine position follows from an offset that
    /// may have come in an earlier one.
    pub is_by_offset: bool,
    /// The same of the further axes that the board has.
    pub further: FurtherAxes,
    /// The work offset, where this report has it.
    pub work_offset: Option<Position>,
    /// The same of the further axes.
    pub further_offset: FurtherAxes,
    pub feed_mm_per_min: Option<f64>,
    /// 1 for 100 %.
    pub feed_override: f64,
    pub blocks_in_use: Option<usize>,
}

/// A line that takes the tool somewhere.
#[derive(Debug, Clone, Copy)]
struct SentMove {
    way: Way,
    turn: Turn,
    feed_mm_per_min: Option<f64>,
    culprit: Culprit,
    /// Lines that take a planner block for sure, up to this one.
    blocks: usize,
    /// How many lines were sent up to this one.
    number: usize,
}

/// What is in force after a line that has no answer yet.
#[derive(Debug, Clone, Copy)]
struct After {
    words: WordsInForce,
    offset: Option<Position>,
    further_offset: FurtherAxes,
    frame_changes: usize,
    blocks: usize,
}

/// Follows what is sent, answered and reported.
#[derive(Debug, Clone)]
pub struct PathWatch {
    board: Board,
    sent: Sent,
    /// From the one that may be under way on; never empty.
    moves: VecDeque<SentMove>,
    /// What is done for sure where any one of the reports is wrong.
    least: Bound,
    /// What is done for sure where all reports are true.
    bound: Bound,
    unanswered: VecDeque<After>,
    /// What is in force after the line that was answered last.
    parsed: After,
    lines_sent: usize,
    /// The work offset that reports have shown last.
    shown: Option<Position>,
    /// The same of the further axes.
    shown_further: FurtherAxes,
    /// What the controller reports next is taken as it is.
    takes_offset: bool,
    speed: SpeedWatch,
}

impl PathWatch {
    /// The machine stands here and has nothing to do.
    pub fn new(
        board: Board,
        mut frame: Frame,
        place: Option<Position>,
        further: FurtherAxes,
    ) -> Self {
        frame.settle();
        let (offset, further_offset) = (frame.in_force, frame.further.in_force);
        let words = WordsInForce::default();
        let sent = Sent { frame, place, ..Sent::default() };
        let mut watch = Self {
            speed: SpeedWatch::new(board.rates),
            board,
            sent,
            moves: VecDeque::new(),
            least: Bound::default(),
            bound: Bound::default(),
            unanswered: VecDeque::new(),
            parsed: After { words, offset, further_offset, frame_changes: 0, blocks: 0 },
            lines_sent: 0,
            shown: offset,
            shown_further: FurtherAxes::NONE,
            takes_offset: false,
        };
        watch.stand(place, further);
        watch
    }

    /// Everything that was sent is done, and the machine stands: here, where that is known.
    fn stand(&mut self, place: Option<Position>, further: FurtherAxes) {
        let way = place.map_or(Way::Anywhere, |place| Way::Line { from: place, to: place });
        let last = self.moves.back();
        let culprit = last.map_or(Culprit::default(), |last| last.culprit);
        let blocks = last.map_or(self.parsed.blocks, |last| last.blocks);
        let (number, feed_mm_per_min, turn) = (self.lines_sent, None, Turn::at(further));
        self.moves.clear();
        self.moves.push_back(SentMove { way, turn, feed_mm_per_min, culprit, blocks, number });
        (self.least, self.bound) = Default::default();
        (self.sent.place, self.sent.further) = (place, further);
    }

    /// The machine stands here, wherever it was thought to be, in this frame, where it is known.
    pub fn begin_again(
        &mut self,
        frame: Option<Frame>,
        place: Option<Position>,
        further: FurtherAxes,
    ) {
        if let Some(mut frame) = frame {
            let (system, length) = (self.sent.frame.system, self.sent.frame.tool_length_mm);
            frame.system = frame.system.or(system);
            frame.tool_length_mm = frame.tool_length_mm.or(length);
            // The lines know them best; what else changes them is a deviation.
            frame.further = self.sent.frame.further;
            if frame.in_force.is_none() {
                // Another system may be in force.
                frame.further = frame.further.only_stored();
            }
            self.sent.frame = frame;
            self.forget_words();
            self.parsed.offset = self.sent.frame.in_force;
            self.parsed.further_offset = self.sent.frame.further.in_force;
        }
        self.stand(place, further);
    }

    /// The axes are going to their switches, and what the owner has stored is in force after it.
    pub fn forget_words(&mut self) {
        self.sent.said = WordsInForce::default();
        self.parsed.words = WordsInForce::default();
    }

    /// The operator goes on after a deviation: what is under way may be anywhere, and what is
    /// in force is what the controller says. Lines that are sent from now on count again.
    pub fn forgive(&mut self) {
        self.forget_places();
        self.forget_words();
        self.unanswered.iter_mut().for_each(|after| after.words = WordsInForce::default());
        self.takes_offset = true;
        self.speed = SpeedWatch::new(self.board.rates);
    }

    fn forget_places(&mut self) {
        for sent in &mut self.moves {
            (sent.way, sent.turn) = (Way::Anywhere, Turn::UNKNOWN);
        }
        // A damaged word of theirs is in force until the next one, and so is a damaged offset.
        self.forget_further();
        (self.least, self.bound) = Default::default();
    }

    fn forget_further(&mut self) {
        self.sent.further = FurtherAxes::NONE;
        self.sent.frame.further = FurtherFrame::default();
        self.shown_further = FurtherAxes::NONE;
        self.parsed.further_offset = FurtherAxes::NONE;
        self.unanswered.iter_mut().for_each(|after| after.further_offset = FurtherAxes::NONE);
    }

    /// The offset in force is not known for sure: the one that is shown next is taken as it is,
    /// and no place is judged before.
    pub fn take_next_offset(&mut self) {
        self.takes_offset = true;
        self.forget_further();
    }

    /// The work offset that reports have shown before the first line.
    pub fn has_shown(&mut self, offset: Option<Position>) {
        self.shown = offset;
    }

    /// Takes a line that is sent now.
    pub fn on_sent(&mut self, text: &str, culprit: Culprit) {
        let asked = self.sent.take(text);
        self.lines_sent += 1;
        let last = self.moves.back().map_or(self.parsed.blocks, |last| last.blocks);
        let mut blocks = last;
        if let Some(way) = asked.way {
            let turn = asked.turn;
            let is_block = way.length_mm() > STEPS_OF_A_BLOCK * self.board.step_mm()
                || turn.moves(&self.board.further_steps, STEPS_OF_A_BLOCK);
            blocks += usize::from(is_block);
            let (number, feed_mm_per_min) = (self.lines_sent, asked.feed_mm_per_min);
            self.moves.push_back(SentMove { way, turn, feed_mm_per_min, culprit, blocks, number });
        }
        let (offset, further_offset) = (self.sent.frame.in_force, self.sent.frame.further.in_force);
        let (words, frame_changes) = (self.sent.said, self.sent.frame_changes);
        let after = After { words, offset, further_offset, frame_changes, blocks };
        self.unanswered.push_back(after);
    }

    /// The oldest line without an answer was answered.
    pub fn on_answer(&mut self) {
        if let Some(after) = self.unanswered.pop_front() {
            self.parsed = after;
        }
        let planner = self.board.planner_blocks.map_or(PLANNER_BLOCKS_UNKNOWN, usize::from);
        let gone = self.finished(planner);
        self.moves.drain(..gone);
        (self.least, self.bound) = (self.least.after(gone), self.bound.after(gone));
    }

    /// The origin of a work system (1 to 9) as the lines have left it, without the shift of G92.
    pub fn stored(&self, system: u8) -> Option<Position> {
        let zero = self.sent.frame.systems.get(usize::from(system).checked_sub(1)?)?;
        let shift = self.sent.frame.shift;
        zero.map(|zero| [0, 1, 2].map(|axis| zero[axis] - shift[axis]))
    }

    /// Judges a report.
    pub fn judge(&mut self, seen: &Seen) -> Option<Deviation> {
        if let Some(shown) = seen.work_offset
            && let Some(deviation) = self.judge_offset(shown)
        {
            return Some(deviation);
        }
        if self.takes_offset {
            return None;
        }
        let before = self.shown_further;
        self.shown_further = seen.further_offset.or(before);
        if let Some(deviation) = self.judge_further_offset(seen.further_offset) {
            return Some(deviation);
        }
        let is_settled = self.parsed.frame_changes == self.sent.frame_changes;
        if is_settled {
            self.adopt_further(seen.further_offset, before);
        }
        let (frame, steps) = (&self.sent.frame.further, &self.board.further_steps);
        let further = match (seen.is_by_offset, is_settled) {
            (false, _) => seen.further,
            (true, true) => frame.as_shown(seen.further, self.shown_further, steps),
            (true, false) => FurtherAxes::NONE,
        };
        let is_placed = !seen.is_by_offset || self.is_offset_shown();
        if let Some(position) = seen.position.filter(|_| is_placed) {
            let blocks = seen.blocks_in_use.filter(|_| self.board.planner_blocks.is_some());
            let index = blocks.map_or(0, |blocks| self.finished(blocks));
            let done = Bound { index, part: 0.0 };
            if let Some(deviation) = self.judge_place(position, further, done) {
                return Some(deviation);
            }
        }
        let feeds = self.moves.iter().map(|sent| sent.feed_mm_per_min);
        let feed = seen.feed_mm_per_min?;
        let allowed = self.speed.judge(feed, seen.feed_override, feeds)?;
        let culprit = self.culprit();
        Some(Deviation::Feed { culprit, feed_mm_per_min: feed, allowed_mm_per_min: allowed })
    }

    /// The line that is under way at the earliest.
    fn culprit(&self) -> Culprit {
        self.moves.get(self.bound.index).map_or(Culprit::default(), |sent| sent.culprit)
    }

    /// All lines are answered, and the machine stands: is it where they end?
    pub fn judge_end(
        &mut self,
        position: Option<Position>,
        further: FurtherAxes,
    ) -> Option<Deviation> {
        let is_known = self.moves.back().is_some_and(|last| last.way != Way::Anywhere);
        let Some(end) = self.sent.place.filter(|_| is_known) else {
            self.stand(position, self.sent.further.or(further));
            return None;
        };
        let at = position?;
        let way = Way::Line { from: end, to: end };
        let off_mm = way.nearest(at, 0.0).distance_mm;
        let culprit = self.moves.back().map_or(Culprit::default(), |last| last.culprit);
        let is_off = off_mm > self.board.tolerance_mm(&way, at);
        if is_off {
            return Some(Deviation::Place { culprit, at, nearest: end, off_mm });
        }
        let stands = Turn::at(self.sent.further);
        if let Some(off) = stands.off(further, [0.0, 1.0], &self.board.further_steps) {
            return Some(Deviation::Further { culprit, off });
        }
        self.stand(Some(end), self.sent.further.or(further));
        None
    }

    /// Judges the words in force, `reported` after `GC:` among the answers.
    pub fn judge_words(&self, reported: &str, units: ReportUnits) -> Option<Deviation> {
        let (is, sent) =
            parser_state::differs(&self.parsed.words, reported, units, self.board.speeds)?;
        let before = self
            .moves
            .iter()
            .rev()
            .find(|sent| sent.number + self.unanswered.len() <= self.lines_sent);
        let culprit = before.or(self.moves.front()).map_or(Culprit::default(), |it| it.culprit);
        Some(Deviation::Words { culprit, is, sent })
    }

    fn judge_offset(&mut self, shown: Position) -> Option<Deviation> {
        self.shown = Some(shown);
        if self.takes_offset {
            // One of the lines that are read meanwhile may have put it in force.
            if !self.is_offset_settled() {
                return None;
            }
            self.takes_offset = false;
            if let Some((place, thought)) = self.sent.place.zip(self.sent.frame.in_force)
                && !self.is_same(thought, shown)
            {
                // What was sent is in that frame.
                let moved = [0, 1, 2].map(|axis| place[axis] + shown[axis] - thought[axis]);
                self.sent.place = Some(moved);
                self.forget_places();
            }
            self.adopt(shown);
            return None;
        }
        let mut candidates = vec![self.parsed.offset];
        candidates.extend(self.unanswered.iter().map(|after| after.offset));
        if self.unanswered.is_empty() && self.parsed.offset.is_none() {
            self.adopt(shown);
            return None;
        }
        if candidates.iter().any(|offset| offset.is_none_or(|it| self.is_same(it, shown))) {
            return None;
        }
        let wanted = candidates.into_iter().flatten().next()?;
        let culprit = self.culprit();
        Some(Deviation::Offset { culprit, shown, wanted })
    }

    /// The offset of each further axis is that after the newest answer, or after a line without one.
    fn judge_further_offset(&self, shown: FurtherAxes) -> Option<Deviation> {
        let after = || std::iter::once(&self.parsed).chain(&self.unanswered);
        shown.iter().find_map(|(axis, shown)| {
            let step = self.board.further_steps[axis];
            let fits = |after: &After| {
                let offset = after.further_offset.get(axis);
                offset.is_none_or(|offset| further::is_same_offset(axis, offset, shown, step))
            };
            let wanted = self.parsed.further_offset.get(axis).filter(|_| !after().any(fits))?;
            Some(Deviation::FurtherOffset { culprit: self.culprit(), axis, shown, wanted })
        })
    }

    /// No line without an answer changes them. One report may be damaged: of offsets that are not known
    /// what two in a row show is taken.
    fn adopt_further(&mut self, shown: FurtherAxes, before: FurtherAxes) {
        self.sent.frame.further.adopt(shown, before);
        let in_force = self.sent.frame.further.in_force;
        self.parsed.further_offset = in_force;
        self.unanswered.iter_mut().for_each(|after| after.further_offset = in_force);
    }

    fn adopt(&mut self, offset: Position) {
        self.sent.frame.adopt(offset);
        self.parsed.offset = Some(offset);
        self.unanswered.iter_mut().for_each(|after| after.offset = Some(offset));
    }

    /// No line without an answer changes the offset.
    fn is_offset_settled(&self) -> bool {
        self.unanswered.iter().all(|after| after.offset == self.parsed.offset)
    }

    /// The offset in force is the one that was shown.
    fn is_offset_shown(&self) -> bool {
        let both = self.parsed.offset.zip(self.shown);
        self.is_offset_settled() && both.is_some_and(|(is, shown)| self.is_same(is, shown))
    }

    fn is_same(&self, one: Position, other: Position) -> bool {
        let most = self.board.rounding_mm() + PATH_MM;
        (0..3).all(|axis| (one[axis] - other[axis]).abs() <= most)
    }

    /// One report may be wrong and lie ahead on the path, where it fits; then a later sound one does
    /// not. So the bound without any one of the reports is kept too.
    fn judge_place(
        &mut self,
        position: Position,
        further: FurtherAxes,
        done: Bound,
    ) -> Option<Deviation> {
        let without = self.find(position, further, self.least.later(done));
        match (self.find(position, further, self.bound.later(done)), without) {
            (Ok(found), without) => {
                // Without this one it would be where it was.
                self.least = without.map_or(self.bound, |least| least.earlier(self.bound));
                self.bound = found;
            }
            (Err(_), Ok(without)) => self.bound = without,
            (Err(misfit), Err(_)) => return misfit,
        }
        let gone = self.least.index;
        self.moves.drain(..gone);
        (self.least, self.bound) = (self.least.after(gone), self.bound.after(gone));
        None
    }

    /// Where the tool is at the earliest, not before a bound; or how far it is off.
    fn find(
        &self,
        position: Position,
        further: FurtherAxes,
        from: Bound,
    ) -> Result<Bound, Option<Deviation>> {
        let mut best: Option<(usize, Nearest)> = None;
        // The first line that fits but for a further axis.
        let mut turned: Option<(usize, Off)> = None;
        for (index, sent) in self.moves.iter().enumerate().skip(from.index) {
            let from_part = if index == from.index { from.part } else { 0.0 };
            let near = sent.way.nearest(position, from_part);
            let tolerance = self.board.tolerance_mm(&sent.way, position);
            if near.distance_mm <= tolerance {
                let length = sent.way.length_mm();
                let slack = if length > 0.0 { tolerance / length } else { 1.0 };
                let parts = match sent.way {
                    Way::Line { .. } => [near.part - slack, near.part + slack],
                    Way::Arc(_) | Way::Anywhere => [0.0, 1.0],
                };
                match sent.turn.off(further, parts, &self.board.further_steps) {
                    None => return Ok(Bound { index, part: (near.part - slack).max(from_part) }),
                    Some(off) => turned = turned.or(Some((index, off))),
                }
            }
            let is_next = best.is_none_or(|(of, least)| {
                // Of two that meet there the later one is cut. Farther on the path may come by again.
                let meets = index == of + 1 && self.moves[of].way.rest_mm(least.part) <= SAME_MM;
                let nearer_by = if meets { -SAME_MM } else { SAME_MM };
                near.distance_mm + nearer_by < least.distance_mm
            });
            if is_next {
                best = Some((index, near));
            }
        }
        if let Some((index, off)) = turned {
            return Err(Some(Deviation::Further { culprit: self.moves[index].culprit, off }));
        }
        let deviation = best.map(|(index, near)| {
            let Nearest { distance_mm: off_mm, place: nearest, .. } = near;
            let culprit = self.moves[index].culprit;
            Deviation::Place { culprit, at: position, nearest, off_mm }
        });
        Err(deviation)
    }

    /// How many lines are done for sure when so many blocks, and those that are at the steps, were
    /// answered after them.
    fn finished(&self, blocks: usize) -> usize {
        let held = blocks + BLOCKS_AT_THE_STEPS;
        let most = self.moves.len() - 1;
        let done = |sent: &&SentMove| sent.blocks + held < self.parsed.blocks;
        self.moves.iter().take(most).take_while(done).count()
    }
}
