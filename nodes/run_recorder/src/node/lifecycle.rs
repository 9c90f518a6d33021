//! The lifecycle of the recorder.
//!
//! Configured: the directory for bags exists. Active: runs are recorded. The recorder
//! subscribes in every state, so that one activated during a run has the earlier messages.

use super::Recorder;
use runtime::{Health, Managed, TransitionResult, Trouble};
use std::sync::Arc;

/// Wraps the recorder, whose tasks need it shared.
pub(super) struct Shell(pub(super) Arc<Recorder>);

impl Managed for Shell {
    async fn configure(&self) -> TransitionResult {
        // An error in making bags should show before the first run.
        let directory = self.0.directory();
        let shown = directory.display().to_string();
        // A disk that hangs blocks this step, not the node.
        let made = tokio::task::spawn_blocking(move || std::fs::create_dir_all(directory)).await;
        made.map_err(std::io::Error::other).flatten().map_err(|error| {
            Trouble::failure(format!("cannot make the folder for bags {shown}: {error}"))
        })?;
        self.0.spawn_removal_of_old_bags();
        self.0.push_to_fleet();
        Ok(())
    }

    async fn activate(&self) -> TransitionResult {
        let (recorder, mut states) = (Arc::clone(&self.0), self.0.node.lifecycle_changes());
        // A run that is active already is recorded from here on.
        self.0.node.spawn("recording on activation", async move {
            if states.changed().await.is_ok()
                && let Some(goal) = { recorder.state().watch.goal() }
            {
                recorder.begin(goal, true);
            }
        });
        Ok(())
    }

    async fn deactivate(&self) -> TransitionResult {
        self.close("the recorder was deactivated in the run").await;
        Ok(())
    }

    async fn shutdown(&self) -> TransitionResult {
        self.close("the recorder was stopped in the run").await;
        Ok(())
    }

    fn health(&self) -> Vec<Health> {
        let always = [self.0.health(), self.0.health_of_old_bags()];
        always.into_iter().chain(self.0.health_of_pushes()).collect()
    }
}

impl Shell {
    /// Closes the open bag, with the reason in it unless the run is over.
    async fn close(&self, why: &str) {
        let (open, is_run) = {
            let mut state = self.0.state();
            (state.open.take(), state.watch.goal().is_some() || state.store.motion_possible())
        };
        if let Some(open) = open {
            if is_run {
                open.bag.note_incomplete(why);
            }
            self.0.finish(open).await;
        }
    }
}
