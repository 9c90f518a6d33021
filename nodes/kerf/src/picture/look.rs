//! How the parts of a path look, in pictures and on pages.

use cnc_msgs::path::{PathElement, Role};

pub(crate) const PROGRAMMED: &str = "#7a7f87";
pub(crate) const PATH: &str = "#7b2fbf";
pub(crate) const CORNER: &str = "#b565e8";
pub(crate) const RAPID: &str = "#2f8f5b";
/// The way to where a run begins.
pub(crate) const APPROACH: &str = "#2e7d32";
/// Also in `page.js`.
pub(crate) const TURN: &str = "#1763a6";

/// How an element is drawn; `page.js` uses the same numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Look {
    Cut = 0,
    /// Generated at an outside corner.
    Corner = 1,
    /// Onto the contour, off it, or from one side to the other; dashed.
    Lead = 2,
    /// Thin.
    Rapid = 3,
}

impl Look {
    pub(crate) fn of(element: &PathElement) -> Self {
        match (element.role, element.feed_mm_per_min) {
            (Role::LeadOn | Role::LeadOff | Role::Link, _) => Self::Lead,
            (_, None) => Self::Rapid,
            (Role::Corner, _) => Self::Corner,
            _ => Self::Cut,
        }
    }
}
