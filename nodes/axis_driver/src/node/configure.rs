//! `configure_controller`: what of the controller's settings improves the watch over the link.

use super::{REPLY_WITHIN, RemoteDriver, reply_fields};
use crate::driver::Command;
use cnc_msgs::interface::Service;
use cnc_msgs::wire::cnc_msgs::srv::{ConfigureController, ConfigureControllerResponse};
use runtime::commands::Answer;
use runtime::{Handle, NodeResult, RequestInfo};
use std::sync::Arc;

/// Offers the service.
pub(super) fn offer(node: &Handle, driver: &Arc<RemoteDriver>) -> NodeResult {
    const NAME: &str = "configure_controller";
    let driver = Arc::clone(driver);
    node.concurrent_service::<ConfigureController, _, _>(
        NAME,
        move |request, info: RequestInfo| {
            let driver = Arc::clone(&driver);
            async move {
                let command = Command::Configure { write: request.write };
                let (success, error_code, message) =
                    reply_fields(driver.ask(command, REPLY_WITHIN).await);
                let answer = Answer { success, error_code, message: &message };
                let of = ConfigureController::TYPE_NAME;
                driver.commands.record(NAME, of, &info, &request, answer);
                ConfigureControllerResponse { success, error_code, message }
            }
        },
    )?;
    Ok(())
}
