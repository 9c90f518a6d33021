//! Routes link events to the current phase.

use super::manual_operation::Task;
use super::stop::HoldWatch;
use super::{Driver, LogLevel, Origin, Phase, Refusal, RunOutcome};
use crate::codes::{self, error_code};
use crate::link::{LinkEvent, LinkFault, realtime};
use crate::report::{Message, is_lock_notice, was_a_banner};

/// The alarm of a target outside of the travel.
const SOFT_LIMIT: u16 = 2;

impl Driver {
    pub(super) fn on_event(&mut self, event: LinkEvent<Origin>) {
        match event {
            LinkEvent::Answer { tag, error } => {
                self.machine.has_just_started = false;
                self.on_answer(tag, error);
            }
            LinkEvent::Alarm(code) => self.on_alarm(code),
            LinkEvent::Banner { firmware, text } => {
                self.machine.on_restart(firmware);
                self.machine.has_just_started = true;
                self.drop_overrides("the controller has restarted");
                self.on_banner(&text);
            }
            LinkEvent::Status { report, since } => self.hear_status(*report, since),
            LinkEvent::Message(message) => {
                if let Some(bytes) = self.machine.on_message(&message) {
                    self.link.set_receive_bytes(bytes);
                }
                match message {
                    Message::Text(text) => {
                        self.log(LogLevel::Info, format!("controller: {text}"));
                        if is_lock_notice(&text) {
                            self.hear_lock_notice(&text);
                        }
                    }
                    Message::ParserState(words) => self.hear_words(&words),
                    Message::Probe { position, has_touched } => {
                        self.hear_probe(position, has_touched);
                    }
                    _ => {}
                }
            }
            LinkEvent::Setting { number, value } => self.machine.on_setting(number, &value),
            LinkEvent::NamedSetting { .. } => {}
            LinkEvent::Text(text) => self.on_text(&text),
            LinkEvent::Fault(fault) => self.on_fault(&fault),
            LinkEvent::Silent => self.on_silence(),
        }
    }

    fn on_answer(&mut self, origin: Origin, error: Option<u16>) {
        match (&mut self.phase, origin) {
            (Phase::Connecting(_), Origin::Query(index)) => self.on_query_answer(index, error),
            (Phase::Manual(_), Origin::Manual) => self.on_manual_answer(error),
            (Phase::Running(_), origin) => self.on_run_answer(origin, error),
            _ => {}
        }
    }

    fn on_alarm(&mut self, code: u16) {
        self.machine.on_alarm(code);
        let text = codes::describe_alarm(self.machine.firmware, code);
        self.log(LogLevel::Error, text.clone());
        if codes::is_deaf(self.machine.firmware, code) {
            self.link.expect_deafness();
        }
        let reason = format!("{text}; soft_reset to go on");
        // A target that cannot be reached is seen when its line is read, all else happens
        // where the tool is.
        let read = match self.link.oldest() {
            Some(Origin::Program { source_line, element, .. }) if code == SOFT_LIMIT => {
                Some((*source_line, *element))
            }
            _ => None,
        };
        match &mut self.phase {
            Phase::Running(run) if run.is_resetting() => run.add_to_verdict(&text),
            Phase::Running(run) if run.waits_for_operator() => {
                run.add_to_verdict(&text);
                self.end_with_verdict(Phase::Adrift { reason });
            }
            Phase::Running(run) => {
                run.blamed_line = read.map_or_else(|| run.line(), |(line, _)| line);
                let place = read.map_or_else(
                    || run.place(),
                    |(line, element)| run.place_of_line(line, element),
                );
                let text = format!("{text}, at {place}");
                self.end_run(RunOutcome::Aborted, error_code::ALARM, text, Phase::Adrift { reason })
            }
            Phase::Manual(operation) => {
                let is_probe =
                    matches!(operation.task, Task::Probe { .. }) && matches!(code, 4 | 5);
                let error_code =
                    if is_probe { error_code::PROBE_FAILED } else { error_code::ALARM };
                self.end_manual(Err(Refusal::new(error_code, text)), Phase::Adrift { reason });
            }
            Phase::Ready => self.phase = Phase::Adrift { reason },
            Phase::Closed { .. } | Phase::Connecting(_) | Phase::Adrift { .. } => {}
        }
    }

