//! The lifecycle states of the planner.
//!
//! Configured: the tool table is read from its file. Active: contours are planned and tools are
//! set. A contour that arrives before is planned on activation.

use super::tool_file::ToolFile;
use super::{Live, Planner};
use cnc_msgs::tool_table::ToolTable;
use runtime::{Health, Managed, TransitionResult, Trouble};
use std::sync::PoisonError;

impl Managed for Planner {
    async fn configure(&self) -> TransitionResult {
        let file: String = self.node.parameter("tool_table");
        let (file, tools) = match file.as_str() {
            "" => (None, ToolTable::default()),
            path => {
                let (file, tools) = ToolFile::open(path.as_ref())
                    .map_err(|error| Trouble::failure(format_args!("tool_table: {error}")))?;
                (Some(file), tools)
            }
        };
        *self.tool_file.lock().unwrap_or_else(PoisonError::into_inner) = file;
        {
            let mut state = self.state();
            state.tools = tools;
            state.tools_revision += 1;
            state.is_due = true;
        }
        self.publish_tools();
        Ok(())
    }

    async fn activate(&self) -> TransitionResult {
        // The new state holds only after this returns; planning checks it then.
        let (mut states, replan) = (self.node.lifecycle_changes(), self.replan.clone());
        self.node.spawn("planning on activation", async move {
            if states.changed().await.is_ok() {
                replan.send_replace(());
            }
        });
        Ok(())
    }

    async fn deactivate(&self) -> TransitionResult {
        // A plan that has begun is finished.
        drop(self.work.write().await);
        Ok(())
    }

    async fn cleanup(&self) -> TransitionResult {
        // The contour stays. It is planned again with the table that is read next, so that nobody
        // runs an old path for lack of a new one.
        let mut state = self.state();
        (state.current, state.live, state.summary) = (None, Live::default(), None);
        Ok(())
    }

    fn health(&self) -> Vec<Health> {
        vec![Planner::health(self)]
    }
}
