//! What the settings and offsets of a controller say about its machine.
//!
//! Travel, rates, spindle range, work systems: read from `$$`, `$#` and `$I`, whether they come
//! over the line or out of a file. Each firmware has rules of its own for where the machine zero
//! lies in the travel; they are here, and those of A to W in [`further`]. Knows no path.

mod further;

use crate::codes::setting_name;
use crate::driver::{ControllerSettings, Offset};
use crate::encoder::Ports;
use crate::firmware::Firmware;
use cnc_msgs::contour::work_system;
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes};
use cnc_msgs::geometry::{AXIS_LETTERS, Position};
use cnc_msgs::machine_file::MachineFile;
use std::collections::BTreeMap;

pub use further::FurtherLimits;
pub(crate) use further::{Direction, direction};

/// Planner blocks where the controller does not say.
const PLANNER_BLOCKS_DEFAULT: u16 = 15;
/// The travel that grbl is delivered with, mm. With soft limits off nobody had to correct it.
const TRAVEL_AS_DELIVERED_MM: f64 = 200.0;

/// As grbl is delivered, mm.
const JUNCTION_DEVIATION_MM: f64 = 0.01;
const ARC_TOLERANCE_MM: f64 = 0.002;
/// The bit of `$22` that switches homing on.
const HOMING_ON: u32 = 1;

/// Where the controller does not report its steps.
const STEPS_PER_MM_DEFAULT: f64 = 1_000.0;

/// A machine as its controller describes it.
#[derive(Debug, Clone, PartialEq)]
pub struct MachineLimits {
    pub firmware: Firmware,
    /// Blocks of the planner.
    pub planner_blocks: usize,
    /// `$11`, mm.
    pub junction_deviation_mm: f64,
    /// `$12`, mm.
    pub arc_tolerance_mm: f64,
    /// `$110` to `$112`.
    pub rate_mm_per_min: Position,
    /// `$120` to `$122`.
    pub acceleration_mm_per_s2: Position,
    /// `$800` to `$802` of grblHAL that is built with it.
    pub jerk_mm_per_s3: Option<Position>,
    /// `$100` to `$102`; the planner rounds to steps.
    pub steps_per_mm: Position,
    /// `$130` to `$132`; `None` for an axis whose travel nobody has entered.
    pub travel_mm: [Option<f64>; 3],
    /// Where the travel lies in the machine frame.
    pub zero: MachineZero,
    /// A, B, C, U, V and W; `None` for an axis that the controller does not have.
    pub further: [Option<FurtherLimits>; 6],
    /// Whether the axes are homed, or will be before a program runs.
    pub is_homed: bool,
    /// `$31` and `$30`, rev/min.
    pub spindle_rpm: Option<[f64; 2]>,
    /// `$32=1`.
    pub is_laser: bool,
    /// Whether the axes can keep pace with the spindle, where it is known.
    pub spindle_sync: Option<bool>,
    /// Outputs and inputs for programs, where it is known.
    pub ports: Option<Ports>,
    pub offsets: StoredOffsets,
}

/// Where the machine zero lies in the travel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MachineZero {
    /// Least and greatest coordinate of each axis, mm, once the machine is homed; `None` for an
    /// axis that it does not home.
    Placed { bounds_mm: [Option<[f64; 2]>; 3] },
    /// It is not known, for this reason.
    Unknown { because: &'static str },
}

/// The stored positions of the controller, machine frame, mm and degrees; `None` where they were not
/// reported.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StoredOffsets {
    /// G54 to G59.3.
    pub systems: [Option<Position>; 9],
    /// G28 and G30.
    pub references: [Option<Position>; 2],
    /// Of G92, added to every work system.
    pub shift: Position,
    /// The same for A, B, C, U, V and W; those that are not named are not known.
    pub further_systems: [FurtherAxes; 9],
    pub further_shift: FurtherAxes,
}

