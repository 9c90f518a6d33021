//! Bytes on the wire against those of another implementation.
//!
//! `fixtures/messages.json` has a value for each of our messages; `oracle.py`
//! encodes the same rows with `rosbags` into `fixtures/cdr.txt`.

use std::fmt::Debug;

use cnc_msgs::cdr;
use cnc_msgs::interface::Message;
use cnc_msgs::wire::cnc_msgs::msg::MachineState;
use cnc_msgs::wire::sensor_msgs::msg::CompressedImage;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// A row, encoded and decoded with our structs.
struct Encoded {
    body: Vec<u8>,
    /// The message, decoded again, as JSON.
    decoded: Value,
    /// A new message as JSON.
    default: Value,
    /// The first length at which a cut-off message was accepted as a whole one.
    accepted_cut: Option<usize>,
}

fn encode<M>(value: &Value) -> Encoded
where
    M: Message + Serialize + DeserializeOwned + Default + Debug + PartialEq,
{
    let message: M = serde_json::from_value(value.clone()).unwrap_or_else(|error| {
        panic!("the row of {} does not fit: {error}; run oracle.py --write", M::TYPE_NAME)
    });
    let bytes = cdr::encapsulated(&message);
    let decoded: M = cdr::decode(&bytes).expect(M::TYPE_NAME);
    assert_eq!(decoded, message, "{}", M::TYPE_NAME);
    let accepted_cut = (0..bytes.len()).find(|cut| cdr::decode::<M>(&bytes[..*cut]).is_ok());
    let to_json = |message: &M| serde_json::to_value(message).expect(M::TYPE_NAME);
    Encoded {
        body: cdr::body(&message),
        decoded: to_json(&decoded),
        default: to_json(&M::default()),
        accepted_cut,
    }
}

type Encode = fn(&Value) -> Encoded;

macro_rules! encoders {
    ($($name:literal => $message:ty,)*) => { &[$(($name, encode::<$message> as Encode),)*] };
}

const ENCODERS: &[(&str, Encode)] = cnc_msgs::for_every_message!(encoders);

/// The rows of the fixture: type, value, and the value encoded.
fn rows() -> Vec<(String, Value, Encoded)> {
    let rows: Vec<Value> =
        serde_json::from_str(include_str!("../fixtures/messages.json")).expect("valid JSON");
    rows.into_iter()
        .map(|mut row| {
            let value = row["value"].take();
            let name = row["type"].as_str().expect("a row has a type").to_string();
            let encode = ENCODERS.iter().find(|(of, _)| *of == name);
            let (_, encode) =
                encode.unwrap_or_else(|| panic!("{name} is no message; drop its row"));
            let encoded = encode(&value);
            (name, value, encoded)
        })
        .collect()
}

#[test]
fn every_message_of_ours_has_a_row() {
    let rows = rows();
    for (name, _) in ENCODERS.iter().filter(|(name, _)| name.starts_with("cnc_msgs/")) {
        assert!(
            rows.iter().any(|(of, _, _)| of == name),
            "{name} has no row in messages.json; msgs/tests/oracle.py --write adds one"
        );
    }
}

#[test]
fn our_bytes_are_those_of_rosbags() {
    let rows = rows();
    let golden: Vec<&str> = include_str!("../fixtures/cdr.txt").lines().collect();
    assert_eq!(rows.len(), golden.len(), "run msgs/tests/oracle.py --write");
    for ((name, _, encoded), golden) in rows.iter().zip(golden) {
        let hex: String = encoded.body.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(format!("{name} {hex}"), golden);
    }
}

#[test]
fn every_field_of_a_row_arrives_and_differs_from_the_default() {
    for (name, value, encoded) in rows() {
        assert_eq!(value, encoded.decoded, "{name}");
        check_differs(&name, &value, &encoded.default);
    }
}

/// A field that is zero or empty proves nothing.
fn check_differs(place: &str, value: &Value, default: &Value) {
    match (value, default) {
        (Value::Object(fields), Value::Object(defaults)) => {
            for (field, value) in fields {
                check_differs(&format!("{place}.{field}"), value, &defaults[field]);
            }
        }
        (Value::Array(elements), _) => {
            assert!(!elements.is_empty(), "{place} is empty");
        }
        _ if place.ends_with(".structure_needs_at_least_one_member") => {}
        _ => assert_ne!(value, default, "{place} is the default"),
    }
}

#[test]
fn a_message_that_was_cut_off_is_refused() {
    for (name, _, encoded) in rows() {
        assert_eq!(encoded.accepted_cut, None, "{name}");
    }
}

#[test]
fn a_length_that_the_message_cannot_have_is_refused_without_taking_memory() {
    let image = CompressedImage { format: "png".into(), ..CompressedImage::default() };
    let mut bytes = cdr::encapsulated(&image);
    let length_at = bytes.len() - 4;
    bytes[length_at..].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(cdr::decode::<CompressedImage>(&bytes).is_err());
}

#[test]
fn a_message_of_a_big_endian_peer_is_understood() {
    let name = MachineState::TYPE_NAME;
    let (of, hex) = include_str!("../fixtures/big_endian.txt").trim_end().split_once(' ').unwrap();
    assert_eq!(of, name);
    let bytes: Vec<u8> = (0..hex.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(&hex[at..at + 2], 16).expect("hex"))
        .collect();
    let decoded: MachineState = cdr::decode(&bytes).expect(name);
    let (_, value, _) = rows().into_iter().find(|(of, _, _)| of == name).expect("has a row");
    assert_eq!(serde_json::to_value(decoded).expect(name), value);
}
