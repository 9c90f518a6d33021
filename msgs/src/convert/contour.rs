//! Contour events.

use super::{
    PLANES, WireError, arc, block_to_wire, constant, key_of, number, position, source, value_of,
};
use crate::contour::{
    Approach, ContourEvent, ContourEventKind, CutterSide, Motion, MotionClass, OutsideCorner,
    RadiusSource,
};
use crate::geometry::{Arc, AxisSet, Direction, Shape};
use crate::units::{
    m_from_mm, m_per_s_from_mm_per_min, mm_from_m, mm_per_min_from_m_per_s, point_from_position,
    received_mm, received_mm_per_min,
};
use crate::wire::cnc_msgs::msg as wire;

const CLASSES: [(u8, MotionClass); 3] = [
    (wire::ContourEvent::CLASS_RAPID, MotionClass::Rapid),
    (wire::ContourEvent::CLASS_FEED, MotionClass::Feed),
    (wire::ContourEvent::CLASS_NON_COORDINATED, MotionClass::NonCoordinated),
];

const SIDES: [(u8, CutterSide); 2] = [
    (wire::ContourEvent::SIDE_LEFT, CutterSide::Left),
    (wire::ContourEvent::SIDE_RIGHT, CutterSide::Right),
];

const APPROACHES: [(u8, Option<Approach>); 3] = [
    (0, None),
    (wire::ContourEvent::APPROACH_CORNER, Some(Approach::Corner)),
    (wire::ContourEvent::APPROACH_NORMAL, Some(Approach::Normal)),
];

const CORNERS: [(u8, OutsideCorner); 3] = [
    (wire::ContourEvent::CORNER_ARC, OutsideCorner::Arc),
    (wire::ContourEvent::CORNER_INTERSECTION, OutsideCorner::Intersection),
    (wire::ContourEvent::CORNER_EXTEND_BY_RADIUS, OutsideCorner::ExtendByRadius),
];

impl From<&ContourEvent> for wire::ContourEvent {
    fn from(event: &ContourEvent) -> Self {
        let mut out = Self {
            line: event.source.line,
            block: block_to_wire(event.source.block),
            column: event.source.column,
            length: event.source.length,
            ..Self::default()
        };
        match event.kind {
            ContourEventKind::Motion(motion) => {
                out.kind = Self::KIND_MOTION;
                out.motion_class = key_of(&CLASSES, motion.class);
                out.axes = motion.axes.bits();
                out.end = point_from_position(motion.end);
                out.feed_rate = m_per_s_from_mm_per_min(motion.feed_mm_per_min);
                out.shape = Self::SHAPE_LINE;
                if let Shape::Arc(arc) = motion.shape {
                    out.shape = Self::SHAPE_ARC;
                    out.plane = key_of(&PLANES, arc.plane);
                    out.clockwise = arc.clockwise;
                    out.turns = arc.turns;
                    out.center = point_from_position(arc.center);
                }
            }
            ContourEventKind::Plane(plane) => {
                out.kind = Self::KIND_PLANE;
                out.plane = key_of(&PLANES, plane);
            }
            ContourEventKind::Radius(radius) => {
                out.kind = Self::KIND_RADIUS;
                (out.detail, out.number, out.value) = match radius {
                    RadiusSource::SpindleTool => (Self::RADIUS_SPINDLE_TOOL, 0, 0.0),
                    RadiusSource::Tool(tool) => (Self::RADIUS_TOOL, tool, 0.0),
                    RadiusSource::Offset(offset) => (Self::RADIUS_OFFSET, offset, 0.0),
                    RadiusSource::Diameter { mm, tip } => {
                        (Self::RADIUS_DIAMETER, tip.into(), m_from_mm(mm))
                    }
                    RadiusSource::Radius(mm) => (Self::RADIUS_RADIUS, 0, m_from_mm(mm)),
                    RadiusSource::SpindleToolPlus(mm) => {
                        (Self::RADIUS_SPINDLE_TOOL_PLUS, 0, m_from_mm(mm))
                    }
                    RadiusSource::Nose(nose) => (Self::RADIUS_NOSE, nose, 0.0),
                };
            }
            ContourEventKind::Select { side, approach, along } => {
                out.kind = Self::KIND_SELECT;
                out.detail = key_of(&SIDES, side);
                out.direction = along.unwrap_or_default();
                out.approach = key_of(&APPROACHES, approach);
            }
            ContourEventKind::Cancel { exit } => {
                out.kind = Self::KIND_CANCEL;
                out.approach = key_of(&APPROACHES, exit);
            }
            ContourEventKind::Corner(corner) => {
                out.kind = Self::KIND_CORNER;
                out.detail = key_of(&CORNERS, corner);
            }
            ContourEventKind::RadiusValue { radius_mm } => {
                out.kind = Self::KIND_RADIUS_VALUE;
                out.value = m_from_mm(radius_mm);
            }
            ContourEventKind::HoldDirection { along } => {
                out.kind = Self::KIND_HOLD_DIRECTION;
                out.direction = along.unwrap_or_default();
            }
            ContourEventKind::CornerArc { along } => {
                out.kind = Self::KIND_CORNER_ARC;
                out.direction = along.unwrap_or_default();
            }
            ContourEventKind::Calculation => out.kind = Self::KIND_CALCULATION,
            ContourEventKind::Action(action) => {
                out.kind = Self::KIND_FUNCTION;
                out.function = vec![(&action).into()];
            }
        }
        out
    }
}

