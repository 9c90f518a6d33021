//! Messages of the program to the operator: which are due, and which one a stop is about.
//!
//! A message is due when everything before it has been done: the tool is where it stands in the
//! path, and the lines of what comes before it at that place have been answered.

use super::ProgramRun;
use crate::driver::context::{Context, Origin};
use crate::driver::output::LogLevel;
use crate::encoder::EncoderStep;
use cnc_msgs::contour::Action;
use cnc_msgs::path::{CompensatedPath, PathEvent};

/// Messages of a program that are shown at once, when a report comes; the rest comes with the next.
const SHOWN_MAX: usize = 20;
/// Texts that the reason of a stop takes: of at most 62 bytes each.
const REASON_TEXTS_MAX: usize = 8;
/// Events before a stop that are searched for them.
const REASON_EVENTS_MAX: usize = 1000;

impl ProgramRun {
    /// Shows the messages that are due.
    pub(super) fn show_messages(&mut self, context: &mut Context) {
        // In check mode nothing is reached.
        if !self.job.has_sent || self.job.is_check() {
            return;
        }
        let answered = self.events_answered(context);
        let tracker = &self.job.tracker;
        let is_held = context.machine.is_held();
        let mut texts = 0;
        while let Some(event) = self.job.request.path.events.get(self.shown) {
            let is_past = tracker.is_under_way() && tracker.element() >= event.at_element;
            let is_here = self.shown < answered
                && (event.at_element <= self.first_element
                    || tracker.has_reached(event.at_element));
            // Before the first motion `element` is not under way yet.
            if !is_here && (!is_past || event.at_element <= self.first_element) {
                break;
            }
            match event.action {
                Action::Message { .. } if texts == SHOWN_MAX => break,
                Action::Message { text } => {
                    texts += 1;
                    let at = &event.source;
                    let calls = self.job.request.path.calls.after(*at);
                    context.log(LogLevel::Info, format!("line {}{calls}: {text}", at.line));
                }
                // Some controllers answer M0 before they go on.
                Action::Stop { .. } if is_held => break,
                _ => {}
            }
            self.shown += 1;
        }
    }

    /// Shows what is left at the end of the program.
    pub(super) fn show_last_messages(&mut self, context: &mut Context) {
        for line in last_lines(&self.job.request.path.events[self.shown..]) {
            context.log(LogLevel::Info, line);
        }
        self.shown = self.job.request.path.events.len();
    }

    /// How many events have no line that waits for its answer or for room.
    fn events_answered(&self, context: &Context) -> usize {
        let waiting = match (context.link.oldest(), &self.next, &self.next_block) {
            (Some(Origin::Program { events, .. }), ..) => Some(*events),
            (_, Some(super::Pending::Line(line)), _) => Some(line.events),
            (_, _, step) => step.as_ref().and_then(EncoderStep::line).map(|line| line.events),
        };
        waiting.unwrap_or_else(|| self.encoder.events_begun())
    }

    /// What the program says at the stop or tool change that is the last of so many events.
    pub(in crate::driver) fn message_before(&self, events: usize) -> Option<String> {
        message_before(&self.job.request.path, events.checked_sub(1)?)
    }
}

/// What is said of the messages among the last events of a program.
fn last_lines(events: &[PathEvent]) -> Vec<String> {
    let mut texts = events.iter().filter_map(|event| match event.action {
        Action::Message { text } => Some((event.source.line, text)),
        _ => None,
    });
    let first = texts.by_ref().take(SHOWN_MAX);
    let mut lines: Vec<String> = first.map(|(line, text)| format!("line {line}: {text}")).collect();
    let more = texts.count();
    if more > 0 {
        lines.push(format!("{more} more messages of the program are in its path only"));
    }
    lines
}

/// The messages at the same place before an event, since the last stop: the last few.
fn message_before(path: &CompensatedPath, event: usize) -> Option<String> {
    let at = path.events.get(event)?.at_element;
    let mut texts = Vec::new();
    for (count, earlier) in path.events[..event].iter().rev().enumerate() {
        let is_stop = matches!(earlier.action, Action::Stop { .. } | Action::ChangeTool { .. });
        if earlier.at_element != at || is_stop || count == REASON_EVENTS_MAX {
            break;
        }
        if let Action::Message { text } = earlier.action {
            if texts.len() == REASON_TEXTS_MAX {
                texts.push("...".to_owned());
                break;
            }
            texts.push(text.to_string());
        }
    }
    texts.reverse();
    (!texts.is_empty()).then(|| texts.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::contour::Source;
    use cnc_msgs::text::Text;

    #[test]
    fn a_stop_is_about_the_messages_at_its_place_since_the_last_stop() {
        let say = |text| Action::Message { text: Text::new(text).expect("short") };
        let stop = Action::Stop { optional: false };
        let actions = [
            (1, say("elsewhere")),
            (2, say("turn the part")),
            (2, say("over")),
            (2, stop),
            (2, say("clamp it")),
            (2, Action::SelectTool { tool: 3 }),
            (2, Action::ChangeTool { tool: 3 }),
            (3, stop),
        ];
        let event =
            |(at_element, action)| PathEvent { at_element, action, source: Source::default() };
        let events = actions.map(event).to_vec();
        let path = CompensatedPath { events, ..CompensatedPath::default() };
        for (event, wanted) in
            [(3, Some("turn the part over")), (6, Some("clamp it")), (7, None), (9, None)]
        {
            assert_eq!(message_before(&path, event).as_deref(), wanted, "event {event}");
        }
    }

    fn numbered(count: usize) -> Vec<PathEvent> {
        let event = |n| {
            let text = Text::new(&format!("m{n}")).expect("short");
            let source = Source { line: n as u32 + 1, ..Source::default() };
            PathEvent { at_element: 0, action: Action::Message { text }, source }
        };
        (0..count).map(event).collect()
    }

    #[test]
    fn a_reason_has_the_last_few_messages_of_very_many() {
        let mut events = numbered(100_000);
        let stop = Action::Stop { optional: false };
        events.push(PathEvent { at_element: 0, action: stop, source: Source::default() });
        let path = CompensatedPath { events, ..CompensatedPath::default() };
        let text = message_before(&path, 100_000).expect("a text");
        assert_eq!(text, "... m99992 m99993 m99994 m99995 m99996 m99997 m99998 m99999");
        assert_eq!(message_before(&path, REASON_TEXTS_MAX).expect("all").split(' ').count(), 8);
    }

    #[test]
    fn the_end_of_a_program_says_how_many_messages_are_left_out() {
        assert_eq!(last_lines(&numbered(2)), ["line 1: m0", "line 2: m1"]);
        let lines = last_lines(&numbered(SHOWN_MAX + 7));
        assert_eq!(lines.len(), SHOWN_MAX + 1);
        assert_eq!(lines[SHOWN_MAX], "7 more messages of the program are in its path only");
    }
}
