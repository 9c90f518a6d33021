//! What has to be the same when a whole stack runs a recording again, and what may differ.
//!
//! | what | the same |
//! |---|---|
//! | programmed contour, compensated paths | field by field, by the rules of `compare`; not their numbers and times |
//! | lines to the controller | all except the checks among them, in order; after a stop up to [`LINES_AFTER_STOP_MAX`] more or fewer |
//! | states | in order, without repetitions and durations; RUN may be missing between two others, UNKNOWN anywhere, IDLE after a stop |
//! | result of the goal, last source line | exactly |
//! | last machine position | [`STANDS_MM`]; after a stop [`NEAR_MM`] |
//! | commands | each place was reached again |
//!
//! Pure.

use super::place::{NEAR_MM, distance_mm};
use super::run::RunHistory;
use super::script::{Cue, machine_position};
use cnc_msgs::chunk::{ContourChunks, PathChunks};
use cnc_msgs::contour::ProgrammedContour as Contour;
use cnc_msgs::convert::mode_from_wire;
use cnc_msgs::wire::action_msgs::msg::GoalStatus;
use cnc_msgs::wire::cnc_msgs::msg::{MachineState, ProgrammedContour};
use replay::bounds::comparable;
use replay::compare::Comparison;
use replay::planner::compare_paths;
use replay::recording::{RecordedPlan, Recording};
use std::sync::Arc;

/// Tolerance of a standing axis, mm: some steps of a motor.
const STANDS_MM: f64 = 0.02;
/// Answers in transit when the run was stopped allow this many more lines.
const LINES_AFTER_STOP_MAX: usize = 3;

/// A recording and the run in it.
#[derive(Debug, Clone, Copy)]
pub(super) struct RecordedRun<'a> {
    pub(super) recording: &'a Recording,
    pub(super) run: &'a RunHistory<'a>,
}

/// Compares two runs.
pub(super) fn compare(was: RecordedRun<'_>, now: RecordedRun<'_>, comparison: &mut Comparison) {
    contours(was, now, comparison);
    paths(was, now, comparison);
    let stopped = was.run.was_stopped();
    let (lines_were, lines_are) = (was.run.lines(), now.run.lines());
    comparison.count("lines to the controller", lines_were.len());
    if let Some((index, text)) = lines_difference(&lines_were, &lines_are, stopped) {
        comparison.differs(&format!("line {index} to the controller"), "line", text);
    }
    let (states_were, states_are) = (states(was.run), states(now.run));
    comparison.count("states", states_were.len());
    if let Some((index, text)) = states_difference(&states_were, &states_are) {
        comparison.differs(&format!("state {index}"), "state", text);
    }
    match (was.run.status, now.run.status) {
        (None, _) => comparison.remark("result", "the bag does not contain how the goal ended"),
        (Some(was), now) => {
            comparison.count("result", 1);
            if Some(was) != now {
                let text = format!("{} became {}", outcome(was), now.map_or("UNKNOWN", outcome));
                comparison.differs("result", "outcome", text);
            }
        }
    }
    let (Some((_, last_was)), Some((_, last_is))) = (was.run.states.last(), now.run.states.last())
    else {
        return comparison.differs("last state", "count", "there is none");
    };
    comparison.count("last position", 1);
    ends(last_was, last_is, stopped, comparison);
}

/// Adds a difference for each command whose place the machine did not reach.
pub(super) fn missed(cues: &[&Cue], comparison: &mut Comparison) {
    for cue in cues {
        let text = format!(
            "it came at line {}, {}; the stack did not get there",
            cue.line,
            cue.when.text()
        );
        comparison.differs(&format!("command {}", cue.act.name()), "place", text);
    }
}

fn contours(was: RecordedRun<'_>, now: RecordedRun<'_>, comparison: &mut Comparison) {
    let find = |recorded: RecordedRun<'_>| {
        recorded.recording.programs.get(&recorded.run.goal.program_id).cloned()
    };
    let (Some(was), Some(now)) = (find(was), find(now)) else {
        return comparison.differs("programmed_contour", "count", "one of the two is missing");
    };
    comparison.message(
        "programmed_contour",
        &comparable(&was.manifest),
        &comparable(&now.manifest),
    );
    // Inputs of the core, which the node has to pass on. Later versions may add rules to the text
    // of the profile.
    let handed_on = |of: &ProgrammedContour| (of.name.clone(), of.control.clone());
    let ((name, control), is) = (handed_on(&was.manifest), handed_on(&now.manifest));
    for (field, was, now) in [("name", name, is.0), ("control", control, is.1)] {
        if was != now {
            comparison.differs("programmed_contour", field, format!("{was:?} became {now:?}"));
        }
    }
    let id = &was.manifest.program_id;
    let all = |contour: &Arc<Contour>| -> Vec<_> {
        let chunks = ContourChunks::new(id.clone(), (**contour).clone());
        (0..chunks.count()).filter_map(|index| chunks.chunk(index)).collect()
    };
    comparison.sequence("programmed_contour/chunks", &all(&was.contour), &all(&now.contour));
}

