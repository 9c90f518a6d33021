//! The threads of the DDS layer, and what they are doing.
//!
//! RustDDS has two threads for each participant: a receiver and a discovery thread. For each
//! new endpoint of ours the discovery thread sends the receiver all peers on its topic,
//! through a queue of 32, and holds a read lock on its database meanwhile. The receiver may
//! need the same read lock when the queue is full. It gets the lock unless a writer waits:
//! then the waiting writer gets priority and the three threads deadlock. Only the thread that
//! makes an endpoint writes then. So we make an endpoint only when both threads are idle:
//! they have then finished with the endpoint before.
//! The report: docs/upstream/rustdds-endpoint-deadlock.md.

use std::collections::BTreeSet;
use std::fs::{read_dir, read_to_string};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How the names of these threads begin, and how long to wait until they are idle. The
/// receiver comes first, because it passes work on to the discovery thread. On a busy
/// computer it may never be idle; after the timeout we assume that it has finished.
const THREADS: [(&str, Duration); 2] =
    [("RustDDS Partici", Duration::from_millis(20)), ("RustDDS discove", Duration::from_secs(2))];
/// The pause between two checks: short at first, then longer and longer.
const PAUSE_MIN: Duration = Duration::from_micros(50);
const PAUSE_MAX: Duration = Duration::from_millis(2);
/// How long they usually need, for systems where they cannot be watched.
const USUAL_TIME: Duration = Duration::from_millis(2);

/// Their names in messages.
const NAMES: [&str; 2] = [RECEIVING, "discovery"];
/// The thread that reads the sockets.
pub(crate) const RECEIVING: &str = "receiving";

/// What a thread is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ThreadState {
    /// It has ended.
    Ended,
    /// It waits for something to do.
    Idle,
    /// It runs, or waits for a lock; with the count of its waits so far.
    Busy { waits: u64 },
}

/// The threads of one participant; none where the system does not show them.
#[derive(Debug, Clone)]
pub(crate) struct DdsThreads(BTreeSet<(usize, PathBuf)>);

/// The threads of the DDS layer in this process, with their indexes in the table above.
pub(crate) fn dds_threads() -> BTreeSet<(usize, PathBuf)> {
    let Ok(threads) = read_dir("/proc/self/task") else { return BTreeSet::new() };
    let known = |thread: PathBuf| {
        let name = read_to_string(thread.join("comm")).ok()?;
        let place = THREADS.iter().position(|(known, _)| name.starts_with(known))?;
        let call = thread.join("syscall");
        read_to_string(&call).is_ok().then_some((place, call))
    };
    threads.flatten().filter_map(|thread| known(thread.path())).collect()
}

impl DdsThreads {
    /// The threads that were started since.
    pub(crate) fn since(before: &BTreeSet<(usize, PathBuf)>) -> Self {
        Self(dds_threads().difference(before).cloned().collect())
    }

    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.0.len()
    }

    /// What each of them does now, with its name in messages.
    pub(crate) fn states(&self) -> Vec<(&'static str, ThreadState)> {
        self.0.iter().map(|(place, call)| (NAMES[*place], state_of(*place, call))).collect()
    }

    /// Waits until each of them has been idle, one after the other.
    pub(crate) fn wait_until_idle(&self) {
        if self.0.is_empty() {
            std::thread::sleep(USUAL_TIME);
        }
        for (place, thread) in &self.0 {
            let (end, mut pause) = (Instant::now() + THREADS[*place].1, PAUSE_MIN);
            while read_to_string(thread).is_ok_and(|call| !is_idle(&call)) && Instant::now() < end {
                std::thread::sleep(pause);
                pause = (2 * pause).min(PAUSE_MAX);
            }
        }
    }
}

/// The state of one thread. It counts as idle if its files cannot be read for another reason than
/// that it has ended, such as too many open files.
fn state_of(place: usize, call: &Path) -> ThreadState {
    let read = |name: &str| read_to_string(call.with_file_name(name));
    match read("comm") {
        // The system may reuse the number for another thread.
        Ok(name) if !name.starts_with(THREADS[place].0) => return ThreadState::Ended,
        Ok(_) => {}
        Err(error) if is_end(&error) => return ThreadState::Ended,
        Err(_) => return ThreadState::Idle,
    }
    match read_to_string(call) {
        Ok(call) if is_idle(&call) => ThreadState::Idle,
        Err(error) if is_end(&error) => ThreadState::Ended,
        _ => read("status")
            .map_or(ThreadState::Idle, |status| ThreadState::Busy { waits: waits(&status) }),
    }
}

/// Whether a file of a thread is missing because the thread has ended.
fn is_end(error: &std::io::Error) -> bool {
    const NO_SUCH_PROCESS: i32 = rustix::io::Errno::SRCH.raw_os_error();
    error.kind() == ErrorKind::NotFound || error.raw_os_error() == Some(NO_SUCH_PROCESS)
}

/// How often a thread has waited, from its `status` file.
fn waits(status: &str) -> u64 {
    let line = status.lines().find_map(|line| line.strip_prefix("voluntary_ctxt_switches:"));
    line.and_then(|count| count.trim().parse().ok()).unwrap_or(0)
}

/// Whether a thread waits for events: in a system call whose first argument is a file, that
/// of its poll. One that waits for a lock or a queue gives an address; one that could run,
/// "running".
fn is_idle(call: &str) -> bool {
    const FILES_MAX: u64 = 1 << 20;
    let first = call.split_whitespace().nth(1).and_then(|word| word.strip_prefix("0x"));
    first.and_then(|word| u64::from_str_radix(word, 16).ok()).is_some_and(|it| it < FILES_MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threads_of_a_participant_are_known_by_their_names() {
        let before = dds_threads();
        let participant = rustdds::DomainParticipantBuilder::new(199)
            .with_only_networks([std::net::Ipv4Addr::LOCALHOST])
            .build()
            .expect("a participant");
        let threads = DdsThreads::since(&before);
        let places: Vec<_> = threads.0.iter().map(|(place, _)| *place).collect();
        assert_eq!(places, [0, 1]);
        threads.wait_until_idle();
        assert_eq!(threads.count(), 2);
        for (name, seen) in threads.states() {
            assert!(
                matches!(seen, ThreadState::Idle | ThreadState::Busy { waits: 1.. }),
                "{name}: {seen:?}"
            );
        }
        drop(participant);
        assert_eq!(
            threads.states(),
            [("receiving", ThreadState::Ended), ("discovery", ThreadState::Ended)]
        );
    }

    #[test]
    fn who_waits_for_events_is_at_rest_and_who_waits_for_a_lock_is_not() {
        let table = [
            ("232 0x3 0x556b6066e680 0x400 0x280 0x0 0x0 0x7ffc 0x7f48", true),
            ("22 0x1f 0xffff 0x400 0x280 0x0 0x0 0x7ffc 0x7f48", true),
            ("202 0x556b6066e680 0x80 0x1 0x0 0x0 0x0 0x7ffc 0x7f48", false),
            ("running", false),
            ("-1 0x7ffc5bd0e9c8 0x7f4899494f36", false),
            ("", false),
        ];
        for (call, expected) in table {
            assert_eq!(is_idle(call), expected, "{call}");
        }
    }
}
