//! G70 to G72: lathe cycles, written out as moves.
//!
//! The block of the cycle opens a profile. The blocks of the subroutine Q are read into it, and when the subroutine has
//! ended, [`turning`](crate::turning) makes the moves. Those that follow the profile have its lines as their source.

use super::axes::Reliance;
use super::{Interpreter, Scene};
use crate::dialect::{FeedMode, GWord, Group, LatheCycle, MWord, Mode};
use crate::findings::Findings;
use crate::limits::{COORDINATE_MM_MAX, CYCLE_MOVES_MAX};
use crate::turning::{self, Along, Corner, Cut, Move, Trouble};
use cnc_msgs::contour::{MotionClass, Source};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::{Arc, AxisSet, Plane, Position, Shape};

/// The axes of the plane.
const PLANE: AxisSet = AxisSet::NONE.with(0).with(2);
/// The first axis of the plane and the second one, as in [`turning::Point`].
pub(super) const AXES: [usize; 2] = [2, 0];

/// A cycle whose profile is being read.
#[derive(Debug, Clone)]
pub(super) struct Profile {
    /// As it is written: `G71.1`.
    pub(super) word: String,
    /// The subroutine.
    pub(super) number: u32,
    cut: Cut,
    /// Where the cycle begins.
    start: Position,
    /// The block of the cycle.
    pub(super) source: Source,
    /// Subroutines that are running while it is read; `None` before the first one is.
    depth: Option<usize>,
    /// The motions after the first one, which leads to the first point, and where each of them is written.
    pub(super) motions: Vec<Corner>,
    pub(super) sources: Vec<Source>,
    pub(super) has_begun: bool,
    pub(super) is_damaged: bool,
}

