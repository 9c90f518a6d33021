//! The compensated path: the only thing that can be sent to a machine.

mod entry;
mod further;
mod known;
mod runs;
mod unknown;

use crate::calls::Calls;
use crate::contour::{Action, CutterSide, Source};
use crate::geometry::{AxisSet, Position, Shape};

pub use entry::{Entry, NoEntry, StartInSpan, in_force};
pub use further::FurtherPlace;
pub use known::KnownPlace;
pub use runs::RunOfLine;
pub use unknown::UnknownAxes;

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
    /// The calls and loop passes that elements and events were run in.
    pub calls: Calls,
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
    /// Axes that are sent to the controller even if they do not change: those
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

/// Memory limit for the paths that a driver holds, bytes.
pub const PATHS_BYTES_MAX: u64 = 768 << 20;
/// Additional memory for the text of a function on its way to the driver, bytes.
const FUNCTION_TEXT_BYTES: u64 = 96;

/// Memory that a path takes in the driver, bytes.
pub fn path_bytes(elements: u64, functions: u64) -> u64 {
    let element = size_of::<PathElement>() as u64;
    let function = size_of::<PathEvent>() as u64 + FUNCTION_TEXT_BYTES;
    elements.saturating_mul(element).saturating_add(functions.saturating_mul(function))
}

/// A path that is too large for a driver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "a path of {elements} elements and {functions} functions takes {} MB of the driver's memory; \
     {} MB are allowed",
    path_bytes(*elements, *functions).div_ceil(1 << 20),
    PATHS_BYTES_MAX >> 20
)]
pub struct PathTooLong {
    pub elements: u64,
    pub functions: u64,
}

impl PathTooLong {
    /// What to do about it.
    pub fn help() -> String {
        let most = PATHS_BYTES_MAX / path_bytes(1, 0);
        format!("split the program into several, each of at most {most} elements")
    }
}

/// Checks that a driver has memory for a path of so many elements and functions.
///
/// # Errors
/// It takes more than [`PATHS_BYTES_MAX`].
pub fn check_length(elements: u64, functions: u64) -> Result<(), PathTooLong> {
    match path_bytes(elements, functions) <= PATHS_BYTES_MAX {
        true => Ok(()),
        false => Err(PathTooLong { elements, functions }),
    }
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
