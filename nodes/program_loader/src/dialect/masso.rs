//! MASSO G3 and Touch: the words of RS-274, with P as a radius on G41 (M03, M08).

use super::rs274::{common, common_m};
use super::{ApproachWords, Dialect, GWord, Letters, MWord};
use crate::block::LexerRules;
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
        names: false,
    },
    g,
    m,
    plane: Plane::Xy,
    letters: Letters::of(b"XYZIJKRFSTHLPQ"),
    // M18 names Z, A and B.
    foreign_axes: Letters::of(b"ABCUVW"),
    auxiliary: Letters::NONE,
    approach: ApproachWords::None,
    dwell: Letters::of(b"P"),
    arc_radius_and_turns: true,
    arc_radius: b'R',
    percent_delimits: true,
};

fn g(tenths: u16) -> GWord {
    match tenths {
        // LinuxCNC has these; MASSO's page does not list them.
        80 | 611 => GWord::Unknown,
        _ => common(tenths),
    }
}

fn m(number: u16) -> MWord {
    common_m(number)
}
