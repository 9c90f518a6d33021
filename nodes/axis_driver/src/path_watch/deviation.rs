//! What does not fit, in words.

use super::further::Off;
use cnc_msgs::calls::Calls;
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes};
use cnc_msgs::geometry::{AXIS_LETTERS, Position};
use std::fmt;

/// The line that should be under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Culprit {
    /// Of the part program; 0 before its first line.
    pub source_line: u32,
    /// Its N number.
    pub block: Option<u32>,
    /// Its row in the table of calls of the path, from 1; 0 without one.
    pub call: u32,
}

/// What does not fit to what was sent.
#[derive(Debug, Clone, PartialEq)]
pub enum Deviation {
    /// Machine frame, mm.
    Place {
        culprit: Culprit,
        at: Position,
        nearest: Position,
        off_mm: f64,
    },
    Offset {
        culprit: Culprit,
        shown: Position,
        wanted: Position,
    },
    Further {
        culprit: Culprit,
        off: Off,
    },
    /// Degrees or mm; 0 for A.
    FurtherOffset {
        culprit: Culprit,
        axis: usize,
        shown: f64,
        wanted: f64,
    },
    Feed {
        culprit: Culprit,
        feed_mm_per_min: f64,
        allowed_mm_per_min: f64,
    },
    Words {
        culprit: Culprit,
        is: String,
        sent: String,
    },
}

impl Deviation {
    /// The line that should be under way.
    pub fn culprit(&self) -> Culprit {
        match self {
            Self::Place { culprit, .. }
            | Self::Offset { culprit, .. }
            | Self::Further { culprit, .. }
            | Self::FurtherOffset { culprit, .. }
            | Self::Feed { culprit, .. }
            | Self::Words { culprit, .. } => *culprit,
        }
    }

    /// In words, with the calls that led to the line.
    pub fn text(&self, calls: &Calls) -> String {
        let culprit = self.culprit();
        match calls.text(culprit.call).as_str() {
            "" => self.to_string(),
            calls => format!("{culprit}, {calls}, {}", What(self)),
        }
    }
}

impl fmt::Display for Culprit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.source_line, self.block) {
            (0, _) => write!(f, "before the first line"),
            (line, Some(block)) => write!(f, "at line {line} (N{block})"),
            (line, None) => write!(f, "at line {line}"),
        }
    }
}

impl fmt::Display for Deviation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.culprit(), What(self))
    }
}

/// What does not fit, without its line.
struct What<'a>(&'a Deviation);

impl fmt::Display for What<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        use Deviation::{Feed, Further, FurtherOffset, Offset, Place, Words};
        match self.0 {
            Place { at, nearest, off_mm, .. } => write!(
                f,
                "the tool is {off_mm:.3} mm off the path: at {} in the machine frame, \
                 where {} is the nearest place of the path",
                show(*at),
                show(*nearest)
            ),
            Offset { shown, wanted, .. } => write!(
                f,
                "the controller has the work offset {} in force and not {} (machine \
                 frame)",
                show(*shown),
                show(*wanted)
            ),
            Further { off: Off { axis, is, ends: [low, high] }, .. } => {
                let (letter, unit) = (FURTHER_LETTERS[*axis], unit(*axis));
                write!(f, "{letter} is at {is:.3} {unit} in the machine frame, where ")?;
                match high - low < 0.000_5 {
                    true => write!(f, "the lines that were sent have it at {low:.3}"),
                    false => {
                        write!(f, "the lines that were sent have it between {low:.3} and {high:.3}")
                    }
                }
            }
            FurtherOffset { axis, shown, wanted, .. } => {
                let letter = FURTHER_LETTERS[*axis];
                write!(
                    f,
                    "the controller has the work offset {letter}{shown:.3} in force and not \
                     {letter}{wanted:.3} (machine frame)"
                )
            }
            Feed { feed_mm_per_min, allowed_mm_per_min, .. } => write!(
                f,
                "the controller moves at {feed_mm_per_min:.0} mm/min; {:.0} mm/min is \
                 the most that was sent",
                allowed_mm_per_min
            ),
            Words { is, sent, .. } => {
                write!(f, "the controller has {is} in force; {sent} was sent")
            }
        }
    }
}

fn unit(axis: usize) -> &'static str {
    if FurtherAxes::is_rotary(axis) { "degrees" } else { "mm" }
}

/// `X-100.000 Y0.000 Z0.000`
fn show(place: Position) -> String {
    let words = (0..3).map(|axis| format!("{}{:.3}", AXIS_LETTERS[axis], place[axis]));
    words.collect::<Vec<_>>().join(" ")
}
