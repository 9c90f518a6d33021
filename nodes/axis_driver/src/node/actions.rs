//! The action `run_program`: one goal at a time, always with a result.

use super::path::{Paths, Planned};
use super::run_start;
use super::source;
use super::user_functions;
use super::{RemoteDriver, Reply};
use crate::codes::error_code;
use crate::driver::{Command, MDI, Refusal, RunOutcome, RunResult};
use crate::journal::{Order, RunOrder};
use cnc_msgs::convert::mode_to_wire;
use cnc_msgs::interface::Action;
use cnc_msgs::wire::builtin_interfaces::msg::Duration as WireDuration;
use cnc_msgs::wire::cnc_msgs::action::{RunProgram, RunProgramFeedback, RunProgramResult};
use cnc_msgs::wire::cnc_msgs::msg::RunResult as RunResultMessage;
use cnc_msgs::wire::cnc_msgs::srv::PlanStart;
use cnc_msgs::wire::unique_identifier_msgs::msg::UUID;
use runtime::action::{Goal, GoalOffer, GoalOutcome, Unfinished};
use runtime::commands::Answer;
use runtime::{Client, Handle, NodeError};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use tokio::sync::oneshot;

/// How long a path that is on its way may take to arrive.
const PATH_WITHIN: Duration = Duration::from_millis(1_500);
/// How long proving that a path can be sent may take.
pub(super) const PROVE_WITHIN: Duration = Duration::from_millis(2_000);
/// How long a cancel may take to be answered; the run ends when the machine stands.
pub(super) const CANCEL_WITHIN: Duration = Duration::from_secs(10);
/// How often feedback goes out.
pub(super) const FEEDBACK_PERIOD: Duration = Duration::from_millis(100);

/// Offers `run_program`.
pub(super) fn offer(
    node: &Handle,
    driver: &Arc<RemoteDriver>,
    paths: Paths,
) -> Result<(), NodeError> {
    let mut runs = node.action_server::<RunProgram>("run_program")?;
    let planner = Arc::new(node.client::<PlanStart>("plan_start")?);
    for unfinished in runs.take_unfinished() {
        let shared = Arc::clone(driver);
        node.spawn("run of a program", async move { go_on(&shared, unfinished).await });
    }
    let (handle, shared) = (node.clone(), Arc::clone(driver));
    node.spawn("run_program", async move {
        while let Some(offer) = runs.next_goal().await {
            let (driver, paths) = (Arc::clone(&shared), paths.clone());
            let planner = Arc::clone(&planner);
            let run = async move { decide(&driver, &paths, &planner, offer).await };
            handle.spawn("run of a program", run);
        }
    });
    Ok(())
}

/// Goes on with a goal of the face before this one, where the driver took it up.
async fn go_on(driver: &Arc<RemoteDriver>, unfinished: Unfinished<RunProgram>) {
    let goal = match unfinished {
        Unfinished::Goal(goal) => goal,
        Unfinished::Offer(offer) => match (offer.kept_tag(), driver.was_taken_up(offer.kept_tag()))
        {
            (id @ 1.., true) => match offer.accept() {
                Some(goal) => goal,
                None => {
                    // It was canceled before it was accepted, and its client heard so.
                    let _ = driver.ask(Command::CancelRun { run: Some(id) }, CANCEL_WITHIN).await;
                    return;
                }
            },
            (id, _) => {
                // It may be taken up yet, and nobody would know of it.
                let _ = driver.ask(Command::CancelRun { run: Some(id) }, CANCEL_WITHIN).await;
                return offer.reject("the driver had not begun it when its ROS side ended");
            }
        },
    };
    let id = goal.kept_tag();
    let finished = driver.waiting().runs.wait(id);
    let _expected = (!goal.goal().check_only).then(|| driver.recorder.expect(&goal.id()));
    // Where the goal left it to the loader, the driver knows which program it took up.
    let program_id = match goal.goal().program_id.as_str() {
        "" => driver.state.borrow().program_id.clone(),
        given => given.to_owned(),
    };
    follow(driver, (id, program_id), goal, finished).await;
}

pub(super) fn answer(reply: &Reply) -> Answer<'_> {
    match reply {
        Ok(message) => Answer { success: true, error_code: 0, message },
        Err(Refusal { error_code, message }) => {
            Answer { success: false, error_code: *error_code, message }
        }
    }
}

