//! Sorts the words of a block into modal groups and values.
//!
//! The first pass over a block: finds unknown, repeated and conflicting words. `check` decides
//! what the words mean together.

use crate::axes::AxisLetters;
use crate::codes::ErrorCode;
use crate::firmware::Vocabulary;
use crate::gcode::port;
use crate::gcode::words::words;
use crate::gcode::{CommandKind, Distance, FeedMode, Flow, Modal, Motion, Plane, Spindle, Units};

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ZeroGroup {
    Dwell,
    SetOffset,
    GoTo { g30: bool },
    Store { g30: bool },
    MachineCoordinates,
    SetG92,
    ClearG92,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ToolLength {
    Dynamic,
    Cancel,
}

/// Which command claims the axis words.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum AxisCommand {
    NonModal,
    Motion,
    ToolLength,
}

/// The words of a block, sorted.
#[derive(Debug, Default)]
pub(super) struct Words {
    /// The axes of the board.
    axes: AxisLetters,
    pub(super) values: [Option<f64>; 26],
    pub(super) groups: u32,
    pub(super) zero: Option<ZeroGroup>,
    pub(super) axis_command: Option<AxisCommand>,
    pub(super) tool_length: Option<ToolLength>,
    pub(super) flow: Option<Flow>,
    pub(super) changes_tool: bool,
    /// 62 to 68.
    pub(super) port_word: Option<i64>,
}

impl Words {
    pub(super) fn get(&self, letter: char) -> Option<f64> {
        self.values[index(letter)]
    }

    pub(super) fn take(&mut self, letter: char) -> Option<f64> {
        self.values[index(letter)].take()
    }

    /// The word of an axis; none for axes that the board does not have.
    pub(super) fn axis(&self, axis: usize) -> Option<f64> {
        self.axes.all().get(axis).and_then(|letter| self.get(*letter))
    }

    /// Millimetres of one unit of an axis word, and degrees of one that turns.
    pub(super) fn scale(&self, axis: usize, mm: f64) -> f64 {
        if self.axes.is_rotary(axis) { 1.0 } else { mm }
    }

    pub(super) fn has_axis(&self) -> bool {
        self.axes.all().iter().any(|letter| self.get(*letter).is_some())
    }

    pub(super) fn take_axes(&mut self) {
        let axes = self.axes;
        axes.all().iter().for_each(|letter| self.values[index(*letter)] = None);
    }

    fn claim_group(&mut self, group: u32) -> Result<(), ErrorCode> {
        if self.groups & (1 << group) != 0 {
            return Err(ErrorCode::ModalGroupViolation);
        }
        self.groups |= 1 << group;
        Ok(())
    }

    fn claim_axes(&mut self, command: AxisCommand) -> Result<(), ErrorCode> {
        match self.axis_command.replace(command) {
            Some(_) => Err(ErrorCode::AxisCommandConflict),
            None => Ok(()),
        }
    }
}

pub(super) fn index(letter: char) -> usize {
    letter as usize - 'A' as usize
}

/// Groups as bits: G groups by their number, M groups from 16 on.
const GROUP_M_FLOW: u32 = 20;
const GROUP_M_TOOL: u32 = 22;
const GROUP_M_SPINDLE: u32 = 23;
const GROUP_M_COOLANT: u32 = 24;
const GROUP_M_PORT: u32 = 25;
/// Groups 0, 3 and 6 are all that a jog may have.
pub(super) const GROUPS_OF_JOGS: u32 = 1 | 1 << 3 | 1 << 6;

/// Sorts the words into groups and values; the first pass of the firmware.
pub(super) fn sort(
    line: &str,
    kind: CommandKind,
    vocabulary: &Vocabulary,
    modal: &mut Modal,
) -> Result<Words, ErrorCode> {
    let mut w = Words { axes: vocabulary.axes, ..Words::default() };
    for word in words(line, vocabulary.stray_letter, vocabulary.digits) {
        let (letter, value) = word?;
        // Codes are read in hundredths: G38.2 is 3820.
        let hundredths = (value * 100.0).round() as i64;
        match letter {
            'G' => g_word(&mut w, modal, vocabulary, hundredths)?,
            'M' => m_word(&mut w, modal, kind, vocabulary, hundredths)?,
            _ if carries_value(letter, vocabulary) => {
                if w.values[index(letter)].replace(value).is_some() {
                    return Err(ErrorCode::WordRepeated);
                }
                if matches!(letter, 'F' | 'N' | 'P' | 'T' | 'S') && value < 0.0 {
                    return Err(ErrorCode::NegativeValue);
                }
                if letter == 'T' && value.trunc() > vocabulary.tool_max {
                    return Err(ErrorCode::ValueTooLarge);
                }
            }
            _ => return Err(ErrorCode::Unsupported),
        }
    }
    Ok(w)
}

fn carries_value(letter: char, vocabulary: &Vocabulary) -> bool {
    let is_common = matches!(letter, 'F' | 'I'..='L' | 'N' | 'P' | 'R' | 'S' | 'T' | 'X'..='Z');
    is_common
        || vocabulary.more_letters.contains(&letter)
        || vocabulary.axes.all().contains(&letter)
}

