//! What the benches of a running machine share: their arguments, the load of the host
//! and the programs that they run.
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

/// What is asked for on the command line; what is not understood is for others.
#[derive(Debug)]
pub(crate) struct Arguments(Vec<String>);

impl Arguments {
    pub(crate) fn read() -> Self {
        Self(std::env::args().skip(1).collect())
    }

    /// Whether only that everything works is to be shown, in a short time.
    pub(crate) fn is_test(&self) -> bool {
        self.has("--test")
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        self.0.iter().any(|word| word == name)
    }

    /// The value after a name; without one `usual`, or `short` with `--test`.
    ///
    /// # Panics
    /// There is one that cannot be read.
    pub(crate) fn value<T: FromStr>(&self, name: &str, usual: T, short: T) -> T {
        let Some(at) = self.0.iter().position(|word| word == name) else {
            return if self.is_test() { short } else { usual };
        };
        let value = self.0.get(at + 1).and_then(|word| word.parse().ok());
        value.unwrap_or_else(|| panic!("{name} takes a value"))
    }
}

/// How many threads want to run, over one and five minutes: whatever else the host does
/// is in the figures.
pub(crate) fn load() -> String {
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let mut words = load.split(' ');
    let (one, five) = (words.next().unwrap_or("?"), words.next().unwrap_or("?"));
    let processors = std::thread::available_parallelism().map_or(0, usize::from);
    format!("load {one} (1 min), {five} (5 min) on {processors} processors")
}
