//! A control profile: every rule in which controls differ.
//!
//! The values come from `config/controls/*.yaml`, which explains each of them.
//! A rule that a program can break is a [`Rule`]: what the control does, and how
//! strictly a program is held to it. An unknown key is an error, because a rule
//! that nobody applies is worse than none. [`Profile::check`] finds values that
//! no control could have.

mod check;
mod radius;
mod selection;

pub use check::ProfileFault;
pub use radius::*;
pub use selection::*;

use crate::contour::OutsideCorner;
use crate::finding::Severity;
use crate::geometry::{AxisSet, Plane};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::str::FromStr;

/// What happens to a program that breaks a rule of its control.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Strictness {
    /// It is refused.
    #[default]
    Error,
    /// It is accepted with a warning, and run in the safe way.
    Warn,
    /// It is accepted with a warning, and run as the control would run it,
    /// safe or not.
    Emulate,
}

impl Strictness {
    /// The severity of the finding about a broken rule.
    pub const fn severity(self) -> Severity {
        match self {
            Self::Error => Severity::Error,
            Self::Warn | Self::Emulate => Severity::Warning,
        }
    }
}

/// What a control does, and how strictly a program is held to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rule<R> {
    pub rule: R,
    #[serde(default)]
    pub strictness: Strictness,
}

impl<R> Rule<R> {
    /// The severity of breaking it.
    pub const fn severity(&self) -> Severity {
        self.strictness.severity()
    }
}

/// The rules of one control.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// The name that `--control` takes.
    pub name: String,
    pub language: Language,
    pub radius: RadiusRules,
    pub corner: CornerRules,
    pub select: SelectRules,
    pub cancel: CancelRules,
    /// G42 while G41 is active, and the reverse (C12).
    pub side_change: SideChangeRules,
    /// G41 while G41 is active (C13).
    pub reselect: Rule<Reselect>,
    /// D0 (C21).
    pub d0: ZeroOffset,
    /// Rapids under compensation (C9).
    pub rapid: Rule<RapidMode>,
    pub off_plane: OffPlaneRules,
    pub auxiliary: AuxiliaryRules,
    /// A full circle in one block (C7).
    pub full_circle: Rule<FullCircle>,
    /// Homing while compensation is active (C16).
    pub home: Rule<HomeMode>,
    /// How far the control looks ahead (C17).
    pub lookahead: LookaheadRules,
    /// G41 in a single block of manual data input (C20).
    pub mdi: Rule<MdiMode>,
    /// Starting in the middle of a compensated contour (C19).
    pub restart: Rule<RestartMode>,
    /// Words that a block under compensation must not have, as written: `G54`.
    #[serde(default)]
    pub forbidden_under_compensation: ForbiddenWords,
    pub interference: InterferenceRules,
    /// The point of the tool that follows the path.
    #[serde(default)]
    pub output: OutputPoint,
    #[serde(default)]
    pub display: Display,
    /// How far the tool may stay off a consumed element before it counts as unreachable.
    pub accept_tolerance_mm: f64,
}

/// How programs are written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Language {
    /// The lexer and word table (C5).
    pub dialect: Dialect,
    /// Planes in which compensation works (C8).
    pub planes: Rule<Vec<Plane>>,
    /// Axes whose motion may be compensated, `XYZ`: the dominant ones (A01).
    #[serde(default = "all_axes")]
    pub dominant_axes: Rule<AxisSet>,
    /// X is programmed as a diameter (Okuma).
    #[serde(default)]
    pub x_is_diameter: bool,
}

const fn all_axes() -> Rule<AxisSet> {
    Rule { rule: AxisSet::ALL, strictness: Strictness::Error }
}

/// A lexer and word table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Dialect {
    Rs274,
    #[serde(rename = "sinumerik_840c")]
    Sinumerik840c,
    Masso,
    Automation1,
    OspLathe,
    Nct,
}

/// What happens at outside corners (C6).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CornerRules {
    /// What each G word of the control selects: `G450: arc`. Empty when there is no choice.
    #[serde(default, deserialize_with = "crate::unique::map")]
    pub words: BTreeMap<String, OutsideCorner>,
    pub default: OutsideCorner,
    /// The machine datum d: obtuse corners with arcs whose ends are nearer than
    /// this get no block of their own (S68, S69, S71); 0: they always do.
    #[serde(default)]
    pub short_block_mm: f64,
    /// An outside corner whose offsets do not meet where they should: a reversal, or
    /// an arc that curves away (O08); unless it is refused, an arc goes around it.
    #[serde(default)]
    pub no_intersection: Strictness,
    /// A circle that its corner would lengthen over 360 degrees (S70); emulate:
    /// only what is above 360 degrees is run.
    #[serde(default)]
    pub arc_over_360: Strictness,
}

/// What a rapid under compensation does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RapidMode {
    /// It is compensated like a feed move.
    Compensated,
    /// Its ends are compensated; the machine chooses the way between them (A08).
    Endpoint,
    /// It goes to its programmed end.
    Raw,
}

