//! What is done by hand: the actions `home`, `jog` and `probe`, offsets and overrides.
//!
//! Requests are range-checked here as far as their types go; what a number means to
//! the machine the core judges.

use super::actions::{CANCEL_WITHIN, FEEDBACK_PERIOD, answer, ended};
use super::{Asked, REPLY_WITHIN, RemoteDriver, reply_fields};
use crate::codes::error_code;
use crate::driver::{
    Command, JogFrame, JogRequest, MoveResult, OffsetRequest, Overrides, ProbeRequest, Refusal,
    RunOutcome,
};
use cnc_msgs::convert::{further_from_wire, further_to_wire, mode_to_wire};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{AxisSet, Position};
use cnc_msgs::interface::{Action, Service};
use cnc_msgs::units::{
    degrees_from_rad, mm_per_min_from_m_per_s, point_from_position, position_from_point,
};
use cnc_msgs::wire::cnc_msgs::action::{
    Home, HomeFeedback, HomeResult, Jog, JogFeedback, JogGoal, JogResult, Probe, ProbeFeedback,
    ProbeGoal, ProbeResult,
};
use cnc_msgs::wire::cnc_msgs::srv::{
    SetOverrides, SetOverridesRequest, SetOverridesResponse, SetWorkOffset, SetWorkOffsetRequest,
    SetWorkOffsetResponse,
};
use cnc_msgs::wire::geometry_msgs::msg::Point;
use runtime::action::{Goal, GoalOffer, GoalOutcome, Unfinished};
use runtime::commands::Answer;
use runtime::{Handle, NodeResult, RequestInfo};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use tokio::sync::oneshot;

/// Longer than the driver's own limit.
const HOME_WITHIN: Duration = Duration::from_secs(2 * 3_600);

/// Offers all of it.
pub(super) fn offer(node: &Handle, driver: &Arc<RemoteDriver>) -> NodeResult {
    let mut homes = node.action_server::<Home>("home")?;
    for unfinished in homes.take_unfinished() {
        let driver = Arc::clone(driver);
        // One that was not accepted was not begun.
        if let Unfinished::Goal(goal) = unfinished {
            let id = goal.kept_tag();
            if !driver.is_of_before(id) {
                let message = "homing had not begun when the driver's ROS side ended".into();
                let error_code = error_code::NO_ANSWER;
                goal.end(GoalOutcome::Aborted, HomeResult { success: false, error_code, message });
                continue;
            }
            let asked = Asked { id, reply: driver.waiting().replies.wait(id) };
            node.spawn("homing", async move { follow_home(&driver, goal, asked).await });
        }
    }
    let (handle, shared) = (node.clone(), Arc::clone(driver));
    node.spawn("home", async move {
        while let Some(offer) = homes.next_goal().await {
            let driver = Arc::clone(&shared);
            handle.spawn("homing", async move { home(&driver, offer).await });
        }
    });
    offer_move::<Jog>(node, driver, "jog")?;
    offer_move::<Probe>(node, driver, "probe")?;
    offer_services(node, driver)
}

/// Homes; the driver's answer comes when the machine is home or cannot be.
async fn home(driver: &Arc<RemoteDriver>, offer: GoalOffer<Home>) {
    let (info, asked) = (offer.info(), offer.goal().clone());
    if let Err(refusal) = driver.require_active() {
        let message = refusal.message.clone();
        driver.commands.record("home", Home::TYPE_NAME, &info, &asked, answer(&Err(refusal)));
        return offer.reject(&message);
    }
    let id = driver.next_id.fetch_add(1, Ordering::Relaxed);
    offer.tag(id);
    let Some(goal) = offer.accept() else { return };
    let asked = driver.begin_as(id, Command::Home);
    follow_home(driver, goal, asked).await;
}

