//! Which lines a manual operation sends.

use super::{OFFSETS, Task};
use crate::codes::error_code;
use crate::driver::answer::Refusal;
use crate::driver::context::Context;
use crate::encoder::DEGREES_MAX;
use crate::encoder::words::{to_grid, write_word};
use crate::link::LineKind;
use cnc_msgs::contour::{Probe, work_system};
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes};
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet, Position};
use serde::{Deserialize, Serialize};

/// Where a jog goes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct JogRequest {
    pub frame: JogFrame,
    pub axes: AxisSet,
    /// mm; only of the axes that move.
    pub target: Position,
    /// Degrees/min where axes turn.
    pub feed_mm_per_min: f64,
    /// Further axes, which move without X, Y and Z.
    #[serde(default, skip_serializing_if = "FurtherAxes::is_empty")]
    pub further: FurtherAxes,
}

/// What the numbers of a jog count from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JogFrame {
    /// From where the axes are.
    Relative,
    Work,
    Machine,
}

/// How a probe looks for the workpiece.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ProbeRequest {
    pub axes: AxisSet,
    /// How far at most, from where the tool is, mm.
    pub distance: Position,
    pub feed_mm_per_min: f64,
    /// Until it releases instead of touching.
    pub away: bool,
    /// A probe that finds nothing causes no alarm.
    pub may_miss: bool,
    /// Further axes, which move without X, Y and Z; the feed is in degrees/min where they turn.
    #[serde(default, skip_serializing_if = "FurtherAxes::is_empty")]
    pub further: FurtherAxes,
}

/// Which coordinates the tool position gets, or where the origin of a work system is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OffsetRequest {
    /// 1 to 9 are G54 to G59.3, 92 is G92.
    pub system: u8,
    pub axes: AxisSet,
    /// mm: the coordinates for the tool position, or where the origin lies.
    pub position: Position,
    pub is_origin: bool,
    /// The same for further axes.
    #[serde(default, skip_serializing_if = "FurtherAxes::is_empty")]
    pub further: FurtherAxes,
}

/// The number of the shift on top of all work systems.
const G92: u8 = 92;

/// A manual operation that may begin.
#[derive(Debug)]
pub(in crate::driver) struct ManualOrder {
    pub(in crate::driver) task: Task,
    pub(in crate::driver) kind: LineKind,
    pub(in crate::driver) lines: Vec<String>,
}

impl ManualOrder {
    pub(in crate::driver) fn new<const COUNT: usize>(
        task: Task,
        kind: LineKind,
        lines: [String; COUNT],
    ) -> Self {
        Self { task, kind, lines: lines.into() }
    }

    pub(in crate::driver) fn home() -> Self {
        Self::new(Task::Home, LineKind::Silent, ["$H".to_owned()])
    }

    pub(in crate::driver) fn unlock() -> Self {
        Self::new(Task::Unlock, LineKind::Slow, ["$X".to_owned()])
    }

    pub(in crate::driver) fn sleep() -> Self {
        Self::new(Task::Sleep, LineKind::Slow, ["$SLP".to_owned()])
    }

    /// A jog. While a tool is changed the way back stays right whatever the machine's zero
    /// is, so that it need not be known.
    pub(in crate::driver) fn jog(
        context: &Context,
        request: JogRequest,
        is_tool_awaited: bool,
    ) -> Result<Self, Refusal> {
        let frame = match request.frame {
            JogFrame::Relative => "G91",
            JogFrame::Work => "G90",
            JogFrame::Machine => "G90G53",
        };
        if request.frame == JogFrame::Machine
            && !is_tool_awaited
            && let Some(refusal) = context.machine.home_obstacle("a jog in the machine frame")
        {
            return Err(refusal);
        }
        refuse_further("jog", request.axes, request.further, is_tool_awaited)?;
        let axes = (request.axes, request.target, request.further);
        let words = move_words(context, axes, request.feed_mm_per_min)?;
        let place = context.machine.machine_position().zip(context.machine.work_position());
        let Some((machine, work)) = place else {
            return Err(Refusal::new(error_code::CONNECTING, context.machine.unknown_place()));
        };
        let mut target = machine;
        for axis in (0..3).filter(|axis| request.axes.contains(*axis)) {
            let from = match request.frame {
                JogFrame::Relative => machine[axis],
                JogFrame::Work => machine[axis] - work[axis],
                JogFrame::Machine => 0.0,
            };
            target[axis] = from + request.target[axis];
        }
        let places = context.machine.further_places().unwrap_or_default();
        let mut further = FurtherAxes::NONE;
        for (axis, value) in request.further.iter() {
            let Some((machine, work)) = places.machine.get(axis).zip(places.work.get(axis)) else {
                return Err(Refusal::new(error_code::CONNECTING, context.machine.unknown_place()));
            };
            let from = match request.frame {
                JogFrame::Relative => machine,
                JogFrame::Work => machine - work,
                JogFrame::Machine => 0.0,
            };
            further = further.with(axis, from + value);
        }
        let line = format!("$J=G21{frame}{words}");
        Ok(Self::new(Task::Jog { target, further }, LineKind::Motion, [line]))
    }

