//! Axis words: straight moves, arcs, reference positions, machine coordinates.
//!
//! Decides which command of the block takes the axis words and keeps the
//! position. A move that an error spoils is not emitted, but what it names
//! absolutely is known afterwards.

use super::arc::{self, ArcTrouble, InPlane, Resolved};
use super::axes::{Cause, Reliance};
use super::{Interpreter, Scene};
use crate::dialect::{Distance, GWord, Group, Mode, Units};
use crate::limits::{
    ARC_MISMATCH_INCH, ARC_MISMATCH_MM, ARC_R_SHORT_INCH, ARC_R_SHORT_MM, ARC_TURNS_MAX,
    COORDINATE_MM_MAX, MM_PER_INCH,
};
use cnc_msgs::contour::{Action, ContourEventKind, Motion, MotionClass};
use cnc_msgs::diagnostic::{Code, Diagnostic};
use cnc_msgs::geometry::{AXIS_LETTERS, Arc, AxisSet, Position, Shape};

const AXIS_WORDS: [u8; 3] = [b'X', b'Y', b'Z'];
const CENTER_WORDS: [u8; 3] = [b'I', b'J', b'K'];

/// The end of a move.
struct End {
    position: Position,
    /// Axes that the block names.
    named: AxisSet,
    /// Axes of those that keep their place unless they are known.
    relative: AxisSet,
}

