//! Checked types to wire structs and back.
//!
//! A wire struct may hold anything: every incoming number is checked here once, and
//! NaN is rejected. Outgoing conversions cannot fail. Units are converted by
//! [`units`](crate::units) alone.

mod calls;
mod contour;
mod finding;
mod function;
mod machine;
mod parameter;
mod path;
mod probing;
mod tool_table;

pub use calls::chain_to_wire;
pub use function::{further_from_wire, further_to_wire};
pub use machine::{
    link_watch_from_wire, link_watch_to_wire, machine_state_to_wire, mode_from_wire, mode_to_wire,
};
pub use parameter::{parameter_from_wire, parameter_to_wire};
pub use path::{path_element_to_wire, start_in_span_from_wire, start_in_span_to_wire};

use crate::contour::Source;
use crate::geometry::{Arc, Plane, Position, Shape};
use crate::tool_table::ToolTableError;
use crate::units::position_from_point;
use crate::wire::cnc_msgs::msg as wire;
use crate::wire::geometry_msgs::msg::Point;

/// No coordinate is farther out than this, mm; a larger number is corrupt.
pub const COORDINATE_MM_MAX: f64 = 1e9;

/// Why a message is rejected.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WireError {
    #[error("{field} is {value}, not a finite number in range")]
    Number { field: &'static str, value: f64 },
    #[error("{field} is {value}, which is not one of its constants")]
    Constant { field: &'static str, value: u32 },
    #[error("{field} is {value:?}, which is not known")]
    Text { field: &'static str, value: String },
    #[error("{field} is missing")]
    Missing { field: &'static str },
    #[error(transparent)]
    ToolTable(#[from] ToolTableError),
}

fn number(field: &'static str, value: f64) -> Result<f64, WireError> {
    if value.is_finite() && value.abs() <= COORDINATE_MM_MAX {
        Ok(value)
    } else {
        Err(WireError::Number { field, value })
    }
}

fn position(field: &'static str, point: &Point) -> Result<Position, WireError> {
    let position = position_from_point(point);
    for value in position {
        number(field, value)?;
    }
    Ok(position)
}

/// The position of a point message, finite and in range.
pub fn checked_position(field: &'static str, point: &Point) -> Result<Position, WireError> {
    position(field, point)
}

fn constant<T>(field: &'static str, value: u8, found: Option<T>) -> Result<T, WireError> {
    found.ok_or(WireError::Constant { field, value: value.into() })
}

const PLANES: [(u8, Plane); 3] = [
    (wire::PathElement::PLANE_XY, Plane::Xy),
    (wire::PathElement::PLANE_ZX, Plane::Zx),
    (wire::PathElement::PLANE_YZ, Plane::Yz),
];

fn value_of<T: Copy>(table: &[(u8, T)], key: u8) -> Option<T> {
    table.iter().find(|row| row.0 == key).map(|row| row.1)
}

fn key_of<T: Copy + PartialEq>(table: &[(u8, T)], value: T) -> u8 {
    let row = table.iter().find(|row| row.1 == value);
    row.expect("every variant has its row in the table of wire constants").0
}

fn block_to_wire(block: Option<u32>) -> Vec<u32> {
    block.into_iter().collect()
}

fn source(line: u32, block: &[u32], column: u16, length: u16) -> Source {
    Source { line, block: block.first().copied(), column, length, call: 0 }
}

fn arc(
    plane: u8,
    center: &Point,
    clockwise: bool,
    turns: u16,
    start: Option<Position>,
) -> Result<Shape, WireError> {
    let plane = constant("plane", plane, value_of(&PLANES, plane))?;
    let mut center = position("center", center)?;
    if let Some(start) = start {
        // A centre is at the height of the start by definition.
        let normal = plane.axes()[2];
        center[normal] = start[normal];
    }
    Ok(Shape::Arc(Arc { center, plane, clockwise, turns }))
}