/// Accepts a goal when the driver does, and follows it to its end.
async fn decide(
    driver: &Arc<RemoteDriver>,
    paths: &Paths,
    planner: &Client<PlanStart>,
    offer: GoalOffer<RunProgram>,
) {
    let id = driver.next_id.fetch_add(1, Ordering::Relaxed);
    offer.tag(id);
    let finished = driver.waiting().runs.wait(id);
    // What is only checked has no record; it may be checked while another runs.
    let _expected = (!offer.goal().check_only).then(|| driver.recorder.expect(&offer.id()));
    let (reply, program_id) = match begin(driver, paths, planner, id, &offer).await {
        Ok((message, program_id)) => (Ok(message), program_id),
        Err(refusal) => (Err(refusal), String::new()),
    };
    let (info, wanted) = (offer.info(), offer.goal().clone());
    let record = |reply: &Reply| {
        let answer = answer(reply);
        driver.commands.record("run_program", RunProgram::TYPE_NAME, &info, &wanted, answer);
    };
    match &reply {
        Err(refusal) => {
            record(&reply);
            if refusal.error_code == error_code::NO_ANSWER {
                // It may be taken up yet, and nobody would know of it.
                let _ = driver.ask(Command::CancelRun { run: Some(id) }, CANCEL_WITHIN).await;
            }
            driver.waiting().runs.forget(id);
            offer.reject(&refusal.message);
        }
        Ok(_) => match offer.accept() {
            Some(goal) => {
                record(&reply);
                follow(driver, (id, program_id), goal, finished).await;
            }
            None => {
                let message = "it was canceled, or decided on too late; its run is canceled";
                tracing::warn!("{message}");
                record(&Err(Refusal { error_code: error_code::CANCELED, message: message.into() }));
                let _ = driver.ask(Command::CancelRun { run: Some(id) }, CANCEL_WITHIN).await;
            }
        },
    }
}

/// Returns the message of the driver, and which program it runs.
async fn begin(
    driver: &RemoteDriver,
    paths: &Paths,
    planner: &Client<PlanStart>,
    id: u64,
    offer: &GoalOffer<RunProgram>,
) -> Result<(String, String), Refusal> {
    driver.require_active()?;
    let (goal, stops) = (offer.goal(), driver.stops());
    // Whoever has just loaded a program may be faster than its `program`: the loader knows which it is.
    let program_id = match goal.program_id.as_str() {
        "" => source::loaded(&driver.programs).await.unwrap_or_default(),
        given => given.to_owned(),
    };
    let planned = paths.get(&program_id, PATH_WITHIN).await;
    let planned = planned
        .map_err(|message| Refusal { error_code: RunProgramResult::UNKNOWN_PROGRAM, message })?;
    if ![0, planned.revision].contains(&goal.revision) {
        let message = format!(
            "revision {} of the plan was asked for, and the program was planned anew since: look at revision {}",
            goal.revision, planned.revision
        );
        return Err(Refusal { error_code: RunProgramResult::UNKNOWN_PROGRAM, message });
    }
    let in_span = run_start::ask(planner, &planned, (goal.start_line, goal.occurrence)).await?;
    user_functions::check(driver, &planned.program_id, &planned.functions, goal.start_line).await?;
    if offer.is_canceled() {
        let message = "it was canceled before it began".into();
        return Err(Refusal { error_code: error_code::CANCELED, message });
    }
    let Planned { program_id, revision, .. } = planned.clone();
    if program_id == MDI {
        let message = format!("{MDI} is the id of blocks entered by hand, not of a program");
        return Err(Refusal { error_code: RunProgramResult::UNKNOWN_PROGRAM, message });
    }
    driver.note_who_begins(offer.info().writer).await;
    let (start_line, check_only) = (goal.start_line, goal.check_only);
    let tool_diameters_mm = match driver.keep_out.keep_out.is_empty() {
        true => BTreeMap::new(),
        false => paths.diameters_mm(&planned),
    };
    let order = Order::Run(RunOrder {
        program_id: program_id.clone(),
        revision,
        start_line,
        occurrence: goal.occurrence,
        in_span,
        check_only,
        tool_diameters_mm,
    });
    let message = driver.ask_unless_stopped(stops, id, order, PROVE_WITHIN).await?;
    if !goal.check_only {
        paths.begin(&planned);
    }
    Ok((message, program_id))
}

