//! What a run from the middle does before its first element, for people.

use crate::approach::ApproachText;
use crate::encoder::{EncodedLine, Encoder, EncoderStep};
use crate::link::LineKind;
use cnc_msgs::contour::{Action, work_system};
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes};
use cnc_msgs::path::{CompensatedPath, PathEvent, StartInSpan, in_force};

/// Lines before the first element that a check shows.
const SHOWN_MAX: usize = 10;
/// Of them the last.
const LAST_SHOWN: usize = 3;
/// Lines of the program that move something, after them.
const MOVES_SHOWN: usize = 3;

/// How the tool gets to the first element of a run from the middle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::driver) enum Descent {
    /// It is lifted, goes over the place and comes down.
    FromAbove,
    /// No height is given, or the machine is not homed.
    NotLifted,
    /// The same, and the first move goes from wherever the tool stands.
    FromHere,
    /// Coming down would cut: Z is in the plane of compensation.
    Cuts,
}

impl Descent {
    /// Where the tool is not lifted; `is_bound`: the path says where axes have to stand.
    pub(in crate::driver) fn unlifted(
        is_in_span: bool,
        in_span: StartInSpan,
        is_bound: bool,
    ) -> Self {
        match () {
            () if is_in_span && in_span != StartInSpan::FromAbove => Self::Cuts,
            () if is_bound => Self::NotLifted,
            () => Self::FromHere,
        }
    }

    /// What has to be done before the run, for people.
    fn before(self) -> Option<&'static str> {
        match self {
            Self::FromAbove => None,
            Self::NotLifted => Some(
                "the tool has to stand there: it comes from above only on a homed machine, with the \
                 parameter approach: lift",
            ),
            Self::FromHere => Some(
                "the first move goes from where the tool stands: lift the tool first; it is lifted by itself \
                 only on a homed machine, with the parameter approach: lift",
            ),
            Self::Cuts => Some(
                "the tool has to stand there: Z is in the plane of compensation, so coming down would \
                 cut",
            ),
        }
    }
}

/// What a check says of a run that begins here, in parts: the words in force there, how the tool gets
/// there, what is sent for that, and the first lines of the program that follow.
pub(in crate::driver) fn beginning_of(
    path: &CompensatedPath,
    encoder: Encoder,
    descent: Descent,
    approach: Option<ApproachText>,
) -> Vec<String> {
    let (element, event) = (encoder.next_element(), encoder.events_begun());
    let mut parts = words_in_force(&in_force(&path.events[..event], element));
    parts.extend(approach.map(|approach| approach.to_string()));
    let awaited = encoder.awaited_further();
    let (first, then) = lines_of(encoder);
    if !first.is_empty() {
        parts.push(format!("first come {}", first.join(", ")));
    }
    if !then.is_empty() {
        parts.push(format!("the program goes on with {}", then.join(", ")));
    }
    parts.extend(awaited.map(|(letters, line)| {
        let (is, it) = if letters.len() == 1 { ("is", "it") } else { ("are", "them") };
        format!("{letters} {is} moved from line {line} on only: put {it} where the program begins")
    }));
    parts.extend(descent.before().map(str::to_owned));
    parts
}

/// `A is not homed: be sure that it stands at A389.440`
pub(in crate::driver) fn not_homed_text(axes: FurtherAxes) -> Option<String> {
    let (are, they) = match axes.letters().len() {
        0 => return None,
        1 => ("is", "it stands"),
        _ => ("are", "they stand"),
    };
    let places = axes.iter().map(|(axis, at)| format!(" {}{at:.3}", FURTHER_LETTERS[axis]));
    let places: String = places.collect();
    Some(format!("{} {are} not homed: be sure that {they} at{places}", axes.letters()))
}

