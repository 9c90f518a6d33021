//! What the words of each control mean.
//!
//! There is no global table: G43, G10 or H mean different things on different controls. Each
//! dialect has its own file in `dialect/`. This file has the meanings that the interpreter can
//! execute.

pub(crate) mod automation1;
mod masso;
mod nct;
mod osp_lathe;
mod rs274;
mod sinumerik_840c;

use crate::block::LexerRules;
pub(crate) use crate::interpreter::{Cycle, OffsetWord, Spline, StateWord};
use crate::no_effect::{self, NoEffect};
use crate::turning::{Along, Pockets};
use cnc_msgs::contour::{CoolantMode, CutterSide, Probe, SpindleMode};
use cnc_msgs::geometry::Plane;
use cnc_msgs::profile;

/// One language of part programs.
#[derive(Debug)]
pub(crate) struct Dialect {
    pub(crate) lexer: LexerRules,
    /// The meaning of a G number, in tenths: G41.1 is 411.
    pub(crate) g: fn(u16) -> GWord,
    /// The meaning of an M number.
    pub(crate) m: fn(u16) -> MWord,
    /// The plane in force when a program begins.
    pub(crate) plane: Plane,
    /// Letters, in addition to G, M and N, that have a meaning in some block.
    pub(crate) letters: Letters,
    /// Axes besides X, Y and Z: A, B and C turn, U, V and W are straight.
    pub(crate) further_axes: Letters,
    /// Axes of this language that the machine does not have.
    pub(crate) foreign_axes: Letters,
    /// Letters that are passed on to the machine with their number.
    pub(crate) auxiliary: Letters,
    /// What I, J and K mean in a block with G41.
    pub(crate) approach: ApproachWords,
    /// Letters for the dwell time of G4, seconds.
    pub(crate) dwell: Letters,
    /// Whether G2 and G3 accept a radius, and turns with P.
    pub(crate) arc_radius_and_turns: bool,
    /// The letter of that radius.
    pub(crate) arc_radius: u8,
    /// Whether a line with only `%` begins and ends the program; else `%` begins a program name.
    pub(crate) percent_delimits: bool,
}

/// Where G41 takes its radius from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RadiusWord {
    /// D, a tool number; without it the tool in the spindle.
    Tool,
    /// D, the number of an offset register; modal; 0 selects nothing.
    ModalOffset,
    /// P, a radius that is added to the radius of the tool in the spindle.
    Addend,
    /// No word of G41: another word or call has set it.
    Set,
    /// Six digits of T: nose radius, tool and tool offset; T also turns the turret.
    Nose,
}

/// What I, J and K mean in a block with G41.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ApproachWords {
    None,
    /// The direction of an imaginary line to the end of the block (NCT).
    Direction,
    /// A point on that line, relative to the end of the block (OSP).
    Point,
}

/// What a G word means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum GWord {
    Motion(Mode),
    /// G80.
    NoMotion,
    Plane(Plane),
    Distance(Distance),
    /// How I, J and K are given.
    Centers(Distance),
    Units(Units),
    CompensationOff,
    CompensationOn {
        side: CutterSide,
        /// Whether D is a diameter.
        is_dynamic: bool,
    },
    Length(LengthWord),
    LengthOff,
    /// 1 to 9.
    WorkOffset(u8),
    /// Says what holds anyway.
    Accepted(Group),
    /// Accepted, together with these letters, and reported once.
    NoEffect(Group, Letters, NoEffect),
    Dwell,
    /// A corner arc about the end of the previous block (NCT G39).
    CornerArc,
    /// The plane of the named axes (840C G16).
    FreePlane,
    /// The axes of compensation, in order (Automation1 G44).
    SetAxes,
    /// The axes of corner rounding, in order.
    RoundingAxes,
    /// The radius of compensation (Automation1 G43).
    SetRadius,
    /// Homes axes.
    Home,
    /// G9: the axes stop at the end of this block.
    ExactStop,
    Reference {
        second: bool,
    },
    MachineCoordinates,
    /// Moves the zero of the program, or changes an offset of the machine.
    Offset(OffsetWord),
    /// How F is given.
    FeedMode(FeedMode),
    /// Whether S is the speed along the surface that is turned (G96), or that of the spindle (G97).
    SurfaceSpeed(bool),
    /// Where the cycles end: at R (G99), or where they began (G98).
    Retract {
        to_r: bool,
    },
    /// Whether X is a diameter.
    Diameter(bool),
    /// G70 to G72.
    LatheCycle(LatheCycle),
    /// Known, but not supported here; the text says what to do instead.
    Refused(&'static str),
    /// A canned cycle or similar: axis words after it are not moves.
    RefusedMotion(&'static str),
    Unknown,
}

/// G words of one group exclude each other in a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Group {
    NonModal,
    Motion,
    Plane,
    Distance,
    Centers,
    Feed,
    Units,
    Compensation,
    Length,
    Retract,
    WorkOffset,
    Path,
    SpindleMode,
    MachineCoordinates,
    Corner,
    Approach,
    ExactStop,
    CycleCancel,
    Diameter,
}

impl Group {
    pub(crate) const COUNT: usize = 19;
}

impl GWord {
    /// A word about how the path is followed, which the controller decides.
    pub(crate) const fn of_path(letters: Letters) -> Self {
        Self::NoEffect(Group::Path, letters, no_effect::PATH)
    }

