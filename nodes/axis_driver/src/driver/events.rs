//! Routes link events to the current phase.

use super::answer::Refusal;
use super::context::Origin;
use super::manual::{ManualEnd, Task};
use super::next::Next;
use super::output::LogLevel;
use super::run::exit::RunVerdict;
use super::{Driver, Phase};
use crate::codes::{self, error_code};
use crate::firmware::Firmware;
use crate::link::{LinkEvent, LinkFault};
use crate::report::{Message, is_lock_notice, was_a_banner};
use std::time::Duration;

/// The alarm of a target outside of the travel.
const SOFT_LIMIT: u16 = 2;
/// The alarms of a probe: it touches already, and it touches nowhere.
const PROBE_FAILS: [u16; 2] = [4, 5];

impl Driver {
    pub(super) fn on_event(&mut self, event: LinkEvent<Origin>) {
        let context = &mut self.context;
        match event {
            LinkEvent::Answer { tag, error } => {
                context.machine.has_just_started = false;
                self.on_answer(tag, error);
            }
            LinkEvent::Alarm(code) => self.on_alarm(code),
            LinkEvent::Banner { firmware, text } => self.take_banner(firmware, &text),
            LinkEvent::Status { report, since } => self.take_report(*report, since),
            LinkEvent::Message(message) => self.on_message(message),
            LinkEvent::Setting { number, value } => context.machine.on_setting(number, &value),
            LinkEvent::NamedSetting { .. } => {}
            LinkEvent::Text(text) => self.on_text(&text),
            LinkEvent::Fault(fault) => self.on_fault(&fault),
            LinkEvent::Silent => self.on_silence(),
        }
    }

    fn on_message(&mut self, message: Message) {
        if let Some(bytes) = self.context.machine.on_message(&message) {
            self.context.link.set_receive_bytes(bytes);
        }
        match message {
            Message::Text(text) => {
                self.context.log(LogLevel::Info, format!("controller: {text}"));
                if is_lock_notice(&text) {
                    self.on_lock_notice(&text);
                }
            }
            Message::ParserState(words) => self.on_parser_state(&words),
            Message::Probe { position, further, has_touched } => match &mut self.phase {
                Phase::Manual(operation) => {
                    let further = self.context.machine.read_further(&further);
                    operation.on_probe(position, further, has_touched);
                }
                Phase::Running(run) => run.on_probe(position, has_touched),
                _ => {}
            },
            _ => {}
        }
    }

    fn on_answer(&mut self, origin: Origin, error: Option<u16>) {
        let context = &mut self.context;
        if matches!(origin, Origin::OffsetsAnew) {
            return context.on_offsets_anew(error);
        }
        if matches!(origin, Origin::SettingsAnew) {
            return;
        }
        match (&mut self.phase, origin) {
            (Phase::Connecting(connecting), Origin::Query(query)) => {
                connecting.on_answer(context, query, error);
            }
            (Phase::Manual(operation), Origin::Manual) => {
                if let Some(end) = operation.on_answer(context, error) {
                    self.end_manual(end);
                }
            }
            (Phase::Running(run), origin) => {
                let exit = run.on_answer(context, origin, error);
                self.leave_run(exit);
            }
            (Phase::Stopping(stopping), origin) => stopping.on_answer(context, &origin),
            _ => {}
        }
    }

    fn on_alarm(&mut self, code: u16) {
        let context = &mut self.context;
        context.machine.on_alarm(code);
        let text = codes::describe_alarm(context.machine.firmware, code);
        context.log(LogLevel::Error, text.clone());
        if codes::is_deaf(context.machine.firmware, code) {
            context.link.expect_deafness();
        }
        let next = Next::adrift(format!("{text}; soft_reset to go on"));
        match &mut self.phase {
            Phase::Stopping(stopping) if stopping.is_resetting() => stopping.add_to_verdict(&text),
            Phase::Stopping(stopping) if stopping.waits_for_operator() => {
                stopping.add_to_verdict(&text);
                self.end_stop(Some(next));
            }
            Phase::Running(_) | Phase::Stopping(_) => self.end_run_in_alarm(code, &text, next),
            Phase::Manual(operation) => {
                let is_probe =
                    matches!(operation.task, Task::Probe { .. }) && PROBE_FAILS.contains(&code);
                let error_code =
                    if is_probe { error_code::PROBE_FAILED } else { error_code::ALARM };
                self.end_manual(ManualEnd::refused(Refusal::new(error_code, text), next));
            }
            Phase::Ready => self.go(Some(next)),
            Phase::Closed { .. } | Phase::Connecting(_) | Phase::Adrift { .. } => {}
        }
    }

    fn end_run_in_alarm(&mut self, code: u16, text: &str, next: Next) {
        // A target that cannot be reached is seen when its line is read, all else happens
        // where the tool is.
        let is_probe = matches!(&self.phase, Phase::Running(run) if run.is_probing());
        let is_of_line = is_probe || code == SOFT_LIMIT;
        let error_code = match is_probe && PROBE_FAILS.contains(&code) {
            true => error_code::PROBE_FAILED,
            false => error_code::ALARM,
        };
        let read = match self.context.link.oldest() {
            Some(Origin::Program { source, .. }) if is_of_line => Some(*source),
            _ => None,
        };
        let Some(job) = self.phase.job_mut() else { return };
        job.blamed_line = read.map_or_else(|| job.line(), |source| source.line);
        let place = match read {
            Some(source) => job.place_of(source),
            None => job.place(),
        };
        self.end_run(RunVerdict::aborted(error_code, format!("{text}, at {place}")), next);
    }

