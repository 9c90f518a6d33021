//! Throttles the log: a rate limit for each place in the source code that logs.
//!
//! Pure. A peer can trigger the same message ten thousand times a second. Without a
//! throttle it would fill disks and `/rosout`, and hide what matters.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Lines that a place may write one after the other.
const BURST: u32 = 100;
/// After that, one line in this time.
const REFILL: Duration = Duration::from_millis(500);

/// A line of the program that logs: file and number.
pub(crate) type LogSite = (&'static str, u32);

/// What has been written, by place; there are only so many places.
#[derive(Debug, Default)]
pub(crate) struct Throttle {
    places: BTreeMap<LogSite, Account>,
}

#[derive(Debug)]
struct Account {
    /// Lines that may still be written, and since when this number counts.
    left: u32,
    since: Instant,
    /// Lines that were left out since the last that was written.
    left_out: u64,
}

impl Throttle {
    /// Whether this line may be written, and then how many like it were left
    /// out before it.
    pub(crate) fn admit(&mut self, place: LogSite, now: Instant) -> Option<u64> {
        let account =
            self.places.entry(place).or_insert(Account { left: BURST, since: now, left_out: 0 });
        let elapsed = now.saturating_duration_since(account.since);
        let refilled = (elapsed.as_nanos() / REFILL.as_nanos()).min(u128::from(BURST)) as u32;
        if account.left + refilled >= BURST {
            (account.left, account.since) = (BURST, now);
        } else {
            account.left += refilled;
            account.since += REFILL * refilled;
        }
        if account.left == 0 {
            account.left_out += 1;
            return None;
        }
        account.left -= 1;
        Some(std::mem::take(&mut account.left_out))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_storm_of_lines_is_a_burst_and_then_two_a_second() {
        let (mut throttle, start) = (Throttle::default(), Instant::now());
        let place = ("reader.rs", 7);
        // Ten thousand a second for ten seconds.
        let at = |index: u32| start + Duration::from_micros(100) * index;
        let written: Vec<u64> =
            (0..100_000).filter_map(|index| throttle.admit(place, at(index))).collect();
        assert_eq!(written.len(), 100 + 19, "{written:?}");
        let left_out = written.iter().sum::<u64>();
        // The next line reports the lines that were left out after the last one.
        let next = throttle.admit(place, start + Duration::from_secs(20)).expect("time went by");
        assert_eq!(left_out + next + 119, 100_000);
    }

    #[test]
    fn places_do_not_disturb_each_other_and_recover() {
        let (mut throttle, start) = (Throttle::default(), Instant::now());
        for _ in 0..1000 {
            throttle.admit(("reader.rs", 7), start);
        }
        assert_eq!(throttle.admit(("reader.rs", 7), start), None);
        assert_eq!(throttle.admit(("reader.rs", 8), start), Some(0));
        let later = start + REFILL * BURST;
        assert_eq!(throttle.admit(("reader.rs", 7), later), Some(901));
        for _ in 1..BURST {
            assert_eq!(throttle.admit(("reader.rs", 7), later), Some(0));
        }
        assert_eq!(throttle.admit(("reader.rs", 7), later), None);
    }
}
