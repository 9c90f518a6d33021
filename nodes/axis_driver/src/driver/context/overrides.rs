//! Feed, rapid and spindle overrides.
//!
//! The controller knows steps only, and takes each as a byte that acts at once and is not
//! answered: `Ov:` in a later report shows what it made of them. grbl 1.1h keeps a bit for
//! each kind of byte, so that equal bytes count once until its main loop comes by. The bytes
//! therefore go in rounds, no kind more often than the firmware counts it, and the next round
//! begins where a report shows the last one ended. Reports are asked for faster meanwhile.

use super::Context;
use crate::codes::error_code;
use crate::driver::answer::{Answer, Refusal, refused};
use crate::driver::output::LogLevel;
use crate::link::realtime;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Percent of the programmed values; `None` leaves one as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Overrides {
    pub feed: Option<u8>,
    pub rapid: Option<u8>,
    pub spindle: Option<u8>,
}

/// The limits of a controller for feed and spindle, percent.
const PERCENT: std::ops::RangeInclusive<u8> = 10..=200;
/// The steps that there are bytes for, percent.
const COARSE: i16 = 10;
const FINE: i16 = 1;
/// grbl 1.1h counts in eight bits: what falls below zero becomes 200 %. With a value lower than
/// this, two steps down never go in one round, in case the value is not the last one.
const TWO_STEPS_DOWN_MIN: i16 = 40;
/// A request has shown in a report by then.
const WITHIN: Duration = Duration::from_secs(3);
/// Requests that wait at a time.
const REQUESTS_MAX: usize = 16;
/// From the bytes of a round to the request for the report that shows them.
const PAUSE: Duration = Duration::from_millis(10);
/// Reports that may be older than the bytes.
const OLD_REPORTS: u32 = 1;
/// A change shows in one of this many reports, else there was none: a byte was lost.
const REPORTS_OF_A_CHANGE: u32 = 4;

/// Overrides that have not shown in a report yet.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::driver) struct OverrideWatch {
    wanted: Overrides,
    /// What the bytes of this round lead to.
    #[serde(default)]
    expected: [u8; 3],
    /// Since the bytes of this round.
    reports: u32,
    #[serde(default)]
    pub(in crate::driver) until: Duration,
    /// The commands that wait for it, each with what it named.
    #[serde(default)]
    requests: Vec<(u64, Overrides)>,
}

impl Overrides {
    fn values(self) -> [Option<u8>; 3] {
        [self.feed, self.rapid, self.spindle]
    }

    fn or(self, other: Self) -> Self {
        Self {
            feed: self.feed.or(other.feed),
            rapid: self.rapid.or(other.rapid),
            spindle: self.spindle.or(other.spindle),
        }
    }

    /// Whether these percentages are what is named.
    pub(in crate::driver) fn are(self, percents: [u8; 3]) -> bool {
        self.values().iter().zip(percents).all(|(wanted, is)| wanted.is_none_or(|w| w == is))
    }

    /// `feed 57 %, rapid 25 %`
    fn describe(self) -> String {
        let named = ["feed", "rapid", "spindle"].into_iter().zip(self.values());
        let named = named.filter_map(|(name, percent)| Some(format!("{name} {} %", percent?)));
        named.collect::<Vec<_>>().join(", ")
    }
}

/// All three, as a report shows them.
fn describe([feed, rapid, spindle]: [u8; 3]) -> String {
    Overrides { feed: Some(feed), rapid: Some(rapid), spindle: Some(spindle) }.describe()
}

/// The bytes of one round from these percentages (feed, rapid, spindle; 0 is not known) to
/// those wanted, and where it ends. No kind of byte comes more than `equal_max` times.
fn round(now: [u8; 3], wanted: Overrides, equal_max: i16) -> (Vec<u8>, [u8; 3]) {
    let (mut bytes, mut ends) = (Vec::new(), now);
    let feed = [realtime::FEED_100, realtime::FEED_PLUS_10, realtime::FEED_PLUS_1];
    let spindle = [realtime::SPINDLE_100, realtime::SPINDLE_PLUS_10, realtime::SPINDLE_PLUS_1];
    if let Some(percent) = wanted.feed {
        ends[0] = climb(&mut bytes, now[0], percent, equal_max, feed);
    }
    if let Some(percent) = wanted.rapid.filter(|percent| *percent != now[1]) {
        bytes.push(match percent {
            25 => realtime::RAPID_25,
            50 => realtime::RAPID_50,
            _ => realtime::RAPID_100,
        });
        ends[1] = percent;
    }
    if let Some(percent) = wanted.spindle {
        ends[2] = climb(&mut bytes, now[2], percent, equal_max, spindle);
    }
    (bytes, ends)
}