impl Interpreter<'_> {
    /// The block of a cycle: moves to where it begins, and opens its profile.
    #[cold]
    pub(super) fn lathe_cycle(&mut self, scene: &mut Scene<'_>, cycle: LatheCycle, at: usize) {
        if !matches!(self.modal.mode, Some(Mode::Rapid | Mode::Feed | Mode::Arc { .. })) {
            self.modal.mode = None;
        }
        let word = scene.quote(at);
        if !self.request.present.contains(b'Q') {
            return self.no_profile(scene, &word, at);
        }
        self.check_lathe_cycle(scene, &word, at);
        let end = self.turned_end(scene);
        let number = self.take_number(scene, b'Q');
        let cut = self.cut(scene, cycle);
        for axis in (0..3).filter(|&axis| end.named.contains(axis) && !PLANE.contains(axis)) {
            let help = "leave it out: the cycle moves X and Z";
            let letter = super::moves::AXIS_WORDS[axis];
            let message = format!("{word} with {}", char::from(letter));
            self.report(scene, letter, Code::Axes, message, help);
        }
        let absolute = end.named.without(end.relative);
        let is_sound = self.relies(scene, PLANE.without(absolute).union(end.relative))
            & self.has_feed(scene, MotionClass::Feed);
        let from = self.axes.position;
        if !self.arrive(&end) || !is_sound {
            return self.axes.poison(PLANE);
        }
        let (Some(number), Some(cut)) = (number, cut) else { return };
        self.axes.position = from;
        let is_known = self.axes.rely_on(absolute) == Reliance::Known && from == end.position;
        let named = if is_known { AxisSet::NONE } else { absolute };
        self.move_to(MotionClass::Rapid, end.position, named);
        self.profile = Some(Box::new(Profile {
            word,
            number,
            cut,
            start: end.position,
            source: self.source,
            depth: None,
            motions: Vec::new(),
            sources: Vec::new(),
            has_begun: false,
            is_damaged: false,
        }));
    }

    /// A cycle without Q. Posts for other controls write G70 and G71 for the units.
    fn no_profile(&mut self, scene: &mut Scene<'_>, word: &str, at: usize) {
        let _ = self.turned_end(scene);
        for letter in *b"DEIPR" {
            let _ = self.take(letter);
        }
        self.axes.poison(PLANE);
        let message = format!("{word} without Q");
        let help = "write Q with the number of the subroutine that has the profile; where G70 and G71 are meant for inches and \
                    millimetres, write G20 and G21";
        self.report_at(scene, at, Code::MissingWord, message, help);
    }

    /// Reports where a cycle cannot be.
    fn check_lathe_cycle(&mut self, scene: &mut Scene<'_>, word: &str, at: usize) {
        self.refuses_compensation(scene, word);
        if self.modal.plane != Plane::Zx {
            let message = format!("{word} outside of the plane ZX");
            self.report_at(scene, at, Code::Plane, message, "write G18 before the cycle");
        }
        self.check_plane(scene, word);
        if self.modal.feed_mode == FeedMode::InverseTime {
            let message = format!("{word} under inverse time feed (G93)");
            let help = "write G94 and F with mm/min before the cycle";
            self.report_at(scene, at, Code::ModalConflict, message, help);
        }
        let later = self.request.m().find(|(meaning, ..)| {
            matches!(
                meaning,
                MWord::Stop { .. }
                    | MWord::ProgramEnd { .. }
                    | MWord::CallProgram
                    | MWord::EndProgram
                    | MWord::Auxiliary { after_motion: true }
            )
        });
        if let Some((.., at)) = later {
            let message = format!("{} in the block of {word}", scene.quote(at));
            let help = "write it into a block of its own after the cycle";
            self.report_at(scene, at, Code::ModalConflict, message, help);
        }
    }

    /// D, E and P, or D, I and R. `None` where one is wrong, which is reported.
    fn cut(&mut self, scene: &mut Scene<'_>, cycle: LatheCycle) -> Option<Cut> {
        // Radii also under G7, as in LinuxCNC.
        let scale = self.scale();
        let length = |it: &mut Self, scene: &mut Scene<'_>, letter: u8, default: f64| {
            let value = it.take_within(scene, letter, scale, COORDINATE_MM_MAX, "mm");
            if value < Some(0.0) && value.is_some() {
                it.negative(scene, letter);
            }
            value.unwrap_or(default * scale)
        };
        let distance_mm = length(self, scene, b'D', 0.0);
        let cut = match cycle {
            LatheCycle::Finish => {
                let last_mm = length(self, scene, b'E', 0.0);
                let passes = match self.request.present.contains(b'P') {
                    true => self.take_number(scene, b'P')?,
                    false => 1,
                };
                if passes == 0 {
                    let message = "P0 makes no pass".to_owned();
                    let help = "write P with the number of passes, at least 1";
                    self.report(scene, b'P', Code::BadNumber, message, help);
                }
                Cut::Finish { passes, first_mm: distance_mm, last_mm }
            }
            LatheCycle::Rough { along, pockets } => {
                let step_mm = length(self, scene, b'I', 1.0);
                let retract_mm = length(self, scene, b'R', 0.5);
                if step_mm == 0.0 {
                    let message = "I0 cuts no layers".to_owned();
                    let help = "write I with the depth of a layer";
                    self.report(scene, b'I', Code::BadNumber, message, help);
                }
                Cut::Rough { along, pockets, distance_mm, step_mm, retract_mm }
            }
        };
        (!self.request.is_damaged).then_some(cut)
    }

    /// The subroutine whose profile a block has opened.
    #[inline]
    pub(super) fn opened_profile(&self) -> Option<u32> {
        let profile = self.profile.as_ref()?;
        profile.depth.is_none().then_some(profile.number)
    }

    /// Follows calls and returns: the profile begins with the first one, and ends where that ends.
    pub(crate) fn follow_profile(&mut self, depth: usize, findings: &mut Findings) {
        let Some(profile) = &mut self.profile else { return };
        match profile.depth {
            None => profile.depth = Some(depth),
            Some(within) if depth < within => self.close_profile(findings),
            Some(_) => {}
        }
    }

    /// The profile has been read: cuts it.
    fn close_profile(&mut self, findings: &mut Findings) {
        let Some(profile) = self.profile.take() else { return };
        findings.begin_block();
        self.axes.position = profile.start;
        if self.modal.mode == Some(Mode::Rapid) {
            // The profile ran its G0 as G1.
            self.modal.mode = Some(Mode::Feed);
        }
        if profile.is_damaged {
            return self.axes.poison(PLANE);
        }
        self.axes.know(PLANE);
        let start = AXES.map(|axis| profile.start[axis]);
        let moves = turning::moves(&profile.motions, start, profile.cut, CYCLE_MOVES_MAX);
        let moves = moves.and_then(|moves| match self.is_too_long_with(0) {
            true => Err(Trouble::Moves { count: self.all_event_count() as f64 }),
            false => Ok(moves),
        });
        match moves {
            Ok(moves) => moves.iter().for_each(|it| self.cut_profile(&profile, it)),
            Err(trouble) => {
                self.axes.poison(PLANE);
                findings.push(self.trouble(&profile, trouble));
            }
        }
    }

    fn cut_profile(&mut self, profile: &Profile, it: &Move) {
        self.source = it.origin.map_or(profile.source, |index| profile.sources[index]);
        let start = self.axes.position;
        let place = |[z, x]: turning::Point| [x, start[1], z];
        let end = place(it.to);
        let Some(circle) = it.circle else {
            let class = if it.is_rapid { MotionClass::Rapid } else { MotionClass::Feed };
            return self.move_to(class, end, AxisSet::NONE);
        };
        let clockwise = !circle.counterclockwise;
        let arc = Arc { center: place(circle.center), plane: Plane::Zx, clockwise, turns: 0 };
        self.axes.position = end;
        self.feed_at_surface(MotionClass::Feed, start, end, Some(&arc));
        self.add_to_bounds(start, Shape::Arc(arc), end, PLANE);
        self.emit_motion(Shape::Arc(arc), end, MotionClass::Feed, PLANE);
    }

    /// What is wrong with a profile.
    #[cold]
    fn trouble(&self, profile: &Profile, trouble: Trouble) -> Finding {
        let unit = self.scale();
        let Profile { word, number, .. } = profile;
        let height = |across: Along, value: f64| {
            let is_diameter = across == Along::X && self.modal.x_is_diameter;
            let value = if is_diameter { 2.0 * value } else { value };
            let at =
                value - self.modal.shift[AXES[across.axis()]] * if is_diameter { 2.0 } else { 1.0 };
            format!("{}{}", across.letter(), rounded(at / unit))
        };
        let (origin, code, message, help) = match trouble {
            Trouble::Short => (
                None,
                Code::MissingWord,
                format!("the profile of {word} in o{number} has fewer than two motions"),
                "write G0 to its first point, and the motions after it",
            ),
            Trouble::RunsBack { along, origin } => (
                Some(origin),
                Code::BadNumber,
                match along {
                    Some(along) => format!(
                        "the profile of {word} does not run one way along {}: it turns back here",
                        along.letter()
                    ),
                    None => format!(
                        "the profile of {word} does not run one way along Z, nor along X: it turns back here"
                    ),
                },
                "correct the motion, or divide the profile",
            ),
            Trouble::Corner { origin, size_mm, lengths_mm: [one, two] } => (
                Some(origin),
                Code::BadNumber,
                format!(
                    "a fillet or chamfer of {} does not fit between motions that are {} and {} long",
                    rounded(size_mm / unit),
                    rounded(one / unit),
                    rounded(two / unit)
                ),
                "write a smaller A or C",
            ),
            Trouble::Reverses { origin } => (
                Some(origin),
                Code::BadNumber,
                format!("the profile of {word} goes back over the motion before this one"),
                "correct the motion, or divide the profile",
            ),
            Trouble::Falls { across, start, first, last } => (
                None,
                Code::BadNumber,
                format!(
                    "{word} begins at {}, and its profile goes away from there, from {} to {}: the first cut \
                     would be as deep as the profile",
                    height(across, start),
                    height(across, first),
                    height(across, last)
                ),
                "begin the cycle on the other side, or end the profile as high as it begins",
            ),
            Trouble::Side => (
                None,
                Code::BadNumber,
                format!(
                    "where {word} begins does not say on which side of the profile D and E are"
                ),
                "begin the cycle beside the first motion of the profile, where the material is",
            ),
            Trouble::Distance { mm } => (
                None,
                Code::BadNumber,
                format!("no path keeps {} away from the profile of {word}", rounded(mm / unit)),
                "write a smaller D or E",
            ),
            Trouble::Moves { count } => (
                None,
                Code::Limit,
                format!("{word} takes {count:.0} moves; at most {CYCLE_MOVES_MAX} are accepted"),
                "look for a missing digit in I or P",
            ),
        };
        let source = origin.and_then(|index| profile.sources.get(index)).copied();
        let mut finding =
            Finding::error(code, source.unwrap_or(profile.source), message).help(help);
        finding.other = source.is_some().then_some(profile.source);
        finding
    }
}

