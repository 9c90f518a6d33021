//! Machine functions.

use super::{WireError, number, position};
use crate::contour::{Action, CoolantMode, Probe, SpindleMode};
use crate::further::{FURTHER_LETTERS, FurtherAxes, FurtherMode, FurtherMove};
use crate::geometry::AxisSet;
use crate::text::{Text, Words};
use crate::units::{
    degrees_from_rad, degrees_per_min_from_rad_per_s, m_from_mm, m_per_s_from_mm_per_min,
    mm_from_m, mm_per_min_from_m_per_s, point_from_position, rad_from_degrees,
    rad_per_s_from_degrees_per_min, rad_per_s_from_rpm, received_degrees_per_min, received_mm,
    received_mm_per_min, received_rpm, rpm_from_rad_per_s,
};
use crate::wire::cnc_msgs::msg as wire;

impl From<&Action> for wire::MachineFunction {
    fn from(action: &Action) -> Self {
        let mut out = Self { text: action.text(), ..Self::default() };
        out.kind = match *action {
            Action::SpindleSpeed { rpm } => {
                out.value = rad_per_s_from_rpm(rpm);
                Self::SPINDLE_SPEED
            }
            Action::Spindle(SpindleMode::Clockwise) => Self::SPINDLE_CLOCKWISE,
            Action::Spindle(SpindleMode::CounterClockwise) => Self::SPINDLE_COUNTERCLOCKWISE,
            Action::Spindle(SpindleMode::Off) => Self::SPINDLE_OFF,
            Action::Coolant(CoolantMode::Mist) => Self::COOLANT_MIST,
            Action::Coolant(CoolantMode::Flood) => Self::COOLANT_FLOOD,
            Action::Coolant(CoolantMode::Off) => Self::COOLANT_OFF,
            Action::SelectTool { tool } => {
                out.number = tool;
                Self::SELECT_TOOL
            }
            Action::ChangeTool { tool } => {
                out.number = tool;
                Self::CHANGE_TOOL
            }
            // The second number is in the text.
            Action::ToolLength { offset: Some(offset), length_mm, .. } => {
                out.number = offset;
                out.value = m_from_mm(length_mm);
                Self::TOOL_LENGTH
            }
            Action::ToolLength { offset: None, .. } => Self::TOOL_LENGTH_CANCEL,
            Action::WorkOffset { system } => {
                out.number = system.into();
                Self::WORK_OFFSET
            }
            Action::Dwell { seconds } => {
                out.value = seconds;
                Self::DWELL
            }
            Action::Auxiliary { letter, number, words } => {
                out.text = format!("{letter} {words}").trim_end().to_owned();
                out.value = number;
                Self::AUXILIARY
            }
            Action::Stop { optional: false } => Self::STOP,
            Action::Stop { optional: true } => Self::OPTIONAL_STOP,
            Action::Reference { axes, second } => {
                out.axes = axes.bits();
                if second { Self::REFERENCE_SECOND } else { Self::REFERENCE_FIRST }
            }
            Action::MachineMove { target, axes, rapid, feed_mm_per_min } => {
                out.axes = axes.bits();
                out.target = point_from_position(target);
                out.value = m_per_s_from_mm_per_min(feed_mm_per_min);
                if rapid { Self::MACHINE_RAPID } else { Self::MACHINE_FEED }
            }
            Action::SetWorkOffset { system, axes, origin, by_position } => {
                out.number = system.into();
                out.axes = axes.bits();
                out.target = point_from_position(origin);
                if by_position { Self::WORK_OFFSET_BY_POSITION } else { Self::SET_WORK_OFFSET }
            }
            Action::StoreReference { second: false } => Self::STORE_REFERENCE_FIRST,
            Action::StoreReference { second: true } => Self::STORE_REFERENCE_SECOND,
            Action::Home { axes } => {
                out.axes = axes.bits();
                Self::HOME
            }
            Action::Further(FurtherMove { axes, mode }) => {
                out.further_axes = axes.bits();
                out.further_target = further_to_wire(axes);
                match mode {
                    FurtherMode::Along => Self::FURTHER_ALONG,
                    FurtherMode::Rapid => Self::FURTHER_RAPID,
                    FurtherMode::Feed(feed) => {
                        out.value = match axes.only_turns() {
                            true => rad_per_s_from_degrees_per_min(feed),
                            false => m_per_s_from_mm_per_min(feed),
                        };
                        Self::FURTHER_FEED
                    }
                }
            }
            Action::Probe(probe) => {
                out.number = probe.number().into();
                Self::PROBE
            }
            Action::SpindleSync { pitch_mm } => {
                out.value = m_from_mm(pitch_mm);
                Self::SPINDLE_SYNC
            }
            Action::Relative { axes } => {
                out.axes = axes.bits();
                Self::RELATIVE
            }
            Action::Stretch { axes } => {
                out.axes = axes.bits();
                Self::STRETCH
            }
            Action::ExactStop => Self::EXACT_STOP,
            Action::Message { text } => {
                out.text = text.to_string();
                Self::MESSAGE
            }
            Action::ProgramEnd { rewind: false } => Self::PROGRAM_END,
            Action::ProgramEnd { rewind: true } => Self::PROGRAM_END_REWIND,
        };
        out
    }
}

