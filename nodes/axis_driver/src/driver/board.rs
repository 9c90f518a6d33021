//! What the controller said of itself that decides how lines are drawn.

use super::machine::{Machine, Offset};
use crate::encoder::Board;
use cnc_msgs::geometry::Position;

impl Machine {
    /// From `$12`, `$32` and `$#`.
    pub(super) fn board(&self) -> Board {
        let usual = Board::default();
        let setting = |number: u16| self.settings.get(&number).copied();
        let place = |name: &str| -> Position {
            let told = self.offsets.iter().find(|offset: &&Offset| offset.name == name);
            told.map_or([0.0; 3], |offset| offset.position)
        };
        let shift = self.shift();
        let system = |index: usize| {
            let stored = place(&format!("G{}", 54 + index));
            std::array::from_fn(|axis| stored[axis] + shift[axis])
        };
        let tolerance = setting(12).filter(|tolerance| *tolerance > 0.0);
        Board {
            arc_tolerance_mm: tolerance.unwrap_or(usual.arc_tolerance_mm),
            is_laser: setting(32) == Some(1.0),
            work_offsets: std::array::from_fn(system),
        }
    }
}
