//! Checks one block against the rules of grbl 1.1 and returns its effect.
//!
//! A block with two faults gets the code of the first failed check, so the order of the checks
//! follows the firmware. Nothing takes effect here.

use crate::axes::{AXES, Axes, with_others_at_zero};
use crate::codes::ErrorCode;
use crate::firmware::Vocabulary;
use crate::gcode::arc::Arc;
use crate::gcode::port::{self, PortCommand};
use crate::gcode::single::{minus, plus, times};
use crate::gcode::sort::{AxisCommand, GROUPS_OF_JOGS, ToolLength, Words, ZeroGroup, sort};
use crate::gcode::{CoordinateSystems, Distance, FeedMode, Modal, Motion, ParserState, Units};

/// Millimetres of an inch.
const MM_PER_INCH: f64 = 25.4;
/// The highest N.
const LINE_NUMBER_MAX: f64 = 10_000_000.0;

/// Program or jog (`$J=`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CommandKind {
    Program,
    Jog,
}

/// A block that may be executed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Checked {
    /// The modal state after it.
    pub(crate) modal: Modal,
    pub(crate) feed: f64,
    pub(crate) spindle_rpm: f64,
    pub(crate) tool: u32,
    pub(crate) line_number: u32,
    pub(crate) dwell_s: Option<f64>,
    pub(crate) tool_length: f64,
    pub(crate) non_modal: Option<NonModal>,
    pub(crate) effect: Effect,
    pub(crate) flow: Option<Flow>,
    /// M6.
    pub(crate) changes_tool: bool,
    /// M62 to M68.
    pub(crate) port: Option<PortCommand>,
}

impl Checked {
    /// Is the block a motion with axis words?
    pub(crate) fn moves_axes(&self) -> bool {
        self.effect != Effect::None
    }
}

/// Motion of a block.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Effect {
    None,
    Rapid(Axes),
    Line(Axes),
    Arc(Arc),
    Probe {
        target: Axes,
        away: bool,
        miss_is_fine: bool,
    },
    /// At the pace of the spindle, so many mm in a revolution.
    Thread {
        target: Axes,
        pitch: f64,
    },
}

/// Commands of group 0 that are not motion themselves.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum NonModal {
    SetWorkOffset {
        system: usize,
        offset: Axes,
    },
    /// G28 or G30; with axis words through an intermediate point, and only these axes go on.
    GoTo {
        g30: bool,
        over: Option<Axes>,
        named: [bool; AXES],
    },
    /// G28.1 or G30.1.
    Store {
        g30: bool,
    },
    /// G92 and G92.1.
    SetG92(Axes),
}

/// M0, M1, M2 and M30.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flow {
    Pause,
    OptionalPause,
    End,
}

/// Checks a line (upper case, without blanks) and returns its effect.
pub(crate) fn check(
    line: &str,
    kind: CommandKind,
    vocabulary: &Vocabulary,
    state: &ParserState,
    systems: &CoordinateSystems,
) -> Result<Checked, ErrorCode> {
    let mut modal = state.modal;
    if kind == CommandKind::Jog {
        modal.motion = Motion::Line;
        modal.feed_mode = FeedMode::UnitsPerMinute;
    }
    let mut w = sort(line, kind, vocabulary, &mut modal)?;
    if w.has_axis() && w.axis_command.is_none() {
        w.axis_command = Some(AxisCommand::Motion);
    }

    let line_number = w.take('N').unwrap_or(0.0);
    if line_number > LINE_NUMBER_MAX {
        return Err(ErrorCode::InvalidLineNumber);
    }
    if kind == CommandKind::Jog {
        let may = matches!(w.zero, None | Some(ZeroGroup::MachineCoordinates));
        if w.groups & !GROUPS_OF_JOGS != 0 || !may || w.tool_length.is_some() {
            return Err(ErrorCode::InvalidJog);
        }
    }
    let mm = if modal.units == Units::Inches { MM_PER_INCH } else { 1.0 };
    let feed = feed(&mut w, kind, &modal, state, mm)?;
    let spindle_rpm = if kind == CommandKind::Jog { None } else { w.take('S') };
    let tool = if kind == CommandKind::Jog { None } else { w.take('T') };
    let dwell_s = match w.zero {
        Some(ZeroGroup::Dwell) => Some(w.take('P').ok_or(ErrorCode::ValueWordMissing)?),
        _ => None,
    };
    let port = match w.port_word {
        Some(number) => Some(port::command(&mut w, number, vocabulary.ports)?),
        None => None,
    };
    let mut tool_length = state.tool_length;
    match w.tool_length {
        Some(ToolLength::Dynamic) => {
            if (0..AXES).any(|axis| w.axis(axis).is_some() != (axis == 2)) {
                return Err(ErrorCode::DynamicOffsetAxis);
            }
            tool_length = times(w.axis(2).unwrap_or(0.0), mm);
        }
        Some(ToolLength::Cancel) => tool_length = 0.0,
        None => {}
    }

    // G54 to G59 act first, so these offsets are in force for this very block.
    let after = ParserState { modal, tool_length, ..state.clone() };
    let non_modal_words = w.zero;
    let target = target(&w, &after, systems, mm);
    let non_modal = non_modal(&mut w, vocabulary, &after, systems, target, mm)?;
    if non_modal_words == Some(ZeroGroup::MachineCoordinates)
        && !matches!(modal.motion, Motion::Rapid | Motion::Line)
    {
        return Err(ErrorCode::G53InvalidMotion);
    }
    let ask = Ask { kind, vocabulary, modal: &modal, target, feed, mm };
    let effect = motion(&mut w, &ask, state)?;

    if w.axis_command.is_some() {
        w.take_axes();
    }
    if w.values.iter().any(Option::is_some) {
        return Err(ErrorCode::UnusedWords);
    }
    if kind == CommandKind::Jog && effect == Effect::None {
        return Err(ErrorCode::NoAxisWords);
    }
    Ok(Checked {
        modal,
        feed,
        spindle_rpm: spindle_rpm.unwrap_or(state.spindle_rpm),
        tool: tool.map_or(state.tool, |tool| tool as u32),
        line_number: line_number as u32,
        dwell_s,
        tool_length,
        non_modal,
        effect,
        flow: w.flow,
        changes_tool: w.changes_tool,
        port,
    })
}

