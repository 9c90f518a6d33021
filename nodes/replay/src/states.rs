//! Compares the driver's states in a bag with those that its core goes through now.
//!
//! Builds both lists and words the differences; [`order`] compares them.

mod order;

use super::compare::{Comparison, DifferencePlace};
use super::recording::{Recording, nanoseconds};
use axis_driver::driver::Output;
use axis_driver::journal::{Entry, EntryKind};
use axis_driver::protocol::MOTION_LOST;
use cnc_msgs::convert::{machine_state_to_wire, mode_from_wire};
use cnc_msgs::units::position_from_point;
use cnc_msgs::wire::cnc_msgs::msg::MachineState;
use cnc_msgs::wire::geometry_msgs::msg::Point;
use cnc_msgs::wire::std_msgs::msg::Header;
use order::{Made, Published, Span, StateDifference};
use serde::Deserialize;
use std::ops::Range;
use std::time::Duration;

/// The published states of a recording, and those that the core goes through now.
pub(crate) struct States {
    published: Vec<Published>,
    made: Vec<Made>,
    span: Span,
    /// How many were sent but did not reach the recorder, if it counted them.
    missed: Option<u64>,
    /// Where the times of the report begin, ns since the epoch.
    begin_ns: i64,
}

impl States {
    /// `None` without a journal.
    pub(crate) fn of(
        recording: &Recording,
        entries: &[Entry],
        outputs: &[(Duration, Output)],
    ) -> Option<Self> {
        let (zero_ns, span) = span(recording, entries)?;
        let mut silences = without_ros(entries);
        silences.extend(before_the_recorder(recording, entries, zero_ns));
        let made = outputs.iter().filter_map(|(at, output)| match output {
            Output::State(state) => {
                let state = machine_state_to_wire(Header::default(), state);
                let state = recording.definitions.forget(comparable(&state));
                let since_ns = i64::try_from(at.as_nanos()).unwrap_or(i64::MAX);
                let is_unreachable = silences.iter().any(|silence| silence.contains(at));
                Some(Made { at_ns: zero_ns.saturating_add(since_ns), state, is_unreachable })
            }
            _ => None,
        });
        // The ROS side itself publishes that the driver is not reachable.
        let recorded = recording.states.iter();
        let recorded = recorded.filter(|recorded| !recorded.state.reason.starts_with(MOTION_LOST));
        let published = recorded.map(|recorded| Published {
            published_ns: recorded.published_ns,
            report_ns: nanoseconds(&recorded.state.header.stamp),
            state: comparable(&recorded.state),
        });
        let (published, made) = (published.collect(), made.collect());
        let begin_ns = recording.begin_ns().unwrap_or(span.begin_ns);
        Some(Self { published, made, span, missed: recording.missed_states, begin_ns })
    }

    /// Checks that the core goes through every published state, and that every state of the core
    /// was published.
    pub(crate) fn compare(&self, comparison: &mut Comparison) {
        let Self { published, made, span, missed, begin_ns } = self;
        let since_begin = |ns: i64| seconds(ns.saturating_sub(*begin_ns));
        let (equal, differences) = order::compare(published, made, *span);
        comparison.count("states", equal + differences.len());
        let (differences, missed) = without_missed(differences, made, *missed);
        if missed > 0 {
            let text = format!("{missed} states were sent and did not reach the recorder");
            comparison.remark("states", text);
        }
        for difference in differences {
            let (message, text, state) = match &difference {
                StateDifference::NotMade(index, Published { report_ns, state, .. }) => {
                    let text = format!(
                        "{} at {} was recorded here, and does not occur now",
                        named(state),
                        since_begin(*report_ns)
                    );
                    (format!("state {index}"), text, state)
                }
                StateDifference::NotPublished(index, Made { at_ns, state, .. }) => {
                    let text = format!(
                        "{} at {} occurs now, and was not recorded here",
                        named(state),
                        since_begin(*at_ns)
                    );
                    (format!("new state {index}"), text, state)
                }
            };
            let place = DifferencePlace {
                line: state.line,
                position: state.position_known.then(|| position_from_point(&state.work_position)),
                distance_mm: None,
            };
            comparison.differs_at(&message, "state", text, place);
        }
        if equal == 0 {
            comparison.differs(
                "states",
                "count",
                "no state was published while the journal was written",
            );
        }
    }
}

