//! Executes blocks: turns the words of a block into events.
//!
//! Holds the modal state and the order of execution within a block. The geometry of compensation
//! is the planner's. Each mistake is reported once: a block with an error does not move, and the
//! state that it leaves unknown is `poisoned`, which suppresses follow-up findings.

mod actions;
mod arc;
mod arcs;
mod axes;
mod compensation;
mod cycles;
mod feeds;
mod further;
mod home;
mod length;
mod machine_words;
mod modal;
mod moves;
mod no_effect;
mod offsets;
mod polar;
mod polar_words;
mod probe;
mod profile;
mod refusals;
mod request;
mod saved_state;
mod scene;
mod spindle_speed;
mod splines;
mod stored;
mod system;
mod threads;
mod tool_lengths;
mod tool_values;
mod turn;
mod turning;

use crate::block::Block;
use crate::bounds::Bounds;
use crate::dialect::{FeedMode, GWord, Group, Letters, Units};
use crate::expression::whole;
use crate::findings::Findings;
use crate::limits::MM_PER_INCH;
use crate::line::Line;
use crate::no_effect::NoEffects;
use crate::rules::Rules;
use crate::tool_rows::ToolRows;
use axes::Axes;
use cnc_msgs::calls::Calls;
use cnc_msgs::contour::{Action, ContourEvent, ContourEventKind, ProgrammedContour, Source};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::{AxisSet, Plane, Position};
use cnc_msgs::text::Text;
use cnc_msgs::units::received_mm;
pub(crate) use cycles::Cycle;
use further::Further;
use modal::Modal;
pub(crate) use offsets::OffsetWord;
use probe::Probes;
use request::Request;
pub(crate) use request::code_in_tenths;
use saved_state::SavedState;
pub(crate) use saved_state::StateWord;
use scene::Scene;
use splines::OpenCurve;
pub(crate) use splines::Spline;
use std::cell::Cell;
use std::collections::BTreeMap;
use tool_lengths::ToolEntries;
use turn::Rotations;

/// The letters of axes beyond X, Y and Z.
const FURTHER_AXES: &[u8] = b"ABCUVW";
/// For whoever moves one of them on a control that has none.
const NO_FURTHER_AXES: &str = "delete it, or program the G word that it belongs to; of all controls \
     only rs274 moves A, B, C, U, V and W: post the program for it";

/// What follows a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum After {
    Block,
    /// M2, M30.
    End,
    /// M98.
    Call {
        program: u32,
        times: u32,
    },
    /// M99.
    EndOfProgram,
    /// G70 to G72: the subroutine with the profile, by its number.
    Profile(u32),
    /// Nothing: the block needs the result of a probe that is still to come.
    Probe,
}

/// Turns blocks into events, one after another.
#[derive(Debug, Clone)]
pub(crate) struct Interpreter<'r> {
    rules: &'r Rules<'r>,
    modal: Modal,
    axes: Axes,
    further: Further,
    request: Request,
    /// Letters that the current block has used, and letters that it has used twice.
    used: Letters,
    shared: Letters,
    /// The place of the current block.
    source: Source,
    has_begun: bool,
    /// Axes whose position at the start a parameter has read.
    read_axes: Cell<AxisSet>,
    /// P and L of M98 in the current block.
    called: Option<(u32, u32)>,
    /// The words that M70 or M73 has saved in the main program and in each subroutine that is
    /// running, and whether the end of the subroutine restores them.
    saved: Vec<Option<(SavedState, bool)>>,
    contour: ProgrammedContour,
    /// Events that the contour has no more.
    taken: usize,
    /// Events of a part, where nobody holds all of them.
    held_events_max: Option<usize>,
    /// The first block that nodes refuse then, because it makes the program too long.
    too_long_from: Option<Source>,
    bounds: Bounds,
    /// Tools of M61.
    named_tools: Vec<(u32, Source)>,
    /// What G10 has set for tools.
    tool_entries: ToolEntries,
    /// The rows of the tool table; `None` where the text has none.
    tool_rows: Option<ToolRows>,
    has_read_tools: Cell<bool>,
    /// Stored positions and work offsets that are known, by their numbers.
    stored: BTreeMap<u32, f64>,
    rotations: Rotations,
    open_curve: Option<OpenCurve>,
    /// Of the curves so far, in plain moves.
    curve_work: u64,
    /// P and Q of the last G5, while no other motion has come.
    last_cubic: Option<[f64; 2]>,
    probes: Probes,
    no_effects: NoEffects,
    /// Something has asked how cycles return: a cycle, or a parameter.
    has_returned: Cell<bool>,
    /// A lathe cycle whose profile is being read.
    profile: Option<Box<turning::Profile>>,
}

