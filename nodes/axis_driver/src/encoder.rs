//! A compensated path as lines of grbl 1.1, one at a time.
//!
//! Knows what grbl can do and how it wants it written; keeps the modal state, so
//! that nothing is said twice, and the place in the program of every line. What
//! grbl cannot do is an error that names the source line. Lines are made when they
//! are asked for: a path is encoded once to prove it and once more to send it, and
//! is never held as text. Knows nothing of ports or answers.

mod action;
mod arc;
mod arc_lines;
mod config;
mod firmware_arc;
mod further;
mod override_word;
mod plunge;
mod port;
mod probe;
mod problem;
mod restart;
mod resume;
mod thread;
mod user_function;
pub(crate) mod words;

use crate::link::LineKind;
use crate::vectors::{minus, norm};
use arc_lines::RestOfArc;
use cnc_msgs::contour::{Probe, Source, SpindleMode};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet, Plane, Position, Shape};
use cnc_msgs::path::{CompensatedPath, PathElement, Role};
use firmware_arc::{DrawingFrame, last_place};
pub(crate) use further::DEGREES_MAX;
use further::HeldFurther;
pub use further::StartFurther;
use port::HeldOutput;
use probe::{motion_words, no_motion};
use std::collections::VecDeque;
use std::sync;
use words::{to_grid, write_word};

pub use config::{Board, EncoderConfig, Homing};
pub use override_word::AllowedOverrides;
pub use port::Ports;
pub use problem::{EncodeError, EncodeProblem};
pub(crate) use restart::is_whole;
pub use restart::{StartProblem, start_at};
pub(crate) use thread::{check_pace, no_spindle_sync, shares};
pub use user_function::{CalledFunction, UserFunction};

/// One line and where it comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct EncodedLine {
    /// Without its line end.
    pub text: String,
    pub kind: LineKind,
    /// It is sent when all before it is answered, and nothing follows before its own
    /// answer: the controller reads or writes its EEPROM and loses bytes meanwhile.
    pub is_alone: bool,
    /// The element that this line cuts; `None` when it cuts none.
    pub element: Option<usize>,
    /// The block of the part program; its line is 0 when there is none.
    pub source: Source,
    /// What the element is for.
    pub role: Role,
    /// The events of the path before it, its own included.
    pub events: usize,
}

/// What comes next.
#[derive(Debug, Clone, PartialEq)]
pub enum EncoderStep {
    Line(EncodedLine),
    /// grbl has no tool change: motion ends, the tool is changed by hand, and the
    /// program goes on when that is confirmed. The spindle was stopped before.
    ToolChange {
        tool: u32,
        source: Source,
    },
    /// The controller was asked to change the tool (`M6T2`): it does so, or waits until a
    /// cycle start says that it was done, and the program goes on.
    ControllerChange {
        tool: u32,
        source: Source,
    },
    /// Motion ends, this line moves the axes until a probe touches, or lets go, and the program goes
    /// on from there.
    Probe {
        line: EncodedLine,
        probe: Probe,
    },
    /// Motion ends, this line waits for an input, and the program goes on.
    ReadInput {
        line: EncodedLine,
    },
    /// Motion ends, and what follows is planned from the results of the probes before.
    Stretch {
        source: Source,
    },
    /// Motion ends, a node of the cell does this, and the program goes on.
    UserFunction {
        function: UserFunction,
        source: Source,
    },
    /// Motion ends, and from here on the operator may override no more than this.
    AllowOverrides {
        allowed: AllowedOverrides,
        source: Source,
    },
    /// Motion ends, these axes are homed by this line, and the program goes on.
    Home {
        text: String,
        axes: AxisSet,
        source: Source,
    },
    /// The frame in which the path is written is in force from here on: whether the
    /// tool is where the path begins can be seen now and not before.
    CheckStart,
    /// The tool is back at this place of the machine frame, where the run stopped: is it?
    CheckReturn {
        stood: Position,
    },
}

/// The words in force.
#[derive(Debug, Clone, Default)]
struct Modal {
    /// The G word of motion: 0 to 3.
    motion: Option<u8>,
    plane: Plane,
    feed: Option<i64>,
    /// Axes whose place in the work frame the program has not given since...
    unknown: AxisSet,
    /// ...this word.
    unknown_since: String,
    /// 1 to 9; 0 is the first, which every run begins with.
    work_system: u8,
    /// The word of the tool length in force; empty when there is none.
    tool_length: String,
    tool_length_mm: f64,
    /// F counts moves of a minute (G93).
    is_inverse_time: bool,
    /// Where A, B, C, U, V and W are in the work frame, as far as the path has said.
    further_at: FurtherAxes,
    ended_at: Option<Source>,
}

