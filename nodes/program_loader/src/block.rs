//! The words of one line, before a dialect gives them a meaning.

use crate::expression::Parameter;
use crate::lexer::remark::Remark;

/// How a dialect writes its blocks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LexerRules {
    /// Blanks inside a number are skipped: `X1 000` is X1000.
    pub(crate) blanks_in_numbers: bool,
    /// `LF` written out ends the block.
    pub(crate) written_line_feed: bool,
    /// `@714` is a word.
    pub(crate) at_words: bool,
    /// `/2` deletes by level.
    pub(crate) delete_levels: bool,
    /// `MoveLinear([X], [1])` is a call, `//` and `/* */` are comments, and `( )` is not a comment.
    pub(crate) calls: bool,
    /// The G number whose axes are named without a number: `G44 X Y`.
    pub(crate) axis_names_after: Option<f64>,
    /// `#1=5`, `X[#1+2]`, O words and program numbers.
    pub(crate) parameters: bool,
    /// `R1=5`, `X=R1`.
    pub(crate) r_parameters: bool,
    /// `$PART.MIN%` begins the file, `OPART` names the program, `NLAP1` names a block.
    pub(crate) names: bool,
    /// Programs that others call by their number, in a language without O words.
    pub(crate) programs: Option<&'static Programs>,
}

/// How a language writes programs that others call by their number.
#[derive(Debug)]
pub(crate) struct Programs {
    /// What may stand before the number where a program begins in the text: `O`, `%SPF`. Without any,
    /// each program is a file.
    pub(crate) begins: &'static [&'static str],
    /// What is called, before its number, as messages show it.
    pub(crate) letter: char,
    /// A word that calls the program of its number, and the one that says how many times; without
    /// them M98 calls, with P and L.
    pub(crate) call: Option<(u8, u8)>,
    /// The M word that returns.
    pub(crate) end: &'static str,
    /// The ending of the name of a file that has one program.
    pub(crate) ending: &'static str,
    /// Programs inside each other.
    pub(crate) depth_max: usize,
}

impl Programs {
    /// What is wrong with a call of a program that is not there, and what to do.
    pub(crate) fn missing(&self, number: u32) -> (String, String) {
        let Self { letter, end, ending, .. } = self;
        let file = format!("{number}.{ending} into a folder of subroutines");
        let help = match self.begins.last() {
            Some(begins) => format!(
                "write {begins}{number} ... {end} after the end of the main program, or put {file}"
            ),
            None => format!("put {file}"),
        };
        (format!("there is no program {letter}{number}"), help)
    }
}

/// One word.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Word {
    /// NaN when the number could not be read; that has been reported then.
    pub(crate) value: f64,
    /// Its first byte in the line, and the first byte after it.
    pub(crate) start: u16,
    pub(crate) end: u16,
    /// A capital letter, or `@`.
    pub(crate) letter: u8,
}

/// A parameter that a block sets.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Assignment {
    pub(crate) parameter: Parameter<'static>,
    /// NaN when its value could not be read; that has been reported then.
    pub(crate) value: f64,
    /// Its first byte in the line, and the first byte after it.
    pub(crate) start: usize,
    pub(crate) end: usize,
}

/// The words of one line.
#[derive(Debug, Default)]
pub(crate) struct Block {
    pub(crate) words: Vec<Word>,
    /// What it sets, once all its words have their values.
    pub(crate) assignments: Vec<Assignment>,
    /// Comments that do something.
    pub(crate) remark: Option<Remark>,
    /// N.
    pub(crate) number: Option<u32>,
    /// From the first word to the last, in bytes of the line.
    pub(crate) start: usize,
    pub(crate) end: usize,
    /// Whether the block begins with `/`.
    pub(crate) is_optional: bool,
    /// Whether the line has a comment before its last word, or anything else that is not a word.
    pub(crate) has_remark: bool,
    /// Whether a word or character of the block was rejected.
    pub(crate) is_damaged: bool,
    /// Whether words after a rejected one were not read.
    pub(crate) is_cut: bool,
    /// Whether nothing after the line can be read: it has a byte that text cannot have, or is of another language.
    pub(crate) ends_reading: bool,
}
