//! What was ordered of a driver, what it owes, and what it may send for it.

use axis_driver::driver::{Command, DriverConfig};
use std::collections::BTreeMap;

/// What an order may put on the wire.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Run,
    /// A run that is only encoded.
    Check,
    Jog,
    Probe,
    Home,
    Unlock,
    Sleep,
    Offset,
    Activate,
    Deactivate,
    /// Nothing, or a byte at once.
    Other,
}

impl Kind {
    /// Whether its end is reported in addition to its answer.
    fn is_goal(self) -> bool {
        matches!(self, Self::Run | Self::Check | Self::Jog | Self::Probe)
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage {
    Asked,
    /// A goal that was accepted; its end is still to come.
    Accepted,
}

#[derive(Debug, Default)]
pub(crate) struct Orders {
    open: BTreeMap<u64, (Kind, Stage)>,
    is_checked_in_controller: bool,
    /// These were asked for at some time.
    has_overrides: bool,
    has_door: bool,
    /// The command that is being handled.
    is_resume: bool,
    shutdowns: usize,
    /// It said that it is inactive, and has not said that it is active.
    is_inactive: bool,
    pub(crate) accepted: u64,
    pub(crate) finished: u64,
}

impl Orders {
    pub(crate) fn new(config: &DriverConfig) -> Self {
        let is_checked_in_controller = config.check_in_controller;
        Self { is_checked_in_controller, ..Self::default() }
    }

    pub(crate) fn on_command(&mut self, id: u64, command: &Command) {
        let kind = match command {
            Command::RunProgram(request)
                if request.check_only && !self.is_checked_in_controller =>
            {
                Kind::Check
            }
            Command::RunProgram(_) | Command::ExecuteMdi { .. } => Kind::Run,
            Command::Jog(_) => Kind::Jog,
            Command::Probe(_) => Kind::Probe,
            Command::Home => Kind::Home,
            Command::Unlock => Kind::Unlock,
            Command::Sleep => Kind::Sleep,
            Command::SetWorkOffset(_) => Kind::Offset,
            Command::Activate => Kind::Activate,
            Command::Deactivate => Kind::Deactivate,
            _ => Kind::Other,
        };
        self.has_overrides |= matches!(command, Command::SetOverrides(_));
        self.has_door |= matches!(command, Command::DoorHold);
        self.shutdowns += usize::from(matches!(command, Command::Shutdown));
        self.is_resume = matches!(command, Command::Resume);
        assert!(self.open.insert(id, (kind, Stage::Asked)).is_none(), "{id} was used twice");
    }

    /// What follows is no longer due to the command.
    pub(crate) fn on_handled(&mut self) {
        self.is_resume = false;
    }

    pub(crate) fn on_reply(&mut self, id: u64, is_accepted: bool) {
        let Some((kind, Stage::Asked)) = self.open.remove(&id) else {
            panic!("{id} was answered twice");
        };
        match kind {
            Kind::Deactivate if is_accepted => {
                let mut goals = self.open.values().filter(|(kind, _)| kind.is_goal());
                assert!(goals.next().is_none(), "inactive, and not done: {:?}", self.open);
                self.is_inactive = true;
            }
            Kind::Activate if is_accepted => self.is_inactive = false,
            _ => {}
        }
        if is_accepted && kind.is_goal() {
            assert!(!self.is_inactive, "{id} was accepted by an inactive driver");
            self.open.insert(id, (kind, Stage::Accepted));
            self.accepted += 1;
        }
    }

    pub(crate) fn on_finished(&mut self, id: u64) {
        let open = self.open.remove(&id);
        let is_accepted = matches!(open, Some((kind, Stage::Accepted)) if kind.is_goal());
        assert!(is_accepted, "{id} ended, but it was {open:?}");
        self.finished += 1;
    }

    pub(crate) fn on_ready_to_close(&mut self) {
        assert!(self.shutdowns > 0, "ready to close without an order");
        self.shutdowns -= 1;
    }

    /// What has no answer or no end.
    pub(crate) fn owed(&self) -> Vec<u64> {
        self.open.keys().copied().collect()
    }

    fn has(&self, kind: Kind) -> bool {
        self.open.values().any(|(open, _)| *open == kind)
    }

    /// # Panics
    /// Checks that every sent byte was ordered.
    pub(crate) fn check_sent(&self, bytes: &[u8]) {
        let mut line = Vec::new();
        for &byte in bytes {
            match byte {
                b'?' | b'!' | 0x18 => {}
                b'~' => {
                    assert!(self.is_resume, "a resume without an order");
                    assert!(!self.is_inactive, "an inactive driver resumes");
                }
                // FluidNC: no echo.
                0x0c => {}
                0x84 => assert!(self.has_door, "a door without an order"),
                0x85 => assert!(self.has(Kind::Jog), "a jog is cancelled that is none"),
                0x90..=0x9d => assert!(self.has_overrides, "{byte:#04x} without an order"),
                b'\n' => self.check_line(&String::from_utf8_lossy(&std::mem::take(&mut line))),
                b' '..=b'}' => line.push(byte),
                _ => panic!("{byte:#04x} was sent"),
            }
        }
        assert!(line.is_empty(), "half a line was sent");
    }

    fn check_line(&self, line: &str) {
        let is_ordered = match line {
            // Questions, and the empty line that ends the errors of grblHAL.
            "" | "$I" | "$$" | "$G" | "$#" => true,
            "$X" => self.has(Kind::Unlock),
            "$SLP" => self.has(Kind::Sleep),
            "$C" => self.has(Kind::Run) && self.is_checked_in_controller,
            _ if line.starts_with("$H") => self.has(Kind::Home) || self.has(Kind::Run),
            _ if line.starts_with("$J=") => self.has(Kind::Jog),
            _ if line.starts_with('$') => false,
            _ if line.contains("G38") => self.has(Kind::Probe),
            _ if line.contains("G10L") || line.contains("G92") => self.has(Kind::Offset),
            _ => self.has(Kind::Run),
        };
        assert!(is_ordered, "{line:?} without an order; open: {:?}", self.open);
    }
}
