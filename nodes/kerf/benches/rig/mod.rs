//! What the benches of a running machine share: arguments, the load of the host and the programs
//! that they run.
#![allow(dead_code, reason = "each bench uses its part")]

pub(crate) mod accounts;
pub(crate) mod controller;
#[path = "../../tests/support/machine.rs"]
pub(crate) mod machine;
pub(crate) mod memory;
pub(crate) mod relay;
#[path = "../../tests/support/mod.rs"]
pub(crate) mod support;
pub(crate) mod table;
pub(crate) mod whole;

use std::str::FromStr;

/// The arguments of a bench; unknown ones are for the harness.
#[derive(Debug)]
pub(crate) struct Arguments(Vec<String>);

impl Arguments {
    pub(crate) fn read() -> Self {
        Self(std::env::args().skip(1).collect())
    }

    /// Whether to show in a short time only that everything works.
    pub(crate) fn is_test(&self) -> bool {
        self.has("--test")
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        self.0.iter().any(|word| word == name)
    }

    /// The value after a name; without one `usual`, or `short` with `--test`.
    ///
    /// # Panics
    /// The value cannot be read.
    pub(crate) fn value<T: FromStr>(&self, name: &str, usual: T, short: T) -> T {
        let Some(at) = self.0.iter().position(|word| word == name) else {
            return if self.is_test() { short } else { usual };
        };
        let value = self.0.get(at + 1).and_then(|word| word.parse().ok());
        value.unwrap_or_else(|| panic!("{name} takes a value"))
    }
}

/// The load average over one and five minutes: other work of the host distorts the figures.
pub(crate) fn load() -> String {
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let mut words = load.split(' ');
    let (one, five) = (words.next().unwrap_or("?"), words.next().unwrap_or("?"));
    let processors = std::thread::available_parallelism().map_or(0, usize::from);
    format!("load {one} (1 min), {five} (5 min) on {processors} processors")
}
