//! A tool change: what is refused while it waits, and the way back into the run.
//!
//! The run goes on from the place in the machine frame where it stopped and with the words
//! that were in force there, and from nowhere else. What the operator does in between is
//! in `driver/paused.rs`.

use super::exit::{Exit, RunVerdict};
use super::{ProgramRun, Stage, Then};
use crate::codes::error_code;
use crate::driver::answer::{Answer, Refusal, done, refused};
use crate::driver::context::Context;
use crate::driver::context::config::RETURN_TOLERANCE_MM;
use crate::driver::context::machine::Machine;
use crate::driver::context::place::show;
use crate::link::realtime;
use crate::report::ControllerState;
use cnc_msgs::contour::{Action, Source};
use cnc_msgs::geometry::Position;
use cnc_msgs::machine::Mode;
use cnc_msgs::path::CompensatedPath;

/// Where the tool change began.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::driver) struct ToolChange {
    pub(in crate::driver) tool: u32,
    pub(in crate::driver) source: Source,
    /// In the machine frame; `None` when it was not known.
    pub(in crate::driver) stood_at: Option<Position>,
    /// A manual operation has begun since: the words in force are no longer certain.
    pub(in crate::driver) is_touched: bool,
}

/// How the run gets back to where it stopped.
#[derive(Debug, Clone, Copy, PartialEq)]
enum ToolReturn {
    There,
    /// The place, and where the tool is.
    Back(Position, Position),
}

impl ProgramRun {
    /// The tool change that it waits for.
    pub(in crate::driver) fn tool_change(&self) -> Option<&ToolChange> {
        if let Stage::ToolChange(change) = &self.stage { Some(change) } else { None }
    }

    /// A manual operation or a block begins while the tool is changed.
    pub(in crate::driver) fn touch(&mut self) {
        if let Stage::ToolChange(change) = &mut self.stage {
            change.is_touched = true;
        }
    }

    /// The tool is in: goes on from where the run stopped, if the tool stands there.
    pub(in crate::driver) fn confirm_tool_change(
        &mut self,
        context: &mut Context,
        objection: Option<String>,
    ) -> Answer {
        let (mode, at) = (context.machine.mode(), context.machine.machine_position());
        let returns = context.config.tool_change_return;
        let change = match &self.stage {
            Stage::ToolChange(change) => *change,
            Stage::Draining(Then::ControllerChange { .. }) => {
                if !context.machine.is_state(&ControllerState::Tool) {
                    let text = "the controller does not wait for a tool";
                    return refused(error_code::NOTHING_TO_DO, text);
                }
                if self.is_held() {
                    return refused(error_code::BUSY, "the run is held: resume first");
                }
                if let Some(objection) = objection {
                    return refused(error_code::TOOL, objection);
                }
                context.link.send_realtime(realtime::RESUME);
                return done("cycle start was sent: the controller finishes the tool change");
            }
            _ => return refused(error_code::NOTHING_TO_DO, NO_CHANGE),
        };
        if mode != Mode::Idle || self.is_held() {
            let text = format!("the machine is in {}: resume first", mode.name());
            return refused(error_code::BUSY, text);
        }
        if self.rest.is_some() {
            let text = "the rest of the program is being checked: try again";
            return refused(error_code::BUSY, text);
        }
        if let Some(objection) = objection {
            return refused(error_code::TOOL, objection);
        }
        let way = match tool_return(change, at) {
            Ok(ToolReturn::Back(stood, at)) if !returns => {
                let text = format!(
                    "the run stopped at {} in the machine frame and the tool is at {}: jog it there \
                     in the machine frame and confirm again, or set tool_change_return",
                    show(stood),
                    show(at)
                );
                return refused(error_code::START_POSITION, text);
            }
            Ok(way) => way,
            Err(refusal) => return Some(Err(refusal)),
        };
        let pushed = match way {
            ToolReturn::There if !change.is_touched => Ok(()),
            ToolReturn::There => self.encoder.go_on_after_change(None),
            ToolReturn::Back(stood, at) => self.encoder.go_on_after_change(Some((stood, at))),
        };
        if let Err(problem) = pushed {
            return refused(error_code::NOT_ENCODABLE, problem.to_string());
        }
        context.machine.spindle_tool = Some(change.tool);
        self.watch_from(context, change.is_touched);
        self.go_on();
        done(match way {
            ToolReturn::There => "the run goes on",
            ToolReturn::Back(..) => {
                "the tool goes back to where the run stopped, and the run goes on"
            }
        })
    }