/// Settings that cannot be those of a machine.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LimitsProblem {
    #[error("firmware {name:?} is not known; known are {known}")]
    Firmware { name: String, known: String },
    #[error("${number} ({what}) is missing: these are not all settings of a {firmware} controller")]
    Missing { number: u16, what: String, firmware: &'static str },
    #[error("${number} ({what}) is {value}; it must be a number {range}")]
    Range { number: u16, what: String, value: String, range: &'static str },
    #[error("a {firmware} controller has no setting ${number}: is this the file of another board?")]
    Foreign { number: u32, firmware: &'static str },
    #[error("{name} is not a stored position; known are G54 to G59.3, G28, G30, G92 and TLO")]
    OffsetName { name: String },
    #[error("{name} has {count} values; the machine has the {wanted} axes {axes}")]
    OffsetLength { name: String, count: usize, wanted: usize, axes: String },
    #[error("axes is {axes:?}; it must be XYZ, and then the letters of the others")]
    Axes { axes: String },
    #[error("{letter} of {name} is {value}; it must be a finite number")]
    OffsetValue { name: String, letter: char, value: f64 },
}

impl LimitsProblem {
    /// The keys that lead to it in a machine file, the outermost first.
    pub fn place(&self) -> Vec<String> {
        let path = |list: &str, key: String| vec![list.to_owned(), key];
        match self {
            Self::Firmware { .. } => vec!["firmware".into()],
            Self::Missing { .. } => vec!["settings".into()],
            Self::Range { number, .. } => path("settings", number.to_string()),
            Self::Foreign { number, .. } => path("settings", number.to_string()),
            Self::Axes { .. } => vec!["axes".into()],
            Self::OffsetName { name }
            | Self::OffsetLength { name, .. }
            | Self::OffsetValue { name, .. } => path("offsets_mm", name.clone()),
        }
    }
}

/// What a machine file says, in the form in which the controller says it.
///
/// # Errors
/// The firmware is not known, or a setting or a position is none of that firmware.
pub fn settings_of_file(file: &MachineFile) -> Result<ControllerSettings, LimitsProblem> {
    let named = |it: &Firmware| it.traits().name.eq_ignore_ascii_case(&file.firmware);
    let Some(firmware) = Firmware::ALL.into_iter().find(named) else {
        let known = Firmware::ALL.map(|it| it.traits().name).join(", ");
        return Err(LimitsProblem::Firmware { name: file.firmware.clone(), known });
    };
    let mut settings = Vec::new();
    for (number, value) in &file.settings {
        let known = u16::try_from(*number).ok().filter(|number| is_of(firmware, *number));
        let Some(known) = known else {
            let firmware = firmware.traits().name;
            return Err(LimitsProblem::Foreign { number: *number, firmware });
        };
        settings.push((known, value.text()));
    }
    let systems = (1..=9).map(work_system);
    let known: Vec<String> =
        systems.chain(["G28", "G30", "G92", "TLO"].map(String::from)).collect();
    if let Some(name) = file.offsets_mm.keys().find(|name| !known.contains(name)) {
        return Err(LimitsProblem::OffsetName { name: name.clone() });
    }
    let axes = if file.axes.is_empty() { "XYZ" } else { &file.axes };
    let letters: Vec<char> = axes.strip_prefix("XYZ").unwrap_or("?").chars().collect();
    let is_new =
        |at: usize| letters[at].is_ascii_uppercase() && !letters[..at].contains(&letters[at]);
    if !(0..letters.len()).all(is_new) {
        return Err(LimitsProblem::Axes { axes: file.axes.clone() });
    }
    let offset = |(name, values): (&String, &Vec<f64>)| match values.split_first_chunk() {
        Some((position, rest)) if rest.len() == letters.len() || rest.is_empty() => {
            let values = letters.iter().zip(rest);
            let named =
                values.filter_map(|(it, value)| Some((FurtherAxes::index_of(*it)?, *value)));
            Ok(Offset { name: name.clone(), position: *position, further: named.collect() })
        }
        _ => Err(LimitsProblem::OffsetLength {
            name: name.clone(),
            count: values.len(),
            wanted: axes.len(),
            axes: axes.to_owned(),
        }),
    };
    let offsets: Result<Vec<Offset>, LimitsProblem> = file.offsets_mm.iter().map(offset).collect();
    Ok(ControllerSettings {
        firmware,
        version: file.version.clone(),
        options: file.options.clone(),
        planner_blocks: file
            .planner_blocks
            .or(firmware.traits().unreported_planner_blocks)
            .unwrap_or(PLANNER_BLOCKS_DEFAULT),
        settings,
        axes: axes.to_owned(),
        offsets: offsets?,
        spindle_sync: file.spindle_sync,
        ports: file.aux_io.map(Ports::from),
        ..ControllerSettings::default()
    })
}

/// Whether a firmware can have a setting of this number. Builds of grbl add some, all below 200;
/// the lists of the others depend on how they are built.
fn is_of(firmware: Firmware, number: u16) -> bool {
    firmware != Firmware::Grbl || number < 200
}

impl MachineLimits {
    /// Reads what a controller has reported.
    ///
    /// # Errors
    /// A setting is missing without which nothing can be judged, or has a value that no machine
    /// has.
    pub fn of(settings: &ControllerSettings) -> Result<Self, LimitsProblem> {
        let table = Table::of(settings);
        let axes = |base: u16, range: Range| -> Result<Position, LimitsProblem> {
            Ok([
                table.needed(base, range)?,
                table.needed(base + 1, range)?,
                table.needed(base + 2, range)?,
            ])
        };
        let travel = axes(130, Range::ZeroOrMore)?;
        let is_soft = table.flag(20);
        let is_as_delivered = |it: f64| !is_soft && (it - TRAVEL_AS_DELIVERED_MM).abs() < 1e-9;
        let travel_mm = travel.map(|it| (it > 0.0 && !is_as_delivered(it)).then_some(it));
        let spindle =
            [table.optional(31, Range::ZeroOrMore)?, table.optional(30, Range::ZeroOrMore)?];
        let spindle_rpm = match spindle {
            [min, Some(max)] if max > 0.0 => Some([min.unwrap_or(0.0), max]),
            _ => None,
        };
        Ok(Self {
            firmware: settings.firmware,
            planner_blocks: usize::from(settings.planner_blocks.max(1)),
            junction_deviation_mm: table
                .optional(11, Range::ZeroOrMore)?
                .unwrap_or(JUNCTION_DEVIATION_MM),
            arc_tolerance_mm: table
                .optional(12, Range::ZeroOrMore)?
                .filter(|tolerance| *tolerance > 0.0)
                .unwrap_or(ARC_TOLERANCE_MM),
            rate_mm_per_min: axes(110, Range::More)?,
            acceleration_mm_per_s2: axes(120, Range::More)?,
            jerk_mm_per_s3: match settings.firmware {
                Firmware::GrblHal if table.values.contains_key(&800) => {
                    Some(axes(800, Range::More)?)
                }
                _ => None,
            },
            steps_per_mm: match table.values.contains_key(&100) {
                true => axes(100, Range::More)?,
                false => [STEPS_PER_MM_DEFAULT; 3],
            },
            travel_mm,
            zero: table.zero(settings, travel),
            further: table.further(settings)?,
            is_homed: table.mask(22) & HOMING_ON != 0,
            spindle_rpm,
            is_laser: table.values.get(&32) == Some(&"1"),
            spindle_sync: match settings.firmware {
                Firmware::GrblHal => settings.spindle_sync,
                // They know no G33.
                Firmware::Grbl | Firmware::FluidNc => Some(false),
            },
            ports: match settings.firmware {
                Firmware::GrblHal => settings.ports,
                Firmware::Grbl | Firmware::FluidNc => Some(Ports::default()),
            },
            offsets: StoredOffsets::of(&settings.offsets)?,
        })
    }

    /// A machine of which nothing is known, for a time that is better than none.
    pub fn unknown(firmware: Firmware, planner_blocks: usize) -> Self {
        Self {
            firmware,
            planner_blocks,
            junction_deviation_mm: JUNCTION_DEVIATION_MM,
            arc_tolerance_mm: ARC_TOLERANCE_MM,
            rate_mm_per_min: [1_000.0; 3],
            acceleration_mm_per_s2: [200.0; 3],
            jerk_mm_per_s3: None,
            steps_per_mm: [STEPS_PER_MM_DEFAULT; 3],
            travel_mm: [None; 3],
            zero: MachineZero::Unknown { because: "the controller has not reported its settings" },
            further: [None; 6],
            is_homed: false,
            spindle_rpm: None,
            is_laser: false,
            spindle_sync: None,
            ports: None,
            offsets: StoredOffsets::default(),
        }
    }

    /// The same for a machine whose axes are not homed.
    #[must_use]
    pub fn not_homed(self) -> Self {
        let because = "the machine is not homed";
        let zero = match self.zero {
            MachineZero::Placed { .. } => MachineZero::Unknown { because },
            unknown @ MachineZero::Unknown { .. } => unknown,
        };
        let not_placed = |it: FurtherLimits| FurtherLimits { bounds: None, ..it };
        let further = self.further.map(|it| it.map(not_placed));
        Self { zero, further, is_homed: false, ..self }
    }

    /// Whether a machine coordinate says nothing about a place. Where only the travel is not
    /// placed, it does.
    pub(crate) fn frame_is_unknown(&self) -> bool {
        let is_travel_alone = self.firmware == Firmware::FluidNc && self.is_homed;
        !is_travel_alone && matches!(self.zero, MachineZero::Unknown { .. })
    }

    /// The axes that homing leaves where they are, although the machine is homed.
    pub(crate) fn axes_not_homed(&self) -> impl Iterator<Item = char> {
        let bounds = match self.zero {
            MachineZero::Placed { bounds_mm } => bounds_mm,
            MachineZero::Unknown { .. } => [Some([0.0; 2]); 3],
        };
        AXIS_LETTERS.into_iter().zip(bounds).filter(|it| it.1.is_none()).map(|it| it.0)
    }
}

fn what(firmware: Firmware, number: u16) -> String {
    match setting_name(firmware, number) {
        Some((name, "")) => name.to_owned(),
        Some((name, unit)) => format!("{name}, {unit}"),
        None => "a setting".to_owned(),
    }
}

/// What a number may be.
#[derive(Debug, Clone, Copy)]
enum Range {
    ZeroOrMore,
    More,
}

/// The settings by number.
struct Table<'a> {
    firmware: Firmware,
    values: BTreeMap<u16, &'a str>,
}

impl<'a> Table<'a> {
    fn of(settings: &'a ControllerSettings) -> Self {
        let rows = settings.settings.iter().map(|(number, value)| (*number, value.trim()));
        Self { firmware: settings.firmware, values: rows.collect() }
    }

    fn optional(&self, number: u16, range: Range) -> Result<Option<f64>, LimitsProblem> {
        let Some(text) = self.values.get(&number) else { return Ok(None) };
        let words = match range {
            Range::ZeroOrMore => "of at least 0",
            Range::More => "above 0",
        };
        let fits = |value: &f64| match range {
            Range::ZeroOrMore => value.is_finite() && *value >= 0.0,
            Range::More => value.is_finite() && *value > 0.0,
        };
        match text.parse().ok().filter(fits) {
            Some(value) => Ok(Some(value)),
            None => Err(LimitsProblem::Range {
                number,
                what: what(self.firmware, number),
                value: (*text).to_owned(),
                range: words,
            }),
        }
    }

    fn needed(&self, number: u16, range: Range) -> Result<f64, LimitsProblem> {
        self.optional(number, range)?.ok_or_else(|| LimitsProblem::Missing {
            number,
            what: what(self.firmware, number),
            firmware: self.firmware.traits().name,
        })
    }

    fn mask(&self, number: u16) -> u32 {
        self.values.get(&number).and_then(|text| text.parse().ok()).unwrap_or(0)
    }

    fn flag(&self, number: u16) -> bool {
        self.mask(number) != 0
    }

    /// Where the travel lies, as the check of each firmware has it.
    fn zero(&self, settings: &ControllerSettings, travel: Position) -> MachineZero {
        if self.mask(22) & HOMING_ON == 0 {
            let because = "homing is switched off ($22=0)";
            return MachineZero::Unknown { because };
        }
        if settings.firmware == Firmware::FluidNc {
            let because = "FluidNC does not report where the machine zero lies (mpos_mm)";
            return MachineZero::Unknown { because };
        }
        let bounds = |axis: usize| {
            self.is_axis_homed(axis).then(|| self.bounds(settings, axis, travel[axis]))
        };
        MachineZero::Placed { bounds_mm: std::array::from_fn(bounds) }
    }

    /// Whether homing takes in an axis. grblHAL says so (`$44` and up, one mask for each pass); the
    /// others home X, Y and Z.
    fn is_axis_homed(&self, axis: usize) -> bool {
        match self.values.contains_key(&44) {
            true => (44..=49).any(|pass| self.mask(pass) >> axis & 1 == 1),
            false => axis < 3,
        }
    }

    /// Least and greatest coordinate of an axis that is homed, as the check of the firmware has it.
    fn bounds(&self, settings: &ControllerSettings, axis: usize, travel: f64) -> [f64; 2] {
        let is_negative_homing = self.mask(23) >> axis & 1 == 1;
        match settings.firmware {
            // `system_check_travel_limits`; the letter says HOMING_FORCE_SET_ORIGIN.
            Firmware::Grbl if settings.options.contains('Z') && is_negative_homing => [0.0, travel],
            Firmware::Grbl | Firmware::FluidNc => [-travel, 0.0],
            // `limits_set_work_envelope`: the pull-off is kept where hard and soft limits are on.
            Firmware::GrblHal => {
                const FORCE_SET_ORIGIN: u32 = 1 << 3;
                let zero_is_at_the_switches = self.mask(22) & FORCE_SET_ORIGIN != 0;
                let is_kept = self.flag(20) && self.flag(21);
                let reported = self.values.get(&27).and_then(|text| text.parse().ok());
                let pull_off: f64 = reported.filter(|_| is_kept).unwrap_or(0.0);
                match (zero_is_at_the_switches, is_negative_homing) {
                    (true, true) => [0.0, travel - pull_off],
                    (true, false) => [pull_off - travel, 0.0],
                    (false, _) => [pull_off - travel, 0.0 - pull_off],
                }
            }
        }
    }
}

/// Stored positions nearer to each other than this are the same, mm: decimals, of inches too.
const SAME_MM: f64 = 0.006;

impl StoredOffsets {
    /// Whether all positions are the same ones.
    pub(crate) fn is_near(&self, other: &Self) -> bool {
        let is_same = |(a, b): (&Option<Position>, &Option<Position>)| match (a, b) {
            (Some(a), Some(b)) => (0..3).all(|axis| (a[axis] - b[axis]).abs() <= SAME_MM),
            (a, b) => a.is_some() == b.is_some(),
        };
        let shift = (&Some(self.shift), &Some(other.shift));
        let systems = self.systems.iter().zip(&other.systems);
        let further = self.further_systems.iter().zip(&other.further_systems);
        let mut further = further.chain([(&self.further_shift, &other.further_shift)]);
        systems.chain(self.references.iter().zip(&other.references)).chain([shift]).all(is_same)
            && further.all(|(a, b)| a.is_near(*b, SAME_MM))
    }

    fn of(offsets: &[Offset]) -> Result<Self, LimitsProblem> {
        let mut stored = Self::default();
        for Offset { name, position, further } in offsets {
            if let Some((axis, value)) = further.iter().find(|it| !it.1.is_finite()) {
                let (name, letter) = (name.clone(), FURTHER_LETTERS[axis]);
                return Err(LimitsProblem::OffsetValue { name, letter, value });
            }
            if let Some(axis) = (0..3).find(|axis| !position[*axis].is_finite()) {
                let (name, letter) = (name.clone(), AXIS_LETTERS[axis]);
                return Err(LimitsProblem::OffsetValue { name, letter, value: position[axis] });
            }
            let system = (1..=9).find(|system| work_system(*system) == *name);
            match (name.as_str(), system) {
                (_, Some(system)) => {
                    stored.systems[usize::from(system) - 1] = Some(*position);
                    stored.further_systems[usize::from(system) - 1] = *further;
                }
                ("G28", _) => stored.references[0] = Some(*position),
                ("G30", _) => stored.references[1] = Some(*position),
                ("G92", _) => (stored.shift, stored.further_shift) = (*position, *further),
                // A stored position that nobody here knows.
                _ => {}
            }
        }
        Ok(stored)
    }
}

#[cfg(test)]
pub(crate) mod tests;
