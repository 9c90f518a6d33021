//! Rate-limits warnings per sender, so that a storm of bad messages is one line in the log.
//!
//! Pure: knows senders and times. The reader writes the warning itself.

use crate::samples::gid::Gid;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// The shortest time between two warnings about the same sender.
const PERIOD: Duration = Duration::from_secs(60);
/// Senders that are remembered; further senders are not warned about.
const SENDERS_MAX: usize = 256;

/// The warnings of one reader.
#[derive(Debug, Default)]
pub struct WarningRateLimit {
    made: BTreeMap<Gid, Instant>,
}

impl WarningRateLimit {
    /// Whether a warning about this sender is due: the first time, and then once a minute
    /// while it goes on.
    pub fn are_due(&mut self, sender: Gid, now: Instant) -> bool {
        let is_over = |made: Instant| now.saturating_duration_since(made) >= PERIOD;
        if self.made.len() >= SENDERS_MAX {
            self.made.retain(|_, made| !is_over(*made));
        }
        let is_due = match self.made.get(&sender) {
            Some(made) => is_over(*made),
            None => self.made.len() < SENDERS_MAX,
        };
        if is_due {
            self.made.insert(sender, now);
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sender_is_warned_about_once_a_minute() {
        let (mut limit, start) = (WarningRateLimit::default(), Instant::now());
        let (one, other) = (Gid([1; 16]), Gid([2; 16]));
        let table = [
            (one, 0, true),
            (one, 1, false),
            (other, 1, true),
            (one, 59, false),
            (one, 60, true),
            (one, 61, false),
            (other, 61, true),
        ];
        for (sender, seconds, expected) in table {
            let now = start + Duration::from_secs(seconds);
            assert_eq!(limit.are_due(sender, now), expected, "{sender} after {seconds} s");
        }
    }

    #[test]
    fn the_number_of_remembered_senders_is_bounded() {
        let (mut limit, start) = (WarningRateLimit::default(), Instant::now());
        let due = (0..10_000_u16).filter(|number| {
            let mut gid = [0; 16];
            gid[..2].copy_from_slice(&number.to_le_bytes());
            limit.are_due(Gid(gid), start)
        });
        assert_eq!(due.count(), SENDERS_MAX);
        assert_eq!(limit.made.len(), SENDERS_MAX);
        assert!(limit.are_due(Gid([9; 16]), start + PERIOD), "expired senders are forgotten");
        assert_eq!(limit.made.len(), 1);
    }
}
