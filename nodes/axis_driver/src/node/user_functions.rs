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

/// How long a node that offers the service may take to be found, and to say whether it knows all functions:
/// a goal has to be decided on within four seconds.
const FOUND_WITHIN: Duration = Duration::from_millis(500);
const KNOWN_WITHIN: Duration = Duration::from_secs(1);
/// Nobody waits so long for an answer.
const FOR_EVER: Duration = Duration::from_secs(30 * 24 * 3600);

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
    let answer = match one_server(driver) {
        // It is sent once: nobody knows whether a request without an answer has been heard. The core
        // decides how long that may take.
        Ok(()) => {
            let request = request(&program_id, line, function);
            driver.user_functions.call_within(request, FOR_EVER).await.map_err(
                |error| match error {
                    CallError::NoAnswer { .. } | CallError::Lost { .. } => {
                        format!("{error}; whether it was done is not known")
                    }
                    _ => error.to_string(),
                },
            )
        }
        Err(why) => Err(why),
    };
    let answer = answer.and_then(said);
    let command = Command::UserFunctionEnded { run, call, answer: answer.clone() };
    if let Err(refusal) = driver.ask(command, REPLY_WITHIN).await {
        let end = match answer {
            Ok(_) => "is done".to_owned(),
            Err(why) => format!("is not done ({why})"),
        };
        tracing::warn!("{function} of line {line} {end}: {}", refusal.message);
    }
}

/// Asks whether the functions of a path would be done, as far as they are in this line or after it.
///
/// # Errors
/// The first that would not, with its line.
pub(super) async fn check(
    driver: &RemoteDriver,
    program_id: &str,
    functions: &[CalledFunction],
    start_line: u32,
) -> Result<(), Refusal> {
    if driver.node.parameter::<i64>("user_function_s_max") == 0 {
        // The core refuses each.
        return Ok(());
    }
    let client = &driver.user_functions;
    let left: Vec<CalledFunction> =
        functions.iter().filter(|it| it.last_line >= start_line).copied().collect();
    if left.is_empty() {
        return Ok(());
    }
    let is_offered = client.wait_for_server(FOUND_WITHIN).await;
    let end = tokio::time::Instant::now() + KNOWN_WITHIN;
    for CalledFunction { function, line, .. } in left {
        let request =
            CallUserFunctionRequest { check_only: true, ..request(program_id, line, function) };
        let within = end.saturating_duration_since(tokio::time::Instant::now());
        let known = match is_offered {
            true => match client.call_within(request, within).await {
                Ok(answer) => said(answer).and_then(|_| one_server(driver)),
                Err(error) => {
                    Err(format!("{error}; its node was only asked whether it would do it"))
                }
            },
            false => Err(format!(
                "nobody offers {}: start the node of the cell that does such functions, in this ROS_DOMAIN_ID and \
                 namespace",
                client.name()
            )),
        };
        if let Err(why) = known {
            let message = format!("line {line}: {function}: {why}");
            return Err(Refusal { error_code: error_code::USER_FUNCTION, message });
        }
    }
    Ok(())
}

/// What an answer says.
fn said(answer: CallUserFunctionResponse) -> Result<String, String> {
    match answer {
        CallUserFunctionResponse { success: true, message } => Ok(message),
        CallUserFunctionResponse { message, .. } if message.is_empty() => {
            Err("its node refuses it, and does not say why".into())
        }
        CallUserFunctionResponse { message, .. } => Err(message),
    }
}

/// Each of several servers would do it.
fn one_server(driver: &RemoteDriver) -> Result<(), String> {
    let client = &driver.user_functions;
    match client.servers() {
        0 | 1 => Ok(()),
        count => Err(format!(
            "{count} nodes offer {}, and each would do it: end all but one",
            client.name()
        )),
    }
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
