//! G33 and G76: threads, cut while the axes keep pace with the spindle.
//!
//! G76 is written out as LinuxCNC does it: a pass of G33 for each depth, and rapids between them.

use super::{Interpreter, Scene};
use crate::dialect::Letters;
use crate::limits::{COORDINATE_MM_MAX, CYCLE_MOVES_MAX, STAYS_MM};
use cnc_msgs::contour::{Action, MotionClass, SpindleMode};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::{AxisSet, Position, Shape};

/// The steepest angle at which the tool of G76 may be fed in, degrees.
const INFEED_DEGREES_MAX: f64 = 80.0;
/// The most passes of G76 at full depth after the first one.
const SPRING_PASSES_MAX: f64 = 1000.0;

/// The passes of G76. Depths are radii, from the drive line where the tool stands.
struct ThreadCycle {
    pitch_mm: f64,
    /// 1 where depths go towards plus X.
    inward: f64,
    /// Of the crest, of the first pass below it, and of the whole thread below it, mm.
    crest: f64,
    first: f64,
    depth: f64,
    /// The depth grows with this root of the number of passes.
    degression: f64,
    /// How far the tool goes along Z for each mm that it goes in.
    lead_per_mm: f64,
    spring_passes: u32,
    target_z: f64,
}

impl ThreadCycle {
    /// The depths of all passes, mm.
    fn depths(&self) -> impl Iterator<Item = f64> {
        let full = self.crest + self.depth;
        let at = move |pass: u32| {
            self.crest + self.first * f64::from(pass).powf(self.degression.recip())
        };
        let last = std::iter::repeat_n(full, self.spring_passes as usize + 1);
        (1..).map(at).take_while(move |depth| *depth < full).chain(last)
    }

    /// How many there are before the one at full depth.
    fn roughing_passes(&self) -> f64 {
        (self.depth / self.first).powf(self.degression).ceil()
    }
}

