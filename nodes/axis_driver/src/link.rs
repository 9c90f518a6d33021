//! The wire protocol of grbl 1.1 without a wire.
//!
//! Bytes go in with the time they came, bytes and events come out. Knows how many
//! bytes of which lines the controller has not answered yet, never puts more than
//! the window into its receive buffer, asks for status, and notices when answers
//! and lines no longer match. Decides nothing about programs; that is
//! [`crate::driver`]. `T` is whatever the caller wants back with a line's answer.

mod at_rest;
mod buffer;
mod check;
mod config;
mod event;
mod framing;
mod health;
pub mod realtime;
mod watch;

pub use at_rest::LinkAtRest;
pub use config::LinkConfig;
pub use event::{LinkEvent, LinkFault};

use crate::report::{self, Message, Report, ReportUnits, StatusReport};
use buffer::{Buffer, Counted};
use check::{CHECK, LineCheck};
use cnc_msgs::machine::LinkWatch;
use config::BITS_PER_BYTE;
use framing::Framer;
use health::Health;
use std::collections::VecDeque;
use std::time::Duration;
use watch::Means;

/// The receive buffer of grbl 1.1 on an ATmega328, bytes; used when the controller reports none.
const RECEIVE_BYTES_DEFAULT: u16 = 128;
/// One byte of the ring stays free.
const RECEIVE_BYTES_SPARE: u16 = 1;
/// More answers than these between two reports, and the line is left to lines: checks among
/// them notice what a report would.
const FEW_ANSWERS: u32 = 10;

/// How a line behaves between being read and being answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineKind {
    /// Answered as soon as there is room in the planner.
    Motion,
    /// May be answered late while the machine reports `Idle`: spindle, coolant, stop.
    Slow,
    /// Answered this long after all motion has ended, and `Idle` meanwhile.
    Dwell { milliseconds: u32 },
    /// The controller may report nothing at all until it answers: homing.
    Silent,
    /// The controller may report nothing for so long before it answers: a thread that waits for its
    /// spindle to come around.
    Thread { milliseconds: u32 },
}

#[derive(Debug)]
struct Sent<T> {
    /// Without its line end.
    text: Box<str>,
    kind: LineKind,
    /// `None`: a check.
    tag: Option<T>,
    /// The controller has echoed it.
    is_read: bool,
}

impl<T> Sent<T> {
    /// What was written for it, with its line end.
    fn bytes(&self) -> usize {
        self.text.len() + 1
    }

    fn is_check(&self) -> bool {
        self.tag.is_none()
    }
}

/// The state of one link. Made anew when a port is opened.
#[derive(Debug)]
pub struct Link<T> {
    config: LinkConfig,
    framer: Framer,
    units: ReportUnits,
    receive_bytes: u16,
    in_flight: VecDeque<Sent<T>>,
    in_flight_bytes: usize,
    /// An alarm or a reset came: answers mean nothing until the next banner.
    is_forgiving: bool,
    /// Ordinary reports lack what is needed.
    asks_everything: bool,
    health: Health,
    buffer: Buffer,
    check: LineCheck,
    /// Answers since the last report.
    answers: u32,
    urgent: Vec<u8>,
    lines: Vec<u8>,
    events: VecDeque<LinkEvent<T>>,
}

impl<T> Link<T> {
    /// A link on which nothing was sent or heard; asks for status from now on.
    pub fn new(config: LinkConfig, now: Duration) -> Self {
        Self {
            config,
            framer: Framer::default(),
            units: ReportUnits::default(),
            receive_bytes: config.receive_buffer_bytes.unwrap_or(RECEIVE_BYTES_DEFAULT),
            in_flight: VecDeque::new(),
            in_flight_bytes: 0,
            is_forgiving: true,
            asks_everything: false,
            health: Health::new(config.poll_interval_ms, now),
            buffer: Buffer::default(),
            check: LineCheck::new(config.line_check_interval_ms),
            answers: 0,
            urgent: Vec::new(),
            lines: Vec::new(),
            events: VecDeque::new(),
        }
    }

    /// Goes on with other intervals and another hold latency; no stream of lines is under way.
    pub fn set_config(&mut self, config: LinkConfig) {
        self.config = config;
        self.health.set_interval(config.poll_interval_ms);
        self.check = LineCheck::new(config.line_check_interval_ms);
    }

    /// The unit in which reports are read.
    pub fn units(&self) -> ReportUnits {
        self.units
    }

    /// Takes the unit of reports, from `$13`.
    pub fn set_units(&mut self, units: ReportUnits) {
        self.units = units;
    }

