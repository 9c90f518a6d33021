//! The status report `<State:sub|field:values|...>`.
//!
//! Only the state and a position are always there; fields come in any order, and those
//! that nobody here knows are kept as they stand.

use super::ReportUnits;
use super::number::{parse_count, parse_further, parse_number, parse_position, parse_work_system};
use crate::firmware::Firmware;
use cnc_msgs::contour::SpindleMode;
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
    /// No word at all, as some builds have it.
    #[default]
    Unnamed,
    /// A word that is not known here, or that says nothing yet: `Starting`.
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

/// Which spindle and coolant outputs are on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Accessories {
    pub spindle: SpindleMode,
    pub flood: bool,
    pub mist: bool,
}

impl Accessories {
    /// Reads `SFM`; letters that are not known here are passed over.
    fn from_letters(letters: &str) -> Self {
        let spindle = match (letters.contains('S'), letters.contains('C')) {
            (_, true) => SpindleMode::CounterClockwise,
            (true, false) => SpindleMode::Clockwise,
            (false, false) => SpindleMode::Off,
        };
        Self { spindle, flood: letters.contains('F'), mist: letters.contains('M') }
    }
}

/// One status report; lengths in mm, feed in mm/min, machine or work frame as named.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct StatusReport {
    pub state: ControllerState,
    /// `Hold:0` has stopped, `Hold:1` decelerates; `Door` likewise; `Alarm:11`.
    pub substate: Option<u8>,
    pub machine_position: Option<Position>,
    pub work_position: Option<Position>,
    /// The values after X, Y and Z of the one position that is in the report, as they are printed.
    pub further: Vec<f64>,
    /// The same of the work offset.
    pub further_offset: Vec<f64>,
    /// The unit that the decimals of the position show, whatever unit it was read in.
    pub shown_in: Option<ReportUnits>,
    /// Work position = machine position - this.
    pub work_offset: Option<Position>,
    pub feed_mm_per_min: Option<f64>,
    /// As programmed, with its override.
    pub spindle_rpm: Option<f64>,
    /// Free planner blocks and free bytes of the receive buffer.
    pub free: Option<(u16, u16)>,
    /// The N number that is being cut.
    pub line: Option<u32>,
    /// Active input pins; absent when there is none.
    pub pins: Option<String>,
    /// Feed, rapid and spindle override, percent.
    pub overrides_percent: Option<[u8; 3]>,
    /// Letters of what is on; see [`Self::accessories_on`].
    pub accessories: Option<String>,
    /// `WCS:G54`: 1 to 6 for G54 to G59, 7 to 9 for G59.1 to G59.3. grblHAL, on change.
    pub work_system: Option<u8>,
    /// `H:1`: all axes that have to be are homed. grblHAL, on change.
    pub is_homed: Option<bool>,
    /// `In:1`: what the last M66 has read, -1 if it has waited in vain. grblHAL, once.
    pub input: Option<i32>,
    /// `T:2`: the tool in the spindle, as the controller counts. grblHAL, on change.
    pub tool: Option<u32>,
    /// Fields that are not known here: name and values. Among them `TLR`, which says that
    /// a reference for tool lengths was taken, not that a tool length is in force.
    pub others: Vec<(String, String)>,
}

impl StatusReport {
    /// Whether an axis may be moving, or will move without another command.
    pub fn is_moving(&self) -> bool {
        match self.state {
            ControllerState::Run | ControllerState::Jog | ControllerState::Home => true,
            ControllerState::Hold => !matches!(self.substate, None | Some(0)),
            ControllerState::Door => !matches!(self.substate, None | Some(0 | 1)),
            _ => false,
        }
    }

    /// Whether it has read a hold that waits for the end of a motion which must not stop: a thread (grblHAL).
    pub fn will_hold(&self) -> bool {
        self.state == ControllerState::Run && self.substate == Some(1)
    }

    /// How fast the axes move. What stands in a hold may still report the feed from before it.
    pub fn speed_mm_per_min(&self) -> Option<f64> {
        self.feed_mm_per_min.filter(|_| !self.is_held())
    }

    /// Whether motion has been stopped in a way that could be resumed.
    pub fn is_held(&self) -> bool {
        matches!(self.state, ControllerState::Hold | ControllerState::Door) && !self.is_moving()
    }

    /// What is on, where this report says it; `None` leaves it as it was.
    ///
    /// Some firmwares leave it out next to the overrides when all is off; with the others only what
    /// is printed counts.
    pub fn accessories_on(&self, firmware: Firmware) -> Option<Accessories> {
        let is_left_out =
            !firmware.traits().prints_accessories_when_off && self.overrides_percent.is_some();
        let letters = self.accessories.as_deref().or(is_left_out.then_some(""));
        letters.map(Accessories::from_letters)
    }