impl Action {
    /// The action as its receiver gets it.
    pub(super) fn received(self) -> Self {
        match self {
            Self::SpindleSpeed { rpm } => Self::SpindleSpeed { rpm: received_rpm(rpm) },
            Self::ToolLength { offset, second, length_mm } => {
                Self::ToolLength { offset, second, length_mm: received_mm(length_mm) }
            }
            Self::MachineMove { target, axes, rapid, feed_mm_per_min } => Self::MachineMove {
                target: target.map(received_mm),
                axes,
                rapid,
                feed_mm_per_min: received_mm_per_min(feed_mm_per_min),
            },
            Self::SetWorkOffset { system, axes, origin, by_position } => {
                Self::SetWorkOffset { system, axes, origin: origin.map(received_mm), by_position }
            }
            Self::SpindleSync { pitch_mm } => Self::SpindleSync { pitch_mm: received_mm(pitch_mm) },
            Self::Further(FurtherMove { axes, mode }) => {
                let mode = match mode {
                    FurtherMode::Feed(feed) if axes.only_turns() => {
                        FurtherMode::Feed(received_degrees_per_min(feed))
                    }
                    FurtherMode::Feed(feed) => FurtherMode::Feed(received_mm_per_min(feed)),
                    other => other,
                };
                Self::Further(FurtherMove { axes: axes.received(), mode })
            }
            other => other,
        }
    }
}

/// The tool whose length is added to that of the first: `G43 H1 G43.2 H2`.
fn second_length(text: &str) -> Result<Option<u32>, WireError> {
    let Some((_, number)) = text.split_once(" G43.2 H") else { return Ok(None) };
    let wrong = |_| WireError::Text { field: "text", value: text.to_owned() };
    number.parse().map(Some).map_err(wrong)
}

impl TryFrom<&wire::MachineFunction> for Action {
    type Error = WireError;