/// One round of feed or spindle; gives where it ends. The byte of a step down follows that of
/// the step up. The order is that in which grbl 1.1h executes its bits.
fn climb(bytes: &mut Vec<u8>, from: u8, to: u8, equal_max: i16, kinds: [u8; 3]) -> u8 {
    let [hundred, coarse, fine] = kinds;
    if from == to {
        return to;
    }
    let (from, to) = (i16::from(from), i16::from(to));
    let rounds =
        |(tens, ones): (i16, i16)| (tens.abs().max(ones.abs()) + equal_max - 1) / equal_max;
    let from_hundred = steps(100, to);
    let direct = steps(from, to);
    let is_reset = from == 0 || rounds(from_hundred) < rounds(direct);
    let (from, (tens, ones)) = if is_reset { (100, from_hundred) } else { (from, direct) };
    let mut at = from;
    if is_reset {
        bytes.push(hundred);
    }
    let is_low = tens < 0 && ones < 0 && from < TWO_STEPS_DOWN_MIN;
    let ones = if is_low { 0 } else { ones };
    for (count, size, up) in [(tens, COARSE, coarse), (ones, FINE, fine)] {
        let count = count.clamp(-equal_max, equal_max);
        let byte = if count > 0 { up } else { up + 1 };
        bytes.extend(std::iter::repeat_n(byte, usize::from(count.unsigned_abs())));
        at += count * size;
    }
    // Within 10 and 200, as `steps` has it.
    u8::try_from(at).unwrap_or(100)
}

/// Coarse and fine steps from one value to another: as few of the more frequent as can be,
/// then as few as can be. The coarse ones do not leave the range.
fn steps(from: i16, to: i16) -> (i16, i16) {
    let way = to - from;
    let range = i16::from(*PERCENT.start())..=i16::from(*PERCENT.end());
    let tens = [way / COARSE - 1, way / COARSE, way / COARSE + 1].into_iter();
    let choices = tens.map(|tens| (tens, way - tens * COARSE));
    let choices = choices.filter(|(tens, _)| *tens == 0 || range.contains(&(from + tens * COARSE)));
    let cost = |(tens, ones): &(i16, i16)| {
        let (tens, ones) = (tens.abs(), ones.abs());
        (tens.max(ones), tens + ones)
    };
    choices.min_by_key(cost).unwrap_or((0, way))
}

impl Context {
    /// The highest feed override that the controller may have now, in parts of one: the last one reported, or
    /// that of bytes which no report shows yet. A round may begin at 100 %.
    pub(in crate::driver) fn feed_override_most(&self) -> f64 {
        let asked = self.overrides.as_ref().filter(|watch| watch.wanted.feed.is_some());
        let asked = asked.map_or(0, |watch| watch.expected[0].max(100));
        f64::from(self.machine.overrides_percent[0].max(asked).max(1)) / 100.0
    }