    /// Takes the size of the receive buffer that `[OPT:]` reports, bytes; FluidNC reports none.
    pub fn set_receive_bytes(&mut self, bytes: Option<u16>) {
        let reported = bytes.filter(|bytes| *bytes > RECEIVE_BYTES_SPARE);
        let sizes = [self.config.receive_buffer_bytes, reported];
        self.receive_bytes = sizes.into_iter().flatten().min().unwrap_or(RECEIVE_BYTES_DEFAULT);
        self.buffer.set_size(reported);
    }

    /// The most bytes that may be unanswered: the receive buffer less one, what it had
    /// free when nothing was under way, or what the wire carries within the hold latency,
    /// whichever is least.
    pub fn window(&self) -> usize {
        let reported = self.receive_bytes.saturating_sub(RECEIVE_BYTES_SPARE);
        let buffer = u64::from(self.buffer.free_at_rest().unwrap_or(reported).min(reported));
        let bits = u64::from(self.config.hold_latency_ms_max) * u64::from(self.config.baud) / 1000;
        usize::try_from(buffer.min(bits / BITS_PER_BYTE)).unwrap_or(usize::MAX)
    }

    /// Whether a line of this many bytes, without its end, may be sent now. A line
    /// longer than the window goes when nothing else is under way, and none after a check that
    /// would end the passing over of lines, until all before it are answered.
    pub fn has_room(&self, text_bytes: usize) -> bool {
        let fits = self.in_flight.is_empty() || self.in_flight_bytes + text_bytes < self.window();
        fits && !(self.check.must_be_first() && self.in_flight.iter().skip(1).any(Sent::is_check))
    }

    /// The size of the receive buffer, as reported or believed, bytes.
    pub fn receive_bytes(&self) -> u16 {
        self.receive_bytes
    }

    /// Lines that were sent and not answered.
    pub fn unanswered(&self) -> usize {
        self.in_flight.len()
    }

    /// The bytes of those lines, with their ends.
    pub fn unanswered_bytes(&self) -> usize {
        self.in_flight_bytes
    }

    /// What the caller gave with the oldest line that is not answered.
    pub fn oldest(&self) -> Option<&T> {
        self.in_flight.iter().find_map(|sent| sent.tag.as_ref())
    }

    /// What the oldest line that is not answered is, a check too.
    pub fn oldest_kind(&self) -> Option<LineKind> {
        self.in_flight.front().map(|sent| sent.kind)
    }

    /// What has come of a line that has not ended yet.
    pub(crate) fn unfinished(&self) -> &[u8] {
        self.framer.unfinished()
    }

    /// Whether the controller has reported the size of its receive buffer: what it reports of it
    /// can be compared then.
    pub fn knows_its_size(&self) -> bool {
        self.buffer.has_size()
    }

    /// How well it is noticed that a line or an answer was lost or came twice, where reports
    /// say how full the receive buffer is or do not.
    pub fn watch(&self, reports_buffer: bool) -> LinkWatch {
        watch::watch(Means {
            has_checks: self.config.line_check_interval_ms > 0,
            has_buffer: reports_buffer && self.buffer.has_size(),
        })
    }

    /// A stream of lines begins: checks go among them from now on. `passes_over`: after an error
    /// the controller passes over lines until it takes one.
    pub fn begin_stream(&mut self, now: Duration, passes_over: bool) {
        self.check.begin(now, passes_over);
        self.answers = 0;
    }

    /// Sends a check if it is time for one and there is room; the caller sends lines and
    /// has none under way that must be alone.
    pub fn check_lines(&mut self, now: Duration) {
        // Its answer and a report are not to delay the answers to lines together.
        if self.check.is_due(now) && !self.health.is_asked() && self.has_room(CHECK.len()) {
            self.check.on_sent(now);
            self.send(CHECK, LineKind::Motion, None);
        }
    }

    /// Sends a line; the caller has asked [`Self::has_room`].
    ///
    /// # Panics
    /// When the text could act on the machine other than as one line.
    pub fn send_line(&mut self, text: &str, kind: LineKind, tag: T) {
        self.send(text, kind, Some(tag));
        self.check.on_line_sent();
    }

    fn send(&mut self, text: &str, kind: LineKind, tag: Option<T>) {
        let is_plain =
            text.bytes().all(|byte| matches!(byte, b' '..=b'}') && !b"!?".contains(&byte));
        assert!(is_plain, "not a line for a controller: {text:?}");
        self.lines.extend_from_slice(text.as_bytes());
        self.lines.push(b'\n');
        let sent = Sent { text: text.into(), kind, tag, is_read: false };
        self.in_flight_bytes += sent.bytes();
        self.in_flight.push_back(sent);
        self.health.on_line_sent();
        self.buffer.on_line_sent();
    }