/// Removes states that were sent but did not reach the recorder: a state is not sent again once
/// another follows.
///
/// A recorder that counts them gives the number. For other recorders a few states may be missing,
/// if they differ from their neighbours only in position, feed and speed.
fn without_missed(
    differences: Vec<StateDifference>,
    made: &[Made],
    missed: Option<u64>,
) -> (Vec<StateDifference>, usize) {
    /// One state in so many may be missing; two of shorter lists.
    const STATES_FOR_ONE: usize = 20;
    let mut each: Vec<&Made> = made.iter().collect();
    each.dedup_by(|next, before| next.state == before.state);
    let is_in_passing = |index: usize, state: &MachineState| {
        let is_like = |index: Option<usize>| {
            index
                .and_then(|index| each.get(index))
                .is_some_and(|it| standing(&it.state) == standing(state))
        };
        is_like(index.checked_sub(1)) && is_like(index.checked_add(1))
    };
    let is_missed = |difference: &StateDifference| match difference {
        StateDifference::NotMade(..) => false,
        StateDifference::NotPublished(index, Made { state, .. }) => {
            missed.is_some() || is_in_passing(*index, state)
        }
    };
    let most = match missed {
        Some(missed) => usize::try_from(missed).unwrap_or(usize::MAX),
        None => (each.len() / STATES_FOR_ONE).max(2),
    };
    let count = differences.iter().filter(|it| is_missed(it)).count();
    if count > most {
        return (differences, 0);
    }
    let kept = differences.into_iter().filter(|it| !is_missed(it)).collect();
    (kept, count)
}

/// A state without the fields that change while the machine moves.
fn standing(state: &MachineState) -> MachineState {
    MachineState {
        machine_position: Point::default(),
        work_position: Point::default(),
        line: 0,
        feed_rate: 0.0,
        spindle_speed: 0.0,
        cutter_radius_active_left: false,
        cutter_radius_active_right: false,
        ..state.clone()
    }
}

/// When the driver was not reachable over ROS, on its clock: from when the journal first shows it
/// until it was over.
fn without_ros(entries: &[Entry]) -> Vec<Range<Duration>> {
    /// A face that hangs is noticed after one second at the latest; with margin.
    const NOTICED: Duration = Duration::from_secs(3);
    /// The recorder has found the next face by then.
    const FOUND: Duration = Duration::from_secs(5);
    let faces = entries.iter().filter(|entry| entry.kind == EntryKind::Command);
    let faces = faces.filter_map(|entry| {
        let command: RosFace = serde_json::from_slice(&entry.data).ok()?;
        let is_meant = command.command == "ros_face";
        is_meant.then_some((Duration::from_nanos(entry.monotonic_ns), command.is_there))
    });
    let (mut silences, mut since) = (Vec::new(), None);
    for (at, is_there) in faces {
        match (is_there, since) {
            (false, None) => since = Some(at.saturating_sub(NOTICED)),
            (true, begin) => {
                // The beginning of the outage may be before the recording.
                silences.push(begin.unwrap_or_default()..at + FOUND);
                since = None;
            }
            (false, Some(_)) => {}
        }
    }
    silences.extend(since.map(|begin| begin..Duration::MAX));
    silences
}

/// Until when a recorder that started late had received nothing, on the driver's clock.
fn before_the_recorder(
    recording: &Recording,
    entries: &[Entry],
    zero_ns: i64,
) -> Option<Range<Duration>> {
    /// It finds one topic sooner than another.
    const FOUND: Duration = Duration::from_secs(1);
    let first = entries.first().filter(|_| recording.begins_late)?;
    let batches = batches(recording, first.sequence);
    let live = batches.iter().find(|batch| batch.is_live())?;
    let since_ns = u64::try_from(live.logged_ns.saturating_sub(zero_ns)).unwrap_or(0);
    Some(Duration::ZERO..Duration::from_nanos(since_ns) + FOUND)
}

