//! The sudden end of a process that cannot go on as it should.
//!
//! A node that is deaf or too large ends at once: what an orderly end would ask of the DDS layer
//! is no longer there. Its supervisor starts it again. Nothing here waits for anybody, not even
//! for a console that nobody reads. A panic of the DDS layer that one packet causes is reported in
//! docs/upstream/rustdds-nack-frag.md.

use crate::console::write_within;
use crate::logging::line;
use crate::supervision::PANICKED;
use crate::time::RosTime;
use rustix::event::Timespec;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};

/// How long a console that is full may take.
const CONSOLE_WITHIN: Timespec = Timespec { tv_sec: 0, tv_nsec: 200_000_000 };

thread_local! {
    /// A panic on this thread is caught on purpose.
    static IS_CAUGHT: Cell<bool> = const { Cell::new(false) };
}

/// Ends the process with one line on the console.
pub(crate) fn end(status: u8, logger: &str, text: &str) -> ! {
    say(logger, text);
    std::process::exit(i32::from(status))
}

/// Writes one line of level FATAL past the log, unless the console is full.
pub(crate) fn say(logger: &str, text: &str) {
    write_within(&line("FATAL", RosTime::wall(), logger, text), &CONSOLE_WITHIN);
}

/// Runs something whose panics are expected; they end neither the process nor the thread.
///
/// # Errors
/// It panicked; this is what with.
pub fn catch<R>(work: impl FnOnce() -> R) -> std::thread::Result<R> {
    let before = IS_CAUGHT.replace(true);
    let outcome = catch_unwind(AssertUnwindSafe(work));
    IS_CAUGHT.set(before);
    outcome
}

/// From now on a panic of any thread ends the process, with its place on the console.
pub(crate) fn end_on_panic(logger: &str) {
    let logger = logger.to_owned();
    std::panic::set_hook(Box::new(move |panic| {
        if !IS_CAUGHT.get() {
            end(PANICKED, &logger, &panicked(panic));
        }
    }));
}

/// From now on a panic of any thread ends this command, except in the DDS layer: a command starts
/// that again.
pub fn end_command_on_panic() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let thread = std::thread::current();
        let is_dds = thread.name().is_some_and(|name| name.starts_with("RustDDS"));
        if IS_CAUGHT.get() || is_dds {
            return;
        }
        usual(panic);
        std::process::exit(i32::from(PANICKED));
    }));
}

fn panicked(panic: &PanicHookInfo<'_>) -> String {
    let thread = std::thread::current();
    let name = thread.name().unwrap_or("unnamed");
    format!("thread \"{name}\" {panic}; the process ends with status {PANICKED}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_that_is_expected_is_a_result() {
        assert!(catch(|| panic!("as expected")).is_err());
        assert_eq!(catch(|| 7).expect("no panic"), 7);
        assert!(!IS_CAUGHT.get());
    }
}