fn g_word(
    w: &mut Words,
    modal: &mut Modal,
    vocabulary: &Vocabulary,
    hundredths: i64,
) -> Result<(), ErrorCode> {
    use AxisCommand::{Motion as M, NonModal as N, ToolLength as T};
    let whole = hundredths / 100;
    let fraction = hundredths % 100;
    // G59.1 is the seventh coordinate system.
    let system = match whole {
        54..=59 => {
            Some((whole - 54) as usize + if whole == 59 { fraction as usize / 10 } else { 0 })
        }
        _ => None,
    };
    let is_beyond_g59 = whole == 59
        && fraction % 10 == 0
        && system.is_some_and(|system| system < vocabulary.systems);
    let fraction_ok = match whole {
        28 | 30 | 92 => matches!(fraction, 0 | 10),
        38 => matches!(fraction, 20 | 30 | 40 | 50),
        43 => fraction == 10,
        91 => matches!(fraction, 0 | 10),
        90 | 61 => fraction == 0,
        _ => true,
    };
    let needs_integer = !matches!(whole, 28 | 30 | 92 | 38 | 43 | 91) && !is_beyond_g59;
    if !fraction_ok {
        return Err(ErrorCode::Unsupported);
    }
    let group = match whole {
        4 | 53 => 0,
        10 | 28 | 30 | 92 => {
            if fraction == 0 {
                w.claim_axes(N)?;
            }
            0
        }
        33 if !vocabulary.has_spindle_sync => return Err(ErrorCode::Unsupported),
        0..=3 | 33 | 38 => {
            w.claim_axes(M)?;
            1
        }
        80 => 1,
        17..=19 => 2,
        91 if fraction == 10 => 4,
        90 | 91 => 3,
        93 | 94 => 5,
        20 | 21 => 6,
        40 => 7,
        43 | 49 => {
            w.claim_axes(T)?;
            8
        }
        54..=59 => 12,
        61 => 13,
        _ => return Err(ErrorCode::Unsupported),
    };
    if needs_integer && fraction != 0 {
        return Err(ErrorCode::NotInteger);
    }
    match whole {
        0 => modal.motion = Motion::Rapid,
        1 => modal.motion = Motion::Line,
        2 => modal.motion = Motion::ArcClockwise,
        3 => modal.motion = Motion::ArcCounterclockwise,
        38 => {
            modal.motion =
                Motion::Probe { away: fraction >= 40, miss_is_fine: matches!(fraction, 30 | 50) };
        }
        33 => modal.motion = Motion::Thread,
        80 => modal.motion = Motion::None,
        17 => modal.plane = Plane::Xy,
        18 => modal.plane = Plane::Zx,
        19 => modal.plane = Plane::Yz,
        90 => modal.distance = Distance::Absolute,
        91 if fraction == 0 => modal.distance = Distance::Incremental,
        93 => modal.feed_mode = FeedMode::InverseTime,
        94 => modal.feed_mode = FeedMode::UnitsPerMinute,
        20 => modal.units = Units::Inches,
        21 => modal.units = Units::Millimetres,
        43 => w.tool_length = Some(ToolLength::Dynamic),
        49 => w.tool_length = Some(ToolLength::Cancel),
        54..=59 => modal.coordinate_system = system.unwrap_or_default(),
        4 => w.zero = Some(ZeroGroup::Dwell),
        10 => w.zero = Some(ZeroGroup::SetOffset),
        53 => w.zero = Some(ZeroGroup::MachineCoordinates),
        28 | 30 if fraction == 0 => w.zero = Some(ZeroGroup::GoTo { g30: whole == 30 }),
        28 | 30 => w.zero = Some(ZeroGroup::Store { g30: whole == 30 }),
        92 if fraction == 0 => w.zero = Some(ZeroGroup::SetG92),
        92 => w.zero = Some(ZeroGroup::ClearG92),
        _ => {}
    }
    w.claim_group(group)
}

fn m_word(
    w: &mut Words,
    modal: &mut Modal,
    kind: CommandKind,
    vocabulary: &Vocabulary,
    hundredths: i64,
) -> Result<(), ErrorCode> {
    if hundredths % 100 != 0 {
        return Err(ErrorCode::NotInteger);
    }
    let has_mist = kind == CommandKind::Program && vocabulary.has_mist;
    let group = match hundredths / 100 {
        0 => {
            w.flow = Some(Flow::Pause);
            GROUP_M_FLOW
        }
        1 => {
            if vocabulary.has_optional_stop {
                w.flow = Some(Flow::OptionalPause);
            }
            GROUP_M_FLOW
        }
        2 | 30 => {
            w.flow = Some(Flow::End);
            GROUP_M_FLOW
        }
        code @ 3..=5 => {
            modal.spindle = match code {
                3 => Spindle::Clockwise,
                4 => Spindle::Counterclockwise,
                _ => Spindle::Off,
            };
            GROUP_M_SPINDLE
        }
        6 if vocabulary.has_tool_change => {
            w.changes_tool = true;
            GROUP_M_TOOL
        }
        7 if has_mist => {
            modal.coolant.mist = true;
            GROUP_M_COOLANT
        }
        8 => {
            modal.coolant.flood = true;
            GROUP_M_COOLANT
        }
        9 => {
            modal.coolant = Default::default();
            GROUP_M_COOLANT
        }
        word @ 62..=68 if port::is_known(word, vocabulary.ports) => {
            w.port_word = Some(word);
            GROUP_M_PORT
        }
        _ => return Err(ErrorCode::Unsupported),
    };
    w.claim_group(group)
}
