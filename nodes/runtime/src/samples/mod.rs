//! What travels, whatever carries it: samples, addresses of endpoints, qualities of service.
//!
//! Pure; uses `process`. Belongs here: what every middleware has. Does not belong here: how one of
//! them says it (`rustdds`, `zenoh`), and how endpoints are made (`endpoints`).

pub(crate) mod gid;
pub(crate) mod qos;
pub(crate) mod sample;
pub(crate) mod type_names;

/// The longest message that is sent, bytes. Every middleware splits what is longer than a packet.
const BYTES_MAX: usize = 16 << 20;

/// Refuses to send a message of so many bytes.
///
/// # Errors
/// It is too long.
pub(crate) fn check_length(bytes: usize) -> Result<(), String> {
    match bytes <= BYTES_MAX {
        true => Ok(()),
        false => Err(format!("a message of {bytes} bytes; at most {BYTES_MAX} can be sent")),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_message_has_a_longest_length() {
        assert!(super::check_length(16_777_216).is_ok());
        let error = super::check_length(16_777_217).expect_err("one byte too many");
        assert_eq!(error, "a message of 16777217 bytes; at most 16777216 can be sent");
    }
}
