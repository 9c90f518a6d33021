//! From an opened port to a controller that is known.
//!
//! Asks first: a machine that moves or holds is held and left to the operator, one
//! that stands still is reset (if the parameter says so), so that half lines and
//! modal words of an earlier life are gone. Then build, settings, words in force and
//! offsets are read, one question at a time.

use super::config::{ANSWER, CROSSING, LISTEN};
use super::place::PlaceWatch;
use super::{Driver, LogLevel, Origin, Phase, Refusal};
use crate::codes::{self, error_code};
use crate::link::{LineKind, Link, LinkFault, realtime};
use crate::report::{ControllerState, ReportUnits};
use cnc_msgs::machine::Mode;
use std::time::Duration;

/// Build, settings, words in force, offsets.
const QUERIES: [&str; 4] = ["$I", "$$", "$G", "$#"];
pub(super) const QUERIES_DONE: usize = QUERIES.len();
const BUILD_QUERY: usize = 0;
const SETTINGS_QUERY: usize = 1;
/// Restarts tolerated while connecting.
const RESTARTS_MAX: u32 = 3;
/// What is kept of garbage to show it, characters.
const SAMPLE_CHARS: usize = 40;

#[derive(Debug)]
pub(super) struct Connecting {
    step: Step,
    until: Duration,
    restarts: u32,
    garbage: usize,
    sample: String,
    /// The soft reset that began this.
    reply: Option<u64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Step {
    Listening,
    AwaitingBanner,
    /// It has started anew by itself: lines that were on their way are still answered.
    PassingOver,
    Asking(usize),
    /// All is answered but what the machine does.
    AwaitingStatus,
}

impl Connecting {
    fn new(step: Step, until: Duration, reply: Option<u64>) -> Self {
        Self { step, until, restarts: 0, garbage: 0, sample: String::new(), reply }
    }

    pub(super) fn until(&self) -> Duration {
        self.until
    }

    pub(super) fn query(&self) -> usize {
        if let Step::Asking(query) = self.step { query } else { 0 }
    }

    /// Whether a reset was sent and its start message has not come.
    pub(super) fn is_resetting(&self) -> bool {
        self.step == Step::AwaitingBanner
    }

    /// Whether the settings were answered, the unit of reports among them.
    pub(super) fn has_settings(&self) -> bool {
        match self.step {
            Step::Asking(query) => query > SETTINGS_QUERY,
            Step::AwaitingStatus => true,
            _ => false,
        }
    }

    /// The soft reset that waits for the outcome.
    pub(super) fn reply_to(&self) -> Option<u64> {
        self.reply
    }

    pub(super) fn describe(&self) -> String {
        match self.step {
            Step::Listening => "listening".into(),
            Step::AwaitingBanner => "waiting for the controller to start".into(),
            Step::PassingOver => "waiting for answers to lines of before".into(),
            Step::Asking(query) => format!("asking {}", QUERIES[query]),
            Step::AwaitingStatus => "waiting for a report".into(),
        }
    }

    pub(super) fn hear_garbage(&mut self, text: &str) {
        self.garbage += 1;
        if self.sample.is_empty() {
            self.sample = text.chars().take(SAMPLE_CHARS).collect();
        }
    }
}

impl Driver {
    pub(super) fn on_port_opened(&mut self) {
        if self.is_open() {
            self.on_port_closed("the port was opened anew");
        }
        self.link = Link::new(self.config.link(), self.now);
        self.machine.on_port();
        self.hold = None;
        self.phase = Phase::Connecting(Connecting::new(Step::Listening, self.now + LISTEN, None));
    }

