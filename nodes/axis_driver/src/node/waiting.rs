//! Callers that wait for results: answers to orders, runs, jogs and probes, the shutdown.
//!
//! If the ROS side before this one gave the order, a result may come before a caller waits for
//! it. Then it is kept here until a caller asks. Sends nothing and decides nothing.

use super::Reply;
use crate::driver::{MoveResult, RunResult};
use std::collections::BTreeMap;
use tokio::sync::oneshot;

/// Who waits for what.
#[derive(Debug)]
pub(super) struct Waiting {
    pub(super) replies: Ends<Reply>,
    pub(super) runs: Ends<RunResult>,
    pub(super) moves: Ends<MoveResult>,
    pub(super) leave: Option<oneshot::Sender<()>>,
    /// Counts the wishes to stop.
    pub(super) stops: u64,
}

impl Waiting {
    /// Ids from `first_unseen_id` on are of this face alone.
    pub(super) fn new(first_unseen_id: u64) -> Self {
        Self {
            replies: Ends::new(first_unseen_id),
            runs: Ends::new(first_unseen_id),
            moves: Ends::new(first_unseen_id),
            leave: None,
            stops: 0,
        }
    }
}

/// Ends of one kind, by the id of the order.
#[derive(Debug)]
pub(super) struct Ends<T> {
    first_unseen_id: u64,
    waiting: BTreeMap<u64, oneshot::Sender<T>>,
    /// What came before this face was there to wait for it, for goals of the face before.
    before: BTreeMap<u64, T>,
}

impl<T> Ends<T> {
    fn new(first_unseen_id: u64) -> Self {
        Self { first_unseen_id, waiting: BTreeMap::new(), before: BTreeMap::new() }
    }

    /// The end of this order: of one that has ended before, too.
    pub(super) fn wait(&mut self, id: u64) -> oneshot::Receiver<T> {
        let (sender, end) = oneshot::channel();
        match self.before.remove(&id) {
            // The receiver is here.
            Some(result) => drop(sender.send(result)),
            None => drop(self.waiting.insert(id, sender)),
        }
        end
    }

    /// It has ended.
    pub(super) fn end(&mut self, id: u64, result: T) {
        match self.waiting.remove(&id) {
            // Whoever asked may have given up.
            Some(sender) => drop(sender.send(result)),
            // What ends while this face starts is waited for later.
            None if id < self.first_unseen_id => drop(self.before.insert(id, result)),
            None => {}
        }
    }

    /// Nobody waits for it any more.
    pub(super) fn forget(&mut self, id: u64) {
        self.waiting.remove(&id);
    }

    /// How it ended before this face was there.
    pub(super) fn before(&self, id: u64) -> Option<&T> {
        self.before.get(&id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_waits_for_its_goal_if_the_face_before_gave_it_and_a_goal_for_its_end() {
        let mut ends = Ends::new(10);
        let mut early = ends.wait(9);
        assert!(early.try_recv().is_err(), "it has not ended");
        ends.end(9, "nine");
        assert_eq!(early.try_recv(), Ok("nine"));
        // Of the face before: it comes before anybody asks.
        ends.end(8, "eight");
        assert_eq!(ends.before(8), Some(&"eight"));
        assert_eq!(ends.wait(8).try_recv(), Ok("eight"));
        assert_eq!(ends.before(8), None, "it is given once");
        // Of this face nobody asks later.
        ends.end(10, "ten");
        assert!(ends.wait(10).try_recv().is_err());
        ends.forget(10);
        ends.end(10, "ten");
        assert_eq!(ends.before(10), None);
    }
}
