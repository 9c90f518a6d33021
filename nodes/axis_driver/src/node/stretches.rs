//! A run that waits where its program reads what its probes have found: the loader reads the program on.

use super::path::Paths;
use super::{REPLY_WITHIN, RemoteDriver};
use crate::driver::{Command, ProbesOfRun};
use cnc_msgs::wire::cnc_msgs::srv::{ContinueProgram, ContinueProgramRequest};
use runtime::{Client, Handle, NodeError};
use std::sync::Arc;
use std::time::Duration;

/// How long the loader and the planner may take, each.
const PLANNED_WITHIN: Duration = Duration::from_secs(50);

/// Follows what the driver says of its probes.
pub(super) fn follow(
    node: &Handle,
    driver: &Arc<RemoteDriver>,
    paths: &Paths,
) -> Result<(), NodeError> {
    let loader = node.client::<ContinueProgram>("continue_program")?;
    let (driver, paths) = (Arc::clone(driver), paths.clone());
    node.spawn("stretches", async move {
        let mut found = driver.probes.subscribe();
        loop {
            let newest = found.borrow_and_update().clone();
            let work = async {
                if let Some(newest) = newest {
                    go_on(&driver, &loader, &paths, newest).await;
                }
                std::future::pending::<()>().await;
            };
            // The next stretch ends what is waited for in this one.
            tokio::select! {
                () = work => {}
                changed = found.changed() => if changed.is_err() {
                    return;
                },
            }
        }
    });
    Ok(())
}

/// Has the program read on; the planner offers the path by itself.
async fn go_on(
    driver: &RemoteDriver,
    loader: &Client<ContinueProgram>,
    paths: &Paths,
    found: ProbesOfRun,
) {
    let ProbesOfRun { program_id, revision: of, results, .. } = found;
    let results = results.iter().map(Into::into).collect();
    let request = ContinueProgramRequest { program_id, results };
    let answer = match loader.call_idempotent(&request, PLANNED_WITHIN).await {
        Ok(answer) if answer.success => Ok(answer.program_id),
        Ok(answer) => Err(answer.message),
        Err(error) => Err(error.to_string()),
    };
    let continued = answer.clone();
    let _ = driver.ask(Command::ProgramContinued { of, answer }, REPLY_WITHIN).await;
    // A path that goes on from another is never one that a run can begin with.
    if let Ok(program_id) = continued
        && let Err(why) = paths.get(&program_id, PLANNED_WITHIN).await
    {
        let answer = Err(why);
        let _ = driver.ask(Command::ProgramContinued { of, answer }, REPLY_WITHIN).await;
    }
}