    /// The group; `None` for words that are always rejected.
    pub(crate) const fn group(self) -> Option<Group> {
        Some(match self {
            Self::Motion(_) | Self::LatheCycle(_) | Self::RefusedMotion(_) => Group::Motion,
            // It is in the motion group by the standard. But many posted programs begin with
            // `G0 G17 G80`, which is unambiguous without cycles.
            Self::NoMotion => Group::CycleCancel,
            Self::Plane(_) | Self::FreePlane => Group::Plane,
            Self::Distance(_) => Group::Distance,
            Self::Centers(_) => Group::Centers,
            Self::Units(_) => Group::Units,
            Self::CompensationOff | Self::CompensationOn { .. } => Group::Compensation,
            Self::Length(_) | Self::LengthOff => Group::Length,
            Self::WorkOffset(_) => Group::WorkOffset,
            Self::Accepted(group) | Self::NoEffect(group, ..) => group,
            Self::Dwell
            | Self::CornerArc
            | Self::SetAxes
            | Self::RoundingAxes
            | Self::SetRadius
            | Self::Home
            | Self::Reference { .. } => Group::NonModal,
            Self::Offset(_) => Group::NonModal,
            Self::FeedMode(_) => Group::Feed,
            Self::SurfaceSpeed(_) => Group::SpindleMode,
            Self::Retract { .. } => Group::Retract,
            Self::Diameter(_) => Group::Diameter,
            Self::ExactStop => Group::ExactStop,
            Self::MachineCoordinates => Group::MachineCoordinates,
            Self::Refused(_) | Self::Unknown => return None,
        })
    }
}

impl GWord {
    /// Whether it changes only what later blocks mean, and only in this program.
    pub(crate) const fn only_acts_later(self) -> bool {
        matches!(
            self,
            Self::Offset(
                OffsetWord::Local
                    | OffsetWord::Axis
                    | OffsetWord::AxisOff { .. }
                    | OffsetWord::AxisRestore
            ) | Self::Motion(Mode::Spline(Spline::Open))
        )
    }
}

impl MWord {
    /// Whether it acts only on later blocks of this program.
    pub(crate) const fn only_acts_later(self) -> bool {
        matches!(self, Self::State(_) | Self::CallProgram | Self::EndProgram | Self::NameTool)
    }
}

/// What axis words mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mode {
    Rapid,
    Feed,
    Arc {
        clockwise: bool,
    },
    /// A move to a point at an angle and a distance from a pole.
    Polar {
        rapid: bool,
    },
    /// A drilling cycle.
    Cycle(Cycle),
    /// A curve, or a part of one.
    Spline(Spline),
    /// A move that a probe ends.
    Probe(Probe),
    /// G33: a move that keeps pace with the spindle.
    Thread,
    /// G76: a thread in passes.
    ThreadCycle,
}

/// A lathe cycle along a profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LatheCycle {
    /// G70.
    Finish,
    /// G71 and G72, and those with .1 and .2.
    Rough { along: Along, pockets: Pockets },
}

/// Where a tool length comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LengthWord {
    /// G43: H, a tool of the table; 0 is the one in the spindle.
    Tool,
    /// The same, where H0 is not what it is in LinuxCNC: it is refused.
    Offset,
    /// G43.1: Z.
    Given,
    /// G43.2: H or Z, added to the length in force.
    Added,
}

/// How F is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FeedMode {
    /// G93: moves of a minute.
    InverseTime,
    /// G94: units a minute.
    PerMinute,
    /// G95: units a revolution of the spindle.
    PerRevolution,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Distance {
    Absolute,
    Incremental,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Units {
    Inch,
    Millimetre,
}

/// What an M word means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MWord {
    Stop {
        optional: bool,
    },
    ProgramEnd {
        rewind: bool,
    },
    Spindle(SpindleMode),
    Coolant(CoolantMode),
    ChangeTool,
    /// M98: calls the program of the number P, L times.
    CallProgram,
    /// M99.
    EndProgram,
    /// M70 to M73.
    State(StateWord),
    /// A function of the machine, before or after the motion of its block.
    Auxiliary {
        after_motion: bool,
    },
    /// M61: names the tool in the spindle.
    NameTool,
    /// A function of the machine with words of its own (`interpreter/machine_words.rs`).
    Machine,
    Refused(&'static str),
    Unknown,
}

/// A set of letters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Letters(u32);

impl Letters {
    pub(crate) const NONE: Self = Self(0);

    /// The set of these capitals.
    pub(crate) const fn of(letters: &[u8]) -> Self {
        let mut bits = 0;
        let mut at = 0;
        while at < letters.len() {
            bits |= 1 << (letters[at] - b'A');
            at += 1;
        }
        Self(bits)
    }

    #[inline]
    pub(crate) const fn contains(self, letter: u8) -> bool {
        self.0 & 1 << (letter - b'A') != 0
    }

    #[inline]
    pub(crate) const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    #[inline]
    pub(crate) const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    #[inline]
    pub(crate) const fn intersection(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    #[inline]
    pub(crate) const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The letters in alphabetical order.
    pub(crate) fn iter(self) -> impl Iterator<Item = u8> {
        (b'A'..=b'Z').filter(move |&letter| self.contains(letter))
    }
}

/// The dialect of a profile.
pub(crate) const fn of(dialect: profile::Dialect) -> &'static Dialect {
    match dialect {
        profile::Dialect::Rs274 => &rs274::DIALECT,
        profile::Dialect::Masso => &masso::DIALECT,
        profile::Dialect::Automation1 => &automation1::DIALECT,
        profile::Dialect::OspLathe => &osp_lathe::DIALECT,
        profile::Dialect::Nct => &nct::DIALECT,
        profile::Dialect::Sinumerik840c => &sinumerik_840c::DIALECT,
    }
}
