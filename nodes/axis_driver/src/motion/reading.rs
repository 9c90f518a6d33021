//! Reading what came from another process, so that a panic in it does not end the line.
//!
//! What is read here is bytes that others chose, in code of this project and of libraries. A
//! defect in it costs the message, and is logged; the machine goes on being served.

use std::any::Any;

/// Reads something; a panic in it is logged and comes back as the text of a refusal.
pub(super) fn read<R>(what: &str, work: impl FnOnce() -> R) -> Result<R, String> {
    runtime::catch(work).map_err(|panic| {
        let text = format!("{what} cannot be read, because of a defect in Kerf: {}", said(&*panic));
        tracing::error!("{text}; the serial line stays connected");
        text
    })
}

/// What a panic said.
fn said(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("a panic")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_while_reading_is_a_refusal_that_says_so() {
        assert_eq!(read("a command", || 7), Ok(7));
        let wanted = "a command cannot be read, because of a defect in Kerf: index 9";
        assert_eq!(read("a command", || panic!("index {}", 9)), Err::<(), _>(wanted.into()));
    }
}
