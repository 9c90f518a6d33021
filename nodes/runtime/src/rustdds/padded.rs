//! Pads each payload to a multiple of four bytes.
//!
//! RTPS requires it, and RustDDS does it for a message in one piece. It does not pad the last
//! fragment of a long message, which then ends at a length that RTPS does not allow. So we pad
//! every payload before RustDDS gets it.
//! The report: docs/upstream/rustdds-fragment-padding.md.

use cnc_msgs::cdr;
use serde::ser::SerializeTuple;
use serde::{Serialize, Serializer};

/// The longest message, bytes: it fits a datagram. Other DDS implementations lose
/// longer ones. No request of a peer may make a node send one.
pub(crate) const BYTES_MAX: usize = 64_000;

/// The padding after so many bytes, to a multiple of four.
pub(crate) fn padding(bytes: usize) -> usize {
    bytes.wrapping_neg() % 4
}

/// A payload that can be sent: not too long, and padded to a multiple of four.
#[derive(Debug)]
pub(crate) struct Padded<T> {
    pub(crate) body: T,
    bytes: usize,
    padding: usize,
}

impl<T: Serialize> Padded<T> {
    pub(crate) fn new(body: T) -> Result<Self, String> {
        match cdr::body(&body).len() {
            bytes if bytes > BYTES_MAX => {
                Err(format!("a message of {bytes} bytes; at most {BYTES_MAX} can be sent"))
            }
            bytes => Ok(Self { body, bytes, padding: padding(bytes) }),
        }
    }
}

impl<T> Padded<T> {
    /// Its length without padding.
    pub(crate) fn bytes(&self) -> usize {
        self.bytes
    }
}

impl<T: Serialize> Serialize for Padded<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(1 + self.padding)?;
        tuple.serialize_element(&self.body)?;
        for _ in 0..self.padding {
            tuple.serialize_element(&0_u8)?;
        }
        tuple.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustdds::RepresentationIdentifier;
    use rustdds::serialization::to_writer_with_rep_id;

    fn encode<T: Serialize>(value: &T) -> Vec<u8> {
        let mut bytes = Vec::new();
        to_writer_with_rep_id(&mut bytes, value, RepresentationIdentifier::CDR_LE)
            .expect("serializable");
        bytes
    }

    #[test]
    fn what_is_sent_is_a_multiple_of_four_and_no_longer_than_a_datagram() {
        for length in 0..9 {
            let text = "x".repeat(length);
            let bytes = encode(&Padded::new(text.clone()).expect("it is short"));
            assert_eq!(bytes.len() % 4, 0, "{length}");
            assert!(bytes.starts_with(&cdr::body(&text)), "{length}");
            assert!(bytes.len() < cdr::body(&text).len() + 4, "{length}");
        }
        assert!(Padded::new("x".repeat(60_000)).is_ok());
        let error = Padded::new("x".repeat(64_000)).expect_err("with its length it is longer");
        assert!(error.contains("64005 bytes") && error.contains("64000"), "{error}");
    }
}
