//! Keeps a panic of a decoder away from the lock of its topic.
//!
//! RustDDS calls the decoder of a sample while it holds the lock of the topic's cache. A panic
//! there poisons the lock, and any peer may send any bytes.
//! The report: docs/upstream/rustdds-decode-under-lock.md.

use crate::process::panic_guard::catch;
use std::fmt::Display;

/// The result of `decode`, with the reason as text; a panic is a reason too.
pub(crate) fn without_panic<T, E: Display>(
    decode: impl FnOnce() -> Result<T, E>,
) -> Result<T, String> {
    match catch(decode) {
        Ok(decoded) => decoded.map_err(|error| error.to_string()),
        Err(_) => Err("the decoder gave up".to_owned()),
    }
}