/// A length for a message: three decimals at most.
fn rounded(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
}

impl Interpreter<'_> {
    /// Whether a word of the block makes no profile, which is reported.
    pub(super) fn refuse_in_profile(&mut self, scene: &mut Scene<'_>, word: &str, since: Source) {
        for at in 0..scene.block.words.len() {
            let found = scene.block.words[at];
            let belongs = match found.letter {
                b'G' => super::code_in_tenths(found.value).is_none_or(|tenths| {
                    let meaning = (scene.rules.dialect.g)(tenths);
                    let is_other = matches!(
                        meaning,
                        GWord::Unknown | GWord::Refused(_) | GWord::RefusedMotion(_)
                    );
                    // It has been reported.
                    is_other || is_motion(meaning)
                }),
                b'M' | b'T' => false,
                _ => true,
            };
            if !belongs {
                let message = format!("{} in the profile of {word}", scene.quote(at));
                let help = "a profile has G0, G1, G2 and G3; write other words before the cycle or after it";
                self.request.is_damaged = true;
                let source = scene.source_of(at);
                let mut finding = Finding::error(Code::Unsupported, source, message).help(help);
                finding.other = Some(since);
                scene.findings.push(finding);
            }
        }
    }

    /// Takes the motion word of a block of a profile.
    pub(super) fn profile_mode(&mut self) -> Option<Mode> {
        if let Some((GWord::Motion(mode), _)) = self.request.g(Group::Motion) {
            self.modal.mode = Some(mode);
            self.modal.mode_is_poisoned = false;
        }
        // G0 and G1 are the same there, so nothing is unclear where neither was written.
        self.modal.mode.or((!self.modal.mode_is_poisoned).then_some(Mode::Feed))
    }
}

/// Whether a word is a motion of a profile.
fn is_motion(word: GWord) -> bool {
    matches!(word, GWord::Motion(Mode::Rapid | Mode::Feed | Mode::Arc { .. }))
}
