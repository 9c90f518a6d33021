//! The neutral events between a dialect and the planner.
//!
//! A dialect turns its words into these; the planner reads nothing else and
//! never sees a G number. Order is order of execution.

use crate::calls::Calls;
use crate::further::FurtherMove;
use crate::geometry::{AxisSet, Direction, Plane, Position, Shape};
use crate::text::{Text, Words};
use serde::{Deserialize, Serialize};

/// What a part program means, before any compensation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ProgrammedContour {
    /// Where the tool is before the first event, in the work frame.
    pub start: Position,
    /// Axes whose start value the motions rely on because the program does not
    /// name them first (an arc, an incremental move or a lead-on from an
    /// unnamed position). A driver runs the program only from there.
    pub assumed_axes: AxisSet,
    /// All events in order of execution.
    pub events: Vec<ContourEvent>,
    /// The calls and loop passes that the events were run in.
    pub calls: Calls,
}

impl ProgrammedContour {
    /// Drops the calls and passes of all events, as in the messages of before there were any.
    pub fn forget_calls(&mut self) {
        self.calls = Calls::default();
        self.events.iter_mut().for_each(|event| event.source.call = 0);
    }
}

/// One event and the block it comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContourEvent {
    pub source: Source,
    pub kind: ContourEventKind,
}

/// The place in the part program that an event or element comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct Source {
    /// Line, from 1; 0 when there is none.
    pub line: u32,
    /// The N number, if the block has one.
    pub block: Option<u32>,
    /// First column of the block, from 1, in characters.
    pub column: u16,
    /// Length of the block, in characters.
    pub length: u16,
    /// Row in the table of calls, from 1: how the line came to be run; 0 in the main program
    /// outside of loops.
    pub call: u32,
}

impl Source {
    /// Whether it is of the same line, and of the same time that the line was run.
    pub fn is_same_place(self, other: Self) -> bool {
        (self.line, self.call) == (other.line, other.call)
    }
}

/// What happens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ContourEventKind {
    /// The tool moves.
    Motion(Motion),
    /// The plane of compensation is selected.
    Plane(Plane),
    /// Where the next compensation takes its radius from.
    Radius(RadiusSource),
    /// Compensation is selected, turned to the other side, or selected again; it takes
    /// effect with the next motion in the plane.
    /// `along`: the contour is entered as if a line in this direction led to it.
    Select { side: CutterSide, approach: Option<Approach>, along: Option<Direction> },
    /// Compensation is switched off with the next motion in the plane.
    Cancel { exit: Option<Approach> },
    /// How outside corners are rounded from here on.
    Corner(OutsideCorner),
    /// The program changes the value of the offset in force to this radius, mm.
    RadiusValue { radius_mm: f64 },
    /// The offset keeps the direction it has, or has this one, until the next
    /// motion in the plane has ended (NCT G38).
    HoldDirection { along: Option<Direction> },
    /// An arc about the end of the block before, to the offset of the next block
    /// or in this direction (NCT G39).
    CornerArc { along: Option<Direction> },
    /// A block that calculates and does nothing else, under compensation: one of those without motion.
    Calculation,
    /// Something for the machine that is not motion of the contour.
    Action(Action),
}

/// One motion; it starts where the motion before it ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    pub shape: Shape,
    pub end: Position,
    pub class: MotionClass,
    /// Feed rate in force, mm/min. 0 for rapids, but after a selection of compensation
    /// when no motion has had this feed yet: a corner before a rapid may be an arc.
    pub feed_mm_per_min: f64,
    /// The axes that the block names (G1 X10 Y10: XY), whether or not they move.
    pub axes: AxisSet,
}

/// How the axes move together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MotionClass {
    /// As fast as the machine can, along the line (G0).
    Rapid,
    /// At a feed rate along the path (G1, G2, G3).
    Feed,
    /// Each axis by itself; the path between the ends is not known (`MoveRapid`).
    NonCoordinated,
}

/// The side of the contour that the tool runs on, seen along the direction of motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CutterSide {
    /// G41.
    Left,
    /// G42.
    Right,
}

/// How a start or an end beyond the contour is reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Approach {
    /// Around the end point as around a corner (840C G455).
    Corner,
    /// Straight to the point perpendicular to the contour (840C G456).
    Normal,
}

/// What the tool does at a corner that turns away from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OutsideCorner {
    /// A circle about the corner (840C G450).
    Arc,
    /// On to the intersection of the two offsets, however far that is.
    Intersection,
    /// Intersection for obtuse corners; each offset lengthened by the radius
    /// and joined by a line for acute ones (840C G451).
    ExtendByRadius,
}