    /// A start message has come. The first in a session of a network is only a greeting: grblHAL
    /// sends one to each, and no session outlives a restart. grbl 1.1 has no network, and so there
    /// is a serial server before it, which may have reset it.
    fn take_banner(&mut self, firmware: Firmware, text: &str) {
        let context = &mut self.context;
        context.machine.has_just_started = true;
        let is_listening =
            matches!(&self.phase, Phase::Connecting(connecting) if connecting.is_listening());
        let is_greeter = firmware.traits().greets_each_session;
        if context.config.is_networked && is_listening && is_greeter {
            context.machine.firmware = firmware;
            return context.log(LogLevel::Info, format!("the controller greets: {text}"));
        }
        context.machine.on_restart(firmware);
        context.drop_overrides("the controller has restarted");
        self.on_banner(text);
    }

    /// The controller has restarted.
    pub(super) fn on_banner(&mut self, text: &str) {
        let context = &mut self.context;
        match &mut self.phase {
            Phase::Closed { .. } => {}
            Phase::Connecting(connecting) => {
                let next = connecting.on_banner(context, text);
                self.go(next);
            }
            Phase::Stopping(stopping) if stopping.is_resetting() => stopping.on_banner(context),
            Phase::Running(_) | Phase::Stopping(_) => {
                let message = format!(
                    "the controller restarted in the middle of the run ({text}); its position is lost: home"
                );
                context.machine.is_homed = false;
                context.machine.lost_its_place = true;
                self.end_run(RunVerdict::aborted(error_code::RESTARTED, message), Next::Ready);
                self.begin_after_restart();
            }
            Phase::Manual(_) => {
                context.machine.is_homed = false;
                context.machine.lost_its_place = true;
                let message = format!("the controller restarted ({text})");
                let refusal = Refusal::new(error_code::RESTARTED, message);
                self.end_manual(ManualEnd::refused(refusal, Next::Ready));
                self.begin_after_restart();
            }
            Phase::Adrift { .. } | Phase::Ready => {
                context.machine.is_homed = false;
                context.log(LogLevel::Warn, format!("the controller restarted by itself: {text}"));
                self.begin_after_restart();
            }
        }
    }

    /// A status report has come, and is in the machine model already.
    pub(super) fn on_status(&mut self, since: Duration) {
        let context = &mut self.context;
        match &mut self.phase {
            Phase::Connecting(connecting) => {
                let next = connecting.on_status(context);
                self.go(next);
            }
            Phase::Running(run) => {
                let exit = run.on_status(context, since);
                self.leave_run(exit);
            }
            Phase::Stopping(stopping) => {
                let next = stopping.on_status(context);
                self.end_stop(next);
            }
            Phase::Manual(operation) => {
                if let Some(end) = operation.on_status(context) {
                    self.end_manual(end);
                }
            }
            Phase::Ready => context.ask_about_new_offset(),
            Phase::Closed { .. } | Phase::Adrift { .. } => {}
        }
    }

    fn on_text(&mut self, text: &str) {
        if was_a_banner(text) {
            return self.on_damaged_banner(text);
        }
        if let Phase::Connecting(connecting) = &mut self.phase {
            connecting.on_garbage(text);
        }
        self.context.log(LogLevel::Info, format!("controller: {text}"));
    }

    fn on_fault(&mut self, fault: &LinkFault) {
        let text = fault.to_string();
        if let LinkFault::Damaged { text } = fault
            && was_a_banner(text)
        {
            return self.on_damaged_banner(text);
        }
        match &mut self.phase {
            Phase::Closed { .. } | Phase::Adrift { .. } => {}
            Phase::Connecting(connecting) => {
                let next = connecting.on_fault(&mut self.context, fault);
                self.go(next);
            }
            // It is being stopped already, and a reset forgets all counts.
            Phase::Stopping(_) => {}
            Phase::Running(_) => {
                self.context.log(LogLevel::Error, text.clone());
                self.stop_run(RunVerdict::aborted(error_code::PROTOCOL, text));
            }
            Phase::Manual(operation) => {
                // What moves is brought to a stop; the count is settled by the reset.
                if operation.task.moves() {
                    self.context.send_hold();
                }
                let next = Next::adrift(format!("{text}; soft_reset to go on"));
                let refusal = Refusal::new(error_code::PROTOCOL, text);
                self.end_manual(ManualEnd::refused(refusal, next));
            }
            Phase::Ready => self.context.log(LogLevel::Warn, text),
        }
    }

    fn on_silence(&mut self) {
        const TEXT: &str = "the controller does not answer; motion may continue";
        if matches!(self.phase, Phase::Closed { .. } | Phase::Connecting(_)) {
            return;
        }
        let context = &mut self.context;
        if self.phase.is_at_work() || context.machine.is_moving() {
            context.machine.needs_acknowledgement = true;
        }
        context.machine.is_silent = true;
        context.log(LogLevel::Error, TEXT);
        let next = Next::adrift(format!("LINK_LOST: {TEXT}; soft_reset to go on"));
        match &self.phase {
            Phase::Running(_) | Phase::Stopping(_) => {
                self.end_run(RunVerdict::aborted(error_code::LINK_LOST, TEXT), next);
                // It may still arrive; if the link comes back it is looked for.
                self.context.send_hold();
            }
            Phase::Manual(operation) => {
                let moves = operation.task.moves();
                let refusal = Refusal::new(error_code::LINK_LOST, TEXT);
                self.end_manual(ManualEnd::refused(refusal, next));
                if moves {
                    self.context.send_hold();
                }
            }
            _ => self.go(Some(next)),
        }
    }
}
