//! Okuma OSP for turning: Z and X, six-digit T words, tool-nose radius compensation.
//!
//! X is a diameter; I is the X part of a centre or of an imaginary point, as a radius; L is the
//! radius of an arc. `$` begins a file, O names a program, N names a block. T turns the turret,
//! so there is no M6. G20 and G21 are not units here. Feeds are mm/min; other feed modes are
//! rejected by name.

use super::rs274::{CONSTANT_SPEED, CYCLE, FEED_MODE, OFFSETS, THREAD, common_m};
use super::{ApproachWords, Dialect, Distance, GWord, Group, Letters, MWord, Mode};
use crate::block::LexerRules;
use cnc_msgs::contour::CutterSide;
use cnc_msgs::geometry::Plane;

pub(super) static DIALECT: Dialect = Dialect {
    lexer: LexerRules {
        blanks_in_numbers: false,
        written_line_feed: false,
        at_words: false,
        delete_levels: false,
        calls: false,
        axis_names_after: None,
        parameters: false,
        r_parameters: false,
        names: true,
        programs: None,
    },
    g,
    m,
    plane: Plane::Zx,
    letters: Letters::of(b"XZIKLFST"),
    further_axes: Letters::NONE,
    foreign_axes: Letters::of(b"ABCUVWY"),
    auxiliary: Letters::NONE,
    approach: ApproachWords::Point,
    dwell: Letters::of(b"F"),
    arc_radius_and_turns: true,
    arc_radius: b'L',
    percent_delimits: true,
};

const C_AXIS: &str = "post for turning; the spindle is not an axis here";
const MACHINE: &str = "do it at the machine, outside part programs";

fn g(tenths: u16) -> GWord {
    match tenths {
        0 => GWord::Motion(Mode::Rapid),
        10 => GWord::Motion(Mode::Feed),
        20 => GWord::Motion(Mode::Arc { clockwise: true }),
        30 => GWord::Motion(Mode::Arc { clockwise: false }),
        40 => GWord::Dwell,
        // G13 is the upper turret; there is no lower one.
        130 => GWord::Accepted(Group::Path),
        140 => GWord::Refused("write the program of each turret by itself"),
        170 => GWord::Plane(Plane::Xy),
        180 => GWord::Plane(Plane::Zx),
        190 => GWord::Plane(Plane::Yz),
        200 | 210 => GWord::Refused("home the machine with the home action before the program"),
        220 | 280 | 290 => GWord::Refused(MACHINE),
        310..=350 => GWord::RefusedMotion(THREAD),
        400 => GWord::CompensationOff,
        410 => GWord::CompensationOn { side: CutterSide::Left, is_dynamic: false },
        420 => GWord::CompensationOn { side: CutterSide::Right, is_dynamic: false },
        500 => GWord::Refused(OFFSETS),
        640 | 650 => GWord::of_path(Letters::NONE),
        710..=790 | 810..=889 => GWord::RefusedMotion(CYCLE),
        900 => GWord::Distance(Distance::Absolute),
        910 => GWord::Distance(Distance::Incremental),
        940 => GWord::Accepted(Group::Feed),
        950 => GWord::Refused(FEED_MODE),
        960 => GWord::Refused(CONSTANT_SPEED),
        970 => GWord::Accepted(Group::SpindleMode),
        1010..=1039 | 1190 | 1320..=1339 | 1360..=1399 => GWord::RefusedMotion(C_AXIS),
        1070 | 1080 | 1120 | 1130 => GWord::RefusedMotion(THREAD),
        1100 | 1110 => GWord::Refused(CONSTANT_SPEED),
        _ => GWord::Unknown,
    }
}

fn m(number: u16) -> MWord {
    match number {
        6 => MWord::Refused("a T word turns the turret: write T010101"),
        0..=9 | 30 => common_m(number),
        10..=999 => MWord::Auxiliary { after_motion: false },
        _ => MWord::Unknown,
    }
}
