//! Compares two paths as the lines that a controller is sent for them.
//!
//! If the lines are the same, the recorded answers for one path are valid for the other.

use super::compare::DifferencePlace;
use axis_driver::encoder::{Encoder, EncoderConfig, EncoderStep};
use cnc_msgs::path::CompensatedPath;
use std::sync::Arc;

/// The first line in which two paths differ.
#[derive(Debug)]
pub(crate) struct OtherLine {
    pub(crate) text: String,
    pub(crate) place: DifferencePlace,
}

/// Compares the lines of two paths; returns their number, or the first difference.
pub(crate) fn compare(
    recorded: &Arc<CompensatedPath>,
    now: &Arc<CompensatedPath>,
    config: EncoderConfig,
) -> Result<usize, OtherLine> {
    let lines = |path: &Arc<CompensatedPath>| Lines(Some(Encoder::new(Arc::clone(path), config)));
    let (mut recorded, mut now) = (lines(recorded), lines(now));
    for count in 0.. {
        let (was, is) = (recorded.next(), now.next());
        if was == is {
            match was {
                None => return Ok(count),
                Some(_) => continue,
            }
        }
        let said = |line: &Option<(String, u32)>| {
            line.as_ref().map_or("nothing".to_owned(), |(text, _)| format!("\"{text}\""))
        };
        let line = was.as_ref().or(is.as_ref()).map_or(0, |(_, line)| *line);
        return Err(OtherLine {
            text: format!("G-code line {count}: {} is {} now", said(&was), said(&is)),
            place: DifferencePlace { line, ..DifferencePlace::default() },
        });
    }
    unreachable!("the counting has no end")
}

/// The lines sent for a path, with the line of the program; ends after a line that cannot be sent.
struct Lines(Option<Encoder>);

impl Iterator for Lines {
    type Item = (String, u32);

    fn next(&mut self) -> Option<Self::Item> {
        let step = self.0.as_mut()?.next_step()?;
        Some(match step {
            Ok(
                EncoderStep::Line(line)
                | EncoderStep::Probe { line, .. }
                | EncoderStep::ReadInput { line },
            ) => (line.text, line.source.line),
            Ok(EncoderStep::ToolChange { tool, source }) => {
                (format!("tool change to T{tool}"), source.line)
            }
            Ok(EncoderStep::ControllerChange { tool, source }) => {
                (format!("tool change to T{tool} by the controller"), source.line)
            }
            Ok(EncoderStep::Home { text, source, .. }) => (text, source.line),
            Ok(EncoderStep::Stretch { source }) => {
                ("what follows is planned from what was measured".to_owned(), source.line)
            }
            Ok(EncoderStep::UserFunction { function, source }) => {
                (format!("the cell does {function}"), source.line)
            }
            Ok(EncoderStep::AllowOverrides { allowed, source }) => {
                (format!("allowed overrides: {allowed}"), source.line)
            }
            Ok(EncoderStep::CheckStart) => ("check of the start".to_owned(), 0),
            Ok(EncoderStep::CheckReturn { .. }) => ("check of the way back".to_owned(), 0),
            Err(error) => {
                self.0 = None;
                (error.to_string(), 0)
            }
        })
    }
}