    pub(super) fn on_port_closed(&mut self, reason: &str) {
        let was_active = matches!(self.phase, Phase::Running(_) | Phase::Manual(_))
            || self.machine.is_moving()
            || self.machine.is_silent;
        if self.is_open() && was_active {
            self.machine.is_lost = true;
            self.machine.needs_acknowledgement = true;
        }
        let reason = match self.machine.is_lost {
            true => format!("LINK_LOST: {reason}; motion may continue"),
            false => reason.to_owned(),
        };
        self.hold = None;
        self.machine.is_homed = false;
        self.machine.status = None;
        self.drop_overrides("the line is gone");
        let code = error_code::LINK_LOST;
        let closed = Phase::Closed { reason: reason.clone() };
        match std::mem::replace(&mut self.phase, closed) {
            running @ Phase::Running(_) => {
                self.phase = running;
                let next = Phase::Closed { reason: reason.clone() };
                self.end_run(super::RunOutcome::Aborted, code, reason, next);
            }
            operation @ Phase::Manual(_) => {
                self.phase = operation;
                let next = Phase::Closed { reason: reason.clone() };
                self.end_manual(Err(Refusal::new(code, reason)), next);
            }
            Phase::Connecting(Connecting { reply: Some(id), .. }) => {
                self.reply(id, Err(Refusal::new(code, reason)));
            }
            _ => {}
        }
        if let Phase::Closed { reason } = &self.phase {
            let reason = reason.clone();
            self.log(LogLevel::Warn, reason);
        }
    }

    /// Resets the controller and learns it anew.
    pub(super) fn begin_reset(&mut self, reply: Option<u64>) {
        self.link.send_reset(self.now);
        self.hold = None;
        self.drop_overrides("the controller is being reset");
        self.phase =
            Phase::Connecting(Connecting::new(Step::AwaitingBanner, self.now + ANSWER, reply));
    }

    /// Asks everything of a controller that has just started.
    pub(super) fn begin_queries(&mut self, reply: Option<u64>) {
        let mut connecting = Connecting::new(Step::Asking(0), self.now, reply);
        if let Phase::Connecting(before) = &self.phase {
            connecting.restarts = before.restarts;
        }
        self.phase = Phase::Connecting(connecting);
        self.ask(0);
    }

    /// The same of one that has started anew when nobody asked for it.
    pub(super) fn begin_queries_behind_a_restart(&mut self) {
        self.link.distrust();
        let until = self.now + CROSSING;
        self.phase = Phase::Connecting(Connecting::new(Step::PassingOver, until, None));
    }

    fn ask(&mut self, query: usize) {
        self.link.send_line(QUERIES[query], LineKind::Slow, Origin::Query(query));
        if let Phase::Connecting(connecting) = &mut self.phase {
            connecting.step = Step::Asking(query);
            connecting.until = self.now + ANSWER;
        }
    }

    /// Asks for the words in force and the offsets again, behind a reset.
    pub(super) fn ask_again(&mut self) {
        const WORDS: usize = 2;
        self.shift_before = self.machine.shift();
        self.link.send_line(QUERIES[WORDS], LineKind::Slow, Origin::Query(WORDS));
    }

    /// One of these was answered.
    pub(super) fn on_again_answer(&mut self, query: usize) {
        if query + 1 < QUERIES.len() {
            self.machine.offsets.clear();
            let next = query + 1;
            return self.link.send_line(QUERIES[next], LineKind::Slow, Origin::Query(next));
        }
        if self.shift_before != self.machine.shift() {
            let text = "the reset has dropped G92: the work frame has moved; set it again";
            self.log(LogLevel::Warn, text.into());
        }
        self.machine.work_out_offset();
        self.publish_settings();
        self.link.ask_status(self.now);
    }

    pub(super) fn on_connect_status(&mut self) {
        match self.phase {
            Phase::Connecting(Connecting { step: Step::Listening, .. }) => {}
            Phase::Connecting(Connecting { step: Step::AwaitingStatus, .. }) => {
                return self.finish_connecting();
            }
            _ => return,
        }
        if self.machine.is_state(&ControllerState::Other("Starting".into())) {
            return;
        }
        let stands = self.machine.is_state(&ControllerState::Idle)
            || self.machine.is_state(&ControllerState::Alarm);
        if !stands {
            if self.machine.is_moving() {
                self.send_hold();
            }
            let reason = match self.machine.needs_acknowledgement {
                true => {
                    "LINK_LOST: the line is back and the machine was still moving: it was held \
                     and keeps what it has; look where the tool is, then soft_reset"
                }
                false => {
                    "DRIVER_RESTARTED: the machine was not idle when the port was opened; it was \
                     held and keeps what it has; soft_reset to take it over"
                }
            };
            self.phase = Phase::Adrift { reason: reason.into() };
            self.log(LogLevel::Warn, reason.into());
            return;
        }
        self.settle();
    }

