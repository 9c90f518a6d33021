//! Aerotech Automation1: G code, and the AeroScript calls for motion and compensation.
//!
//! `lexer/call.rs` turns calls into words. G43 sets the radius, G44 the axes of compensation. A
//! rapid does not follow a path (A08).

use super::rs274::{CONSTANT_SPEED, CYCLE, FEED_MODE, OFFSETS, THREAD, common_m};
use super::{ApproachWords, Dialect, Distance, GWord, Group, Letters, MWord, Mode, Units};
use crate::block::LexerRules;
use crate::lexer::call;
use cnc_msgs::contour::CutterSide;
use cnc_msgs::geometry::Plane;

pub(super) static DIALECT: Dialect = Dialect {
    lexer: LexerRules {
        blanks_in_numbers: false,
        written_line_feed: false,
        at_words: false,
        delete_levels: false,
        calls: true,
        axis_names_after: Some(44.0),
        parameters: false,
        r_parameters: false,
        names: false,
        programs: None,
    },
    g,
    m,
    plane: Plane::Xy,
    letters: Letters::of(b"XYZIJKRFSTPQ"),
    further_axes: Letters::NONE,
    foreign_axes: Letters::of(b"ABCUVW"),
    auxiliary: Letters::NONE,
    approach: ApproachWords::None,
    dwell: Letters::of(b"P"),
    arc_radius_and_turns: true,
    arc_radius: b'R',
    percent_delimits: true,
};

/// The meaning of a call that has no G word.
pub(crate) fn called(number: f64) -> GWord {
    match number {
        call::SET_AXES => GWord::SetAxes,
        call::ROUNDING_AXES => GWord::RoundingAxes,
        call::HOME => GWord::Home,
        _ => GWord::Unknown,
    }
}

fn g(tenths: u16) -> GWord {
    match tenths {
        0 => GWord::Motion(Mode::Rapid),
        10 => GWord::Motion(Mode::Feed),
        20 => GWord::Motion(Mode::Arc { clockwise: true }),
        30 => GWord::Motion(Mode::Arc { clockwise: false }),
        40 => GWord::Dwell,
        90 => GWord::ExactStop,
        170 => GWord::Plane(Plane::Xy),
        180 => GWord::Plane(Plane::Zx),
        190 => GWord::Plane(Plane::Yz),
        330 => GWord::RefusedMotion(THREAD),
        400 => GWord::CompensationOff,
        410 => GWord::CompensationOn { side: CutterSide::Left, is_dynamic: false },
        420 => GWord::CompensationOn { side: CutterSide::Right, is_dynamic: false },
        430 => GWord::SetRadius,
        440 => GWord::SetAxes,
        530 => GWord::MachineCoordinates,
        540 | 550 | 560 | 570 | 580 | 590 => GWord::WorkOffset((tenths / 10 - 53) as u8),
        610 | 640 => GWord::of_path(Letters::NONE),
        700 => GWord::Units(Units::Inch),
        710 => GWord::Units(Units::Millimetre),
        810..=899 => GWord::RefusedMotion(CYCLE),
        900 => GWord::Distance(Distance::Absolute),
        910 => GWord::Distance(Distance::Incremental),
        920 => GWord::Refused(OFFSETS),
        930 | 950 => GWord::Refused(FEED_MODE),
        940 => GWord::Accepted(Group::Feed),
        960 => GWord::Refused(CONSTANT_SPEED),
        970 => GWord::Accepted(Group::SpindleMode),
        _ => GWord::Unknown,
    }
}

fn m(number: u16) -> MWord {
    common_m(number)
}
