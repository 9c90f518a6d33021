//! Parameters that change while the driver runs.
//!
//! Only between works: a run keeps the parameters that it was begun with.

use super::parameters::check_approach;
use super::{REPLY_WITHIN, RemoteDriver};
use crate::codes::error_code;
use crate::driver::{Command, DriverConfig};
use cnc_msgs::machine::Mode;
use runtime::Handle;
use runtime::parameters::ParameterValue;
use std::sync::Arc;
use std::time::Duration;

/// Time until parameters are offered again to a driver that had begun something.
const AGAIN_AFTER: Duration = Duration::from_millis(200);

/// Refuses changes while something moves, and hands all others to the core.
/// `is_tuned`: the core may have others than those of the start.
pub(super) fn follow(node: &Handle, driver: &Arc<RemoteDriver>, is_tuned: bool) {
    let (shared, handle) = (Arc::clone(driver), node.clone());
    node.guard_parameters(move |changes| match shared.state.borrow().mode {
        Mode::Run
        | Mode::Hold
        | Mode::Jog
        | Mode::Home
        | Mode::Door
        | Mode::ToolChange
        | Mode::Check
            if changes.iter().any(|(name, _)| name != "use_sim_time") =>
        {
            Err("the machine is at work: set it when the machine is idle".to_owned())
        }
        _ => check_approach(|name| {
            let changed = changes.iter().find(|(changed, _)| changed == name);
            changed.map_or_else(|| handle.parameter(name), |(_, value)| value.clone())
        }),
    });
    let (handle, driver, mut changes) =
        (node.clone(), Arc::clone(driver), node.parameter_changes());
    node.spawn("parameters", async move {
        let keep_out = &driver.keep_out;
        let config = || DriverConfig {
            keep_out: keep_out.clone(),
            ..DriverConfig::from_parameters(|name| handle.parameter::<ParameterValue>(name))
        };
        let mut taken = (!is_tuned).then(config);
        loop {
            let config = config();
            if taken.as_ref() != Some(&config) {
                let command = Command::SetConfig(Box::new(config.clone()));
                match driver.ask(command, REPLY_WITHIN).await {
                    Ok(_) => taken = Some(config),
                    Err(refusal) => {
                        if refusal.error_code != error_code::BUSY {
                            tracing::warn!("parameters: {}", refusal.message);
                        }
                        tokio::time::sleep(AGAIN_AFTER).await;
                        continue;
                    }
                }
            }
            if changes.changed().await.is_err() {
                break;
            }
        }
    });
}