    /// Sends a byte that acts at once, before all lines that wait for the port.
    ///
    /// # Panics
    /// When it is none of [`realtime`]: others mean what nobody here has thought of.
    pub fn send_realtime(&mut self, byte: u8) {
        assert!(realtime::is_named(byte), "not a real-time byte: {byte:#04x}");
        self.urgent.push(byte);
    }

    /// Sends a soft reset; whatever was under way is forgotten, here and there.
    pub fn send_reset(&mut self, now: Duration) {
        self.lines.clear();
        self.urgent.push(realtime::SOFT_RESET);
        self.forget();
        self.is_forgiving = true;
        self.restart(now);
    }

    /// Asks for status at the next opportunity: something has changed.
    pub fn ask_status(&mut self, now: Duration) {
        self.health.ask_at(now);
    }

    /// Takes it that the controller will answer nothing more until it is reset.
    pub fn expect_deafness(&mut self) {
        self.health.set_deaf(true);
    }

    /// Takes bytes that came from the controller.
    pub fn receive(&mut self, now: Duration, bytes: &[u8]) {
        for &byte in bytes {
            if let Some(line) = self.framer.push(byte) {
                let report = report::parse(&line, self.units);
                self.on_report(now, report);
            }
        }
    }

    /// Does what is due: asks for status, notices silence.
    pub fn handle_time(&mut self, now: Duration) {
        let oldest = self.in_flight.front().map(|sent| sent.kind);
        let is_silence_expected = self.health.is_silence_expected(now, oldest);
        let is_alone = !self.health.is_asked() && self.config.is_prompt();
        if self.health.poll_is_due(now, is_silence_expected) {
            self.urgent.push(match self.asks_everything {
                true => realtime::FULL_STATUS,
                false => realtime::STATUS,
            });
            // The lines that wait for the port go after it.
            let waiting = self.lines.len();
            let sent = self.in_flight_bytes.saturating_sub(waiting);
            self.buffer.on_request(sent, waiting, is_alone);
            if self.health.is_silent_now() {
                self.events.push_back(LinkEvent::Silent);
            }
        }
    }

    /// Whether the controller cuts a thread, which no hold stops, or waits for its spindle.
    pub fn is_threading(&self) -> bool {
        let oldest = self.in_flight.front();
        oldest.is_some_and(|sent| matches!(sent.kind, LineKind::Thread { .. }))
    }

    /// When [`Self::handle_time`] has something to do.
    pub fn next_deadline(&self) -> Duration {
        self.health.next_poll_at()
    }

    /// When the last status report came.
    pub fn last_status_at(&self) -> Option<Duration> {
        self.health.last_status_at()
    }

    pub fn poll_event(&mut self) -> Option<LinkEvent<T>> {
        self.events.pop_front()
    }

    /// The bytes to write now, the urgent ones first.
    pub fn poll_transmit(&mut self) -> Option<Vec<u8>> {
        let mut bytes = std::mem::take(&mut self.urgent);
        bytes.append(&mut self.lines);
        (!bytes.is_empty()).then_some(bytes)
    }

    fn on_report(&mut self, now: Duration, report: Report) {
        match report {
            Report::Ok => self.on_answer(None),
            Report::Error(code) => self.on_answer(Some(code)),
            Report::Alarm(code) => {
                self.is_forgiving = true;
                self.events.push_back(LinkEvent::Alarm(code));
            }
            Report::Banner { firmware, text } => {
                self.forget();
                self.is_forgiving = false;
                self.restart(now);
                self.events.push_back(LinkEvent::Banner { firmware, text });
            }
            Report::Status(status) => self.on_status(now, *status),
            Report::Message(message) => {
                match &message {
                    Message::ParserState(_) => self.check.on_words(),
                    Message::Echo(read) => self.on_echo(read),
                    _ => {}
                }
                self.events.push_back(LinkEvent::Message(message));
            }
            Report::Setting { number, value } => {
                self.events.push_back(LinkEvent::Setting { number, value });
            }
            Report::NamedSetting { name, value } => {
                self.events.push_back(LinkEvent::NamedSetting { name, value });
            }
            Report::StartupLine(text) | Report::Unknown(text) => {
                self.events.push_back(LinkEvent::Text(text));
            }
            Report::Damaged(text) => {
                self.events.push_back(LinkEvent::Fault(LinkFault::Damaged { text }));
            }
            Report::Empty => {}
        }
    }

