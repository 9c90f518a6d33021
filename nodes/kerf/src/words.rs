//! Numbers of the command line, with messages that say what to write.

/// A percentage within limits.
pub(crate) fn percent<const MIN: u8, const MAX: u8>(text: &str) -> Result<u8, String> {
    let percent = text.parse().ok().filter(|percent| (MIN..=MAX).contains(percent));
    percent.ok_or_else(|| format!("write a percentage from {MIN} to {MAX}"))
}

/// A number that counts from 1.
pub(crate) fn from_one(text: &str) -> Result<u32, String> {
    let number = text.parse().ok().filter(|number| *number > 0);
    number.ok_or_else(|| "write a whole number from 1".to_owned())
}