/// Follows homing to its end.
async fn follow_home(driver: &RemoteDriver, goal: Goal<Home>, asked: Asked) {
    let mut homed = std::pin::pin!(driver.answer(asked, HOME_WITHIN));
    let mut ticks = tokio::time::interval(FEEDBACK_PERIOD);
    let mut is_canceling = false;
    let reply = loop {
        tokio::select! {
            reply = &mut homed => break reply,
            () = goal.cancel_requested(), if !is_canceling => {
                // grbl hears nothing but a reset while it homes.
                is_canceling = true;
                let _ = driver.ask(Command::SoftReset, CANCEL_WITHIN).await;
            }
            _ = ticks.tick() => {
                goal.feedback(HomeFeedback { state: mode_to_wire(driver.state.borrow().mode) });
            }
        }
    };
    driver.commands.record("home", Home::TYPE_NAME, &goal.info(), goal.goal(), answer(&reply));
    let (outcome, result) = match reply {
        Ok(message) => {
            (GoalOutcome::Succeeded, HomeResult { success: true, error_code: 0, message })
        }
        Err(Refusal { error_code, message }) => (
            if is_canceling { GoalOutcome::Canceled } else { GoalOutcome::Aborted },
            HomeResult { success: false, error_code, message },
        ),
    };
    goal.end(outcome, result);
}

/// An action that moves axes by hand.
trait Move: Action<Result: Default> {
    fn command(goal: &Self::Goal) -> Result<Command, Refusal>;
    fn feedback(state: u8, machine_position: Point) -> Self::Feedback;
    fn result(result: MoveResult) -> Self::Result;
}

impl Move for Jog {
    fn command(goal: &JogGoal) -> Result<Command, Refusal> {
        let frame = match goal.frame {
            JogGoal::FRAME_RELATIVE => JogFrame::Relative,
            JogGoal::FRAME_WORK => JogFrame::Work,
            JogGoal::FRAME_MACHINE => JogFrame::Machine,
            frame => return invalid(format!("frame {frame} is not 1, 2 or 3")),
        };
        let further = further_axes("further_target", goal.further_axes, &goal.further_target)?;
        let (axes, target) = axes_and_place(goal.axes, &goal.target, further)?;
        let feed_mm_per_min = feed_per_min(goal.feed_rate, further)?;
        Ok(Command::Jog(JogRequest { frame, axes, target, feed_mm_per_min, further }))
    }

    fn feedback(state: u8, machine_position: Point) -> JogFeedback {
        JogFeedback { state, machine_position }
    }

    fn result(result: MoveResult) -> JogResult {
        JogResult {
            success: result.outcome == RunOutcome::Succeeded,
            error_code: result.error_code,
            message: result.message,
            machine_position: point(result.machine_position),
            further_axes: result.further.bits(),
            further_machine_position: further_to_wire(result.further),
        }
    }
}

impl Move for Probe {
    fn command(goal: &ProbeGoal) -> Result<Command, Refusal> {
        let further = further_axes("further_distance", goal.further_axes, &goal.further_distance)?;
        let (axes, distance) = axes_and_place(goal.axes, &goal.distance, further)?;
        let feed_mm_per_min = feed_per_min(goal.feed_rate, further)?;
        let (away, may_miss) = (goal.away, goal.may_miss);
        Ok(Command::Probe(ProbeRequest {
            axes,
            distance,
            feed_mm_per_min,
            away,
            may_miss,
            further,
        }))
    }

    fn feedback(state: u8, machine_position: Point) -> ProbeFeedback {
        ProbeFeedback { state, machine_position }
    }

    fn result(result: MoveResult) -> ProbeResult {
        ProbeResult {
            success: result.outcome == RunOutcome::Succeeded,
            error_code: result.error_code,
            message: result.message,
            found: result.found,
            machine_position: point(result.machine_position),
            work_position: point(result.work_position),
            further_axes: result.further.bits(),
            further_machine_position: further_to_wire(result.further),
        }
    }
}

/// mm/min of a goal in m/s; where axes turn, degrees/min of one in rad/s.
fn feed_per_min(feed_rate: f64, further: FurtherAxes) -> Result<f64, Refusal> {
    let per_min = match further.only_turns() {
        true => degrees_from_rad(feed_rate) * 60.0,
        false => mm_per_min_from_m_per_s(feed_rate),
    };
    finite("feed_rate", per_min)
}

