//! Gives closed bags to a store of many bags, by `kerf-fleet push`: a process of its own, so that nothing that a
//! store does can hold up a recording.

use super::Recorder;
use crate::handed_over::HandedOver;
use runtime::{Health, HealthLevel, program_beside};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The program that pushes.
const PROGRAM: &str = "kerf-fleet";

/// What is being pushed, and what was wrong.
#[derive(Debug, Default)]
pub(super) struct FleetPushes {
    state: Mutex<PushState>,
}

#[derive(Debug, Default)]
struct PushState {
    is_pushing: bool,
    /// A bag was closed meanwhile.
    is_due_again: bool,
    /// What the last push said was wrong.
    problem: Option<String>,
    /// Bags that were refused: not offered again before the next start.
    refused: BTreeSet<PathBuf>,
}

impl FleetPushes {
    fn state(&self) -> MutexGuard<'_, PushState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Recorder {
    /// Gives the store of `fleet_store` the bags that it has not been given: at the start, when a bag is closed,
    /// and when the parameter is set. Returns at once.
    pub(super) fn push_to_fleet(self: &Arc<Self>) {
        if self.node.parameter::<String>("fleet_store").is_empty() {
            self.pushes.state().problem = None;
            return;
        }
        let mut state = self.pushes.state();
        if std::mem::replace(&mut state.is_pushing, true) {
            state.is_due_again = true;
            return;
        }
        drop(state);
        let recorder = Arc::clone(self);
        // A thread, not a task: a store that hangs must not keep the node from ending.
        let started = std::thread::Builder::new().name("fleet push".into()).spawn(move || {
            loop {
                let problem = recorder.push_what_is_due().err();
                if let Some(problem) = &problem {
                    tracing::warn!("fleet_store: {problem}");
                }
                let mut state = recorder.pushes.state();
                state.problem = problem;
                if !std::mem::take(&mut state.is_due_again) {
                    state.is_pushing = false;
                    return;
                }
            }
        });
        if let Err(error) = started {
            self.pushes.state().is_pushing = false;
            tracing::warn!("fleet_store: no thread for the push: {error}");
        }
    }

    /// One call of the program for each bag, and one for what waits. The error says what was wrong with the last.
    fn push_what_is_due(&self) -> Result<(), String> {
        let store = self.node.parameter::<String>("fleet_store");
        if store.is_empty() {
            return Ok(());
        }
        let folder = HandedOver::new(self.directory(), store.clone());
        let due = folder.due().map_err(|error| {
            format!("cannot look for bags in {}: {error}", self.directory().display())
        })?;
        let mut problem = None;
        let refused = self.pushes.state().refused.clone();
        let mut bags: Vec<_> = due.iter().filter(|bag| !refused.contains(*bag)).map(Some).collect();
        if bags.is_empty() {
            // Without a bag, what waits is sent.
            bags.push(None);
        }
        for bag in bags {
            let mut push = Command::new(program_beside(PROGRAM));
            push.args(["push", "--store", &store, "--spool"]).arg(folder.spool()).args(bag);
            let said = push.stdin(Stdio::null()).output().map_err(|error| {
                format!(
                    "{PROGRAM}: {error}; `cargo install --path nodes/fleet --locked` in a checkout of Kerf makes it"
                )
            })?;
            let complaint = String::from_utf8_lossy(&said.stderr).trim().to_owned();
            if !complaint.is_empty() {
                problem = Some(complaint.clone());
            }
            let Some(bag) = bag else { continue };
            if said.status.success() {
                folder.note(bag).map_err(|error| {
                    format!("cannot note that {} was pushed: {error}", bag.display())
                })?;
                let place = if complaint.is_empty() { "is in" } else { "waits for" };
                tracing::info!("{} {place} {store}", bag.display());
            } else if complaint.contains(": not pushed: ") {
                self.pushes.state().refused.insert(bag.clone());
            } else {
                // The next bag would not fare better.
                return Err(complaint);
            }
        }
        problem.map_or(Ok(()), Err)
    }

    /// The health of the pushes; `None` without a store.
    pub(super) fn health_of_pushes(&self) -> Option<Health> {
        if self.node.parameter::<String>("fleet_store").is_empty() {
            return None;
        }
        let (level, message) = match &self.pushes.state().problem {
            None => (HealthLevel::Ok, "no bag waits for the store".to_owned()),
            Some(problem) => (HealthLevel::Warn, problem.clone()),
        };
        Some(Health { component: "fleet store".into(), level, message, ..Health::default() })
    }
}