/// The fields of a command that say whether the driver is reachable.
#[derive(Deserialize)]
struct RosFace {
    command: String,
    #[serde(default)]
    is_there: bool,
}

/// The wall time at which the driver's clock was zero, and what the recording covers.
fn span(recording: &Recording, entries: &[Entry]) -> Option<(i64, Span)> {
    let (first, last) = (entries.first()?, entries.last()?);
    let (_, begin) = recording.traffic.get(&first.sequence)?;
    let clock_ns = |entry: &Entry| i64::try_from(entry.monotonic_ns).unwrap_or(i64::MAX);
    let batches = batches(recording, first.sequence);
    let jump_ns = jump_ns(&batches);
    let zero_ns = nanoseconds(&begin.stamp).saturating_sub(clock_ns(first)).saturating_add(jump_ns);
    let live = batches.iter().filter(|batch| batch.is_live()).map(|batch| batch.logged_ns);
    let received = live.chain(recording.states.iter().map(|it| it.at_ns));
    let span = Span {
        begin_ns: zero_ns.saturating_add(clock_ns(first)),
        begins_at_checkpoint: first.kind == EntryKind::Checkpoint,
        end_ns: zero_ns.saturating_add(clock_ns(last)),
        last_received_ns: received.max().unwrap_or(i64::MIN),
    };
    Some((zero_ns, span))
}

/// Entries that arrived together; times are nanoseconds since the epoch.
struct Batch {
    /// When the recorder received it; for fetched entries, when the first was written.
    logged_ns: i64,
    oldest_ns: i64,
    newest_ns: i64,
}

impl Batch {
    fn is_live(&self) -> bool {
        self.logged_ns != self.oldest_ns
    }
}

/// The journal from an entry on, by the messages that carried it.
fn batches(recording: &Recording, first: u64) -> Vec<Batch> {
    let mut batches: Vec<Batch> = Vec::new();
    for (logged_ns, entry) in recording.traffic.range(first..).map(|(_, row)| row) {
        let logged_ns = i64::try_from(*logged_ns).unwrap_or(i64::MAX);
        let at_ns = nanoseconds(&entry.stamp);
        match batches.last_mut() {
            Some(batch) if batch.logged_ns == logged_ns => batch.newest_ns = at_ns,
            _ => batches.push(Batch { logged_ns, oldest_ns: at_ns, newest_ns: at_ns }),
        }
    }
    batches
}

/// How far the wall clock was set between the driver's start and the recording: entries are stamped
/// by the clock at the driver's start.
fn jump_ns(batches: &[Batch]) -> i64 {
    /// Transport takes less than this.
    const JUMP_NS: u64 = 1_000_000_000;
    let first = batches.iter().find(|batch| batch.is_live());
    let delay_ns = first.map_or(0, |batch| batch.logged_ns.saturating_sub(batch.newest_ns));
    if delay_ns.unsigned_abs() > JUMP_NS { delay_ns } else { 0 }
}

/// `HOLD "FEED_HOLD"`, `IDLE`.
fn named(state: &MachineState) -> String {
    let mode = mode_from_wire(state.state).name();
    match state.reason.as_str() {
        "" => mode.to_owned(),
        reason => format!("{mode} \"{reason}\""),
    }
}

/// `12.345 s`, as on the page of a run.
fn seconds(ns: i64) -> String {
    format!("{:.3} s", Duration::from_nanos(ns.unsigned_abs()).as_secs_f64())
}

/// A state without the fields that depend on its publication time.
fn comparable(state: &MachineState) -> MachineState {
    MachineState { header: Header::default(), link_age: 0.0, ..state.clone() }
}

#[cfg(test)]
mod tests;
