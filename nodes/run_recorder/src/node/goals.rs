//! Begins and ends a bag with the goals of `run_program` that the driver reports.

use super::watch::{Edge, is_accepted_before};
use super::{BEGUN_PERIOD, Recorder};
use crate::bag_reader::LATE;
use cnc_msgs::cdr;
use runtime::{RawSubscription, RosTime};
use std::sync::Arc;
use std::time::Duration;
use tokio::time::Instant;

/// A sample that is older than this when it arrives was kept for late joiners. A newer one
/// follows within [`NEWER_WITHIN`].
const OLD: Duration = Duration::from_millis(300);
const NEWER_WITHIN: Duration = Duration::from_millis(200);
/// How much older than its subscription a goal may be: a driver may be discovered when it
/// takes its first goal. Earlier messages are latched or in its journal.
const FOUND_WITHIN: Duration = Duration::from_millis(300);
/// How long the state of the machine may take to arrive.
const STATE_WITHIN: Duration = Duration::from_secs(2);

impl Recorder {
    /// Keeps the first sample. If it is old, keeps the following ones too, up to the newest: a
    /// late joiner gets outdated samples first. Returns the last.
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

    /// Begins or ends a bag when the goals show that a run begins or ends. `since` is given with
    /// the first sample: when the subscription began.
    pub(super) fn follow(self: &Arc<Self>, goals: &[u8], since: Option<RosTime>) {
        // Samples of another type are skipped.
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

    /// Marks a bag that was begun after its goal as incomplete, unless the driver has waited for
    /// it.
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