async fn follow(
    driver: &RemoteDriver,
    (id, program_id): (u64, String),
    goal: Goal<RunProgram>,
    finished: oneshot::Receiver<RunResult>,
) {
    let (result, _) = ended(driver, id, &goal, finished, feedback).await;
    let Some(result) = result else {
        let result = RunProgramResult {
            outcome: RunProgramResult::OUTCOME_ABORTED,
            error_code: error_code::LINK_LOST,
            message: "the driver stopped; motion may continue".into(),
            ..RunProgramResult::default()
        };
        return end(driver, goal, program_id, GoalOutcome::Aborted, (result, 0));
    };
    let (outcome, code) = match result.outcome {
        RunOutcome::Succeeded => (GoalOutcome::Succeeded, RunProgramResult::OUTCOME_SUCCEEDED),
        RunOutcome::Canceled => (GoalOutcome::Canceled, RunProgramResult::OUTCOME_CANCELED),
        RunOutcome::Aborted => (GoalOutcome::Aborted, RunProgramResult::OUTCOME_ABORTED),
    };
    goal.feedback(feedback(driver));
    let text = match result.blamed_line {
        0 => None,
        line => source::text_of(&driver.programs, &program_id, line).await,
    };
    let message = match text {
        Some(text) => format!("{}; the block is {text:?}", result.message),
        None => result.message,
    };
    let (error_code, last_line) = (result.error_code, result.last_line);
    let answer = RunProgramResult { outcome: code, error_code, message, last_line };
    end(driver, goal, program_id, outcome, (answer, result.last_occurrence));
}

/// Ends a goal. The result of a run is on `run_result` too, for those who did not send the goal, with
/// which time its last line is run.
fn end(
    driver: &RemoteDriver,
    goal: Goal<RunProgram>,
    program_id: String,
    outcome: GoalOutcome,
    (result, last_occurrence): (RunProgramResult, u32),
) {
    if !goal.goal().check_only {
        let RunProgramResult { outcome, error_code, message, last_line } = result.clone();
        driver.run_results.publish(RunResultMessage {
            stamp: driver.node.now().into(),
            goal_id: UUID { uuid: goal.id().0 },
            program_id,
            outcome,
            error_code,
            message,
            last_line,
            last_occurrence,
            start_line: goal.goal().start_line,
            start_occurrence: goal.goal().occurrence,
        });
    }
    goal.end(outcome, result);
}

/// Waits for the end of a goal, gives feedback, and hands a cancel on; also says whether
/// one was asked for. `None` when the driver's thread is gone, and with it what it knew.
pub(super) async fn ended<A: Action, R>(
    driver: &RemoteDriver,
    id: u64,
    goal: &Goal<A>,
    finished: oneshot::Receiver<R>,
    feedback: impl Fn(&RemoteDriver) -> A::Feedback,
) -> (Option<R>, bool) {
    let mut finished = std::pin::pin!(finished);
    let mut ticks = tokio::time::interval(FEEDBACK_PERIOD);
    let mut is_canceling = false;
    let result = loop {
        tokio::select! {
            result = &mut finished => break result,
            () = goal.cancel_requested(), if !is_canceling => {
                is_canceling = true;
                let cancel = Command::CancelRun { run: Some(id) };
                if let Err(refusal) = driver.ask(cancel, CANCEL_WITHIN).await {
                    tracing::error!("the goal cannot be canceled: {}", refusal.message);
                }
            }
            _ = ticks.tick() => goal.feedback(feedback(driver)),
        }
    };
    (result.ok(), is_canceling)
}

fn feedback(driver: &RemoteDriver) -> RunProgramFeedback {
    let progress = *driver.progress.borrow();
    let left = Duration::try_from_secs_f64(progress.time_left_s).unwrap_or_default();
    RunProgramFeedback {
        line: progress.line,
        fraction: progress.fraction,
        time_left: WireDuration {
            sec: i32::try_from(left.as_secs()).unwrap_or(i32::MAX),
            nanosec: left.subsec_nanos(),
        },
        state: mode_to_wire(driver.state.borrow().mode),
    }
}
