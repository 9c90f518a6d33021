//! M66: the machine stands until an input of the board is as the program waits for it, or the time is over.

use super::exit::Exit;
use super::job::Job;
use super::{ProgramRun, Stage};
use crate::codes::error_code;
use crate::driver::context::Context;
use crate::driver::output::LogLevel;
use crate::encoder::EncodedLine;
use cnc_msgs::contour::Source;
use std::time::Duration;

/// An M66 that is under way.
#[derive(Debug, Clone)]
pub(super) struct Reading {
    /// As it was sent.
    text: String,
    source: Source,
    /// When it was answered: a report from then on says what it has read, once.
    answered: Option<Duration>,
    /// That report was lost, and another with all fields was asked for.
    is_asked: bool,
}

impl Reading {
    /// `INPUT: M66L3P0Q2.5 (line 12)`
    pub(super) fn reason(&self, job: &Job) -> String {
        format!("INPUT: {} ({})", self.text, job.line_of(self.source))
    }
}

impl ProgramRun {
    /// All motion has ended: sends the line.
    pub(super) fn begin_reading(&mut self, context: &mut Context, line: EncodedLine) {
        let (text, source) = (line.text.clone(), line.source);
        self.stage = Stage::Reading(Reading { text, source, answered: None, is_asked: false });
        self.send(context, EncodedLine { is_alone: true, ..line });
    }

    /// The line was answered.
    pub(super) fn end_waiting(&mut self, context: &mut Context) {
        if let Stage::Reading(reading) = &mut self.stage {
            reading.answered = Some(context.now);
            context.link.ask_status(context.now);
        }
    }

    /// Takes a report; the controller was asked for it at `since` or later.
    pub(super) fn read_input(&mut self, context: &mut Context, since: Duration) -> Option<Exit> {
        let Stage::Reading(reading) = &mut self.stage else { return None };
        let answered = reading.answered?;
        let place = self.job.place_of(reading.source);
        let word = &reading.text;
        match context.machine.status.as_ref().and_then(|status| status.input) {
            Some(value) => {
                let (level, said) = match value {
                    -1 => (LogLevel::Warn, "waited in vain".to_owned()),
                    value => (LogLevel::Info, format!("read {value}")),
                };
                context.log(level, format!("{place}: {word} has {said}"));
                context.link.ask_for_everything(context.machine.reports_too_little());
                self.measured.inputs.push(value);
                self.go_on();
                None
            }
            // The next report has it.
            None if since <= answered => {
                context.link.ask_status(context.now);
                None
            }
            None if !std::mem::replace(&mut reading.is_asked, true) => {
                reading.answered = Some(context.now);
                context.link.ask_for_everything(true);
                context.link.ask_status(context.now);
                None
            }
            None => {
                context.link.ask_for_everything(context.machine.reports_too_little());
                let text = format!("{place}: the controller did not say what {word} has read");
                self.job.blamed_line = reading.source.line;
                Some(Exit::abort(error_code::PROTOCOL, text))
            }
        }
    }
}
