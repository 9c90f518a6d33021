//! Every state that is removed from a golden run, or added to it, is found.

use super::order::{Made, Published, Span, StateDifference, compare};
use super::*;
use crate::compare::Comparison;
use crate::driver;
use crate::inputs::CoreInputs;
use std::path::Path;
use std::sync::Arc;

/// The states of each golden run in which today's driver does what was recorded.
fn golden_runs() -> Vec<(String, States)> {
    let bags = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags");
    let bags = std::fs::read_dir(bags).expect("bags/ is there");
    let folders = bags.map(|it| it.expect("it can be read").path()).filter(|it| it.is_dir());
    let runs = folders.filter(|folder| !folder.ends_with("rs274_older_definitions"));
    let runs: Vec<_> = runs
        .map(|folder| {
            let mut bag = run_recorder::files::open_bag(&folder).expect("a bag");
            let recording = Recording::read(&mut bag).expect("a recording");
            let definitions = Arc::new(recording.definitions.clone());
            let inputs = CoreInputs::new(recording, false);
            let (mut comparison, mut outputs) = (Comparison::new(definitions), Vec::new());
            let played = driver::replay(&inputs, &mut comparison, &mut outputs);
            let played = played.expect("a journal").expect("it is played");
            let outputs = &played.played.outputs;
            let states = States::of(&inputs.recording, &played.entries, outputs);
            (folder.display().to_string(), states.expect("a run has states"))
        })
        .collect();
    assert!(runs.len() >= 20, "{} golden runs", runs.len());
    runs
}

/// The ranges of equal published states, one range for each distinct state, from the start of the
/// journal.
fn distinct(states: &States) -> Vec<std::ops::Range<usize>> {
    let published = &states.published;
    let mut runs: Vec<std::ops::Range<usize>> = Vec::new();
    for (index, it) in published.iter().enumerate() {
        if it.published_ns < states.span.begin_ns {
            continue;
        }
        match runs.last_mut() {
            Some(run) if published[run.start].state == it.state => run.end = index + 1,
            _ => runs.push(index..index + 1),
        }
    }
    runs
}

/// The number of differences when the published states are these.
fn found(states: &States, published: &[Published]) -> usize {
    compare(published, &states.made, states.span).1.len()
}

/// Runs whose last states are not within the tolerance at the ends of a recording.
fn runs_received_to_their_end() -> Vec<(String, States)> {
    const LATE_NS: i64 = 200_000_000;
    let mut runs = golden_runs();
    runs.retain(|(_, States { published, made, span, .. })| {
        let is_made = made.last().is_some_and(|it| it.at_ns + LATE_NS <= span.last_received_ns);
        let is_published = published.iter().all(|it| it.report_ns <= span.end_ns);
        is_made && is_published
    });
    assert!(runs.len() >= 10, "{} golden runs are left", runs.len());
    runs
}

#[test]
fn every_golden_run_has_every_state_once_and_in_order() {
    for (name, states) in golden_runs() {
        let (equal, differences) = compare(&states.published, &states.made, states.span);
        assert!(differences.is_empty(), "{name}: {differences:?}");
        assert_eq!(equal, distinct(&states).len(), "{name}");
    }
}

#[test]
fn each_single_state_is_missed_and_one_of_its_repetitions_is_not() {
    let (mut missed, mut repeated) = (0, 0);
    for (name, states) in runs_received_to_their_end() {
        for run in distinct(&states) {
            let mut left = states.published.clone();
            left.drain(run.clone());
            assert!(found(&states, &left) > 0, "{name}: {:?}", states.published[run.start]);
            missed += 1;
            for one in run.clone().skip(1) {
                let mut left = states.published.clone();
                left.remove(one);
                assert_eq!(found(&states, &left), 0, "{name}: {one} equals {run:?}");
                repeated += 1;
            }
        }
    }
    assert!(missed > 500 && repeated > 500, "{missed} states, {repeated} repetitions");
}

#[test]
fn a_class_of_states_or_an_end_of_them_is_missed() {
    for (name, states) in runs_received_to_their_end() {
        let begin_ns = states.span.begin_ns;
        let is_in_time = |it: &Published| it.published_ns >= begin_ns;
        let modes: std::collections::BTreeSet<u8> =
            states.published.iter().filter(|it| is_in_time(it)).map(|it| it.state.state).collect();
        for mode in modes {
            let mut left = states.published.clone();
            left.retain(|it| it.state.state != mode);
            assert!(found(&states, &left) > 0, "{name}: without state {mode}");
            let mut left = states.published.clone();
            left.retain(|it| it.state.state == mode || !is_in_time(it));
            let is_all = left.len() == states.published.len();
            assert_eq!(found(&states, &left) == 0, is_all, "{name}: state {mode} alone");
        }
        let runs = distinct(&states);
        for run in &runs {
            for kept in [0..run.start, run.end..states.published.len(), run.start..run.start + 1] {
                let is_all = runs.iter().all(|it| it.start < kept.end && it.end > kept.start);
                let few = &states.published[kept.clone()];
                assert_eq!(found(&states, few) == 0, is_all, "{name}: only {kept:?}");
            }
        }
    }
}