impl<'r> Interpreter<'r> {
    /// Starts with the state of a machine that was switched on and homed: G21, the plane of the
    /// dialect, G90, G91.1, G94, G40, G49, G54, no motion mode, no feed.
    pub(crate) fn new(rules: &'r Rules<'r>, start: Position, events: usize) -> Self {
        let start = start.map(received_mm);
        let mut contour = ProgrammedContour {
            start,
            assumed_axes: AxisSet::NONE,
            events: Vec::with_capacity(events),
            calls: Calls::default(),
        };
        if rules.dialect.plane != Plane::Xy {
            // Readers of the events assume XY until a plane event.
            let kind = ContourEventKind::Plane(rules.dialect.plane);
            contour.events.push(ContourEvent { source: Source::default(), kind });
        }
        Self {
            rules,
            modal: Modal::new(rules),
            axes: Axes::new(start),
            further: Further::default(),
            request: Request::default(),
            used: Letters::NONE,
            shared: Letters::NONE,
            source: Source::default(),
            has_begun: false,
            read_axes: Cell::new(AxisSet::NONE),
            called: None,
            saved: vec![None],
            contour,
            taken: 0,
            held_events_max: None,
            too_long_from: None,
            bounds: Bounds::default(),
            named_tools: Vec::new(),
            tool_entries: ToolEntries::new(),
            tool_rows: None,
            has_read_tools: Cell::new(false),
            stored: BTreeMap::new(),
            rotations: Rotations::default(),
            open_curve: None,
            curve_work: 0,
            last_cubic: None,
            probes: Probes::default(),
            no_effects: NoEffects::default(),
            has_returned: Cell::new(false),
            profile: None,
        }
    }

    /// Whether a block has been executed.
    pub(crate) fn has_begun(&self) -> bool {
        self.has_begun
    }

    /// What has been done so far, in plain moves: a piece of a curve takes as long as several.
    pub(crate) fn work(&self) -> u64 {
        self.all_event_count() as u64 + self.curve_work
    }

    /// Events of the contour so far, without those that were taken.
    #[inline]
    pub(crate) fn event_count(&self) -> usize {
        self.contour.events.len()
    }

    /// Events so far.
    fn all_event_count(&self) -> usize {
        self.taken + self.contour.events.len()
    }

    /// Whether compensation is selected.
    #[inline]
    pub(crate) fn is_compensating(&self) -> bool {
        self.modal.compensation.is_selected()
    }

    /// Offers the events so far.
    pub(crate) fn give(&mut self, take: &mut dyn FnMut(&mut ProgrammedContour)) {
        let count = self.contour.events.len();
        take(&mut self.contour);
        self.taken += count - self.contour.events.len();
    }

    /// Shows a text to the operator here.
    pub(crate) fn show(&mut self, source: Source, text: &str) {
        self.source = source;
        for text in Text::parts(text) {
            self.act(Action::Message { text });
        }
    }

    /// Executes one block; returns what follows it.
    pub(crate) fn execute(
        &mut self,
        line: Line<'_>,
        block: &Block,
        findings: &mut Findings,
    ) -> After {
        self.has_begun = true;
        let under_compensation = self.modal.compensation.selected_at();
        let rules = self.rules;
        let plane = self.modal.plane;
        let mut scene = Scene { line, block, rules, findings, under_compensation, plane };
        self.source = scene.source();
        self.used = Letters::NONE;
        self.shared = Letters::NONE;
        self.called = None;
        self.request.read(&mut scene);
        if self.profile.is_some() {
            self.profile_block(&mut scene);
            return After::Block;
        }
        if self.request.polar != [None; 2] {
            self.check_polar_words(&mut scene);
        }

        if self.request.is_plain() {
            self.feed(&mut scene);
        } else {
            self.all_but_motion(&mut scene);
        }
        self.motion(&mut scene);
        self.unused_words(&mut scene);
        if block.is_cut {
            self.axes.poison(AxisSet::ALL);
            self.further.poison_known();
        }
        if let Some(number) = self.opened_profile() {
            return After::Profile(number);
        }
        match self.request.m_at(0) {
            None if self.request.present.intersection(self.rules.call_letters).is_empty() => {
                After::Block
            }
            None => self.called_program(),
            Some(_) => self.functions_after_motion(),
        }
    }

