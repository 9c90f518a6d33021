//! NCT: D registers, D00 as well as G40, G39, and an approach direction on G41.
//!
//! H is a length offset, `%` begins a program name. M functions without a meaning here are passed
//! on to the machine. G38 keeps an offset vector that depends on the move before it; it is
//! rejected by name.

use super::rs274::{CONSTANT_SPEED, CYCLE, FEED_MODE, OFFSETS, THREAD, common_m};
use super::{
    ApproachWords, Dialect, Distance, GWord, Group, LengthWord, Letters, MWord, Mode, Units,
};
use crate::block::{LexerRules, Programs};
use crate::no_effect;
use cnc_msgs::contour::CutterSide;
use cnc_msgs::geometry::Plane;

pub(super) static DIALECT: Dialect = Dialect {
    lexer: LexerRules {
        blanks_in_numbers: false,
        written_line_feed: false,
        at_words: false,
        delete_levels: true,
        calls: false,
        axis_names_after: None,
        parameters: false,
        r_parameters: false,
        names: false,
        programs: Some(&PROGRAMS),
    },
    g,
    m,
    plane: Plane::Xy,
    letters: Letters::of(b"XYZIJKRFSTDHLPQ"),
    further_axes: Letters::NONE,
    foreign_axes: Letters::of(b"ABCUVW"),
    auxiliary: Letters::NONE,
    approach: ApproachWords::Direction,
    dwell: Letters::of(b"P"),
    arc_radius_and_turns: true,
    arc_radius: b'R',
    percent_delimits: false,
};

/// `%O100` or `O100` begins a program, M98 P100 L2 calls it, M99 returns.
static PROGRAMS: Programs = Programs {
    begins: &["%O", "O"],
    letter: 'O',
    call: None,
    end: "M99",
    ending: "nct",
    depth_max: usize::MAX,
};

const SCALE: &str = "post the program in its final size and position";

fn g(tenths: u16) -> GWord {
    match tenths {
        0 => GWord::Motion(Mode::Rapid),
        10 => GWord::Motion(Mode::Feed),
        20 => GWord::Motion(Mode::Arc { clockwise: true }),
        30 => GWord::Motion(Mode::Arc { clockwise: false }),
        40 => GWord::Dwell,
        90 => GWord::ExactStop,
        100 | 520 | 920 => GWord::Refused(OFFSETS),
        170 => GWord::Plane(Plane::Xy),
        180 => GWord::Plane(Plane::Zx),
        190 => GWord::Plane(Plane::Yz),
        200 => GWord::Units(Units::Inch),
        210 => GWord::Units(Units::Millimetre),
        280 => GWord::Reference { second: false },
        300 => GWord::Reference { second: true },
        310 | 320 | 370 => {
            GWord::RefusedMotion("probe with the probe action, outside part programs")
        }
        330 => GWord::RefusedMotion(THREAD),
        380 => GWord::Refused(
            "end the contour with G40 and begin the next with G41 instead of keeping the vector",
        ),
        390 => GWord::CornerArc,
        400 => GWord::CompensationOff,
        410 => GWord::CompensationOn { side: CutterSide::Left, is_dynamic: false },
        420 => GWord::CompensationOn { side: CutterSide::Right, is_dynamic: false },
        430 => GWord::Length(LengthWord::Offset),
        440 => GWord::Refused("enter the length with its sign and use G43"),
        490 => GWord::LengthOff,
        500 | 510 | 680 | 690 => GWord::Refused(SCALE),
        530 => GWord::MachineCoordinates,
        540 | 550 | 560 | 570 | 580 | 590 => GWord::WorkOffset((tenths / 10 - 53) as u8),
        610 | 620 | 630 | 640 => GWord::of_path(Letters::NONE),
        650..=670 => GWord::Refused("write macros out where they are called"),
        730 | 740 | 760 | 810..=899 => GWord::RefusedMotion(CYCLE),
        800 => GWord::NoMotion,
        900 => GWord::Distance(Distance::Absolute),
        910 => GWord::Distance(Distance::Incremental),
        930 | 950 => GWord::Refused(FEED_MODE),
        940 => GWord::Accepted(Group::Feed),
        960 => GWord::Refused(CONSTANT_SPEED),
        970 => GWord::Accepted(Group::SpindleMode),
        980 | 990 => GWord::NoEffect(Group::Retract, Letters::NONE, no_effect::RETRACT),
        _ => GWord::Unknown,
    }
}

fn m(number: u16) -> MWord {
    match number {
        98 => MWord::CallProgram,
        99 => MWord::EndProgram,
        0..=9 | 30 => common_m(number),
        10..=97 => MWord::Auxiliary { after_motion: false },
        _ => MWord::Unknown,
    }
}
