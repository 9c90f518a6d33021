//! The compensated path: the only thing that can be sent to a machine.

use crate::contour::{Action, CutterSide, Source};
use crate::geometry::{AxisSet, Position, Shape};

/// The path of the tool centre, with everything that happens along it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CompensatedPath {
    /// Where the tool is before the first element, in the work frame, mm.
    pub start: Position,
    /// Axes whose start value the path relies on; see
    /// [`ProgrammedContour::assumed_axes`](crate::contour::ProgrammedContour::assumed_axes).
    pub assumed_axes: AxisSet,
    /// All motion, each element starting where the one before it ended.
    pub elements: Vec<PathElement>,
    /// All that is not motion, in order.
    pub events: Vec<PathEvent>,
}

/// One line or arc of the tool centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathElement {
    pub shape: Shape,
    pub end: Position,
    /// `None` for a rapid.
    pub feed_mm_per_min: Option<f64>,
    pub role: Role,
    /// The side that the tool runs on, from the lead-on to the end of the
    /// lead-off; `None` when not compensated.
    pub side: Option<CutterSide>,
    /// Axes that a controller must be told, whether they change or not: those
    /// that the block names and, under compensation, both axes of the plane.
    pub axes: AxisSet,
    /// The block it belongs to; a generated element belongs to the next block.
    pub source: Source,
}

/// What an element is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Role {
    /// Not compensated.
    #[default]
    None,
    /// From the uncompensated path to the offset.
    LeadOn,
    /// The offset of a programmed element.
    Contour,
    /// Generated at an outside corner.
    Corner,
    /// From the offset back to the programmed path.
    LeadOff,
    /// A change of side, or a reselection.
    Link,
    /// A move out of the plane under compensation.
    OffPlane,
}

impl Role {
    /// The name in JSON and in messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::LeadOn => "lead_on",
            Self::Contour => "contour",
            Self::Corner => "corner",
            Self::LeadOff => "lead_off",
            Self::Link => "link",
            Self::OffPlane => "off_plane",
        }
    }
}

/// Something that happens before an element of the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathEvent {
    /// It happens before this element; the number of elements means at the end.
    pub at_element: usize,
    pub action: Action,
    pub source: Source,
}

impl CompensatedPath {
    /// Where the element of this index starts.
    pub fn start_of(&self, index: usize) -> Position {
        if index == 0 { self.start } else { self.elements[index - 1].end }
    }

    /// Whether the element of this index is a rapid.
    pub fn is_rapid(&self, index: usize) -> bool {
        self.elements[index].feed_mm_per_min.is_none()
    }
}