    /// After the way back: whether it ended where the run stopped.
    pub(super) fn check_return(&mut self, machine: &Machine, stood: Position) -> Option<Exit> {
        let at = machine.machine_position();
        if at.is_some_and(|at| is_at(at, stood)) {
            self.go_on();
            return None;
        }
        let at = at.map_or_else(|| "a place that is not known".into(), show);
        let text = format!(
            "the way back after the tool change ended at {at} and not at {} in the machine frame",
            show(stood)
        );
        Some(Exit::over(RunVerdict::aborted(error_code::START_POSITION, text)))
    }
}

/// The answer to a confirmation that nothing waits for.
pub(in crate::driver) const NO_CHANGE: &str = "no tool change was asked for";

/// Whether a block may be run while a tool is changed.
pub(in crate::driver) fn check_block(path: &CompensatedPath) -> Result<(), Refusal> {
    let is_out_of_place = |action: &Action| {
        matches!(
            action,
            Action::ChangeTool { .. }
                | Action::ProgramEnd { .. }
                | Action::Stop { .. }
                | Action::Home { .. }
                | Action::Auxiliary { .. }
                // The run takes X, Y and Z back to where it stopped, and no other axis.
                | Action::Further(_)
        )
    };
    match path.events.iter().find(|event| is_out_of_place(&event.action)) {
        None => Ok(()),
        Some(event) => {
            let text = format!(
                "{} is not possible while a tool is changed: confirm_tool_change or cancel first",
                event.action.text()
            );
            Err(Refusal::new(error_code::BUSY, text))
        }
    }
}

fn is_at(at: Position, stood: Position) -> bool {
    (0..3).all(|axis| (at[axis] - stood[axis]).abs() <= RETURN_TOLERANCE_MM)
}

fn tool_return(change: ToolChange, at: Option<Position>) -> Result<ToolReturn, Refusal> {
    match (change.stood_at, at) {
        (Some(stood), Some(at)) if is_at(at, stood) => Ok(ToolReturn::There),
        (Some(stood), Some(at)) => Ok(ToolReturn::Back(stood, at)),
        // This driver cannot have moved it: a jog needs the position too.
        _ if !change.is_touched => Ok(ToolReturn::There),
        _ => {
            let text = "the position of the tool is not known, so it may not be where the run \
                        stopped: cancel, and start at the first line after the tool change";
            Err(Refusal::new(error_code::START_POSITION, text))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::contour::Source;
    use cnc_msgs::further::{FurtherAxes, FurtherMode, FurtherMove};
    use cnc_msgs::path::PathEvent;

    #[test]
    fn the_run_goes_on_where_it_stopped_and_a_position_that_is_not_known_is_not_there() {
        let change = |stood_at, is_touched| ToolChange {
            tool: 2,
            source: Source::default(),
            stood_at,
            is_touched,
        };
        let place = [10.0, -20.0, 5.0];
        let lifted = [10.0, -20.0, 25.0];
        for (change, at, wanted) in [
            (change(Some(place), true), Some([10.01, -20.0, 5.0]), Some(ToolReturn::There)),
            (change(Some(place), true), Some(lifted), Some(ToolReturn::Back(place, lifted))),
            // A hand wheel that the controller has of its own.
            (change(Some(place), false), Some(lifted), Some(ToolReturn::Back(place, lifted))),
            (change(None, false), None, Some(ToolReturn::There)),
            (change(Some(place), true), None, None),
            (change(None, true), Some(place), None),
        ] {
            assert_eq!(tool_return(change, at).ok(), wanted, "{change:?} {at:?}");
        }
    }

    #[test]
    fn a_block_during_a_tool_change_turns_no_axis_that_the_run_does_not_take_back() {
        let with = |action| {
            let events = vec![PathEvent { at_element: 0, action, source: Source::default() }];
            CompensatedPath { events, ..CompensatedPath::default() }
        };
        let axes = FurtherAxes::NONE.with(0, 90.0);
        let turns = Action::Further(FurtherMove { axes, mode: FurtherMode::Rapid });
        let refused = check_block(&with(turns)).expect_err("a refusal");
        assert!(refused.message.starts_with("G0 A90 is not possible"), "{refused:?}");
        assert!(check_block(&with(Action::Dwell { seconds: 1.0 })).is_ok());
    }
}
