//! How names and payloads look on DDS.
//!
//! Knows the mangling of ROS names and types, the header that Cyclone puts
//! before requests and replies, and how foreign bytes become a value without
//! ever panicking. Leaves sending and receiving to the endpoints.
//!
//! The endpoints move bytes: messages are encoded before them and decoded after
//! them, so that the code of a DDS reader and writer is compiled once, and not
//! for each message. DDS matches endpoints by topic name, so any bytes may
//! arrive. A sample that does not fit its type, with bytes missing or more than
//! padding left over, becomes an `Err` with the reason.

use crate::rustdds::padded::Padded;
use crate::samples::gid::Gid;
use crate::samples::sample::{ByteOrder, Received};
use crate::samples::type_names::dds_type;
use cnc_msgs::cdr::{Cdr, Reader};

impl From<rustdds::GUID> for Gid {
    fn from(guid: rustdds::GUID) -> Self {
        Self(guid.to_bytes())
    }
}

impl From<ros2_client::Gid> for Gid {
    fn from(gid: ros2_client::Gid) -> Self {
        Self(gid.to_bytes16())
    }
}

/// The DDS topics of a service with the absolute name `name`: request, reply.
pub(crate) fn service_topics(name: &str) -> (String, String) {
    (format!("rq{name}Request"), format!("rr{name}Reply"))
}

/// The DDS types of a service: request, reply.
pub(crate) fn service_types(type_name: &str) -> (String, String) {
    (dds_type(type_name, "_Request"), dds_type(type_name, "_Response"))
}

/// What Cyclone puts before a request and its reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct CycloneHeader {
    /// The second half of the client's GUID.
    client: [u8; 8],
    sequence: i64,
}

impl CycloneHeader {
    /// Its bytes on the wire. A multiple of eight, so that it does not move the alignment of
    /// what follows.
    const BYTES: usize = 16;

    pub(crate) fn new(client: Gid, sequence: i64) -> Self {
        let mut half = [0; 8];
        half.copy_from_slice(&client.0[8..]);
        Self { client: half, sequence }
    }

    pub(crate) fn sequence(self) -> i64 {
        self.sequence
    }

    /// The client's GUID, of which the first half is that of `writer`.
    pub(crate) fn client(self, writer: Gid) -> Gid {
        let mut bytes = writer.0;
        bytes[8..].copy_from_slice(&self.client);
        Gid(bytes)
    }

    fn bytes(self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        bytes[..8].copy_from_slice(&self.client);
        bytes[8..].copy_from_slice(&self.sequence.to_le_bytes());
        bytes
    }
}

/// The payload of a message; `body` is its CDR, `header` what the service mapping puts before it.
///
/// # Errors
/// It is longer than a message may be.
pub(crate) fn padded(header: Option<CycloneHeader>, body: &[u8]) -> Result<Padded, String> {
    match header {
        None => Padded::new(&[], body),
        Some(header) => Padded::new(&header.bytes(), body),
    }
}

/// A message with the header that its mapping asks for.
#[derive(Debug)]
pub(crate) struct Framed<T> {
    pub(crate) header: Option<CycloneHeader>,
    pub(crate) body: T,
}

impl Received {
    /// The message, or why the bytes are not one; never panics.
    pub(crate) fn decode<T: Cdr>(&self, has_header: bool) -> Result<Framed<T>, String> {
        let header = self.header(has_header);
        let body = match has_header {
            true => self.bytes.get(CycloneHeader::BYTES..).ok_or("the message is cut short")?,
            false => &self.bytes,
        };
        let mut from = Reader::new(body, self.order == ByteOrder::Big);
        let value = T::read(&mut from).map_err(|broken| broken.to_string())?;
        // Up to three bytes are padding; four more are another type's fields.
        match from.left() {
            0..4 => Ok(Framed { header, body: value }),
            _ => Err("bytes are left over".to_owned()),
        }
    }

