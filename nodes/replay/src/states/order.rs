//! Two lists of states in their order: what was published, and what the core goes through now.
//!
//! The driver publishes a state whenever one changes, and the newest again at a steady rate. So
//! both lists are the same once repetitions are left out: one state after the other, none more
//! and none less. Only at the ends of the record one list may have what the other cannot have;
//! see [`compare`].

use cnc_msgs::wire::cnc_msgs::msg::MachineState;

/// How much later than others of the driver's messages a state may be on its topic, or entries
/// of the journal on theirs, ns. It is some milliseconds on a computer that is not busy.
const LATE_NS: i64 = 200_000_000;
/// Differences after which no more are looked for.
const DIFFERENCES_MAX: usize = 1000;

/// A state on its topic; times are nanoseconds since the epoch.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Published {
    pub(crate) published_ns: i64,
    /// When the report came that it tells of, as far as the driver's clock is that exact.
    pub(crate) report_ns: i64,
    pub(crate) state: MachineState,
}

/// A state that the core goes through now.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Made {
    /// When the entry was written that leads to it.
    pub(crate) at_ns: i64,
    pub(crate) state: MachineState,
    /// The driver could not be reached over ROS then: nobody may have heard of it.
    pub(crate) is_unheard: bool,
}

/// What the journal and the recorder cover, nanoseconds since the epoch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Span {
    /// The first entry that is played.
    pub(crate) begin_ns: i64,
    /// The first entry is a checkpoint: its state is known and was not published then.
    pub(crate) begins_at_checkpoint: bool,
    pub(crate) end_ns: i64,
    /// The recorder still heard the driver then.
    pub(crate) heard_ns: i64,
}

/// A state that one list has at its place and the other one has not.
#[derive(Debug, PartialEq)]
pub(crate) enum Difference {
    /// It was published; the number counts published states without repetitions.
    NotMade(usize, Published),
    /// The core goes through it, and the bag does not have it; the number counts such states.
    NotPublished(usize, Made),
}

/// Compares the lists; the number is how many states both have.
///
/// At the beginning the state of a checkpoint is published only where it is repeated, and one
/// from before it may still have been on its way to the topic. At the end the journal may stop a
/// moment before the topic does, or the recorder a moment before the journal.
pub(crate) fn compare(
    published: &[Published],
    made: &[Made],
    span: Span,
) -> (usize, Vec<Difference>) {
    // What was said before the journal begins cannot be made again. Later the clock may have been
    // set back.
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
        // Whichever list has the other's state sooner has more at this place.
        let ahead_is = made[is..].iter().position(|it| it.state == next_was.state);
        let ahead_was = published[was..].iter().position(|it| it.state == next_is.state);
        let (more_is, more_was) = match (ahead_is, ahead_was) {
            (Some(is), Some(was)) if is <= was => (is, 0),
            (Some(is), None) => (is, 0),
            (_, Some(was)) => (0, was),
            // Neither has: it is another state.
            (None, None) => (1, 1),
        };
        differences.extend(not_published(&made, is..is + more_is));
        differences.extend(not_made(&published, was..was + more_was));
        (is, was) = (is + more_is, was + more_was);
    }
    // What is made is on its topic soon after.
    let is_missed = |it: &&&Made| it.at_ns + LATE_NS <= span.heard_ns;
    let missed = made[is..].iter().take_while(|it| is_missed(it)).count();
    differences.extend(not_published(&made, is..is + missed));
    // The entries of a state that is the last to be heard may not have been.
    let is_later =
        |it: &Published| it.report_ns > span.end_ns && it.published_ns + LATE_NS > span.heard_ns;
    let unmade = published[was..].iter().filter(|it| !is_later(it)).count();
    differences.extend(not_made(&published, was..was + unmade));
    (equal, differences)
}

/// Where both lists begin.
fn beginning(published: &[&Published], made: &[&Made], span: Span) -> (usize, usize) {
    let are_same = |is: usize, was: usize| match (made.get(is), published.get(was)) {
        (Some(is), Some(was)) => is.state == was.state,
        _ => false,
    };
    let is_late = published.first().is_some_and(|it| it.published_ns < span.begin_ns + LATE_NS);
    if are_same(0, 0) {
        (0, 0)
    } else if is_late && are_same(0, 1) {
        // The first was on its way as the journal began, and so was the newest of then.
        (0, 1)
    } else {
        (usize::from(span.begins_at_checkpoint), 0)
    }
}

fn not_published(made: &[&Made], range: std::ops::Range<usize>) -> Vec<Difference> {
    let heard = range.filter(|index| !made[*index].is_unheard);
    heard.map(|index| Difference::NotPublished(index, made[index].clone())).collect()
}

fn not_made(published: &[&Published], range: std::ops::Range<usize>) -> Vec<Difference> {
    range.map(|index| Difference::NotMade(index, published[index].clone())).collect()
}
