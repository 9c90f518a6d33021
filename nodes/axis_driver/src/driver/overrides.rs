//! Faster and slower than programmed.
//!
//! The controller knows steps only, and takes each as a byte that acts at once and
//! is not answered: what it made of them shows in a later report, and is asked for
//! again when a byte was lost.

use super::command::{Answer, refused};
use super::{Driver, LogLevel, Phase};
use crate::codes::error_code;
use crate::link::realtime;
use serde::{Deserialize, Serialize};

/// Percent of the programmed values; `None` leaves one as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Overrides {
    pub feed: Option<u8>,
    pub rapid: Option<u8>,
    pub spindle: Option<u8>,
}

/// What a controller takes of feed and spindle, percent.
const PERCENT: std::ops::RangeInclusive<u8> = 10..=200;
/// How often it is asked for again.
const TRIES_MAX: u32 = 3;
/// Reports with overrides that may be older than the bytes.
const OLD_REPORTS: u32 = 1;

/// Overrides that have not shown in a report yet.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct OverrideWatch {
    wanted: Overrides,
    reports: u32,
    tries: u32,
}

/// The bytes that lead from these percentages (feed, rapid, spindle) to those wanted.
fn steps(now: [u8; 3], wanted: Overrides) -> Vec<u8> {
    let mut bytes = Vec::new();
    let feed = [realtime::FEED_100, realtime::FEED_PLUS_10, realtime::FEED_PLUS_1];
    let spindle = [realtime::SPINDLE_100, realtime::SPINDLE_PLUS_10, realtime::SPINDLE_PLUS_1];
    if let Some(percent) = wanted.feed {
        climb(&mut bytes, now[0], percent, feed);
    }
    match wanted.rapid {
        Some(100) => bytes.push(realtime::RAPID_100),
        Some(50) => bytes.push(realtime::RAPID_50),
        Some(25) => bytes.push(realtime::RAPID_25),
        _ => {}
    }
    if let Some(percent) = wanted.spindle {
        climb(&mut bytes, now[2], percent, spindle);
    }
    bytes
}

/// Tens first, then ones. The byte of a step down follows that of the step up.
fn climb(bytes: &mut Vec<u8>, from: u8, to: u8, [hundred, ten, one]: [u8; 3]) {
    if to == 100 {
        return bytes.push(hundred);
    }
    let mut left = i16::from(to) - i16::from(from);
    for (size, up) in [(10, ten), (1, one)] {
        let byte = if left > 0 { up } else { up + 1 };
        while left.abs() >= size {
            left -= size * left.signum();
            bytes.push(byte);
        }
    }
}

impl Driver {
    pub(super) fn set_overrides(&mut self, wanted: Overrides) -> Answer {
        match &self.phase {
            Phase::Ready | Phase::Running(_) | Phase::Errand(_) => {}
            _ => return self.obstacle().map(Err),
        }
        let named = [("feed", wanted.feed), ("spindle", wanted.spindle)];
        for (name, percent) in named {
            if let Some(percent) = percent.filter(|percent| !PERCENT.contains(percent)) {
                let text = format!("the {name} override of {percent} % is not within 10 and 200 %");
                return refused(error_code::INVALID_REQUEST, text);
            }
        }
        if let Some(percent) = wanted.rapid.filter(|percent| ![25, 50, 100].contains(percent)) {
            let text = format!("the rapid override of {percent} % is not 25, 50 or 100 %");
            return refused(error_code::INVALID_REQUEST, text);
        }
        if wanted == Overrides::default() {
            let text =
                "nothing is named: which has bit 0 for feed, bit 1 for rapid, bit 2 for spindle";
            return refused(error_code::INVALID_REQUEST, text);
        }
        // What was sent and has not shown yet counts as done.
        let sent = self.overrides.as_ref().map(|watch| watch.wanted).unwrap_or_default();
        let reported = self.machine.overrides_percent;
        let now = [
            sent.feed.unwrap_or(reported[0]),
            sent.rapid.unwrap_or(reported[1]),
            sent.spindle.unwrap_or(reported[2]),
        ];
        for byte in steps(now, wanted) {
            self.link.send_realtime(byte);
        }
        let wanted = Overrides {
            feed: wanted.feed.or(sent.feed),
            rapid: wanted.rapid.or(sent.rapid),
            spindle: wanted.spindle.or(sent.spindle),
        };
        self.overrides = Some(OverrideWatch { wanted, reports: 0, tries: 0 });
        Some(Ok("sent; machine_state shows what the controller makes of it".into()))
    }

    /// Looks for overrides that were asked for in a report that tells of them.
    pub(super) fn watch_overrides(&mut self, told: Option<[u8; 3]>) {
        let is_listening = match &self.phase {
            Phase::Running(run) => !run.is_resetting(),
            Phase::Ready | Phase::Errand(_) => true,
            _ => false,
        };
        if !is_listening {
            // A reset sets them all to 100 %, and another board was never asked.
            self.overrides = None;
        }
        let (Some(told), Some(watch)) = (told, &mut self.overrides) else { return };
        let Overrides { feed, rapid, spindle } = watch.wanted;
        let is_as_wanted = [feed, rapid, spindle]
            .iter()
            .zip(told)
            .all(|(wanted, told)| wanted.is_none_or(|w| w == told));
        if is_as_wanted {
            self.overrides = None;
            return;
        }
        watch.reports += 1;
        if watch.reports <= OLD_REPORTS {
            return;
        }
        (watch.reports, watch.tries) = (0, watch.tries + 1);
        let (wanted, tries) = (watch.wanted, watch.tries);
        if tries > TRIES_MAX {
            self.overrides = None;
            let text = format!(
                "the controller has overrides of {told:?} % (feed, rapid, spindle) and does not take those asked for"
            );
            return self.log(LogLevel::Warn, text);
        }
        for byte in steps(told, wanted) {
            self.link.send_realtime(byte);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the firmware makes of the bytes.
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
            let value = by.map_or(100, |by: i16| (i16::from(at[slot]) + by).clamp(10, 200));
            at[slot] = u8::try_from(value).unwrap();
        }
        at
    }

    #[test]
    fn every_override_is_reached_from_every_other() {
        for from in 10..=200u8 {
            for to in 10..=200u8 {
                let wanted = Overrides { feed: Some(to), rapid: Some(50), spindle: Some(from) };
                let bytes = steps([from, 100, to], wanted);
                assert_eq!(play([from, 100, to], &bytes), [to, 50, from], "{from} to {to}");
                assert!(bytes.len() <= 60, "{from} to {to}: {} bytes", bytes.len());
            }
        }
    }

    #[test]
    fn what_is_not_named_is_left_alone() {
        let only_rapid = Overrides { rapid: Some(25), ..Overrides::default() };
        assert_eq!(steps([80, 100, 120], only_rapid), [realtime::RAPID_25]);
    }
}