impl Interpreter<'_> {
    #[inline]
    pub(super) fn motion(&mut self, scene: &mut Scene<'_>) {
        let word = self.request.g(Group::Motion);
        if self.request.g(Group::CycleCancel).is_some() {
            self.modal.mode = None;
            self.modal.mode_is_poisoned = false;
        }
        match word {
            Some((GWord::Motion(mode), _)) => {
                self.modal.mode = Some(mode);
                self.modal.mode_is_poisoned = false;
            }
            Some(_) => self.modal.mode_is_poisoned = true,
            None => {}
        }
        if let Some((GWord::Dwell, _)) = self.request.g(Group::NonModal)
            && self.rules.dialect.dwell.contains(b'X')
        {
            // X may be the time: such a block does not move.
            return;
        }
        let has_axes = AXIS_WORDS.iter().any(|&letter| self.request.present.contains(letter));
        if let Some((GWord::Reference { second }, at)) = self.request.g(Group::NonModal) {
            return self.reference(scene, second, at);
        }
        if let Some((_, at)) = self.request.g(Group::MachineCoordinates) {
            return self.machine_move(scene, at);
        }
        let is_arc = matches!(self.modal.mode, Some(Mode::Arc { .. }));
        let has_circle = is_arc && self.asks_for_circle(word.is_some());
        if !has_axes && !has_circle {
            return;
        }
        if self.modal.mode_is_poisoned {
            return self.skip_move(scene);
        }
        match self.modal.mode {
            None if self.request.has_refused_word => {
                // The refused word may have been the motion.
                self.modal.mode_is_poisoned = true;
                self.skip_move(scene);
            }
            None => {
                self.modal.mode_is_poisoned = true;
                self.complain_of_block(
                    scene,
                    Code::MissingWord,
                    "axis words, but neither G0, G1, G2 nor G3 is in force".to_owned(),
                    "write G0 or G1 into this block",
                );
                self.skip_move(scene);
            }
            Some(Mode::Rapid) => self.straight(scene, MotionClass::Rapid),
            Some(Mode::Feed) => self.straight(scene, MotionClass::Feed),
            Some(Mode::Arc { clockwise }) => self.arc(scene, clockwise),
        }
    }

    /// Whether a block without axis words is an arc all the same: `G2 I5`, or a bare `G2`.
    fn asks_for_circle(&self, has_motion_word: bool) -> bool {
        let has = |letter| self.request.present.contains(letter);
        CENTER_WORDS.iter().any(|&letter| has(letter)) || has_motion_word
    }

    /// Reads the axis words. Values that could not be read are NaN.
    #[inline]
    fn end(&mut self, scene: &mut Scene<'_>) -> End {
        let scale = self.scale();
        let is_relative = self.modal.distance == Distance::Incremental;
        let mut end =
            End { position: self.axes.position, named: AxisSet::NONE, relative: AxisSet::NONE };
        for (axis, letter) in AXIS_WORDS.into_iter().enumerate() {
            if let Some(value) = self.take_within(scene, letter, scale, COORDINATE_MM_MAX, "mm") {
                let base = if is_relative { self.axes.position[axis] } else { 0.0 };
                end.position[axis] = base + value;
                end.named = end.named.with(axis);
                if end.position[axis].abs() > COORDINATE_MM_MAX
                    && self.axes.rely_on(AxisSet::NONE.with(axis)) != Reliance::Poisoned
                {
                    let message =
                        format!("{} leads beyond {COORDINATE_MM_MAX} mm", char::from(letter));
                    let help = "look for an incremental move that should be absolute";
                    self.complain(scene, letter, Code::Limit, message, help);
                }
            }
        }
        if is_relative {
            end.relative = end.named;
        }
        end
    }

    #[inline]
    fn straight(&mut self, scene: &mut Scene<'_>, class: MotionClass) {
        let end = self.end(scene);
        let relied = end.relative.union(self.relied_by_compensation(end.named));
        let is_sound = self.relies(scene, relied) & self.has_feed(scene, class);
        if self.arrive(&end) && is_sound {
            self.bounds.add_end(end.position, end.named);
            self.emit_motion(Shape::Line, end.position, class, end.named);
        }
    }

    fn arc(&mut self, scene: &mut Scene<'_>, clockwise: bool) {
        let start = self.axes.position;
        let plane = self.modal.plane;
        let [first, second, normal] = plane.axes();
        let mut end = self.end(scene);
        let in_plane = AxisSet::NONE.with(first).with(second);
        let helix = AxisSet::from_bits(end.named.bits() & AxisSet::NONE.with(normal).bits());
        let is_sound =
            self.relies(scene, in_plane.union(helix)) & self.has_feed(scene, MotionClass::Feed);
        let from = [start[first], start[second]];
        let to = [end.position[first], end.position[second]];
        let turns = self.turns(scene);
        let center = self.center(scene, [first, second], from, to, clockwise);
        if let Some(resolved) = center
            && resolved.is_full_circle
        {
            end.position[first] = from[0];
            end.position[second] = from[1];
        }
        if !self.arrive(&end) || !is_sound {
            return;
        }
        let (Some(resolved), Some(turns)) = (center, turns) else { return };
        let mut center = start;
        center[first] = resolved.center[0];
        center[second] = resolved.center[1];
        let turns = turns - u16::from(!resolved.is_full_circle);
        let arc = Arc { center, plane, clockwise, turns };
        self.bounds.add_arc(start, end.position, &arc);
        self.bounds.add_end(end.position, end.named);
        // An arc says where both axes of its plane end, even if it names one or none.
        let axes = end.named.union(in_plane);
        self.emit_motion(Shape::Arc(arc), end.position, MotionClass::Feed, axes);
    }

    #[inline]
    fn emit_motion(&mut self, shape: Shape, end: Position, class: MotionClass, axes: AxisSet) {
        let feed_mm_per_min =
            if class == MotionClass::Feed { self.modal.feed_mm_per_min } else { 0.0 };
        self.emit(ContourEventKind::Motion(Motion { shape, end, class, feed_mm_per_min, axes }));
    }

    /// P: how many turns the arc makes, at least 1.
    fn turns(&mut self, scene: &mut Scene<'_>) -> Option<u16> {
        if !self.rules.dialect.arc_radius_and_turns {
            return Some(1);
        }
        let Some(turns) = self.take(b'P') else { return Some(1) };
        if (1.0..=ARC_TURNS_MAX).contains(&turns) && turns.fract() == 0.0 {
            return Some(turns as u16);
        }
        if !turns.is_nan() {
            let message = format!("an arc cannot make {turns} turns");
            let help = format!("write P as a whole number from 1 to {ARC_TURNS_MAX}");
            self.complain(scene, b'P', Code::BadNumber, message, &help);
        }
        None
    }

    /// I, J, K or R to the centre; `None` after a complaint or in a damaged block.
    fn center(
        &mut self,
        scene: &mut Scene<'_>,
        [first, second]: [usize; 2],
        from: InPlane,
        to: InPlane,
        clockwise: bool,
    ) -> Option<Resolved> {
        let scale = self.scale();
        let letters = [CENTER_WORDS[first], CENTER_WORDS[second]];
        let offsets =
            letters.map(|letter| self.take_within(scene, letter, scale, COORDINATE_MM_MAX, "mm"));
        let radius = if self.rules.dialect.arc_radius_and_turns {
            self.take_within(scene, b'R', scale, COORDINATE_MM_MAX, "mm")
        } else {
            None
        };
        // Posts write K0 behind I and J (FreeCAD); anything but 0 is meant otherwise.
        let normal = CENTER_WORDS[3 - first - second];
        if self.request.value(normal) == Some(0.0) {
            self.take(normal);
        }
        let names = letters.map(char::from);
        if radius.is_some() && offsets.iter().any(Option::is_some) {
            let message = format!("R and {} or {} in one block", names[0], names[1]);
            let help = "give the centre or the radius, not both";
            self.complain(scene, b'R', Code::ModalConflict, message, help);
            return None;
        }
        let is_absolute = self.modal.centers == Distance::Absolute;
        if radius.is_none()
            && (offsets == [None, None] || is_absolute && offsets.iter().any(Option::is_none))
        {
            if !self.request.has_refused_word {
                let message = format!("the arc needs {} and {}", names[0], names[1]);
                let help = if is_absolute {
                    "under G90.1 both coordinates of the centre must be there"
                } else {
                    "write the distance from the start to the centre"
                };
                self.complain_of_block(scene, Code::MissingWord, message, help);
            }
            return None;
        }
        if self.request.is_damaged {
            return None;
        }
        let (mismatch, short) = match self.modal.units {
            Units::Millimetre => (ARC_MISMATCH_MM, ARC_R_SHORT_MM),
            Units::Inch => (ARC_MISMATCH_INCH * MM_PER_INCH, ARC_R_SHORT_INCH * MM_PER_INCH),
        };
        let resolved = if let Some(radius) = radius {
            arc::with_radius(from, to, radius, clockwise, short)
        } else {
            let base = if is_absolute { [0.0; 2] } else { from };
            let center = [base[0] + offsets[0].unwrap_or(0.0), base[1] + offsets[1].unwrap_or(0.0)];
            arc::about_center(from, to, center, mismatch)
        };
        match resolved {
            Ok(resolved) => Some(resolved),
            Err(trouble) => {
                self.complain_of_arc(scene, trouble);
                None
            }
        }
    }

    #[cold]
    fn complain_of_arc(&mut self, scene: &mut Scene<'_>, trouble: ArcTrouble) {
        let (message, help, numbers) = match trouble {
            ArcTrouble::ZeroRadius => (
                "the arc has no radius".to_owned(),
                "the centre must not be the start or the end",
                None,
            ),
            ArcTrouble::Mismatch { start_mm, end_mm, allowed_mm } => (
                format!(
                    "the radii of the arc differ by {:.3} mm: {start_mm:.3} mm at its start, \
                     {end_mm:.3} mm at its end; {allowed_mm:.3} mm is allowed",
                    (start_mm - end_mm).abs()
                ),
                "check the end and the centre; I, J and K count from the start of the arc \
                 unless G90.1 is in force",
                Some((allowed_mm, (start_mm - end_mm).abs())),
            ),
            ArcTrouble::TooShort { radius_mm, half_chord_mm } => (
                format!(
                    "radius {radius_mm:.3} mm does not reach: start and end are {:.3} mm apart, \
                     which takes {half_chord_mm:.3} mm",
                    2.0 * half_chord_mm
                ),
                "check the end and R",
                Some((half_chord_mm, radius_mm)),
            ),
            ArcTrouble::NoChord => (
                "an arc with R must end elsewhere than it starts".to_owned(),
                "program a full circle with its centre: I, J or K",
                None,
            ),
            ArcTrouble::TooLarge { radius_mm } => (
                format!("radius {radius_mm:.3} mm is beyond {COORDINATE_MM_MAX} mm"),
                "program a straight line",
                None,
            ),
        };
        self.request.is_damaged = true;
        let mut diagnostic = Diagnostic::error(Code::ArcRadius, self.source, message).help(help);
        if let Some((needed, available)) = numbers {
            diagnostic.needed_mm = Some(needed);
            diagnostic.available_mm = Some(available);
        }
        scene.findings.push(diagnostic);
    }

    /// G28 and G30: over the programmed point, then the axes that are named, or all.
    fn reference(&mut self, scene: &mut Scene<'_>, second: bool, at: usize) {
        if let Some((_, motion)) = self.request.g(Group::Motion)
            && !self.request.has_refused_word
            && AXIS_WORDS.iter().any(|&letter| self.request.present.contains(letter))
        {
            let words = (scene.quote(at), scene.quote(motion));
            let message =
                format!("both {} and {} take the axis words of this block", words.0, words.1);
            let help = "write two blocks";
            self.complain_at(scene, motion, Code::ModalConflict, message, help);
        }
        let mut via = self.end(scene);
        let mut named = via.named;
        // G91 G28 Z0 goes home from where it is, wherever that is.
        let stays = (0..3).filter(|&axis| {
            let letter = AXIS_WORDS[axis];
            via.relative.contains(axis) && self.request.value(letter) == Some(0.0)
        });
        let stays = stays.fold(AxisSet::NONE, AxisSet::with);
        via.named = via.named.without(stays);
        via.relative = via.relative.without(stays);
        let is_sound = self.relies(scene, via.relative);
        let arrives = self.arrive(&via);
        if named.is_empty() {
            named = AxisSet::ALL;
        }
        if arrives && is_sound {
            if !via.named.is_empty() {
                self.bounds.add_end(via.position, via.named);
                self.emit_motion(Shape::Line, via.position, MotionClass::Rapid, via.named);
            }
            self.act(Action::Reference { axes: named, second });
        }
        let word = if second { "G30" } else { "G28" };
        self.axes.lose(named, Cause { source: self.source, word });
    }

    /// G53.
    fn machine_move(&mut self, scene: &mut Scene<'_>, at: usize) {
        let position = self.axes.position;
        let distance = std::mem::replace(&mut self.modal.distance, Distance::Absolute);
        let end = self.end(scene);
        self.modal.distance = distance;
        self.axes.position = position;
        let rapid = match self.modal.mode {
            Some(Mode::Rapid) => true,
            Some(Mode::Feed) => false,
            _ if self.modal.mode_is_poisoned => return self.axes.poison(end.named),
            _ => {
                self.axes.poison(end.named);
                self.request.has_refused_word = true;
                let message = "G53 works with G0 and G1 only".to_owned();
                return self.complain_at(
                    scene,
                    at,
                    Code::ModalConflict,
                    message,
                    "write G0 into this block",
                );
            }
        };
        if distance == Distance::Incremental {
            self.axes.poison(end.named);
            let message = "G53 takes machine coordinates, which G91 cannot have".to_owned();
            return self.complain_at(
                scene,
                at,
                Code::ModalConflict,
                message,
                "write G90 into this block",
            );
        }
        if end.named.is_empty() && !self.request.has_refused_word {
            let message = "G53 without X, Y or Z".to_owned();
            return self.complain_at(
                scene,
                at,
                Code::MissingWord,
                message,
                "name the axes that move",
            );
        }
        let class = if rapid { MotionClass::Rapid } else { MotionClass::Feed };
        if self.has_feed(scene, class) && !self.request.is_damaged {
            let mut target = [0.0; 3];
            for axis in (0..3).filter(|&axis| end.named.contains(axis)) {
                target[axis] = end.position[axis];
            }
            let feed_mm_per_min = if rapid { 0.0 } else { self.modal.feed_mm_per_min };
            self.act(Action::MachineMove { target, axes: end.named, rapid, feed_mm_per_min });
        }
        self.axes.lose(end.named, Cause { source: self.source, word: "G53" });
    }

    /// A move whose command was refused: what it names absolutely is known all the same.
    #[cold]
    fn skip_move(&mut self, scene: &mut Scene<'_>) {
        let end = self.end(scene);
        self.request.has_refused_word = true;
        self.axes.poison(end.relative);
        self.request.is_damaged = true;
        self.arrive(&end);
    }

    /// Takes over the end of a move; whether the block is good enough to move.
    #[inline]
    fn arrive(&mut self, end: &End) -> bool {
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

    /// Under compensation a move in the plane needs both axes of it: the planner turns them.
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

    /// Whether a motion may rely on where some axes are; the first one that must not says why.
    #[inline]
    fn relies(&mut self, scene: &mut Scene<'_>, axes: AxisSet) -> bool {
        match self.axes.rely_on(axes) {
            Reliance::Known => true,
            Reliance::Assumed(assumed) => {
                self.contour.assumed_axes = self.contour.assumed_axes.union(assumed);
                self.axes.know(assumed);
                true
            }
            Reliance::Poisoned => false,
            Reliance::Unknown(unknown) => {
                self.complain_of_unknown(scene, unknown);
                false
            }
        }
    }

    #[cold]
    fn complain_of_unknown(&mut self, scene: &mut Scene<'_>, unknown: AxisSet) {
        let axis = (0..3).find(|&axis| unknown.contains(axis)).unwrap_or(0);
        let Cause { source, word } = self.axes.cause(axis);
        let letters = unknown.letters();
        let verb = if letters.len() == 1 { "is" } else { "are" };
        let message = format!(
            "this move starts from where {letters} {verb}, which is not known since {word} in line {}",
            source.line
        );
        let named: Vec<String> = (0..3)
            .filter(|&axis| unknown.contains(axis))
            .map(|axis| AXIS_LETTERS[axis].to_string())
            .collect();
        let help = format!("move {} with G90 and G0 or G1 before it", named.join(" and "));
        let mut diagnostic = Diagnostic::error(Code::Axes, self.source, message).help(help);
        diagnostic.other = Some(source);
        scene.findings.push(diagnostic);
        // Said once; what follows from it is not worth saying.
        self.axes.know(unknown);
        self.axes.poison(unknown);
        self.request.is_damaged = true;
    }

    /// Whether a feed is in force for a move that needs one; complains once.
    #[inline]
    fn has_feed(&mut self, scene: &mut Scene<'_>, class: MotionClass) -> bool {
        if class == MotionClass::Rapid || self.modal.feed_mm_per_min > 0.0 {
            return true;
        }
        if !self.modal.feed_is_poisoned {
            self.modal.feed_is_poisoned = true;
            let message = "a move at feed, but no feed has been programmed".to_owned();
            let help = "write F with mm/min (inch/min under G20) into this block or before it";
            let known = !self.request.is_damaged;
            self.complain_of_block(scene, Code::MissingWord, message, help);
            self.request.is_damaged = !known;
        }
        false
    }
}
