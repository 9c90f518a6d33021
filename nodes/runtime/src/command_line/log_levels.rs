//! The level of each logger; it can change while a node runs.
//!
//! As in rcl: a logger without a level of its own has that of the nearest logger above
//! it, by the dots in their names, and then the default. Which level a message has, and
//! where it goes, is in `logging`.

use crate::command_line::arguments::{Arguments, LogLevel};
use crate::command_line::names::Names;
use crate::process::lock;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, Mutex};

/// Loggers that may have a level: a node has one, with a few above it.
const LOGGERS_MAX: usize = 64;
/// The longest name of a logger, bytes.
const LOGGER_BYTES_MAX: usize = 512;

/// What is logged, and where.
#[derive(Debug, Clone)]
pub struct LogSettings {
    /// `cell.mill.driver`.
    pub logger: String,
    /// Less important messages are left out.
    pub(crate) levels: Arc<LiveLevels>,
    pub to_console: bool,
    pub to_rosout: bool,
}

impl LogSettings {
    /// From the arguments.
    pub(crate) fn new(arguments: &Arguments, names: &Names) -> Self {
        let logger = names.logger();
        let levels = LiveLevels::new(logger.clone(), LogLevels::new(arguments, names));
        Self {
            logger,
            levels: Arc::new(levels),
            to_console: !arguments.disable_console,
            to_rosout: !arguments.disable_rosout,
        }
    }
}

/// The levels of all loggers that have one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct LogLevels {
    default: LogLevel,
    loggers: BTreeMap<String, LogLevel>,
}

impl LogLevels {
    /// As the arguments say, the later over the earlier. The node's base name stands for
    /// its logger, so that users need not know its namespace.
    pub(crate) fn new(arguments: &Arguments, names: &Names) -> Self {
        let mut levels = Self { default: LogLevel::Info, loggers: BTreeMap::new() };
        for argument in &arguments.log_levels {
            match argument.logger.as_deref() {
                None => levels.set("", argument.level),
                Some(logger) if logger == names.node() => {
                    levels.set(&names.logger(), argument.level);
                }
                Some(logger) => levels.set(logger, argument.level),
            }
        }
        levels
    }

    /// Gives a logger a level, or with none lets it inherit one; "" is the default.
    pub(crate) fn set(&mut self, logger: &str, level: Option<LogLevel>) {
        match (logger, level) {
            ("", level) => self.default = level.unwrap_or(LogLevel::Info),
            (logger, Some(level)) => drop(self.loggers.insert(logger.to_owned(), level)),
            (logger, None) => drop(self.loggers.remove(logger)),
        }
    }

    /// The level that a logger was given; "" is the default.
    pub(crate) fn get(&self, logger: &str) -> Option<LogLevel> {
        if logger.is_empty() { Some(self.default) } else { self.loggers.get(logger).copied() }
    }

    /// The level from which a logger writes.
    pub(crate) fn effective(&self, logger: &str) -> LogLevel {
        let mut name = logger;
        loop {
            if let Some(level) = self.loggers.get(name) {
                return *level;
            }
            match name.rsplit_once('.') {
                Some((above, _)) => name = above,
                None => return self.default,
            }
        }
    }
}

/// The levels of a running node, with a cached level of its own logger.
#[derive(Debug)]
pub(crate) struct LiveLevels {
    logger: String,
    levels: Mutex<LogLevels>,
    effective: AtomicU8,
}

impl LiveLevels {
    pub(crate) fn new(logger: String, levels: LogLevels) -> Self {
        let effective = AtomicU8::new(levels.effective(&logger) as u8);
        Self { logger, levels: Mutex::new(levels), effective }
    }

    /// Whether the node's logger writes messages of this level.
    pub(crate) fn writes(&self, level: LogLevel) -> bool {
        level as u8 >= self.effective.load(Ordering::Relaxed)
    }

    pub(crate) fn get(&self, logger: &str) -> Option<LogLevel> {
        lock(&self.levels).get(logger)
    }

    /// Takes effect with the next message.
    ///
    /// # Errors
    /// The name is too long, or more loggers have a level than are kept.
    pub(crate) fn set(&self, logger: &str, level: Option<LogLevel>) -> Result<(), String> {
        let mut levels = lock(&self.levels);
        let (is_full, bytes) = (levels.loggers.len() >= LOGGERS_MAX, logger.len());
        if bytes > LOGGER_BYTES_MAX && level.is_some() {
            return Err(format!(
                "the logger's name has {bytes} bytes, and may have {LOGGER_BYTES_MAX}"
            ));
        }
        if is_full && level.is_some() && levels.get(logger).is_none() {
            return Err(format!("no more than {LOGGERS_MAX} loggers may have a level"));
        }
        levels.set(logger, level);
        self.effective.store(levels.effective(&self.logger) as u8, Ordering::Relaxed);
        drop(levels);
        // `tracing` caches for each place whether its level is enabled.
        tracing::callsite::rebuild_interest_cache();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command_line::names::Remap;
    use LogLevel::{Debug, Error, Fatal, Info, Warn};

    fn levels(words: &str) -> LogLevels {
        let words: Vec<String> = words.split_whitespace().map(str::to_owned).collect();
        let ns = Remap::new("__ns", "/cell");
        let names = Names::new("driver", &[ns]).expect("valid");
        LogLevels::new(&Arguments::parse(&words).expect("valid"), &names)
    }

    #[test]
    fn the_nearest_logger_that_has_a_level_decides() {
        let table = [
            ("", Info),
            ("--log-level debug", Debug),
            ("--log-level debug --log-level cell.driver:=error", Error),
            // The order does not matter, the name does.
            ("--log-level cell.driver:=error --log-level debug", Error),
            ("--log-level cell.driver:=error --log-level cell:=debug", Error),
            ("--log-level cell:=debug --log-level warn", Debug),
            ("--log-level driver:=warn", Warn),
            ("--log-level cell:=warn", Warn),
            ("--log-level cel:=warn --log-level planner:=error", Info),
            ("--log-level cell.driver.link:=debug", Info),
            // Of the same logger the last counts.
            ("--log-level driver:=debug --log-level cell.driver:=fatal", Fatal),
            ("--log-level warn --log-level error", Error),
            ("--log-level warn --log-level driver:=debug --log-level driver:=unset", Warn),
        ];
        for (words, expected) in table {
            let words = format!("--ros-args {words}");
            assert_eq!(levels(&words).effective("cell.driver"), expected, "{words}");
        }
    }

    #[test]
    fn a_level_is_of_the_logger_that_was_given_it() {
        let mut levels = levels("--ros-args --log-level cell:=warn");
        assert_eq!((levels.get(""), levels.get("cell")), (Some(Info), Some(Warn)));
        assert_eq!(levels.get("cell.driver"), None, "it inherits one");
        levels.set("", Some(Error));
        levels.set("cell", None);
        assert_eq!(levels.effective("cell.driver"), Error);
    }

    #[test]
    fn a_change_while_the_node_runs_takes_effect_at_once() {
        let live = LiveLevels::new("cell.driver".into(), levels("--ros-args"));
        assert!(live.writes(Info) && !live.writes(Debug));
        live.set("cell.driver", Some(Debug)).unwrap();
        assert!(live.writes(Debug));
        live.set("cell", Some(Fatal)).unwrap();
        assert!(live.writes(Debug), "its own level counts");
        live.set("cell.driver", None).unwrap();
        assert!(live.writes(Fatal) && !live.writes(Error));
    }
}
