//! The threads of the DDS layer, and whether they are at rest.
//!
//! RustDDS has two for each participant: one that receives and one that discovers. For each
//! endpoint of ours the second tells the first of all peers on its topic, through a queue of
//! 32, with its database locked for reading meanwhile. When the queue is full, and the first
//! is to read the database too, it can, unless somebody waits to write: then he who waits
//! goes first, and all three wait for each other for ever. Only who makes an endpoint writes
//! while the database is locked in this way. So an endpoint is made when both threads have
//! come to rest, which is when nothing is left to do for the one before.

use std::collections::BTreeSet;
use std::fs::{read_dir, read_to_string};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// What the names of these threads begin with, and how long they may be busy without a break.
/// The receiving one comes first: it hands on to the other what there is to do. Where it is
/// never at rest, so busy is the computer, it has most probably done so.
const THREADS: [(&str, Duration); 2] =
    [("RustDDS Partici", Duration::from_millis(20)), ("RustDDS discove", Duration::from_secs(2))];
/// How often they are looked at: soon, then less and less often.
const SHORTEST: Duration = Duration::from_micros(50);
const LONGEST: Duration = Duration::from_millis(2);
/// What they usually need, where they cannot be watched.
const UNWATCHED: Duration = Duration::from_millis(2);

/// The threads of one participant; none where the system does not show them.
#[derive(Debug)]
pub(crate) struct DdsThreads(BTreeSet<(usize, PathBuf)>);

/// The threads of the DDS layer in this process, with their places in the table above.
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
    /// Those that were started since.
    pub(crate) fn since(before: &BTreeSet<(usize, PathBuf)>) -> Self {
        Self(dds_threads().difference(before).cloned().collect())
    }

    /// Waits until each of them has been at rest, one after the other.
    pub(crate) fn wait_for_rest(&self) {
        if self.0.is_empty() {
            std::thread::sleep(UNWATCHED);
        }
        for (place, thread) in &self.0 {
            let (end, mut pause) = (Instant::now() + THREADS[*place].1, SHORTEST);
            while read_to_string(thread).is_ok_and(|call| !is_at_rest(&call))
                && Instant::now() < end
            {
                std::thread::sleep(pause);
                pause = (2 * pause).min(LONGEST);
            }
        }
    }
}

/// Whether a thread waits for events: in a system call whose first argument is a file, that
/// of its poll. One that waits for a lock or a queue gives an address; one that could run,
/// "running".
fn is_at_rest(call: &str) -> bool {
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
        threads.wait_for_rest();
        drop(participant);
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
            assert_eq!(is_at_rest(call), expected, "{call}");
        }
    }
}
