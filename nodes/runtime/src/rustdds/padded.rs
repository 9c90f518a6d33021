//! Pads each payload to a multiple of four bytes.
//!
//! RTPS requires it, and RustDDS does it for a message in one piece. It does not pad the last
//! fragment of a long message, which then ends at a length that RTPS does not allow. So we pad
//! every payload before RustDDS gets it.
//! The report: docs/upstream/rustdds-fragment-padding.md.

use crate::samples::check_length;
use serde::ser::SerializeTuple;
use serde::{Serialize, Serializer};

/// The padding after so many bytes, to a multiple of four.
fn padding(bytes: usize) -> usize {
    bytes.wrapping_neg() % 4
}

/// A payload that can be sent: little-endian CDR, not too long, and padded to a multiple of four.
/// One type for the messages of all topics and services.
#[derive(Debug)]
pub(crate) struct Padded {
    bytes: Vec<u8>,
}

impl Padded {
    /// The payload of a header, which may be empty, and a body.
    pub(crate) fn new(header: &[u8], body: &[u8]) -> Result<Self, String> {
        let len = header.len() + body.len();
        check_length(len)?;
        let mut bytes = Vec::with_capacity(len + padding(len));
        bytes.extend_from_slice(header);
        bytes.extend_from_slice(body);
        bytes.resize(len + padding(len), 0);
        Ok(Self { bytes })
    }

    /// Bytes that it takes.
    pub(crate) fn len(&self) -> usize {
        self.bytes.len()
    }
}

impl Serialize for Padded {
    /// The bytes as they are, for the little-endian CDR serializer of RustDDS. In words, which
    /// it takes faster than bytes.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (words, rest) = self.bytes.as_chunks::<8>();
        let mut tuple = serializer.serialize_tuple(words.len() + rest.len())?;
        for word in words {
            tuple.serialize_element(&u64::from_le_bytes(*word))?;
        }
        for byte in rest {
            tuple.serialize_element(byte)?;
        }
        tuple.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::cdr;
    use rustdds::RepresentationIdentifier;
    use rustdds::serialization::to_writer_with_rep_id;

    fn sent(payload: &Padded) -> Vec<u8> {
        let mut bytes = Vec::new();
        to_writer_with_rep_id(&mut bytes, payload, RepresentationIdentifier::CDR_LE)
            .expect("serializable");
        bytes
    }

    #[test]
    fn what_is_sent_is_a_multiple_of_four() {
        for length in 0..40 {
            let body = cdr::body(&"x".repeat(length));
            let payload = Padded::new(&[7; 16], &body).expect("it is short");
            let bytes = sent(&payload);
            assert_eq!(bytes.len() % 4, 0, "{length}");
            assert!(bytes.starts_with(&[7; 16]) && bytes[16..].starts_with(&body), "{length}");
            assert!(bytes.len() < 16 + body.len() + 4, "{length}");
        }
    }
}