    /// The machine stands still: makes sure that nothing of an earlier life is left.
    fn settle(&mut self) {
        if self.config.reset_on_connect {
            self.begin_reset(None);
        } else {
            self.link.trust();
            self.begin_queries(None);
        }
    }

    pub(super) fn on_connect_banner(&mut self, text: &str) {
        let Phase::Connecting(connecting) = &mut self.phase else { return };
        let reply = connecting.reply;
        match connecting.step {
            Step::Listening => {
                // The machine may have been moving when its controller fell over.
                self.machine.is_homed = false;
                let text = format!(
                    "the controller restarted when its port was opened ({text}): the axes are not \
                     homed; see the parameters dtr and rts if it should not"
                );
                self.log(LogLevel::Warn, text);
                self.settle();
            }
            Step::AwaitingBanner => self.begin_queries(reply),
            Step::PassingOver => self.begin_queries_behind_a_restart(),
            Step::Asking(_) | Step::AwaitingStatus if connecting.restarts < RESTARTS_MAX => {
                connecting.restarts += 1;
                self.log(LogLevel::Warn, format!("the controller restarted again: {text}"));
                self.begin_queries(reply);
            }
            Step::Asking(_) | Step::AwaitingStatus => {
                let message = "the controller restarts again and again: check its supply";
                self.fail_to_connect(error_code::RESTARTED, message.into());
            }
        }
    }

    pub(super) fn on_query_answer(&mut self, query: usize, error: Option<u16>) {
        if let Some(code) = error {
            let text = codes::describe_error(self.machine.firmware, code);
            self.log(LogLevel::Warn, format!("{} was refused: {text}", QUERIES[query]));
        }
        if query == SETTINGS_QUERY {
            let is_inch = self.machine.reports_in_inches();
            let units = if is_inch { ReportUnits::Inches } else { ReportUnits::Millimetres };
            // Where it was not told, decimals may have shown the unit.
            let is_told = self.machine.settings.contains_key(&13);
            if (is_told || !self.machine.has_units) && units != self.link.units() {
                // What was heard before was read in the other unit.
                self.machine.status = None;
                self.machine.place = PlaceWatch::default();
                self.link.set_units(units);
            }
            self.machine.has_units |= error.is_none();
            self.link.ask_for_everything(self.machine.reports_too_little());
        }
        if query == BUILD_QUERY && self.machine.firmware.traits().echoes_after_control_characters {
            // A control character of whoever was here before has switched its echo on.
            self.link.send_realtime(realtime::ECHO_OFF);
        }
        if query + 1 < QUERIES.len() {
            return self.ask(query + 1);
        }
        self.machine.work_out_offset();
        // Whoever waits for this can rely on the state then.
        if let Phase::Connecting(connecting) = &mut self.phase {
            connecting.step = Step::AwaitingStatus;
            connecting.until = self.now + ANSWER;
        }
        // An alarm that is announced while connecting leaves the answers in order.
        self.link.trust();
        self.link.ask_status(self.now);
    }

