//! The stored positions of a controller.

use super::LimitsProblem;
use crate::driver::Offset;
use cnc_msgs::contour::work_system;
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes};
use cnc_msgs::geometry::{AXIS_LETTERS, Position};

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

    /// Reads them; a position with a coordinate that is no number is a problem, and is not known.
    pub(super) fn of(offsets: &[Offset], problems: &mut Vec<LimitsProblem>) -> Self {
        let mut stored = Self::default();
        for Offset { name, position, further } in offsets {
            let named = AXIS_LETTERS.into_iter().zip(*position);
            let rest = further.iter().map(|(axis, value)| (FURTHER_LETTERS[axis], value));
            let mut all = named.chain(rest);
            if let Some((letter, value)) = all.find(|(_, value)| !value.is_finite()) {
                let name = name.clone();
                problems.push(LimitsProblem::OffsetValue { name, letter, value });
                continue;
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
        stored
    }
}
