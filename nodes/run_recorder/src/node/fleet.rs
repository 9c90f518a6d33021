//! Gives closed bags to a store of many bags, by `kerf-fleet push`: a process of its own, so that nothing that a
//! store does can hold up a recording.

use super::Recorder;
use crate::handed_over::{HandedOver, refused_of};
use runtime::{Health, HealthLevel, program_beside};
use rustix::process::{Pid, setpriority_process};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The program that pushes.
const PROGRAM: &str = "kerf-fleet";
/// A store that did not take its bags is tried again after so long.
pub(super) const TRY_AGAIN_AFTER: Duration = Duration::from_secs(600);
/// A push that takes longer shows in the health.
const LONG: Duration = Duration::from_secs(60);
/// The push leaves the processors to the machine.
const NICE: i32 = 19;

/// What is being pushed, and what was wrong.
#[derive(Debug, Default)]
pub(super) struct FleetPushes {
    state: Mutex<PushState>,
}

#[derive(Debug, Default)]
struct PushState {
    pushing_since: Option<Instant>,
    /// A bag was closed meanwhile.
    is_due_again: bool,
    /// What the last push said was wrong.
    problem: Option<String>,
    /// Bags that the program refuses: not offered again before the next start.
    refused: BTreeSet<PathBuf>,
}

impl FleetPushes {
    fn state(&self) -> MutexGuard<'_, PushState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the store has not taken everything that it was offered.
    pub(super) fn has_problem(&self) -> bool {
        self.state().problem.is_some()
    }
}

impl Recorder {
    /// The store of `fleet_store`, and what it was given of the bags here; `None` without one.
    fn fleet_store(&self) -> Option<(String, HandedOver)> {
        let store = self.node.parameter::<String>("fleet_store");
        let handed_over = HandedOver::new(self.directory(), store.clone());
        (!store.is_empty()).then_some((store, handed_over))
    }

    /// The bags that must not be removed before the store has them.
    pub(super) fn due_for_fleet(&self) -> BTreeSet<PathBuf> {
        let Some((_, handed_over)) = self.fleet_store() else { return BTreeSet::new() };
        let refused = self.pushes.state().refused.clone();
        let due = handed_over.due().unwrap_or_default();
        due.into_iter().filter(|bag| !refused.contains(bag)).collect()
    }

    /// Gives the store of `fleet_store` the bags that it has not been given: at the start, when a bag is closed,
    /// when the parameter is set, and later again if the store did not take them. Returns at once.
    pub(super) fn push_to_fleet(self: &Arc<Self>) {
        let mut state = self.pushes.state();
        if self.fleet_store().is_none() {
            state.problem = None;
            return;
        }
        if state.pushing_since.is_some() {
            state.is_due_again = true;
            return;
        }
        state.pushing_since = Some(Instant::now());
        drop(state);
        let recorder = Arc::clone(self);
        // A thread, not a task: a store that hangs must not keep the node from ending.
        let started = std::thread::Builder::new().name("fleet push".into()).spawn(move || {
            loop {
                let pushed = runtime::catch(|| recorder.push_what_is_due());
                let panicked = |_| Err("the push panicked".to_owned());
                let problem = pushed.unwrap_or_else(panicked).err();
                if let Some(problem) = &problem {
                    tracing::warn!("fleet_store: {problem}");
                }
                let mut state = recorder.pushes.state();
                state.problem = problem;
                state.pushing_since = state.is_due_again.then(Instant::now);
                if !std::mem::take(&mut state.is_due_again) {
                    return;
                }
            }
        });
        if let Err(error) = started {
            self.pushes.state().pushing_since = None;
            tracing::warn!("fleet_store: no thread for the push: {error}");
        }
    }

    /// One call of the program for all bags that are due.
    fn push_what_is_due(&self) -> Result<(), String> {
        let Some((store, handed_over)) = self.fleet_store() else { return Ok(()) };
        let due = handed_over.due().map_err(|error| {
            format!("cannot look for bags in {}: {error}", self.directory().display())
        })?;
        let refused = self.pushes.state().refused.clone();
        let (again, bags): (Vec<_>, Vec<_>) =
            due.into_iter().partition(|bag| refused.contains(bag));
        let mut problem = (!again.is_empty())
            .then(|| format!("{} bags were refused, as the log says", again.len()));
        if !bags.is_empty() {
            let said = run_nice(&store, &bags).map_err(|error| {
                format!(
                    "{PROGRAM}: {error}; `cargo install --path nodes/fleet --locked` in a checkout of Kerf makes it"
                )
            })?;
            let complaint = String::from_utf8_lossy(&said.stderr).trim().to_owned();
            // Its result: without one the store took nothing for sure.
            if said.stdout.is_empty() {
                return Err(format!("{complaint}; {} bags wait here", bags.len()));
            }
            let refused = refused_of(&complaint, &bags);
            for bag in bags.iter().filter(|bag| !refused.contains(*bag)) {
                handed_over.note(bag).map_err(|error| {
                    format!("cannot note that {} was pushed: {error}", bag.display())
                })?;
                tracing::info!("{} is in {store}", bag.display());
            }
            self.pushes.state().refused.extend(refused);
            problem = (!complaint.is_empty()).then_some(complaint).or(problem);
        }
        problem.map_or(Ok(()), Err)
    }

    /// The health of the pushes; `None` without a store.
    pub(super) fn health_of_pushes(&self) -> Option<Health> {
        self.fleet_store()?;
        let state = self.pushes.state();
        let long = state.pushing_since.map(|since| since.elapsed()).filter(|it| *it > LONG);
        let (level, message) = match (long, &state.problem) {
            (Some(time), _) => {
                (HealthLevel::Warn, format!("{PROGRAM} has been pushing for {} s", time.as_secs()))
            }
            (None, Some(problem)) => (HealthLevel::Warn, problem.clone()),
            (None, None) => (HealthLevel::Ok, "no bag waits for the store".to_owned()),
        };
        Some(Health { component: "fleet store".into(), level, message, ..Health::default() })
    }
}

/// Runs the program and waits for its end.
fn run_nice(store: &str, bags: &[PathBuf]) -> std::io::Result<Output> {
    let mut push = Command::new(program_beside(PROGRAM));
    push.args(["push", "--store", store]).args(bags);
    push.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let child = push.spawn()?;
    // It pushes as well without.
    let _ = setpriority_process(i32::try_from(child.id()).ok().and_then(Pid::from_raw), NICE);
    child.wait_with_output()
}