/// Blocks without motion in the plane between two that have it (C1).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OffPlaneRules {
    /// How many there may be; absent: any number.
    pub max_blocks: Option<u32>,
    /// One block too many; emulate: the block before ends perpendicular, which cuts
    /// into inside corners (S63).
    pub strictness: Strictness,
    /// The control's alarm for one block too many.
    pub alarm: Option<String>,
}

/// Functions and moves out of the plane while compensation is active (C2).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AuxiliaryRules {
    /// Spindle, coolant and M functions.
    pub functions: Rule<Permission>,
    /// Moves of the third axis.
    pub moves: Rule<Permission>,
    /// Where functions without a move run when they stand between two blocks.
    #[serde(default)]
    pub anchor: Anchor,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Permission {
    Allowed,
    Forbidden,
}

/// Where functions between two blocks with motion run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Anchor {
    /// Before the generated corner (S51).
    #[default]
    BeforeCorner,
    /// Functions of blocks without any move after the corner, the others before it (SINUMERIK 880).
    AfterCorner,
}

/// What a full circle in one block means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FullCircle {
    Allowed,
    Forbidden,
}

/// What homing does to compensation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HomeMode {
    /// It ends compensation at once, without a lead-off (A05).
    Drop,
    Forbidden,
}

/// How far a control looks ahead.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LookaheadRules {
    /// Blocks with motion in the plane; absent: the whole program.
    pub blocks: Option<u32>,
    /// A contour violation that the control is too short-sighted to see.
    #[serde(default)]
    pub strictness: Strictness,
}

/// What G41 does in manual data input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MdiMode {
    /// Nothing: the block runs as it is programmed (N09).
    Uncompensated,
    Forbidden,
}

/// What starting inside a compensated contour does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RestartMode {
    /// The run begins at the compensated point.
    Rebuild,
    /// The program starts before the selection (M28).
    Forbidden,
}

/// Words that must not stand under compensation.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForbiddenWords {
    pub words: Vec<String>,
    #[serde(default)]
    pub strictness: Strictness,
}

/// What happens when the tool does not fit a contour (C18).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InterferenceRules {
    /// What happens when the tool gouges a contour or does not reach it.
    #[serde(default)]
    pub react: Reaction,
    /// A lead that cuts into its contour.
    pub leads: Strictness,
    /// A lead that only passes over the free end of what it leads onto or leaves.
    #[serde(default = "warn")]
    pub lead_nick: Strictness,
    /// A cut between the beginning and the end of a contour, where it closes: some manuals'
    /// own figures begin there in an inside corner.
    #[serde(default = "error")]
    pub at_closing: Strictness,
    /// A cut into what an earlier contour of the program left.
    #[serde(default)]
    pub other_spans: OtherSpans,
    /// Where the material begins, work coordinate along the tool, mm. A lead above this and
    /// above all cuts of a contour passes over its walls.
    #[serde(default)]
    pub stock_top_mm: f64,
    /// The smallest radius of an arc that the tool runs inside of.
    #[serde(default = "any_arc")]
    pub inside_arc: Rule<InsideArc>,
    /// The control's alarm for a contour that the tool does not fit.
    pub alarm: Option<String>,
}

/// What happens when the tool cuts into what an earlier contour of the program left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OtherSpans {
    /// The program is refused.
    Error,
    /// A warning: a finishing contour is meant to cut what a roughing contour left.
    #[default]
    Warn,
    /// Contours are not compared: each may belong to a different part.
    Ignore,
}

/// What happens when the tool does not fit a contour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reaction {
    /// The program is refused, with all places.
    #[default]
    Alarm,
    /// What does not fit is left out, with warnings; what stays uncut is reported.
    Trim,
    /// A warning; the tool cuts what it cuts.
    Ignore,
}

impl FromStr for Reaction {
    type Err = UnknownReaction;

    fn from_str(name: &str) -> Result<Self, UnknownReaction> {
        match name {
            "alarm" => Ok(Self::Alarm),
            "trim" => Ok(Self::Trim),
            "ignore" => Ok(Self::Ignore),
            _ => Err(UnknownReaction(name.to_owned())),
        }
    }
}

/// Not the name of a [`Reaction`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is not a reaction to interference; use alarm, trim or ignore")]
pub struct UnknownReaction(String);

const fn error() -> Strictness {
    Strictness::Error
}

const fn warn() -> Strictness {
    Strictness::Warn
}

const fn any_arc() -> Rule<InsideArc> {
    Rule { rule: InsideArc::Any, strictness: Strictness::Error }
}

/// The smallest radius of an arc that the tool runs inside of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InsideArc {
    /// Larger than the radius of the tool, so that some of the arc is left.
    Any,
    /// At least twice the radius of the nose (Okuma).
    TwiceTheRadius,
}

/// The point of the tool that follows the path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OutputPoint {
    /// The centre of the tool or of its nose (O06).
    #[default]
    Center,
    /// The theoretical tip of a turning tool (S66, S73).
    Tip,
}

/// How pictures are drawn; the path does not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Display {
    /// Turning in front of the centre: X points down (S02).
    pub mirror_x: bool,
}
