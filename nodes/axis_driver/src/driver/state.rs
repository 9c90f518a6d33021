//! The machine state that the driver publishes: the facts of the machine model, and the
//! mode and reason that follow from the phase.

use super::context::Origin;
use super::deactivate::INACTIVE;
use super::{Driver, Output, Phase};
use crate::codes;
use cnc_msgs::machine::{LinkWatch, MachineState, Mode};
use std::time::Duration;

impl Driver {
    /// What is known of the machine now.
    pub fn state(&self, now: Duration) -> MachineState {
        let mut state = self.compose();
        state.link_age_s = match self.last_report_at() {
            Some(at) => now.saturating_sub(at).as_secs_f64(),
            None => f64::INFINITY,
        };
        state
    }

    /// Gives the state when it has changed.
    pub(super) fn publish(&mut self) {
        let state = self.compose();
        if self.published.as_ref() != Some(&state) {
            self.published = Some(state.clone());
            let link_age_s = self.state(self.context.now).link_age_s;
            self.context.outputs.push_back(Output::State(MachineState { link_age_s, ..state }));
        }
    }

    /// The state without the age of the link.
    pub(super) fn compose(&self) -> MachineState {
        let mut state = self.context.machine.state();
        self.compose_mode(&mut state);
        state
    }

    /// Judges mode and reason from the phase and from what was heard.
    fn compose_mode(&self, state: &mut MachineState) {
        let (machine, link) = (&self.context.machine, &self.context.link);
        if machine.is_silent {
            state.mode = Mode::Unknown;
        }
        state.motion_possible = machine.is_silent || machine.is_lost;
        state.link_watch = match &self.phase {
            Phase::Closed { .. } | Phase::Connecting(_) => LinkWatch::Unknown,
            _ => link.watch(machine.reports_buffer()),
        };
        match &self.phase {
            Phase::Closed { reason } => {
                state.mode = if machine.is_lost { Mode::Unknown } else { Mode::Disconnected };
                state.reason.clone_from(reason);
                (state.machine_position, state.work_position) = (None, None);
            }
            Phase::Connecting(connecting) => {
                state.mode = Mode::Unknown;
                state.reason = format!("CONNECTING: {}", connecting.describe());
                if !connecting.has_settings() {
                    (state.machine_position, state.work_position) = (None, None);
                }
            }
            Phase::Adrift { reason } => {
                state.reason.clone_from(reason);
                state.needs_reset = true;
            }
            Phase::Manual(operation) => state.mode = operation.mode(state.mode),
            Phase::Running(run) => run.compose_mode(state, machine.is_held()),
            Phase::Stopping(stopping) => stopping.compose_mode(state),
            Phase::Ready => {}
        }
        self.compose_paused(state);
        if !state.reason.is_empty() {
            return;
        }
        state.reason = match state.mode {
            Mode::Alarm if state.alarm_code > 0 => {
                codes::describe_alarm(machine.firmware, state.alarm_code)
            }
            Mode::Alarm => "ALARM: locked; home or unlock".into(),
            Mode::Hold => match link.oldest() {
                Some(Origin::Program { text, source, events, .. }) if text == "M0" => {
                    let (message, line) = match &self.phase {
                        Phase::Running(run) => {
                            (run.message_before(*events), run.job.line_of(*source))
                        }
                        _ => (None, format!("line {}", source.line)),
                    };
                    let message = message.map_or_else(String::new, |text| format!("{text}; "));
                    format!("PROGRAM_STOP: {message}resume to go on ({line})")
                }
                _ => "FEED_HOLD".into(),
            },
            Mode::Unknown => "no status report has been received yet".into(),
            _ if !self.is_active => INACTIVE.into(),
            _ => String::new(),
        };
    }
}