/// Where the compensation radius comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RadiusSource {
    /// The tool in the spindle.
    SpindleTool,
    /// The tool of this number (LinuxCNC `D`).
    Tool(u32),
    /// The offset register of this number (`D` on 840C and NCT).
    Offset(u32),
    /// This diameter, mm (LinuxCNC `G41.1 D`). Unless `tip` is 0, the path is that of the tip of a
    /// turning tool, and `tip` its direction, 1 to 9 (`G41.1 D L`).
    Diameter { mm: f64, tip: u8 },
    /// This radius, mm (Automation1 `G43 P`).
    Radius(f64),
    /// The tool in the spindle and this radius added, mm (MASSO `P`).
    SpindleToolPlus(f64),
    /// The nose radius of this number (Okuma six-digit `T`).
    Nose(u32),
}

/// Something for the machine that is not motion of the contour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action {
    /// `S`, revolutions per minute.
    SpindleSpeed { rpm: f64 },
    /// `M3`, `M4`, `M5`.
    Spindle(SpindleMode),
    /// `M7`, `M8`, `M9`.
    Coolant(CoolantMode),
    /// `T`: the tool that the next change puts in.
    SelectTool { tool: u32 },
    /// `M6`: the tool that is in the spindle afterwards.
    ChangeTool { tool: u32 },
    /// `G43 H` and `G49`: the tool length offset; the loader gives the number (`None`: cancel), and
    /// what is added to the length in the tool table; the planner adds them. Number 0 is no tool:
    /// the program gives the whole length (`G43.1`). The length of the second number is added as well
    /// (`G43.2 H`).
    ToolLength { offset: Option<u32>, second: Option<u32>, length_mm: f64 },
    /// `G54` to `G59.3`: 1 to 9. Positions after it are in that system.
    WorkOffset { system: u8 },
    /// `G4`, seconds.
    Dwell { seconds: f64 },
    /// A word that only the machine understands: `H3`, or `M62` with the words `P1`.
    Auxiliary { letter: char, number: f64, words: Words },
    /// `M0`, or `M1` when optional: motion stops until the operator resumes it.
    Stop { optional: bool },
    /// `G28`, or `G30` when second: these axes go to the stored position.
    Reference { axes: AxisSet, second: bool },
    /// `G10 L2`, or `G10 L20` when `by_position`: the controller stores the origin of a work
    /// system, 1 to 9, in machine coordinates, or so that the position now reads this, mm; only the
    /// axes that are named.
    SetWorkOffset { system: u8, axes: AxisSet, origin: Position, by_position: bool },
    /// `G28.1`, or `G30.1` when second: the controller stores where it is.
    StoreReference { second: bool },
    /// `G53`: a move in machine coordinates, mm; only the axes that are named.
    MachineMove { target: Position, axes: AxisSet, rapid: bool, feed_mm_per_min: f64 },
    /// `G38.2` to `G38.5`: the motion of the block ends where a probe touches, on the way to its end.
    Probe(Probe),
    /// `G33`: the motion of the block keeps pace with the turning spindle, by so much for each revolution, mm.
    SpindleSync { pitch_mm: f64 },
    /// Nobody knows where these axes are: the motion of the block moves them from there, by its end
    /// less its start.
    Relative { axes: AxisSet },
    /// A new stretch begins: what follows is planned from the results of the probes before. The places of
    /// these axes are known from here on, and a rapid that moves nothing says them.
    Stretch { axes: AxisSet },
    /// The block moves A, B, C, U, V or W, with its motion or alone.
    Further(FurtherMove),
    /// These axes are homed; the machine decides where they are afterwards.
    Home { axes: AxisSet },
    /// The axes stop here before the next motion (`G9`).
    ExactStop,
    /// `(MSG, put in the 6 mm cutter)`: the operator sees this when the tool is here.
    Message { text: Text },
    /// `M2`, or `M30` when it rewinds.
    ProgramEnd { rewind: bool },
}

/// What ends a probe.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Probe {
    /// That it lets go, and not that it touches.
    pub away: bool,
    /// Or the end of its motion, which is an alarm otherwise.
    pub may_miss: bool,
}

