//! Which end of a run changes the parameter file.
//!
//! Knows what the newest programs leave, and the newest run. Writing is the shell's.

use super::Left;
use cnc_msgs::wire::builtin_interfaces::msg::Time;
use cnc_msgs::wire::cnc_msgs::msg::RunResult;
use cnc_msgs::wire::unique_identifier_msgs::msg::UUID;

/// Programs that are remembered: one that is loaded while another runs must not take its place.
const PROGRAMS_MAX: usize = 8;

/// Why a run that was finished leaves nothing in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Ignored {
    #[error(
        "its program is not known here: the loader was restarted since, or has loaded \
         {PROGRAMS_MAX} others; load the program again"
    )]
    UnknownProgram,
    #[error(
        "its result is older than the newest one, or than this node: a bag is played, or the \
         clock was set back"
    )]
    Older,
}

/// The programs that were loaded, and the newest run.
#[derive(Debug)]
pub struct Runs {
    /// By program id, newest last.
    programs: Vec<(String, Vec<Left>)>,
    newest: Time,
    newest_goal: Option<UUID>,
}

impl Runs {
    /// Runs that end from now on.
    pub fn since(now: Time) -> Self {
        Self { programs: Vec::new(), newest: now, newest_goal: None }
    }

    /// Remembers what a program leaves when it has run.
    pub fn loaded(&mut self, program_id: &str, left: Vec<Left>) {
        self.programs.retain(|(known, _)| known != program_id);
        self.programs.push((program_id.to_owned(), left));
        let surplus = self.programs.len().saturating_sub(PROGRAMS_MAX);
        self.programs.drain(..surplus);
    }

    /// What a run has left, for the file; nothing if it was not finished, or is known already.
    ///
    /// # Errors
    /// It was finished, and nobody knows what it has left.
    pub fn ended(&mut self, result: &RunResult) -> Result<&[Left], Ignored> {
        if self.newest_goal.as_ref() == Some(&result.goal_id) {
            return Ok(&[]);
        }
        let age = |stamp: &Time| (stamp.sec, stamp.nanosec);
        let is_older = age(&result.stamp) < age(&self.newest);
        if !is_older {
            self.newest = result.stamp.clone();
            self.newest_goal = Some(result.goal_id.clone());
        }
        if result.outcome != RunResult::OUTCOME_SUCCEEDED {
            return Ok(&[]);
        }
        if is_older {
            return Err(Ignored::Older);
        }
        let program = self.programs.iter().find(|(id, _)| *id == result.program_id);
        program.map(|(_, left)| left.as_slice()).ok_or(Ignored::UnknownProgram)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DONE: u8 = RunResult::OUTCOME_SUCCEEDED;

    fn left(number: u32) -> Vec<Left> {
        vec![Left { number, began: 7.0, value: 8.0, is_read: true }]
    }

    fn result(goal: u8, sec: i32, program_id: &str, outcome: u8) -> RunResult {
        RunResult {
            goal_id: UUID { uuid: [goal; 16] },
            stamp: Time { sec, nanosec: 0 },
            program_id: program_id.into(),
            outcome,
            ..RunResult::default()
        }
    }

    #[test]
    fn a_run_that_is_finished_now_leaves_what_its_program_does() {
        let mut runs = Runs::since(Time { sec: 100, nanosec: 0 });
        runs.loaded("first", left(31));
        // The next program is loaded while this one runs.
        runs.loaded("second", left(32));
        runs.loaded("nothing", Vec::new());
        /// Goal, time, program, outcome, and the number that is left.
        type Row = (u8, i32, &'static str, u8, Result<Option<u32>, Ignored>);
        let table: [Row; 13] = [
            (1, 99, "first", DONE, Err(Ignored::Older)),
            (2, 101, "first", RunResult::OUTCOME_UNKNOWN, Ok(None)),
            (3, 102, "first", RunResult::OUTCOME_CANCELED, Ok(None)),
            (4, 103, "first", RunResult::OUTCOME_ABORTED, Ok(None)),
            (5, 104, "first", DONE, Ok(Some(31))),
            // Heard twice, and played from a bag.
            (5, 104, "first", DONE, Ok(None)),
            (1, 99, "first", DONE, Err(Ignored::Older)),
            (3, 102, "first", RunResult::OUTCOME_CANCELED, Ok(None)),
            (5, 104, "first", DONE, Ok(None)),
            // Two runs in one tick of a clock.
            (6, 104, "second", DONE, Ok(Some(32))),
            (7, 105, "nothing", DONE, Ok(None)),
            (8, 106, "another", DONE, Err(Ignored::UnknownProgram)),
            (9, 107, "another", RunResult::OUTCOME_ABORTED, Ok(None)),
        ];
        for (goal, sec, program, outcome, wanted) in table {
            let found = runs.ended(&result(goal, sec, program, outcome));
            let number = found.map(|left| left.first().map(|it| it.number));
            assert_eq!(number, wanted, "goal {goal} of {program} at {sec} s");
        }
    }

    #[test]
    fn few_programs_are_remembered() {
        let mut runs = Runs::since(Time::default());
        for number in 0..20 {
            runs.loaded(&number.to_string(), left(31));
        }
        runs.loaded("19", Vec::new());
        assert_eq!(runs.programs.len(), PROGRAMS_MAX);
        assert_eq!((&*runs.programs[0].0, &*runs.programs[7].0), ("12", "19"));
        assert!(runs.programs[7].1.is_empty());
    }
}