    pub(in crate::driver) fn probe(
        context: &Context,
        request: ProbeRequest,
        is_tool_awaited: bool,
    ) -> Result<Self, Refusal> {
        refuse_further("probe", request.axes, request.further, is_tool_awaited)?;
        let axes = (request.axes, request.distance, request.further);
        let words = move_words(context, axes, request.feed_mm_per_min)?;
        let word = Probe { away: request.away, may_miss: request.may_miss }.word();
        let task = Task::Probe { may_miss: request.may_miss, touch: None };
        Ok(Self::new(task, LineKind::Slow, [format!("G21G91G94{word}{words}")]))
    }

    pub(in crate::driver) fn set_work_offset(
        context: &Context,
        request: OffsetRequest,
    ) -> Result<Self, Refusal> {
        let OffsetRequest { system, axes, position, is_origin, further } = request;
        let words = axis_words(context, axes, position, further)?;
        let (line, name) = match (system, is_origin) {
            (1..=9, _) if system <= context.machine.work_systems() => {
                let set = if is_origin { 2 } else { 20 };
                (format!("G21G10L{set}P{system}{words}"), work_system(system))
            }
            (7..=9, _) => {
                return invalid(format!(
                    "this controller has no {}: it reports no offset of it ($#)",
                    work_system(system)
                ));
            }
            (G92, false) => (format!("G21G92{words}"), "G92".into()),
            (G92, true) => {
                return invalid(
                    "G92 is set at the tool position; it has no origin in the machine frame",
                );
            }
            _ => {
                return invalid(format!(
                    "work system {system} does not exist: 1 to 9 are G54 to G59.3, 92 is G92"
                ));
            }
        };
        let done = match is_origin {
            true => format!("the origin of {name} is {words} in the machine frame"),
            false => format!("the tool is now at {words} in {name}"),
        };
        let lines = [line, OFFSETS.to_owned()];
        Ok(Self::new(Task::SetWorkOffset { done }, LineKind::Slow, lines))
    }
}

/// Refuses axes whose common feed rate boards count in different ways, and those that a tool change
/// does not bring back.
fn refuse_further(
    name: &str,
    axes: AxisSet,
    further: FurtherAxes,
    is_tool_awaited: bool,
) -> Result<(), Refusal> {
    if further.is_empty() {
        return Ok(());
    }
    let turns = further.iter().any(|(axis, _)| FurtherAxes::is_rotary(axis));
    if !axes.is_empty() || turns && !further.only_turns() {
        return invalid(format!(
            "boards differ in how fast they move X, Y and Z together with other axes, and degrees \
             together with mm: {name} X, Y and Z in one move, A, B and C in another, U, V and W in \
             a third"
        ));
    }
    match is_tool_awaited {
        true => invalid(format!(
            "a {name} moves X, Y and Z alone during a tool change: the way back would not move the \
             other axes"
        )),
        false => Ok(()),
    }
}

/// The words of a move, with its feed rate.
fn move_words(
    context: &Context,
    (axes, position, further): (AxisSet, Position, FurtherAxes),
    feed_mm_per_min: f64,
) -> Result<String, Refusal> {
    let mut words = axis_words(context, axes, position, further)?;
    let max = context.config.encoder.feed_mm_per_min_max;
    if !(feed_mm_per_min <= max && to_grid(feed_mm_per_min) > 0) {
        let text = format!(
            "the feed rate {feed_mm_per_min} mm/min is not between 0.0001 and {max} mm/min"
        );
        return Err(Refusal::new(error_code::INVALID_REQUEST, text));
    }
    write_word(&mut words, 'F', to_grid(feed_mm_per_min));
    Ok(words)
}

/// `X10Y-.5`
fn axis_words(
    context: &Context,
    axes: AxisSet,
    position: Position,
    further: FurtherAxes,
) -> Result<String, Refusal> {
    let max_mm = context.config.encoder.position_mm_max;
    let named = (0..3).filter(|axis| axes.contains(*axis));
    let named = named.map(|axis| (AXIS_LETTERS[axis], position[axis], max_mm, "mm"));
    let board = context.machine.board();
    let mut words = String::new();
    let further = further.iter().map(|(axis, value)| {
        let (max, unit) = match FurtherAxes::is_rotary(axis) {
            true => (DEGREES_MAX, "degrees"),
            false => (max_mm, "mm"),
        };
        let letter = FURTHER_LETTERS[axis];
        match board.has_further(axis) {
            true => Ok((letter, value, max, unit)),
            false => invalid(format!(
                "the controller has no axis {letter}: it has {}",
                board.axis_letters()
            )),
        }
    });
    for word in named.map(Ok).chain(further) {
        let (letter, value, max, unit) = word?;
        if value.is_nan() || value.abs() > max {
            return invalid(format!("{letter}{value} is not between -{max} and {max} {unit}"));
        }
        write_word(&mut words, letter, to_grid(value));
    }
    if words.is_empty() {
        return invalid(
            "no axis is named: axes has bit 0 for X, bit 1 for Y, bit 2 for Z; further_axes has \
             bit 0 for A, and so on to W",
        );
    }
    Ok(words)
}

fn invalid<T>(text: impl Into<String>) -> Result<T, Refusal> {
    Err(Refusal::new(error_code::INVALID_REQUEST, text))
}
