//! Which of the occasional fields a status report carries.

use crate::firmware::{Fields, Traits};

/// Counts reports until `WCO` and `Ov` are due again, and remembers changes.
#[derive(Debug, Clone)]
pub(in crate::controller) struct Cadence {
    accessories_alone: bool,
    until_offsets: u8,
    until_overrides: u8,
    changed: Due,
}

/// The occasional fields of one report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Due {
    pub(super) offsets: bool,
    pub(super) system: bool,
    pub(super) overrides: bool,
    pub(super) accessories: bool,
    pub(super) homed: bool,
    pub(super) tool: bool,
    pub(super) tool_reference: bool,
    /// These are reported on demand only.
    pub(super) rest: bool,
}

impl Due {
    const EVERYTHING: Self = Self {
        offsets: true,
        system: true,
        overrides: true,
        accessories: true,
        homed: true,
        tool: true,
        tool_reference: true,
        rest: true,
    };
}

impl Cadence {
    /// The state after a reset.
    pub(in crate::controller) fn new(traits: &Traits) -> Self {
        let accessories_alone = traits.reports_accessories_alone;
        Self {
            accessories_alone,
            until_offsets: u8::from(traits.reports_overrides_first),
            until_overrides: 0,
            changed: Due {
                accessories: accessories_alone,
                tool_reference: accessories_alone,
                ..Due::default()
            },
        }
    }

    pub(in crate::controller) fn offsets_changed(&mut self) {
        self.until_offsets = 0;
    }

    pub(in crate::controller) fn overrides_changed(&mut self) {
        self.until_overrides = 0;
    }

    /// Spindle, coolant or a pending tool change changed.
    pub(in crate::controller) fn accessories_changed(&mut self) {
        match self.accessories_alone {
            true => self.changed.accessories = true,
            false => self.until_overrides = 0,
        }
    }

    pub(in crate::controller) fn system_changed(&mut self) {
        self.changed.system = self.accessories_alone;
    }

    pub(in crate::controller) fn homed_changed(&mut self) {
        self.changed.homed = self.accessories_alone;
    }

    pub(in crate::controller) fn tool_changed(&mut self) {
        self.changed.tool = true;
        self.changed.accessories = true;
    }

    /// The occasional fields of the next report; they count as sent.
    pub(super) fn next(&mut self, fields: Fields, is_busy: bool, everything: bool) -> Due {
        let mut due = std::mem::take(&mut self.changed);
        due.offsets = fields.offsets && self.offsets_due(is_busy);
        due.overrides = fields.overrides && self.overrides_due(is_busy);
        due.accessories |= due.overrides && !self.accessories_alone;
        if everything { Due::EVERYTHING } else { due }
    }

    /// Due every 10 reports at rest, every 30 in motion.
    fn offsets_due(&mut self, is_busy: bool) -> bool {
        if self.until_offsets > 0 {
            self.until_offsets -= 1;
            return false;
        }
        self.until_offsets = if is_busy { 29 } else { 9 };
        // Never both in one report.
        self.until_overrides = self.until_overrides.max(1);
        true
    }

    /// Due every 10 reports at rest, every 20 in motion.
    fn overrides_due(&mut self, is_busy: bool) -> bool {
        if self.until_overrides > 0 {
            self.until_overrides -= 1;
            return false;
        }
        self.until_overrides = if is_busy { 19 } else { 9 };
        true
    }
}
