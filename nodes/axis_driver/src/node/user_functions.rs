//! Functions of the user: has a node of the cell do what a run waits for.

use super::{REPLY_WITHIN, RemoteDriver};
use crate::codes::error_code;
use crate::driver::{Command, Refusal, UserFunctionCall};
use crate::encoder::{CalledFunction, UserFunction};
use cnc_msgs::wire::cnc_msgs::srv::{
    CallUserFunction, CallUserFunctionRequest, CallUserFunctionResponse,
};
use runtime::{CallError, Client, Handle, NodeError};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::mpsc;

/// How long the node may take to say whether it knows a function.
const KNOWN_WITHIN: Duration = Duration::from_secs(2);

/// The client of the node that does them.
pub(super) type UserFunctions = Client<CallUserFunction>;

pub(super) fn client(node: &Handle) -> Result<UserFunctions, NodeError> {
    node.client("user_function")
}

/// Has the functions done that runs ask for.
pub(super) fn follow(
    node: &Handle,
    driver: &Arc<RemoteDriver>,
    mut calls: mpsc::UnboundedReceiver<UserFunctionCall>,
) {
    let (driver, handle) = (Arc::clone(driver), node.clone());
    node.spawn("user functions", async move {
        while let Some(call) = calls.recv().await {
            let driver = Arc::clone(&driver);
            // One whose run was canceled does not hold up that of the next run.
            handle.spawn("user function", async move { serve(&driver, call).await });
        }
    });
}

async fn serve(driver: &RemoteDriver, call: UserFunctionCall) {
    let UserFunctionCall { run, call, program_id, line, function } = call;
    let request = request(&program_id, line, function);
    // It is sent once: nobody knows whether a request without an answer has been heard.
    let answer = match driver.user_functions.call_within(request, longest(driver)).await {
        Ok(CallUserFunctionResponse { success: true, message }) => Ok(message),
        Ok(CallUserFunctionResponse { message, .. }) => Err(message),
        Err(error) => Err(unanswered(&error)),
    };
    let command = Command::UserFunctionEnded { run, call, answer };
    if let Err(refusal) = driver.ask(command, REPLY_WITHIN).await {
        tracing::warn!("{function} of line {line} has ended: {}", refusal.message);
    }
}

/// Asks whether the functions of a path would be done.
///
/// # Errors
/// The first that would not, with its line.
pub(super) async fn check(
    driver: &RemoteDriver,
    program_id: &str,
    functions: &[CalledFunction],
) -> Result<(), Refusal> {
    if longest(driver).is_zero() {
        // The core refuses each.
        return Ok(());
    }
    for &CalledFunction { function, line } in functions {
        let request =
            CallUserFunctionRequest { check_only: true, ..request(program_id, line, function) };
        let answer = driver.user_functions.call_within(request, KNOWN_WITHIN).await;
        let why = match answer {
            Ok(CallUserFunctionResponse { success: true, .. }) => continue,
            Ok(answer) => answer.message,
            Err(error) => unanswered(&error),
        };
        let message = format!("line {line}: {function}: {why}");
        return Err(Refusal { error_code: error_code::USER_FUNCTION, message });
    }
    Ok(())
}

/// The longest that a function may take.
fn longest(driver: &RemoteDriver) -> Duration {
    let seconds = driver.node.parameter::<i64>("user_function_s_max");
    Duration::from_secs(u64::try_from(seconds).unwrap_or(0))
}

fn request(program_id: &str, line: u32, function: UserFunction) -> CallUserFunctionRequest {
    CallUserFunctionRequest {
        program_id: program_id.to_owned(),
        line,
        number: function.number,
        p: function.p.into_iter().collect(),
        q: function.q.into_iter().collect(),
        check_only: false,
    }
}

fn unanswered(error: &CallError) -> String {
    match error {
        CallError::NoServer { .. } => format!(
            "{error}; functions of the user are done by a node of the cell that offers this service"
        ),
        _ => format!("{error}; whether it was done is not known"),
    }
}
