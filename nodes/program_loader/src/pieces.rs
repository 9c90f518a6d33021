//! The text of a long program, which comes in pieces and is not kept.
//!
//! A program of plain lines needs no line twice. What reads its text in another order, or looks at its end first, wants
//! it whole: loops, subroutines, program numbers, and what Kerf appends.

use crate::block::LexerRules;
use crate::findings::Findings;
use crate::flow::FlowMap;
use crate::interpreter::Interpreter;
use crate::limits::APPENDED_BY;
use crate::reader::{Parts, Reader};
use crate::subroutines::calls_programs;
use crate::{BYTE_ORDER_MARK, LoadOptions, Loaded, is_utf_16, loaded, rules_of, without_filler};
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::profile::Profile;
use std::ops::RangeInclusive;

/// A text in pieces.
pub trait Pieces {
    /// The next piece; `None` after the last one.
    fn next(&mut self) -> Option<Piece<'_>>;
}

/// Whole lines of a text.
#[derive(Debug, Clone, Copy)]
pub struct Piece<'t> {
    pub text: &'t [u8],
    /// Bytes of the text after it; 0 in the last one.
    pub left: u64,
}

/// A text in one piece.
pub(crate) struct Whole<'t>(Option<&'t [u8]>);

impl<'t> Whole<'t> {
    pub(crate) fn of(text: &'t [u8]) -> Self {
        Self(Some(text))
    }
}

impl Pieces for Whole<'_> {
    fn next(&mut self) -> Option<Piece<'_>> {
        self.0.take().map(|text| Piece { text, left: 0 })
    }
}

/// [`load_in_parts`](crate::load_in_parts) for a text of any length that comes in pieces. `None`: it is to be read whole.
///
/// The limits on bytes, lines and events of a program protect those who keep it, and do not count here. `part_events` are
/// the least events of a part, and the most that may come without a place where nothing is compensated.
pub fn load_pieces(
    pieces: &mut dyn Pieces,
    profile: &Profile,
    options: &LoadOptions,
    part_events: RangeInclusive<usize>,
    take: &mut dyn FnMut(&mut ProgrammedContour),
) -> Option<Loaded> {
    let (rules, findings) = rules_of(profile);
    let lexer = &rules.dialect.lexer;
    let mut plain =
        Plain { pieces, rules: lexer, lines: 0, is_open: false, is_first: true, is_plain: true };
    let (least, most) = part_events.into_inner();
    let mut interpreter = Interpreter::new(&rules, options.start, 2 * least);
    interpreter.hold_at_most(most);
    interpreter.take_results(Default::default(), options.probes_touch_at);
    let reader = Reader::new(&[], &rules, options, interpreter, None, findings);
    let parts = Parts { least, most, take };
    let read = reader.read(&mut plain, parts);
    // It may have ended before.
    while plain.next().is_some() {}
    let line_count = u32::try_from(plain.lines + u64::from(plain.is_open)).unwrap_or(u32::MAX);
    plain.is_plain.then(|| loaded(read, options, line_count, lexer.parameters.then_some(None)))
}

/// Pieces as long as they are plain lines.
struct Plain<'p> {
    pieces: &'p mut dyn Pieces,
    rules: &'p LexerRules,
    /// Line feeds so far.
    lines: u64,
    /// The last line has none.
    is_open: bool,
    is_first: bool,
    is_plain: bool,
}

impl Pieces for Plain<'_> {
    fn next(&mut self) -> Option<Piece<'_>> {
        if !self.is_plain {
            return None;
        }
        let Piece { mut text, left } = self.pieces.next()?;
        let is_first = std::mem::take(&mut self.is_first);
        if is_first {
            text = text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text);
        }
        if left == 0 {
            let is_filler = !is_first && text.iter().all(|byte| *byte == 0);
            text = if is_filler { &[] } else { without_filler(text) };
        }
        self.lines += memchr::memchr_iter(b'\n', text).count() as u64;
        self.is_open = text.last().map_or(self.is_open, |&last| last != b'\n');
        self.is_plain = self.lines < u64::from(u32::MAX)
            && !(is_first && is_utf_16(text))
            && is_plain(text, self.rules, is_first);
        self.is_plain.then_some(Piece { text, left })
    }
}

/// Whether no line of a piece needs the others.
fn is_plain(text: &[u8], rules: &LexerRules, is_first: bool) -> bool {
    let mut findings = Findings::default();
    let has_flow = match (rules.programs, rules.parameters) {
        // The number of the main program may stand before all.
        (Some(programs), _) if is_first => {
            !FlowMap::of_programs(text, programs, &mut findings).entries.is_empty()
        }
        (Some(programs), _) => FlowMap::has_program(text, programs),
        (None, true) => !FlowMap::of(text, false, &mut findings).entries.is_empty(),
        (None, false) => false,
    };
    !has_flow
        && findings.count() == 0
        && !calls_programs(text, rules)
        && memchr::memmem::find(text, APPENDED_BY.as_bytes()).is_none()
}