    fn on_status(&mut self, now: Duration, status: StatusReport) {
        let oldest = self.in_flight.front();
        let counted =
            Counted { bytes: self.in_flight_bytes, oldest_bytes: oldest.map_or(0, Sent::bytes) };
        let disagreement = self.buffer.on_status(&status, counted, self.receive_bytes);
        let kind = oldest.map(|sent| sent.kind);
        let is_quiet = self.answers <= FEW_ANSWERS || self.would_be_quiet(now);
        let since = self.health.looked_at_since(now);
        let fault = self.health.on_status(now, &status, kind, self.in_flight.len());
        if oldest.is_some() {
            self.health.ask_again_within(match is_quiet {
                true => self.config.busy_poll_interval(),
                false => self.config.crowded_poll_interval(),
            });
        }
        self.answers = 0;
        self.events.push_back(LinkEvent::Status { report: Box::new(status), since });
        if let Some(fault) = fault.or(disagreement).filter(|_| !self.is_forgiving) {
            self.events.push_back(LinkEvent::Fault(fault));
        }
    }

    /// Whether few answers would come between two reports at the short interval, though many came
    /// in a long one.
    fn would_be_quiet(&self, now: Duration) -> bool {
        let Some(last) = self.health.last_status_at().filter(|_| self.config.watches_path) else {
            return false;
        };
        let share = now.saturating_sub(last).as_secs_f64();
        let answers = f64::from(self.answers) * self.config.busy_poll_interval().as_secs_f64();
        answers <= f64::from(FEW_ANSWERS) * share
    }

    fn on_answer(&mut self, error: Option<u16>) {
        self.health.on_answer();
        self.answers = self.answers.saturating_add(1);
        match self.in_flight.pop_front() {
            Some(sent) => {
                self.in_flight_bytes -= sent.bytes();
                self.buffer.on_answer(sent.bytes());
                let fault = self.check.on_answer(sent.is_check(), error);
                if let Some(tag) = sent.tag {
                    self.events.push_back(LinkEvent::Answer { tag, error });
                }
                if let Some(fault) = fault.filter(|_| !self.is_forgiving) {
                    self.events.push_back(LinkEvent::Fault(fault));
                }
            }
            // A line that was under way may still be answered before the banner.
            None if self.is_forgiving => {}
            None => self.events.push_back(LinkEvent::Fault(LinkFault::UnexpectedAnswer)),
        }
    }

    /// The controller has read a line, and executes it next: of ours, the oldest without an answer.
    fn on_echo(&mut self, read: &str) {
        let Some(sent) = self.in_flight.front_mut().filter(|_| !self.is_forgiving) else { return };
        // The macro of a tool change has lines of its own.
        if std::mem::replace(&mut sent.is_read, true) && changes_tool(&sent.text) {
            return;
        }
        if !is_same_line(&sent.text, read) {
            let fault = LinkFault::ReadOtherwise { sent: sent.text.to_string(), read: read.into() };
            self.events.push_back(LinkEvent::Fault(fault));
        }
    }

    fn restart(&mut self, now: Duration) {
        self.health.restart(now);
        self.buffer.restart();
    }

    fn forget(&mut self) {
        self.in_flight.clear();
        self.in_flight_bytes = 0;
        self.lines.clear();
        self.check.forget();
    }

    /// Takes it that the controller has started anew, though its start message was not heard.
    pub fn believe_in_restart(&mut self, now: Duration) {
        self.forget();
        self.is_forgiving = false;
        self.restart(now);
    }

    /// Asks for reports with every field that the controller has, or for ordinary ones.
    pub fn ask_for_everything(&mut self, is_wanted: bool) {
        self.asks_everything = is_wanted;
    }

    /// Passes over answers to lines that it does not know of, until the next banner.
    pub fn distrust(&mut self) {
        self.is_forgiving = true;
    }

    /// Believes answers from here on, without a banner: the caller connects to a
    /// controller that it does not reset.
    pub fn trust(&mut self) {
        self.is_forgiving = false;
    }
}

/// Whether a line has the controller change the tool: `N5M6T2`.
fn changes_tool(line: &str) -> bool {
    let words = line.trim_start_matches('N').trim_start_matches(|c: char| c.is_ascii_digit());
    words.starts_with("M6T")
}

/// Whether a controller that drops blanks and writes capitals would read one as the other.
fn is_same_line(sent: &str, read: &str) -> bool {
    let words = |text: &'_ str| {
        let characters = text.bytes().filter(|byte| !byte.is_ascii_whitespace());
        characters.map(|byte| byte.to_ascii_uppercase()).collect::<Vec<_>>()
    };
    words(sent) == words(read)
}

#[cfg(test)]
mod tests;
