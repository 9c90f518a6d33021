//! The panic guard, and the immediate exit of a process that cannot continue.
//!
//! A node that is deaf or takes too much memory exits at once: an orderly end would need the DDS
//! layer. Its supervisor restarts it. Nothing here blocks, not even a full console.

use crate::process::console::{log_line, write_within};
use crate::process::supervision::PANICKED;
use crate::process::time::RosTime;
use rustix::event::Timespec;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};

/// How long to wait for a console that is full.
const CONSOLE_WITHIN: Timespec = Timespec { tv_sec: 0, tv_nsec: 200_000_000 };

thread_local! {
    /// A panic on this thread is expected and caught.
    static IS_CAUGHT: Cell<bool> = const { Cell::new(false) };
}

/// Exits with one line on the console.
pub(crate) fn exit_now(status: u8, logger: &str, text: &str) -> ! {
    log_fatal(logger, text);
    std::process::exit(i32::from(status))
}

/// Writes one FATAL line directly to the console, without the log; skips it if the console
/// is full.
pub(crate) fn log_fatal(logger: &str, text: &str) {
    write_within(&log_line("FATAL", RosTime::wall(), logger, text), &CONSOLE_WITHIN);
}

/// Catches the panics of `work`; they end neither the process nor the thread.
///
/// # Errors
/// It panicked; with the panic's payload.
pub fn catch<R>(work: impl FnOnce() -> R) -> std::thread::Result<R> {
    let before = IS_CAUGHT.replace(true);
    let outcome = catch_unwind(AssertUnwindSafe(work));
    IS_CAUGHT.set(before);
    outcome
}

/// From now on a panic of any thread ends the process; the console gets its source line.
pub(crate) fn end_on_panic(logger: &str) {
    let logger = logger.to_owned();
    std::panic::set_hook(Box::new(move |panic| {
        if !IS_CAUGHT.get() {
            exit_now(PANICKED, &logger, &panicked(panic));
        }
    }));
}

/// From now on a panic of any thread ends this command.
pub fn end_command_on_panic() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !IS_CAUGHT.get() {
            usual(panic);
            std::process::exit(i32::from(PANICKED));
        }
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
