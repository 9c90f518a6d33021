//! Whether a recording reaches the end of its run, and how the run ended.
//!
//! A journal that stops in the middle of a run replays without a difference up to its end, and
//! nothing after that is compared. So the end must be there: the driver's core ends each run that
//! it starts. The goal of the bag must have a result, and the core must reach the same result now.

use super::compare::Comparison;
use super::driver::Played;
use super::guard::HELP;
use super::recording::Recording;
use super::run_result::{last_result, last_status};
use super::{Level, ReplayError};
use axis_driver::driver::{Output, RunOutcome, RunResult};
use axis_driver::journal::EntryKind;
use cnc_msgs::wire::action_msgs::msg::GoalStatus;
use cnc_msgs::wire::cnc_msgs::msg::RunResult as Recorded;
use serde::Deserialize;

/// How a run was started.
#[derive(Deserialize)]
struct RunStart {
    id: u64,
    command: String,
}

/// Compares how the run ended; rejects a recording that stops before.
pub(crate) fn compare(
    recording: &Recording,
    played: &Played,
    comparison: &mut Comparison,
) -> Result<(), ReplayError> {
    let ends = ends(played);
    let outcomes: Vec<_> = ends.iter().map(|end| end.map(|end| end.outcome)).collect();
    // If states differ now, those are the differences to report.
    if comparison.differences.is_empty()
        && outcomes.iter().any(Option::is_none)
        && let Some(last) = played.entries.last()
    {
        return absent(format!(
            "the journal stops in the middle of a run, with entry {} at {:.3} s of the driver's \
             clock",
            last.sequence,
            last.monotonic_ns as f64 / 1e9
        ));
    }
    let Some(goal) = recording.goal_id.as_deref() else { return Ok(()) };
    let Some(status) = result(recording, goal) else {
        return absent(format!("the result of goal {goal} (usually run_program/_action/status)"));
    };
    match compare_end(&outcomes, status) {
        Ok(()) => {
            let recorded = last_result(&recording.results, goal);
            if let Some(text) = recorded.and_then(|recorded| compare_result(&ends, recorded)) {
                comparison.differs("run_result", "message", text);
            }
            Ok(())
        }
        // A goal may end before its run starts, but not with success.
        Err(None) if comparison.differences.is_empty() => {
            absent(format!("the run of goal {goal}: no command of the journal begins it"))
        }
        Err(None) => Ok(()),
        Err(Some(text)) => {
            comparison.differs("result of the goal", "status", text);
            Ok(())
        }
    }
}

/// Whether one of these runs can have this result; with several runs, any may be the one. The error
/// is the difference, or `None` if there is no run.
fn compare_end(outcomes: &[Option<RunOutcome>], status: i8) -> Result<(), Option<String>> {
    let ends: Vec<i8> = outcomes.iter().flatten().map(|outcome| status_of(*outcome)).collect();
    match ends.as_slice() {
        [] if outcomes.is_empty() && status == GoalStatus::STATUS_SUCCEEDED => Err(None),
        [] => Ok(()),
        ends if ends.contains(&status) => Ok(()),
        ends => {
            let now: Vec<&str> = ends.iter().map(|end| word(*end)).collect();
            Err(Some(format!("{} became {}", word(status), now.join(", "))))
        }
    }
}

/// The difference between the recorded result and the driver's results of these runs; `None` if one
/// matches. The shell appends the block that caused it to the recorded message.
fn compare_result(ends: &[Option<&RunResult>], recorded: &Recorded) -> Option<String> {
    let is_same = |end: &RunResult| {
        (end.error_code, end.last_line, end.last_occurrence)
            == (recorded.error_code, recorded.last_line, recorded.last_occurrence)
            && recorded.message.starts_with(&end.message)
    };
    let mut ended = ends.iter().copied().flatten().peekable();
    ended.peek()?;
    let words = |code, message: &str, line, occurrence: u32| match occurrence {
        0 => format!("({code}) {message:?}, last line {line}"),
        number => format!("({code}) {message:?}, last line {line} for time {number}"),
    };
    let now = ended
        .clone()
        .map(|end| words(end.error_code, &end.message, end.last_line, end.last_occurrence));
    let now: Vec<String> = now.collect();
    (!ended.any(is_same)).then(|| {
        let Recorded { error_code, message, last_line, last_occurrence, .. } = recorded;
        let before = words(*error_code, message, *last_line, *last_occurrence);
        format!("{before} became {}", now.join(", "))
    })
}