/// Gives the lines of a path in order.
#[derive(Debug, Clone)]
pub struct Encoder {
    path: sync::Arc<CompensatedPath>,
    config: EncoderConfig,
    next_element: usize,
    next_event: usize,
    modal: Modal,
    pending: VecDeque<EncoderStep>,
    /// What is left of a helix of very many turns.
    rest: Option<RestOfArc>,
    /// The tool comes from above.
    is_lifted: bool,
    start_axes: AxisSet,
    start_further: StartFurther,
    /// S that waits for the line of the next move.
    speed: Option<HeldSpeed>,
    /// What M62, M63 and M67 switch when the next motion begins.
    outputs: Vec<HeldOutput>,
    allowed_overrides: AllowedOverrides,
    /// A, B, C, U, V and W that wait for the line of their block.
    further: Option<HeldFurther>,
    /// Axes that the next motion moves from wherever they are.
    relative: AxisSet,
    /// The further axes that the path never moves away from 0.
    idle_axes: u8,
}

/// A spindle speed or laser power that is not sent yet.
#[derive(Debug, Clone)]
struct HeldSpeed {
    word: String,
    source: Source,
}

/// The words that every run begins with: millimetres, absolute, feed per minute, no
/// compensation, no tool length offset, first work system.
pub const PREAMBLE: &str = "G21G90G94G17G40G49G54";
/// The same for a block in the frame that is in force: its work system and tool length stay.
pub const PREAMBLE_IN_FRAME: &str = "G21G90G94G17G40";
/// A dwell that is answered when all motion before it has ended.
pub const SYNC: &str = "G4P0.01";

impl Encoder {
    /// The whole path, its start being where the tool is. The caller sends
    /// [`PREAMBLE`] first.
    pub fn new(path: sync::Arc<CompensatedPath>, config: EncoderConfig) -> Self {
        Self {
            idle_axes: further::idle_axes(&path),
            further: None,
            relative: AxisSet::NONE,
            path,
            config,
            next_element: 0,
            next_event: 0,
            modal: Modal::default(),
            pending: VecDeque::new(),
            rest: None,
            is_lifted: false,
            start_axes: AxisSet::NONE,
            start_further: StartFurther::default(),
            speed: None,
            outputs: Vec::new(),
            allowed_overrides: AllowedOverrides::default(),
        }
    }

    /// The element that comes next, counted from 0.
    pub fn next_element(&self) -> usize {
        self.next_element
    }

    /// How many events of the path have been encoded.
    pub fn events_begun(&self) -> usize {
        self.next_event
    }

    /// The same place in another path; `None` when that path is not the same so far. It may rely on where
    /// more axes stand, which the caller has to look at.
    pub fn going_on_with(&self, path: sync::Arc<CompensatedPath>) -> Option<Self> {
        let (elements, events) = (self.next_element, self.next_event);
        let is_same = path.start == self.path.start
            && self.path.assumed_axes.without(path.assumed_axes).is_empty()
            && path.elements.get(..elements)? == &self.path.elements[..elements]
            && path.events.get(..events)? == &self.path.events[..events];
        is_same.then(|| Self { idle_axes: further::idle_axes(&path), path, ..self.clone() })
    }

    /// Whether the tool is lifted before anything else, and comes from above.
    pub(crate) fn is_lifted(&self) -> bool {
        self.is_lifted
    }

    /// The axes that must stand where the first element starts, in the middle of a path.
    pub fn start_axes(&self) -> AxisSet {
        self.start_axes
    }

    /// Where A to W must stand then.
    pub fn start_further(&self) -> StartFurther {
        self.start_further
    }

    /// Whether a [`EncoderStep::CheckStart`] is among the next steps.
    pub fn checks_start(&self) -> bool {
        self.pending.contains(&EncoderStep::CheckStart)
    }

