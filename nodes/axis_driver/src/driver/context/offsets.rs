//! The stored offsets of the controller, and the work offset that follows from them.

use super::machine::Machine;
use crate::driver::output::Offset;
use crate::report::StatusReport;
use cnc_msgs::contour::work_system;
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::Position;

/// The shift of G92, which a reset may drop.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(in crate::driver) struct Shift {
    /// mm, zero if it was not reported.
    pub(in crate::driver) position: Position,
    /// As far as it was reported.
    further: FurtherAxes,
}

impl Shift {
    /// Whether that of a further axis is another one now.
    pub(in crate::driver) fn is_further_other(&self, now: &Self) -> bool {
        let is_other = |(axis, was)| now.further.get(axis).is_some_and(|is| is != was);
        self.further.iter().any(is_other)
    }

    /// Whether it is another one now.
    pub(in crate::driver) fn is_other(&self, now: &Self) -> bool {
        self.position != now.position || self.is_further_other(now)
    }
}

impl Machine {
    /// The shift of G92 in all axes.
    pub(in crate::driver) fn whole_shift(&self) -> Shift {
        Shift { position: self.shift(), further: self.further_stored("G92") }
    }

    /// Takes the work offset from the stored ones if reports have not shown it yet: at least
    /// every thirtieth does, and with some settings none.
    pub(in crate::driver) fn work_out_offset(&mut self) {
        self.work_offset = self.work_offset.or(self.stored_offset());
    }

    /// What the stored offsets of the work system in force add up to.
    pub(in crate::driver) fn stored_offset(&self) -> Option<Position> {
        let stored = |name: &str| {
            self.offsets.iter().find(|offset| offset.name == name).map(|offset| offset.position)
        };
        let zero = stored(&work_system(self.work_system?))?;
        let shifts = ["G92", "TLO"].map(|name| stored(name).unwrap_or_default());
        Some([0, 1, 2].map(|axis| zero[axis] + shifts[0][axis] + shifts[1][axis]))
    }

    /// Takes a work offset out of the report of a machine at rest that is neither the one in
    /// force nor one that the stored offsets add up to, unless it comes twice.
    pub(in crate::driver) fn doubt_offset(&mut self, report: &mut StatusReport) {
        let (Some(is), Some(was)) = (report.work_offset, self.work_offset) else { return };
        let doubted = self.doubted_offset.take();
        if is != was && doubted != Some(is) && !self.is_stored(is) {
            self.doubted_offset = report.work_offset.take();
        }
    }

    /// Whether the stored offsets of some work system add up to this.
    pub(in crate::driver) fn is_stored(&self, offset: Position) -> bool {
        const ROUNDING_MM: f64 = 0.002;
        let stored = |name: &str| self.offsets.iter().find(|stored| stored.name == name);
        let shifts = ["G92", "TLO"].map(|name| stored(name).map_or([0.0; 3], |it| it.position));
        (1..=9).filter_map(|system| stored(&work_system(system))).any(|zero| {
            (0..3).all(|axis| {
                let sum = zero.position[axis] + shifts[0][axis] + shifts[1][axis];
                (sum - offset[axis]).abs() <= ROUNDING_MM
            })
        })
    }

    /// How many work systems it has: it reports G59.1 to G59.3 where there are nine.
    pub(in crate::driver) fn work_systems(&self) -> u8 {
        let has = |system: &u8| self.offsets.iter().any(|it| it.name == work_system(*system));
        (7..=9).take_while(has).last().unwrap_or(6)
    }

    /// The shift of G92, zero if it was not reported.
    pub(in crate::driver) fn shift(&self) -> Position {
        let stored = self.offsets.iter().find(|offset| offset.name == "G92");
        stored.map_or([0.0; 3], |offset| offset.position)
    }

    /// All stored offsets, with the values of the further axes.
    pub(in crate::driver) fn stored_offsets(&self) -> Vec<Offset> {
        let further = |offset: &Offset| self.further_stored(&offset.name);
        let offsets = self.offsets.iter();
        offsets.map(|offset| Offset { further: further(offset), ..offset.clone() }).collect()
    }

    /// Keeps a stored offset.
    pub(in crate::driver) fn remember(&mut self, name: &str, position: Position) {
        self.offsets.retain(|offset| offset.name != name);
        self.offsets.push(Offset { name: name.to_owned(), position, ..Offset::default() });
    }
}