#[test]
fn states_that_change_places_or_come_once_more_are_found() {
    for (name, states) in runs_received_to_their_end() {
        let runs = distinct(&states);
        for pair in runs.windows(2) {
            let mut other = states.published.clone();
            other[pair[0].start..pair[1].end].rotate_left(pair[0].len());
            assert!(found(&states, &other) > 0, "{name}: {pair:?} the other way around");
            // The previous state once more, after the next.
            let mut other = states.published.clone();
            let again = other[pair[0].start].clone();
            let at_ns = other[pair[1].end - 1].published_ns;
            let is_repetition =
                other.get(pair[1].end).is_some_and(|next| next.state == again.state);
            other.insert(pair[1].end, Published { published_ns: at_ns, ..again });
            let is_found = found(&states, &other) > 0;
            assert_ne!(is_found, is_repetition, "{name}: {pair:?} and the first again");
        }
        for at in runs.iter().flat_map(Clone::clone) {
            let changes: [fn(&mut MachineState); 4] = [
                |state| state.state ^= 1,
                |state| state.alarm_code += 1,
                |state| state.line += 1,
                |state| state.machine_position.x += 1e-6,
            ];
            for change in changes {
                let mut other = states.published.clone();
                change(&mut other[at].state);
                // A message may equal the one before it, or the one after it.
                let is_repetition = in_order(&other) == in_order(&states.published);
                let is_found = found(&states, &other) > 0;
                assert_ne!(is_found, is_repetition, "{name}: message {at} is another");
            }
        }
    }
}

/// The states without adjacent repetitions.
fn in_order(published: &[Published]) -> Vec<&MachineState> {
    let mut states: Vec<_> = published.iter().map(|it| &it.state).collect();
    states.dedup();
    states
}

#[test]
fn a_state_of_the_core_that_comes_or_goes_is_found() {
    for (name, states) in runs_received_to_their_end() {
        let found = |made: &[Made]| compare(&states.published, made, states.span).1.len();
        for index in 0..states.made.len() {
            let mut made = states.made.clone();
            let gone = made.remove(index);
            // The state of a checkpoint is not published.
            assert_eq!(found(&made) == 0, index == 0, "{name}: without {gone:?}");
            let mut made = states.made.clone();
            let mut other = gone;
            other.state.alarm_code += 1;
            made.insert(index, other);
            assert!(found(&made) > 0, "{name}: another one before {index}");
        }
    }
}

/// A state that differs from others in its line only, published and made at the same time.
fn published(at_ns: i64, line: u32) -> Published {
    let state = MachineState { line, ..MachineState::default() };
    Published { published_ns: at_ns, report_ns: at_ns, state }
}

fn made(at_ns: i64, line: u32) -> Made {
    Made { at_ns, state: published(at_ns, line).state, is_unreachable: false }
}

/// Times in milliseconds, and lines.
type Rows<'a> = &'a [(i64, u32)];

#[test]
fn the_ends_of_a_recording_are_judged_by_what_was_received_there() {
    const MS: i64 = 1_000_000;
    let span = Span {
        begin_ns: 1000 * MS,
        begins_at_checkpoint: true,
        end_ns: 5000 * MS,
        last_received_ns: 5000 * MS,
    };
    let lists = |is: Rows<'_>, was: Rows<'_>| {
        let is: Vec<_> = is.iter().map(|&(at, line)| made(at * MS, line)).collect();
        let was: Vec<_> = was.iter().map(|&(at, line)| published(at * MS, line)).collect();
        (is, was)
    };
    // The core's states, the published states, and how many of each are missing.
    let cases: [(&str, Rows<'_>, Rows<'_>, usize, usize); 12] = [
        ("alike", &[(1000, 0), (2000, 1)], &[(2000, 1), (3000, 1)], 0, 0),
        ("the checkpoint's is repeated", &[(1000, 0), (2000, 1)], &[(1500, 0), (2000, 1)], 0, 0),
        ("one of before the journal", &[(1000, 0), (2000, 1)], &[(900, 9), (2000, 1)], 0, 0),
        ("one on its way then", &[(1000, 0), (2000, 1)], &[(1100, 9), (1110, 0), (2000, 1)], 0, 0),
        ("one more there", &[(1000, 0), (2000, 1)], &[(1100, 9), (2000, 1)], 0, 1),
        ("one more later", &[(1000, 0), (2000, 1)], &[(1300, 9), (1310, 0), (2000, 1)], 0, 2),
        ("a report after the journal", &[(1000, 0), (2000, 1)], &[(2000, 1), (5100, 2)], 0, 0),
        (
            "published until long after the journal",
            &[(1000, 0), (2000, 1)],
            &[(2000, 1), (5300, 2), (5500, 2)],
            0,
            1,
        ),
        ("in the journal's time", &[(1000, 0), (2000, 1)], &[(2000, 1), (4900, 2)], 0, 1),
        ("not received any more", &[(1000, 0), (2000, 1), (4900, 2)], &[(2000, 1)], 0, 0),
        ("received, but not recorded", &[(1000, 0), (2000, 1), (4800, 2)], &[(2000, 1)], 1, 0),
        ("nothing was published", &[(1000, 0), (2000, 1)], &[], 1, 0),
    ];
    for (what, is, was, is_missed, was_missed) in cases {
        let (is, was) = lists(is, was);
        let received = was.iter().map(|it| it.published_ns);
        let last_received_ns = received.chain([span.last_received_ns]).max().expect("two times");
        let (_, differences) = compare(&was, &is, Span { last_received_ns, ..span });
        let of_now = |it: &&StateDifference| matches!(it, StateDifference::NotPublished(..));
        let count = differences.iter().filter(of_now).count();
        assert_eq!((count, differences.len() - count), (is_missed, was_missed), "{what}");
    }
}