    /// Everything that a block does before its motion, in the order of RS-274.
    fn all_but_motion(&mut self, scene: &mut Scene<'_>) {
        for group in [Group::Path, Group::Retract] {
            if let Some((GWord::NoEffect(_, _, why), at)) = self.request.g(group) {
                self.has_no_effect(scene, at, why);
            }
        }
        // Units first: they hold for F of the same block (grbl). Then the order of RS-274.
        if let Some((GWord::Units(units), _)) = self.request.g(Group::Units) {
            self.modal.units = units;
        }
        if let Some((GWord::Diameter(is_diameter), _)) = self.request.g(Group::Diameter) {
            self.modal.x_is_diameter = is_diameter;
        }
        self.feed_mode();
        let dwells = matches!(self.request.g(Group::NonModal), Some((GWord::Dwell, _)));
        if !dwells || !self.rules.dialect.dwell.contains(b'F') {
            self.feed(scene);
        }
        self.functions_before_motion(scene);
        if dwells {
            self.dwell(scene);
        }
        let plane = match self.request.g(Group::Plane) {
            Some((GWord::Plane(plane), _)) => Some(plane),
            Some((GWord::FreePlane, at)) => self.free_plane(scene, at),
            _ => None,
        };
        if let Some(plane) = plane
            && self.modal.plane != plane
        {
            self.modal.plane = plane;
            // R and the bottom were along another axis.
            self.end_cycles();
            self.emit(ContourEventKind::Plane(plane));
        }
        if let Some(corner) = self.request.corner {
            self.emit(ContourEventKind::Corner(corner));
        }
        self.compensation(scene);
        if let Some((GWord::CornerArc, at)) = self.request.g(Group::NonModal) {
            self.corner_arc(scene, at);
        }
        match self.request.g(Group::NonModal) {
            Some((GWord::SetRadius, at)) => self.set_radius(scene, at),
            Some((GWord::SetAxes, at)) => self.set_axes(scene, at, false),
            Some((GWord::RoundingAxes, at)) => self.set_axes(scene, at, true),
            Some((GWord::Home, _)) => self.home_axes(),
            _ => {}
        }
        if let Some((GWord::ExactStop, _)) = self.request.g(Group::ExactStop) {
            self.act(Action::ExactStop);
        }
        self.tool_length(scene);
        self.work_offset();
        self.retract_mode(scene);
        if let Some((GWord::Offset(word), at)) = self.request.g(Group::NonModal) {
            self.offsets(scene, word, at);
        }
        if let Some((GWord::Distance(distance), _)) = self.request.g(Group::Distance) {
            self.modal.distance = distance;
        }
        if let Some((GWord::Centers(distance), _)) = self.request.g(Group::Centers) {
            self.modal.centers = distance;
        }
    }

    /// A line could not be read: all state that it may have changed is unknown.
    pub(crate) fn lose_line(&mut self) {
        self.axes.poison(AxisSet::ALL);
        self.further.poison_known();
        self.modal.feed_is_poisoned = true;
        self.modal.mode_is_poisoned = true;
    }

    /// Returns the contour, the box around it if it has any motion, and the tools of M61.
    pub(crate) fn finish(mut self) -> (ProgrammedContour, Option<Bounds>, Vec<(u32, Source)>) {
        self.contour.assumed_axes = self.contour.assumed_axes.union(self.read_axes.get());
        let bounds = (!self.bounds.axes.is_empty()).then_some(self.bounds);
        (self.contour, bounds, self.named_tools)
    }

    /// Adds an event, with numbers rounded as the planner's node receives them, so that `kerf plan`
    /// judges the same contour.
    #[inline]
    fn emit(&mut self, kind: ContourEventKind) {
        self.contour.events.push(ContourEvent { source: self.source, kind: kind.received() });
    }

    #[inline]
    fn act(&mut self, action: Action) {
        self.emit(ContourEventKind::Action(action));
    }

    /// Millimetres of one unit of length.
    #[inline]
    fn scale(&self) -> f64 {
        match self.modal.units {
            Units::Millimetre => 1.0,
            Units::Inch => MM_PER_INCH,
        }
    }

