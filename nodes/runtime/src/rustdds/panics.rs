//! Lets a command survive a panic of the DDS layer.
//!
//! One packet of a peer can make a thread of RustDDS panic. A node exits then, as after any
//! panic, and is restarted. A command restarts its DDS layer itself.
//! The report: docs/upstream/rustdds-nack-frag.md.

use crate::process::panic_guard::is_caught;
use crate::process::supervision::PANICKED;

/// From now on a panic of any thread ends this command, except in the DDS layer, which a
/// command restarts.
pub fn end_command_on_panic() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let thread = std::thread::current();
        let is_dds = thread.name().is_some_and(|name| name.starts_with("RustDDS"));
        if is_caught() || is_dds {
            return;
        }
        usual(panic);
        std::process::exit(i32::from(PANICKED));
    }));
}
