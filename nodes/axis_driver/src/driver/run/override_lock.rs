//! M50 and M51: the program forbids its operator to override feed or spindle speed, and allows it again.
//!
//! What is forbidden is brought to 100 %, and kept there whoever changes it. What the operator had set comes back
//! when it is allowed again. The end of the run ends it.

use super::exit::Exit;
use super::{ProgramRun, Stage};
use crate::codes::error_code;
use crate::driver::answer::Refusal;
use crate::driver::context::Context;
use crate::driver::context::overrides::Overrides;
use crate::driver::output::LogLevel;
use crate::encoder::AllowedOverrides;
use cnc_msgs::contour::Source;

/// What the program allows now.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct OverrideLock {
    allowed: AllowedOverrides,
    /// What the operator had set where it is forbidden.
    kept: Overrides,
    /// The block of the last such word.
    source: Source,
}

impl OverrideLock {
    /// What is forbidden, at 100 %.
    fn forbidden(&self) -> Overrides {
        let hundred = |is_allowed: bool| (!is_allowed).then_some(100);
        let AllowedOverrides { feed, spindle } = self.allowed;
        Overrides { feed: hundred(feed), rapid: hundred(feed), spindle: hundred(spindle) }
    }

    /// Takes what is allowed from now on; gives the overrides that this asks for.
    fn allow(&mut self, allowed: AllowedOverrides, reported: [u8; 3], source: Source) -> Overrides {
        let (before, kept) = (self.forbidden(), self.kept);
        (self.allowed, self.source) = (allowed, source);
        let now = self.forbidden();
        let each = |before: Option<u8>, now: Option<u8>, kept: Option<u8>, reported: u8| match (
            before, now,
        ) {
            // 0: no report has said it yet.
            (None, Some(_)) => (now, Some(reported).filter(|percent| *percent > 0)),
            (Some(_), None) => (kept, None),
            _ => (now, kept),
        };
        let [feed, rapid, spindle] = reported;
        let (feed, kept_feed) = each(before.feed, now.feed, kept.feed, feed);
        let (rapid, kept_rapid) = each(before.rapid, now.rapid, kept.rapid, rapid);
        let (spindle, kept_spindle) = each(before.spindle, now.spindle, kept.spindle, spindle);
        self.kept = Overrides { feed: kept_feed, rapid: kept_rapid, spindle: kept_spindle };
        Overrides { feed, rapid, spindle }
    }
}

impl ProgramRun {
    /// All motion has ended: brings the overrides to what is allowed from here on.
    pub(super) fn allow_overrides(
        &mut self,
        context: &mut Context,
        allowed: AllowedOverrides,
        source: Source,
    ) {
        if self.job.request.is_mdi() {
            let text = "overrides are forbidden until the end of this block only";
            context.log(LogLevel::Warn, text);
        }
        let reported = context.machine.overrides_percent;
        let wanted = self.override_lock.allow(allowed, reported, source);
        self.stage = Stage::Overriding;
        context.bring_overrides_to(wanted, "the program says which overrides are allowed");
    }

    /// Why an operator may not override now, if so.
    pub(in crate::driver) fn override_obstacle(&self, wanted: &Overrides) -> Option<Refusal> {
        let forbidden = self.override_lock.forbidden();
        let is_feed = forbidden.feed.is_some() && (wanted.feed.is_some() || wanted.rapid.is_some());
        let is_spindle = forbidden.spindle.is_some() && wanted.spindle.is_some();
        let name = match (is_feed, is_spindle) {
            (true, _) => "feed and rapid overrides",
            (_, true) => "the spindle override",
            _ => return None,
        };
        let place = self.job.place_of(self.override_lock.source);
        let text = format!(
            "{place}: the program has switched {name} off (M49, M50, M51), until it switches them on or ends; a feed \
             hold works"
        );
        Some(Refusal::new(error_code::BUSY, text))
    }

    /// After a report: what is forbidden is at 100 %, or brought there.
    pub(super) fn keep_overrides(&mut self, context: &mut Context) -> Option<Exit> {
        if context.overrides.is_some() || self.job.is_check() {
            return None;
        }
        let forbidden = self.override_lock.forbidden();
        let reported = context.machine.overrides_percent;
        let is_kept = forbidden.are(reported);
        let place = || self.job.place_of(self.override_lock.source);
        match (&self.stage, is_kept) {
            (Stage::Overriding, true) => self.go_on(),
            (Stage::Overriding, false) => {
                let text = format!(
                    "{}: the program switches overrides off, and {}",
                    place(),
                    context.shown_overrides()
                );
                self.job.blamed_line = self.override_lock.source.line;
                return Some(Exit::abort(error_code::NO_ANSWER, text));
            }
            (_, true) => {}
            (_, false) => {
                let text = format!(
                    "{}: the program has switched overrides off, and {}: they are set to 100 % again",
                    place(),
                    context.shown_overrides()
                );
                context.log(LogLevel::Warn, text);
                context.bring_overrides_to(forbidden, "the program has switched overrides off");
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_forbidden_goes_to_a_hundred_and_comes_back_when_it_is_allowed() {
        let allowed = |feed, spindle| AllowedOverrides { feed, spindle };
        let percent = |feed, rapid, spindle| Overrides { feed, rapid, spindle };
        let mut lock = OverrideLock::default();
        for (word, reported, expected) in [
            (allowed(false, true), [150, 50, 80], percent(Some(100), Some(100), None)),
            // The operator has changed the spindle meanwhile.
            (allowed(false, false), [100, 100, 90], percent(Some(100), Some(100), Some(100))),
            (allowed(true, false), [100; 3], percent(Some(150), Some(50), Some(100))),
            (allowed(true, false), [70, 50, 100], percent(None, None, Some(100))),
            (allowed(true, true), [70, 50, 100], percent(None, None, Some(90))),
            (allowed(true, true), [70, 50, 90], percent(None, None, None)),
        ] {
            assert_eq!(lock.allow(word, reported, Source::default()), expected, "{word:?}");
        }
    }
    #[test]
    fn what_no_report_has_said_does_not_come_back() {
        let mut lock = OverrideLock::default();
        let nothing = AllowedOverrides { feed: false, spindle: false };
        let hundred = Overrides { feed: Some(100), rapid: Some(100), spindle: Some(100) };
        assert_eq!(lock.allow(nothing, [0; 3], Source::default()), hundred);
        let all = AllowedOverrides::default();
        assert_eq!(lock.allow(all, [100; 3], Source::default()), Overrides::default());
    }
}
