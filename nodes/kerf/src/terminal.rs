//! Printing to a terminal, or to whoever may have left: `kerf plan part.ngc | head` is no
//! failure.
//!
//! These stand in for the macros of the standard library, which panic when
//! the other end of a pipe is closed. Names and messages of others are printed here, so
//! nothing that steers a terminal gets through.

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

/// Shows a text of several lines.
pub(crate) fn show(mut to: impl Write, text: &str) {
    // The other end may have left.
    let _ = to.write_all(intake::text::lines(text).as_bytes());
}

/// Shows findings on standard error; the renderer has made them safe and may color them.
pub(crate) fn show_findings(drawn: &str) {
    let _ = std::io::stderr().write_all(drawn.as_bytes());
}
