//! Where the radius comes from, and when it may change.

use super::Rule;
use serde::{Deserialize, Serialize};

/// Where the radius comes from and when it may change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RadiusRules {
    /// What D, P or their absence mean (C3); strictness: a program that names none.
    pub source: Rule<RadiusKind>,
    /// Whether the value in force is a radius or a width (A03).
    #[serde(default)]
    pub value_is: RadiusValue,
    /// A negative resolved radius (C4).
    pub negative: Rule<NegativeRadius>,
    /// When the program may change it (C15).
    pub change: Rule<RadiusChange>,
    /// What the block that changes it does (S43).
    #[serde(default)]
    pub change_at: ChangeAt,
    /// Blocks that still run with the old value after one that changes the value
    /// of the offset in force (S47).
    #[serde(default)]
    pub value_latency_blocks: u32,
    /// What a running program does when `set_tool` changes its offset (S46, S48).
    #[serde(default)]
    pub live_value: LiveValue,
    /// What the length of the offset named by D does (S34).
    #[serde(default)]
    pub length_of_d: LengthOfD,
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
    /// A value that the program sets (`G43 P`), else that of the tool in the spindle.
    ProgramValue,
    /// The nose radius that the T word names.
    NoseRegister,
}

/// What the number in a program or register means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RadiusValue {
    #[default]
    Radius,
    /// The width of a kerf: the offset is half of it.
    Width,
}

/// What a negative radius does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NegativeRadius {
    /// The tool runs on the other side.
    Flip,
    /// It is not allowed.
    Forbidden,
}

/// When a program may change the radius.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RadiusChange {
    /// In any block.
    Anywhere,
    /// In straight blocks (S44).
    StraightBlocks,
    /// Only while compensation is off (A14).
    WhenOff,
}

/// Where a block that changes the radius begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ChangeAt {
    /// At the intersection with the old radius; it ends at the intersection with the new one.
    #[default]
    Intersection,
    /// Perpendicular to the end of the block before, with the old radius (SINUMERIK 880).
    Perpendicular,
}

/// Which value of an offset a running program uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LiveValue {
    /// The value that it started with.
    #[default]
    AtStart,
    /// The new value from the next corner on, if it is set during a hold (S48).
    WhenStopped,
}

/// What the length of the offset named by D does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LengthOfD {
    /// Nothing: another word selects lengths, or no word does.
    #[default]
    Ignored,
    /// It shifts Z from the next move of Z on (S34).
    WithZ,
}
