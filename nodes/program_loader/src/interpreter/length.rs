//! How many events a program may have before one more cycle or curve, of which a line makes many.

use super::Interpreter;
use crate::limits::EVENTS_MAX;
use cnc_msgs::finding::{Code, Finding};

impl Interpreter<'_> {
    /// Nobody holds more than so many events at a time, however many the program has.
    pub(crate) fn hold_at_most(&mut self, events: usize) {
        self.held_events_max = Some(events);
    }

    /// Whether so many events more are too many for those who hold them.
    pub(super) fn is_too_long_with(&mut self, more: usize) -> bool {
        let is_too_long = self.all_event_count() + more > EVENTS_MAX;
        let Some(most) = self.held_events_max else { return is_too_long };
        if is_too_long {
            self.too_long_from.get_or_insert(self.source);
        }
        self.event_count() + more > most
    }

    /// Why those who hold all events refuse the program, where only parts of it were held.
    pub(crate) fn too_long(&self) -> Option<Finding> {
        let message =
            format!("{EVENTS_MAX} moves come before this cycle or curve, and nodes accept no more");
        let source = self.too_long_from?;
        Some(Finding::error(Code::Limit, source, message).help("split the program"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rules::Rules;
    use cnc_msgs::contour::Source;

    #[test]
    fn the_events_of_a_part_count_where_nobody_holds_more() {
        let profile = settings::load_profile("rs274").expect("a shipped profile");
        let (rules, _) = Rules::of(&profile);
        // The most that are held, those that were taken, how many more; whether they are too many for this reader, and for nodes.
        for (held, taken, more, is_refused, is_too_long) in [
            (None, 0, EVENTS_MAX, false, false),
            (None, 0, EVENTS_MAX + 1, true, false),
            (None, EVENTS_MAX, 1, true, false),
            (Some(100), EVENTS_MAX - 10, 10, false, false),
            (Some(100), EVENTS_MAX, 1, false, true),
            (Some(100), 0, 100, false, false),
            (Some(100), 0, 101, true, false),
        ] {
            let mut interpreter = Interpreter::new(&rules, [0.0; 3], 0);
            interpreter.held_events_max = held;
            interpreter.taken = taken;
            let place = |line| Source { line, ..Source::default() };
            interpreter.source = place(7);
            assert_eq!(interpreter.is_too_long_with(more), is_refused, "{held:?} {taken} {more}");
            interpreter.source = place(8);
            interpreter.is_too_long_with(more);
            let line = interpreter.too_long().map(|found| found.source.line);
            assert_eq!(line, is_too_long.then_some(7), "{held:?} {taken} {more}");
        }
    }
}
