//! How compensation is selected, canceled, and turned to the other side.

use super::Rule;
use super::Strictness;
use crate::contour::Approach;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How compensation begins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SelectRules {
    /// Where the lead-on ends (C11).
    pub target: SelectTarget,
    /// What each G word of the control selects: `G455: corner`.
    #[serde(default, deserialize_with = "crate::unique::map")]
    pub words: BTreeMap<String, Approach>,
    /// A start beyond the contour without such a word.
    pub default: Approach,
    /// Which move is the lead-on (A15, A16).
    #[serde(default)]
    pub lead: LeadMove,
    /// What the length of the lead-on must be, compared with the radius (C10).
    pub length: Rule<LeadLength>,
    /// A lead-on that is an arc.
    #[serde(default)]
    pub arc_lead: ArcLead,
    /// A selection that no move in the plane follows (A16).
    #[serde(default = "warn")]
    pub if_no_move: Strictness,
}

const fn warn() -> Strictness {
    Strictness::Warn
}

/// Where a lead-on ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SelectTarget {
    /// Perpendicular to the start of the next element.
    NormalNext,
    /// Perpendicular to the end of the entry move, joined to the next element as a corner.
    NormalEntry,
}

/// What a lead-on that is an arc becomes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ArcLead {
    /// It is refused.
    #[default]
    Error,
    /// A straight line, with a warning.
    Warn,
    /// The same.
    Emulate,
    /// An arc from the same start that ends at a tangent, one radius beside the end of the
    /// programmed one (LinuxCNC).
    Arc,
}

impl ArcLead {
    /// How strictly a program is held to a straight line.
    pub const fn strictness(self) -> Strictness {
        match self {
            Self::Error | Self::Arc => Strictness::Error,
            Self::Warn => Strictness::Warn,
            Self::Emulate => Strictness::Emulate,
        }
    }
}

/// Which move in the plane is a lead.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LeadMove {
    /// The next one.
    #[default]
    Any,
    /// The next one at feed; the state of compensation does not change with a rapid before it.
    Coordinated,
}

/// How long a lead must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LeadLength {
    /// Anything, even zero.
    Any,
    /// Strictly longer than the radius.
    LongerThanRadius,
}

/// How compensation ends (C14).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CancelRules {
    /// An end beyond the contour without a word that says so.
    pub default: Approach,
    /// Which move is the lead-off (A20, A21).
    #[serde(default)]
    pub lead: LeadMove,
    /// The axes that the first move after the cancel must name.
    pub axes: Rule<CancelAxes>,
    /// What the length of the lead-off must be, compared with the radius.
    pub length: Rule<LeadLength>,
    /// A lead-off that is an arc; unless it is refused, it is run as a straight line.
    #[serde(default)]
    pub arc_lead: Strictness,
    /// A cancel that no move in the plane follows: compensation stays on (A21).
    #[serde(default)]
    pub if_no_move: Strictness,
    /// Compensation that is still active at the end of the program.
    pub missing: Strictness,
    /// Where the cancel must stand before the end of the program (S32).
    #[serde(default = "anywhere")]
    pub before_end: Rule<CancelBeforeEnd>,
    /// Whether a move in the plane must come between the cancel and a move out of it (M13).
    pub before_off_plane: Rule<OffPlaneAfterCancel>,
    /// Compensation that is still active at the end of the program, with the tool above the contour; as elsewhere
    /// if not given.
    #[serde(default)]
    pub missing_above: Option<Strictness>,
}

const fn anywhere() -> Rule<CancelBeforeEnd> {
    Rule { rule: CancelBeforeEnd::Anywhere, strictness: Strictness::Error }
}

/// The axes of the plane that the lead-off names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CancelAxes {
    /// One is enough.
    Any,
    Both,
}

/// Where the cancel must stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CancelBeforeEnd {
    /// Anywhere with a move.
    Anywhere,
    /// In a block with a move before the block that ends the program.
    OwnBlock,
}

/// What may come right after the cancel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OffPlaneAfterCancel {
    Allowed,
    /// The lead-off comes first.
    LeadOffFirst,
}

/// A change of side while compensation is active.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SideChangeRules {
    pub rule: SideChange,
    /// A change on a control that has none, or where the offsets do not meet.
    #[serde(default)]
    pub strictness: Strictness,
    /// The control's alarm where the offsets do not meet.
    #[serde(default)]
    pub alarm: Option<String>,
}

/// What a change of side does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SideChange {
    /// The old contour ends and the new one begins as the words say; without a word,
    /// straight (S39).
    Relink,
    /// At the intersection of both offsets (O02), no move between.
    Intersection,
    /// It is not allowed.
    Forbidden,
}

/// What G41 does while G41 is active.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reselect {
    /// Nothing, unless the block also has a word of the approach (S35 to S37).
    Ignore,
    Forbidden,
}

/// What D0 does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ZeroOffset {
    /// The control has no D, or D0 is a number like any other.
    None,
    /// It cancels (S22, S29).
    Deselect,
    /// The offset goes to zero and the side stays selected (N05, N06).
    Suspend,
}