    /// The header before the message; `None` also when the bytes are too few for one.
    pub(crate) fn header(&self, has_header: bool) -> Option<CycloneHeader> {
        let (client, rest) = self.bytes.split_first_chunk().filter(|_| has_header)?;
        let sequence = match self.order {
            ByteOrder::Little => i64::from_le_bytes(*rest.first_chunk()?),
            ByteOrder::Big => i64::from_be_bytes(*rest.first_chunk()?),
        };
        Some(CycloneHeader { client: *client, sequence })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rustdds::received::AsReceived;
    use byteorder::BigEndian;
    use cnc_msgs::{cdr, cdr_struct};
    use rustdds::RepresentationIdentifier;
    use rustdds::serialization::{
        deserialize_from_cdr_with_decoder_and_rep_id, to_writer_with_rep_id,
    };
    use serde::Serialize;

    const LE: RepresentationIdentifier = RepresentationIdentifier::CDR_LE;

    #[derive(Debug, Clone, Default, PartialEq, Serialize)]
    struct Sample {
        name: String,
        values: Vec<f64>,
        flag: bool,
    }

    cdr_struct!(Sample { name, values, flag });

    fn received(bytes: &[u8], encoding: RepresentationIdentifier) -> Received {
        deserialize_from_cdr_with_decoder_and_rep_id(bytes, encoding, AsReceived)
            .expect("bytes are bytes")
            .0
    }

    fn decode(bytes: &[u8], has_header: bool) -> Result<Framed<Sample>, String> {
        received(bytes, LE).decode(has_header)
    }

    /// What a writer of RustDDS makes of a message.
    fn sent(message: &Padded) -> Vec<u8> {
        let mut bytes = Vec::new();
        to_writer_with_rep_id(&mut bytes, message, LE).expect("serializable");
        bytes
    }

    fn sample() -> Sample {
        Sample { name: "x".into(), values: vec![1.0, -2.5], flag: true }
    }

    #[test]
    fn a_service_has_two_topics() {
        assert_eq!(
            service_topics("/cell/load"),
            ("rq/cell/loadRequest".into(), "rr/cell/loadReply".into())
        );
    }

    #[test]
    fn a_sample_survives_the_wire_with_and_without_padding() {
        let mut bytes = cdr::body(&sample());
        for _ in 0..4 {
            assert_eq!(decode(&bytes, false).expect("decodes").body, sample());
            bytes.push(0);
        }
        let error = decode(&bytes, false).expect_err("four bytes too many");
        assert!(error.contains("left over"), "{error}");
        let error = decode(&bytes[..9], false).expect_err("its end is missing");
        assert!(!error.is_empty());
    }

    #[test]
    fn a_sample_of_a_big_endian_computer_is_read() {
        for length in 0..20 {
            let sample = Sample { name: "x".repeat(length), ..sample() };
            let bytes = cdr_encoding::to_vec::<_, BigEndian>(&sample).expect("serializable");
            let received = received(&bytes, RepresentationIdentifier::CDR_BE);
            assert_eq!((&received.bytes, received.order), (&bytes, ByteOrder::Big));
            assert_eq!(received.decode::<Sample>(false).expect("decodes").body, sample);
        }
        let mut bytes = vec![7; 8];
        bytes.extend([0, 0, 0, 0, 0, 0, 1, 2]);
        bytes.extend(cdr_encoding::to_vec::<_, BigEndian>(&sample()).expect("serializable"));
        let framed = received(&bytes, RepresentationIdentifier::CDR_BE).decode::<Sample>(true);
        let header = framed.expect("decodes").header.expect("has a header");
        assert_eq!(header, CycloneHeader::new(Gid([7; 16]), 258));
    }

    #[test]
    fn a_cyclone_header_keeps_client_and_sequence() {
        let client = Gid([7; 16]);
        for sequence in [1, 4_294_967_297, i64::from(u32::MAX)] {
            let header = Some(CycloneHeader::new(client, sequence));
            let bytes = sent(&padded(header, &cdr::body(&sample())).expect("it is short"));
            let framed = decode(&bytes, true).expect("decodes");
            let header = framed.header.expect("has a header");
            assert_eq!((header.sequence(), header.client(client)), (sequence, client));
            assert_eq!(framed.body, sample());
        }
    }

    #[test]
    fn a_request_through_the_wrong_mapping_is_refused() {
        #[derive(Debug)]
        struct AddTwoInts {
            a: i64,
            b: i64,
        }
        cdr_struct!(AddTwoInts { a, b });
        let body = cdr::body(&AddTwoInts { a: 2, b: 40 });
        let header = Some(CycloneHeader::new(Gid([9; 16]), 3));
        let bytes = sent(&padded(header, &body).expect("it is short"));
        assert!(received(&bytes, LE).decode::<AddTwoInts>(false).is_err());
        let bytes = sent(&padded(None, &body).expect("it is short"));
        assert!(received(&bytes, LE).decode::<AddTwoInts>(true).is_err());
    }

    #[test]
    fn no_bytes_whatever_make_the_decoder_panic() {
        let good = cdr::body(&sample());
        let mut state = 1_u64;
        for round in 0..20_000_usize {
            let mut bytes = good.clone();
            for _ in 0..=(round % 5) {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                let at = (state >> 33) as usize % bytes.len();
                bytes[at] = (state >> 25) as u8;
            }
            bytes.truncate(bytes.len() - round % 7);
            let _ = decode(&bytes, round % 2 == 0);
        }
        for length in 0..20 {
            let _ = decode(&good[..length.min(good.len())], true);
        }
    }
}
