//! A run that waits where its program reads what its probes have found: the loader reads the program on.

use super::path::Paths;
use super::{REPLY_WITHIN, RemoteDriver};
use crate::driver::{Command, ProbesOfRun};
use cnc_msgs::wire::cnc_msgs::srv::{ContinueProgram, ContinueProgramRequest};
use runtime::{CallError, Client, Handle, NodeError};
use std::sync::Arc;
use std::time::Duration;

/// How long the loader may take; the driver waits no longer.
const READ_WITHIN: Duration = Duration::from_secs(60);
/// The driver does not wait so long for the planner.
const RUN_ENDS_WITHIN: Duration = Duration::from_secs(3600);

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
    let ProbesOfRun { program_id, revision: of, measured, .. } = found;
    let results = measured.probes.iter().map(Into::into).collect();
    let request = ContinueProgramRequest { program_id, results, inputs: measured.inputs };
    // It is not sent again by the clock: each copy would be read, and one could come after the run.
    let mut answer = loader.call_within(request.clone(), READ_WITHIN).await;
    if matches!(answer, Err(CallError::Lost { .. })) {
        answer = loader.call_within(request, READ_WITHIN).await;
    }
    let answer = match answer {
        Ok(answer) if answer.success => Ok(answer.program_id),
        Ok(answer) => Err(answer.message),
        Err(error) => Err(error.to_string()),
    };
    let say = |answer| async move {
        let _ = driver.ask(Command::ProgramContinued { of, answer }, REPLY_WITHIN).await;
    };
    say(answer.clone()).await;
    let Ok(program_id) = answer else { return };
    // The path may have come before the answer.
    if let Some(planned) = paths.rest(of, &program_id) {
        driver.replan(paths, of, planned).await;
    }
    // A path that goes on from another is never one that a run can begin with.
    let whole = paths.get(&program_id, RUN_ENDS_WITHIN).await;
    let why = whole.map_or_else(
        |why| why,
        |_| {
            "it was planned as a whole, and not on from this run: was the planner restarted?".into()
        },
    );
    say(Err(why)).await;
}
