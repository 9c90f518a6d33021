//! G73, G74, G81 to G86, G88 and G89: drilling, boring and tapping cycles, written out as moves.
//!
//! As LinuxCNC does them, in each plane: R and the bottom are along the axis across the plane.
//! Words stay in force while the same cycle is on. No cycle reaches a controller.

use super::{FeedMode, Interpreter, Scene};
use crate::dialect::{Distance, Group};
use crate::limits::{
    COORDINATE_MM_MAX, CYCLE_MOVES_MAX, DWELL_SECONDS_MAX, DWELL_SECONDS_SUSPICIOUS,
    PECK_CLEARANCE_MM, STEP_LEFT_MM,
};
use crate::no_effect::RETRACT_TO_R;
use cnc_msgs::contour::{Action, MotionClass, SpindleMode};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet, Position, Shape};

/// What a cycle does in a hole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Cycle {
    /// G73: steps of Q, each with a short retract.
    ChipBreak,
    /// G74, G84: feeds in and out with the spindle reversed, in a floating chuck.
    Tap { left_hand: bool },
    /// G81.
    Drill,
    /// G82: waits at the bottom.
    DrillAndDwell,
    /// G83: steps of Q, each with a retract to R.
    Peck,
    /// G85: feeds out.
    Bore,
    /// G86: waits, and comes out with the spindle stopped.
    BoreAndStop,
    /// G88: waits, stops the spindle and the program, and comes out.
    BoreAndWait,
    /// G89: waits, and feeds out.
    BoreAndDwell,
}

impl Cycle {
    /// Its G number.
    pub(crate) const fn number(self) -> u16 {
        match self {
            Self::ChipBreak => 73,
            Self::Tap { left_hand: true } => 74,
            Self::Drill => 81,
            Self::DrillAndDwell => 82,
            Self::Peck => 83,
            Self::Tap { left_hand: false } => 84,
            Self::Bore => 85,
            Self::BoreAndStop => 86,
            Self::BoreAndWait => 88,
            Self::BoreAndDwell => 89,
        }
    }

    /// The letter of the word that it needs besides R and the bottom, if any.
    const fn needs(self) -> Option<u8> {
        match self {
            Self::ChipBreak | Self::Peck => Some(b'Q'),
            Self::DrillAndDwell | Self::BoreAndStop | Self::BoreAndWait | Self::BoreAndDwell => {
                Some(b'P')
            }
            Self::Tap { .. } | Self::Drill | Self::Bore => None,
        }
    }

    const fn can_dwell(self) -> bool {
        matches!(
            self,
            Self::DrillAndDwell
                | Self::BoreAndStop
                | Self::BoreAndWait
                | Self::BoreAndDwell
                | Self::Tap { .. }
        )
    }
}

/// The words of a cycle that stay in force, and where the first one began.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct CycleWords {
    /// The cycle of the block before, if that was one.
    last: Option<Cycle>,
    /// As programmed, mm.
    r: f64,
    bottom: f64,
    step: f64,
    dwell: f64,
    /// Where the axis across the plane was before the first of a row of cycles.
    pub(super) initial: Option<f64>,
    /// G99; else G98.
    pub(super) returns_to_r: bool,
}

/// One cycle, ready to be written out. Heights are along the axis across the plane.
struct Plan {
    cycle: Cycle,
    r: f64,
    bottom: f64,
    /// Where each hole ends.
    clear: f64,
    step: f64,
    dwell: f64,
}