fn offer_move<M: Move + 'static>(
    node: &Handle,
    driver: &Arc<RemoteDriver>,
    name: &'static str,
) -> NodeResult {
    let mut goals = node.action_server::<M>(name)?;
    for unfinished in goals.take_unfinished() {
        let driver = Arc::clone(driver);
        node.spawn(name, async move { go_on(&driver, unfinished).await });
    }
    let (handle, shared) = (node.clone(), Arc::clone(driver));
    node.spawn(name, async move {
        while let Some(offer) = goals.next_goal().await {
            let driver = Arc::clone(&shared);
            handle.spawn(name, async move { decide(&driver, name, offer).await });
        }
    });
    Ok(())
}

/// Goes on with a goal of the face before this one, where the driver took it up.
async fn go_on<M: Move>(driver: &Arc<RemoteDriver>, unfinished: Unfinished<M>) {
    let goal = match unfinished {
        Unfinished::Goal(goal) => Some(goal),
        Unfinished::Offer(offer) => {
            let id = offer.kept_tag();
            if id > 0 && driver.was_taken_up(id) {
                let goal = offer.accept();
                if goal.is_none() {
                    // It was canceled before it was accepted, and its client heard so.
                    let _ = driver.ask(Command::CancelRun { run: Some(id) }, CANCEL_WITHIN).await;
                }
                goal
            } else {
                // It may be taken up yet, and nobody would know of it.
                let _ = driver.ask(Command::CancelRun { run: Some(id) }, CANCEL_WITHIN).await;
                return offer.reject("the driver had not begun it when its ROS side ended");
            }
        }
    };
    if let Some(goal) = goal {
        let id = goal.kept_tag();
        let finished = driver.waiting().moves.wait(id);
        follow(driver, id, goal, finished).await;
    }
}

/// Accepts a goal when the driver does, and follows it to its end.
async fn decide<M: Move>(driver: &Arc<RemoteDriver>, name: &str, offer: GoalOffer<M>) {
    let id = driver.next_id.fetch_add(1, Ordering::Relaxed);
    offer.tag(id);
    let finished = driver.waiting().moves.wait(id);
    let reply = match M::command(offer.goal()) {
        Ok(command) => {
            driver.note_who_begins(offer.info().writer).await;
            driver.ask_as(id, command, REPLY_WITHIN).await
        }
        Err(refusal) => Err(refusal),
    };
    driver.commands.record(name, M::TYPE_NAME, &offer.info(), offer.goal(), answer(&reply));
    let cancel = || driver.ask(Command::CancelRun { run: Some(id) }, CANCEL_WITHIN);
    match reply {
        Err(refusal) => {
            if refusal.error_code == error_code::NO_ANSWER {
                // It may be taken up yet, and nobody would know of it.
                let _ = cancel().await;
            }
            driver.waiting().moves.forget(id);
            offer.reject(&refusal.message);
        }
        Ok(_) => match offer.accept() {
            Some(goal) => follow(driver, id, goal, finished).await,
            None => {
                tracing::error!("the {name} was accepted too late and is canceled");
                let _ = cancel().await;
            }
        },
    }
}

async fn follow<M: Move>(
    driver: &RemoteDriver,
    id: u64,
    goal: Goal<M>,
    finished: oneshot::Receiver<MoveResult>,
) {
    let feedback = |driver: &RemoteDriver| {
        let state = driver.state.borrow();
        M::feedback(mode_to_wire(state.mode), point(state.machine_position))
    };
    let (result, is_canceling) = ended(driver, id, &goal, finished, feedback).await;
    let result = result.unwrap_or_else(|| MoveResult {
        id,
        outcome: RunOutcome::Aborted,
        error_code: error_code::LINK_LOST,
        message: "the driver stopped; motion may continue".into(),
        machine_position: None,
        work_position: None,
        further: FurtherAxes::NONE,
        found: false,
    });
    let outcome = match result.outcome {
        RunOutcome::Succeeded => GoalOutcome::Succeeded,
        // Only what somebody canceled can end so.
        RunOutcome::Canceled if is_canceling => GoalOutcome::Canceled,
        RunOutcome::Canceled | RunOutcome::Aborted => GoalOutcome::Aborted,
    };
    goal.end(outcome, M::result(result));
}

