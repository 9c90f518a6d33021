//! What travels with each sample: numbers attached to it, and the encoding before it.
//!
//! Pure. The attachment is what the serializer of zenoh-ext makes of the number of the sample, the
//! time at the sender in nanoseconds, and the sender's address of sixteen bytes.

use crate::samples::sample::{ByteOrder, Received};

/// Number, time, length of the address, address.
const BYTES: usize = 8 + 8 + 1 + 16;

/// Numbers attached to a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Attachment {
    /// Of a topic: from 1. Of a request and its reply: what the client counts.
    pub(crate) sequence: i64,
    /// Wall time at the sender, in nanoseconds.
    pub(crate) source_time: i64,
    /// Of the sender; of the client for a reply too.
    pub(crate) wire_gid: [u8; 16],
}

impl Attachment {
    pub(crate) fn bytes(self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(BYTES);
        bytes.extend(self.sequence.to_le_bytes());
        bytes.extend(self.source_time.to_le_bytes());
        bytes.push(16);
        bytes.extend(self.wire_gid);
        bytes
    }

    /// The numbers; none for an attachment of another kind.
    pub(crate) fn parse(bytes: &[u8]) -> Option<Self> {
        let (sequence, rest) = bytes.split_first_chunk()?;
        let (source_time, rest) = rest.split_first_chunk()?;
        let (length, gid) = rest.split_first()?;
        let wire_gid = gid.try_into().ok().filter(|_| *length == 16)?;
        let (sequence, source_time) =
            (i64::from_le_bytes(*sequence), i64::from_le_bytes(*source_time));
        (sequence >= 0).then_some(Self { sequence, source_time, wire_gid })
    }
}

/// The CDR of a message, little-endian, with the four bytes that say so before it.
pub(crate) fn encapsulated(body: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(body.len() + 4);
    bytes.extend([0, 1, 0, 0]);
    bytes.extend(body);
    bytes
}

/// What a payload holds.
///
/// # Errors
/// It is not CDR.
pub(crate) fn received(payload: &[u8]) -> Result<Received, String> {
    let order = match payload {
        [0, 0, _, _, ..] => ByteOrder::Big,
        [0, 1, _, _, ..] => ByteOrder::Little,
        [first, second, _, _, ..] => {
            return Err(format!("its encoding {first:#04x} {second:#04x} is not plain CDR"));
        }
        _ => return Err(format!("{} bytes are too few for a message", payload.len())),
    };
    Ok(Received { bytes: payload[4..].to_vec(), order })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_attachment_is_33_bytes_as_rmw_zenoh_writes_them() {
        let attachment =
            Attachment { sequence: 7, source_time: 0x0102_0304_0506_0708, wire_gid: [0xab; 16] };
        let bytes = attachment.bytes();
        let mut expected = vec![7, 0, 0, 0, 0, 0, 0, 0, 8, 7, 6, 5, 4, 3, 2, 1, 16];
        expected.extend([0xab; 16]);
        assert_eq!(bytes, expected);
        assert_eq!(Attachment::parse(&bytes), Some(attachment));
        for length in 0..bytes.len() {
            assert_eq!(Attachment::parse(&bytes[..length]), None, "{length}");
        }
        let mut other = bytes.clone();
        other[16] = 15;
        assert_eq!(Attachment::parse(&other), None);
        other[16] = 16;
        other[7] = 0x80;
        assert_eq!(Attachment::parse(&other), None, "a negative number");
        other[7] = 0;
        other.push(0);
        assert_eq!(Attachment::parse(&other), None, "a byte too many");
    }

    #[test]
    fn a_payload_names_its_byte_order() {
        let of = |payload: &[u8]| received(payload).map(|it| (it.bytes, it.order));
        assert_eq!(of(&encapsulated(&[7, 8])), Ok((vec![7, 8], ByteOrder::Little)));
        assert_eq!(of(&[0, 0, 0, 0, 7]), Ok((vec![7], ByteOrder::Big)));
        assert_eq!(of(&[0, 1, 0, 3]), Ok((vec![], ByteOrder::Little)));
        // The second version of XCDR, and text.
        for payload in [&[0, 7, 0, 0, 1][..], b"{\"data\": 1}"] {
            assert!(of(payload).expect_err("no CDR").contains("not plain CDR"));
        }
        for payload in [&[][..], &[0, 1, 0]] {
            assert!(of(payload).expect_err("too short").contains("too few"));
        }
    }
}