fn absent(missing: String) -> Result<(), ReplayError> {
    Err(ReplayError::Absent { level: Level::Driver.name(), missing, help: HELP })
}

/// The result of each run that was active at the start, or was started and not refused; `None` for
/// a run that has not ended.
fn ends(played: &Played) -> Vec<Option<&RunResult>> {
    let outputs = || played.played.outputs.iter().map(|(_, output)| output);
    let asked = played.entries.iter().filter(|entry| entry.kind == EntryKind::Command);
    let asked = asked.filter_map(|entry| serde_json::from_slice::<RunStart>(&entry.data).ok());
    let ids = asked.filter(|asked| asked.command == "run_program").map(|asked| asked.id);
    let ids: Vec<u64> = ids.collect();
    let of_before = outputs().filter_map(|it| match it {
        Output::RunFinished(result) if !ids.contains(&result.id) => Some(Some(result)),
        _ => None,
    });
    let is_refused = |id: &u64| {
        outputs().any(|it| matches!(it, Output::Reply { id: of, result: Err(_) } if of == id))
    };
    let end = |id: u64| {
        outputs().find_map(|it| match it {
            Output::RunFinished(result) if result.id == id => Some(result),
            _ => None,
        })
    };
    let begun = ids.iter().copied().filter(|id| !is_refused(id)).map(end);
    of_before.chain(begun).collect()
}

/// The last status of a goal, if the goal has ended.
fn result(recording: &Recording, goal: &str) -> Option<i8> {
    last_status(&recording.goals, goal).filter(|status| {
        [GoalStatus::STATUS_SUCCEEDED, GoalStatus::STATUS_CANCELED, GoalStatus::STATUS_ABORTED]
            .contains(status)
    })
}

const fn status_of(outcome: RunOutcome) -> i8 {
    match outcome {
        RunOutcome::Succeeded => GoalStatus::STATUS_SUCCEEDED,
        RunOutcome::Canceled => GoalStatus::STATUS_CANCELED,
        RunOutcome::Aborted => GoalStatus::STATUS_ABORTED,
    }
}

const fn word(status: i8) -> &'static str {
    match status {
        GoalStatus::STATUS_SUCCEEDED => "SUCCEEDED",
        GoalStatus::STATUS_CANCELED => "CANCELED",
        _ => "ABORTED",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_result_of_a_run_is_the_one_of_today() {
        let end = |error_code, message: &str, last_line| RunResult {
            id: 1,
            outcome: Aborted,
            error_code,
            message: message.into(),
            last_line,
            blamed_line: 0,
            last_occurrence: 0,
        };
        use RunOutcome::Aborted;
        let recorded = Recorded {
            error_code: 309,
            message: "error:20; the block is \"G5 X1\"".into(),
            last_line: 4,
            ..Recorded::default()
        };
        let (same, other) = (end(309, "error:20", 4), end(304, "alarm", 4));
        assert_eq!(compare_result(&[Some(&other), Some(&same)], &recorded), None);
        assert_eq!(compare_result(&[None], &recorded), None);
        assert_eq!(
            compare_result(&[Some(&other)], &recorded).as_deref(),
            Some(
                "(309) \"error:20; the block is \\\"G5 X1\\\"\", last line 4 became (304) \"alarm\", \
                 last line 4"
            )
        );
    }

    #[test]
    fn a_goal_ends_as_one_of_the_runs_does() {
        use RunOutcome::{Aborted, Canceled, Succeeded};
        const GOOD: i8 = GoalStatus::STATUS_SUCCEEDED;
        const STOPPED: i8 = GoalStatus::STATUS_CANCELED;
        let became = |text: &str| Err(Some(text.to_owned()));
        for (outcomes, status, expected) in [
            (&[Some(Succeeded)][..], GOOD, Ok(())),
            (&[Some(Canceled)], GOOD, became("SUCCEEDED became CANCELED")),
            (&[Some(Aborted), Some(Succeeded)], GOOD, Ok(())),
            (&[Some(Aborted), Some(Aborted)], GOOD, became("SUCCEEDED became ABORTED, ABORTED")),
            // It was canceled before it started, or its start is not in the journal.
            (&[], STOPPED, Ok(())),
            (&[], GOOD, Err(None)),
            // The journal stops in the run: another check has already reported that.
            (&[None], GOOD, Ok(())),
        ] {
            assert_eq!(compare_end(outcomes, status), expected, "{outcomes:?} {status}");
        }
    }
}
