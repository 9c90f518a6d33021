//! The buttons of the machine: services without arguments, and the hold by topic.

use super::edges::Edges;
use super::path::Paths;
use super::{REPLY_WITHIN, RemoteDriver, Reply, reply_fields};
use crate::driver::{Command, MDI, STILL_STOPPING};
use cnc_msgs::interface::{Message, Service};
use cnc_msgs::wire::std_msgs::msg::Bool;
use cnc_msgs::wire::std_srvs::srv::{SetBool, SetBoolResponse, Trigger, TriggerResponse};
use runtime::commands::Answer;
use runtime::{Handle, NodeResult, Qos, RequestInfo, SampleInfo, Subscription};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Time between two holds by topic, however many are wished; the first comes at once.
const WISH_PAUSE: Duration = Duration::from_millis(10);
/// How long a machine that is held may take to stand, and how often it is looked at.
const STANDS_WITHIN: Duration = Duration::from_secs(5);
const STANDS_PERIOD: Duration = Duration::from_millis(50);
/// Wishes that may wait: one of a peer must not be lost for the storm of another.
const WISHES_MAX: usize = 10_000;

/// The tool that was asked for is in the spindle: is it the one that was planned with?
pub(super) fn offer_tool_change(
    node: &Handle,
    driver: &Arc<RemoteDriver>,
    paths: &Paths,
) -> NodeResult {
    const NAME: &str = "confirm_tool_change";
    let (driver, paths) = (Arc::clone(driver), paths.clone());
    node.concurrent_service::<Trigger, _, _>(NAME, move |request, info: RequestInfo| {
        let (driver, paths) = (Arc::clone(&driver), paths.clone());
        async move {
            let (wanted, is_by_hand) = {
                let state = driver.state.borrow();
                (state.tool_wanted, state.program_id == MDI)
            };
            let objection = paths.objection(wanted, is_by_hand);
            let command = Command::ConfirmToolChange { objection };
            let (success, error_code, message) =
                reply_fields(driver.ask(command, REPLY_WITHIN).await);
            let answer = Answer { success, error_code, message: &message };
            driver.commands.record(NAME, Trigger::TYPE_NAME, &info, &request, answer);
            TriggerResponse { success, message }
        }
    })?;
    Ok(())
}

/// Offers the buttons, single block, and the hold by topic.
pub(super) fn offer(node: &Handle, driver: &Arc<RemoteDriver>) -> NodeResult {
    for (name, command) in [
        ("feed_hold", Command::FeedHold),
        ("soft_reset", Command::SoftReset),
        ("unlock", Command::Unlock),
        ("door_hold", Command::DoorHold),
        ("sleep", Command::Sleep),
        ("cancel", Command::CancelRun { run: None }),
    ] {
        let driver = Arc::clone(driver);
        node.concurrent_service::<Trigger, _, _>(name, move |request, info: RequestInfo| {
            let driver = Arc::clone(&driver);
            // Now, not when a task finds a processor: a hold may not wait for that.
            let asked = driver.begin(command.clone());
            async move {
                let (success, error_code, message) =
                    reply_fields(driver.answer(asked, REPLY_WITHIN).await);
                let answer = Answer { success, error_code, message: &message };
                driver.commands.record(name, Trigger::TYPE_NAME, &info, &request, answer);
                TriggerResponse { success, message }
            }
        })?;
    }
    let shared = Arc::clone(driver);
    node.concurrent_service::<Trigger, _, _>("resume", move |request, info: RequestInfo| {
        let driver = Arc::clone(&shared);
        async move {
            let (success, error_code, message) = reply_fields(resume(&driver).await);
            let answer = Answer { success, error_code, message: &message };
            driver.commands.record("resume", Trigger::TYPE_NAME, &info, &request, answer);
            TriggerResponse { success, message }
        }
    })?;
    let shared = Arc::clone(driver);
    node.service::<SetBool, _, _>("single_block", move |request, info: RequestInfo| {
        let driver = Arc::clone(&shared);
        async move {
            let reply = driver.ask(Command::SetSingleBlock(request.data), REPLY_WITHIN).await;
            let (success, error_code, message) = reply_fields(reply);
            let answer = Answer { success, error_code, message: &message };
            driver.commands.record("single_block", SetBool::TYPE_NAME, &info, &request, answer);
            SetBoolResponse { success, message }
        }
    })?;
    // Topics work across every middleware; a hold must.
    let holds = node.subscription::<Bool>("feed_hold", Qos::DEFAULT.with_depth(WISHES_MAX))?;
    node.spawn("feed_hold", hold_by_topic(Arc::clone(driver), holds));
    Ok(())
}

/// Resumes, as soon as the machine stands: who has seen HOLD need not know that it decelerates
/// yet. A wish to stop that comes meanwhile ends the wait.
async fn resume(driver: &RemoteDriver) -> Reply {
    let (stops, begun) = (driver.stops(), Instant::now());
    loop {
        let id = driver.next_id.fetch_add(1, Ordering::Relaxed);
        let reply = driver.ask_unless_stopped(stops, id, Command::Resume, REPLY_WITHIN).await;
        let is_stopping = matches!(&reply, Err(refusal) if refusal.message == STILL_STOPPING);
        if !is_stopping || begun.elapsed() > STANDS_WITHIN {
            return reply;
        }
        tokio::time::sleep(STANDS_PERIOD).await;
    }
}

async fn hold_by_topic(driver: Arc<RemoteDriver>, mut holds: Subscription<Bool>) {
    let (mut edges, mut wish) = (Edges::default(), None);
    loop {
        let (hold, info) = match wish.take() {
            Some(wish) => wish,
            None => {
                let (hold, info) = holds.next().await;
                if !edges.rises(info.publisher, hold.data) {
                    continue;
                }
                (hold, info)
            }
        };
        let reply = driver.ask(Command::FeedHold, REPLY_WITHIN).await;
        if reply.is_err() {
            // It did not hold: the next wish counts.
            edges.rises(info.publisher, false);
        }
        let (success, error_code, message) = reply_fields(reply);
        let answer = Answer { success, error_code, message: &message };
        driver.commands.record("feed_hold", Bool::TYPE_NAME, &info, &hold, answer);
        wish = gather(&mut holds, &mut edges).await;
    }
}

/// What is wished within [`WISH_PAUSE`] is one wish: the last that begins, if any does.
async fn gather(holds: &mut Subscription<Bool>, edges: &mut Edges) -> Option<(Bool, SampleInfo)> {
    let mut wish = None;
    let pause = tokio::time::sleep(WISH_PAUSE);
    tokio::pin!(pause);
    loop {
        tokio::select! {
            biased;
            () = &mut pause => return wish,
            (hold, info) = holds.next() => {
                if edges.rises(info.publisher, hold.data) {
                    wish = Some((hold, info));
                }
            }
        }
    }
}