impl Probe {
    /// `G38.2`.
    pub const fn word(self) -> &'static str {
        ["G38.2", "G38.3", "G38.4", "G38.5"][self.number() as usize - 2]
    }

    /// The digit after the point, 2 to 5.
    pub const fn number(self) -> u8 {
        2 + 2 * self.away as u8 + self.may_miss as u8
    }

    pub const fn of_number(number: u32) -> Option<Self> {
        match number {
            2..=5 => Some(Self { away: number >= 4, may_miss: number % 2 == 1 }),
            _ => None,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SpindleMode {
    Clockwise,
    CounterClockwise,
    Off,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CoolantMode {
    Mist,
    Flood,
    Off,
}

impl Action {
    /// The kind as `kerf plan --json` and the messages name it.
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::SpindleSpeed { .. } | Self::Spindle(_) => "spindle",
            Self::Coolant(_) => "coolant",
            Self::SelectTool { .. } | Self::ChangeTool { .. } => "tool",
            Self::Dwell { .. } => "dwell",
            Self::Stop { .. } => "stop_point",
            Self::ProgramEnd { .. } => "program_end",
            Self::Message { .. } => "message",
            Self::Further(_) => "axes",
            Self::Probe(_) => "probe",
            Self::SpindleSync { .. } => "spindle_sync",
            Self::Relative { .. } => "relative",
            Self::Stretch { .. } => "stretch",
            Self::ToolLength { .. }
            | Self::WorkOffset { .. }
            | Self::Auxiliary { .. }
            | Self::Reference { .. }
            | Self::Home { .. }
            | Self::ExactStop
            | Self::SetWorkOffset { .. }
            | Self::StoreReference { .. }
            | Self::MachineMove { .. } => "aux",
        }
    }

    /// Whether it sends all axes to their switches.
    pub fn homes_all(&self) -> bool {
        matches!(self, Self::Home { axes } if *axes == AxisSet::ALL || axes.is_empty())
    }

    /// Whether the axes A to W of its block belong to it: it goes to another frame, or sets one.
    pub fn takes_further(&self) -> bool {
        matches!(
            self,
            Self::MachineMove { .. } | Self::Reference { .. } | Self::SetWorkOffset { .. }
        )
    }

    /// Whether all axes A to W are elsewhere after it, or count from another zero.
    pub fn loses_further(&self) -> bool {
        matches!(self, Self::WorkOffset { .. }) || self.homes_all()
    }

    /// The canonical word: `S80`, `M3`, `G4 P0.5`.
    pub fn text(&self) -> String {
        match *self {
            Self::SpindleSpeed { rpm } => format!("S{rpm}"),
            Self::Spindle(SpindleMode::Clockwise) => "M3".into(),
            Self::Spindle(SpindleMode::CounterClockwise) => "M4".into(),
            Self::Spindle(SpindleMode::Off) => "M5".into(),
            Self::Coolant(CoolantMode::Mist) => "M7".into(),
            Self::Coolant(CoolantMode::Flood) => "M8".into(),
            Self::Coolant(CoolantMode::Off) => "M9".into(),
            Self::SelectTool { tool } => format!("T{tool}"),
            Self::ChangeTool { .. } => "M6".into(),
            Self::ToolLength { offset: Some(0), length_mm, .. } => format!("G43.1 Z{length_mm}"),
            Self::ToolLength { offset: Some(offset), second: Some(second), .. } => {
                format!("G43 H{offset} G43.2 H{second}")
            }
            Self::ToolLength { offset: Some(offset), .. } => format!("G43 H{offset}"),
            Self::ToolLength { offset: None, .. } => "G49".into(),
            Self::WorkOffset { system } => work_system(system),
            Self::Dwell { seconds } => format!("G4 P{seconds}"),
            Self::Auxiliary { letter, number, words } => {
                let blank = if words == Words::EMPTY { "" } else { " " };
                format!("{letter}{number}{blank}{words}")
            }
            Self::Stop { optional: false } => "M0".into(),
            Self::Stop { optional: true } => "M1".into(),
            Self::Reference { axes, second } => {
                format!("G{} {}", if second { 30 } else { 28 }, axes.letters())
            }
            Self::MachineMove { target, axes, rapid, .. } => {
                format!("G53 G{}{}", u8::from(!rapid), axis_words(axes, target))
            }
            Self::SetWorkOffset { system, axes, origin, by_position } => {
                let mode = if by_position { 20 } else { 2 };
                format!("G10 L{mode} P{system}{}", axis_words(axes, origin))
            }
            Self::StoreReference { second } => if second { "G30.1" } else { "G28.1" }.into(),
            Self::Further(further) => further.text(),
            Self::Probe(probe) => probe.word().into(),
            Self::SpindleSync { pitch_mm } => format!("G33 K{pitch_mm}"),
            Self::Relative { axes } => format!("G91 {}", axes.letters()),
            Self::Stretch { .. } => "(results of probes)".into(),
            Self::Home { axes } => format!("Home {}", axes.letters()),
            Self::ExactStop => "G9".into(),
            Self::Message { text } => format!("(MSG, {text})"),
            Self::ProgramEnd { rewind: false } => "M2".into(),
            Self::ProgramEnd { rewind: true } => "M30".into(),
        }
    }
}

/// The word that selects a work system: `G54` for 1, `G59.3` for 9.
pub fn work_system(system: u8) -> String {
    match system {
        7.. => format!("G59.{}", system - 6),
        _ => format!("G{}", 53 + u32::from(system)),
    }
}

/// ` X10 Z-5`
fn axis_words(axes: AxisSet, values: Position) -> String {
    let named = (0..3).filter(|&axis| axes.contains(axis));
    named.map(|axis| format!(" {}{}", crate::geometry::AXIS_LETTERS[axis], values[axis])).collect()
}
