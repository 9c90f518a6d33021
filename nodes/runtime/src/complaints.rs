//! Rate-limits warnings per sender, so that a storm of bad messages is one line in the log.
//!
//! Pure: knows senders and times. What is wrong with a message, its reader says.

use crate::wire::Gid;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// How long a complaint about a sender stands for those that follow.
const PERIOD: Duration = Duration::from_secs(60);
/// Senders that are remembered; further senders are not warned about.
const SENDERS_MAX: usize = 256;

/// The complaints of one reader.
#[derive(Debug, Default)]
pub struct Complaints {
    made: BTreeMap<Gid, Instant>,
}

impl Complaints {
    /// Whether it is time to say that something of this sender cannot be used:
    /// the first time, and once a minute while it goes on.
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
    fn a_sender_is_complained_about_once_a_minute() {
        let (mut complaints, start) = (Complaints::default(), Instant::now());
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
            assert_eq!(complaints.are_due(sender, now), expected, "{sender} after {seconds} s");
        }
    }

    #[test]
    fn a_crowd_of_senders_is_not_remembered() {
        let (mut complaints, start) = (Complaints::default(), Instant::now());
        let due = (0..10_000_u16).filter(|number| {
            let mut gid = [0; 16];
            gid[..2].copy_from_slice(&number.to_le_bytes());
            complaints.are_due(Gid(gid), start)
        });
        assert_eq!(due.count(), SENDERS_MAX);
        assert_eq!(complaints.made.len(), SENDERS_MAX);
        assert!(complaints.are_due(Gid([9; 16]), start + PERIOD), "those of before are forgotten");
        assert_eq!(complaints.made.len(), 1);
    }
}
