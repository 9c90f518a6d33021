//! G33 and G76: threads, cut while the axes keep pace with the spindle.
//!
//! G76 is written out as LinuxCNC does it: a pass of G33 for each depth, and rapids between them.

use super::axes::Reliance;
use super::{Interpreter, Scene};
use crate::dialect::{Letters, Mode};
use crate::limits::{COORDINATE_MM_MAX, CYCLE_MOVES_MAX, STAYS_MM};
use cnc_msgs::contour::{Action, MotionClass, SpindleMode};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet, Position, Shape};

/// The steepest angle at which the tool of G76 may be fed in, degrees.
const INFEED_DEGREES_MAX: f64 = 80.0;
/// A pitch below this is a mistake, mm.
const PITCH_MM_MIN: f64 = 0.001;
/// The most passes of G76 at full depth after the first one.
const SPRING_PASSES_MAX: f64 = 1000.0;

/// The passes of G76. Depths are radii, from the drive line where the tool stands.
struct ThreadCycle {
    pitch_mm: f64,
    /// 1 for an inside thread, whose depths go towards plus X; else -1.
    towards_x: f64,
    /// Of the crest, of the first pass below it, and of the whole thread below it, mm.
    crest: f64,
    first: f64,
    depth: f64,
    /// The depth grows with this root of the number of passes.
    degression: f64,
    /// How far the tool goes towards minus Z for each mm below the crest.
    lead_per_mm: f64,
    spring_passes: u32,
    /// Where a pass at the crest would end, mm: the one at full depth ends at the programmed Z.
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

    /// The number of the first pass at full depth.
    fn passes_to_full_depth(&self) -> f64 {
        (self.depth / self.first).powf(self.degression).ceil()
    }

