//! Every limit and tolerance of the loader, with its unit and its reason.

use std::time::Duration;

/// Bytes of a program that is held. The events of a larger one would not fit a small machine's memory.
pub const PROGRAM_BYTES_MAX: usize = 512 << 20;
/// Lines of a program that is held: one event of about 120 bytes each. [`load_pieces`](crate::pieces::load_pieces) holds
/// none.
pub const LINES_MAX: u32 = 10_000_000;
/// The size of a program.
#[derive(Debug, Clone, Copy)]
pub struct ProgramSize {
    pub bytes: u64,
    pub lines: u32,
}

impl ProgramSize {
    /// The most that is held.
    pub const HELD_MAX: Self = Self { bytes: PROGRAM_BYTES_MAX as u64, lines: LINES_MAX };
}

/// Bytes of a line, comments and blanks included: no control takes more.
pub const LINE_BYTES_MAX: usize = 4096;
/// Words of a block: more than any block that means something.
pub const BLOCK_WORDS_MAX: usize = 64;
/// Findings of a program; further ones are only counted.
pub const DIAGNOSTICS_MAX: usize = 1000;
/// Findings of a block, so that a line of prose does not use up the limit of the program.
pub const BLOCK_DIAGNOSTICS_MAX: u32 = 8;
/// Tools that are named when a program selects tools that are not expected.
pub const UNEXPECTED_TOOLS_MAX: usize = 20;
/// Magnitude of a coordinate, a centre or a radius, mm: one kilometre.
pub const COORDINATE_MM_MAX: f64 = 1e6;
/// Feed, mm/min: faster than any machine.
pub const FEED_MM_PER_MIN_MAX: f64 = 1e6;
/// Spindle speed, 1/min: faster than any spindle.
pub const SPINDLE_RPM_MAX: f64 = 1e6;
/// Dwell, seconds: a day.
pub const DWELL_SECONDS_MAX: f64 = 86_400.0;
/// A longer dwell is suspected to be in milliseconds, seconds.
pub const DWELL_SECONDS_SUSPICIOUS: f64 = 100.0;
/// N, T, D and H numbers: eight digits, as the longest T words have.
pub const NUMBER_MAX: f64 = 99_999_999.0;
/// Digits of such a number.
pub(crate) const NUMBER_DIGITS: usize = 8;
/// Turns of one arc block.
pub const ARC_TURNS_MAX: f64 = 9_999.0;

/// Moves of one block with a cycle.
pub const CYCLE_MOVES_MAX: f64 = 100_000.0;
/// Events that are held before one more cycle: as many as a program of the most lines has. Of a program that is planned
/// in parts and not held, those of one part.
pub const EVENTS_MAX: usize = LINES_MAX as usize;
/// How far a chip-breaking or peck cycle stays away from the last depth in rapid, mm: a hundredth
/// of an inch (LinuxCNC).
pub const PECK_CLEARANCE_MM: f64 = 0.254;
/// What is left of a step by rounding is none: 0.3 in is not three times 0.1 in.
pub const STEP_LEFT_MM: f64 = 1e-6;

/// An axis that goes less far stands still: half of the last place that is sent to a controller.
pub const STAYS_MM: f64 = 0.000_05;
/// Millimetres of an inch.
pub const MM_PER_INCH: f64 = 25.4;

/// How much the radii at the start and the end of an arc may differ in a metric program, mm,
/// however small the arc: two decimals, rounded at both ends (LinuxCNC).
pub const ARC_MISMATCH_MM: f64 = 2.0 * 0.01 * std::f64::consts::SQRT_2;
/// The same in an inch program, mm: three decimals.
pub const ARC_MISMATCH_INCH: f64 = 2.0 * 0.001 * std::f64::consts::SQRT_2;
/// A larger difference is accepted below this share of the radius (LinuxCNC, grbl).
pub const ARC_MISMATCH_RELATIVE: f64 = 0.001;
/// A difference that is never accepted, mm (grbl).
pub const ARC_MISMATCH_MM_MAX: f64 = 0.5;
/// How much half the chord may exceed R in a metric program, mm: a half circle (LinuxCNC).
pub const ARC_R_SHORT_MM: f64 = 0.001;
/// The same in an inch program.
pub const ARC_R_SHORT_INCH: f64 = 0.000_05;
/// Start and end of an arc are one point below this share of the radius: a full circle (LinuxCNC).
pub const FULL_CIRCLE_RELATIVE: f64 = 1e-6;
/// A G or M number must be this close to a tenth.
pub const CODE_FUZZ: f64 = 1e-6;

/// In the first line of all that is appended to a program.
pub(crate) const APPENDED_BY: &str = "appended by Kerf";
/// The line between a program and what is appended to it. It is the end of the program.
pub(crate) const APPENDED: &str = "% (what follows is appended by Kerf)";
/// Bytes of a name of a subroutine in the calls that led to a line.
pub(crate) const CALL_NAME_BYTES_MAX: usize = 40;
/// Files with subroutines that a program may call.
pub const LIBRARY_FILES_MAX: usize = 500;

/// Limits of programs with subroutines and loops.
#[derive(Debug, Clone, Copy)]
pub struct FlowLimits {
    /// Lines that are executed, above those of the text: a loop without an end stops here. At about a hundred bytes of
    /// memory for a line that moves, and some 10 million lines a second.
    pub blocks_max: u64,
    /// Bytes of the lines that are executed and of their messages, above those of the text: long lines with
    /// expressions take their time by the byte.
    pub bytes_max: u64,
    /// Subroutines inside each other.
    pub depth_max: usize,
    /// The time for all of it, where somebody waits.
    pub time: Option<TimeLimit>,
}

impl Default for FlowLimits {
    fn default() -> Self {
        Self { blocks_max: 5_000_000, bytes_max: 64 << 20, depth_max: 100, time: None }
    }
}

/// A limit on the time that a program with subroutines and loops takes to be read. Programs without them take
/// what their length takes.
#[derive(Debug, Clone, Copy)]
pub struct TimeLimit {
    pub most: Duration,
    /// The time since any moment.
    pub clock: fn() -> Duration,
}