    /// Asks the controller for overrides; the answer comes when a report shows them.
    pub(in crate::driver) fn set_overrides(&mut self, id: u64, wanted: Overrides) -> Answer {
        let named = [("feed", wanted.feed), ("spindle", wanted.spindle)];
        for (name, percent) in named {
            if let Some(percent) = percent.filter(|percent| !PERCENT.contains(percent)) {
                let text =
                    format!("the {name} override of {percent} % is not between 10 and 200 %");
                return refused(error_code::INVALID_REQUEST, text);
            }
        }
        if let Some(percent) = wanted.rapid.filter(|percent| ![25, 50, 100].contains(percent)) {
            let text = format!("the rapid override of {percent} % is not 25, 50 or 100 %");
            return refused(error_code::INVALID_REQUEST, text);
        }
        if wanted == Overrides::default() {
            let text = "no override is named: which has bit 0 for feed, bit 1 for rapid, bit 2 for \
                        spindle";
            return refused(error_code::INVALID_REQUEST, text);
        }
        let until = self.now + WITHIN;
        let Some(mut watch) = self.overrides.take() else {
            let reported = self.machine.overrides_percent;
            if wanted.are(reported) {
                return Some(Ok(shown(reported)));
            }
            let requests = vec![(id, wanted)];
            let watch = OverrideWatch { wanted, expected: reported, reports: 0, until, requests };
            self.begin_round(watch, reported);
            return None;
        };
        if watch.requests.len() >= REQUESTS_MAX {
            self.overrides = Some(watch);
            let text =
                format!("{REQUESTS_MAX} override requests already wait for a report: try again");
            return refused(error_code::BUSY, text);
        }
        // The bytes of the round that is under way count first.
        let together = wanted.or(watch.wanted);
        if together != watch.wanted {
            watch.until = until;
        }
        watch.wanted = together;
        let kept = watch.wanted;
        let is_kept = |of: &Overrides| of.or(kept) == kept;
        let (kept_requests, replaced) = watch.requests.into_iter().partition(|(_, of)| is_kept(of));
        watch.requests = kept_requests;
        watch.requests.push((id, wanted));
        self.overrides = Some(watch);
        for (id, of) in replaced {
            let text =
                format!("{} was replaced by a later request: {}", of.describe(), wanted.describe());
            self.reply(id, Err(Refusal::new(error_code::CANCELED, text)));
        }
        None
    }

    /// Asks the controller for overrides that no command has named.
    pub(in crate::driver) fn bring_overrides_to(&mut self, wanted: Overrides, why: &str) {
        let reported = self.machine.overrides_percent;
        if self.overrides.is_none() && wanted.are(reported) {
            return;
        }
        for (id, of) in self.overrides.take().into_iter().flat_map(|watch| watch.requests) {
            let text = format!("{} was replaced: {why}", of.describe());
            self.reply(id, Err(Refusal::new(error_code::CANCELED, text)));
        }
        let until = self.now + WITHIN;
        let requests = Vec::new();
        let watch = OverrideWatch { wanted, expected: reported, reports: 0, until, requests };
        self.begin_round(watch, reported);
    }

    /// `the controller reports feed 150 %, rapid 100 %, spindle 100 %`
    pub(in crate::driver) fn shown_overrides(&self) -> String {
        shown(self.machine.overrides_percent)
    }

    /// Sends the bytes of the next round, from what a report has shown.
    fn begin_round(&mut self, mut watch: OverrideWatch, from: [u8; 3]) {
        let equal_max = self.machine.firmware.traits().overrides_in_a_round;
        let (bytes, expected) = round(from, watch.wanted, equal_max);
        for byte in bytes {
            self.link.send_realtime(byte);
        }
        (watch.expected, watch.reports) = (expected, 0);
        self.overrides = Some(watch);
        self.link.ask_status(self.now + PAUSE);
    }

    /// Looks in each report for overrides that were asked for.
    pub(in crate::driver) fn watch_overrides(&mut self, reported: Option<[u8; 3]>) {
        let Some(mut watch) = self.overrides.take() else { return };
        watch.reports += 1;
        let is_new =
            |reported: &[u8; 3]| *reported == watch.expected || watch.reports > OLD_REPORTS;
        match reported.filter(is_new) {
            Some(reported) if watch.wanted.are(reported) => {
                for (id, _) in watch.requests {
                    self.reply(id, Ok(shown(reported)));
                }
            }
            Some(reported) => self.begin_round(watch, reported),
            None if watch.reports >= REPORTS_OF_A_CHANGE => {
                let reported = self.machine.overrides_percent;
                self.begin_round(watch, reported);
            }
            None => {
                self.overrides = Some(watch);
                self.link.ask_status(self.now + PAUSE);
            }
        }
    }