impl Interpreter<'_> {
    /// Ends a row of cycles: another motion is in force.
    #[inline]
    pub(super) fn end_cycles(&mut self) {
        self.modal.cycle.last = None;
        self.modal.cycle.initial = None;
    }

    /// A block with axis words while a cycle is in force.
    #[cold]
    pub(super) fn cycle(&mut self, scene: &mut Scene<'_>, cycle: Cycle) {
        let [first, second, across] = self.modal.plane.axes();
        let letter = AXIS_LETTERS[across];
        let is_first = self.modal.cycle.last != Some(cycle);
        let is_relative = self.modal.distance == Distance::Incremental;
        if self.refuses_cycle(scene, cycle) {
            let end = self.end(scene);
            let _ = (self.take(b'R'), self.take(b'P'), self.take(b'Q'), self.take(b'L'));
            self.axes.poison(end.named.union(AxisSet::NONE.with(across)));
            return;
        }
        let start = self.axes.position;
        let scale = self.scale();
        let end = self.end(scene);
        let mut words = self.modal.cycle;
        let has = |interpreter: &mut Self, scene: &mut Scene<'_>, word: u8| {
            interpreter.take_within(scene, word, scale, COORDINATE_MM_MAX, "mm")
        };
        let r = has(self, scene, b'R');
        let step = match cycle.needs() {
            Some(b'Q') => has(self, scene, b'Q'),
            _ => {
                self.refuse_step(scene, cycle);
                None
            }
        };
        let dwell = match cycle.can_dwell() {
            true => self.take_within(scene, b'P', 1.0, DWELL_SECONDS_MAX, "s"),
            false => None,
        };
        let repeats = self.take_number(scene, b'L');
        let shift = self.modal.shift[across];
        let height = end.named.contains(across).then(|| {
            let base = if is_relative { start[across] } else { shift };
            end.position[across] - base
        });
        for (word, value) in [('R', r), (letter, height)] {
            if value.is_none() && is_first {
                let number = cycle.number();
                let message = format!("G{number} without {word}");
                let help = match word {
                    'R' => format!("write R with the {letter} from which the tool feeds"),
                    _ => format!("write {letter} with the bottom of the hole"),
                };
                self.report_block(scene, Code::MissingWord, message, &help);
            }
        }
        let needed = cycle.needs().filter(|_| is_first);
        if let Some(word) = needed.filter(|&word| !self.request.present.contains(word)) {
            let word = char::from(word);
            let message = format!("G{} without {word}", cycle.number());
            let help = match word {
                'Q' => "write Q with the depth of a step",
                _ => "write P with the seconds at the bottom",
            };
            self.report_block(scene, Code::MissingWord, message, help);
        }
        if dwell.is_some_and(|seconds| seconds >= DWELL_SECONDS_SUSPICIOUS) {
            self.long_dwell(scene, b'P', dwell.unwrap_or_default());
        }
        for (letter, value) in [(b'P', dwell), (b'Q', step)] {
            let is_wrong = if letter == b'P' { value < Some(0.0) } else { value <= Some(0.0) };
            if value.is_some_and(|value| !value.is_nan()) && is_wrong {
                self.negative(scene, letter);
            }
        }
        if repeats == Some(0) {
            let help = "write L with at least 1, or delete the block";
            self.report(scene, b'L', Code::BadNumber, "L0 repeats nothing".to_owned(), help);
        }
        words.r = r.unwrap_or(words.r);
        words.bottom = height.unwrap_or(words.bottom);
        words.step = step.unwrap_or(words.step);
        words.dwell = dwell.unwrap_or(words.dwell);
        let initial = *words.initial.get_or_insert(start[across]);
        let r = if is_relative { initial + words.r } else { words.r + shift };
        let bottom = if is_relative { r + words.bottom } else { words.bottom + shift };
        if !self.request.is_damaged && r < bottom {
            self.below(scene, letter, r - shift, bottom - shift);
        }
        let in_plane = AxisSet::NONE.with(first).with(second);
        let unnamed =
            in_plane.without(end.named).union(end.relative).union(AxisSet::NONE.with(across));
        let is_sound = self.relies(scene, unnamed) & self.has_feed(scene, MotionClass::Feed);
        words.last = Some(cycle);
        self.modal.cycle = words;
        self.has_returned.set(true);
        if self.request.is_damaged || !is_sound {
            self.axes.poison(end.named.union(AxisSet::NONE.with(across)));
            return;
        }
        let top = initial.max(r);
        let clear = if words.returns_to_r { r } else { top };
        let plan = Plan { cycle, r, bottom, clear, step: words.step, dwell: words.dwell };
        let increment = match is_relative {
            true => [end.position[first] - start[first], end.position[second] - start[second]],
            false => [0.0; 2],
        };
        let count = f64::from(repeats.unwrap_or(1));
        let steps = if cycle.needs() == Some(b'Q') { (r - bottom) / words.step } else { 1.0 };
        let moves = count * (3.0 * steps + 6.0);
        if moves.is_nan() || moves > CYCLE_MOVES_MAX || self.is_too_long_with(0) {
            let message =
                format!("the cycle takes {moves:.0} moves; at most {CYCLE_MOVES_MAX} are accepted");
            let help = "look for a missing digit in Q or L";
            self.axes.poison(AxisSet::ALL);
            return self.report_block(scene, Code::Limit, message, help);
        }
        let mut hole = start;
        if !is_relative {
            (hole[first], hole[second]) = (end.position[first], end.position[second]);
        }
        if initial < r {
            self.go(MotionClass::Rapid, start, across, r);
        }
        for repeat in 0..repeats.unwrap_or(1) {
            match self.next_polar(hole).filter(|_| is_relative && repeat > 0) {
                Some(next) => hole = next,
                None => {
                    hole[first] += increment[0];
                    hole[second] += increment[1];
                }
            }
            if let Some(axis) = [first, second].into_iter().find(|&axis| is_beyond(hole[axis])) {
                self.axes.poison(AxisSet::ALL);
                return self.report_beyond(scene, axis, hole);
            }
            let above = match repeat {
                0 if self.axes.position[across] > r => self.axes.position[across],
                _ => clear,
            };
            // To the hole also where the last known position is the same.
            let absolute = end.named.without(end.relative).without(AxisSet::NONE.with(across));
            let named = if repeat == 0 { self.axes.doubtful() } else { AxisSet::NONE };
            let named = AxisSet::from_bits(named.bits() & absolute.bits());
            self.go_naming(MotionClass::Rapid, hole, across, above, named);
            self.go(MotionClass::Rapid, hole, across, r);
            self.hole(&plan, hole);
        }
        self.axes.know(end.named.without(end.relative).union(AxisSet::NONE.with(across)));
    }

    /// Reports a hole of a repeated cycle that cannot be.
    #[cold]
    fn report_beyond(&mut self, scene: &mut Scene<'_>, axis: usize, hole: Position) {
        if hole[axis].is_nan() {
            let message = "the cycle comes to the zero, where there is no angle".to_owned();
            let help = "write a smaller L, or a block for each hole";
            return self.report_block(scene, Code::Axes, message, help);
        }
        let message = format!("{} leads beyond {COORDINATE_MM_MAX} mm", AXIS_LETTERS[axis]);
        let help = "look for an incremental move that should be absolute";
        self.report_block(scene, Code::Limit, message, help);
    }

    /// Reports a cycle without a place.
    #[cold]
    pub(super) fn cycle_without_axes(&mut self, scene: &mut Scene<'_>, cycle: Cycle, at: usize) {
        let _ = (self.take(b'R'), self.take(b'P'), self.take(b'Q'), self.take(b'L'));
        if !self.request.has_refused_word {
            let message = format!("G{} without X, Y or Z", cycle.number());
            let help = "write the place of the first hole into this block";
            self.report_at(scene, at, Code::MissingWord, message, help);
        }
    }

    /// Whether compensation is on, under which no cycle stands, which is reported.
    pub(super) fn refuses_compensation(&mut self, scene: &mut Scene<'_>, word: &str) -> bool {
        let on = scene.under_compensation.or(self.modal.compensation.selected_at());
        let Some(since) = on else { return false };
        let message = format!(
            "{word} must not stand under cutter radius compensation, which is on since line {}",
            since.line
        );
        let help = "cancel with G40 and a straight move before the cycle";
        self.request.is_damaged = true;
        let mut finding =
            Finding::error(Code::ForbiddenUnderCompensation, self.source, message).help(help);
        finding.other = Some(since);
        scene.findings.push(finding);
        true
    }

    /// Whether the block must not be a cycle, which is reported.
    fn refuses_cycle(&mut self, scene: &mut Scene<'_>, cycle: Cycle) -> bool {
        let number = cycle.number();
        if self.refuses_compensation(scene, &format!("G{number}")) {
            return true;
        }
        if self.modal.feed_mode == FeedMode::InverseTime {
            let message = format!("G{number} under inverse time feed (G93)");
            let help = "write G94 and F with mm/min before the cycle";
            self.report_block(scene, Code::ModalConflict, message, help);
            return true;
        }
        let is_turning = self.modal.spindle != SpindleMode::Off;
        let wanted = match cycle {
            Cycle::Tap { left_hand: false } => self.modal.spindle == SpindleMode::Clockwise,
            Cycle::Tap { left_hand: true } => self.modal.spindle == SpindleMode::CounterClockwise,
            Cycle::BoreAndStop | Cycle::BoreAndWait => is_turning,
            _ => true,
        };
        if !wanted {
            let start = match cycle {
                Cycle::Tap { left_hand: false } => "M3",
                Cycle::Tap { left_hand: true } => "M4",
                _ => "M3 or M4",
            };
            let message = format!("G{number} needs a spindle that turns: {start} is not in force");
            let help = format!("write {start} with S before the cycle");
            self.report_block(scene, Code::MissingWord, message, &help);
        }
        !wanted
    }

    /// Q in a cycle that goes down in one step.
    fn refuse_step(&mut self, scene: &mut Scene<'_>, cycle: Cycle) {
        if self.take(b'Q').is_some() {
            let quote = scene.quote(self.request.word(b'Q'));
            let message =
                format!("G{} goes down in one step: nothing uses {quote}", cycle.number());
            let help = "write G83 or G73 to drill in steps of Q, or delete Q";
            self.report(scene, b'Q', Code::Syntax, message, help);
        }
    }

    #[cold]
    fn below(&mut self, scene: &mut Scene<'_>, letter: char, r: f64, bottom: f64) {
        let scale = self.scale();
        let (r, bottom) = (r / scale, bottom / scale);
        let message = format!("the cycle feeds from R = {letter}{r} up to {letter}{bottom}");
        let help =
            format!("R is the height from which the tool feeds down: write it above {letter}");
        self.report_block(scene, Code::BadNumber, message, &help);
    }

    /// Drills one hole.
    fn hole(&mut self, plan: &Plan, hole: Position) {
        let across = self.modal.plane.axes()[2];
        let (feed, rapid) = (MotionClass::Feed, MotionClass::Rapid);
        match plan.cycle {
            Cycle::Drill | Cycle::DrillAndDwell => {
                self.go(feed, hole, across, plan.bottom);
                if plan.cycle == Cycle::DrillAndDwell {
                    self.act(Action::Dwell { seconds: plan.dwell });
                }
                self.go(rapid, hole, across, plan.clear);
            }
            Cycle::ChipBreak | Cycle::Peck => {
                let mut depth = plan.r - plan.step;
                while depth > plan.bottom + STEP_LEFT_MM {
                    self.go(feed, hole, across, depth);
                    if plan.cycle == Cycle::Peck {
                        self.go(rapid, hole, across, plan.r);
                    }
                    self.go(rapid, hole, across, depth + PECK_CLEARANCE_MM);
                    depth -= plan.step;
                }
                self.go(feed, hole, across, plan.bottom);
                self.go(rapid, hole, across, plan.clear);
            }
            Cycle::Tap { .. } => {
                let turning = self.modal.spindle;
                let back = match turning {
                    SpindleMode::Clockwise => SpindleMode::CounterClockwise,
                    _ => SpindleMode::Clockwise,
                };
                self.go(feed, hole, across, plan.bottom);
                self.act(Action::Spindle(SpindleMode::Off));
                self.act(Action::Spindle(back));
                if plan.dwell > 0.0 {
                    self.act(Action::Dwell { seconds: plan.dwell });
                }
                self.go(feed, hole, across, plan.clear);
                self.act(Action::Spindle(SpindleMode::Off));
                self.act(Action::Spindle(turning));
            }
            Cycle::Bore => {
                self.go(feed, hole, across, plan.bottom);
                self.go(feed, hole, across, plan.r);
                self.go(rapid, hole, across, plan.clear);
            }
            Cycle::BoreAndStop => {
                let turning = self.modal.spindle;
                self.go(feed, hole, across, plan.bottom);
                self.act(Action::Dwell { seconds: plan.dwell });
                self.act(Action::Spindle(SpindleMode::Off));
                self.go(rapid, hole, across, plan.clear);
                self.act(Action::Spindle(turning));
            }
            Cycle::BoreAndWait => {
                let turning = self.modal.spindle;
                self.go(feed, hole, across, plan.bottom);
                self.act(Action::Dwell { seconds: plan.dwell });
                self.act(Action::Spindle(SpindleMode::Off));
                self.act(Action::Stop { optional: false });
                self.act(Action::Spindle(turning));
                self.go(rapid, hole, across, plan.clear);
            }
            Cycle::BoreAndDwell => {
                self.go(feed, hole, across, plan.bottom);
                self.act(Action::Dwell { seconds: plan.dwell });
                self.go(feed, hole, across, plan.clear);
            }
        }
    }

    /// Moves to a hole at this height; nothing if the tool is there.
    fn go(&mut self, class: MotionClass, hole: Position, across: usize, height: f64) {
        self.go_naming(class, hole, across, height, AxisSet::NONE);
    }

    /// The same; the move names these axes in any case.
    fn go_naming(
        &mut self,
        class: MotionClass,
        hole: Position,
        across: usize,
        height: f64,
        named: AxisSet,
    ) {
        let mut end = hole;
        end[across] = height;
        self.move_to(class, end, named);
    }

    /// Moves to a place; nothing if the tool is there and no axis is named.
    pub(super) fn move_to(&mut self, class: MotionClass, end: Position, named: AxisSet) {
        let from = self.axes.position;
        let moves = (0..3).filter(|&axis| end[axis] != from[axis]);
        let axes = moves.fold(named, AxisSet::with);
        if axes.is_empty() {
            return;
        }
        self.axes.position = end;
        self.feed_at_surface(class, from, end, None);
        self.add_to_bounds(from, Shape::Line, end, axes);
        self.emit_motion(Shape::Line, end, class, axes);
    }
}

/// Whether a coordinate is no place for a hole, mm.
fn is_beyond(at: f64) -> bool {
    at.is_nan() || at.abs() > COORDINATE_MM_MAX
}

impl Interpreter<'_> {
    /// G98 and G99.
    #[inline]
    pub(super) fn retract_mode(&mut self, scene: &Scene<'_>) {
        if let Some((crate::dialect::GWord::Retract { to_r }, at)) = self.request.g(Group::Retract)
        {
            self.modal.cycle.returns_to_r = to_r;
            if to_r {
                self.has_no_effect(scene, at, RETRACT_TO_R);
            }
        }
    }
}