    /// Takes the value of a letter and marks the letter as used; NaN if it could not be read.
    #[inline]
    fn take(&mut self, letter: u8) -> Option<f64> {
        let letters = Letters::of(&[letter]);
        self.shared = self.shared.union(self.used.intersection(letters));
        self.used = self.used.union(letters);
        self.request.value(letter)
    }

    /// Takes a length or similar, in mm, and checks its limits.
    ///
    /// `None` if absent; NaN if it is not a valid value, which has been reported then.
    #[inline]
    fn take_within(
        &mut self,
        scene: &mut Scene<'_>,
        letter: u8,
        scale: f64,
        max: f64,
        unit: &str,
    ) -> Option<f64> {
        let value = self.take(letter)? * scale;
        if value.abs() > max {
            self.report_size(scene, letter, max, unit);
            return Some(f64::NAN);
        }
        Some(value)
    }

    #[cold]
    fn report_size(&mut self, scene: &mut Scene<'_>, letter: u8, max: f64, unit: &str) {
        let message = format!("{} is beyond {max} {unit}", scene.quote(self.request.word(letter)));
        let help = "look for a missing decimal point, and for inches taken as millimetres";
        self.report(scene, letter, Code::Limit, message, help);
    }

    /// Takes a whole number such as a tool number; `None` if absent or rejected.
    #[inline]
    fn take_number(&mut self, scene: &mut Scene<'_>, letter: u8) -> Option<u32> {
        let value = self.take(letter)?;
        let number = whole(value);
        if number.is_some() {
            return number;
        }
        if !value.is_nan() {
            let word = scene.quote(self.request.word(letter));
            let is_computed = word.contains(['[', '#']);
            let value = if is_computed { format!(" ({value})") } else { String::new() };
            let message = format!("{word}{value} is not a whole number of at most eight digits");
            let help = "write a whole number from 0 to 99999999";
            self.report(scene, letter, Code::BadNumber, message, help);
        }
        None
    }

    /// Reports an error at the word of a letter that is present.
    #[cold]
    fn report(
        &mut self,
        scene: &mut Scene<'_>,
        letter: u8,
        code: Code,
        message: String,
        help: &str,
    ) {
        self.request.is_damaged = true;
        let source = scene.source_of(self.request.word(letter));
        scene.findings.push(Finding::error(code, source, message).help(help));
    }

    /// Reports an error at a word, by its index.
    #[cold]
    fn report_at(
        &mut self,
        scene: &mut Scene<'_>,
        word: usize,
        code: Code,
        message: String,
        help: &str,
    ) {
        self.request.is_damaged = true;
        let source = scene.source_of(word);
        scene.findings.push(Finding::error(code, source, message).help(help));
    }

    /// Reports an error of the whole block.
    #[cold]
    fn report_block(&mut self, scene: &mut Scene<'_>, code: Code, message: String, help: &str) {
        self.request.is_damaged = true;
        scene.findings.push(Finding::error(code, self.source, message).help(help));
    }

    /// Reports words that nothing in the block uses.
    #[inline]
    fn unused_words(&mut self, scene: &mut Scene<'_>) {
        let accepted = self.request.letters_of_accepted();
        let shared = self.shared.union(self.used.intersection(accepted));
        let shared = shared.intersection(self.request.present);
        let unused = self.request.present.without(self.used.union(accepted));
        if (!unused.is_empty() || !shared.is_empty()) && !self.request.has_refused_word {
            self.report_unused(scene, unused, shared);
        }
    }

    #[cold]
    fn report_unused(&mut self, scene: &mut Scene<'_>, unused: Letters, shared: Letters) {
        for letter in unused.union(shared).iter() {
            if self.request.value(letter).is_none_or(f64::is_nan) {
                continue;
            }
            let word = scene.quote(self.request.word(letter));
            if shared.contains(letter) {
                let message = format!("two words of this block use {word}");
                self.report(scene, letter, Code::ModalConflict, message, "write two blocks");
            } else {
                let message = format!("nothing in this block uses {word}");
                let is_axis = Letters::of(FURTHER_AXES).contains(letter);
                let help = match is_axis && !self.rules.dialect.further_axes.contains(letter) {
                    true => NO_FURTHER_AXES,
                    false => "delete it, or program the G word that it belongs to",
                };
                self.report(scene, letter, Code::Syntax, message, help);
            }
        }
    }
}
