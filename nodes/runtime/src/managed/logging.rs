//! The log: one line per message on the console, and `/rosout`.
//!
//! Everything that is logged through `tracing` comes here, except what the DDS
//! layers and Zenoh log. Logging never blocks: lines that `/rosout` cannot take are
//! on the console only. A place in the code that logs too often is throttled, so that no
//! peer can fill a disk.

use crate::command_line::arguments::LogLevel;
use crate::command_line::log_levels::LogSettings;
use crate::endpoints::error::NodeError;
use crate::endpoints::node::Handle;
use crate::managed::log_throttle::Throttle;
use crate::process::console::{log_line, write};
use crate::process::lock;
use crate::process::time::RosTime;
use crate::samples::qos::Qos;
use cnc_msgs::wire::rcl_interfaces::msg::Log;
use intake::text::one_line;
use std::fmt::Write as _;
use std::sync::Mutex;
use std::time::Instant;
use tokio::sync::mpsc;
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;

/// Lines that may wait for `/rosout`.
const WAITING_MAX: usize = 1000;
/// A longer line is cut on `/rosout`, in bytes.
const LINE_MAX: usize = 16 * 1024;

impl LogSettings {
    /// Makes this the log of a process that is no node itself: nothing goes to `/rosout`.
    pub fn install_console(&self) {
        drop(Self { to_rosout: false, ..self.clone() }.install());
    }

    /// Makes this the log of the process; the first one stays. Returns the
    /// lines for `/rosout`.
    pub(crate) fn install(&self) -> Lines {
        let (sender, lines) = mpsc::channel(WAITING_MAX);
        let layer = RosLog {
            settings: self.clone(),
            rosout: self.to_rosout.then_some(sender),
            throttle: Mutex::default(),
        };
        // Another log is installed already in tests and in `kerf`.
        drop(tracing_subscriber::registry().with(layer).try_init());
        Lines(lines)
    }
}

/// The lines that go to `/rosout`.
#[derive(Debug)]
pub(crate) struct Lines(mpsc::Receiver<Log>);

impl Lines {
    /// Publishes them as long as the node lives.
    pub(crate) fn publish(mut self, handle: &Handle) -> Result<(), NodeError> {
        let publisher = handle.publisher::<Log>("/rosout", Qos::ROSOUT)?;
        let clock = handle.clone();
        handle.spawn("rosout", async move {
            while let Some(mut line) = self.0.recv().await {
                let (sec, nanosec) = clock.now().parts();
                (line.stamp.sec, line.stamp.nanosec) = (sec, nanosec);
                publisher.publish(line);
            }
        });
        Ok(())
    }
}

struct RosLog {
    settings: LogSettings,
    rosout: Option<mpsc::Sender<Log>>,
    throttle: Mutex<Throttle>,
}

impl<S: Subscriber> Layer<S> for RosLog {
    fn enabled(&self, metadata: &tracing::Metadata<'_>, _: Context<'_, S>) -> bool {
        let target = metadata.target();
        let is_noise = ["rustdds", "ros2_client", "mio", "tokio"]
            .iter()
            .any(|noise| target.strip_prefix(noise).is_some_and(|rest| !rest.starts_with('_')))
            // Many crates, whose names all begin so.
            || target.starts_with("zenoh");
        !is_noise && self.settings.levels.writes(level_of(*metadata.level()).0)
    }

    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let (level, name) = level_of(*event.metadata().level());
        let place = (event.metadata().file().unwrap_or(""), event.metadata().line().unwrap_or(0));
        let Some(left_out) = lock(&self.throttle).admit(place, Instant::now()) else { return };
        let mut text = Text::default();
        event.record(&mut text);
        // It may hold names and texts of peers: escaped, so that none can add a line.
        let mut text = one_line(&text.finish()).into_owned();
        if left_out > 0 {
            // Writing to a string does not fail.
            let _ = write!(text, " ({left_out} lines like this were left out)");
        }
        if self.settings.to_console {
            let line = log_line(name, RosTime::wall(), &self.settings.logger, &text);
            write(&line);
        }
        if let Some(rosout) = &self.rosout {
            let log = Log {
                level: number_of(level),
                name: self.settings.logger.clone(),
                msg: cut(text, LINE_MAX),
                file: event.metadata().file().unwrap_or_default().to_owned(),
                function: event.metadata().target().to_owned(),
                line: event.metadata().line().unwrap_or_default(),
                ..Log::default()
            };
            drop(rosout.try_send(log));
        }
    }
}

fn cut(mut text: String, bytes: usize) -> String {
    if text.len() > bytes {
        let end = (0..=bytes).rev().find(|end| text.is_char_boundary(*end)).unwrap_or(0);
        text.truncate(end);
        text.push_str(" ...");
    }
    text
}

fn level_of(level: Level) -> (LogLevel, &'static str) {
    match level {
        Level::ERROR => (LogLevel::Error, "ERROR"),
        Level::WARN => (LogLevel::Warn, "WARN"),
        Level::INFO => (LogLevel::Info, "INFO"),
        Level::DEBUG | Level::TRACE => (LogLevel::Debug, "DEBUG"),
    }
}

/// As in `rcl_interfaces/Log`.
pub(crate) fn number_of(level: LogLevel) -> u8 {
    match level {
        LogLevel::Debug => Log::DEBUG,
        LogLevel::Info => Log::INFO,
        LogLevel::Warn => Log::WARN,
        LogLevel::Error => Log::ERROR,
        LogLevel::Fatal => Log::FATAL,
    }
}

/// The message of an event, then its other fields as `name=value`.
#[derive(Default)]
struct Text {
    message: String,
    fields: String,
}

impl Text {
    fn finish(self) -> String {
        self.message + &self.fields
    }
}

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        // Writing to a string does not fail.
        let _ = match field.name() {
            "message" => write!(self.message, "{value:?}"),
            name => write!(self.fields, " {name}={value:?}"),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn a_line_looks_as_rcl_writes_it() {
        let time = RosTime::from_parts(1_700_000_000, 1_234);
        let expected = "[WARN] [1700000000.000001234] [cell.driver]: link is lost\n";
        assert_eq!(log_line("WARN", time, "cell.driver", "link is lost"), expected);
    }

    #[test]
    fn a_long_line_is_cut_between_characters() {
        assert_eq!(cut("aä".to_owned(), 2), "a ...");
        assert_eq!(cut("aä".to_owned(), 3), "aä");
    }
}
