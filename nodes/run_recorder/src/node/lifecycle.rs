//! What the states of the recorder mean.
//!
//! Configured is: there is a directory for the bags. Active is: runs are recorded. It
//! listens in every state, so that one that is activated in a run has what came before.

use super::Recorder;
use runtime::{Health, Managed, Step, Trouble};
use std::sync::Arc;

/// Wraps the recorder, whose tasks need it shared.
pub(super) struct Shell(pub(super) Arc<Recorder>);

impl Managed for Shell {
    async fn configure(&self) -> Step {
        // Whether bags can be made is better known before the first run.
        let directory = &self.0.directory;
        std::fs::create_dir_all(directory).map_err(|error| {
            Trouble::failure(format!("bags cannot go to {}: {error}", directory.display()))
        })
    }

    async fn activate(&self) -> Step {
        let (recorder, mut states) = (Arc::clone(&self.0), self.0.node.lifecycle_changes());
        // A run that is under way is recorded from here on, when the node is active.
        self.0.node.spawn("recording on activation", async move {
            if states.changed().await.is_ok()
                && let Some(goal) = { recorder.state().goal }
            {
                recorder.begin(goal);
            }
        });
        Ok(())
    }

    async fn deactivate(&self) -> Step {
        self.close(Some("the recorder was deactivated in the run")).await;
        Ok(())
    }

    async fn shutdown(&self) -> Step {
        self.close(None).await;
        Ok(())
    }

    fn health(&self) -> Vec<Health> {
        vec![self.0.health()]
    }
}

impl Shell {
    /// Closes the bag that is open.
    async fn close(&self, why: Option<&str>) {
        let open = self.0.state().open.take();
        if let Some(open) = open {
            if let Some(why) = why {
                open.bag.note_incomplete(why);
            }
            self.0.finish(open).await;
        }
    }
}
