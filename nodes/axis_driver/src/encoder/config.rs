//! What a controller takes, as far as lines depend on it.

use super::Ports;
use cnc_msgs::further::FURTHER_LETTERS;
use cnc_msgs::geometry::{AXIS_LETTERS, Position};
use serde::{Deserialize, Deserializer, Serialize};

/// What the controller takes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct EncoderConfig {
    /// Bytes of a line without its end; grbl 1.1 takes 79.
    pub line_bytes_max: usize,
    /// The largest coordinate, either sign, mm. grbl itself checks nothing: beyond
    /// what its step counters hold it moves for ever.
    pub position_mm_max: f64,
    pub feed_mm_per_min_max: f64,
    pub spindle_rpm_max: f64,
    /// Whether the build knows mist coolant (letter M in `[OPT:]`).
    pub has_mist: bool,
    /// Whether `M1` stops; grbl ignores the word, so it is sent as `M0` or not at all.
    pub optional_stop: bool,
    /// Whether every line of the path carries an N word, so that a controller that
    /// reports `Ln` says itself which one it cuts.
    #[serde(default)]
    pub line_numbers: bool,
    /// The height in the machine frame at which the tool is clear of everything, mm:
    /// a start in the middle goes there by itself. `None`: the tool has to be there.
    #[serde(default)]
    pub approach_z_mm: Option<f64>,
    /// Whether the controller changes tools itself (`M6`), where it can.
    #[serde(default)]
    pub controller_changes_tools: bool,
    /// Whether functions of the user (M100 to M199) are called.
    #[serde(default)]
    pub has_user_functions: bool,
    /// What the controller can home; it reports this.
    #[serde(default)]
    pub homing: Homing,
    /// What the controller said of itself, as far as it decides how arcs are drawn.
    #[serde(default)]
    pub board: Board,
}

/// How a controller is set up.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Board {
    /// `$12`, mm.
    pub arc_tolerance_mm: f64,
    /// `$32`: S in the line of a move does not stop the machine.
    pub is_laser: bool,
    /// G54 to G59.3, each with G92, in the machine frame, mm; zero where unknown.
    #[serde(deserialize_with = "nine")]
    pub work_offsets: [Position; 9],
    /// How many of them it has, at least 6.
    #[serde(default = "six")]
    pub work_systems: u8,
    /// The axes that it has besides X, Y and Z, as the bits of
    /// [`FurtherAxes`](cnc_msgs::further::FurtherAxes).
    #[serde(default)]
    pub further_axes: u8,
    /// The fastest that X, Y and Z move at the pace of the spindle, mm/min, as far as it is known; `None`
    /// where they cannot (no `SS` in `[NEWOPT:]`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thread_mm_per_min_max: Option<[Option<f64>; 3]>,
    /// The outputs and inputs that programs can use.
    #[serde(default, skip_serializing_if = "Ports::are_none")]
    pub ports: Ports,
}

const fn six() -> u8 {
    6
}

/// Records of before have the first six.
fn nine<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[Position; 9], D::Error> {
    let some: Vec<Position> = Vec::deserialize(deserializer)?;
    let mut all = [[0.0; 3]; 9];
    all.iter_mut().zip(some).for_each(|(to, from)| *to = from);
    Ok(all)
}

impl Board {
    /// Whether it has the further axis of this index.
    pub const fn has_further(&self, axis: usize) -> bool {
        self.further_axes >> axis & 1 == 1
    }

    /// The letters of all its axes: `X Y Z A`.
    pub fn axis_letters(&self) -> String {
        let further = (0..FURTHER_LETTERS.len()).filter(|&axis| self.has_further(axis));
        let letters = AXIS_LETTERS.into_iter().chain(further.map(|axis| FURTHER_LETTERS[axis]));
        letters.map(String::from).collect::<Vec<_>>().join(" ")
    }
}

impl Default for Board {
    fn default() -> Self {
        // As grbl is delivered.
        Self {
            arc_tolerance_mm: 0.002,
            is_laser: false,
            work_offsets: [[0.0; 3]; 9],
            work_systems: six(),
            further_axes: 0,
            thread_mm_per_min_max: None,
            ports: Ports::default(),
        }
    }
}

/// Which axes a controller homes on demand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Homing {
    /// It is switched off ($22=0).
    Off,
    /// All that have switches, one after the other (`$H`).
    #[default]
    Together,
    /// One by one as well (`$HX`, letter H in `[OPT:]`).
    OneByOne,
}

impl Default for EncoderConfig {
    fn default() -> Self {
        Self {
            line_bytes_max: 79,
            position_mm_max: 10_000.0,
            feed_mm_per_min_max: 60_000.0,
            spindle_rpm_max: 200_000.0,
            has_mist: false,
            optional_stop: false,
            line_numbers: false,
            approach_z_mm: None,
            controller_changes_tools: false,
            has_user_functions: true,
            homing: Homing::default(),
            board: Board::default(),
        }
    }
}