/// Returns the feed in force: mm/min, or moves per minute in G93; 0 is undefined.
fn feed(
    w: &mut Words,
    kind: CommandKind,
    modal: &Modal,
    state: &ParserState,
    mm: f64,
) -> Result<f64, ErrorCode> {
    let given = w.take('F');
    match modal.feed_mode {
        FeedMode::InverseTime => {
            let moves = w.axis_command == Some(AxisCommand::Motion)
                && !matches!(modal.motion, Motion::None | Motion::Rapid);
            match given {
                None if moves => Err(ErrorCode::UndefinedFeed),
                given => Ok(given.unwrap_or(0.0)),
            }
        }
        FeedMode::UnitsPerMinute => Ok(match given {
            Some(feed) => times(feed, mm),
            None if kind == CommandKind::Jog => 0.0,
            None if state.modal.feed_mode == FeedMode::UnitsPerMinute => state.feed,
            None => 0.0,
        }),
    }
}

/// Returns the target of the axis words, in machine coordinates, mm.
fn target(w: &Words, after: &ParserState, systems: &CoordinateSystems, mm: f64) -> Axes {
    let work = systems.work[after.modal.coordinate_system];
    let is_machine = w.zero == Some(ZeroGroup::MachineCoordinates);
    std::array::from_fn(|axis| match w.axis(axis) {
        None => after.position_in_machine[axis],
        Some(value) if is_machine => times(value, w.scale(axis, mm)),
        Some(value) => match after.modal.distance {
            Distance::Absolute => {
                let place =
                    plus(times(value, w.scale(axis, mm)), plus(work[axis], after.g92[axis]));
                if axis == 2 { plus(place, after.tool_length) } else { place }
            }
            Distance::Incremental => {
                plus(times(value, w.scale(axis, mm)), after.position_in_machine[axis])
            }
        },
    })
}

