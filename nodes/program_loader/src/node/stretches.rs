//! The stretches of a program that computes with what its probes have found.
//!
//! When the run has come so far, the driver asks for the text to be read again with the results at its end.
//! When the run has ended, the program is again what it was: the next run has results of its own.

use super::tools::ReadAgain;
use super::{Current, Loader, Refusal, id_of, refusal, refuse};
use crate::tool_rows::load_with_results;
use cnc_msgs::convert::WireError;
use cnc_msgs::interface::Service;
use cnc_msgs::probing::{Measured, ProbeResult};
use cnc_msgs::wire::cnc_msgs::msg::RunResult;
use cnc_msgs::wire::cnc_msgs::srv::{
    ContinueProgram, ContinueProgramRequest, ContinueProgramResponse,
};
use runtime::commands::{Answer, CommandLog};
use runtime::{Handle, NodeError, Qos};
use std::sync::Arc;

impl Loader {
    /// Reads the program of a run on, with what its probes have found. Asked again with the same results it
    /// answers the same, and does nothing.
    fn continue_program(&self, request: &ContinueProgramRequest) -> Result<String, Refusal> {
        type W = ContinueProgramResponse;
        self.node.require_active().or_else(|why| refuse(W::NOT_ACTIVE, why))?;
        let Some(current) = self.state().current.clone() else {
            let why = "no program is loaded: the loader was restarted since the run began";
            return refuse(W::UNKNOWN_PROGRAM, why);
        };
        let first = current.first();
        let is_meant = |it: &&Arc<ReadAgain>| it.probes && first.program_id == request.program_id;
        let Some(again) = first.again.as_ref().filter(is_meant) else {
            return refuse(W::UNKNOWN_PROGRAM, "another program was loaded since the run began");
        };
        let ReadAgain { name, text, profile, expected_tools, .. } = &**again;
        let results: Result<Vec<ProbeResult>, WireError> =
            request.results.iter().map(TryInto::try_into).collect();
        let results = results.or_else(|error| refuse(W::PROGRAM_REFUSED, error))?;
        let inputs = request.inputs.clone();
        let measured = Measured { probes: results, inputs };
        let tools = self.state().tools.clone();
        let (text, mut loaded) =
            load_with_results(text, &measured, profile, &self.options, tools.as_ref());
        let id = id_of(profile, &text);
        if id == current.program_id {
            return Ok(id);
        }
        loaded.allow_tools(expected_tools);
        if let Some(message) = refusal(name, &loaded) {
            return refuse(W::PROGRAM_REFUSED, message);
        }
        let Measured { probes, inputs } = &measured;
        let (probes, inputs) = (probes.len(), inputs.len());
        tracing::info!(
            "{name} is read again with {probes} results of probes and {inputs} of inputs"
        );
        self.remember_left(&first.program_id, &mut loaded);
        let read = self.current(name.clone(), text, profile, loaded);
        self.publish(Current { first: Some(Box::new(first.clone())), ..read });
        Ok(id)
    }

    /// A run has ended: the next one probes anew.
    fn begin_anew(&self, result: &RunResult) {
        let current = self.state().current.clone();
        let is_other = |it: &Current| it.program_id != result.program_id;
        match current {
            Some(Current { first: Some(first), .. }) if !is_other(&first) => self.publish(*first),
            // Loaded during that run, it may have been taken for what the run goes on with.
            Some(current)
                if current.again.as_ref().is_some_and(|it| it.probes) && is_other(&current) =>
            {
                self.publish(current);
            }
            _ => {}
        }
    }
}

/// Offers to read a program on, and follows the ends of runs. Only from now on: older results have nothing
/// to do with a program that is loaded later.
pub(super) fn offer(
    node: &Handle,
    loader: &Arc<Loader>,
    commands: &CommandLog,
) -> Result<(), NodeError> {
    let (shared, log) = (Arc::clone(loader), commands.clone());
    node.service::<ContinueProgram, _, _>("continue_program", move |request, info| {
        let (loader, log) = (Arc::clone(&shared), log.clone());
        async move {
            let asked = request.clone();
            let worker = Arc::clone(&loader);
            let _work = loader.work.lock().await;
            let read = tokio::task::spawn_blocking(move || worker.continue_program(&request)).await;
            type W = ContinueProgramResponse;
            let response = match read {
                Ok(Ok(program_id)) => W { success: true, program_id, ..W::default() },
                Ok(Err(Refusal { code, message })) => {
                    W { error_code: code, message, ..W::default() }
                }
                Err(error) => W { message: format!("the loader failed: {error}"), ..W::default() },
            };
            let answer = Answer {
                success: response.success,
                error_code: response.error_code,
                message: &response.message,
            };
            log.record("continue_program", ContinueProgram::TYPE_NAME, &info, &asked, answer);
            response
        }
    })?;
    let mut results = node.subscription::<RunResult>("run_result", Qos::DEFAULT)?;
    let loader = Arc::clone(loader);
    node.spawn("run results", async move {
        loop {
            let (result, _) = results.next().await;
            let worker = Arc::clone(&loader);
            // A program that is loaded now begins with what this run leaves.
            let _work = loader.work.lock().await;
            let done = tokio::task::spawn_blocking(move || {
                if let Some(file) = &worker.parameter_file {
                    file.finished(&result);
                }
                worker.begin_anew(&result);
            });
            if let Err(error) = done.await {
                tracing::error!("the end of a run was not followed: {error}");
            }
        }
    });
    Ok(())
}
