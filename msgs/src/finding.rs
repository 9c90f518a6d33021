//! What is wrong with a program, with its place and its numbers.
//!
//! A finding is data; whoever shows it renders it.

use crate::calls::Call;
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
///
/// Of each code the first paragraph says what it means, the second what to do. `docs/findings.md`
/// is made of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Code {
    /// The text cannot be read as blocks: a comment is not closed, or a word has no letter.
    ///
    /// Correct the marked text.
    Syntax,
    /// The control has no such word.
    ///
    /// Delete the word, or choose the control that the program was written for (`--control`).
    UnknownWord,
    /// Two words of one block exclude each other.
    ///
    /// Delete one of them, or write two blocks.
    ModalConflict,
    /// A word lacks another one that it needs: a dwell its time, a move its feed rate, an arc its
    /// centre.
    ///
    /// Write the missing word into this block, or into one before it.
    MissingWord,
    /// A number cannot be read, or the word cannot have that value.
    ///
    /// Write the number as the help line says.
    BadNumber,
    /// The start, the end and the centre of an arc do not fit together, or the arc is too small for
    /// the tool.
    ///
    /// Check the end and the centre. Where the radii differ by little, post more decimals.
    ArcRadius,
    /// Something is larger than Kerf accepts: the program, a block, a coordinate, or the number of
    /// findings.
    ///
    /// Split the program, the block or the contour. Where a list of findings ends, correct those
    /// first.
    Limit,
    /// The program asks for something that Kerf does not do, although the control may.
    ///
    /// Write it as the help line says, or post the program without it.
    Unsupported,
    /// The control does not allow this word or move while G41 or G42 is on.
    ///
    /// Cancel with G40 and a straight move before it, and select again after it.
    ForbiddenUnderCompensation,
    /// The arc or the compensation is in another plane than the control compensates in.
    ///
    /// Select the plane with G17, G18 or G19 before G41 or G42.
    Plane,
    /// The block names axes that are not there, or moves from a position that is not known.
    ///
    /// Post the program for the axes of the machine. After homing, move each axis with G90 first.
    Axes,
    /// The compensation has no radius, or one that the control does not accept here.
    ///
    /// Name the tool, the offset or the radius before G41 or G42, as the help line says.
    RadiusSource,
    /// The tool table lacks a tool or an offset of the program, or the job does not expect that
    /// tool.
    ///
    /// Add it to the tool table, or correct its number in the program.
    UnknownTool,
    /// The lead-on or the lead-off is no straight move, and no arc that leads this tool.
    ///
    /// Put a straight move in the plane between the contour and the arc or rapid.
    LeadType,
    /// The lead-on or the lead-off is shorter than the control needs.
    ///
    /// Make it longer than the radius of the tool, or use a smaller tool.
    LeadLength,
    /// The move after G40 lacks an axis of the plane, or leaves the plane too early.
    ///
    /// Write both axes of the plane into that block. Retract only after it.
    Cancel,
    /// The program ends while compensation is on.
    ///
    /// End the contour with G40 and a straight move in the plane.
    NotCancelled,
    /// Compensation is selected, and no move follows that it acts on.
    ///
    /// Program a move in the plane after the selection, or delete the selection.
    NeverActive,
    /// More blocks without motion in the plane follow each other than the control looks across.
    ///
    /// Put M functions into blocks that move in the plane, or cancel the compensation before them.
    OffPlaneBlocks,
    /// A full circle is in one block, which the control does not accept under compensation.
    ///
    /// Write the circle as two arcs.
    FullCircle,
    /// The tool path of an arc becomes longer than a full circle, because its neighbours meet it
    /// late.
    ///
    /// Write the arc as two.
    ArcOver360,
    /// The tool does not fit where the program wants it: into a slot, a fillet or an inside corner.
    ///
    /// Use a tool of at most the radius that the help line names. If it names none, check whether
    /// the side is right: G41 or G42.
    Unreachable,
    /// The tool comes nearer than its radius to a wall of the same pass, and cuts into the part.
    ///
    /// Use a smaller tool, or begin and end the contour where it does not bend back.
    Gouge,
    /// The tool cuts into a wall that another pass of the same contour leaves.
    ///
    /// Check whether that is meant, as in finishing after roughing. Otherwise use a smaller tool.
    CutsOtherPass,
    /// The tool cuts into what an earlier contour of the program leaves.
    ///
    /// Check whether that is meant. The profile key `interference.other_spans` decides what
    /// follows.
    CutsOtherSpan,
    /// The lead-on or the lead-off cuts into the contour.
    ///
    /// Lead from the side of the tool, at a right angle to the contour, or with a longer lead.
    LeadGouge,
    /// The lead-on or the lead-off passes over the free end of the block that it leads to or from.
    ///
    /// Lead at a right angle to the contour. If nothing but air is at that end, leave it.
    LeadNick,
    /// The move from one contour to the next cuts into one of them.
    ///
    /// Lead from the side of the tool, at a right angle to the contour, or cancel with G40 between
    /// the contours.
    LinkGouge,
    /// The lead meets the contour in an inside corner, and a part of the first or last blocks stays
    /// uncut.
    ///
    /// Lead on in the direction of the first block, and off in the direction of the last.
    Uncut,
    /// The side changes, or compensation is selected again, where the control does not accept it.
    ///
    /// Cancel with G40 and a lead-off, then select again with a lead-on.
    SideChange,
    /// The program leaves the travel of the machine, or is longer than the travel.
    ///
    /// Move the work zero as the help line says. A program that is longer than the travel must be
    /// split. If the travel is wrong, correct `$130` to `$132` in the controller.
    Travel,
    /// The tool touches a keep-out box: a clamp, a vice or a fixture. As a warning: it may.
    ///
    /// Move the clamp and its box, lift the tool above it, or lead around it.
    KeepOut,
    /// The controller does not do what the program asks for: its settings limit a spindle speed or a
    /// feed, its laser mode does not fit the program, or it cannot cut a thread.
    ///
    /// Check the value in the program, and what the message names of the machine.
    MachineSetting,
    /// A run cannot start at this line: it is after the last block, or inside a compensated contour,
    /// where the control does not start.
    ///
    /// Start at the line that the help line names, or before it.
    Restart,
    /// A value is allowed, but is often a mistake: a dwell in milliseconds, a radius that counts
    /// twice.
    ///
    /// Check the value. If it is meant, leave it.
    SuspiciousValue,
    /// The audit found a path that is not what its program asks for.
    ///
    /// Where it is an error, do not run the path, and plan the program again. Where it is a warning,
    /// look at the path there: the tool does not fit.
    PathMismatch,
    /// The planner and the audit of its path disagree: a defect of Kerf.
    ///
    /// Send the file that the help line names to the developers of Kerf. It is in the folder
    /// `kerf-reports`, and holds the program, the tools and the control.
    InternalError,
}

impl Code {
    /// Every code, in the order of declaration.
    pub const ALL: [Self; 37] = [
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
        Self::Travel,
        Self::KeepOut,
        Self::MachineSetting,
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
            Self::Travel => "travel",
            Self::KeepOut => "keep_out",
            Self::MachineSetting => "machine_setting",
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
    /// The calls and loop passes that led to the place, the innermost first.
    pub calls: Vec<Call>,
    /// The same of the other block.
    pub other_calls: Vec<Call>,
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
            calls: Vec::new(),
            other_calls: Vec::new(),
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
