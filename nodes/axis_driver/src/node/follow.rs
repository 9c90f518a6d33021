//! Who else is there: a commander that gives signs of life, a recorder that records.
//!
//! What follows from either the core decides; this file hands it on. Which of two bags of a
//! goal counts is decided here, since only bags have names.

use super::{REPLY_WITHIN, RemoteDriver};
use crate::driver::Command;
use cnc_msgs::chunk::hex;
use cnc_msgs::wire::cnc_msgs::msg::Recording;
use cnc_msgs::wire::std_msgs::msg::Header;
use runtime::action::GoalId;
use runtime::{Gid, Handle, NodeResult, Qos};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Time between two signs of life that are handed on; far below what a commander is given.
const BEAT_PAUSE: Duration = Duration::from_millis(20);

/// The goals whose records matter: the one that runs, and those that may be about to.
#[derive(Debug, Default)]
pub(super) struct Recorder {
    goals: Mutex<Vec<String>>,
}

/// The process whose sign of life was the last.
#[derive(Debug, Default)]
pub(super) struct LastBeat(Mutex<Option<[u8; 12]>>);

impl LastBeat {
    fn is_of(&self, commander: Gid) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(commander.participant());
    }

    fn is_of_another_than(&self, commander: Gid) -> bool {
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        last.is_some_and(|last| last != commander.participant())
    }
}

impl RemoteDriver {
    /// Says to the core who begins what comes next, where that is not the commander whose signs
    /// of life are watched: one that has ended must not stop the work of its successor.
    pub(super) async fn note_who_begins(&self, commander: Gid) {
        if self.last_beat.is_of_another_than(commander)
            && let Err(refusal) = self.ask(Command::ForgetCommander, REPLY_WITHIN).await
        {
            tracing::warn!("commander heartbeat: {}", refusal.message);
        }
    }
}

/// Held as long as the record of a goal matters.
#[derive(Debug)]
pub(super) struct Expected<'a> {
    recorder: &'a Recorder,
    goal: String,
}

impl Recorder {
    /// The recorder names a run by the beginning of its goal's id.
    pub(super) fn expect(&self, goal: &GoalId) -> Expected<'_> {
        let goal = hex(&goal.0[..4]);
        self.goals().push(goal.clone());
        Expected { recorder: self, goal }
    }

    fn goals(&self) -> MutexGuard<'_, Vec<String>> {
        self.goals.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_of_goal(&self, run_id: &str) -> bool {
        self.goals().iter().any(|goal| run_id.ends_with(goal))
    }
}

impl Drop for Expected<'_> {
    fn drop(&mut self) {
        let mut goals = self.recorder.goals();
        if let Some(place) = goals.iter().position(|goal| *goal == self.goal) {
            goals.remove(place);
        }
    }
}

/// Follows both.
pub(super) fn follow(node: &Handle, driver: &Arc<RemoteDriver>) -> NodeResult {
    let mut beats = node.subscription::<Header>("commander_heartbeat", Qos::DEFAULT)?;
    let shared = Arc::clone(driver);
    node.spawn("commander heartbeat", async move {
        loop {
            let first = beats.next().await;
            // Of several that waited one sign of life is enough.
            let (_, info) = beats.drain().pop().unwrap_or(first);
            shared.last_beat.is_of(info.publisher);
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
        let mut bags = Bags::default();
        loop {
            let (recording, _) = recordings.next().await;
            let is_of_goal = |run_id: &str| driver.recorder.is_of_goal(run_id);
            if let Some(is_whole) = bags.news(&recording, is_of_goal) {
                let reason = reason(recording);
                let command = Command::Recorder { is_whole, reason };
                let _ = driver.ask(command, REPLY_WITHIN).await;
            }
        }
    });
    Ok(())
}

/// What was reported of the bags of a goal.
#[derive(Debug, Default)]
struct Bags {
    /// The first bag of the goal.
    first: String,
    reported: Option<(String, bool, bool)>,
}

impl Bags {
    /// Whether the record is whole, where that is new and matters to the run.
    ///
    /// A recorder that comes in the place of one that died has not the whole of it, and says
    /// so: that the record ends there stopped no run, so its continuation does not either.
    fn news(&mut self, recording: &Recording, is_of_goal: impl Fn(&str) -> bool) -> Option<bool> {
        if !is_of_goal(&recording.run_id) {
            return None;
        }
        if !is_of_goal(&self.first) {
            self.first.clone_from(&recording.run_id);
        }
        let is_whole = recording.is_recording && recording.complete;
        let news = Some((recording.run_id.clone(), recording.is_recording, is_whole));
        if self.reported == news {
            return None;
        }
        self.reported = news;
        (is_whole || recording.run_id == self.first).then_some(is_whole)
    }
}

/// Why a record is not whole; one that was closed too early may miss nothing so far.
fn reason(recording: Recording) -> String {
    if recording.reason.is_empty() && !recording.is_recording {
        return "the recorder is not recording any more".into();
    }
    recording.reason
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_first_bag_of_a_run_can_miss_something() {
        let mut bags = Bags::default();
        let mut news = |run_id: &str, is_recording, complete| {
            let run_id = run_id.to_owned();
            let recording = Recording { run_id, is_recording, complete, ..Recording::default() };
            bags.news(&recording, |run_id| run_id.ends_with("_a"))
        };
        assert_eq!(news("1_b", true, true), None, "of another goal");
        assert_eq!(news("1_a", true, true), Some(true));
        assert_eq!(news("1_a", true, true), None, "it is known");
        // The recorder died; another came.
        assert_eq!(news("2_a", true, false), None);
        assert_eq!(news("2_a", false, false), None);
        assert_eq!(news("1_a", true, false), Some(false));
    }

    #[test]
    fn another_goal_that_is_refused_does_not_hide_the_record_of_the_one_that_runs() {
        let recorder = Recorder::default();
        let goal = |byte| GoalId([byte; 16]);
        let runs = recorder.expect(&goal(0xaa));
        let refused = recorder.expect(&goal(0xbb));
        let are_expected = ["run_1_aaaaaaaa", "run_1_bbbbbbbb", "run_1_cccccccc", ""];
        let are = |recorder: &Recorder| are_expected.map(|run| recorder.is_of_goal(run));
        assert_eq!(are(&recorder), [true, true, false, false]);
        drop(refused);
        assert_eq!(are(&recorder), [true, false, false, false]);
        drop(runs);
        assert_eq!(are(&recorder), [false; 4], "what comes late is not of the next run");
    }

    #[test]
    fn a_record_that_is_closed_too_early_has_a_reason() {
        let gone = "the recorder is not recording any more";
        for (is_recording, text, expected) in [
            (true, "", ""),
            (true, "the disk is full", "the disk is full"),
            (false, "run_recorder is inactive", "run_recorder is inactive"),
            (false, "", gone),
        ] {
            let recording = Recording { is_recording, reason: text.into(), ..Recording::default() };
            assert_eq!(reason(recording), expected);
        }
    }
}
