//! Compares two ordered lists of states: what was published, and what the core goes through now.
//!
//! The driver publishes a state whenever it changes, and repeats the newest at a steady rate. So
//! both lists are the same without repetitions. Only at the ends of the recording may one list
//! have states that the other cannot have; see [`compare`].

use cnc_msgs::wire::cnc_msgs::msg::MachineState;

/// How much later than the driver's other messages a state may arrive, or an entry of the journal
/// on its topic, ns. On a computer that is not busy it is some milliseconds.
const LATE_NS: i64 = 200_000_000;
/// The comparison stops after this many differences.
const DIFFERENCES_MAX: usize = 1000;

/// A published state; times are nanoseconds since the epoch.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Published {
    pub(crate) published_ns: i64,
    /// When its report arrived, as exactly as the driver's clock says.
    pub(crate) report_ns: i64,
    pub(crate) state: MachineState,
}

/// A state that the core goes through now.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Made {
    /// When the entry was written that leads to it.
    pub(crate) at_ns: i64,
    pub(crate) state: MachineState,
    /// The driver was not reachable over ROS then: the state may not have reached the recorder.
    pub(crate) is_unreachable: bool,
}

/// What the journal and the recorder cover, nanoseconds since the epoch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Span {
    /// The first entry that is played.
    pub(crate) begin_ns: i64,
    /// The first entry is a checkpoint: its state is known, but was not published then.
    pub(crate) begins_at_checkpoint: bool,
    pub(crate) end_ns: i64,
    /// Last time at which the recorder received anything from the driver.
    pub(crate) last_received_ns: i64,
}

/// A state that only one of the lists has at its place.
#[derive(Debug, PartialEq)]
pub(crate) enum StateDifference {
    /// It was published; the number counts published states without repetitions.
    NotMade(usize, Published),
    /// The core goes through it, but the bag lacks it; the number counts the core's states.
    NotPublished(usize, Made),
}

/// Compares the lists; the number is how many states both have.
///
/// At the beginning, the state of a checkpoint is published only if it is repeated, and an earlier
/// one may still have been in transit. At the end, the journal may stop a moment before the topic,
/// or the recorder a moment before the journal.
pub(crate) fn compare(
    published: &[Published],
    made: &[Made],
    span: Span,
) -> (usize, Vec<StateDifference>) {
    // States from before the journal cannot be made again. Later the clock may have been set back.
    let published = published.iter().skip_while(|it| it.published_ns < span.begin_ns);
    let mut published: Vec<&Published> = published.collect();
    published.dedup_by(|next, before| next.state == before.state);
    let mut made: Vec<&Made> = made.iter().collect();
    made.dedup_by(|next, before| next.state == before.state);

    let (mut is, mut was) = beginning(&published, &made, span);
    let mut equal = 0;
    let mut differences = Vec::new();
    while let (Some(next_is), Some(next_was)) = (made.get(is), published.get(was)) {
        if next_is.state == next_was.state {
            (equal, is, was) = (equal + 1, is + 1, was + 1);
            continue;
        }
        if differences.len() >= DIFFERENCES_MAX {
            return (equal, differences);
        }
        // The list that reaches the other's state sooner has the additional states.
        let ahead_is = made[is..].iter().position(|it| it.state == next_was.state);
        let ahead_was = published[was..].iter().position(|it| it.state == next_is.state);
        let (more_is, more_was) = match (ahead_is, ahead_was) {
            (Some(is), Some(was)) if is <= was => (is, 0),
            (Some(is), None) => (is, 0),
            (_, Some(was)) => (0, was),
            // Neither does: the state is a different one.
            (None, None) => (1, 1),
        };
        differences.extend(not_published(&made, is..is + more_is));
        differences.extend(not_made(&published, was..was + more_was));
        (is, was) = (is + more_is, was + more_was);
    }
    // A state is on its topic soon after it is made.
    let is_missed = |it: &&&Made| it.at_ns + LATE_NS <= span.last_received_ns;
    let missed = made[is..].iter().take_while(|it| is_missed(it)).count();
    differences.extend(not_published(&made, is..is + missed));
    // The entries of the last received state may not have been received.
    let is_later = |it: &Published| {
        it.report_ns > span.end_ns && it.published_ns + LATE_NS > span.last_received_ns
    };
    let unmade = published[was..].iter().filter(|it| !is_later(it)).count();
    differences.extend(not_made(&published, was..was + unmade));
    (equal, differences)
}

/// Where the comparison starts in both lists.
fn beginning(published: &[&Published], made: &[&Made], span: Span) -> (usize, usize) {
    let are_same = |is: usize, was: usize| match (made.get(is), published.get(was)) {
        (Some(is), Some(was)) => is.state == was.state,
        _ => false,
    };
    let is_late = published.first().is_some_and(|it| it.published_ns < span.begin_ns + LATE_NS);
    if are_same(0, 0) {
        (0, 0)
    } else if is_late && are_same(0, 1) {
        // The first state was in transit when the journal began, and so was the newest then.
        (0, 1)
    } else {
        (usize::from(span.begins_at_checkpoint), 0)
    }
}

fn not_published(made: &[&Made], range: std::ops::Range<usize>) -> Vec<StateDifference> {
    let received = range.filter(|index| !made[*index].is_unreachable);
    received.map(|index| StateDifference::NotPublished(index, made[index].clone())).collect()
}

fn not_made(published: &[&Published], range: std::ops::Range<usize>) -> Vec<StateDifference> {
    range.map(|index| StateDifference::NotMade(index, published[index].clone())).collect()
}
