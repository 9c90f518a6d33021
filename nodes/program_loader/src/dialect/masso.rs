//! MASSO G3 and Touch: the words of RS-274, with P as a radius on G41 (M03, M08).

use super::rs274::{common, common_m};
use super::{ApproachWords, Dialect, GWord, Letters, MWord};
use crate::block::{LexerRules, Programs};
use cnc_msgs::geometry::Plane;

pub(super) static DIALECT: Dialect = Dialect {
    lexer: LexerRules {
        blanks_in_numbers: true,
        written_line_feed: false,
        at_words: false,
        delete_levels: false,
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
    letters: Letters::of(b"XYZIJKRFSTHLPQ"),
    further_axes: Letters::NONE,
    // M18 names Z, A and B.
    foreign_axes: Letters::of(b"ABCUVW"),
    auxiliary: Letters::NONE,
    approach: ApproachWords::None,
    dwell: Letters::of(b"P"),
    arc_radius_and_turns: true,
    arc_radius: b'R',
    percent_delimits: true,
};

/// M98 P10 L2 runs the file 10.nc twice, M99 returns; five levels (page "M98 & M99 - sub program
/// call").
static PROGRAMS: Programs =
    Programs { begins: &[], letter: 'P', call: None, end: "M99", ending: "nc", depth_max: 5 };

fn g(tenths: u16) -> GWord {
    match tenths {
        // LinuxCNC has these; MASSO's page does not list them.
        80 | 611 => GWord::Unknown,
        _ => common(tenths),
    }
}

fn m(number: u16) -> MWord {
    match number {
        98 => MWord::CallProgram,
        99 => MWord::EndProgram,
        _ => common_m(number),
    }
}