    /// No report has shown them in time.
    pub(in crate::driver) fn on_overrides_timeout(&mut self) {
        let Some(watch) = self.overrides.take() else { return };
        let text = format!(
            "the controller was asked for {} and reports {} after {} s; it accepts none while it \
             homes or is locked",
            watch.wanted.describe(),
            describe(self.machine.overrides_percent),
            WITHIN.as_secs()
        );
        self.log(LogLevel::Warn, text.clone());
        for (id, _) in watch.requests {
            self.reply(id, Err(Refusal::new(error_code::NO_ANSWER, text.clone())));
        }
    }

    /// Forgets those that have not shown: a reset sets them all to 100 %, and another board
    /// was never asked.
    pub(in crate::driver) fn drop_overrides(&mut self, why: &str) {
        for (id, wanted) in self.overrides.take().into_iter().flat_map(|watch| watch.requests) {
            let text = format!("{}: {why}", wanted.describe());
            self.reply(id, Err(Refusal::new(error_code::NEEDS_RESET, text)));
        }
    }
}

fn shown(percents: [u8; 3]) -> String {
    format!("the controller reports {}", describe(percents))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What grbl 1.1h makes of the bytes when it looks at them at once.
    fn look(at: [u8; 3], bytes: &[u8]) -> [u8; 3] {
        let mut flags = bytes.to_vec();
        flags.sort_unstable();
        flags.dedup();
        play(at, &flags)
    }

    /// What a firmware that queues them makes of the bytes.
    fn play(mut at: [u8; 3], bytes: &[u8]) -> [u8; 3] {
        for byte in bytes {
            let (slot, by) = match byte {
                0x90 => (0, None),
                0x91 => (0, Some(10)),
                0x92 => (0, Some(-10)),
                0x93 => (0, Some(1)),
                0x94 => (0, Some(-1)),
                0x99 => (2, None),
                0x9a => (2, Some(10)),
                0x9b => (2, Some(-10)),
                0x9c => (2, Some(1)),
                0x9d => (2, Some(-1)),
                0x95..=0x97 => {
                    at[1] = [100, 50, 25][usize::from(byte - 0x95)];
                    continue;
                }
                _ => panic!("{byte:#x} is no override"),
            };
            let value = by.map_or(100, |by: i16| i16::from(at[slot]) + by);
            assert!((10..=200).contains(&value), "{at:?} and {byte:#x} leave the range");
            at[slot] = u8::try_from(value).unwrap();
        }
        at
    }

    #[test]
    fn every_override_is_reached_from_every_other_in_eleven_rounds_of_flags() {
        for from in 10..=200u8 {
            for to in 10..=200u8 {
                let wanted = Overrides { feed: Some(to), rapid: Some(50), spindle: Some(from) };
                let mut at = [from, 100, to];
                let mut rounds = 0;
                while !wanted.are(at) {
                    let (bytes, expected) = round(at, wanted, 1);
                    at = look(at, &bytes);
                    assert_eq!(at, expected, "{from} to {to}");
                    rounds += 1;
                    assert!(rounds <= 11, "{from} to {to}: at {at:?}");
                }
            }
        }
    }

    #[test]
    fn a_queue_is_never_overfilled() {
        for from in std::iter::once(0).chain(10..=200u8) {
            for to in 10..=200u8 {
                let wanted = Overrides { feed: Some(to), rapid: Some(25), spindle: None };
                let mut at = [from, 100, 100];
                for _ in 0..3 {
                    let (bytes, expected) = round(at, wanted, crate::firmware::QUEUED_MAX);
                    assert!(bytes.len() <= 15, "{from} to {to}: {bytes:x?}");
                    at = play(at, &bytes);
                    assert_eq!(at, expected, "{from} to {to}");
                }
                assert!(wanted.are(at), "{from} to {to}: {at:?}");
            }
        }
    }

    #[test]
    fn what_is_not_named_is_left_alone() {
        let only_rapid = Overrides { rapid: Some(25), ..Overrides::default() };
        assert_eq!(round([80, 100, 120], only_rapid, 1), (vec![realtime::RAPID_25], [80, 25, 120]));
    }

    #[test]
    fn two_steps_down_never_go_together_where_they_could_fall_below_zero() {
        let feed = |percent| Overrides { feed: Some(percent), ..Overrides::default() };
        let (bytes, ends) = round([39, 100, 100], feed(15), 1);
        assert_eq!((bytes, ends[0]), (vec![realtime::FEED_MINUS_10], 29));
    }
}
