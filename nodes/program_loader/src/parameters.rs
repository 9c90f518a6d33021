//! The parameters that a program sets: numbered, global and local ones.
//!
//! Knows scopes and which parameters a program may set. What the machine and the modal state
//! give (`#5420`, `#<_feed>`) is the interpreter's.

use crate::expression::Parameter;
use crate::parameter_file::{Left, OF_THE_USER, Stored};
use std::collections::BTreeMap;

/// The highest number of a parameter (LinuxCNC).
pub(crate) const NUMBER_MAX: u32 = 5602;
/// `#1` to `#30` belong to a subroutine.
pub(crate) const ARGUMENTS: usize = 30;

/// The parameter that switches DEBUG messages off; it is 1 at first.
pub(crate) const SHOWS_DEBUG: u32 = 5599;

/// Why a parameter cannot be set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CannotSet {
    NoSuchNumber,
    ReadOnly,
}

/// One numbered parameter that only the machine sets: its position, its tool, its offsets.
const fn is_read_only(number: u32) -> bool {
    matches!(
        number,
        5021..=5029 | 5061..=5070 | 5161..=5199 | 5210..=5390 | 5400..=5413 | 5420..=5428
    )
}

#[derive(Debug)]
pub(crate) struct Parameters {
    /// By number; empty until the first is set.
    numbered: Vec<f64>,
    globals: BTreeMap<String, f64>,
    /// Of the main program, then of each subroutine that is running.
    locals: Vec<BTreeMap<String, f64>>,
}

impl Default for Parameters {
    fn default() -> Self {
        let mut new =
            Self { numbered: Vec::new(), globals: BTreeMap::new(), locals: vec![BTreeMap::new()] };
        new.set_returned(None);
        new
    }
}

impl Parameters {
    /// The value of a numbered parameter, 0 if nothing has set it; `None` if there is no such
    /// number.
    pub(crate) fn numbered(&self, number: u32) -> Option<f64> {
        if !(1..=NUMBER_MAX).contains(&number) {
            return None;
        }
        let first = || f64::from(u8::from(number == SHOWS_DEBUG));
        Some(self.numbered.get(number as usize).copied().unwrap_or_else(first))
    }

    /// The value of a named parameter that the program has set; names with `_` are global.
    pub(crate) fn named(&self, name: &str) -> Option<f64> {
        match is_global(name) {
            true => self.globals.get(name).copied(),
            false => self.locals.last()?.get(name).copied(),
        }
    }

    pub(crate) fn set(&mut self, parameter: &Parameter<'_>, value: f64) -> Result<(), CannotSet> {
        match parameter {
            Parameter::Numbered(number) => {
                if !(1..=NUMBER_MAX).contains(number) {
                    return Err(CannotSet::NoSuchNumber);
                }
                if is_read_only(*number) {
                    return Err(CannotSet::ReadOnly);
                }
                self.fill();
                self.numbered[*number as usize] = value;
            }
            Parameter::Named(name) => {
                if is_predefined(name) {
                    return Err(CannotSet::ReadOnly);
                }
                let scope = match is_global(name) {
                    true => Some(&mut self.globals),
                    false => self.locals.last_mut(),
                };
                let Some(scope) = scope else { return Ok(()) };
                match scope.get_mut(&**name) {
                    Some(old) => *old = value,
                    None => {
                        scope.insert(name.clone().into_owned(), value);
                    }
                }
            }
        }
        Ok(())
    }

    /// Takes the user's values of a parameter file.
    pub(crate) fn store(&mut self, values: &[Stored]) {
        for &Stored { number, value, .. } in
            values.iter().filter(|it| OF_THE_USER.contains(&it.number))
        {
            self.fill();
            self.numbered[number as usize] = value;
        }
    }

    /// The user's values that are others than those of the parameter file.
    pub(crate) fn left(&self, begun: &[Stored]) -> Vec<Left> {
        let mut before = Self::default();
        before.store(begun);
        let is_changed = |number: &u32| self.numbered(*number) != before.numbered(*number);
        let numbers = OF_THE_USER.filter(is_changed);
        numbers.map(|number| Left { number, value: self.numbered(number) }).collect()
    }

    /// Gives each number a value, before the first is set.
    fn fill(&mut self) {
        if self.numbered.is_empty() {
            self.numbered = vec![0.0; NUMBER_MAX as usize + 1];
            self.numbered[SHOWS_DEBUG as usize] = 1.0;
        }
    }

    /// Subroutines that are running.
    pub(crate) fn depth(&self) -> usize {
        self.locals.len() - 1
    }

    /// What the last subroutine has returned: `#<_value>` and `#<_value_returned>`.
    pub(crate) fn set_returned(&mut self, value: Option<f64>) {
        let returned = f64::from(u8::from(value.is_some()));
        for (name, value) in [("_value", value.unwrap_or(0.0)), ("_value_returned", returned)] {
            self.globals.insert(name.to_owned(), value);
        }
    }

    /// Begins a subroutine: `#1` to `#30` are its arguments, and it has no local names yet.
    /// Returns the values of `#1` to `#30` before.
    pub(crate) fn enter(&mut self, arguments: &[f64]) -> [f64; ARGUMENTS] {
        let mut saved = [0.0; ARGUMENTS];
        self.fill();
        let own = &mut self.numbered[1..=ARGUMENTS];
        saved.copy_from_slice(own);
        own.fill(0.0);
        for (parameter, &argument) in own.iter_mut().zip(arguments) {
            *parameter = argument;
        }
        self.locals.push(BTreeMap::new());
        saved
    }

    /// Ends a subroutine.
    pub(crate) fn leave(&mut self, saved: &[f64; ARGUMENTS]) {
        self.locals.pop();
        if let Some(own) = self.numbered.get_mut(1..=ARGUMENTS) {
            own.copy_from_slice(saved);
        }
    }
}

/// Names that have their value from the interpreter. A program cannot set them.
pub(crate) const PREDEFINED: [&str; 60] = [
    "_vmajor",
    "_vminor",
    "_line",
    "_motion_mode",
    "_plane",
    "_ccomp",
    "_metric",
    "_imperial",
    "_absolute",
    "_incremental",
    "_inverse_time",
    "_units_per_minute",
    "_units_per_rev",
    "_coord_system",
    "_tool_offset",
    "_retract_r_plane",
    "_retract_old_z",
    "_spindle_rpm_mode",
    "_spindle_css_mode",
    "_ijk_absolute_mode",
    "_lathe_diameter_mode",
    "_lathe_radius_mode",
    "_spindle_on",
    "_spindle_cw",
    "_mist",
    "_flood",
    "_speed_override",
    "_feed_override",
    "_adaptive_feed",
    "_feed_hold",
    "_feed",
    "_rpm",
    "_x",
    "_y",
    "_z",
    "_a",
    "_b",
    "_c",
    "_u",
    "_v",
    "_w",
    "_abs_x",
    "_abs_y",
    "_abs_z",
    "_abs_a",
    "_abs_b",
    "_abs_c",
    "_abs_u",
    "_abs_v",
    "_abs_w",
    "_current_tool",
    "_current_pocket",
    "_selected_tool",
    "_selected_pocket",
    "_value",
    "_value_returned",
    "_task",
    "_call_level",
    "_remap_level",
    "_metric_machine",
];

fn is_predefined(name: &str) -> bool {
    name.starts_with('_') && PREDEFINED.contains(&name)
}

fn is_global(name: &str) -> bool {
    name.starts_with('_')
}