/// The plans that were run: the goal's, and each plan for the rest that was taken.
fn plans<'a>(recorded: RecordedRun<'a>) -> Vec<&'a RecordedPlan> {
    let mut revisions = vec![recorded.run.goal.revision];
    let states = recorded.run.states.iter().map(|(_, state)| state.path_revision);
    for revision in states.take_while(|revision| *revision > 0) {
        if !revisions.contains(&revision) {
            revisions.push(revision);
        }
    }
    revisions.iter().filter_map(|revision| recorded.recording.plans.get(revision)).collect()
}

fn paths(was: RecordedRun<'_>, now: RecordedRun<'_>, comparison: &mut Comparison) {
    let (were, are) = (plans(was), plans(now));
    if were.len() != are.len() {
        comparison.differs(
            "compensated_path",
            "count",
            format!("{} paths were run, {} are run now", were.len(), are.len()),
        );
    }
    for (was, now) in were.into_iter().zip(are) {
        let pair = (&was.manifest, &was.path, &now.manifest, &now.path);
        let (Some(manifest), Some(path), Some(manifest_now), Some(path_now)) = pair else {
            comparison.differs("compensated_path", "count", "one of the two was refused");
            continue;
        };
        let id = manifest_now.program_id.clone();
        let cut = PathChunks::new(id, manifest_now.revision, Arc::clone(path_now));
        let chunks: Vec<_> = (0..cut.count()).filter_map(|index| cut.chunk(index)).collect();
        compare_paths(comparison, (manifest, manifest_now), path, (path_now, &chunks));
    }
}

/// The first line that differs, with its description.
fn lines_difference(was: &[&str], now: &[&str], stopped: bool) -> Option<(usize, String)> {
    let common = was.iter().zip(now).take_while(|(was, now)| was == now).count();
    let left = (was.len() - common).max(now.len() - common);
    let is_cut = common == was.len().min(now.len());
    // If none of the lines was sent, the program did not run at all.
    let has_begun = common > 0 || was.is_empty();
    if left == 0 || (stopped && is_cut && has_begun && left <= LINES_AFTER_STOP_MAX) {
        return None;
    }
    let shown = |lines: &[&str]| match lines.get(common) {
        Some(line) => format!("{line:?}"),
        None => "nothing".to_owned(),
    };
    let text = format!(
        "{} was sent and {} is sent now; {} lines were sent, {} are",
        shown(was),
        shown(now),
        was.len(),
        now.len()
    );
    Some((common, text))
}

/// The states of a run without repetitions, and without the state at rest before it, which may have
/// been published before the bag was opened.
fn states(run: &RunHistory<'_>) -> Vec<u8> {
    // During a reset nothing is known, for less than the time between two states.
    let states = run.states.iter().map(|(_, state)| state.state);
    let states = states.filter(|state| *state != MachineState::STATE_UNKNOWN);
    let mut states: Vec<u8> =
        states.skip_while(|state| *state == MachineState::STATE_IDLE).collect();
    states.dedup();
    // The goal may end before the last state is published.
    if run.was_stopped() {
        states.pop_if(|last| *last == MachineState::STATE_IDLE);
    }
    states
}

/// The first state that is not reached again in this order, or was not reached in the recording.
///
/// A RUN between two others may be shorter than the time between two reports.
fn states_difference(was: &[u8], now: &[u8]) -> Option<(usize, String)> {
    const RUN: u8 = MachineState::STATE_RUN;
    let (mut at, mut at_now) = (0, 0);
    loop {
        match (was.get(at), now.get(at_now)) {
            (None, None) => return None,
            (Some(a), Some(b)) if a == b => (at, at_now) = (at + 1, at_now + 1),
            (Some(&RUN), _) if at > 0 && at + 1 < was.len() => at += 1,
            (_, Some(&RUN)) if at_now > 0 && at_now + 1 < now.len() => at_now += 1,
            _ => break,
        }
    }
    let names = |states: &[u8]| {
        let names: Vec<&str> = states.iter().map(|&it| mode_from_wire(it).name()).collect();
        names.join(", ")
    };
    Some((at, format!("{} became {}", names(was), names(now))))
}

