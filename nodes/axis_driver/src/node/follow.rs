//! Who else is there: a commander that gives signs of life, a recorder that records.
//!
//! What follows from either the core decides; this file hands it on.

use super::{Driver, REPLY_WITHIN};
use crate::driver::Command;
use cnc_msgs::chunk::hex;
use cnc_msgs::wire::cnc_msgs::msg::Recording;
use cnc_msgs::wire::std_msgs::msg::Header;
use runtime::action::GoalId;
use runtime::{Handle, NodeResult, Qos};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Time between two signs of life that are handed on; far below what a commander is given.
const BEAT_PAUSE: Duration = Duration::from_millis(20);

/// The goal whose record is waited for.
#[derive(Debug, Default)]
pub(super) struct Recorder {
    goal: Mutex<String>,
}

impl Recorder {
    /// What is recorded from now on is judged by whether it is of this goal: the
    /// recorder names a run by the beginning of its goal's id.
    pub(super) fn expect(&self, goal: &GoalId) {
        *self.goal.lock().unwrap_or_else(PoisonError::into_inner) = hex(&goal.0[..4]);
    }

    fn is_of_goal(&self, run_id: &str) -> bool {
        let goal = self.goal.lock().unwrap_or_else(PoisonError::into_inner);
        !goal.is_empty() && run_id.ends_with(goal.as_str())
    }
}

/// Follows both.
pub(super) fn follow(node: &Handle, driver: &Arc<Driver>) -> NodeResult {
    let mut beats = node.subscription::<Header>("commander_heartbeat", Qos::DEFAULT)?;
    let shared = Arc::clone(driver);
    node.spawn("commander heartbeat", async move {
        loop {
            beats.next().await;
            // Of several that waited one sign of life is enough.
            beats.drain();
            if let Err(refusal) = shared.ask(Command::Heartbeat, REPLY_WITHIN).await {
                tracing::warn!("commander heartbeat: {}", refusal.message);
            }
            // However many beats come, the journal holds so many.
            tokio::time::sleep(BEAT_PAUSE).await;
        }
    });
    let mut recordings = node.subscription::<Recording>("recording", Qos::LATCHED)?;
    let driver = Arc::clone(driver);
    node.spawn("recording", async move {
        let mut told = None;
        loop {
            let (recording, _) = recordings.next().await;
            if !driver.recorder.is_of_goal(&recording.run_id) {
                continue;
            }
            let is_whole = recording.is_recording && recording.complete;
            let news = Some((recording.run_id.clone(), recording.is_recording, is_whole));
            if told != news {
                told = news;
                let reason = recording.reason;
                let command = Command::Recorder { is_whole, reason };
                let _ = driver.ask(command, REPLY_WITHIN).await;
            }
        }
    });
    Ok(())
}
