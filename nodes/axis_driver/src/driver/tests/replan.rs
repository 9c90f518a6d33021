//! Checkpoints on trial: from each of them the rest of a record plays as it did.

use crate::driver::{Driver, DriverConfig, Output};
use crate::journal::{Entry, EntryKind, replay};
use cnc_msgs::path::CompensatedPath;
use std::sync::Arc;
use std::time::Duration;

/// A checkpoint and the place in a record where it was made.
#[derive(Debug)]
struct Rest {
    json: String,
    at: Duration,
    state: Output,
    entries: usize,
    outputs: usize,
}

/// Those of one record.
#[derive(Debug, Default)]
pub(super) struct Rests(Vec<Rest>);

impl Rests {
    /// Makes one, if the driver is at rest before the input at `now`.
    pub(super) fn mark(&mut self, driver: &Driver, now: Duration, entries: usize, outputs: usize) {
        let state = Output::State(driver.state(now));
        let Some(json) = driver.checkpoint() else { return };
        let again = Driver::from_checkpoint(json.as_bytes()).expect("it was written just now");
        let known = |driver: &Driver| format!("{:?}", driver.context.machine);
        assert_eq!(known(&again), known(driver), "a checkpoint keeps all that is known");
        self.0.push(Rest { json, at: now, state, entries, outputs });
    }

    /// The number of those after which the rest of the record did not play as it did.
    pub(super) fn failures(
        &self,
        entries: &[Entry],
        outputs: &[(Duration, Output)],
        lookup: &dyn Fn(&str, u64) -> Option<Arc<CompensatedPath>>,
    ) -> usize {
        let plays_again = |rest: &Rest| {
            let tail = &entries[rest.entries..];
            let checkpoint = Entry {
                sequence: tail.first().map_or(1, |entry| entry.sequence - 1),
                monotonic_ns: u64::try_from(rest.at.as_nanos()).unwrap(),
                kind: EntryKind::Checkpoint,
                data: rest.json.clone().into_bytes(),
            };
            let record: Vec<Entry> = [checkpoint].into_iter().chain(tail.iter().cloned()).collect();
            let again = replay(&record, lookup, DriverConfig::default()).unwrap();
            let state = [(rest.at, rest.state.clone())];
            again.first_difference(&record).is_none()
                && again.outputs.iter().eq(state.iter().chain(&outputs[rest.outputs..]))
        };
        self.0.iter().filter(|rest| !plays_again(rest)).count()
    }
}
