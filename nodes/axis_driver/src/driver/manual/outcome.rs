//! How a manual operation ended.

use super::{ManualOperation, Task, Touch, configure};
use crate::codes::error_code;
use crate::driver::answer::Refusal;
use crate::driver::context::Context;
use crate::driver::context::machine::Machine;
use crate::driver::context::place::show;
use crate::driver::output::{MoveResult, Output, RunOutcome};
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes};
use cnc_msgs::machine::Mode;

/// How far from its target a jog may end, mm or degrees: steps, and three decimals.
const JOG_TOLERANCE_MM: f64 = 0.02;

impl ManualOperation {
    /// Judges how it ended: every line is answered, and the machine stands.
    pub(in crate::driver) fn judge(&mut self, context: &mut Context) -> Result<String, Refusal> {
        let is_alarm = context.machine.mode() == Mode::Alarm;
        if let Some(stop) = self.stop.take() {
            return Err(stop);
        }
        match &self.task {
            Task::Home | Task::Unlock if is_alarm => {
                let text = "the controller accepted the command, but is still in alarm";
                Err(Refusal::new(error_code::ALARM, text))
            }
            Task::Home => Ok("homed".into()),
            Task::Unlock => {
                Ok("unlocked; the position may be wrong until the machine is homed".into())
            }
            Task::Sleep => Ok("the controller sleeps; soft_reset wakes it".into()),
            Task::SetWorkOffset { done } => {
                context.publish_settings();
                Ok(done.clone())
            }
            Task::Configure { wanted, done } => {
                context.publish_settings();
                configure::judge_mask(&context.machine, *wanted, done)
            }
            Task::Jog { target, further } => {
                let machine = &context.machine;
                let at = machine.machine_position().unwrap_or(*target);
                let places = machine.further_places().unwrap_or_default().machine;
                let further_at = further.map(|axis, to| places.get(axis).unwrap_or(to));
                let is_there = further.iter().all(|(axis, to)| {
                    let is = further_at.get(axis).unwrap_or(to);
                    (is - to).abs() <= JOG_TOLERANCE_MM + machine.further_step(axis)
                });
                if is_there
                    && (0..3).all(|axis| (at[axis] - target[axis]).abs() <= JOG_TOLERANCE_MM)
                {
                    return Ok("done".into());
                }
                let (is, to) = match further.is_empty() {
                    true => (show(at), show(*target)),
                    false => (show_further(further_at), show_further(*further)),
                };
                let text = format!(
                    "the jog ended at {is} and not at {to} in the machine frame: it was held, or \
                     cut short by the controller at the end of its travel"
                );
                Err(Refusal::new(error_code::STOPPED_SHORT, text))
            }
            Task::Probe { touch: Some(Touch { found: true, .. }), .. } => Ok("done".into()),
            Task::Probe { touch: Some(_), may_miss: true } => {
                Ok("the probe touched nothing on the way".into())
            }
            Task::Probe { .. } => {
                let text = "the controller did not say where the probe touched";
                Err(Refusal::new(error_code::PROBE_FAILED, text))
            }
        }
    }

    /// Reports the end to whoever asked for the operation.
    pub(in crate::driver) fn report(
        self,
        machine: &Machine,
        result: Result<String, Refusal>,
    ) -> Output {
        let Self { id, task, .. } = self;
        if !task.moves() {
            return Output::Reply { id, result };
        }
        let touch = match task {
            Task::Probe { touch, .. } => touch,
            _ => machine.machine_position().map(|position| {
                let further = machine.further_places().unwrap_or_default().machine;
                Touch { position, further, found: false }
            }),
        };
        let found = touch.is_some_and(|it| it.found);
        // Only a machine that stands is where it was reported last.
        let stands = match &result {
            Ok(_) => true,
            Err(refusal) => {
                matches!(refusal.error_code, error_code::CANCELED | error_code::STOPPED_SHORT)
            }
        };
        let is_place = found || stands && matches!(task, Task::Jog { .. });
        let touch = touch.filter(|_| is_place);
        let machine_position = touch.map(|it| it.position);
        let work_position = machine_position.and_then(|at| machine.in_work_frame(at));
        let (outcome, error_code, message) = match result {
            Ok(message) => (RunOutcome::Succeeded, 0, message),
            Err(Refusal { error_code: error_code::CANCELED, message }) => {
                (RunOutcome::Canceled, error_code::CANCELED, message)
            }
            Err(Refusal { error_code, message }) => (RunOutcome::Aborted, error_code, message),
        };
        Output::MoveFinished(MoveResult {
            id,
            outcome,
            error_code,
            message,
            machine_position,
            work_position,
            further: touch.map_or(FurtherAxes::NONE, |it| it.further),
            found,
        })
    }
}

/// `A90.000 B-5.000`
fn show_further(axes: FurtherAxes) -> String {
    let words = axes.iter().map(|(axis, value)| format!("{}{value:.3}", FURTHER_LETTERS[axis]));
    words.collect::<Vec<_>>().join(" ")
}