    /// All that is asked is answered, and a report has come.
    fn finish_connecting(&mut self) {
        let Phase::Connecting(connecting) = std::mem::replace(&mut self.phase, Phase::Ready) else {
            return;
        };
        let message = format!(
            "connected: {:?}, {} planner blocks, at most {} bytes under way",
            self.machine.firmware,
            self.machine.planner_blocks(),
            self.link.window()
        );
        self.log(LogLevel::Info, message);
        self.publish_settings();
        if let Some(id) = connecting.reply {
            self.reply(id, Ok("the controller was reset".into()));
        }
        // An alarm holds it back by itself; without one nothing would.
        let has_moved = self.machine.has_moved_since_start();
        let is_lost = std::mem::take(&mut self.machine.lost_its_place) || has_moved;
        if has_moved {
            self.machine.is_homed = false;
        }
        if is_lost && self.machine.mode() != Mode::Alarm {
            if self.machine.is_moving() {
                self.send_hold();
            }
            let reason = "RESTARTED: the controller started anew and may take the place where it \
                          stands for zero; soft_reset, then home, or set the work offset again";
            self.phase = Phase::Adrift { reason: reason.into() };
        }
        if self.machine.needs_acknowledgement {
            let reason = "LINK_LOST: the controller was out of reach while the machine was \
                          moving, and is back; look where the tool is, then soft_reset";
            self.phase = Phase::Adrift { reason: reason.into() };
        }
    }

    pub(super) fn on_connect_fault(&mut self, fault: &LinkFault) {
        let Phase::Connecting(connecting) = &mut self.phase else { return };
        match (fault, connecting.step) {
            (LinkFault::Damaged { text }, Step::Listening | Step::AwaitingBanner) => {
                connecting.hear_garbage(&text.clone());
            }
            (_, Step::Asking(_) | Step::AwaitingStatus) => {
                self.fail_to_connect(error_code::PROTOCOL, fault.to_string());
            }
            _ => {}
        }
    }

    pub(super) fn on_connect_timeout(&mut self) {
        let Phase::Connecting(connecting) = &self.phase else { return };
        if connecting.step == Step::PassingOver {
            return self.begin_queries(None);
        }
        let waited = match connecting.step {
            Step::Listening => LISTEN,
            _ => ANSWER,
        };
        let waited = waited.as_secs_f64();
        let message = match (connecting.step, connecting.garbage) {
            (Step::Asking(query), _) => {
                format!("the controller did not answer {} within {waited} s", QUERIES[query])
            }
            (Step::AwaitingStatus, _) => {
                format!("the controller answers, but did not report what it does within {waited} s")
            }
            (_, 1..) => format!(
                "what answers is no controller of the grbl family: {} lines such as {:?} in {waited} s; check baud rate and port",
                connecting.garbage, connecting.sample
            ),
            (Step::Listening, 0) => {
                format!("nothing answered within {waited} s; check port, cable and supply")
            }
            (Step::AwaitingBanner | Step::PassingOver, 0) => {
                format!("no start message came within {waited} s of a reset")
            }
        };
        self.fail_to_connect(error_code::NO_ANSWER, message);
    }

    fn fail_to_connect(&mut self, code: u16, message: String) {
        let reason = format!("{message}; soft_reset to try again");
        // Whatever was reported before is older than the silence.
        self.machine.status = None;
        let failed = std::mem::replace(&mut self.phase, Phase::Adrift { reason });
        self.log(LogLevel::Error, message.clone());
        if let Phase::Connecting(Connecting { reply: Some(id), .. }) = failed {
            self.reply(id, Err(Refusal::new(code, message)));
        }
    }

    /// Why no program can be run now, as far as the link and the machine go.
    pub(super) fn obstacle(&self) -> Option<Refusal> {
        let refuse = |code, text: String| Some(Refusal::new(code, text));
        match &self.phase {
            Phase::Closed { reason } => refuse(error_code::NOT_CONNECTED, reason.clone()),
            Phase::Connecting(connecting) => {
                refuse(error_code::CONNECTING, format!("still {}", connecting.describe()))
            }
            Phase::Adrift { reason } => refuse(error_code::NEEDS_RESET, reason.clone()),
            Phase::Manual(operation) => refuse(error_code::BUSY, operation.describe()),
            Phase::Running(_) => refuse(error_code::BUSY, "a program is running".into()),
            Phase::Ready => match self.machine.mode() {
                Mode::Idle => None,
                Mode::Alarm => refuse(error_code::ALARM, self.compose().reason),
                Mode::Unknown => refuse(error_code::CONNECTING, "no status was heard yet".into()),
                mode => refuse(error_code::BUSY, format!("the machine is in {}", mode.name())),
            },
        }
    }
}
