//! The parameters that a program sets: numbered, global and local ones.
//!
//! Knows scopes and which parameters a program may set. What the machine and the modal state
//! give (`#5420`, `#<_feed>`) is the interpreter's.

use crate::expression::Parameter;
use crate::parameter_file::{Left, OF_THE_USER, Stored};
use std::cell::Cell;
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
        5021..=5029 | 5081..=5089 | 5161..=5199 | 5210..=5390 | 5400..=5413 | 5420..=5428
    )
}

/// What a program has done with a numbered parameter.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Use {
    is_set: bool,
    /// Before it was set.
    is_read: bool,
}

#[derive(Debug)]
pub(crate) struct Parameters {
    /// By number; empty until the first is set.
    numbered: Vec<f64>,
    /// By number.
    uses: Vec<Cell<Use>>,
    globals: BTreeMap<String, f64>,
    /// Of the main program, then of each subroutine that is running.
    locals: Vec<BTreeMap<String, f64>>,
}

impl Default for Parameters {
    fn default() -> Self {
        let mut new = Self {
            numbered: Vec::new(),
            uses: vec![Cell::default(); NUMBER_MAX as usize + 1],
            globals: BTreeMap::new(),
            locals: vec![BTreeMap::new()],
        };
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
        let used = &self.uses[number as usize];
        used.set(Use { is_read: used.get().is_read || !used.get().is_set, ..used.get() });
        Some(self.value(number))
    }

    fn value(&self, number: u32) -> f64 {
        let first = || f64::from(u8::from(number == SHOWS_DEBUG));
        self.numbered.get(number as usize).copied().unwrap_or_else(first)
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
                self.uses[*number as usize].get_mut().is_set = true;
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

    /// The user's parameters that the program has read or set; none if it has set none. `begun` are
    /// the values of the parameter file.
    pub(crate) fn left(&self, begun: &[Stored]) -> Vec<Left> {
        let mut before = Self::default();
        before.store(begun);
        let used = |number: u32| self.uses[number as usize].get();
        let mut numbers = OF_THE_USER;
        if !numbers.any(|number| used(number).is_set) {
            return Vec::new();
        }
        OF_THE_USER
            .filter(|&number| used(number) != Use::default())
            .map(|number| Left {
                number,
                began: before.value(number),
                value: self.value(number),
                is_read: used(number).is_read,
            })
            .collect()
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

#[cfg(test)]
mod tests {
    use crate::parameter_file::with_parameters;
    use crate::{LoadOptions, load};

    #[test]
    fn a_program_leaves_the_parameters_that_it_has_used() {
        // The program and what it leaves: numbers with values at first and at the end, `!` where a
        // number was read before it was set. #31 begins with 7.
        let table = [
            ("#31=[#31+1]", "!31: 7 8"),
            ("#31=0", "31: 7 0"),
            ("#31=7", "31: 7 7"),
            ("#31=8\n#31=[#31+1]", "31: 7 9"),
            ("#31=1 #32=#31", "!31: 7 1; 32: 0 7"),
            ("#32=[#31+1]\n#31=#32", "!31: 7 8; 32: 0 8"),
            ("#40=2\n#[#31+34]=#40", "!31: 7 7; 40: 0 2; 41: 0 2"),
            ("o1 if [#31 GT 5]\n#100=1\no1 endif", "!31: 7 7; 100: 0 1"),
            ("o1 sub\n#1=9 #200=[#200+1]\no1 endsub\no1 call [#31]", "!31: 7 7; !200: 0 1"),
            // Nothing to keep.
            ("G0 X#31", ""),
            ("#1=5 #<_part>=6", ""),
        ];
        let profile = settings::load_profile("rs274").expect("a shipped profile");
        for (text, wanted) in table {
            let text = format!("{text}\nM2").into_bytes();
            let text = with_parameters(text, &profile, "x.var", b"31 7\n").expect("a good file");
            let loaded = load(&text, &profile, &LoadOptions::default());
            assert!(loaded.is_accepted(), "{wanted}: {:?}", loaded.findings);
            let left = loaded.left.iter().map(|it| {
                let mark = if it.is_read { "!" } else { "" };
                format!("{mark}{}: {} {}", it.number, it.began, it.value)
            });
            assert_eq!(left.collect::<Vec<_>>().join("; "), wanted);
        }
    }
}