fn ends(was: &MachineState, now: &MachineState, stopped: bool, comparison: &mut Comparison) {
    let within_mm = if stopped { NEAR_MM } else { STANDS_MM };
    let (a, b) = (machine_position(was), machine_position(now));
    let apart_mm = distance_mm(a, b);
    if was.position_known != now.position_known {
        let text = format!("known: {} became {}", was.position_known, now.position_known);
        comparison.differs("last position", "position_known", text);
    } else if was.position_known && (apart_mm.is_nan() || apart_mm > within_mm) {
        let place = |[x, y, z]: [f64; 3]| format!("X{x:.3} Y{y:.3} Z{z:.3}");
        let text = format!(
            "{} became {}, {apart_mm:.3} mm apart; {within_mm} mm count as the same",
            place(a),
            place(b)
        );
        comparison.differs("last position", "machine_position", text);
    }
    // At a stop, one position may be after the end of a line and the other before it.
    let lines_apart = was.line.abs_diff(now.line);
    if lines_apart > u32::from(stopped) {
        let text = format!("{} became {}", was.line, now.line);
        comparison.differs("last position", "line", text);
    }
}

fn outcome(status: i8) -> &'static str {
    match status {
        GoalStatus::STATUS_SUCCEEDED => "SUCCEEDED",
        GoalStatus::STATUS_CANCELED => "CANCELED",
        GoalStatus::STATUS_ABORTED => "ABORTED",
        GoalStatus::STATUS_EXECUTING | GoalStatus::STATUS_CANCELING => "a run without an end",
        _ => "UNKNOWN",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_the_same_in_number_and_order_except_after_a_stop() {
        for (name, was, now, stopped, at) in [
            ("all the same", &["a", "b"][..], &["a", "b"][..], false, None),
            ("another line", &["a", "b"], &["a", "c"], false, Some(1)),
            ("one is missing at the end", &["a", "b"], &["a"], false, Some(1)),
            ("one more at the end", &["a"], &["a", "b"], false, Some(1)),
            ("stopped a line earlier", &["a", "b"], &["a"], true, None),
            ("stopped a line later", &["a"], &["a", "b"], true, None),
            ("stopped much later", &["a"], &["a", "b", "c", "d", "e"], true, Some(1)),
            ("stopped, with another line", &["a", "b"], &["a", "c"], true, Some(1)),
            ("nothing is sent", &["a"; 5], &[], true, Some(0)),
            ("nothing of the few is sent", &["a", "b"], &[], true, Some(0)),
            ("stopped before the first line", &[], &["a"], true, None),
        ] {
            let found = lines_difference(was, now, stopped);
            assert_eq!(found.map(|(index, _)| index), at, "{name}");
        }
    }

    #[test]
    fn states_are_in_the_same_order_except_for_a_run_shorter_than_a_report() {
        const IDLE: u8 = MachineState::STATE_IDLE;
        const RUN: u8 = MachineState::STATE_RUN;
        const HOLD: u8 = MachineState::STATE_HOLD;
        const TOOL: u8 = MachineState::STATE_TOOL_CHANGE;
        for (name, was, now, at) in [
            ("the same", &[RUN, IDLE][..], &[RUN, IDLE][..], None),
            ("no hold", &[RUN, HOLD, RUN, IDLE], &[RUN, IDLE], Some(1)),
            ("a hold more", &[RUN, IDLE], &[RUN, HOLD, RUN, IDLE], Some(1)),
            ("a short run", &[RUN, HOLD, RUN, IDLE], &[RUN, HOLD, IDLE], None),
            ("a longer run", &[RUN, TOOL, IDLE], &[RUN, TOOL, RUN, IDLE], None),
            ("it never ran", &[RUN, IDLE], &[], Some(0)),
            ("one hold of two", &[RUN, HOLD, RUN, HOLD], &[RUN, HOLD], Some(3)),
            ("no end", &[RUN, IDLE], &[RUN], Some(1)),
            ("it ran to the last", &[RUN, HOLD, RUN], &[RUN, HOLD], Some(2)),
            ("it runs to the last", &[RUN, HOLD], &[RUN, HOLD, RUN], Some(2)),
        ] {
            let found = states_difference(was, now);
            assert_eq!(found.map(|(index, _)| index), at, "{name}");
        }
    }

    #[test]
    fn the_last_position_is_the_same_within_steps_or_within_a_stop() {
        let at = |x_mm: f64| {
            let mut state = MachineState { position_known: true, ..MachineState::default() };
            state.machine_position.x = x_mm / 1000.0;
            state
        };
        for (x_mm, line, stopped, count) in [
            (10.0, 7, false, 0),
            (10.3, 7, false, 1),
            (10.3, 7, true, 0),
            (11.0, 7, true, 1),
            (f64::NAN, 7, true, 1),
            (10.0, 6, false, 1),
            (10.3, 6, true, 0),
            (10.0, 5, true, 1),
        ] {
            let mut comparison = Comparison::default();
            let now = MachineState { line, ..at(x_mm) };
            ends(&MachineState { line: 7, ..at(10.0) }, &now, stopped, &mut comparison);
            assert_eq!(comparison.differences.len(), count, "{x_mm} {line} {stopped}");
        }
    }
}
