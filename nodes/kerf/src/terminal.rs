//! Printing to whoever may have left: `kerf plan part.ngc | head` is no failure.
//!
//! These stand in for the macros of the standard library, which panic when
//! the other end of a pipe is closed.

macro_rules! print {
    ($($part:tt)*) => {{
        use std::io::Write;
        let _ = write!(std::io::stdout(), $($part)*);
    }};
}

macro_rules! println {
    ($($part:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stdout(), $($part)*);
    }};
}

macro_rules! eprint {
    ($($part:tt)*) => {{
        use std::io::Write;
        let _ = write!(std::io::stderr(), $($part)*);
    }};
}

macro_rules! eprintln {
    ($($part:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stderr(), $($part)*);
    }};
}
