//! The driver's states in a bag, compared with those that its core goes through now.
//!
//! Finds both lists and words what is different; what counts as different is said in [`order`].

mod order;

use super::compare::{Comparison, Place};
use super::recording::{Recording, nanoseconds};
use axis_driver::driver::Output as DriverOutput;
use axis_driver::journal::{Entry, EntryKind};
use axis_driver::node::MOTION_LOST;
use cnc_msgs::convert::{machine_state_to_wire, mode_from_wire};
use cnc_msgs::units::position_from_point;
use cnc_msgs::wire::cnc_msgs::msg::MachineState;
use cnc_msgs::wire::geometry_msgs::msg::Point;
use cnc_msgs::wire::std_msgs::msg::Header;
use order::{Difference, Made, Published, Span};
use serde::Deserialize;
use std::ops::Range;
use std::time::Duration;

/// The states of a record: those that were published and those that the core goes through.
pub(crate) struct States {
    published: Vec<Published>,
    made: Vec<Made>,
    span: Span,
    /// How many were sent and did not come to the recorder, where it counted them.
    missed: Option<u64>,
}

impl States {
    /// `None` without a journal.
    pub(crate) fn of(
        recording: &Recording,
        entries: &[Entry],
        outputs: &[(Duration, DriverOutput)],
    ) -> Option<Self> {
        let (zero_ns, span) = span(recording, entries)?;
        let mut silences = without_ros(entries);
        silences.extend(before_the_recorder(recording, entries, zero_ns));
        let made = outputs.iter().filter_map(|(at, output)| match output {
            DriverOutput::State(state) => {
                let state = machine_state_to_wire(Header::default(), state);
                let state = recording.definitions.forget(comparable(&state));
                let since_ns = i64::try_from(at.as_nanos()).unwrap_or(i64::MAX);
                let is_unheard = silences.iter().any(|silence| silence.contains(at));
                Some(Made { at_ns: zero_ns.saturating_add(since_ns), state, is_unheard })
            }
            _ => None,
        });
        // That the driver itself is not heard, its ROS face says by itself.
        let told = recording.states.iter();
        let told = told.filter(|told| !told.state.reason.starts_with(MOTION_LOST));
        let published = told.map(|told| Published {
            published_ns: told.published_ns,
            report_ns: nanoseconds(&told.state.header.stamp),
            state: comparable(&told.state),
        });
        let (published, made) = (published.collect(), made.collect());
        Some(Self { published, made, span, missed: recording.missed_states })
    }

