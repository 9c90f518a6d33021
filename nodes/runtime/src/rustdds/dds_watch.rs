//! The watchdog of the DDS layer: whether it still serves this process.
//!
//! No packet that we know stops a thread of our copy of RustDDS. If one hangs all the same, the process lives on but
//! receives nothing. So each of its two loops is given a reason to go round, four times a second, and has to do so in
//! [`FAILED_CHECKS_MAX`] checks. Checks are counted, not seconds: a process that is stopped, or gets no processor time,
//! does not check either. A panic of a thread ends the process (`process/panic_guard`).

use crate::process::watchdog::{CHECK_PERIOD, Deafness, EndOfProcess, Watchdog};
use rustdds::LoopTurns;
use tokio::sync::watch;

/// Checks in a row without progress: five seconds if this thread runs on time.
const FAILED_CHECKS_MAX: u32 = 20;
/// The loops, in the order of [`LoopTurns::count_and_wake`].
const LOOPS: [&str; 2] = ["receiving", "discovery"];

/// Starts to watch the loops of a participant; `deaf` gets the reason once, unless the process exits.
///
/// # Errors
/// The system has no thread left.
pub(crate) fn start(
    turns: LoopTurns,
    deaf: watch::Sender<Option<Deafness>>,
    end: Option<EndOfProcess>,
) -> std::io::Result<Watchdog> {
    let mut checks = Checks::default();
    Watchdog::start("dds-watch", deaf, end, move || checks.take(turns.count_and_wake()))
}

/// The checks so far: a pure core.
#[derive(Debug, Default)]
struct Checks {
    turns: [u64; 2],
    failed: [u32; 2],
}

impl Checks {
    /// Takes one check; the reason when the process is deaf.
    fn take(&mut self, turns: [u64; 2]) -> Result<(), String> {
        for (place, name) in LOOPS.into_iter().enumerate() {
            let goes_round = turns[place] != self.turns[place];
            self.failed[place] = if goes_round { 0 } else { self.failed[place] + 1 };
            if self.failed[place] > FAILED_CHECKS_MAX {
                return Err(format!(
                    "the {name} thread of the DDS layer has done nothing for {FAILED_CHECKS_MAX} checks, {} ms apart",
                    CHECK_PERIOD.as_millis()
                ));
            }
        }
        self.turns = turns;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, Instant};

    #[test]
    fn a_loop_that_hangs_is_given_its_checks_and_no_more() {
        let first = |turns: fn(u64) -> [u64; 2]| {
            let mut checks = Checks::default();
            (1..1_000).find_map(|check| Some((check, checks.take(turns(check)).err()?)))
        };
        let limit = u64::from(FAILED_CHECKS_MAX);
        assert_eq!(first(|check| [check, 3 * check]), None);
        // Slow, as on a busy computer.
        assert_eq!(first(|check| [check / 15, check]), None);
        let (check, reason) = first(|check| [check, check.min(7)]).expect("deaf");
        assert_eq!(check, 7 + limit + 1);
        assert!(reason.starts_with("the discovery thread"), "{reason}");
        let (check, reason) = first(|check| [0, check]).expect("deaf");
        assert_eq!(check, limit + 1);
        assert!(reason.starts_with("the receiving thread"), "{reason}");
    }

    #[test]
    fn both_loops_of_a_participant_go_round_until_it_is_dropped() {
        let participant = rustdds::DomainParticipantBuilder::new(199)
            .with_only_networks([std::net::Ipv4Addr::LOCALHOST])
            .build()
            .expect("a participant");
        let turns = participant.loop_turns();
        for _ in 0..3 {
            let (before, end) = (turns.count_and_wake(), Instant::now() + Duration::from_secs(30));
            while turns.count_and_wake().iter().zip(before).any(|(now, then)| *now <= then) {
                assert!(Instant::now() < end, "{before:?}");
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        drop(participant);
        let after = turns.count_and_wake();
        std::thread::sleep(Duration::from_millis(50));
        assert_eq!(turns.count_and_wake(), after);
    }
}
