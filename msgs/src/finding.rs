//! What is wrong with a program, with its place and its numbers.
//!
//! A finding is data; whoever shows it renders it.

use crate::contour::Source;
use crate::geometry::Position;
use serde::{Deserialize, Serialize};

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Worth knowing; nothing is refused.
    Warning,
    /// The program is refused.
    Error,
}

/// What is wrong. A closed list: scripts and other nodes branch on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Code {
    Syntax,
    UnknownWord,
    ModalConflict,
    MissingWord,
    BadNumber,
    ArcRadius,
    Limit,
    Unsupported,
    ForbiddenUnderCompensation,
    Plane,
    Axes,
    RadiusSource,
    UnknownTool,
    LeadType,
    LeadLength,
    Cancel,
    NotCancelled,
    NeverActive,
    OffPlaneBlocks,
    FullCircle,
    ArcOver360,
    Unreachable,
    Gouge,
    CutsOtherPass,
    CutsOtherSpan,
    LeadGouge,
    LeadNick,
    LinkGouge,
    Uncut,
    SideChange,
    Restart,
    SuspiciousValue,
    /// The audit found a path that is not what its program asks for.
    PathMismatch,
    /// The planner and the audit of its path disagree: a defect of Kerf.
    InternalError,
}

impl Code {
    /// Every code, in the order of declaration.
    pub const ALL: [Self; 34] = [
        Self::Syntax,
        Self::UnknownWord,
        Self::ModalConflict,
        Self::MissingWord,
        Self::BadNumber,
        Self::ArcRadius,
        Self::Limit,
        Self::Unsupported,
        Self::ForbiddenUnderCompensation,
        Self::Plane,
        Self::Axes,
        Self::RadiusSource,
        Self::UnknownTool,
        Self::LeadType,
        Self::LeadLength,
        Self::Cancel,
        Self::NotCancelled,
        Self::NeverActive,
        Self::OffPlaneBlocks,
        Self::FullCircle,
        Self::ArcOver360,
        Self::Unreachable,
        Self::Gouge,
        Self::CutsOtherPass,
        Self::CutsOtherSpan,
        Self::LeadGouge,
        Self::LeadNick,
        Self::LinkGouge,
        Self::Uncut,
        Self::SideChange,
        Self::Restart,
        Self::SuspiciousValue,
        Self::PathMismatch,
        Self::InternalError,
    ];

    /// The name in JSON and messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Syntax => "syntax",
            Self::UnknownWord => "unknown_word",
            Self::ModalConflict => "modal_conflict",
            Self::MissingWord => "missing_word",
            Self::BadNumber => "bad_number",
            Self::ArcRadius => "arc_radius",
            Self::Limit => "limit",
            Self::Unsupported => "unsupported",
            Self::ForbiddenUnderCompensation => "forbidden_under_compensation",
            Self::Plane => "plane",
            Self::Axes => "axes",
            Self::RadiusSource => "radius_source",
            Self::UnknownTool => "unknown_tool",
            Self::LeadType => "lead_type",
            Self::LeadLength => "lead_length",
            Self::Cancel => "cancel",
            Self::NotCancelled => "not_cancelled",
            Self::NeverActive => "never_active",
            Self::OffPlaneBlocks => "off_plane_blocks",
            Self::FullCircle => "full_circle",
            Self::ArcOver360 => "arc_over_360",
            Self::Unreachable => "unreachable",
            Self::Gouge => "gouge",
            Self::CutsOtherPass => "cuts_other_pass",
            Self::CutsOtherSpan => "cuts_other_span",
            Self::LeadGouge => "lead_gouge",
            Self::LeadNick => "lead_nick",
            Self::LinkGouge => "link_gouge",
            Self::Uncut => "uncut",
            Self::SideChange => "side_change",
            Self::Restart => "restart",
            Self::SuspiciousValue => "suspicious_value",
            Self::PathMismatch => "path_mismatch",
            Self::InternalError => "internal_error",
        }
    }
}

/// One finding.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    pub severity: Severity,
    pub code: Code,
    /// The control's own alarm number or name, where it has one (`3021`).
    pub alarm: Option<String>,
    /// Where in the program; line 0 when it is about the program as a whole.
    pub source: Source,
    /// The other block of a pair.
    pub other: Option<Source>,
    /// Where in the work frame, mm.
    pub position: Option<Position>,
    /// How deep the tool cuts into the part, mm.
    pub depth_mm: Option<f64>,
    /// What is needed, mm.
    pub needed_mm: Option<f64>,
    /// What is there, mm.
    pub available_mm: Option<f64>,
    /// What is wrong: lower case, no full stop, values with their units.
    pub message: String,
    /// What to do about it; may be empty.
    pub help: String,
}

impl Finding {
    /// An error at a place, without numbers or help yet.
    pub fn error(code: Code, source: Source, message: impl Into<String>) -> Self {
        Self {
            severity: Severity::Error,
            code,
            alarm: None,
            source,
            other: None,
            position: None,
            depth_mm: None,
            needed_mm: None,
            available_mm: None,
            message: message.into(),
            help: String::new(),
        }
    }

    /// A warning at a place, without numbers or help yet.
    pub fn warning(code: Code, source: Source, message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, ..Self::error(code, source, message) }
    }

    /// The same with a sentence about what to do.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = help.into();
        self
    }

    /// Whether it refuses the program.
    pub fn is_error(&self) -> bool {
        self.severity == Severity::Error
    }
}
