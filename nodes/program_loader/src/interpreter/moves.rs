//! Axis words: which command uses them, straight moves, and the position afterwards.
//!
//! A move with an error is not emitted, but the axes that it names absolutely are known
//! afterwards.

use super::axes::{Cause, Reliance};
use super::{Interpreter, Scene};
use crate::block::Word;
use crate::dialect::{Distance, FeedMode, GWord, Group, Letters, Mode, Spline};
use crate::limits::{COORDINATE_MM_MAX, STAYS_MM};
use cnc_msgs::contour::{Action, ContourEventKind, Motion, MotionClass};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet, Position, Shape};

/// The words of the axes, and of the centre of an arc along each.
pub(super) const AXIS_WORDS: [u8; 3] = [b'X', b'Y', b'Z'];
pub(super) const CENTER_WORDS: [u8; 3] = [b'I', b'J', b'K'];

/// The end of a move.
pub(super) struct End {
    pub(super) position: Position,
    /// Axes that the block names.
    pub(super) named: AxisSet,
    /// Unnamed axes whose position the move relies on.
    pub(super) relative: AxisSet,
}

impl Interpreter<'_> {
    #[inline]
    pub(super) fn motion(&mut self, scene: &mut Scene<'_>) {
        let word = self.request.g(Group::Motion);
        self.begin_further();
        if self.request.polar != [None; 2] {
            self.polar_words(scene, self.request.polar);
        }
        if self.open_curve.is_some() {
            self.check_open_curve(scene);
        }
        if self.request.g(Group::CycleCancel).is_some() {
            // It ends a cycle that was rejected: the moves after it are unknown, too.
            self.modal.mode = None;
            self.end_cycles();
        }
        if let Some((GWord::LatheCycle(cycle), at)) = word {
            self.end_cycles();
            self.last_cubic = None;
            if self.has_further() {
                let _ = self.further_motion(scene, true);
            }
            return self.lathe_cycle(scene, cycle, at);
        }
        match word {
            Some((GWord::Motion(mode), _)) => {
                if !matches!(mode, Mode::Cycle(_)) {
                    self.end_cycles();
                }
                if mode != Mode::Spline(Spline::Cubic) {
                    self.last_cubic = None;
                }
                self.modal.mode = Some(mode);
                self.modal.mode_is_poisoned = false;
            }
            Some(_) => self.modal.mode_is_poisoned = true,
            None => {}
        }
        if let Some((GWord::Dwell, _)) = self.request.g(Group::NonModal)
            && self.rules.dialect.dwell.contains(b'X')
        {
            // X may be the time of a dwell: such a block does not move.
            return;
        }
        let has_axes = AXIS_WORDS.iter().any(|&letter| self.request.present.contains(letter));
        if let Some((GWord::FreePlane, _)) = self.request.g(Group::Plane) {
            return;
        }
        if let Some((GWord::SetAxes | GWord::RoundingAxes | GWord::Home, _)) =
            self.request.g(Group::NonModal)
        {
            // The block only names axes.
            return;
        }
        if self.only_sets_offsets() {
            return;
        }
        if let Some((GWord::Reference { second }, at)) = self.request.g(Group::NonModal) {
            return self.reference(scene, second, at);
        }
        if let Some((_, at)) = self.request.g(Group::MachineCoordinates) {
            return self.machine_move(scene, at);
        }
        if let Some(Mode::Spline(spline)) = self.modal.mode
            && (word.is_some() || has_axes || self.has_further())
        {
            if self.has_further() {
                let _ = self.further_motion(scene, true);
            }
            return self.spline(scene, spline);
        }
        let is_arc = matches!(self.modal.mode, Some(Mode::Arc { .. }));
        let has_circle = is_arc && self.asks_for_circle(word.is_some());
        const POLAR: Letters = Letters::of(b"ABU");
        let is_polar = matches!(self.modal.mode, Some(Mode::Polar { .. }));
        let has_polar = is_polar && !self.request.present.intersection(POLAR).is_empty();
        let from = self.further_position();
        if self.has_further() && !self.further_motion(scene, has_axes || has_circle) {
            return;
        }
        if !has_axes && !has_circle && !has_polar {
            match word {
                Some((GWord::Motion(Mode::Cycle(cycle)), at)) => {
                    self.cycle_without_axes(scene, cycle, at);
                }
                Some((GWord::Motion(Mode::Probe(_)), at)) => self.probe_without_axes(scene, at),
                Some((GWord::Motion(Mode::Thread | Mode::ThreadCycle), at)) => {
                    self.thread_without_axes(scene, at);
                }
                _ => {}
            }
            return;
        }
        if self.modal.mode_is_poisoned {
            return self.skip_move(scene);
        }
        if !matches!(self.modal.mode, None | Some(Mode::Rapid | Mode::Polar { rapid: true })) {
            self.lost_compensation(scene);
        }
        match self.modal.mode {
            None if self.request.is_damaged => {
                // The rejected word may have been the motion.
                self.modal.mode_is_poisoned = true;
                self.skip_move(scene);
            }
            None => {
                self.modal.mode_is_poisoned = true;
                self.report_block(
                    scene,
                    Code::MissingWord,
                    "axis words, but neither G0, G1, G2 nor G3 is in force".to_owned(),
                    "write G0 or G1 into this block",
                );
                self.skip_move(scene);
            }
            Some(Mode::Rapid) => self.straight(scene, MotionClass::Rapid, from),
            Some(Mode::Feed) => self.straight(scene, MotionClass::Feed, from),
            Some(Mode::Arc { clockwise }) => self.arc(scene, clockwise),
            Some(Mode::Cycle(cycle)) => self.cycle(scene, cycle),
            Some(Mode::Probe(probe)) => self.probe(scene, probe),
            Some(Mode::Thread) => self.thread(scene),
            Some(Mode::ThreadCycle) => self.thread_cycle(scene),
            // They have been followed above.
            Some(Mode::Spline(_)) => {}
            Some(Mode::Polar { rapid }) => {
                self.polar(scene, if rapid { MotionClass::Rapid } else { MotionClass::Feed });
            }
        }
    }

    /// Takes the axes that a block only names, as indices in the order of its words.
    pub(super) fn take_axis_names(&mut self, scene: &Scene<'_>) -> Vec<usize> {
        for letter in AXIS_WORDS {
            let _ = self.take(letter);
        }
        let axis = |word: &Word| AXIS_WORDS.iter().position(|&letter| letter == word.letter);
        scene.block.words.iter().filter_map(axis).collect()
    }

    /// Whether a block without axis words is an arc: `G2 I5`, or a bare `G2`.
    fn asks_for_circle(&self, has_motion_word: bool) -> bool {
        let has = |letter| self.request.present.contains(letter);
        CENTER_WORDS.iter().any(|&letter| has(letter)) || has_motion_word
    }

    /// Reads the axis words. Values that could not be read are NaN.
    #[inline]
    pub(super) fn end(&mut self, scene: &mut Scene<'_>) -> End {
        let is_relative = self.modal.distance == Distance::Incremental;
        let mut end =
            End { position: self.axes.position, named: AxisSet::NONE, relative: AxisSet::NONE };
        for (axis, letter) in AXIS_WORDS.into_iter().enumerate() {
            let scale = self.scale_of(axis);
            if let Some(value) = self.take_within(scene, letter, scale, COORDINATE_MM_MAX, "mm") {
                let base =
                    if is_relative { self.axes.position[axis] } else { self.modal.shift[axis] };
                end.position[axis] = base + value;
                end.named = end.named.with(axis);
                if end.position[axis].abs() > COORDINATE_MM_MAX {
                    self.report_end(scene, axis);
                }
            }
        }
        if is_relative {
            end.relative = end.named;
        }
        end
    }

    /// Millimetres of one unit of an axis word; a diameter counts half.
    #[inline]
    pub(super) fn scale_of(&self, axis: usize) -> f64 {
        let is_diameter = axis == 0 && self.modal.x_is_diameter;
        if is_diameter { self.scale() / 2.0 } else { self.scale() }
    }

    #[cold]
    fn report_end(&mut self, scene: &mut Scene<'_>, axis: usize) {
        if self.axes.rely_on(AxisSet::NONE.with(axis)) != Reliance::Poisoned {
            let message = format!("{} leads beyond {COORDINATE_MM_MAX} mm", AXIS_LETTERS[axis]);
            let help = "look for an incremental move that should be absolute";
            self.report(scene, AXIS_WORDS[axis], Code::Limit, message, help);
        }
    }

    #[inline]
    fn straight(&mut self, scene: &mut Scene<'_>, class: MotionClass, further_from: FurtherAxes) {
        let end = self.turned_end(scene);
        let mut relied = end.relative.union(self.relied_by_compensation(end.named));
        let turns_at_feed = class == MotionClass::Feed && self.has_further_along();
        if turns_at_feed {
            // How far X, Y and Z go decides how fast the other axes turn.
            relied = relied.union(end.named);
        }
        let by_so_much = match self.modal.compensation.is_selected() || self.has_further_along() {
            true => AxisSet::NONE,
            false => self.by_so_much(&end),
        };
        if class == MotionClass::Feed && self.modal.feed_mode == FeedMode::InverseTime {
            // How far it goes decides how fast.
            relied = relied.union(end.named);
        }
        let is_sound = self.relies(scene, relied.without(by_so_much)) & self.has_feed(scene, class);
        let from = self.axes.position;
        if self.arrive(&end) && is_sound {
            self.act_relative(by_so_much);
            let stays = (0..3).all(|axis| (from[axis] - end.position[axis]).abs() < STAYS_MM);
            if turns_at_feed && stays {
                return self.further_without_motion(scene, further_from);
            }
            self.feed_of_length(class, || distance(from, end.position));
            self.feed_at_surface(class, from, end.position, None);
            self.add_to_bounds(from, Shape::Line, end.position, self.placed(&end));
            self.emit_motion(Shape::Line, end.position, class, end.named);
        }
    }

    /// The axes of a move whose end in the work frame is known, as far as the way of a probe says it.
    #[inline]
    pub(super) fn placed(&self, end: &End) -> AxisSet {
        let moved = self.by_so_much(end);
        end.named.without(moved.without(self.axes.drifting(moved)))
    }

    /// The axes that the move takes by so much from wherever they are.
    #[inline]
    pub(super) fn by_so_much(&self, end: &End) -> AxisSet {
        match self.modal.distance {
            Distance::Incremental => self.axes.movable(end.relative),
            Distance::Absolute => AxisSet::NONE,
        }
    }

    /// The motion of the block moves these axes by so much.
    #[inline]
    pub(super) fn act_relative(&mut self, axes: AxisSet) {
        if !axes.is_empty() {
            self.act(Action::Relative { axes });
        }
    }

    /// Extends the bounds by a move.
    #[inline]
    pub(super) fn add_to_bounds(
        &mut self,
        start: Position,
        shape: Shape,
        end: Position,
        axes: AxisSet,
    ) {
        if let Shape::Arc(arc) = &self.shape_out(shape) {
            self.bounds.add_arc(self.out(start), self.out(end), arc);
        }
        self.bounds.add_end(self.out(end), self.turned_axes(axes));
    }

    #[inline]
    pub(super) fn emit_motion(
        &mut self,
        shape: Shape,
        end: Position,
        class: MotionClass,
        axes: AxisSet,
    ) {
        let feed_mm_per_min = match class {
            MotionClass::Feed => {
                self.modal.emitted_feed_mm_per_min = self.modal.feed_mm_per_min;
                self.modal.feed_mm_per_min
            }
            // The corner before a compensated rapid may be an arc, which needs a feed.
            _ if self.modal.compensation.was_selected() && !self.has_emitted_feed() => {
                self.modal.feed_mm_per_min
            }
            _ => 0.0,
        };
        self.further_along();
        self.moves_in_system();
        let (shape, end, axes) = (self.shape_out(shape), self.out(end), self.turned_axes(axes));
        self.emit(ContourEventKind::Motion(Motion { shape, end, class, feed_mm_per_min, axes }));
    }

    /// Whether a motion at the feed in force has been emitted.
    fn has_emitted_feed(&self) -> bool {
        self.modal.feed_mm_per_min == self.modal.emitted_feed_mm_per_min
    }

    /// Skips a move whose command was rejected; the axes that it names absolutely are known.
    #[cold]
    fn skip_move(&mut self, scene: &mut Scene<'_>) {
        let end = self.end(scene);
        self.request.has_refused_word = true;
        self.axes.poison(end.relative);
        self.request.is_damaged = true;
        self.arrive(&end);
    }

    /// Sets the position to the end of a move; returns whether the block may move.
    #[inline]
    pub(super) fn arrive(&mut self, end: &End) -> bool {
        let absolute = end.named.without(end.relative);
        if !self.request.is_damaged {
            self.axes.position = end.position;
            self.axes.know(absolute);
            return true;
        }
        for axis in (0..3).filter(|&axis| end.named.contains(axis)) {
            if absolute.contains(axis) && end.position[axis].is_finite() {
                self.axes.position[axis] = end.position[axis];
                self.axes.know(AxisSet::NONE.with(axis));
            } else {
                self.axes.poison(AxisSet::NONE.with(axis));
            }
        }
        false
    }

    /// The axes that compensation relies on: both of the plane, because the planner offsets them.
    #[inline]
    fn relied_by_compensation(&self, named: AxisSet) -> AxisSet {
        if !self.modal.compensation.is_selected() {
            return AxisSet::NONE;
        }
        let [first, second, _] = self.modal.plane.axes();
        if named.contains(first) || named.contains(second) {
            AxisSet::NONE.with(first).with(second)
        } else {
            AxisSet::NONE
        }
    }

    /// Whether a motion may rely on the position of some axes; reports the first that is unknown.
    #[inline]
    pub(super) fn relies(&mut self, scene: &mut Scene<'_>, axes: AxisSet) -> bool {
        match self.axes.rely_on(self.turned_axes(axes)) {
            Reliance::Known => true,
            Reliance::Assumed(assumed) => {
                self.contour.assumed_axes = self.contour.assumed_axes.union(assumed);
                self.axes.know(assumed);
                true
            }
            Reliance::Poisoned => false,
            Reliance::Unknown(unknown) => {
                if !self.asks_for_stretch(scene, unknown) {
                    self.report_unknown_axes(scene, unknown);
                }
                false
            }
        }
    }

    #[cold]
    fn report_unknown_axes(&mut self, scene: &mut Scene<'_>, unknown: AxisSet) {
        let axis = (0..3).find(|&axis| unknown.contains(axis)).unwrap_or(0);
        let Cause { source, word } = self.axes.cause(axis);
        let letters: Vec<String> = unknown.letters().chars().map(String::from).collect();
        let (named, zeroed) = (letters.join(" and "), letters.join("0 "));
        let verb = if letters.len() == 1 { "is" } else { "are" };
        let message = format!(
            "this block starts from where {named} {verb}, which is not known since {word} in line {}",
            source.line
        );
        let help = match word.starts_with("G38") {
            true => format!(
                "move {named} with G90 and G0 or G1 before it; to count from where the probe touched, write G10 L20 P0 {zeroed}0 after the probe"
            ),
            false => format!("move {named} with G90 and G0 or G1 before it"),
        };
        let mut finding = Finding::error(Code::Axes, self.source, message).help(help);
        finding.other = Some(source);
        scene.findings.push(finding);
        // Reported once; findings that follow from it are suppressed.
        self.axes.know(unknown);
        self.axes.poison(unknown);
        self.request.is_damaged = true;
    }

    /// Whether a feed is in force for a move that needs one; reports its absence once.
    #[inline]
    pub(super) fn has_feed(&mut self, scene: &mut Scene<'_>, class: MotionClass) -> bool {
        if class == MotionClass::Rapid {
            return true;
        }
        // Under G93 each block has an F of its own.
        if self.modal.feed_mode != FeedMode::InverseTime && self.modal.feed_mm_per_min > 0.0 {
            // How far from the axis of the spindle the tool is decides how fast.
            return !self.has_feed_of_radius() || self.relies(scene, AxisSet::NONE.with(0));
        }
        if self.modal.feed_mode != FeedMode::PerMinute {
            return self.has_unusual_feed(scene);
        }
        if !self.modal.feed_is_poisoned {
            self.modal.feed_is_poisoned = true;
            let message = "this move needs a feed rate, and none has been programmed".to_owned();
            let help = "write F with mm/min (inch/min under G20) into this block or before it";
            let known = !self.request.is_damaged;
            self.report_block(scene, Code::MissingWord, message, help);
            self.request.is_damaged = !known;
        }
        false
    }
}

/// The length of a straight move, mm.
pub(super) fn distance(from: Position, to: Position) -> f64 {
    (to[0] - from[0]).hypot(to[1] - from[1]).hypot(to[2] - from[2])
}
