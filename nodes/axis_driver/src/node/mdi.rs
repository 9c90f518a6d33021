//! `execute_mdi`: one block from the operator's hand to the machine.
//!
//! The driver reads no program and plans no path. It asks the loader what the
//! block means and the planner where the tool goes, as services, and runs what
//! they answer from standstill to standstill, or nothing at all.

use super::actions::{CANCEL_WITHIN, PROVE_WITHIN};
use super::path::Paths;
use super::{RemoteDriver, Reply, reply_fields, user_functions};
use crate::codes::error_code;
use crate::driver::{Command, MDI, Refusal, RunOutcome};
use crate::encoder::CalledFunction;
use cnc_msgs::chunk::Collector;
use cnc_msgs::interface::Service;
use cnc_msgs::machine::Mode;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::units::point_from_position;
use cnc_msgs::wire::cnc_msgs::srv::{
    ExecuteMdi, ExecuteMdiRequest, ExecuteMdiResponse, PlanBlock, PlanBlockRequest, ReadBlock,
    ReadBlockRequest,
};
use runtime::commands::Answer;
use runtime::{CallError, Client, Handle, NodeResult, RequestInfo};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// How long loader and planner may take for one block.
const ASK_WITHIN: Duration = Duration::from_secs(5);

/// Those who know what a block means and where its path is.
struct Advisers {
    loader: Client<ReadBlock>,
    planner: Client<PlanBlock>,
}

/// Offers `execute_mdi`. The answer comes when the block is done.
pub(super) fn offer(node: &Handle, driver: &Arc<RemoteDriver>, paths: &Paths) -> NodeResult {
    let advisers = Arc::new(Advisers {
        loader: node.client::<ReadBlock>("read_block")?,
        planner: node.client::<PlanBlock>("plan_block")?,
    });
    let (driver, paths) = (Arc::clone(driver), paths.clone());
    node.concurrent_service::<ExecuteMdi, _, _>(
        "execute_mdi",
        move |request, info: RequestInfo| {
            let (driver, advisers) = (Arc::clone(&driver), Arc::clone(&advisers));
            let paths = paths.clone();
            async move {
                driver.note_who_begins(info.writer).await;
                let (success, error_code, message) =
                    reply_fields(execute(&driver, &advisers, &paths, &request).await);
                let answer = Answer { success, error_code, message: &message };
                driver.commands.record(
                    "execute_mdi",
                    ExecuteMdi::TYPE_NAME,
                    &info,
                    &request,
                    answer,
                );
                ExecuteMdiResponse { success, error_code, message }
            }
        },
    )?;
    Ok(())
}

fn refuse<T>(error_code: u16, message: impl Into<String>) -> Result<T, Refusal> {
    Err(Refusal { error_code, message: message.into() })
}

async fn execute(
    driver: &RemoteDriver,
    advisers: &Advisers,
    paths: &Paths,
    request: &ExecuteMdiRequest,
) -> Reply {
    driver.require_active()?;
    let stops = driver.stops();
    let state = driver.state_now();
    // The core looks again; this spares the others a block that cannot run.
    if !matches!(state.mode, Mode::Idle | Mode::ToolChange) {
        let reason = if state.reason.is_empty() { state.mode.name() } else { &state.reason };
        return refuse(error_code::BUSY, format!("the machine is not idle: {reason}"));
    }
    let Some(start) = state.work_position else {
        return refuse(error_code::START_POSITION, "the position of the tool is not known yet");
    };
    let (path, warnings) = advise(advisers, request, start).await?;
    user_functions::check(driver, MDI, &CalledFunction::all_of(&path), 0).await?;
    let is_still = path.elements.is_empty() && path.events.is_empty();
    let message = match warnings.as_slice() {
        [] => String::new(),
        warnings => format!("; {}", warnings.join("; ")),
    };
    if is_still {
        return Ok(format!("there is nothing to do{message}"));
    }
    let id = driver.next_id.fetch_add(1, Ordering::Relaxed);
    let finished = driver.waiting().runs.wait(id);
    let tool_diameters_mm = match driver.keep_out.keep_out.is_empty() {
        true => BTreeMap::new(),
        false => paths.diameters_in_force_mm(),
    };
    let command = Command::ExecuteMdi { path: Arc::new(path), tool_diameters_mm };
    if let Err(refusal) = driver.ask_unless_stopped(stops, id, command, PROVE_WITHIN).await {
        if refusal.error_code == error_code::NO_ANSWER {
            // It may be taken up yet, and nobody would know of it.
            let _ = driver.ask(Command::CancelRun { run: Some(id) }, CANCEL_WITHIN).await;
        }
        driver.waiting().runs.forget(id);
        return Err(refusal);
    }
    if !message.is_empty() {
        tracing::warn!("{}{message}", request.text.trim());
    }
    match finished.await {
        Ok(result) if result.outcome == RunOutcome::Succeeded => {
            Ok(format!("{}{message}", result.message))
        }
        Ok(result) => refuse(result.error_code, result.message),
        Err(_) => refuse(error_code::LINK_LOST, "the driver stopped; motion may continue"),
    }
}

/// The path of a block, and what loader and planner have to say of it.
async fn advise(
    advisers: &Advisers,
    request: &ExecuteMdiRequest,
    start: [f64; 3],
) -> Result<(CompensatedPath, Vec<String>), Refusal> {
    let silent = |who: &str, error: CallError| Refusal {
        error_code: error_code::NO_ANSWER,
        message: format!("{who}: {error}"),
    };
    let question = ReadBlockRequest {
        text: request.text.clone(),
        control: request.control.clone(),
        start: point_from_position(start),
    };
    let read = advisers.loader.call_within(question, ASK_WITHIN).await;
    let read = read.map_err(|error| silent("the loader", error))?;
    if !read.success {
        return refuse(error_code::BLOCK_REFUSED, read.message);
    }
    let question = PlanBlockRequest { contour: read.contour, chunks: read.chunks };
    let planned = advisers.planner.call_within(question, ASK_WITHIN).await;
    let planned = planned.map_err(|error| silent("the planner", error))?;
    if !planned.success {
        return refuse(error_code::BLOCK_REFUSED, planned.message);
    }
    let whole = || {
        let mut collector = Collector::for_path(&planned.path)?;
        for chunk in &planned.chunks {
            collector.add(chunk.clone())?;
        }
        collector.finish(&planned.path)
    };
    let path = whole().or_else(|error| refuse(error_code::BLOCK_REFUSED, error.to_string()))?;
    let said = [read.message, planned.message];
    Ok((path, said.into_iter().filter(|text| !text.is_empty()).collect()))
}
