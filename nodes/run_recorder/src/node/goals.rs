//! The goals of `run_program` as the driver tells of them, and what they mean for the bag.

use super::watch::{Edge, is_accepted_before};
use super::{BEGUN_PERIOD, Recorder};
use crate::bag_reader::LATE;
use cnc_msgs::cdr;
use runtime::{RawSubscription, RosTime};
use std::sync::Arc;
use std::time::Duration;
use tokio::time::Instant;

/// What is older than this when it arrives was kept for who comes late, and what is newer
/// follows it so soon.
const OLD: Duration = Duration::from_millis(300);
const NEWER_WITHIN: Duration = Duration::from_millis(200);
/// What a goal may be older than the subscription that tells of it: a driver that is found
/// when it takes its first goal. What it said before is kept, or in its journal.
const FOUND_WITHIN: Duration = Duration::from_millis(300);
/// How long it may take until it is known how the machine stands.
const STATE_WITHIN: Duration = Duration::from_secs(2);

impl Recorder {
    /// Keeps the first sample, and those behind it that a late joiner is told before the
    /// newest: what was said some time ago may not be so any more. Returns the last.
    pub(super) async fn keep_newest(
        &self,
        index: usize,
        subscription: &mut RawSubscription,
    ) -> Vec<u8> {
        let mut sample = subscription.next().await;
        loop {
            let is_old = sample.info.source_time.is_some_and(|at| at < RosTime::wall().before(OLD));
            let bytes = sample.bytes.clone();
            self.keep(index, sample);
            if !is_old {
                return bytes;
            }
            match tokio::time::timeout(NEWER_WITHIN, subscription.next()).await {
                Ok(newer) => sample = newer,
                Err(_) => return bytes,
            }
        }
    }

    /// Begins or ends a bag with the run that the goals tell of. Of the first that is heard
    /// it is given since when there was somebody to hear it.
    pub(super) fn follow(self: &Arc<Self>, goals: &[u8], since: Option<RosTime>) {
        // What is not of that type is nobody's goal.
        let Ok(status) = cdr::decode(goals) else { return };
        let edge = self.state().watch.update(&status);
        match edge {
            Some(Edge::Begin { goal }) => {
                let since = since.map(|since| since.before(FOUND_WITHIN));
                let is_late = since.is_some_and(|at| is_accepted_before(&status, goal, at));
                self.begin(goal, is_late);
            }
            Some(Edge::End) => self.end(),
            None => {}
        }
    }

    /// Notes of a bag that came later than its goal that it misses the beginning, unless the
    /// driver has waited for it.
    pub(super) async fn judge_beginning(&self, run: u64) {
        let end = Instant::now() + STATE_WITHIN;
        loop {
            {
                let mut state = self.state();
                let has_waited = state.store.waits_for_recorder();
                let is_over = has_waited.is_some() || Instant::now() >= end;
                let is_ours = state.run == run;
                let Some(open) =
                    state.open.as_mut().filter(|open| is_ours && open.is_beginning_unclear)
                else {
                    return;
                };
                if is_over {
                    open.is_beginning_unclear = false;
                    if has_waited != Some(true) {
                        open.bag.note_incomplete(LATE);
                    }
                    return;
                }
            }
            tokio::time::sleep(BEGUN_PERIOD).await;
        }
    }
}
