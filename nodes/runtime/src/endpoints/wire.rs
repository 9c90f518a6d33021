//! How names and payloads look on DDS.
//!
//! Knows the mangling of ROS names and types, the header that Cyclone puts
//! before requests and replies, and how foreign bytes become a value without
//! ever panicking. Leaves sending and receiving to the endpoints.
//!
//! DDS matches endpoints by topic name, so any bytes may arrive. A sample that
//! does not fit its type, with bytes missing or more than padding left over,
//! becomes an `Err` with the reason.

use crate::command_line::environment::ServiceMapping;
use crate::rustdds::decode::without_panic;
use serde::de::{DeserializeOwned, DeserializeSeed, Error, SeqAccess, Visitor};
use serde::ser::SerializeTuple;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::marker::PhantomData;

/// Who sent something: the address of a DDS endpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Gid(pub [u8; 16]);

impl Gid {
    /// The part that all endpoints of one process share.
    pub fn participant(self) -> [u8; 12] {
        let mut prefix = [0; 12];
        prefix.copy_from_slice(&self.0[..12]);
        prefix
    }
}

impl std::fmt::Display for Gid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (index, byte) in self.0.iter().enumerate() {
            if index == 12 {
                f.write_str("|")?;
            } else if index > 0 && index % 4 == 0 {
                f.write_str(".")?;
            }
            write!(f, "{byte:02x}")?;
        }
        Ok(())
    }
}

impl From<Gid> for [u8; 16] {
    fn from(gid: Gid) -> Self {
        gid.0
    }
}

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

/// `pkg::msg::dds_::Type_` of `pkg/msg/Type`; `suffix` goes before the last underscore.
pub(crate) fn dds_type(type_name: &str, suffix: &str) -> String {
    let mut parts = type_name.rsplitn(2, '/');
    let base = parts.next().unwrap_or_default();
    let path = parts.next().unwrap_or_default().replace('/', "::");
    format!("{path}::dds_::{base}{suffix}_")
}

/// `pkg/msg/Type` of `pkg::msg::dds_::Type_`, or the name as it is.
pub(crate) fn ros_type(dds_type: &str) -> String {
    match dds_type.rsplit_once("::dds_::") {
        Some((path, base)) => {
            format!("{}/{}", path.replace("::", "/"), base.strip_suffix('_').unwrap_or(base))
        }
        None => dds_type.to_owned(),
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct CycloneHeader {
    /// The second half of the client's GUID.
    client: [u8; 8],
    sequence: i64,
}

impl CycloneHeader {
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
}

/// A payload with the header that its mapping asks for.
#[derive(Debug)]
pub(crate) struct Framed<T> {
    pub(crate) header: Option<CycloneHeader>,
    pub(crate) body: T,
}

impl<T: Serialize> Serialize for Framed<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.header {
            None => self.body.serialize(serializer),
            Some(header) => {
                let mut tuple = serializer.serialize_tuple(2)?;
                tuple.serialize_element(header)?;
                tuple.serialize_element(&self.body)?;
                tuple.end()
            }
        }
    }
}

/// The decoded sample, or why its bytes are not one.
pub(crate) type Decoded<T> = Result<Framed<T>, String>;

/// Turns bytes into a [`Decoded`]; never fails and never panics itself.
#[derive(Debug)]
pub(crate) struct Decoder<T> {
    has_header: bool,
    payload: PhantomData<fn() -> T>,
}

impl<T> Decoder<T> {
    pub(crate) fn plain() -> Self {
        Self { has_header: false, payload: PhantomData }
    }

    pub(crate) fn of_service(mapping: ServiceMapping) -> Self {
        Self { has_header: mapping == ServiceMapping::Cyclone, payload: PhantomData }
    }
}

impl<T> Clone for Decoder<T> {
    fn clone(&self) -> Self {
        Self { ..*self }
    }
}

impl<'de, T: DeserializeOwned> DeserializeSeed<'de> for Decoder<T> {
    type Value = Decoded<T>;

    fn deserialize<D: Deserializer<'de>>(self, bytes: D) -> Result<Self::Value, D::Error> {
        let fields = if self.has_header { 3 } else { 2 };
        Ok(without_panic(|| bytes.deserialize_tuple(fields, self)))
    }
}