    /// The next step; `None` at the end. After an error nothing useful follows.
    pub fn next_step(&mut self) -> Option<Result<EncoderStep, EncodeError>> {
        loop {
            if let Some(step) = self.pending.pop_front() {
                return Some(Ok(step));
            }
            if let Some(rest) = self.rest.take() {
                let source_place = self.path.elements[rest.element].source;
                match self.encode_arc_part(rest) {
                    Ok(()) => continue,
                    Err(problem) => {
                        return Some(Err(EncodeError::new(&self.path, source_place, problem)));
                    }
                }
            }
            let event = self.path.events.get(self.next_event).copied();
            let is_event_due = event.is_some_and(|event| event.at_element <= self.next_element);
            let (source, outcome) = match (event, self.path.elements.get(self.next_element)) {
                (Some(event), element) if is_event_due || element.is_none() => {
                    self.next_event += 1;
                    (event.source, self.encode_action(&event))
                }
                (_, Some(element)) => {
                    let (index, element) = (self.next_element, *element);
                    self.next_element += 1;
                    (element.source, self.encode_element(index, &element))
                }
                (_, None) if self.further.is_some() => {
                    let source = self.further.as_ref().map(|held| held.source).unwrap_or_default();
                    (source, self.refuse_held_further())
                }
                (_, None) => match self.speed.as_ref().map(|speed| speed.source) {
                    Some(source) => (source, self.push_speed()),
                    None => match self.useless_output() {
                        Some(HeldOutput { word, source, .. }) => {
                            (source, Err(EncodeProblem::NoMotionAfter { word }))
                        }
                        None => return None,
                    },
                },
            };
            if let Err(problem) = outcome {
                return Some(Err(EncodeError::new(&self.path, source, problem)));
            }
        }
    }

    fn encode_element(&mut self, index: usize, element: &PathElement) -> Result<(), EncodeProblem> {
        self.refuse_after_end("motion")?;
        let start = self.path.start_of(index);
        self.check_ends(start, element.end)?;
        let further = self.take_further(element.source)?;
        match element.shape {
            Shape::Arc(_) if !self.relative.is_empty() => Err(no_motion(self.relative)),
            Shape::Line => self.encode_line(index, element, start, element.end, further),
            Shape::Arc(_) if !further.is_empty() => {
                let word = format!("arc that also moves{}", further.words());
                Err(EncodeProblem::Unsupported { word })
            }
            Shape::Arc(arc) => self.encode_arc(index, element, start, &arc),
        }
    }

    /// Whether the controller takes the ends of a motion.
    fn check_ends(&self, start: Position, end: Position) -> Result<(), EncodeProblem> {
        for axis in 0..3 {
            for value in [end[axis], start[axis]] {
                self.checked_position(AXIS_LETTERS[axis], value)?;
                self.refuse_coarse(axis, value)?;
            }
        }
        Ok(())
    }

    fn encode_line(
        &mut self,
        index: usize,
        element: &PathElement,
        start: Position,
        end: Position,
        further: FurtherAxes,
    ) -> Result<(), EncodeProblem> {
        let relative = std::mem::take(&mut self.relative);
        if !relative.is_empty() && !further.is_empty() {
            return Err(no_motion(relative));
        }
        let mut text = self.line_number(index);
        let is_rapid = element.feed_mm_per_min.is_none();
        let (axes, words) = motion_words(element.axes, start, end, relative);
        if axes.is_empty() && further.is_empty() {
            return Ok(());
        }
        self.push_outputs(element.source)?;
        self.write_motion(&mut text, u8::from(!is_rapid));
        text += if relative.is_empty() { "" } else { "G91" };
        text += &words;
        match element.feed_mm_per_min {
            Some(feed) if !further.is_empty() => {
                self.write_further(&mut text, further);
                self.write_inverse_time(&mut text, norm(minus(end, start)), feed)?;
            }
            feed => {
                self.write_further(&mut text, further);
                self.write_feed(&mut text, feed)?;
            }
        }
        self.modal.unknown = self.modal.unknown.without(axes.without(relative));
        let kind = self.write_speed(&mut text);
        self.push_motion(text, kind, index, element)?;
        self.push_absolute(relative, element.source)
    }

    /// The beginning of a line that cuts this element.
    fn line_number(&self, index: usize) -> String {
        let mut text = String::with_capacity(60);
        if self.config.line_numbers {
            text = format!("N{}", line_number(index));
        }
        text
    }

    fn write_motion(&mut self, text: &mut String, motion: u8) {
        if self.modal.motion != Some(motion) {
            self.modal.motion = Some(motion);
            *text += ["G0", "G1", "G2", "G3"][usize::from(motion)];
        }
    }

    fn write_feed(&mut self, text: &mut String, feed: Option<f64>) -> Result<(), EncodeProblem> {
        let Some(value) = feed else { return Ok(()) };
        let feed = Some(self.checked_feed(value)?);
        if std::mem::take(&mut self.modal.is_inverse_time) {
            *text += "G94";
            self.modal.feed = None;
        }
        if self.modal.feed != feed {
            self.modal.feed = feed;
            write_word(text, 'F', to_grid(value));
        }
        Ok(())
    }

    /// Writes the speed that waits for a move into its line. On a line of its own the
    /// firmware stops for it; with a laser (`$32=1`) it does not stop for it here.
    fn write_speed(&mut self, text: &mut String) -> LineKind {
        let Some(HeldSpeed { word, .. }) = self.speed.take() else { return LineKind::Motion };
        *text += &word;
        if self.config.board.is_laser { LineKind::Motion } else { LineKind::Slow }
    }

