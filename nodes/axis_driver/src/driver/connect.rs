//! The phase `Connecting`: from an opened port to a controller that is known.
//!
//! Asks first: a machine that moves or holds is held and left to the operator, one
//! that stands still is reset (if the parameter says so), so that half lines and
//! modal words of an earlier session are gone. Then build, settings, words in force and
//! offsets are read, one question at a time (`questions`).

mod questions;

use super::answer::Refusal;
use super::context::Context;
use super::context::config::{ANSWER, CROSSING, LISTEN};
use super::context::queries::{QUERIES, SETTINGS_QUERY};
use super::next::Next;
use super::output::LogLevel;
use crate::codes::error_code;
use crate::link::LinkFault;
use crate::report::ControllerState;
use std::time::Duration;

/// Restarts tolerated while connecting.
const RESTARTS_MAX: u32 = 3;
/// Characters of garbage that are kept for the message.
const SAMPLE_CHARS: usize = 40;

/// Owns what is known of a controller that is still being identified: which question
/// is open, until when, and which soft reset waits for the outcome.
#[derive(Debug)]
pub(super) struct Connecting {
    step: ConnectStep,
    until: Duration,
    restarts: u32,
    garbage: usize,
    sample: String,
    /// The soft reset that began this.
    reply: Option<u64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum ConnectStep {
    Listening,
    AwaitingBanner,
    /// It has restarted by itself: lines that were on their way are still answered.
    PassingOver,
    Asking(usize),
    /// Every question is answered; the first status report is missing.
    AwaitingStatus,
}

impl Connecting {
    fn new(step: ConnectStep, until: Duration, reply: Option<u64>) -> Self {
        Self { step, until, restarts: 0, garbage: 0, sample: String::new(), reply }
    }

    /// Listens at a port that was just opened.
    pub(super) fn listen(context: &Context) -> Self {
        Self::new(ConnectStep::Listening, context.now + LISTEN, None)
    }

    /// Resets the controller, then asks for everything again.
    pub(super) fn reset(context: &mut Context, reply: Option<u64>) -> Self {
        context.link.send_reset(context.now);
        context.hold = None;
        context.drop_overrides("the controller is being reset");
        Self::new(ConnectStep::AwaitingBanner, context.now + ANSWER, reply)
    }

    /// Asks for everything again after a restart that the driver did not ask for.
    pub(super) fn after_restart(context: &mut Context) -> Self {
        context.link.distrust();
        Self::new(ConnectStep::PassingOver, context.now + CROSSING, None)
    }

    pub(super) fn until(&self) -> Duration {
        self.until
    }

    /// Whether nothing has been heard of what the controller does.
    pub(super) fn is_listening(&self) -> bool {
        self.step == ConnectStep::Listening
    }

    /// Whether a reset was sent and its start message has not come.
    pub(super) fn is_resetting(&self) -> bool {
        self.step == ConnectStep::AwaitingBanner
    }

    /// Whether the settings were answered, the unit of reports among them.
    pub(super) fn has_settings(&self) -> bool {
        match self.step {
            ConnectStep::Asking(query) => query > SETTINGS_QUERY,
            ConnectStep::AwaitingStatus => true,
            _ => false,
        }
    }

    /// The soft reset that waits for the outcome.
    pub(super) fn reply_to(&self) -> Option<u64> {
        self.reply
    }

    pub(super) fn describe(&self) -> String {
        match self.step {
            ConnectStep::Listening => "listening".into(),
            ConnectStep::AwaitingBanner => "waiting for the controller to start".into(),
            ConnectStep::PassingOver => "waiting for answers to lines of before".into(),
            ConnectStep::Asking(query) => format!("asking {}", QUERIES[query]),
            ConnectStep::AwaitingStatus => "waiting for a report".into(),
        }
    }

    pub(super) fn on_garbage(&mut self, text: &str) {
        self.garbage += 1;
        if self.sample.is_empty() {
            self.sample = text.chars().take(SAMPLE_CHARS).collect();
        }
    }

    /// Takes a status report, which is in the machine model already.
    pub(super) fn on_status(&mut self, context: &mut Context) -> Option<Next> {
        match self.step {
            ConnectStep::Listening => {}
            ConnectStep::AwaitingStatus => return Some(self.finish(context)),
            _ => return None,
        }
        if context.machine.is_state(&ControllerState::Other("Starting".into())) {
            return None;
        }
        let stands = context.machine.is_state(&ControllerState::Idle)
            || context.machine.is_state(&ControllerState::Alarm);
        if stands {
            self.settle(context);
            return None;
        }
        if context.machine.is_moving() {
            context.send_hold();
        }
        let reason = match context.machine.needs_acknowledgement {
            true => {
                "LINK_LOST: the line is back and the machine is not idle; it is held, \
                 commands stay buffered; check the tool position, then soft_reset"
            }
            false => {
                "DRIVER_RESTARTED: the machine was not idle when the port was opened; it is held, \
                 commands stay buffered; soft_reset to take it over"
            }
        };
        context.log(LogLevel::Warn, reason);
        Some(Next::adrift(reason))
    }

