//! What is done when the machine is not where the lines that were sent can have taken it.

use super::machine::Machine;
use crate::path_watch::{Board, Frame, PathWatch, Rates};
use crate::report::ReportUnits;
use cnc_msgs::contour::work_system;
use cnc_msgs::further::FurtherAxes;
use serde::{Deserialize, Serialize};

/// What is done when a report does not fit what was sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnPathDeviation {
    /// Nothing is compared. Drivers of before had no such watch.
    #[default]
    Off,
    /// It is logged, and the run goes on.
    Log,
    /// The machine holds until it is resumed or the run is canceled.
    Hold,
}

/// The first word of the reason when a deviation has caused the hold.
pub const PATH_DEVIATION: &str = "PATH_DEVIATION";

impl OnPathDeviation {
    /// The words of the parameter.
    pub const WORDS: [(&'static str, Self); 3] =
        [("hold", Self::Hold), ("log", Self::Log), ("off", Self::Off)];
}

/// Offsets nearer to each other than this are the same, mm: rounding, of inches too.
const SAME_MM: f64 = 0.006;

impl Machine {
    /// A watch of a run that begins now, with the machine at rest. Where the offsets are fresh,
    /// the first line says which of them are in force.
    pub(in crate::driver) fn path_watch(&self, units: ReportUnits, is_fresh: bool) -> PathWatch {
        let setting = |number: u16| self.settings.get(&number).copied();
        let board = Board {
            planner_blocks: self.reported_planner_blocks(),
            arc_tolerance_mm: self.board().arc_tolerance_mm,
            steps_per_mm: [100, 101, 102].map(setting),
            further_steps: std::array::from_fn(|axis| self.further_step(axis)),
            units,
            rates: Rates(self.fastest_mm_per_min()),
            speeds: [setting(31).unwrap_or(0.0), setting(30).unwrap_or(f64::INFINITY)],
        };
        let frame = self.frame();
        let frame = if is_fresh { frame.only_stored() } else { frame };
        // A work position is one in the machine frame only with the offset in force.
        let is_placed = self.shown.has_machine_position || self.is_offset_in_force();
        let place = self.machine_position().filter(|_| is_placed);
        let further = if is_placed { self.further_standing() } else { FurtherAxes::NONE };
        let mut watch = PathWatch::new(board, frame, place, further);
        watch.has_shown(self.work_offset);
        watch
    }

    /// Whether the work offset that reports have shown is the stored one of the work system.
    fn is_offset_in_force(&self) -> bool {
        let both = self.stored_offset().zip(self.work_offset);
        both.is_some_and(|(is, shown)| (0..3).all(|axis| (is[axis] - shown[axis]).abs() < SAME_MM))
    }

    /// Kinematics whose motors go between two places on another way than a straight line.
    pub(in crate::driver) fn other_kinematics(&self) -> Option<&str> {
        const STRAIGHT: [&str; 4] = ["cartesian", "corexy", "midtbot", "asymmetric ganging"];
        let name = self.kinematics.as_deref()?;
        let is_straight = STRAIGHT.iter().any(|known| known.eq_ignore_ascii_case(name));
        (!is_straight).then_some(name)
    }

    /// The offsets as they are known now.
    pub(in crate::driver) fn frame(&self) -> Frame {
        let stored = |name: &str| {
            self.offsets.iter().find(|offset| offset.name == name).map(|offset| offset.position)
        };
        let shift = self.shift();
        let system = |index: usize| {
            let zero = stored(&work_system(index as u8 + 1))?;
            Some([0, 1, 2].map(|axis| zero[axis] + shift[axis]))
        };
        Frame {
            systems: std::array::from_fn(system),
            shift,
            references: ["G28", "G30"].map(stored),
            in_force: self.work_offset,
            system: self.work_system,
            tool_length_mm: self.has_tool_length.and_then(|has_one| match has_one {
                true => stored("TLO").map(|length| length[2]),
                false => Some(0.0),
            }),
            further: self.further_frame(),
        }
    }
}
