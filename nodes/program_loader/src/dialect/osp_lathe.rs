//! Okuma OSP for turning.

use super::rs274::{common, common_m};
use super::{Dialect, GWord, Letters, MWord, RadiusWord};
use crate::block::LexerRules;

pub(super) static DIALECT: Dialect = Dialect {
    lexer: LexerRules {
        blanks_in_numbers: true,
        written_line_feed: false,
        at_words: false,
        delete_levels: false,
        calls: false,
    },
    g,
    m,
    letters: Letters::of(b"XYZIJKRFSTDHLPQ"),
    // M18 names Z, A and B.
    foreign_axes: Letters::of(b"ABCUVW"),
    auxiliary: Letters::NONE,
    radius_word: RadiusWord::Tool,
    approach_direction: true,
    dwell: Letters::of(b"P"),
    arc_radius_and_turns: true,
    percent_delimits: true,
};

fn g(tenths: u16) -> GWord {
    match tenths {
        // Fine points of LinuxCNC that MASSO's page does not name.
        80 | 611 => GWord::Unknown,
        _ => common(tenths),
    }
}

fn m(number: u16) -> MWord {
    common_m(number)
}
