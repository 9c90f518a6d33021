//! Whether the other end is there and answers.
//!
//! Asks for status at a fixed rate with one request outstanding, and notices an answer
//! that does not come while the controller has nothing else to do.

use super::{LineKind, LinkFault};
use crate::report::{ControllerState, StatusReport};
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Requests without an answer until the link counts as lost.
const MISSED_POLLS_MAX: u32 = 3;
/// An idle controller reads and answers a motion line at once; this long without an
/// answer, over several reports, and the answer was lost.
const IDLE_WITHOUT_ANSWER: Duration = Duration::from_millis(600);
/// The same for a line that takes its time, a spindle that gets up to speed.
const SLOW_WITHOUT_ANSWER: Duration = Duration::from_secs(60);

/// How old a report may be that nobody asked for.
const UNASKED_AGE_MAX: Duration = Duration::from_secs(1);

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Health {
    interval: Duration,
    next_poll_at: Duration,
    is_asked: bool,
    /// When the oldest request went out whose report has not come.
    #[serde(default)]
    waits_since: Option<Duration>,
    is_deaf: bool,
    missed: u32,
    last_status_at: Option<Duration>,
    idle_since: Option<Duration>,
    #[serde(default)]
    asked_at: Option<Duration>,
}

impl Health {
    pub(super) fn new(interval_ms: u32, now: Duration) -> Self {
        Self {
            interval: Duration::from_millis(u64::from(interval_ms.max(1))),
            next_poll_at: now,
            is_asked: false,
            waits_since: None,
            is_deaf: false,
            missed: 0,
            last_status_at: None,
            idle_since: None,
            asked_at: None,
        }
    }

    pub(super) fn set_interval(&mut self, interval_ms: u32) {
        self.interval = Duration::from_millis(u64::from(interval_ms.max(1)));
    }

    /// The controller starts over.
    pub(super) fn restart(&mut self, now: Duration) {
        self.is_asked = false;
        self.waits_since = None;
        self.is_deaf = false;
        self.missed = 0;
        self.idle_since = None;
        self.next_poll_at = now + self.interval;
    }

    pub(super) fn set_deaf(&mut self, is_deaf: bool) {
        self.is_deaf = is_deaf;
    }

    /// Whether a request may stay without its report, with this oldest line without an answer.
    pub(super) fn is_silence_expected(&self, now: Duration, oldest: Option<LineKind>) -> bool {
        match oldest {
            Some(LineKind::Silent) => true,
            Some(LineKind::Thread { milliseconds }) => {
                let patience = Duration::from_millis(u64::from(milliseconds));
                self.waits_since.is_none_or(|since| now < since + patience)
            }
            _ => false,
        }
    }

    /// Asks then, unless a request is under way.
    pub(super) fn ask_at(&mut self, now: Duration) {
        if !self.is_asked {
            self.next_poll_at = self.next_poll_at.min(now);
        }
    }

    /// A report has come and lines are under way: asks again so long after the last request.
    /// A request that stays without its report is repeated at the rate of before.
    pub(super) fn ask_again_within(&mut self, interval: Duration) {
        if let Some(asked_at) = self.asked_at {
            self.next_poll_at = self.next_poll_at.min(asked_at + interval);
        }
    }

    pub(super) fn next_poll_at(&self) -> Duration {
        self.next_poll_at
    }

    pub(super) fn last_status_at(&self) -> Option<Duration> {
        self.last_status_at
    }

    /// When the machine was looked at for a report that comes now, at the earliest.
    pub(super) fn looked_at_since(&self, now: Duration) -> Duration {
        self.waits_since.unwrap_or(now.saturating_sub(UNASKED_AGE_MAX))
    }

    /// Whether a request is under way.
    pub(super) fn is_asked(&self) -> bool {
        self.is_asked
    }

    pub(super) fn on_line_sent(&mut self) {
        self.idle_since = None;
    }

    pub(super) fn on_answer(&mut self) {
        self.idle_since = None;
        // Whoever answers lines is there; on a slow line its report waits until the answers are sent.
        self.missed = 0;
    }

    /// Whether to ask now. While silence is expected an unanswered request stands.
    pub(super) fn poll_is_due(&mut self, now: Duration, is_silence_expected: bool) -> bool {
        if now < self.next_poll_at {
            return false;
        }
        self.next_poll_at = now + self.interval;
        if self.is_asked && (is_silence_expected || self.is_deaf) {
            return false;
        }
        self.missed = if self.is_asked { self.missed.saturating_add(1) } else { 0 };
        self.is_asked = true;
        self.asked_at = Some(now);
        self.waits_since.get_or_insert(now);
        true
    }

    /// True once, when the last request made the silence too long.
    pub(super) fn is_silent_now(&self) -> bool {
        self.missed == MISSED_POLLS_MAX
    }

    /// Takes a report; `oldest` is the kind of the oldest of so many lines without an
    /// answer.
    pub(super) fn on_status(
        &mut self,
        now: Duration,
        status: &StatusReport,
        oldest: Option<LineKind>,
        lines: usize,
    ) -> Option<LinkFault> {
        self.is_asked = false;
        self.waits_since = None;
        self.is_deaf = false;
        self.missed = 0;
        self.last_status_at = Some(now);
        let patience = match oldest {
            Some(LineKind::Motion | LineKind::Thread { .. }) => IDLE_WITHOUT_ANSWER,
            Some(LineKind::Slow) => SLOW_WITHOUT_ANSWER,
            Some(LineKind::Dwell { milliseconds }) => {
                SLOW_WITHOUT_ANSWER + Duration::from_millis(u64::from(milliseconds))
            }
            Some(LineKind::Silent) | None => Duration::MAX,
        };
        // In check mode nothing is waited for.
        let is_waiting = matches!(status.state, ControllerState::Idle | ControllerState::Check);
        if !is_waiting || patience == Duration::MAX {
            self.idle_since = None;
            return None;
        }
        let since = *self.idle_since.get_or_insert(now);
        (now >= since + patience).then_some(LinkFault::LostAnswer { lines })
    }
}