#[test]
fn a_wall_clock_that_was_set_before_the_run_changes_nothing() {
    const SECOND: i64 = 1_000_000_000;
    let batch = |logged, oldest, newest| Batch {
        logged_ns: logged * SECOND,
        oldest_ns: oldest * SECOND,
        newest_ns: newest * SECOND,
    };
    assert_eq!(jump_ns(&[]), 0);
    assert_eq!(jump_ns(&[batch(10, 10, 19), batch(21, 20, 20)]), 0);
    // Fetched entries say nothing about the clock.
    assert_eq!(jump_ns(&[batch(10, 10, 19)]), 0);
    assert_eq!(jump_ns(&[batch(10, 10, 19), batch(3620, 20, 20)]), 3600 * SECOND);
    assert_eq!(jump_ns(&[batch(5, 30, 30), batch(40, 31, 32)]), -25 * SECOND);
}

#[test]
fn states_after_the_wall_clock_was_set_back_in_the_run_count() {
    let span = Span { begin_ns: 5, begins_at_checkpoint: false, end_ns: 9, last_received_ns: 9 };
    let made: Vec<Made> = (5..=9).map(|at| made(at, at as u32)).collect();
    let published_at = |at: &[i64]| -> Vec<Published> {
        (5..).zip(at).map(|(line, &at)| published(at, line)).collect()
    };
    assert_eq!(compare(&published_at(&[5, 6, 1, 2, 9]), &made, span), (5, Vec::new()));
    assert_eq!(compare(&published_at(&[5, 6, 1, 2]), &made[..3], span).1.len(), 1);
}

#[test]
fn only_states_while_ros_is_not_reachable_may_be_missing() {
    let made: Vec<Made> = (1..=6)
        .map(|line| Made { is_unreachable: (3..=4).contains(&line), ..made(i64::from(line), line) })
        .collect();
    let of = |lines: &[u32]| -> Vec<Published> {
        lines.iter().map(|line| published(i64::from(*line), *line)).collect()
    };
    let span = Span {
        begin_ns: 0,
        begins_at_checkpoint: false,
        end_ns: 6,
        last_received_ns: 1_000_000_000,
    };
    for (received, differences) in [
        (&[1, 2, 3, 4, 5, 6][..], 0),
        (&[1, 2, 5, 6], 0),
        (&[1, 2, 4, 5, 6], 0),
        (&[1, 2, 3, 4, 6], 1),
        (&[2, 3, 4, 5, 6], 1),
        (&[1, 2, 4, 3, 5, 6], 1),
    ] {
        assert_eq!(compare(&of(received), &made, span).1.len(), differences, "{received:?}");
    }
}

#[test]
fn as_many_states_may_be_missing_as_did_not_arrive() {
    const HOLD: u8 = MachineState::STATE_HOLD;
    let mut all: Vec<Made> = (1..=40).map(|line| made(i64::from(line), line)).collect();
    all[9].state.state = HOLD;
    let span = Span {
        begin_ns: 0,
        begins_at_checkpoint: false,
        end_ns: 40,
        last_received_ns: 1_000_000_000,
    };
    let published_at = |gone: &[u32]| -> Vec<Published> {
        let kept = all.iter().filter(|it| !gone.contains(&it.state.line));
        let at = |it: &Made| Published {
            published_ns: it.at_ns,
            report_ns: it.at_ns,
            state: it.state.clone(),
        };
        kept.map(at).collect()
    };
    // Lines whose states are removed, how many the recorder counted, and how many are differences.
    for (gone, missed, different) in [
        (&[][..], Some(0), 0),
        (&[20], Some(0), 1),
        (&[20], Some(1), 0),
        (&[10], Some(1), 0),
        (&[20, 30], Some(1), 2),
        (&[20, 30], Some(7), 0),
        // A recorder that does not count: two of forty, within a motion.
        (&[20, 30], None, 0),
        (&[20, 25, 30], None, 3),
        (&[10], None, 1),
        (&[9], None, 1),
        (&[10, 20], None, 1),
    ] {
        let (_, differences) = compare(&published_at(gone), &all, span);
        let (left, forgiven) = without_missed(differences, &all, missed);
        assert_eq!(left.len(), different, "{gone:?} {missed:?}");
        assert_eq!(left.len() + forgiven, gone.len(), "{gone:?} {missed:?}");
    }
}
