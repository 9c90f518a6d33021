//! `~/get_logger_levels` and `~/set_logger_levels`: log levels, for other nodes.
//!
//! rclcpp offers them with `enable_logger_service`; here they are always available.
//! `log_levels` has the levels themselves.

use crate::command_line::arguments::LogLevel;
use crate::command_line::log_levels::LiveLevels;
use crate::endpoints::error::NodeError;
use crate::endpoints::node::Handle;
use crate::managed::logging::number_of;
use cnc_msgs::wire::rcl_interfaces::msg::{LoggerLevel, SetLoggerLevelsResult};
use cnc_msgs::wire::rcl_interfaces::srv;
use std::future::ready;
use std::sync::Arc;

/// Offers both.
pub(crate) fn serve(node: &Handle, levels: &Arc<LiveLevels>) -> Result<(), NodeError> {
    let live = Arc::clone(levels);
    node.service::<srv::GetLoggerLevels, _, _>("~/get_logger_levels", move |request, _| {
        let levels = request.names.into_iter().map(|name| {
            // Without a level of its own: unset, as in rcl.
            let level = live.get(&name).map_or(0, |level| u32::from(number_of(level)));
            LoggerLevel { name, level }
        });
        ready(srv::GetLoggerLevelsResponse { levels: levels.collect() })
    })?;
    let live = Arc::clone(levels);
    node.service::<srv::SetLoggerLevels, _, _>("~/set_logger_levels", move |request, info| {
        let results = request.levels.iter().map(|LoggerLevel { name, level }| {
            let result = level_of(*level).and_then(|level| live.set(name, level));
            match &result {
                Ok(()) => tracing::info!("{} sets logger \"{name}\" to {level}", info.client),
                Err(reason) => tracing::warn!("logger \"{name}\" stays as it is: {reason}"),
            }
            SetLoggerLevelsResult {
                successful: result.is_ok(),
                reason: result.err().unwrap_or_default(),
            }
        });
        ready(srv::SetLoggerLevelsResponse { results: results.collect() })
    })
}

/// The level of a number; `None` lets a logger inherit one.
fn level_of(number: u32) -> Result<Option<LogLevel>, String> {
    use LogLevel::{Debug, Error, Fatal, Info, Warn};
    if number == 0 {
        return Ok(None);
    }
    let known = [Debug, Info, Warn, Error, Fatal];
    let found = known.into_iter().find(|level| u32::from(number_of(*level)) == number);
    found.map(Some).ok_or_else(|| {
        format!(
            "{number} is not a level: 0 inherits one, 10 is debug, 20 info, 30 warn, 40 error, \
             50 fatal"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_a_level_or_is_refused() {
        let table = [
            (0, Some(None)),
            (10, Some(Some(LogLevel::Debug))),
            (30, Some(Some(LogLevel::Warn))),
            (50, Some(Some(LogLevel::Fatal))),
            (1, None),
            (60, None),
            (u32::MAX, None),
        ];
        for (number, expected) in table {
            assert_eq!(level_of(number).ok(), expected, "{number}");
        }
    }
}
