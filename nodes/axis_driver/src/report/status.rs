//! The status report `<State:sub|field:values|...>`.
//!
//! Only the state is always there; fields come in any order, and those that
//! nobody here knows are kept as they stand.

use super::{ReportUnits, parse_code, parse_number, parse_position};
use cnc_msgs::geometry::Position;
use serde::{Deserialize, Serialize};

/// The state word.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum ControllerState {
    Idle,
    Run,
    Hold,
    Jog,
    Alarm,
    Door,
    Check,
    Home,
    Sleep,
    Tool,
    /// A word that is not known here; empty on some builds.
    #[default]
    Unnamed,
    /// A word that is not known here.
    Other(String),
}

impl ControllerState {
    fn from_word(word: &str) -> Self {
        match word {
            "Idle" => Self::Idle,
            "Run" => Self::Run,
            "Hold" => Self::Hold,
            "Jog" => Self::Jog,
            "Alarm" => Self::Alarm,
            "Door" => Self::Door,
            "Check" => Self::Check,
            "Home" => Self::Home,
            "Sleep" => Self::Sleep,
            "Tool" => Self::Tool,
            "" => Self::Unnamed,
            other => Self::Other(other.to_owned()),
        }
    }
}

/// One status report; lengths in mm, feed in mm/min, machine or work frame as named.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct StatusReport {
    pub state: ControllerState,
    /// `Hold:0` has stopped, `Hold:1` decelerates; `Door` likewise.
    pub substate: Option<u8>,
    pub machine_position: Option<Position>,
    pub work_position: Option<Position>,
    /// Work position = machine position - this.
    pub work_offset: Option<Position>,
    pub feed_mm_per_min: Option<f64>,
    pub spindle_rpm: Option<f64>,
    /// Free planner blocks and free bytes of the receive buffer.
    pub free: Option<(u16, u16)>,
    /// The N number that is being cut.
    pub line: Option<u32>,
    /// Active input pins; absent when there is none.
    pub pins: Option<String>,
    /// Feed, rapid and spindle override, percent.
    pub overrides_percent: Option<[u8; 3]>,
    /// Spindle and coolant that are on: S C F M. Absent beside overrides: all off.
    pub accessories: Option<String>,
    /// Fields that are not known here: name and values.
    pub others: Vec<(String, String)>,
}

impl StatusReport {
    /// Whether an axis may be moving, or will without being told again.
    pub fn is_moving(&self) -> bool {
        match self.state {
            ControllerState::Run | ControllerState::Jog | ControllerState::Home => true,
            ControllerState::Hold => self.substate == Some(1),
            ControllerState::Door => !matches!(self.substate, None | Some(0 | 1)),
            _ => false,
        }
    }

    /// Whether motion has been stopped in a way that could be resumed.
    pub fn is_held(&self) -> bool {
        matches!(self.state, ControllerState::Hold | ControllerState::Door) && !self.is_moving()
    }
}

/// Reads what stands between the angle brackets; `None` for a damaged report.
pub(super) fn parse(text: &str, units: ReportUnits) -> Option<StatusReport> {
    if text.contains(['<', '>']) {
        return None;
    }
    let mut fields = text.split('|');
    let (word, substate) = match fields.next()?.split_once(':') {
        Some((word, substate)) => (word, Some(u8::try_from(parse_code(substate)?).ok()?)),
        None => (text.split('|').next()?, None),
    };
    if !word.bytes().all(|byte| byte.is_ascii_alphabetic()) {
        return None;
    }
    let state = ControllerState::from_word(word);
    let mut report = StatusReport { state, substate, ..StatusReport::default() };
    for field in fields {
        let (key, value) = field.split_once(':').unwrap_or(("", field));
        match key {
            "MPos" => report.machine_position = Some(parse_position(value, units)?),
            "WPos" => report.work_position = Some(parse_position(value, units)?),
            "WCO" => report.work_offset = Some(parse_position(value, units)?),
            "FS" => {
                let mut numbers = value.split(',').map(parse_number);
                report.feed_mm_per_min = Some(numbers.next()?? * units.millimetres());
                report.spindle_rpm = Some(numbers.next()??);
            }
            "F" => report.feed_mm_per_min = Some(parse_number(value)? * units.millimetres()),
            "Bf" => {
                let (blocks, bytes) = value.split_once(',')?;
                report.free = Some((parse_code(blocks)?, parse_code(bytes)?));
            }
            "Ln" => report.line = Some(value.parse().ok()?),
            "Pn" => report.pins = Some(value.to_owned()),
            "Ov" => {
                let mut percents = [0; 3];
                let mut numbers = value.split(',');
                for percent in &mut percents {
                    *percent = numbers.next()?.parse().ok()?;
                }
                report.overrides_percent = Some(percents);
            }
            "A" => report.accessories = Some(value.to_owned()),
            _ => report.others.push((key.to_owned(), value.to_owned())),
        }
    }
    Some(report)
}