impl Interpreter<'_> {
    /// G33: a line along which the axes keep pace with the spindle.
    #[cold]
    pub(super) fn thread(&mut self, scene: &mut Scene<'_>) {
        let end = self.turned_end(scene);
        let pitch_mm = self.pitch(scene, "G33", b'K');
        self.check_thread(scene, "G33");
        if self.request.present.contains(b'F') {
            let help = "delete F: K and S give the feed of G33";
            let message = "F in a block with G33".to_owned();
            self.report(scene, b'F', Code::ModalConflict, message, help);
        }
        let from = self.axes.position;
        let is_sound = self.relies(scene, end.relative);
        if self.arrive(&end) && is_sound {
            if (0..3).all(|axis| (from[axis] - end.position[axis]).abs() < STAYS_MM) {
                let message = "G33 ends where it begins, and cuts nothing".to_owned();
                let help = "name the end of the thread: Z, or X and Z for a cone";
                let finding = Finding::warning(Code::SuspiciousValue, self.source, message);
                scene.findings.push(finding.help(help));
                return;
            }
            self.cut_thread(from, end.position, end.named, pitch_mm);
        }
    }

    /// G76: a whole thread along Z.
    #[cold]
    pub(super) fn thread_cycle(&mut self, scene: &mut Scene<'_>) {
        let start = self.axes.position;
        let end = self.turned_end(scene);
        let cycle = self.thread_words(scene, start, end.position);
        self.check_thread(scene, "G76");
        let [x, z] = [0, 2].map(|axis| AxisSet::NONE.with(axis));
        if !end.named.contains(2) && !self.request.is_damaged {
            let message = "G76 without Z".to_owned();
            self.report_block(
                scene,
                Code::MissingWord,
                message,
                "write Z with the end of the thread",
            );
        }
        let is_sound = self.relies(scene, x.union(z).union(end.relative));
        let (Some(cycle), true) = (cycle, self.arrive(&end) && is_sound) else { return };
        self.axes.position = start;
        for depth in cycle.depths() {
            let along = cycle.lead_per_mm * (depth - cycle.crest);
            let at = |depth: f64, z: f64| {
                let [x, y, _] = start;
                [x + cycle.inward * depth, y, z - along]
            };
            let clear = depth - cycle.crest - cycle.depth;
            self.move_to(MotionClass::Rapid, at(clear, start[2]), AxisSet::NONE);
            self.move_to(MotionClass::Rapid, at(depth, start[2]), AxisSet::NONE);
            let (from, to) = (self.axes.position, at(depth, cycle.target_z));
            self.axes.position = to;
            self.cut_thread(from, to, z, cycle.pitch_mm);
            self.move_to(MotionClass::Rapid, at(clear, cycle.target_z), AxisSet::NONE);
        }
        self.move_to(MotionClass::Rapid, end.position, end.named.without(end.relative));
    }

    /// A motion at the pace of the spindle; the tool is at its end already.
    fn cut_thread(&mut self, from: Position, end: Position, named: AxisSet, pitch_mm: f64) {
        self.act(Action::SpindleSync { pitch_mm });
        self.add_to_bounds(from, Shape::Line, end, named);
        let feed = self.modal.feed_mm_per_min;
        self.modal.feed_mm_per_min = self.feed_of_pitch(pitch_mm);
        self.emit_motion(Shape::Line, end, MotionClass::Feed, named);
        self.modal.feed_mm_per_min = feed;
    }

    /// The pitch of a thread, mm; NaN if there is none, which is reported.
    fn pitch(&mut self, scene: &mut Scene<'_>, word: &str, letter: u8) -> f64 {
        let scale = self.scale();
        let pitch = self.take_within(scene, letter, scale, COORDINATE_MM_MAX, "mm");
        let name = char::from(letter);
        match pitch {
            None => {
                let message = format!("{word} without {name}");
                let help = format!("write {name} with the pitch of the thread");
                self.report_block(scene, Code::MissingWord, message, &help);
            }
            Some(pitch) if pitch <= 0.0 => {
                let message = format!("{} is no pitch", scene.quote(self.request.word(letter)));
                let help = "write the way along the thread in one revolution, above 0";
                self.report(scene, letter, Code::BadNumber, message, help);
            }
            Some(_) => {}
        }
        pitch.unwrap_or(f64::NAN)
    }

    /// Reports what no thread is cut with.
    fn check_thread(&mut self, scene: &mut Scene<'_>, word: &str) {
        if let Some(since) = scene.under_compensation.or(self.modal.compensation.selected_at()) {
            let message = format!(
                "{word} under cutter radius compensation, which is on since line {}",
                since.line
            );
            let help = "cancel with G40 and a straight move before it";
            self.request.is_damaged = true;
            let mut finding =
                Finding::error(Code::ForbiddenUnderCompensation, self.source, message).help(help);
            finding.other = Some(since);
            scene.findings.push(finding);
        } else if self.modal.spindle == SpindleMode::Off || self.modal.rpm <= 0.0 {
            let lacks = match self.modal.spindle {
                SpindleMode::Off => "neither M3 nor M4 is in force",
                _ => "no spindle speed is in force",
            };
            let message = format!("{word} needs a spindle that turns: {lacks}");
            let help = "write M3 or M4 with S before it";
            self.report_block(scene, Code::MissingWord, message, help);
        }
    }

    /// The words of G76; `None` if one is wrong, which is reported.
    fn thread_words(
        &mut self,
        scene: &mut Scene<'_>,
        start: Position,
        end: Position,
    ) -> Option<ThreadCycle> {
        const NEEDED: [(u8, &str); 3] = [
            (b'I', "I with the distance from here to the crest: below 0 for an outside thread"),
            (b'J', "J with the depth of the first pass"),
            (b'K', "K with the depth of the thread"),
        ];
        let pitch_mm = self.pitch(scene, "G76", b'P');
        let along_x = if self.modal.x_is_diameter { self.scale() / 2.0 } else { self.scale() };
        let mut depths = [f64::NAN; 3];
        for ((letter, what), value) in NEEDED.into_iter().zip(&mut depths) {
            match self.take_within(scene, letter, along_x, COORDINATE_MM_MAX, "mm") {
                Some(depth) => *value = depth,
                None => {
                    let message = format!("G76 without {}", char::from(letter));
                    self.report_block(scene, Code::MissingWord, message, &format!("write {what}"));
                }
            }
        }
        let [crest, first, depth] = depths;
        let wrong = [
            (b'I', crest == 0.0, "write the distance from here to the crest of the thread"),
            (b'J', first <= 0.0, "write the depth of the first pass, above 0"),
            (b'K', depth <= first, "write the depth of the thread: more than J"),
        ];
        for (letter, is_wrong, help) in wrong {
            if is_wrong {
                let message = format!("G76 with {}", scene.quote(self.request.word(letter)));
                self.report(scene, letter, Code::BadNumber, message, help);
            }
        }
        let [angle, degression] = [b'Q', b'R'].map(|letter| self.take(letter));
        let degrees = angle.unwrap_or(0.0);
        if degrees.abs() > INFEED_DEGREES_MAX {
            let message = format!("G76 with {}", scene.quote(self.request.word(b'Q')));
            let help = "write the angle of the compound slide: 29 to 30 for most threads";
            self.report(scene, b'Q', Code::BadNumber, message, help);
        }
        if degression.is_some_and(|it| it < 1.0) {
            let message = format!("G76 with {}", scene.quote(self.request.word(b'R')));
            let help = "write 1 for equal depths, 2 for equal areas";
            self.report(scene, b'R', Code::BadNumber, message, help);
        }
        let spring_passes = self.take_number(scene, b'H').unwrap_or(0);
        self.refuse_tapers(scene);
        let backwards = if end[2] > start[2] { -1.0 } else { 1.0 };
        let lead_per_mm = backwards * degrees.to_radians().tan();
        let cycle = ThreadCycle {
            pitch_mm,
            inward: crest.signum(),
            crest: crest.abs(),
            first,
            depth,
            degression: degression.unwrap_or(1.0),
            lead_per_mm,
            spring_passes,
            target_z: end[2] + depth * lead_per_mm,
        };
        if self.request.is_damaged {
            return None;
        }
        let passes = cycle.roughing_passes();
        let moves = 4.0 * (passes + f64::from(spring_passes));
        if moves.is_nan() || moves > CYCLE_MOVES_MAX || f64::from(spring_passes) > SPRING_PASSES_MAX
        {
            let message = format!(
                "the thread takes {passes:.0} passes and {spring_passes} more at full depth; at most \
                 {:.0} and {SPRING_PASSES_MAX} are accepted",
                CYCLE_MOVES_MAX / 4.0
            );
            let help = "look for a wrong digit in J, K, R or H";
            self.report_block(scene, Code::Limit, message, help);
            return None;
        }
        Some(cycle)
    }

    /// E and L: an entry or exit at an angle.
    fn refuse_tapers(&mut self, scene: &mut Scene<'_>) {
        let (length, ends) = (self.take(b'E'), self.take_number(scene, b'L'));
        if length.is_some_and(|length| length > 0.0) && ends.is_some_and(|ends| ends & 3 != 0) {
            let message = "G76 with an angled entry or exit (E and L)".to_owned();
            let help = "write L0: a controller stops between two moves that keep pace with the spindle, \
                        and the tool would cut a groove there";
            self.report(scene, b'L', Code::Unsupported, message, help);
        }
    }

    #[cold]
    pub(super) fn thread_without_axes(&mut self, scene: &mut Scene<'_>, at: usize) {
        const WORDS: Letters = Letters::of(b"EHIJKLPQR");
        for letter in WORDS.iter() {
            let _ = self.take(letter);
        }
        let message = format!("{} without Z", scene.quote(at));
        self.report_at(scene, at, Code::MissingWord, message, "name the end of the thread");
    }
}
