//! Every tolerance of the path watch, with its unit and its reason.

/// What no other reason explains, mm: as much as the tracker takes for "on the element".
pub(super) const PATH_MM: f64 = 0.02;
/// A report in millimetres has three decimals: half of the last one, mm.
pub(super) const REPORT_MM: f64 = 0.000_5;
/// A report in inches has four decimals: half of the last one, mm.
pub(super) const REPORT_INCH_MM: f64 = 0.001_27;
/// Numbers that may be rounded on the way to a place: the position, the stored offset, the
/// shift, the tool length.
pub(super) const ROUNDED_NUMBERS: f64 = 4.0;
/// The step of an axis where `$100` to `$102` do not say, mm: 20 steps per millimetre.
pub(super) const STEP_MM_UNKNOWN: f64 = 0.05;
/// The axes step one after the other, so that each may be a whole step off the line.
pub(super) const STEPS: f64 = 1.0;
/// What the firmware draws of an arc is off what was written by at most this, mm, and by this
/// many times `$12`: the encoder sends no arc that would be drawn worse.
pub(super) const ARC_DRAWN_MM: f64 = 0.005;
pub(super) const ARC_TOLERANCES: f64 = 2.0;
/// The numbers of the firmware have 24 bits: a place in the machine frame is off by as many of
/// the last places as are added to it.
pub(super) const LAST_PLACES: f64 = 4.0;

/// Distances nearer to each other than this are the same, mm: rounding.
pub(super) const SAME_MM: f64 = 1e-9;

/// Finished blocks whose steps are still to be made: the step generator holds up to ten
/// slices of a hundredth of a second, each of which may be a block of its own, and the answer
/// of a line may come before or after that of its neighbours.
pub(super) const BLOCKS_AT_THE_STEPS: usize = 16;
/// Planner blocks where the firmware reports none: FluidNC can be set up to hold 120.
pub(super) const PLANNER_BLOCKS_UNKNOWN: usize = 128;
/// A line is sure to take a planner block where it is longer than this many steps.
pub(super) const STEPS_OF_A_BLOCK: f64 = 2.0;

/// A reported feed is above what is allowed from this share on...
pub(super) const FEED_SHARE: f64 = 1.1;
/// ...and this much, mm/min: reports round it to whole numbers, and it is an average of a slice.
pub(super) const FEED_MM_PER_MIN: f64 = 60.0;
/// Reports in a row that show it, none slower than the one before: while an override is taken
/// back the axes slow down first.
pub(super) const FEED_REPORTS: u32 = 3;

/// F and S in the words in force are rounded to whole numbers by some firmwares, and to 32 bits.
pub(super) const WORD: f64 = 0.6;
pub(super) const WORD_SHARE: f64 = 1e-5;
