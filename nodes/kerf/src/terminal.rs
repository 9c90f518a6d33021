//! Prints to a terminal or a pipe: in `kerf plan part.ngc | head` the reader may exit early, which
//! is not a failure.
//!
//! These macros replace those of the standard library, which panic when the other end of a pipe is
//! closed. Names and messages from outside are printed here, so control characters are escaped.

use std::io::Write;

macro_rules! print {
    ($($part:tt)*) => { $crate::terminal::show(std::io::stdout(), &format!($($part)*)) };
}

macro_rules! println {
    ($($part:tt)*) => { print!("{}\n", format_args!($($part)*)) };
}

macro_rules! eprint {
    ($($part:tt)*) => { $crate::terminal::show(std::io::stderr(), &format!($($part)*)) };
}

macro_rules! eprintln {
    ($($part:tt)*) => { eprint!("{}\n", format_args!($($part)*)) };
}

/// Prints a text of several lines.
pub(crate) fn show(mut to: impl Write, text: &str) {
    // The reader may have exited.
    let _ = to.write_all(intake::text::lines(text).as_bytes());
}

/// Prints findings on standard error; the renderer has escaped them and may color them.
pub(crate) fn show_findings(drawn: &str) {
    let _ = std::io::stderr().write_all(drawn.as_bytes());
}