    /// Every state that was published is one that the core goes through, and the other way
    /// around.
    pub(crate) fn compare(&self, comparison: &mut Comparison) {
        let Self { published, made, span, missed } = self;
        let (equal, differences) = order::compare(published, made, *span);
        comparison.count("states", equal + differences.len());
        let (differences, missed) = without_missed(differences, made, *missed);
        if missed > 0 {
            let text = format!("{missed} states that were sent did not come to the recorder");
            comparison.remark("states", text);
        }
        for difference in differences {
            let (message, text, state) = match &difference {
                Difference::NotMade(index, Published { report_ns, state, .. }) => {
                    let text = format!(
                        "{} of the report at {} is not reached in this order",
                        named(state),
                        seconds(*report_ns)
                    );
                    (format!("state {index}"), text, state)
                }
                Difference::NotPublished(index, Made { at_ns, state, .. }) => {
                    let text = format!(
                        "the driver goes through {} at {}, and the bag does not have that state in \
                         this place",
                        named(state),
                        seconds(*at_ns)
                    );
                    (format!("new state {index}"), text, state)
                }
            };
            let place = Place {
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

/// Leaves out states that were sent and did not come to the recorder: a state that another one
/// follows is not sent again.
///
/// A recorder that counts says how many there were. Of a bag of another one some may be missing,
/// if nothing but the place, the feed and the speed tells them from those before and after.
fn without_missed(
    differences: Vec<Difference>,
    made: &[Made],
    missed: Option<u64>,
) -> (Vec<Difference>, usize) {
    /// Of so many states one may be missing, and two of fewer.
    const STATES_FOR_ONE: usize = 20;
    let mut each: Vec<&Made> = made.iter().collect();
    each.dedup_by(|next, before| next.state == before.state);
    let is_in_passing = |index: usize, state: &MachineState| {
        let beside = |index: Option<usize>| {
            index
                .and_then(|index| each.get(index))
                .is_some_and(|it| standing(&it.state) == standing(state))
        };
        beside(index.checked_sub(1)) && beside(index.checked_add(1))
    };
    let is_missed = |difference: &Difference| match difference {
        Difference::NotMade(..) => false,
        Difference::NotPublished(index, Made { state, .. }) => {
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

/// A state without what changes while the machine moves on.
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

/// When the driver could not be reached over ROS, on its clock: it wrote down when that began to
/// show and when it was over.
fn without_ros(entries: &[Entry]) -> Vec<Range<Duration>> {
    /// A face that hangs is noticed after one second on time.
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
                // A record that begins in the silence has not its beginning.
                silences.push(begin.unwrap_or_default()..at + FOUND);
                since = None;
            }
            (false, Some(_)) => {}
        }
    }
    silences.extend(since.map(|begin| begin..Duration::MAX));
    silences
}

/// Until when a recorder that came late has heard nothing, on the driver's clock.
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

/// What of a command says whether the driver can be reached.
#[derive(Deserialize)]
struct RosFace {
    command: String,
    #[serde(default)]
    is_there: bool,
}

/// The wall time at which the driver's clock showed zero, and what the record covers.
fn span(recording: &Recording, entries: &[Entry]) -> Option<(i64, Span)> {
    let (first, last) = (entries.first()?, entries.last()?);
    let (_, begin) = recording.traffic.get(&first.sequence)?;
    let clock_ns = |entry: &Entry| i64::try_from(entry.monotonic_ns).unwrap_or(i64::MAX);
    let batches = batches(recording, first.sequence);
    let jump_ns = jump_ns(&batches);
    let zero_ns = nanoseconds(&begin.stamp).saturating_sub(clock_ns(first)).saturating_add(jump_ns);
    let live = batches.iter().filter(|batch| batch.is_live()).map(|batch| batch.logged_ns);
    let heard = live.chain(recording.states.iter().map(|it| it.at_ns));
    let span = Span {
        begin_ns: zero_ns.saturating_add(clock_ns(first)),
        begins_at_checkpoint: first.kind == EntryKind::Checkpoint,
        end_ns: zero_ns.saturating_add(clock_ns(last)),
        heard_ns: heard.max().unwrap_or(i64::MIN),
    };
    Some((zero_ns, span))
}

/// Entries that came together; times are nanoseconds since the epoch.
struct Batch {
    /// When the recorder heard of it; of what it fetched later, when the first was written.
    logged_ns: i64,
    oldest_ns: i64,
    newest_ns: i64,
}

impl Batch {
    fn is_live(&self) -> bool {
        self.logged_ns != self.oldest_ns
    }
}

/// The journal from an entry on, by the messages that it came in.
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

/// How far the wall clock was set between the driver's start and the record: entries are stamped
/// by the clock of then.
fn jump_ns(batches: &[Batch]) -> i64 {
    /// A batch is on its way for less.
    const JUMP_NS: u64 = 1_000_000_000;
    let first = batches.iter().find(|batch| batch.is_live());
    let behind_ns = first.map_or(0, |batch| batch.logged_ns.saturating_sub(batch.newest_ns));
    if behind_ns.unsigned_abs() > JUMP_NS { behind_ns } else { 0 }
}

/// `HOLD "FEED_HOLD"`.
fn named(state: &MachineState) -> String {
    format!("{} \"{}\"", mode_from_wire(state.state).name(), state.reason)
}

/// `123.000000004 s`.
fn seconds(ns: i64) -> String {
    format!("{}.{:09} s", ns.div_euclid(1_000_000_000), ns.rem_euclid(1_000_000_000))
}

/// A state without what depends on when it was published.
fn comparable(state: &MachineState) -> MachineState {
    MachineState { header: Header::default(), link_age: 0.0, ..state.clone() }
}

#[cfg(test)]
mod tests;
