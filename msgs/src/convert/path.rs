//! Elements and events of the compensated path.

use super::{
    PLANES, WireError, arc, block_to_wire, constant, key_of, number, position, source, value_of,
};
use crate::contour::CutterSide;
use crate::geometry::{AxisSet, Position, Shape};
use crate::path::{PathElement, PathEvent, Role, StartInSpan};
use crate::units::{m_per_s_from_mm_per_min, mm_per_min_from_m_per_s, point_from_position};
use crate::wire::cnc_msgs::msg as wire;
use crate::wire::cnc_msgs::srv::PlanStartResponse;

const ROLES: [(u8, Role); 7] = [
    (wire::PathElement::ROLE_NONE, Role::None),
    (wire::PathElement::ROLE_LEAD_ON, Role::LeadOn),
    (wire::PathElement::ROLE_CONTOUR, Role::Contour),
    (wire::PathElement::ROLE_CORNER, Role::Corner),
    (wire::PathElement::ROLE_LEAD_OFF, Role::LeadOff),
    (wire::PathElement::ROLE_LINK, Role::Link),
    (wire::PathElement::ROLE_OFF_PLANE, Role::OffPlane),
];

const SIDES: [(u8, Option<CutterSide>); 3] = [
    (wire::PathElement::SIDE_NONE, None),
    (wire::PathElement::SIDE_LEFT, Some(CutterSide::Left)),
    (wire::PathElement::SIDE_RIGHT, Some(CutterSide::Right)),
];

/// The planner's answer about a start under compensation, as a number.
pub fn start_in_span_to_wire(start: StartInSpan) -> u8 {
    match start {
        StartInSpan::Refused => PlanStartResponse::ENTRY_OUTSIDE,
        StartInSpan::Standing => PlanStartResponse::ENTRY_STANDING,
        StartInSpan::FromAbove => PlanStartResponse::ENTRY_FROM_ABOVE,
    }
}

/// The same, read; an unknown number forbids a start under compensation.
pub fn start_in_span_from_wire(entry: u8) -> StartInSpan {
    match entry {
        PlanStartResponse::ENTRY_STANDING => StartInSpan::Standing,
        PlanStartResponse::ENTRY_FROM_ABOVE => StartInSpan::FromAbove,
        _ => StartInSpan::Refused,
    }
}

/// An element with its start, as a message.
pub fn path_element_to_wire(start: Position, element: &PathElement) -> wire::PathElement {
    let mut out = wire::PathElement {
        kind: wire::PathElement::KIND_LINE,
        rapid: element.feed_mm_per_min.is_none(),
        role: key_of(&ROLES, element.role),
        side: key_of(&SIDES, element.side),
        axes: element.axes.bits(),
        start: point_from_position(start),
        end: point_from_position(element.end),
        feed_rate: m_per_s_from_mm_per_min(element.feed_mm_per_min.unwrap_or(0.0)),
        line: element.source.line,
        block: block_to_wire(element.source.block),
        column: element.source.column,
        length: element.source.length,
        ..Default::default()
    };
    if let Shape::Arc(arc) = element.shape {
        out.kind = wire::PathElement::KIND_ARC;
        out.plane = key_of(&PLANES, arc.plane);
        out.clockwise = arc.clockwise;
        out.turns = arc.turns;
        out.center = point_from_position(arc.center);
    }
    out
}

impl TryFrom<&wire::PathElement> for PathElement {
    type Error = WireError;

    fn try_from(element: &wire::PathElement) -> Result<Self, WireError> {
        type W = wire::PathElement;
        let start = position("start", &element.start)?;
        let feed = number("feed_rate", mm_per_min_from_m_per_s(element.feed_rate))?;
        if !element.rapid && feed <= 0.0 {
            return Err(WireError::Number { field: "feed_rate", value: element.feed_rate });
        }
        Ok(Self {
            shape: match element.kind {
                W::KIND_LINE => Shape::Line,
                W::KIND_ARC => arc(
                    element.plane,
                    &element.center,
                    element.clockwise,
                    element.turns,
                    Some(start),
                )?,
                value => return Err(WireError::Constant { field: "kind", value: value.into() }),
            },
            end: position("end", &element.end)?,
            feed_mm_per_min: (!element.rapid).then_some(feed),
            role: constant("role", element.role, value_of(&ROLES, element.role))?,
            side: constant("side", element.side, value_of(&SIDES, element.side))?,
            axes: AxisSet::from_bits(element.axes),
            source: source(element.line, &element.block, element.column, element.length),
        })
    }
}

impl From<&PathEvent> for wire::PathEvent {
    fn from(event: &PathEvent) -> Self {
        Self {
            at_element: event.at_element as u64,
            function: (&event.action).into(),
            line: event.source.line,
            block: block_to_wire(event.source.block),
            column: event.source.column,
            length: event.source.length,
        }
    }
}

impl TryFrom<&wire::PathEvent> for PathEvent {
    type Error = WireError;

    fn try_from(event: &wire::PathEvent) -> Result<Self, WireError> {
        Ok(Self {
            at_element: usize::try_from(event.at_element)
                .map_err(|_| WireError::Number { field: "at_element", value: f64::INFINITY })?,
            action: (&event.function).try_into()?,
            source: source(event.line, &event.block, event.column, event.length),
        })
    }
}
