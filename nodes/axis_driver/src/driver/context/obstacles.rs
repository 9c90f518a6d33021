//! What keeps a machine that stands from going where it is asked to.

use super::machine::Machine;
use crate::codes::error_code;
use crate::driver::answer::Refusal;
use crate::report::ControllerState;

impl Machine {
    /// Why nothing may go to a place of the machine frame: its zero is not known. A machine
    /// that cannot home has no other than the one it was switched on at.
    pub(in crate::driver) fn home_obstacle(&self, what: &str) -> Option<Refusal> {
        if self.is_homed || !self.has_homing() {
            return None;
        }
        let text = format!(
            "{what} counts from the machine's zero, and the machine is not homed: an unlock or a \
             restart leaves a zero that may be anywhere; home first, or move in the work frame"
        );
        Some(Refusal::new(error_code::NOT_HOMED, text))
    }

    /// Why no position is known, and what helps.
    pub(in crate::driver) fn unknown_place(&self) -> String {
        match self.reported.get(&10) {
            Some(mask) if self.status.is_some() => format!(
                "the reports of the controller have not shown a work offset yet ($10={mask}): try \
                 again; if that lasts, $10=3 (grbl, FluidNC) or $10=511 (grblHAL) has reports show it"
            ),
            _ => "the position of the tool is not known yet".into(),
        }
    }

    /// Why a safety door keeps the machine from going on.
    pub(in crate::driver) fn door_obstacle(&self) -> Option<Refusal> {
        const AJAR: u8 = 1;
        const RETRACTING: u8 = 2;
        let status = self.status.as_ref().filter(|status| status.state == ControllerState::Door)?;
        let is_open = status.substate == Some(AJAR)
            || status.pins.as_ref().is_some_and(|pins| pins.contains('D'));
        let text = match status.substate {
            _ if is_open => "the safety door is open: close it, then resume",
            Some(RETRACTING) => "the machine is still stopping for the safety door: try again",
            None | Some(0) => return None,
            Some(_) => "the machine is resuming already: spindle and coolant are coming back",
        };
        Some(Refusal::new(error_code::BUSY, text))
    }
}