fn offer_services(node: &Handle, driver: &Arc<RemoteDriver>) -> NodeResult {
    let shared = Arc::clone(driver);
    node.concurrent_service::<SetOverrides, _, _>(
        "set_overrides",
        move |request, info: RequestInfo| {
            let driver = Arc::clone(&shared);
            async move {
                let (success, error_code, message) = reply_fields(match overrides(&request) {
                    Ok(wanted) => driver.ask(Command::SetOverrides(wanted), REPLY_WITHIN).await,
                    Err(refusal) => Err(refusal),
                });
                let answer = Answer { success, error_code, message: &message };
                let of = SetOverrides::TYPE_NAME;
                driver.commands.record("set_overrides", of, &info, &request, answer);
                SetOverridesResponse { success, error_code, message }
            }
        },
    )?;
    let shared = Arc::clone(driver);
    node.concurrent_service::<SetWorkOffset, _, _>(
        "set_work_offset",
        move |request, info: RequestInfo| {
            let driver = Arc::clone(&shared);
            async move {
                let (success, error_code, message) = reply_fields(match offset(&request) {
                    Ok(request) => driver.ask(Command::SetWorkOffset(request), REPLY_WITHIN).await,
                    Err(refusal) => Err(refusal),
                });
                let answer = Answer { success, error_code, message: &message };
                let of = SetWorkOffset::TYPE_NAME;
                driver.commands.record("set_work_offset", of, &info, &request, answer);
                SetWorkOffsetResponse { success, error_code, message }
            }
        },
    )?;
    Ok(())
}

fn overrides(request: &SetOverridesRequest) -> Result<Overrides, Refusal> {
    let of = |bit: u8, name: &str, ratio: f64| {
        if request.which & bit == 0 {
            return Ok(None);
        }
        let percent = (finite(name, ratio)? * 100.0).round();
        match percent {
            // The range makes it fit.
            0.0..=255.0 => Ok(Some(percent as u8)),
            _ => invalid(format!("the {name} override {ratio} is not between 0.1 and 2")),
        }
    };
    if request.which > 0b111 {
        return invalid(format!("which is {}; only bits 0 to 2 have a meaning", request.which));
    }
    Ok(Overrides {
        feed: of(0b001, "feed", request.feed)?,
        rapid: of(0b010, "rapid", request.rapid)?,
        spindle: of(0b100, "spindle", request.spindle)?,
    })
}

fn offset(request: &SetWorkOffsetRequest) -> Result<OffsetRequest, Refusal> {
    let further =
        further_axes("further_position", request.further_axes, &request.further_position)?;
    let (axes, position) = axes_and_place(request.axes, &request.position, further)?;
    let (system, is_origin) = (request.system, request.is_origin);
    Ok(OffsetRequest { system, axes, position, is_origin, further })
}

fn further_axes(field: &'static str, named: u8, values: &[f64]) -> Result<FurtherAxes, Refusal> {
    if usize::try_from(named.count_ones()) != Ok(values.len()) {
        return invalid(format!(
            "{field} has {} values, and further_axes {named} names {} axes",
            values.len(),
            named.count_ones()
        ));
    }
    further_from_wire(field, named, values).or_else(|error| invalid(error.to_string()))
}

/// The axes that a request names, and its numbers for them; others are 0.
fn axes_and_place(
    bits: u8,
    point: &Point,
    further: FurtherAxes,
) -> Result<(AxisSet, Position), Refusal> {
    if bits == 0 && further.is_empty() || bits > 0b111 {
        return invalid(format!("axes is {bits}; bit 0 is X, bit 1 is Y, bit 2 is Z"));
    }
    let axes = AxisSet::from_bits(bits);
    let mut position = position_from_point(point);
    for axis in 0..3 {
        position[axis] = match axes.contains(axis) {
            true => finite(["x", "y", "z"][axis], position[axis])?,
            false => 0.0,
        };
    }
    Ok((axes, position))
}

fn finite(name: &str, value: f64) -> Result<f64, Refusal> {
    match value.is_finite() {
        true => Ok(value),
        false => invalid(format!("{name} is {value}, which is not a number")),
    }
}

fn invalid<T>(message: String) -> Result<T, Refusal> {
    Err(Refusal { error_code: error_code::INVALID_REQUEST, message })
}

fn point(position: Option<Position>) -> Point {
    point_from_position(position.unwrap_or([f64::NAN; 3]))
}
