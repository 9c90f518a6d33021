//! Limits the memory of a process.
//!
//! Any peer can make the DDS layer take more and more: it may announce endpoints without end. So each process that
//! uses DDS has a bound of its own, and exits above it: a flood restarts that process and nothing else. The
//! kernel refuses allocations far above the bound at once
//! (`RLIMIT_DATA`): the process aborts with "memory allocation of N bytes failed".

use crate::parameters::common::{MEMORY_MB_LEAST, MEMORY_MB_MAX, MEMORY_MB_USUAL};
use std::fs::{File, read_to_string};
use std::io::Read;

const MB: u64 = 1 << 20;

/// The bound of one process, in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct MemoryBound(u64);

impl MemoryBound {
    /// The bound that the parameter asks for, on this computer.
    pub(crate) fn of(megabytes: i64) -> Self {
        Self::on(megabytes, physical())
    }

    /// The bound of a command.
    pub(crate) fn usual() -> Self {
        Self::of(MEMORY_MB_USUAL)
    }

    fn on(megabytes: i64, physical: Option<u64>) -> Self {
        let asked =
            u64::try_from(megabytes.max(MEMORY_MB_LEAST)).unwrap_or(u64::MAX).saturating_mul(MB);
        // Three quarters: the rest of the stack has to run too.
        Self(physical.map_or(asked, |bytes| asked.min(bytes / 4 * 3)))
    }

    pub(crate) fn bytes(self) -> u64 {
        self.0
    }

    /// Has the kernel refuse what is far above the bound; a lower limit is kept.
    pub(crate) fn enforce(self) {
        use rustix::process::{Resource, getrlimit, setrlimit};
        let mut limit = getrlimit(Resource::Data);
        // This limit counts untouched memory too; the watched value does not.
        let hard = self.0.saturating_add(self.0 / 2).saturating_add(256 * MB);
        if limit.current.is_none_or(|current| current > hard) {
            limit.current = Some(limit.maximum.map_or(hard, |maximum| maximum.min(hard)));
            // Without it the process is watched all the same.
            let _ = setrlimit(Resource::Data, limit);
        }
    }

    /// A sentence with the numbers, when the process is above the bound.
    pub(crate) fn exceeded(self) -> Option<String> {
        let resident = resident()?;
        (resident > self.0).then(|| {
            format!(
                "this process takes {} MB of memory, {} MB are allowed ({MEMORY_MB_MAX})",
                resident / MB,
                self.0 / MB
            )
        })
    }
}

/// Resident memory of this process, in bytes. Allocates nothing.
fn resident() -> Option<u64> {
    let mut text = [0; 4_096];
    let length = File::open("/proc/self/status").ok()?.read(&mut text).ok()?;
    kilobytes(std::str::from_utf8(&text[..length]).ok()?, "VmRSS:")
}

/// Memory of the computer, in bytes.
fn physical() -> Option<u64> {
    let text = read_to_string("/proc/meminfo").ok()?;
    kilobytes(&text, "MemTotal:")
}

/// A line "NAME: 1234 kB" of the system, in bytes.
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_ascii_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1_024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_is_what_was_asked_for_and_what_the_computer_has() {
        let table = [
            (2_048, Some(64 << 30), 2_048 * MB),
            (2_048, Some(2 << 30), 1_536 * MB),
            (2_048, None, 2_048 * MB),
            (1, Some(64 << 30), 64 * MB),
            (i64::MAX, Some(4 << 30), 3_072 * MB),
        ];
        for (asked, physical, expected) in table {
            assert_eq!(MemoryBound::on(asked, physical), MemoryBound(expected), "{asked}");
        }
    }

    #[test]
    fn what_this_process_takes_is_known() {
        let resident = resident().expect("/proc");
        assert!((MB..64 << 30).contains(&resident), "{resident}");
        assert!(physical().expect("/proc") > resident);
        assert_eq!(MemoryBound(u64::MAX).exceeded(), None);
        let text = MemoryBound(MB).exceeded().expect("more than one megabyte");
        assert!(text.ends_with("1 MB are allowed (memory_mb_max)"), "{text}");
    }
}