/// `tool T1, to be confirmed (M6)`, `offsets G55 G43 H3`, `spindle S1000 M3`, `coolant M8`.
fn words_in_force(events: &[PathEvent]) -> Vec<String> {
    let of = |name: &str, none: &str, word: &dyn Fn(&Action) -> Option<String>| {
        let words: Vec<String> = events.iter().filter_map(|event| word(&event.action)).collect();
        format!("{name} {}", if words.is_empty() { none.to_owned() } else { words.join(" ") })
    };
    let text = |action: &Action| Some(action.text());
    vec![
        of("tool", "as it is: the program has changed none before", &|action| match action {
            Action::ChangeTool { tool } => Some(format!("T{tool}, to be confirmed (M6)")),
            _ => None,
        }),
        // Every run begins with these.
        of("offsets", "G54", &|action| match action {
            Action::WorkOffset { system } => Some(work_system(*system)),
            Action::ToolLength { .. } => text(action),
            _ => None,
        }),
        of("spindle", "off", &|action| match action {
            Action::SpindleSpeed { .. } | Action::Spindle(_) => text(action),
            _ => None,
        }),
        of("coolant", "off", &|action| match action {
            Action::Coolant(_) => text(action),
            _ => None,
        }),
    ]
}

/// The lines that bring machine and tool to the start, and the first ones of the program, with their
/// lines there.
fn lines_of(mut encoder: Encoder) -> (Vec<String>, Vec<String>) {
    let begun = encoder.events_begun();
    let (mut first, mut then, mut moves) = (Vec::new(), Vec::new(), 0);
    while let Some(Ok(step)) = encoder.next_step() {
        let is_of_program = !then.is_empty() || encoder.events_begun() > begun;
        if !is_of_program && step.line().is_none_or(|line| line.element.is_none()) {
            first.extend(match step {
                EncoderStep::Line(line) | EncoderStep::ReadInput { line } => Some(line.text),
                EncoderStep::ToolChange { tool, .. } => Some(format!("the change to T{tool}")),
                EncoderStep::ControllerChange { tool, .. } => Some(format!("M6T{tool}")),
                _ => None,
            });
            continue;
        }
        let (text, source) = match step {
            EncoderStep::Line(EncodedLine { text, source, kind, .. }) => {
                moves += usize::from(kind == LineKind::Motion);
                (text, source)
            }
            EncoderStep::ReadInput { line } => (line.text, line.source),
            EncoderStep::Home { text, source, .. } => (text, source),
            EncoderStep::ToolChange { tool, source } => (format!("the change to T{tool}"), source),
            EncoderStep::ControllerChange { tool, source } => (format!("M6T{tool}"), source),
            EncoderStep::Probe { .. }
            | EncoderStep::Stretch { .. }
            | EncoderStep::UserFunction { .. } => break,
            EncoderStep::AllowOverrides { .. }
            | EncoderStep::CheckStart
            | EncoderStep::CheckReturn { .. } => continue,
        };
        then.push(format!("{text} (line {})", source.line));
        if moves == MOVES_SHOWN || then.len() == SHOWN_MAX {
            break;
        }
    }
    (shortened(first), then)
}