    pub(super) fn on_banner(&mut self, text: &str) {
        match &mut self.phase {
            Phase::Closed { .. } => {}
            Phase::Connecting(_) => self.on_connect_banner(text),
            Phase::Running(run) if run.is_resetting() => self.on_stop_banner(),
            Phase::Running(_) => {
                let message = format!(
                    "the controller restarted in the middle of the run ({text}); its position is lost: home"
                );
                self.machine.is_homed = false;
                self.machine.lost_its_place = true;
                self.end_run(RunOutcome::Aborted, error_code::RESTARTED, message, Phase::Ready);
                self.begin_queries_behind_a_restart();
            }
            Phase::Manual(_) => {
                self.machine.is_homed = false;
                self.machine.lost_its_place = true;
                let message = format!("the controller restarted ({text})");
                let refusal = Refusal::new(error_code::RESTARTED, message);
                self.end_manual(Err(refusal), Phase::Ready);
                self.begin_queries_behind_a_restart();
            }
            Phase::Adrift { .. } | Phase::Ready => {
                self.machine.is_homed = false;
                self.log(LogLevel::Warn, format!("the controller restarted by itself: {text}"));
                self.begin_queries_behind_a_restart();
            }
        }
    }

    pub(super) fn on_status(&mut self) {
        match &mut self.phase {
            Phase::Connecting(_) => self.on_connect_status(),
            Phase::Running(_) => self.on_run_status(),
            Phase::Manual(_) => self.on_manual_status(),
            _ => {}
        }
    }

    fn on_text(&mut self, text: &str) {
        if was_a_banner(text) {
            return self.on_damaged_banner(text);
        }
        if let Phase::Connecting(connecting) = &mut self.phase {
            connecting.hear_garbage(text);
        }
        self.log(LogLevel::Info, format!("controller: {text}"));
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
            Phase::Connecting(_) => self.on_connect_fault(fault),
            // It is being stopped already, and a reset forgets all counts.
            Phase::Running(run) if run.is_stopping() => {}
            Phase::Running(_) => {
                self.log(LogLevel::Error, text.clone());
                self.stop_run(RunOutcome::Aborted, error_code::PROTOCOL, text);
            }
            Phase::Manual(operation) => {
                // What moves is brought to a stop; the count is settled by the reset.
                if operation.task.moves() {
                    self.send_hold();
                }
                let next = Phase::Adrift { reason: format!("{text}; soft_reset to go on") };
                self.end_manual(Err(Refusal::new(error_code::PROTOCOL, text)), next);
            }
            Phase::Ready => self.log(LogLevel::Warn, text),
        }
    }

    fn on_silence(&mut self) {
        const TEXT: &str = "the controller does not answer; motion may continue";
        if matches!(self.phase, Phase::Closed { .. } | Phase::Connecting(_)) {
            return;
        }
        let was_active = matches!(self.phase, Phase::Running(_) | Phase::Manual(_));
        if was_active || self.machine.is_moving() {
            self.machine.needs_acknowledgement = true;
        }
        self.machine.is_silent = true;
        self.log(LogLevel::Error, TEXT.into());
        let next = || Phase::Adrift { reason: format!("LINK_LOST: {TEXT}; soft_reset to go on") };
        match &self.phase {
            Phase::Running(_) => {
                // It may still arrive; if the link comes back it is looked for.
                self.link.send_realtime(realtime::FEED_HOLD);
                let (code, text) = (error_code::LINK_LOST, TEXT.to_owned());
                self.end_run(RunOutcome::Aborted, code, text, next());
                self.hold = Some(HoldWatch::default());
            }
            Phase::Manual(operation) => {
                let moves = operation.task.moves();
                self.end_manual(Err(Refusal::new(error_code::LINK_LOST, TEXT)), next());
                if moves {
                    self.send_hold();
                }
            }
            _ => self.phase = next(),
        }
    }
}