fn non_modal(
    w: &mut Words,
    vocabulary: &Vocabulary,
    after: &ParserState,
    systems: &CoordinateSystems,
    target: Axes,
    mm: f64,
) -> Result<Option<NonModal>, ErrorCode> {
    let position = after.position_in_machine;
    let along_z = |axis: usize| if axis == 2 { after.tool_length } else { 0.0 };
    Ok(match w.zero {
        Some(ZeroGroup::SetOffset) => {
            if !w.has_axis() {
                return Err(ErrorCode::NoAxisWords);
            }
            let (Some(p), Some(l)) = (w.take('P'), w.take('L')) else {
                return Err(ErrorCode::ValueWordMissing);
            };
            if p.trunc() > vocabulary.systems as f64 {
                return Err(ErrorCode::UnsupportedCoordinateSystem);
            }
            let from_position = match l.trunc() as i64 {
                20 => true,
                2 if w.get('R').is_none() => false,
                _ => return Err(ErrorCode::Unsupported),
            };
            let system = match p.trunc() as usize {
                0 => after.modal.coordinate_system,
                system => system - 1,
            };
            let mut offset = systems.work[system];
            for (axis, offset) in offset.iter_mut().enumerate() {
                if let Some(value) = w.axis(axis) {
                    *offset = match from_position {
                        true => {
                            let from = minus(position[axis], after.g92[axis]);
                            minus(minus(from, along_z(axis)), times(value, w.scale(axis, mm)))
                        }
                        false => times(value, w.scale(axis, mm)),
                    };
                }
            }
            Some(NonModal::SetWorkOffset { system, offset })
        }
        Some(ZeroGroup::SetG92) => {
            if !w.has_axis() {
                return Err(ErrorCode::NoAxisWords);
            }
            let work = systems.work[after.modal.coordinate_system];
            Some(NonModal::SetG92(std::array::from_fn(|axis| match w.axis(axis) {
                Some(value) => {
                    let from = minus(position[axis], work[axis]);
                    minus(minus(from, along_z(axis)), times(value, w.scale(axis, mm)))
                }
                None => after.g92[axis],
            })))
        }
        Some(ZeroGroup::ClearG92) => Some(NonModal::SetG92([0.0; AXES])),
        Some(ZeroGroup::Store { g30 }) => Some(NonModal::Store { g30 }),
        Some(ZeroGroup::GoTo { g30 }) => {
            let named = std::array::from_fn(|axis| w.axis(axis).is_some());
            Some(NonModal::GoTo { g30, over: w.has_axis().then_some(target), named })
        }
        Some(ZeroGroup::Dwell | ZeroGroup::MachineCoordinates) | None => None,
    })
}

/// What a motion needs to know of its block, apart from the words.
struct Ask<'a> {
    kind: CommandKind,
    vocabulary: &'a Vocabulary,
    modal: &'a Modal,
    target: Axes,
    feed: f64,
    mm: f64,
}

fn motion(w: &mut Words, ask: &Ask<'_>, state: &ParserState) -> Result<Effect, ErrorCode> {
    let &Ask { kind, vocabulary, modal, target, feed, mm } = ask;
    if modal.motion == Motion::None {
        return if w.has_axis() { Err(ErrorCode::AxisWordsExist) } else { Ok(Effect::None) };
    }
    if w.axis_command != Some(AxisCommand::Motion) {
        return Ok(Effect::None);
    }
    if modal.motion == Motion::Rapid {
        return Ok(if w.has_axis() { Effect::Rapid(target) } else { Effect::None });
    }
    if modal.motion == Motion::Thread {
        let pitch = times(w.take('K').unwrap_or(0.0), mm);
        return match pitch != 0.0 {
            true => Ok(Effect::Thread { target, pitch }),
            false => Err(ErrorCode::ValueOutOfRange),
        };
    }
    if feed <= 0.0 {
        return Err(ErrorCode::UndefinedFeed);
    }
    let start = state.position_in_machine;
    let clockwise = modal.motion == Motion::ArcClockwise;
    match modal.motion {
        Motion::Line if w.has_axis() => Ok(Effect::Line(target)),
        Motion::Line if kind == CommandKind::Jog => Err(ErrorCode::NoAxisWords),
        Motion::Line => Ok(Effect::None),
        Motion::ArcClockwise | Motion::ArcCounterclockwise => {
            let (a, b, _) = modal.plane.axes();
            let letters = ['I', 'J', 'K'];
            let has_center = w.get(letters[a]).is_some() || w.get(letters[b]).is_some();
            let is_bare_circle = vocabulary.has_bare_circles && !w.has_axis() && has_center;
            if !w.has_axis() && !is_bare_circle {
                return Err(ErrorCode::NoAxisWords);
            }
            if w.axis(a).is_none() && w.axis(b).is_none() && !is_bare_circle {
                return Err(ErrorCode::NoAxisWordsInPlane);
            }
            if let Some(radius) = w.take('R') {
                let radius = times(radius, mm);
                return Arc::from_radius(modal.plane, start, target, radius, clockwise)
                    .map(Effect::Arc);
            }
            if !has_center {
                return Err(ErrorCode::NoOffsetsInPlane);
            }
            let offset = letters.map(|letter| times(w.take(letter).unwrap_or(0.0), mm));
            let offset = with_others_at_zero(offset);
            Arc::from_offsets(modal.plane, start, target, offset, clockwise).map(Effect::Arc)
        }
        Motion::Probe { away, miss_is_fine } => {
            if !w.has_axis() {
                return Err(ErrorCode::NoAxisWords);
            }
            if target == start {
                return Err(ErrorCode::InvalidTarget);
            }
            Ok(Effect::Probe { target, away, miss_is_fine })
        }
        Motion::Rapid | Motion::Thread | Motion::None => Ok(Effect::None),
    }
}
