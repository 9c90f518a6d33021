//! What the generator knows of a program: its text, and the contour that the text means.
//!
//! The contour is written down while the text is, from the same rounded numbers; nothing of it
//! was read by the loader.

use crate::piece::{Piece, Point};
use cnc_msgs::tool_table::ToolTable;
use settings::Control;

/// All controls, in the order that decides what a seed draws: a new one comes last.
pub const CONTROLS: [Control; Control::ALL.len()] = [
    Control::Rs274,
    Control::Masso,
    Control::Automation1,
    Control::Sinumerik840c,
    Control::OspLathe,
    Control::Nct,
];

/// A program and what it means.
#[derive(Debug, Clone)]
pub struct Program {
    pub seed: u64,
    pub control: Control,
    pub text: String,
    pub tools: ToolTable,
    /// Of a position: first and second axis of the plane, and the height.
    pub axes: [usize; 3],
    pub spans: Vec<Span>,
    /// What was drawn, for the counts.
    pub features: Vec<&'static str>,
}

/// The contour between a lead-on and the next lead-off, or a change of side.
#[derive(Debug, Clone)]
pub struct Span {
    pub elements: Vec<Element>,
    /// 1 where the tool runs on the left, −1 on the right; a negative radius is counted in.
    pub side: f64,
    pub corner: Corner,
    pub begin: End,
    pub end: End,
    /// The lines of the blocks that lead on and off.
    pub lines: (u32, u32),
    /// Whether it is a closed contour, which a tool may begin inside of under some controls.
    pub is_closed: bool,
}

/// A block of the contour, or a part of one.
#[derive(Debug, Clone, Copy)]
pub struct Element {
    pub shape: Piece,
    pub line: u32,
    pub pass: usize,
    pub role: Role,
    /// The radius of the tool where it begins and where it ends, mm, never negative.
    pub radius_mm: (f64, f64),
    /// Whether it retraces a wall before it.
    pub is_copy: bool,
}

/// What an element bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    Wall,
    /// Nothing: it lies between a free end and the first or last place where the contour
    /// meets itself.
    Tail {
        is_at_end: bool,
    },
}

/// How outside corners are shaped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Corner {
    Arc,
    Intersection,
    Extended,
}

/// How a span begins or ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum End {
    /// With a lead that ends one radius from the end of the contour.
    Normal { outside: Point },
    /// With a lead that meets the contour as a corner.
    Joined { outside: Point },
    /// With a change of side.
    OtherSide,
}

impl Span {
    /// What bounds the tool along a pass.
    pub fn walls(&self, pass: usize) -> impl Iterator<Item = &Element> {
        self.elements.iter().filter(move |element| {
            element.pass == pass && element.role == Role::Wall && !element.is_copy
        })
    }

    /// Whether another tool is called in it.
    pub fn changes_tool(&self) -> bool {
        self.elements.iter().any(|element| element.radius_mm.0 != element.radius_mm.1)
    }

    /// Whether a line of the program belongs to it.
    pub fn contains(&self, line: u32) -> bool {
        (self.lines.0..=self.lines.1).contains(&line)
    }
}