    /// Reads what stands between the angle brackets; `None` for a damaged report.
    pub(super) fn read(text: &str, units: ReportUnits) -> Option<Self> {
        let mut fields = text.split('|');
        let (state, substate) = read_state(fields.next()?)?;
        let mut report = Self { state, substate, ..Self::default() };
        let mut keys: Vec<&str> = Vec::new();
        for field in fields {
            let (key, value) = field.split_once(':').unwrap_or(("", field));
            // A field that comes twice is two reports in one.
            if !key.is_empty() && keys.contains(&key) {
                return None;
            }
            keys.push(key);
            report.read_field(key, value, field, units)?;
        }
        (report.machine_position.is_some() || report.work_position.is_some()).then_some(report)
    }

    fn read_field(
        &mut self,
        key: &str,
        value: &str,
        field: &str,
        units: ReportUnits,
    ) -> Option<()> {
        // The name of a file may hold letters of any language.
        let is_plain = field.bytes().all(|byte| (0x20..0x7f).contains(&byte));
        let is_name = key == "SD" && !field.contains(char::REPLACEMENT_CHARACTER);
        if field.contains(['<', '>']) || !(is_plain || is_name) {
            return None;
        }
        match key {
            "MPos" => {
                self.machine_position = Some(parse_position(value, units)?);
                self.further = parse_further(value);
                self.shown_in = units_of(value);
            }
            "WPos" => {
                self.work_position = Some(parse_position(value, units)?);
                self.further = parse_further(value);
                self.shown_in = units_of(value);
            }
            "WCO" => {
                self.work_offset = Some(parse_position(value, units)?);
                self.further_offset = parse_further(value);
            }
            "FS" => {
                // A third number is the speed that was measured.
                let mut numbers = value.split(',').map(parse_number);
                self.feed_mm_per_min = Some(numbers.next()?? * units.millimetres());
                self.spindle_rpm = Some(numbers.next()??);
            }
            "F" => self.feed_mm_per_min = Some(parse_number(value)? * units.millimetres()),
            "Bf" => {
                let (blocks, bytes) = value.split_once(',')?;
                self.free = Some((parse_count(blocks)?, parse_count(bytes)?));
            }
            "Ln" => self.line = Some(value.parse().ok()?),
            "Pn" => self.pins = Some(value.to_owned()),
            "Ov" => {
                let mut percents = [0; 3];
                let mut numbers = value.split(',');
                for percent in &mut percents {
                    *percent = numbers.next()?.parse().ok()?;
                }
                self.overrides_percent = Some(percents);
            }
            "A" => self.accessories = Some(value.to_owned()),
            "WCS" if parse_work_system(value).is_some() => {
                self.work_system = parse_work_system(value);
            }
            // The axes that are homed may follow.
            "H" if matches!(value.split(',').next(), Some("0" | "1")) => {
                self.is_homed = Some(value.starts_with('1'));
            }
            "In" if value.parse::<i32>().is_ok() => self.input = value.parse().ok(),
            "T" if value.parse::<u32>().is_ok() => self.tool = value.parse().ok(),
            _ if key.is_empty() => self.others.push((String::new(), field.to_owned())),
            _ => self.others.push((key.to_owned(), value.to_owned())),
        }
        Some(())
    }
}

/// grbl and its relatives print three decimals of a millimetre, four of an inch; some print three
/// of a degree beside inches.
fn units_of(position: &str) -> Option<ReportUnits> {
    let mut decimals =
        position.split(',').take(3).map(|number| number.rsplit_once('.').map(|(_, d)| d.len()));
    let first = decimals.next()??;
    if !decimals.all(|other| other == Some(first)) {
        return None;
    }
    match first {
        3 => Some(ReportUnits::Millimetres),
        4 => Some(ReportUnits::Inches),
        _ => None,
    }
}

/// `Idle`, `Hold:0`, `Alarm:11`, or nothing at all.
fn read_state(text: &str) -> Option<(ControllerState, Option<u8>)> {
    let (word, substate) = match text.split_once(':') {
        Some((word, digits)) => {
            // Some builds print a substate below zero as a huge one.
            let is_number =
                (1..=10).contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_digit());
            let number: u64 = is_number.then(|| digits.parse().ok())??;
            (word, Some(u8::try_from(number).unwrap_or(u8::MAX)))
        }
        None => (text, None),
    };
    let is_word = word.bytes().all(|byte| byte.is_ascii_alphabetic());
    is_word.then(|| (ControllerState::from_word(word), substate))
}
