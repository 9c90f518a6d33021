//! SINUMERIK 840C: the words of milling programs with radius compensation.
//!
//! H is an auxiliary function, D an offset register. M functions without a meaning here are
//! passed on to the machine. The profile defines G450, G451, G455 and G456.

use super::rs274::{CONSTANT_SPEED, FEED_MODE, OFFSETS, THREAD, common_m};
use super::{ApproachWords, Dialect, Distance, GWord, Group, Letters, MWord, Mode, Units};
use crate::block::{LexerRules, Programs};
use cnc_msgs::contour::CutterSide;
use cnc_msgs::geometry::Plane;

pub(super) static DIALECT: Dialect = Dialect {
    lexer: LexerRules {
        blanks_in_numbers: false,
        written_line_feed: true,
        at_words: true,
        delete_levels: true,
        calls: false,
        axis_names_after: Some(16.0),
        parameters: false,
        r_parameters: true,
        names: false,
        programs: Some(&PROGRAMS),
    },
    g,
    m,
    plane: Plane::Xy,
    letters: Letters::of(b"XYZIJKFSTDHABULP"),
    further_axes: Letters::NONE,
    foreign_axes: Letters::of(b"CQVWE"),
    auxiliary: Letters::of(b"H"),
    approach: ApproachWords::None,
    dwell: Letters::of(b"FX"),
    arc_radius_and_turns: false,
    arc_radius: b'R',
    percent_delimits: false,
};

/// `%SPF100` begins a subprogram, L100 P2 calls it, M17 returns.
static PROGRAMS: Programs = Programs {
    begins: &["%SPF"],
    letter: 'L',
    call: Some((b'L', b'P')),
    end: "M17",
    ending: "spf",
    depth_max: usize::MAX,
};

/// TRANSMIT and similar: G131, G231, G331 select one, G130 deselects (NC MD 5061).
const TRANSFORMATION: &str =
    "post the program for the axes of the machine, without a transformation";
const POLAR: &str = "program arcs with G2 and G3, X, Y and Z";

fn g(tenths: u16) -> GWord {
    match tenths {
        0 => GWord::Motion(Mode::Rapid),
        10 => GWord::Motion(Mode::Feed),
        20 => GWord::Motion(Mode::Arc { clockwise: true }),
        30 => GWord::Motion(Mode::Arc { clockwise: false }),
        40 => GWord::Dwell,
        90 => GWord::ExactStop,
        100 => GWord::Motion(Mode::Polar { rapid: true }),
        110 => GWord::Motion(Mode::Polar { rapid: false }),
        120 | 130 => GWord::RefusedMotion(POLAR),
        160 => GWord::FreePlane,
        170 => GWord::Plane(Plane::Xy),
        180 => GWord::Plane(Plane::Zx),
        190 => GWord::Plane(Plane::Yz),
        250 | 260 => GWord::Refused("set the limits of the working area on the machine"),
        330..=350 => GWord::RefusedMotion(THREAD),
        400 => GWord::CompensationOff,
        410 => GWord::CompensationOn { side: CutterSide::Left, is_dynamic: false },
        420 => GWord::CompensationOn { side: CutterSide::Right, is_dynamic: false },
        530 => GWord::MachineCoordinates,
        540 | 550 | 560 | 570 => GWord::WorkOffset((tenths / 10 - 53) as u8),
        580 | 590 => GWord::Refused(OFFSETS),
        600 | 620 | 640 => GWord::of_path(Letters::NONE),
        630 => GWord::RefusedMotion("tapping without a spindle encoder is not supported"),
        700 => GWord::Units(Units::Inch),
        710 => GWord::Units(Units::Millimetre),
        740 => GWord::Refused("home the machine with the home action before the program"),
        810..=899 => GWord::RefusedMotion(super::rs274::CYCLE),
        800 => GWord::NoMotion,
        900 => GWord::Distance(Distance::Absolute),
        910 => GWord::Distance(Distance::Incremental),
        920 | 960 => GWord::Refused(CONSTANT_SPEED),
        940 => GWord::Accepted(Group::Feed),
        950 => GWord::Refused(FEED_MODE),
        970 => GWord::Accepted(Group::SpindleMode),
        1300 | 1310 | 2310 | 3310 => GWord::Refused(TRANSFORMATION),
        _ => GWord::Unknown,
    }
}

fn m(number: u16) -> MWord {
    match number {
        17 => MWord::EndProgram,
        // S58: it takes effect at the end of its block.
        18 => MWord::Auxiliary { after_motion: true },
        0..=9 | 30 => common_m(number),
        10..=99 => MWord::Auxiliary { after_motion: false },
        _ => MWord::Unknown,
    }
}