    fn try_from(function: &wire::MachineFunction) -> Result<Self, WireError> {
        type W = wire::MachineFunction;
        let value = number("value", function.value)?;
        let axes = AxisSet::from_bits(function.axes);
        let machine_move = |rapid| -> Result<Self, WireError> {
            Ok(Self::MachineMove {
                target: position("target", &function.target)?,
                axes,
                rapid,
                feed_mm_per_min: mm_per_min_from_m_per_s(value),
            })
        };
        let system = || match u8::try_from(function.number) {
            Ok(system @ 1..=9) => Ok(system),
            _ => Err(WireError::Constant { field: "number", value: function.number }),
        };
        let set_work_offset = |by_position| -> Result<Self, WireError> {
            let origin = position("target", &function.target)?;
            Ok(Self::SetWorkOffset { system: system()?, axes, origin, by_position })
        };
        let further =
            further_from_wire("further_target", function.further_axes, &function.further_target)?;
        let further_move = |mode| match further.is_empty() {
            true => Err(WireError::Missing { field: "further_target" }),
            false => Ok(Self::Further(FurtherMove { axes: further, mode })),
        };
        Ok(match function.kind {
            W::SPINDLE_SPEED => Self::SpindleSpeed { rpm: rpm_from_rad_per_s(value) },
            W::SPINDLE_CLOCKWISE => Self::Spindle(SpindleMode::Clockwise),
            W::SPINDLE_COUNTERCLOCKWISE => Self::Spindle(SpindleMode::CounterClockwise),
            W::SPINDLE_OFF => Self::Spindle(SpindleMode::Off),
            W::COOLANT_MIST => Self::Coolant(CoolantMode::Mist),
            W::COOLANT_FLOOD => Self::Coolant(CoolantMode::Flood),
            W::COOLANT_OFF => Self::Coolant(CoolantMode::Off),
            W::SELECT_TOOL => Self::SelectTool { tool: function.number },
            W::CHANGE_TOOL => Self::ChangeTool { tool: function.number },
            W::TOOL_LENGTH => Self::ToolLength {
                offset: Some(function.number),
                second: second_length(&function.text)?,
                length_mm: mm_from_m(value),
            },
            W::TOOL_LENGTH_CANCEL => {
                Self::ToolLength { offset: None, second: None, length_mm: 0.0 }
            }
            W::WORK_OFFSET => Self::WorkOffset { system: system()? },
            W::SET_WORK_OFFSET => set_work_offset(false)?,
            W::WORK_OFFSET_BY_POSITION => set_work_offset(true)?,
            W::STORE_REFERENCE_FIRST => Self::StoreReference { second: false },
            W::STORE_REFERENCE_SECOND => Self::StoreReference { second: true },
            W::DWELL if value >= 0.0 => Self::Dwell { seconds: value },
            W::DWELL => return Err(WireError::Number { field: "value", value }),
            W::AUXILIARY => match auxiliary(&function.text) {
                Some((letter, words)) => Self::Auxiliary { letter, number: value, words },
                None => {
                    return Err(WireError::Text { field: "text", value: function.text.clone() });
                }
            },
            W::STOP => Self::Stop { optional: false },
            W::OPTIONAL_STOP => Self::Stop { optional: true },
            W::REFERENCE_FIRST => Self::Reference { axes, second: false },
            W::REFERENCE_SECOND => Self::Reference { axes, second: true },
            W::MACHINE_RAPID => machine_move(true)?,
            W::MACHINE_FEED => machine_move(false)?,
            W::HOME => Self::Home { axes },
            W::FURTHER_ALONG => further_move(FurtherMode::Along)?,
            W::FURTHER_RAPID => further_move(FurtherMode::Rapid)?,
            W::FURTHER_FEED if value > 0.0 => {
                further_move(FurtherMode::Feed(match further.only_turns() {
                    true => degrees_per_min_from_rad_per_s(value),
                    false => mm_per_min_from_m_per_s(value),
                }))?
            }
            W::FURTHER_FEED => return Err(WireError::Number { field: "value", value }),
            W::PROBE => match Probe::of_number(function.number) {
                Some(probe) => Self::Probe(probe),
                None => {
                    return Err(WireError::Constant { field: "number", value: function.number });
                }
            },
            W::SPINDLE_SYNC if value > 0.0 => Self::SpindleSync { pitch_mm: mm_from_m(value) },
            W::SPINDLE_SYNC => return Err(WireError::Number { field: "value", value }),
            W::RELATIVE => Self::Relative { axes },
            W::STRETCH => Self::Stretch { axes },
            W::EXACT_STOP => Self::ExactStop,
            W::MESSAGE => match Text::new(&function.text) {
                Some(text) => Self::Message { text },
                None => {
                    return Err(WireError::Text { field: "text", value: function.text.clone() });
                }
            },
            W::PROGRAM_END => Self::ProgramEnd { rewind: false },
            W::PROGRAM_END_REWIND => Self::ProgramEnd { rewind: true },
            value => return Err(WireError::Constant { field: "kind", value: value.into() }),
        })
    }
}

/// The values of the axes that are named, in the order of their bits, rad and m.
pub fn further_to_wire(axes: FurtherAxes) -> Vec<f64> {
    let values = axes.iter().map(|(axis, value)| match FurtherAxes::is_rotary(axis) {
        true => rad_from_degrees(value),
        false => m_from_mm(value),
    });
    values.collect()
}

/// The same, read: as many values as axes are named, each of them finite and in range.
pub fn further_from_wire(
    field: &'static str,
    named: u8,
    values: &[f64],
) -> Result<FurtherAxes, WireError> {
    if usize::try_from(named.count_ones()) != Ok(values.len())
        || named >> FURTHER_LETTERS.len() != 0
    {
        return Err(WireError::Constant { field: "further_axes", value: named.into() });
    }
    let mut rest = values.iter();
    let mut axes = FurtherAxes::NONE;
    for axis in (0..FURTHER_LETTERS.len()).filter(|axis| named >> axis & 1 == 1) {
        let Some(value) = rest.next() else { break };
        let value = match FurtherAxes::is_rotary(axis) {
            true => degrees_from_rad(*value),
            false => mm_from_m(*value),
        };
        axes = axes.with(axis, number(field, value)?);
    }
    Ok(axes)
}

/// The letter of an auxiliary word, and the words that belong to it: `M`, `M P1 L3`.
fn auxiliary(text: &str) -> Option<(char, Words)> {
    let (letter, words) = text.split_once(' ').unwrap_or((text, ""));
    let mut letters = letter.chars();
    match (letters.next(), letters.next()) {
        (Some(letter), None) if letter.is_ascii_uppercase() => Some((letter, Words::new(words)?)),
        _ => None,
    }
}