/// The first of many lines and the last three, which move the tool over the part and down.
fn shortened(mut lines: Vec<String>) -> Vec<String> {
    let more = lines.len().saturating_sub(SHOWN_MAX);
    if more > 0 {
        let from = SHOWN_MAX - LAST_SHOWN;
        lines.splice(from..from + more, [format!("{more} more")]);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encoder::{EncoderConfig, start_at};
    use cnc_msgs::contour::{Action, CoolantMode, Source, SpindleMode};
    use cnc_msgs::geometry::{AxisSet, Shape};
    use cnc_msgs::path::{PathElement, PathEvent, Role};
    use std::sync::Arc;

    #[test]
    fn where_the_tool_is_not_lifted_the_start_says_what_to_do() {
        use StartInSpan::{FromAbove, Refused, Standing};
        for (is_in_span, in_span, is_bound, expected) in [
            (false, Refused, true, Descent::NotLifted),
            (true, FromAbove, true, Descent::NotLifted),
            (true, Standing, true, Descent::Cuts),
            // The control's answer is about another place than the path's.
            (false, Standing, true, Descent::NotLifted),
            // Before the first motion of a program that names its axes.
            (false, Refused, false, Descent::FromHere),
        ] {
            let descent = Descent::unlifted(is_in_span, in_span, is_bound);
            assert_eq!(descent, expected, "{is_in_span} {in_span:?} {is_bound}");
            let before = descent.before().expect("something has to be done");
            let stands = before.starts_with("the tool has to stand there");
            assert_eq!(stands, is_bound);
        }
        assert_eq!(Descent::FromAbove.before(), None);
    }

    #[test]
    fn axes_that_homing_leaves_out_are_said_with_their_places() {
        let a = FurtherAxes::NONE.with(0, 389.44);
        for (axes, text) in [
            (FurtherAxes::NONE, None),
            (a, Some("A is not homed: be sure that it stands at A389.440")),
            (
                a.with(1, -5.0),
                Some("AB are not homed: be sure that they stand at A389.440 B-5.000"),
            ),
        ] {
            assert_eq!(not_homed_text(axes).as_deref(), text);
        }
    }

    #[test]
    fn of_many_lines_before_the_first_element_ten_are_shown() {
        let beginning = |offsets: u32| {
            let element = |line, x| PathElement {
                shape: Shape::Line,
                end: [x, 0.0, 0.0],
                feed_mm_per_min: Some(600.0),
                role: Role::None,
                side: None,
                axes: AxisSet::ALL,
                source: Source { line, ..Source::default() },
            };
            let events = (0..offsets).map(|number| PathEvent {
                at_element: 0,
                action: Action::SetWorkOffset {
                    system: 1,
                    axes: AxisSet::ALL,
                    origin: [f64::from(number), 0.0, 0.0],
                    by_position: false,
                },
                source: Source { line: 1, ..Source::default() },
            });
            let path = CompensatedPath {
                elements: vec![element(2, 10.0), element(3, 20.0)],
                events: events.collect(),
                ..CompensatedPath::default()
            };
            let config = EncoderConfig::default();
            let path = Arc::new(path);
            let started = start_at(path.clone(), config, (3, 0), StartInSpan::Refused);
            let (encoder, _) = started.expect("it begins");
            let parts = beginning_of(&path, encoder, Descent::FromAbove, None);
            parts
                .into_iter()
                .find(|part| part.starts_with("first come "))
                .expect("lines come first")
        };
        let few = beginning(2);
        assert!(!few.contains(" more"), "{few}");
        let shown = few.split(", ").count();
        let many = beginning(1000);
        assert_eq!(many.split(", ").count(), SHOWN_MAX + 1, "{many}");
        let rest = shown + 998 - SHOWN_MAX;
        assert_eq!(many.split(", ").nth(SHOWN_MAX - LAST_SHOWN), Some(&*format!("{rest} more")));
    }

    #[test]
    fn what_is_in_force_and_what_is_cut_first_is_said_in_parts() {
        let element = |line, x| PathElement {
            shape: Shape::Line,
            end: [x, 0.0, -1.0],
            feed_mm_per_min: Some(600.0),
            role: Role::None,
            side: None,
            axes: AxisSet::ALL,
            source: Source { line, ..Source::default() },
        };
        let event = |action| {
            let source = Source { line: 1, ..Source::default() };
            PathEvent { at_element: 0, action, source }
        };
        let events = [
            Action::ChangeTool { tool: 3 },
            Action::WorkOffset { system: 2 },
            Action::ToolLength { offset: Some(3), length_mm: 50.0, second: None },
            Action::SpindleSpeed { rpm: 900.0 },
            Action::Spindle(SpindleMode::Clockwise),
            Action::Coolant(CoolantMode::Flood),
        ];
        let path = Arc::new(CompensatedPath {
            elements: (2..8).map(|line| element(line, f64::from(line))).collect(),
            events: events.map(event).to_vec(),
            ..CompensatedPath::default()
        });
        let started =
            start_at(path.clone(), EncoderConfig::default(), (4, 0), StartInSpan::Refused);
        let (encoder, _) = started.expect("it begins");
        let parts = beginning_of(&path, encoder, Descent::NotLifted, None);
        assert_eq!(
            parts,
            [
                "tool T3, to be confirmed (M6)",
                "offsets G55 G43 H3",
                "spindle S900 M3",
                "coolant M8",
                "first come M5, the change to T3, G55, G43.1Z50, S900, M3, M8",
                "the program goes on with G1X4Y0Z-1F600 (line 4), X5Y0Z-1 (line 5), X6Y0Z-1 (line 6)",
                Descent::NotLifted.before().expect("it has to stand there"),
            ]
        );
    }
}
