//! Why a path cannot be sent: with the source line, the numbers and what is allowed.

use cnc_msgs::contour::{Action, Source, work_system};
use cnc_msgs::geometry::Position;
use cnc_msgs::path::CompensatedPath;

/// Why a path cannot be sent to this controller.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("line {}{calls}: {problem}", source_place.line)]
pub struct EncodeError {
    /// The place in the part program.
    pub source_place: Source,
    /// What follows the line in a message: the calls and passes that led to it.
    pub calls: String,
    pub problem: EncodeProblem,
}

impl EncodeError {
    pub(super) fn new(
        path: &CompensatedPath,
        source_place: Source,
        problem: EncodeProblem,
    ) -> Self {
        Self { source_place, calls: path.calls.after(source_place), problem }
    }
}

/// What is wrong; lengths in mm.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EncodeProblem {
    #[error("{letter}{value} is not between -{max} and {max} mm, the limit of position_mm_max")]
    Position { letter: char, value: f64, max: f64 },
    #[error("the feed rate {value} mm/min is not between 0.0001 and {max} mm/min")]
    Feed { value: f64, max: f64 },
    #[error("the spindle speed {value} rpm is not between 0 and {max} rpm")]
    SpindleSpeed { value: f64, max: f64 },
    #[error("the dwell of {value} s is not between 0 and {max} s")]
    Dwell { value: f64, max: f64 },
    #[error("a rapid along an arc cannot be sent: give the arc a feed rate")]
    RapidArc,
    #[error("the arc from {start:?} to {end:?} about {center:?} cannot be drawn")]
    Arc { start: Position, end: Position, center: Position },
    #[error(
        "the arc from {start:?} to {end:?} about {center:?} would be sent as {count:.0} lines; at \
         most {max:.0} are sent: split it into shorter arcs"
    )]
    ArcLines { start: Position, end: Position, center: Position, count: f64, max: f64 },
    #[error(
        "{letter}{value} is at {in_machine} mm in the machine frame, where the controller's 32 bit numbers are {step} mm apart: move the work offset nearer to the machine zero"
    )]
    Resolution { letter: char, value: f64, in_machine: f64, step: f64 },
    #[error(
        "the arc starts at a position of {axes} that is not known since {since}: move {axes} \
         before it"
    )]
    UnknownStart { axes: String, since: String },
    #[error("this controller has no {}: it reports no offset of it ($#)", work_system(*system))]
    WorkOffset { system: u8 },
    #[error(
        "the program moves {letter}, and this controller has no axis {letter}: its axes are {axes}; \
         delete these words, or run the program on a machine with {letter}"
    )]
    NoAxis { letter: char, axes: String },
    #[error(
        "{letter}{value} is not between -{max} and {max} degrees: the controller's 32 bit numbers \
         would be too far apart; post angles between -360 and 360 degrees"
    )]
    Turns { letter: char, value: f64, max: f64 },
    #[error("{words} moves with a motion of its block, and the path has none there")]
    NoMotion { words: String },
    #[error("how fast {words} moves depends on where the axes are, which is not known here")]
    UnknownRate { words: String },
    #[error(
        "{word} needs a spindle that the axes keep pace with, and this controller has none: grblHAL has one where \
         its spindle has an encoder (SS in [NEWOPT:])"
    )]
    NoSpindleSync { word: String },
    #[error(
        "{word} feeds {feed:.0} mm/min at this spindle speed, and this controller takes at most {max:.0} mm/min \
         there (90 % of ${setting}): program a lower S"
    )]
    ThreadFeed { word: String, feed: f64, max: f64, setting: usize },
    #[error("how fast {word} may be is not known: the controller has not reported ${setting}")]
    ThreadRate { word: String, setting: usize },
    #[error(
        "{word} waits for two turns of the spindle, for at most {max} s, and this spindle takes longer: program an S \
         above {:.0}",
        120.0 / max
    )]
    SlowThread { word: String, max: f64 },
    #[error(
        "{word} calls a function of the user, and user_function_s_max is 0: set this parameter to the longest \
         time that one may take"
    )]
    NoUserFunctions { word: String },
    #[error(
        "{word} needs {needs}, and this controller has {count} of them, counted from 0: grblHAL says how many it has in \
         [AUX IO:] of $I"
    )]
    NoPort { word: String, needs: String, count: u8 },
    #[error(
        "{word}: grblHAL would set {takes} instead: it sets whole numbers from -2147483648 to 2147483647, of the unit that \
         the output has"
    )]
    WholeOutput { word: String, takes: i32 },
    #[error(
        "{word} switches when the next motion begins, and none follows: M64, M65 and M68 switch where they stand"
    )]
    NoMotionAfter { word: String },
    #[error("{word} is not done: {why}")]
    NeverDone { word: String, why: &'static str },
    #[error("this controller has no {word}")]
    Unsupported { word: String },
    #[error("{word} comes after the end of the program in line {end}")]
    AfterEnd { word: String, end: u32 },
    #[error("the line {text:?} has {bytes} bytes; the controller accepts {max}")]
    LineLength { text: String, bytes: usize, max: usize },
}

impl EncodeProblem {
    /// A word that only a machine can do, and this one does not.
    pub(crate) fn not_here(action: &Action) -> Self {
        let word = action.text();
        let why = match *action {
            Action::Auxiliary { letter: 'M', number: 19.0, .. } => {
                "no firmware that Kerf knows turns its spindle to an angle; let a function of your cell do it \
                 (M100 to M199), or stop with M0 and turn it by hand"
            }
            Action::Auxiliary { letter: 'G', number: 96.0 | 97.0, .. } => {
                "grblHAL has one speed for all moves that it has planned, which would not follow the tool, and other \
                 firmware has no G96; post speeds in 1/min (G97)"
            }
            _ => return Self::Unsupported { word },
        };
        Self::NeverDone { word, why }
    }
}