impl ContourEventKind {
    /// The event as its receiver gets it: with lengths, feeds and speeds rounded.
    ///
    /// The sender can so check the same bits that every receiver checks.
    #[must_use]
    pub fn received(self) -> Self {
        match self {
            Self::Motion(motion) => Self::Motion(Motion {
                shape: match motion.shape {
                    Shape::Line => Shape::Line,
                    Shape::Arc(arc) => {
                        Shape::Arc(Arc { center: arc.center.map(received_mm), ..arc })
                    }
                },
                end: motion.end.map(received_mm),
                feed_mm_per_min: received_mm_per_min(motion.feed_mm_per_min),
                ..motion
            }),
            Self::Radius(RadiusSource::Diameter { mm, tip }) => {
                Self::Radius(RadiusSource::Diameter { mm: received_mm(mm), tip })
            }
            Self::Radius(RadiusSource::Radius(mm)) => {
                Self::Radius(RadiusSource::Radius(received_mm(mm)))
            }
            Self::Radius(RadiusSource::SpindleToolPlus(mm)) => {
                Self::Radius(RadiusSource::SpindleToolPlus(received_mm(mm)))
            }
            Self::RadiusValue { radius_mm } => {
                Self::RadiusValue { radius_mm: received_mm(radius_mm) }
            }
            Self::Action(action) => Self::Action(action.received()),
            Self::Radius(
                RadiusSource::SpindleTool
                | RadiusSource::Tool(_)
                | RadiusSource::Offset(_)
                | RadiusSource::Nose(_),
            )
            | Self::Plane(_)
            | Self::Select { .. }
            | Self::Cancel { .. }
            | Self::Corner(_)
            | Self::HoldDirection { .. }
            | Self::CornerArc { .. }
            | Self::Calculation => self,
        }
    }
}

impl TryFrom<&wire::ContourEvent> for ContourEvent {
    type Error = WireError;

    fn try_from(event: &wire::ContourEvent) -> Result<Self, WireError> {
        type W = wire::ContourEvent;
        let kind = match event.kind {
            W::KIND_MOTION => ContourEventKind::Motion(Motion {
                shape: match event.shape {
                    W::SHAPE_LINE => Shape::Line,
                    W::SHAPE_ARC => {
                        arc(event.plane, &event.center, event.clockwise, event.turns, None)?
                    }
                    value => {
                        return Err(WireError::Constant { field: "shape", value: value.into() });
                    }
                },
                end: position("end", &event.end)?,
                class: constant(
                    "motion_class",
                    event.motion_class,
                    value_of(&CLASSES, event.motion_class),
                )?,
                feed_mm_per_min: number("feed_rate", mm_per_min_from_m_per_s(event.feed_rate))?,
                axes: AxisSet::from_bits(event.axes),
            }),
            W::KIND_PLANE => ContourEventKind::Plane(constant(
                "plane",
                event.plane,
                value_of(&PLANES, event.plane),
            )?),
            W::KIND_RADIUS => {
                let mm = number("value", mm_from_m(event.value))?;
                ContourEventKind::Radius(match event.detail {
                    W::RADIUS_SPINDLE_TOOL => RadiusSource::SpindleTool,
                    W::RADIUS_TOOL => RadiusSource::Tool(event.number),
                    W::RADIUS_OFFSET => RadiusSource::Offset(event.number),
                    W::RADIUS_DIAMETER => {
                        let tip = u8::try_from(event.number).ok().filter(|&tip| tip <= 9);
                        let value = event.number;
                        let tip = tip.ok_or(WireError::Constant { field: "number", value })?;
                        RadiusSource::Diameter { mm, tip }
                    }
                    W::RADIUS_RADIUS => RadiusSource::Radius(mm),
                    W::RADIUS_SPINDLE_TOOL_PLUS => RadiusSource::SpindleToolPlus(mm),
                    W::RADIUS_NOSE => RadiusSource::Nose(event.number),
                    value => {
                        return Err(WireError::Constant { field: "detail", value: value.into() });
                    }
                })
            }
            W::KIND_SELECT => ContourEventKind::Select {
                side: constant("detail", event.detail, value_of(&SIDES, event.detail))?,
                approach: approach(event.approach)?,
                along: direction(event.direction)?,
            },
            W::KIND_CANCEL => ContourEventKind::Cancel { exit: approach(event.approach)? },
            W::KIND_CORNER => ContourEventKind::Corner(constant(
                "detail",
                event.detail,
                value_of(&CORNERS, event.detail),
            )?),
            W::KIND_RADIUS_VALUE => {
                let radius_mm = number("value", mm_from_m(event.value))?;
                ContourEventKind::RadiusValue { radius_mm }
            }
            W::KIND_HOLD_DIRECTION => {
                ContourEventKind::HoldDirection { along: direction(event.direction)? }
            }
            W::KIND_CORNER_ARC => {
                ContourEventKind::CornerArc { along: direction(event.direction)? }
            }
            W::KIND_CALCULATION => ContourEventKind::Calculation,
            W::KIND_FUNCTION => {
                let function = event.function.first();
                let function = function.ok_or(WireError::Missing { field: "function" })?;
                ContourEventKind::Action(function.try_into()?)
            }
            value => return Err(WireError::Constant { field: "kind", value: value.into() }),
        };
        Ok(Self { source: source(event.line, &event.block, event.column, event.length), kind })
    }
}

/// A direction; `None` for 0 0 0.
fn direction(value: Direction) -> Result<Option<Direction>, WireError> {
    for part in value {
        number("direction", part)?;
    }
    Ok((value != [0.0; 3]).then_some(value))
}

fn approach(value: u8) -> Result<Option<Approach>, WireError> {
    constant("approach", value, value_of(&APPROACHES, value))
}
