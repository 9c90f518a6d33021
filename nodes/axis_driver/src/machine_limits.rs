//! What the settings and offsets of a controller say about its machine.
//!
//! Travel, rates, spindle range, work systems: read from `$$`, `$#` and `$I`, whether they come
//! over the line or out of a file. [`table`] has the rules of each firmware for where the machine zero
//! lies in the travel, [`further`] has A to W, [`offsets`] the stored positions. Knows no path.

mod further;
mod offsets;
mod table;

use crate::driver::{ControllerSettings, Offset};
use crate::encoder::Ports;
use crate::firmware::Firmware;
use cnc_msgs::contour::work_system;
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{AXIS_LETTERS, Position};
use cnc_msgs::machine_file::MachineFile;

pub use further::FurtherLimits;
pub(crate) use further::{Direction, direction};
pub use offsets::StoredOffsets;
use table::{Range, Table};

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
    /// Where homing leaves each axis, machine frame, mm; `None` where it is not known.
    pub home_mm: [Option<f64>; 3],
    /// The name of its kinematics, where they are not Cartesian: its travel is no box. What it reports
    /// and is sent is in Cartesian coordinates all the same.
    pub other_kinematics: Option<String>,
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
    /// The machine is homed, so that its coordinates are places. Where the travel lies among them is
    /// not known, for this reason.
    Unplaced { because: &'static str },
    /// A machine coordinate says nothing about a place, for this reason.
    Unknown { because: &'static str },
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
    #[error("axes is {axes:?}; it must be XYZ, and then the letters of the others, each once")]
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
    let is_new = |at: usize| {
        let letter = letters[at];
        letter.is_ascii_uppercase()
            && !AXIS_LETTERS.contains(&letter)
            && !letters[..at].contains(&letter)
    };
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

/// Whether a firmware can have a setting of this number.
fn is_of(firmware: Firmware, number: u16) -> bool {
    number < firmware.traits().settings_below
}

impl MachineLimits {
    /// Reads what a controller has reported.
    ///
    /// # Errors
    /// A setting is missing without which nothing can be judged, or has a value that no machine
    /// has.
    pub fn of(settings: &ControllerSettings) -> Result<Self, LimitsProblem> {
        let (limits, mut problems) = Self::as_far_as(settings);
        if problems.is_empty() { Ok(limits) } else { Err(problems.swap_remove(0)) }
    }

    /// Reads as much of it as there is, and what is wrong with the rest. An axis whose travel is not
    /// readable has none; one whose rate is not has no greatest one.
    pub fn as_far_as(settings: &ControllerSettings) -> (Self, Vec<LimitsProblem>) {
        let table = Table::of(settings);
        let mut problems = Vec::new();
        let mut read = |number: u16, range: Range, is_needed: bool| {
            let value = match is_needed {
                true => table.needed(number, range).map(Some),
                false => table.optional(number, range),
            };
            value.unwrap_or_else(|problem| {
                problems.push(problem);
                None
            })
        };
        let mut axes =
            |base: u16, range: Range| [0, 1, 2].map(|axis| read(base + axis, range, true));
        let reported_travel = axes(130, Range::ZeroOrMore);
        let is_soft = table.flag(20);
        let is_as_delivered = |it: f64| !is_soft && (it - TRAVEL_AS_DELIVERED_MM).abs() < 1e-9;
        let is_entered = |it: &f64| *it > 0.0 && !is_as_delivered(*it);
        let travel_mm = reported_travel.map(|it| it.filter(is_entered));
        let spindle = [31, 30].map(|number| read(number, Range::ZeroOrMore, false));
        let spindle_rpm = match spindle {
            [min, Some(max)] if max > 0.0 => Some([min.unwrap_or(0.0), max]),
            _ => None,
        };
        let junction_deviation_mm = read(11, Range::ZeroOrMore, false);
        let arc_tolerance_mm = read(12, Range::ZeroOrMore, false).filter(|it| *it > 0.0);
        let mut axes = |base: u16| [0, 1, 2].map(|axis| read(base + axis, Range::More, true));
        let rate_mm_per_min = axes(110).map(|it| it.unwrap_or(f64::INFINITY));
        let acceleration_mm_per_s2 = axes(120).map(|it| it.unwrap_or(f64::INFINITY));
        let traits = settings.firmware.traits();
        let has_jerk = traits.may_have_jerk && table.has(800);
        let jerk_mm_per_s3 = has_jerk.then(|| axes(800).map(|it| it.unwrap_or(f64::INFINITY)));
        let steps_per_mm = match table.has(100) {
            true => axes(100).map(|it| it.unwrap_or(STEPS_PER_MM_DEFAULT)),
            false => [STEPS_PER_MM_DEFAULT; 3],
        };
        let further = table.further(settings).unwrap_or_else(|problem| {
            problems.push(problem);
            [None; 6]
        });
        let limits = Self {
            firmware: settings.firmware,
            planner_blocks: usize::from(settings.planner_blocks.max(1)),
            junction_deviation_mm: junction_deviation_mm.unwrap_or(JUNCTION_DEVIATION_MM),
            arc_tolerance_mm: arc_tolerance_mm.unwrap_or(ARC_TOLERANCE_MM),
            rate_mm_per_min,
            acceleration_mm_per_s2,
            jerk_mm_per_s3,
            steps_per_mm,
            travel_mm,
            zero: table.zero(settings, reported_travel),
            home_mm: std::array::from_fn(|axis| table.home(settings, axis, reported_travel[axis])),
            other_kinematics: None,
            further,
            is_homed: table.mask(22) & HOMING_ON != 0,
            spindle_rpm,
            is_laser: table.is(32, "1"),
            spindle_sync: if traits.may_thread { settings.spindle_sync } else { Some(false) },
            ports: if traits.may_have_ports { settings.ports } else { Some(Ports::default()) },
            offsets: StoredOffsets::of(&settings.offsets, &mut problems),
        };
        (limits, problems)
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
            home_mm: [None; 3],
            other_kinematics: None,
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
            MachineZero::Placed { .. } | MachineZero::Unplaced { .. } => {
                MachineZero::Unknown { because }
            }
            unknown @ MachineZero::Unknown { .. } => unknown,
        };
        let not_placed = |it: FurtherLimits| FurtherLimits { bounds: None, ..it };
        let further = self.further.map(|it| it.map(not_placed));
        Self { zero, further, is_homed: false, ..self }
    }

    /// The same for a machine whose travel is no box: its coordinates are places once it is homed.
    #[must_use]
    pub fn with_other_kinematics(self, name: &str) -> Self {
        let because = "the kinematics are not Cartesian";
        let zero = match self.zero {
            MachineZero::Placed { .. } | MachineZero::Unplaced { .. } => {
                MachineZero::Unplaced { because }
            }
            unknown @ MachineZero::Unknown { .. } => unknown,
        };
        let other_kinematics = Some(name.to_owned());
        Self { zero, other_kinematics, travel_mm: [None; 3], home_mm: [None; 3], ..self }
    }

    /// The kinematics, where rapids are no straight lines with them: grblHAL cuts only feeds into short
    /// segments (`wall_plotter.c`, `polar.c`), but its delta all, as FluidNC does.
    pub(crate) fn bows_rapids(&self) -> Option<&str> {
        let name = self.other_kinematics.as_deref()?;
        let bows = self.firmware.traits().bows_rapids && !name.eq_ignore_ascii_case("delta");
        bows.then_some(name)
    }

    /// The axes that homing leaves where they are, although the machine is homed.
    pub(crate) fn axes_not_homed(&self) -> impl Iterator<Item = char> {
        let bounds = match self.zero {
            MachineZero::Placed { bounds_mm } => bounds_mm,
            MachineZero::Unplaced { .. } | MachineZero::Unknown { .. } => [Some([0.0; 2]); 3],
        };
        AXIS_LETTERS.into_iter().zip(bounds).filter(|it| it.1.is_none()).map(|it| it.0)
    }
}

#[cfg(test)]
pub(crate) mod tests;