    /// The machine stands still: makes sure that nothing of an earlier session is left.
    fn settle(&mut self, context: &mut Context) {
        if context.config.reset_on_connect {
            *self = Self::reset(context, None);
        } else {
            context.link.trust();
            self.begin_queries(context);
        }
    }

    pub(super) fn on_banner(&mut self, context: &mut Context, text: &str) -> Option<Next> {
        match self.step {
            ConnectStep::Listening => {
                // The machine may have been moving when its controller restarted.
                context.machine.is_homed = false;
                let text = format!(
                    "the controller restarted when its port was opened ({text}): the axes are not \
                     homed; see the parameters dtr and rts if it should not"
                );
                context.log(LogLevel::Warn, text);
                self.settle(context);
            }
            ConnectStep::AwaitingBanner => self.begin_queries(context),
            ConnectStep::PassingOver => *self = Self::after_restart(context),
            ConnectStep::Asking(_) | ConnectStep::AwaitingStatus
                if self.restarts < RESTARTS_MAX =>
            {
                self.restarts += 1;
                context.log(LogLevel::Warn, format!("the controller restarted again: {text}"));
                self.begin_queries(context);
            }
            ConnectStep::Asking(_) | ConnectStep::AwaitingStatus => {
                let message = "the controller restarts again and again: check its supply";
                return Some(self.fail(context, error_code::RESTARTED, message.into()));
            }
        }
        None
    }

    pub(super) fn on_fault(&mut self, context: &mut Context, fault: &LinkFault) -> Option<Next> {
        match (fault, self.step) {
            (LinkFault::Damaged { text }, ConnectStep::Listening | ConnectStep::AwaitingBanner) => {
                self.on_garbage(text);
                None
            }
            (_, ConnectStep::Asking(_) | ConnectStep::AwaitingStatus) => {
                Some(self.fail(context, error_code::PROTOCOL, fault.to_string()))
            }
            _ => None,
        }
    }

    pub(super) fn on_timeout(&mut self, context: &mut Context) -> Option<Next> {
        if self.step == ConnectStep::PassingOver {
            self.begin_queries(context);
            return None;
        }
        let waited = match self.step {
            ConnectStep::Listening => LISTEN,
            _ => ANSWER,
        };
        let waited = waited.as_secs_f64();
        let message = match (self.step, self.garbage) {
            (ConnectStep::Asking(query), _) => {
                format!("the controller did not answer {} within {waited} s", QUERIES[query])
            }
            (ConnectStep::AwaitingStatus, _) => {
                format!("the controller answers, but did not report what it does within {waited} s")
            }
            (_, 1..) => format!(
                "the device that answers is not a grbl-class controller: {} lines such as {:?} in \
                 {waited} s; check {}",
                self.garbage,
                self.sample,
                if context.config.is_networked {
                    "host and port number"
                } else {
                    "baud rate and port"
                }
            ),
            (ConnectStep::Listening, 0) if !context.link.unfinished().is_empty() => {
                let heard = String::from_utf8_lossy(context.link.unfinished());
                let heard: String = heard.chars().take(SAMPLE_CHARS).collect();
                format!(
                    "what answers is no controller: {heard:?} came within {waited} s and no line; a port or cable \
                     that sends back what it is sent does so (echo, loopback); check the port"
                )
            }
            (ConnectStep::Listening, 0) if context.config.is_networked => format!(
                "the connection is open and nothing answered within {waited} s; check the port number (a \
                 web server or TLS is silent too) and that no other client has the controller"
            ),
            (ConnectStep::Listening, 0) => {
                format!("nothing answered within {waited} s; check port, cable and supply")
            }
            (ConnectStep::AwaitingBanner | ConnectStep::PassingOver, 0) => {
                format!("no start message came within {waited} s after a reset")
            }
        };
        Some(self.fail(context, error_code::NO_ANSWER, message))
    }

    fn fail(&mut self, context: &mut Context, code: u16, message: String) -> Next {
        let reason = format!("{message}; soft_reset to try again");
        // Whatever was reported before is older than the silence.
        context.machine.status = None;
        context.log(LogLevel::Error, message.clone());
        if let Some(id) = self.reply {
            context.reply(id, Err(Refusal::new(code, message)));
        }
        Next::Adrift { reason }
    }
}
