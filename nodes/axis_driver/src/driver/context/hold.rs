//! Watches that a feed hold shows in the reports.
//!
//! A byte can be lost on the wire, so a hold that does not show is sent again.

use super::Context;
use super::config::{HOLDS_MAX, REPORTS_PER_HOLD};
use crate::driver::output::LogLevel;
use crate::link::realtime;
use crate::report::ControllerState;
use cnc_msgs::geometry::Position;
use serde::{Deserialize, Serialize};

/// A hold outside a stop that has not shown in the reports yet.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(in crate::driver) struct HoldWatch {
    /// Of an opened door, not of a feed hold.
    #[serde(default)]
    is_door: bool,
    reports: u32,
    sent_again: u32,
    /// Where the axes were when the controller last said that it will hold.
    #[serde(default)]
    moved_to: Option<Position>,
}

impl Context {
    /// Sends a feed hold, and sends it again when it does not show.
    pub(in crate::driver) fn send_hold(&mut self) {
        self.link.send_realtime(realtime::FEED_HOLD);
        self.hold = Some(HoldWatch::default());
    }

    /// Does the same with what an opened door does.
    pub(in crate::driver) fn send_door_hold(&mut self) {
        self.link.send_realtime(realtime::SAFETY_DOOR);
        self.hold = Some(HoldWatch { is_door: true, ..HoldWatch::default() });
    }

    /// Looks in each report for a hold that was sent. While a run is under way the
    /// controller may be idle between two lines, which is no hold.
    pub(in crate::driver) fn watch_hold(&mut self, is_running: bool) {
        let Some(status) = &self.machine.status else { return };
        let Some(hold) = &mut self.hold else { return };
        // It does so at the end of a thread, as long as that goes on.
        if status.will_hold() && !hold.is_door && hold.moved_to != status.machine_position {
            let is_first = hold.moved_to.is_none();
            hold.moved_to = status.machine_position;
            if is_first {
                let text = "the hold waits for the end of the thread; soft_reset stops at once";
                self.log(LogLevel::Info, text);
            }
            return;
        }
        hold.reports += 1;
        match status.state {
            ControllerState::Run | ControllerState::Jog | ControllerState::Home => {}
            ControllerState::Idle if is_running || hold.reports < REPORTS_PER_HOLD => {}
            _ => {
                self.hold = None;
                return;
            }
        }
        if hold.reports % REPORTS_PER_HOLD != 0 {
            return;
        }
        hold.sent_again += 1;
        if hold.sent_again > HOLDS_MAX {
            self.hold = None;
            let text = "the controller does not hold; use soft_reset or the emergency stop";
            return self.log(LogLevel::Error, text);
        }
        let byte = if hold.is_door { realtime::SAFETY_DOOR } else { realtime::FEED_HOLD };
        self.link.send_realtime(byte);
    }
}
