//! A controller profile: every rule in which controls differ.
//!
//! The values come from `config/controllers/*.yaml`, where each is explained
//! beside its value. Keys are added as rules need them; an unknown key is an
//! error, because a rule that nobody applies is worse than none.

use crate::contour::{Approach, OutsideCorner};
use crate::diagnostic::Severity;
use crate::geometry::Plane;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The rules of one control.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// The name that `--controller` takes.
    pub name: String,
    pub language: Language,
    pub radius: RadiusRules,
    pub corner: CornerRules,
    pub select: SelectRules,
    pub cancel: CancelRules,
    /// G41 while G41 is active, without a change of side.
    pub reselect: Reselect,
    pub off_plane: OffPlaneRules,
    pub auxiliary: AuxiliaryRules,
    pub full_circle: FullCircle,
    /// Words that a block under compensation must not hold, as they are written: `G54`.
    #[serde(default)]
    pub forbidden_under_compensation: Vec<String>,
    pub interference: InterferenceRules,
    /// How far the tool may stay off a consumed element before it counts as unreachable.
    pub accept_tolerance_mm: f64,
}

/// How programs are written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Language {
    /// The lexer and word table.
    pub dialect: Dialect,
    /// Planes in which compensation works.
    pub planes: Vec<Plane>,
}

/// A lexer and word table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Dialect {
    Rs274,
    #[serde(rename = "sinumerik_840c")]
    Sinumerik840c,
    Masso,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RadiusRules {
    /// What D, P or their absence mean.
    pub source: RadiusKind,
    /// A negative resolved radius.
    pub negative: NegativeRadius,
}

/// What a control calls the radius.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RadiusKind {
    /// D is a tool number; without D the tool in the spindle.
    ToolNumber,
    /// D is an offset register.
    DRegister,
    /// The tool in the spindle, (diameter + wear)/2, and P added.
    SpindleToolPlusP,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NegativeRadius {
    /// The tool runs on the other side.
    Flip,
    Error,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CornerRules {
    /// What each G word of the control selects: `G450: arc`. Empty when there is no choice.
    #[serde(default)]
    pub words: BTreeMap<String, OutsideCorner>,
    pub default: OutsideCorner,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SelectRules {
    /// Where the lead-on ends.
    pub target: SelectTarget,
    /// What each G word of the control selects: `G455: corner`.
    #[serde(default)]
    pub words: BTreeMap<String, Approach>,
    /// Start behind the contour without such a word.
    pub default: Approach,
    /// What the length of the lead-on must be, compared with the radius.
    pub length: LeadLength,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SelectTarget {
    /// Perpendicular to the start of the next element.
    NormalNext,
    /// Perpendicular to the end of the entry move, joined to the next element as a corner.
    NormalEntry,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LeadLength {
    /// Anything, even zero.
    None,
    /// Strictly longer than the radius.
    LongerThanRadius,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CancelRules {
    /// End behind the contour without a word that says so.
    pub default: Approach,
    /// Whether the first move after the cancel must name both axes of the plane.
    pub both_axes: bool,
    /// What the length of the lead-off must be, compared with the radius.
    pub length: LeadLength,
    /// Compensation that is still active at the end of the program.
    pub missing: Severity,
    /// Whether a move in the plane must come between the cancel and a move out of it.
    pub before_off_plane: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reselect {
    Ignore,
    Error,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OffPlaneRules {
    /// Blocks without motion in the plane that may stand between two that have it;
    /// absent: any number.
    pub max_blocks: Option<u32>,
    /// The control's alarm for one block more.
    pub alarm: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AuxiliaryRules {
    /// Spindle, coolant and M functions while compensation is active.
    pub under_compensation: Permission,
    /// Moves of the third axis while compensation is active.
    pub off_plane_moves: Permission,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Permission {
    Allowed,
    Warn,
    Error,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FullCircle {
    Ok,
    Error,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InterferenceRules {
    /// A lead that cuts into its contour.
    pub leads: Severity,
    /// The control's alarm for a contour that the tool does not fit.
    pub alarm: Option<String>,
}