    /// Where the tool is at a depth, having begun a pass at this Z.
    fn place(&self, [x, y, _]: Position, depth: f64, z: f64, below_crest: f64) -> Position {
        [x + self.towards_x * depth, y, z - self.lead_per_mm * below_crest]
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
            let help = "move F to the next block with G1: K and S give the feed of G33";
            let message = "F in a block with G33".to_owned();
            self.report(scene, b'F', Code::ModalConflict, message, help);
        }
        let from = self.axes.position;
        let is_sound = self.relies(scene, end.relative);
        let is_known = self.axes.rely_on(self.turned_axes(end.named)) == Reliance::Known;
        if self.arrive(&end) && is_sound {
            if is_known && (0..3).all(|axis| (from[axis] - end.position[axis]).abs() < STAYS_MM) {
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
        if let Some(cycle) = cycle.as_ref().filter(|_| is_sound && !self.request.is_damaged) {
            self.check_places(scene, cycle, start, end.position);
        }
        let (Some(cycle), true) = (cycle, self.arrive(&end) && is_sound) else { return };
        self.axes.position = start;
        for depth in cycle.depths() {
            let below_crest = depth - cycle.crest;
            let at = |depth: f64, z: f64| cycle.place(start, depth, z, below_crest);
            let clear = below_crest - cycle.depth;
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
            Some(pitch) if pitch < PITCH_MM_MIN => {
                let word = scene.quote(self.request.word(letter));
                let message = format!("the pitch {word} is not at least {PITCH_MM_MIN} mm");
                let help = "write the way along the thread in one turn of the spindle";
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
            self.request.is_damaged |= self.modal.spindle_is_reported;
            if std::mem::replace(&mut self.modal.spindle_is_reported, true) {
                return;
            }
            let (lacks, help) = match self.modal.spindle {
                _ if self.modal.surface.is_some() => {
                    ("G96 changes its speed along X", "write G97 and S before it")
                }
                SpindleMode::Off => ("neither M3 nor M4 is in force", "write M3 or M4 before it"),
                _ => ("no spindle speed is in force", "write S before it"),
            };
            let message = format!("{word} needs a spindle that turns: {lacks}");
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
            (
                b'I',
                "I with the way from here to the crest (under G7 in diameter): below 0 for an outside thread",
            ),
            (b'J', "J with the depth of the first pass (under G7 in diameter)"),
            (b'K', "K with the depth of the thread (under G7 in diameter)"),
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
        let help = "write the way from here to the crest of the thread";
        self.wrong(scene, b'I', crest == 0.0, "is 0", help);
        let help = "write the depth of the first pass";
        self.wrong(scene, b'J', first <= 0.0, "is not above 0", help);
        let help = "write the depth of the thread, which is more than that of the first pass";
        self.wrong(scene, b'K', depth <= first, "is not more than J", help);
        let [angle, degression] = [b'Q', b'R'].map(|letter| self.take(letter));
        let degrees = angle.unwrap_or(0.0);
        let is_steep = degrees.abs() > INFEED_DEGREES_MAX;
        let what = format!("is more than {INFEED_DEGREES_MAX} degrees");
        let help = "write the angle of the compound slide: 29 to 30 for most threads";
        self.wrong(scene, b'Q', is_steep, &what, help);
        let help = "write 1 for equal depths, 2 for equal areas";
        self.wrong(scene, b'R', degression.is_some_and(|it| it < 1.0), "is below 1", help);
        let spring_passes = self.take_number(scene, b'H').unwrap_or(0);
        self.refuse_tapers(scene);
        let backwards = if end[2] > start[2] { -1.0 } else { 1.0 };
        let lead_per_mm = backwards * degrees.to_radians().tan();
        let cycle = ThreadCycle {
            pitch_mm,
            towards_x: crest.signum(),
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
        let passes = cycle.passes_to_full_depth();
        let passes_max = CYCLE_MOVES_MAX / 4.0;
        if !(passes <= passes_max && f64::from(spring_passes) <= SPRING_PASSES_MAX) {
            let message = format!(
                "the thread takes more than {passes_max} passes to its depth, or more than {SPRING_PASSES_MAX} at it"
            );
            let help = "look for a wrong digit in J, K, R or H";
            self.report_block(scene, Code::Limit, message, help);
            return None;
        }
        Some(cycle)
    }

    /// Reports a word of G76 that is wrong.
    fn wrong(&mut self, scene: &mut Scene<'_>, letter: u8, is_wrong: bool, what: &str, help: &str) {
        if is_wrong {
            let message = format!("{} of G76 {what}", scene.quote(self.request.word(letter)));
            self.report(scene, letter, Code::BadNumber, message, help);
        }
    }

    /// Reports passes that do not go along the thread, or to places that no machine has.
    fn check_places(
        &mut self,
        scene: &mut Scene<'_>,
        cycle: &ThreadCycle,
        start: Position,
        end: Position,
    ) {
        let backwards = if end[2] > start[2] { -1.0 } else { 1.0 };
        let lead = backwards * cycle.depth * cycle.lead_per_mm;
        let way = (end[2] - start[2]).abs();
        if way - lead < STAYS_MM {
            let message = format!(
                "the thread is {:.3} mm long, and Q takes {:.3} mm of it from the last pass",
                way / self.scale(),
                lead / self.scale()
            );
            let help = "name an end farther along Z, or write a smaller Q";
            return self.report_block(scene, Code::BadNumber, message, help);
        }
        let deepest = cycle.place(start, cycle.crest + cycle.depth, start[2], cycle.depth);
        if let Some(axis) = (0..3).find(|&axis| deepest[axis].abs() > COORDINATE_MM_MAX) {
            let message =
                format!("G76 leads beyond {COORDINATE_MM_MAX} mm in {}", AXIS_LETTERS[axis]);
            let help = "look for a missing decimal point in I, J and K";
            self.report_block(scene, Code::Limit, message, help);
        }
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
        let axes = if self.modal.mode == Some(Mode::Thread) { "X, Y or Z" } else { "Z" };
        let message = format!("{} without {axes}", scene.quote(at));
        self.report_at(scene, at, Code::MissingWord, message, "name the end of the thread");
    }
}
