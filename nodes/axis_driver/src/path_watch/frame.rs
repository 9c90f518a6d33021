//! The frame that the lines are written in: offsets as they were reported, and what the
//! lines themselves change.

use super::further::FurtherFrame;
use cnc_msgs::geometry::Position;

/// The offsets of the controller when a run begins; machine frame, mm, `None` where unknown.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Frame {
    /// G54 to G59.3, each with the shift of G92.
    pub systems: [Option<Position>; 9],
    /// The shift of G92.
    pub shift: Position,
    /// The place of G28 and that of G30.
    pub references: [Option<Position>; 2],
    /// Machine = work + this.
    pub in_force: Option<Position>,
    /// 1 to 9.
    pub system: Option<u8>,
    pub tool_length_mm: Option<f64>,
    pub further: FurtherFrame,
}

impl Frame {
    /// The same without what is in force.
    pub fn without_offset(self) -> Self {
        Self { in_force: None, further: self.further.only_stored(), ..self }
    }

    /// The same with nothing in force.
    pub fn only_stored(self) -> Self {
        Self { system: None, tool_length_mm: None, ..self.without_offset() }
    }

    /// The offset in force is that of the system in force: reports know it better than a list
    /// that was asked for long ago.
    pub(super) fn settle(&mut self) {
        let Some((offset, length)) = self.in_force.zip(self.tool_length_mm) else { return };
        if let Some(slot) = self.slot(self.system) {
            *slot = Some([offset[0], offset[1], offset[2] - length]);
        }
    }

    fn slot(&mut self, system: Option<u8>) -> Option<&mut Option<Position>> {
        self.systems.get_mut(usize::from(system?).checked_sub(1)?)
    }

    /// Works out the offset in force from the system and the tool length.
    fn work_out(&mut self) {
        let length = self.tool_length_mm;
        let zero = self.slot(self.system).and_then(|zero| *zero);
        self.in_force = zero.zip(length).map(|(zero, length)| [zero[0], zero[1], zero[2] + length]);
    }

    pub(super) fn select(&mut self, system: Option<u8>) {
        self.system = system;
        self.further.select(system);
        self.work_out();
    }

    pub(super) fn set_tool_length(&mut self, length_mm: f64) {
        self.tool_length_mm = Some(length_mm);
        self.work_out();
    }

    /// G10 L2 or L20: where these axes of a system are zero, from now on.
    pub(super) fn store(&mut self, system: u8, origin: [Option<f64>; 3]) {
        let is_in_force = self.system == Some(system);
        if let Some(slot) = self.slot(Some(system)) {
            let before = *slot;
            let place: [Option<f64>; 3] =
                [0, 1, 2].map(|axis| origin[axis].or(before.map(|before| before[axis])));
            *slot = match place {
                [Some(x), Some(y), Some(z)] => Some([x, y, z]),
                _ => None,
            };
        }
        // Where the system is not known, it may be this one.
        if is_in_force || self.system.is_none() {
            self.work_out();
        }
    }

    /// The controller is in a frame that was not asked for, and that is to be.
    pub(super) fn adopt(&mut self, offset: Position) {
        self.in_force = Some(offset);
        self.settle();
    }

    /// The tool length is not known, nor what follows from it.
    pub(super) fn forget_tool_length(&mut self) {
        (self.in_force, self.tool_length_mm) = (None, None);
    }

    /// Nothing is known of what is in force.
    pub(super) fn forget(&mut self) {
        (self.in_force, self.system, self.tool_length_mm) = (None, None, None);
        self.further = self.further.only_stored();
    }
}
