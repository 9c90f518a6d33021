//! The feed at which the tool comes down to where a run begins, or back to where it stood.

use super::Encoder;
use cnc_msgs::contour::Action;
use cnc_msgs::further::FurtherMode;
use cnc_msgs::geometry::Shape;
use cnc_msgs::path::CompensatedPath;

impl Encoder {
    /// The feed in force before this element, else that of the first one from here on; `None` where no
    /// move of X, Y and Z has one of its own.
    pub(crate) fn plunge_feed(&self, index: usize) -> Option<f64> {
        let path = &self.path;
        let index = index.min(path.elements.len());
        let before = (0..index).rev();
        before.chain(index..path.elements.len()).find_map(|number| own_feed(path, number))
    }
}

/// The feed of an element along X, Y and Z. That of a thread follows from its spindle. Where A to W go
/// along, or nothing moves, the feed may follow from a time (G93): it can be as slow as nothing.
fn own_feed(path: &CompensatedPath, number: usize) -> Option<f64> {
    let element = path.elements[number];
    let first = path.events.partition_point(|event| event.at_element < number);
    let mut of_block = path.events[first..].iter().take_while(|event| event.at_element == number);
    let is_other = of_block.any(|event| match event.action {
        Action::SpindleSync { .. } => true,
        Action::Further(further) => {
            further.mode == FurtherMode::Along && event.source == element.source
        }
        _ => false,
    });
    let moves = element.shape != Shape::Line || element.end != path.start_of(number);
    element.feed_mm_per_min.filter(|_| moves && !is_other)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encoder::{Board, EncoderConfig, EncoderStep, StartProblem, start_at};
    use cnc_msgs::contour::Source;
    use cnc_msgs::further::{FurtherAxes, FurtherMove};
    use cnc_msgs::geometry::AxisSet;
    use cnc_msgs::path::{PathElement, PathEvent, Role, StartInSpan};
    use std::sync::Arc;

    /// A block a word, line 1 first: `G0`, `F300`, `still F300` (no length), `along F2` (A turns too), `pitch F500`
    /// and `turn F3600` (A alone, no element).
    fn path(blocks: &[&str]) -> CompensatedPath {
        let mut path = CompensatedPath::default();
        for (block, line) in blocks.iter().zip(1..) {
            let source = Source { line, ..Source::default() };
            let at_element = path.elements.len();
            let (kind, feed) = block.rsplit_once(' ').unwrap_or(("", block));
            let feed = feed.strip_prefix('F').map(|feed| feed.parse().expect("a feed"));
            let mut act = |action| path.events.push(PathEvent { at_element, action, source });
            let axes = FurtherAxes::NONE.with(0, f64::from(line));
            match kind {
                "along" => act(Action::Further(FurtherMove { axes, mode: FurtherMode::Along })),
                "pitch" => act(Action::SpindleSync { pitch_mm: 1.0 }),
                "turn" => {
                    let mode = FurtherMode::Feed(feed.expect("a feed"));
                    act(Action::Further(FurtherMove { axes, mode }));
                    continue;
                }
                _ => {}
            }
            let before = path.elements.last().map_or(0.0, |last: &PathElement| last.end[0]);
            path.elements.push(PathElement {
                shape: Shape::Line,
                end: [if kind == "still" { before } else { f64::from(line) }, 0.0, -1.0],
                feed_mm_per_min: feed,
                role: Role::None,
                side: None,
                axes: AxisSet::ALL,
                source,
            });
        }
        path
    }

    #[test]
    fn the_tool_comes_down_at_the_feed_in_force_else_at_the_next_one() {
        for (blocks, line, expected) in [
            // Before the last retract, and before lines that turn A alone.
            (&["F300", "F200", "G0"][..], 3, Some(200.0)),
            (&["G0", "F300", "turn F3600", "turn F3600", "G0"], 4, Some(300.0)),
            // The one in force counts, not the one of the line.
            (&["F100", "F1000"], 2, Some(100.0)),
            // None is in force yet.
            (&["G0", "G0", "F600"], 2, Some(600.0)),
            // A time is no feed, before and after.
            (&["F300", "along F0.2", "F400"], 3, Some(300.0)),
            (&["G0", "along F0.2", "still F0.1", "F400"], 2, Some(400.0)),
            (&["G0", "along F0.2", "F400"], 3, Some(400.0)),
            (&["F300", "pitch F1500", "G0"], 3, Some(300.0)),
            (&["G0", "turn F3600", "G0"], 3, None),
            (&["G0", "along F0.2", "G0"], 3, None),
        ] {
            let path = Arc::new(path(blocks));
            let config = EncoderConfig { approach_z_mm: Some(-5.0), ..EncoderConfig::default() };
            let board = Board { further_axes: 1, ..config.board };
            let config = EncoderConfig { board, ..config };
            let started = start_at(path, config, (line, 0), StartInSpan::Refused);
            match (started, expected) {
                (Ok((mut encoder, _)), Some(feed)) => {
                    let steps = std::iter::from_fn(|| encoder.next_step());
                    let lines = steps.filter_map(|step| match step {
                        Ok(EncoderStep::Line(line)) => Some(line.text),
                        _ => None,
                    });
                    let down = lines.into_iter().find(|text| text.contains("Z-1"));
                    assert_eq!(down, Some(format!("G1Z-1F{feed}")), "{blocks:?}");
                }
                (Err(StartProblem::NoFeed { line: at, z_mm }), None) => {
                    assert_eq!((at, z_mm), (line, -1.0), "{blocks:?}");
                }
                (other, expected) => panic!("{blocks:?}: {other:?} and not {expected:?}"),
            }
        }
    }
}