impl<'de, T: DeserializeOwned> Visitor<'de> for Decoder<T> {
    type Value = Framed<T>;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a message")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut fields: A) -> Result<Framed<T>, A::Error> {
        let missing = || A::Error::custom("the message is cut short");
        let header = match self.has_header {
            true => Some(fields.next_element()?.ok_or_else(missing)?),
            false => None,
        };
        let body = fields.next_element()?.ok_or_else(missing)?;
        // Up to three bytes are padding; four more are another type's fields.
        if fields.next_element::<[u8; 4]>().is_ok() {
            return Err(A::Error::custom("bytes are left over"));
        }
        Ok(Framed { header, body })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustdds::RepresentationIdentifier;
    use rustdds::serialization::{
        deserialize_from_cdr_with_decoder_and_rep_id, to_writer_with_rep_id,
    };

    const LE: RepresentationIdentifier = RepresentationIdentifier::CDR_LE;

    #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
    struct Sample {
        name: String,
        values: Vec<f64>,
        flag: bool,
    }

    fn encode<T: Serialize>(value: &T) -> Vec<u8> {
        let mut bytes = Vec::new();
        to_writer_with_rep_id(&mut bytes, value, LE).expect("serializable");
        bytes
    }

    fn decode(bytes: &[u8], decoder: Decoder<Sample>) -> Decoded<Sample> {
        deserialize_from_cdr_with_decoder_and_rep_id(bytes, LE, decoder).expect("never fails").0
    }

    fn sample() -> Sample {
        Sample { name: "x".into(), values: vec![1.0, -2.5], flag: true }
    }

    #[test]
    fn names_of_types_go_to_dds_and_back() {
        assert_eq!(dds_type("std_msgs/msg/String", ""), "std_msgs::msg::dds_::String_");
        assert_eq!(
            dds_type("std_srvs/srv/Trigger", "_Request"),
            "std_srvs::srv::dds_::Trigger_Request_"
        );
        assert_eq!(ros_type("std_msgs::msg::dds_::String_"), "std_msgs/msg/String");
        assert_eq!(ros_type("odd"), "odd");
        assert_eq!(
            service_topics("/cell/load"),
            ("rq/cell/loadRequest".into(), "rr/cell/loadReply".into())
        );
    }

    #[test]
    fn a_sample_survives_the_wire_with_and_without_padding() {
        let mut bytes = encode(&sample());
        for _ in 0..4 {
            assert_eq!(decode(&bytes, Decoder::plain()).expect("decodes").body, sample());
            bytes.push(0);
        }
        let error = decode(&bytes, Decoder::plain()).expect_err("four bytes too many");
        assert!(error.contains("left over"), "{error}");
    }

    #[test]
    fn a_cyclone_header_keeps_client_and_sequence() {
        let client = Gid([7; 16]);
        for sequence in [1, 4_294_967_297, i64::from(u32::MAX)] {
            let header = Some(CycloneHeader::new(client, sequence));
            let bytes = encode(&Framed { header, body: sample() });
            let framed = decode(&bytes, Decoder::of_service(ServiceMapping::Cyclone));
            let framed = framed.expect("decodes");
            let header = framed.header.expect("has a header");
            assert_eq!((header.sequence(), header.client(client)), (sequence, client));
            assert_eq!(framed.body, sample());
        }
    }

    #[test]
    fn a_request_through_the_wrong_mapping_is_refused() {
        #[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
        struct AddTwoInts {
            a: i64,
            b: i64,
        }
        let header = Some(CycloneHeader::new(Gid([9; 16]), 3));
        let bytes = encode(&Framed { header, body: AddTwoInts { a: 2, b: 40 } });
        let decoder = Decoder::<AddTwoInts>::of_service(ServiceMapping::Enhanced);
        let decoded = deserialize_from_cdr_with_decoder_and_rep_id(&bytes, LE, decoder);
        assert!(decoded.expect("never fails").0.is_err());

        let bytes = encode(&AddTwoInts { a: 2, b: 40 });
        let decoder = Decoder::<AddTwoInts>::of_service(ServiceMapping::Cyclone);
        let decoded = deserialize_from_cdr_with_decoder_and_rep_id(&bytes, LE, decoder);
        assert!(decoded.expect("never fails").0.is_err());
    }

    #[test]
    fn no_bytes_whatever_make_the_decoder_panic() {
        let good = encode(&sample());
        let mut state = 1_u64;
        for round in 0..20_000_usize {
            let mut bytes = good.clone();
            for _ in 0..=(round % 5) {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                let at = (state >> 33) as usize % bytes.len();
                bytes[at] = (state >> 25) as u8;
            }
            bytes.truncate(bytes.len() - round % 7);
            let _ = decode(&bytes, Decoder::plain());
        }
    }
}