    fn checked_feed(&self, value: f64) -> Result<i64, EncodeProblem> {
        let max = self.config.feed_mm_per_min_max;
        if value.is_finite() && value <= max && to_grid(value) > 0 {
            return Ok(to_grid(value));
        }
        Err(EncodeProblem::Feed { value, max })
    }

    fn checked_position(&self, letter: char, value: f64) -> Result<i64, EncodeProblem> {
        let max = self.config.position_mm_max;
        if value.abs() <= max {
            return Ok(to_grid(value));
        }
        Err(EncodeProblem::Position { letter, value, max })
    }

    /// Where the lines are drawn that come now.
    fn drawing_frame(&self) -> DrawingFrame {
        let Board { arc_tolerance_mm, work_offsets, .. } = self.config.board;
        let system = usize::from(self.modal.work_system.clamp(1, 9)) - 1;
        let mut offset_mm = work_offsets[system];
        offset_mm[2] += self.modal.tool_length_mm;
        DrawingFrame { offset_mm, tolerance_mm: arc_tolerance_mm }
    }

    /// Rejects a coordinate that the controller cannot distinguish from its neighbours.
    fn refuse_coarse(&self, axis: usize, value: f64) -> Result<(), EncodeProblem> {
        let in_machine = value + self.drawing_frame().offset_mm[axis];
        let step = f64::from(last_place(in_machine as f32));
        if step <= STEP_MM_MAX {
            return Ok(());
        }
        Err(EncodeProblem::Resolution { letter: AXIS_LETTERS[axis], value, in_machine, step })
    }

    fn refuse_after_end(&self, word: &str) -> Result<(), EncodeProblem> {
        match self.modal.ended_at {
            Some(source) => {
                Err(EncodeProblem::AfterEnd { word: word.to_owned(), end: source.line })
            }
            None => Ok(()),
        }
    }

    fn push_motion(
        &mut self,
        text: String,
        kind: LineKind,
        index: usize,
        element: &PathElement,
    ) -> Result<(), EncodeProblem> {
        self.push(EncodedLine {
            text,
            kind,
            is_alone: false,
            element: Some(index),
            source: element.source,
            role: element.role,
            events: self.next_event,
        })
    }

    fn push(&mut self, line: EncodedLine) -> Result<(), EncodeProblem> {
        let (bytes, max) = (line.text.len(), self.config.line_bytes_max);
        if bytes > max {
            return Err(EncodeProblem::LineLength { text: line.text, bytes, max });
        }
        self.pending.push_back(EncoderStep::Line(line));
        Ok(())
    }
}

/// The N word of an element's lines; numbers come again after ten million elements.
pub fn line_number(element: usize) -> usize {
    element % LINE_NUMBERS + 1
}

/// The controller's numbers are no farther apart than this where it is sent, mm.
const STEP_MM_MAX: f64 = 0.005;
/// The firmware takes no more.
const LINE_NUMBERS: usize = 9_999_999;

/// The words of the axes that are named or change, in the order X Y Z.
fn axis_words(named: AxisSet, start: Position, end: Position) -> (AxisSet, String) {
    let mut text = String::with_capacity(30);
    let mut axes = AxisSet::NONE;
    for axis in 0..3 {
        let value = to_grid(end[axis]);
        if named.contains(axis) || value != to_grid(start[axis]) {
            write_word(&mut text, AXIS_LETTERS[axis], value);
            axes = axes.with(axis);
        }
    }
    (axes, text)
}

impl EncoderStep {
    /// The line that is sent for it, if it is one.
    pub fn line(&self) -> Option<&EncodedLine> {
        match self {
            Self::Line(line) | Self::Probe { line, .. } | Self::ReadInput { line } => Some(line),
            _ => None,
        }
    }
}

impl Modal {
    /// These axes stand somewhere that the program has not said.
    fn forget(&mut self, axes: AxisSet, since: &str) {
        self.unknown = self.unknown.union(axes);
        since.clone_into(&mut self.unknown_since);
    }

    /// What the end of the program sets: G1, G17, and whatever F was.
    fn reset_at_end(&mut self, source: Source) {
        *self = Self { ended_at: Some(source), ..Self::default() };
    }
}

/// `M3`, `M4`, `M5`.
const fn spindle_word(mode: SpindleMode) -> &'static str {
    match mode {
        SpindleMode::Clockwise => "M3",
        SpindleMode::CounterClockwise => "M4",
        SpindleMode::Off => "M5",
    }
}

#[cfg(test)]
mod tests;
