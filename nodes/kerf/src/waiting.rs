//! What a run waits for, said once for each wait, with the command that ends it.

use crate::node_message::with_commands;
use cnc_msgs::convert::mode_from_wire;
use cnc_msgs::machine::Mode;
use cnc_msgs::wire::cnc_msgs::msg::MachineState;
use intake::text::one_line;

/// The waits that were said.
#[derive(Debug, Default)]
pub(crate) struct Waits {
    said: String,
}

impl Waits {
    /// Takes the state of the machine during a run; gives what to say, if it is new.
    pub(crate) fn take(&mut self, state: &MachineState) -> Option<String> {
        let mode = mode_from_wire(state.state);
        // A probe or a block by hand in a tool change runs, too.
        if mode == Mode::Run && state.tool_wanted == 0 {
            self.said.clear();
        }
        let text = notice(mode, state)?;
        let is_new = text != self.said;
        self.said.clone_from(&text);
        is_new.then_some(text)
    }
}

/// `None` where nobody has to do anything for the run to go on.
fn notice(mode: Mode, state: &MachineState) -> Option<String> {
    // A run that ends is held on its way.
    let ends = ["STOPPING", "RESETTING"].iter().any(|word| state.reason.starts_with(word));
    if ends || state.needs_reset {
        return None;
    }
    let todo = match mode {
        Mode::ToolChange => "then `kerf confirm`",
        Mode::Door if state.pins.contains('D') => {
            "close the door, then `kerf resume`, or `kerf abort`"
        }
        // It says what to do.
        Mode::Hold if state.reason.contains("resume to go on") => "`kerf resume` or `kerf abort`",
        Mode::Hold | Mode::Door => "`kerf resume` continues, `kerf abort` cancels",
        _ => return None,
    };
    let why = match state.reason.as_str() {
        "" => mode.name().to_owned(),
        reason => with_commands(&one_line(reason)),
    };
    Some(format!("the run waits: {why}; {todo}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(mode: u8, reason: &str) -> MachineState {
        MachineState { state: mode, reason: reason.to_owned(), ..MachineState::default() }
    }

    #[test]
    fn each_wait_of_a_run_is_said_once_with_what_ends_it() {
        use MachineState as S;
        const T2: &str = "TOOL_CHANGE: put in T2 (line 3)";
        const M0: &str = "PROGRAM_STOP: resume to go on (line 5)";
        let mut waits = Waits::default();
        for (mode, reason, expected) in [
            (S::STATE_IDLE, "", None),
            (S::STATE_RUN, "", None),
            (
                S::STATE_TOOL_CHANGE,
                T2,
                Some("the run waits: TOOL_CHANGE: put in T2 (line 3); then `kerf confirm`"),
            ),
            (S::STATE_TOOL_CHANGE, T2, None),
            // By hand, in the change.
            (S::STATE_JOG, "TOOL_CHANGE: put in T2 (line 3); a jog is under way", None),
            (S::STATE_TOOL_CHANGE, T2, None),
            (S::STATE_RUN, "", None),
            (
                S::STATE_HOLD,
                M0,
                Some(
                    "the run waits: PROGRAM_STOP: resume to go on (line 5); `kerf resume` or `kerf abort`",
                ),
            ),
            (S::STATE_HOLD, M0, None),
            // The same stop in the next pass of a loop.
            (S::STATE_RUN, "", None),
            (
                S::STATE_HOLD,
                M0,
                Some(
                    "the run waits: PROGRAM_STOP: resume to go on (line 5); `kerf resume` or `kerf abort`",
                ),
            ),
            (
                S::STATE_DOOR,
                "",
                Some("the run waits: DOOR; `kerf resume` continues, `kerf abort` cancels"),
            ),
            (S::STATE_HOLD, "STOPPING: canceled", None),
            (S::STATE_HOLD, "RESETTING: canceled", None),
        ] {
            let said = waits.take(&state(mode, reason));
            assert_eq!(said.as_deref(), expected, "{mode} {reason}");
        }
    }

    #[test]
    fn a_probe_in_a_tool_change_does_not_end_the_wait() {
        const T2: &str = "TOOL_CHANGE: put in T2 (line 3)";
        let wanted = |mode| MachineState { tool_wanted: 2, ..state(mode, T2) };
        let mut waits = Waits::default();
        assert!(waits.take(&wanted(MachineState::STATE_TOOL_CHANGE)).is_some());
        for mode in [MachineState::STATE_RUN, MachineState::STATE_TOOL_CHANGE] {
            assert_eq!(waits.take(&wanted(mode)), None);
        }
    }

    #[test]
    fn an_open_door_is_to_be_closed() {
        let open = MachineState { pins: "PD".into(), ..state(MachineState::STATE_DOOR, "") };
        let said = Waits::default().take(&open);
        let expected = "the run waits: DOOR; close the door, then `kerf resume`, or `kerf abort`";
        assert_eq!(said.as_deref(), Some(expected));
    }

    #[test]
    fn a_run_that_has_ended_waits_for_nothing() {
        let held = state(MachineState::STATE_HOLD, "error:20; soft_reset to go on");
        let blocked = MachineState { needs_reset: true, ..held };
        assert_eq!(Waits::default().take(&blocked), None);
    }
}
