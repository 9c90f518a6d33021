//! Messages are decoded by the definition in the bag, as another implementation wrote them.

use byteorder::{BigEndian, LittleEndian};
use proptest::prelude::*;
use rosidl::decode::{DecodeError, decode};
use rosidl::schema::{MessageSchema, SchemaError};
use rosidl::value::{MessageValue, Value};
use serde::Serialize;

/// Every wire type, in an order that needs padding.
const ALL_TEXT: &str = "\
# Constants and comments are not on the wire.
uint8 UNKNOWN=0
string HASH = a # b
bool flag
int8 small   # after a field
Inner[] inner
float64 wide 1.5
uint8[] bytes
string<=20 text
int16[3] triple
other_msgs/Inner[2] pair
float32 narrow
uint64 big
string[<=4] names
byte last
================================================================================
MSG: test_msgs/Inner
uint16 a
float64[] values
================================================================================
MSG: other_msgs/Inner
builtin_interfaces/Time stamp
Nothing nothing
================================================================================
MSG: other_msgs/Nothing
# No field at all.
";

#[derive(Debug, Clone, Serialize)]
struct All {
    flag: bool,
    small: i8,
    inner: Vec<Inner>,
    wide: f64,
    bytes: Vec<u8>,
    text: String,
    triple: [i16; 3],
    pair: [OtherInner; 2],
    narrow: f32,
    big: u64,
    names: Vec<String>,
    last: u8,
}

#[derive(Debug, Clone, Serialize)]
struct Inner {
    a: u16,
    values: Vec<f64>,
}

#[derive(Debug, Clone, Serialize)]
struct OtherInner {
    sec: i32,
    nanosec: u32,
    // A message without fields is one byte on the wire.
    nothing: u8,
}

fn all() -> impl Strategy<Value = All> {
    let inner = (any::<u16>(), prop::collection::vec(any::<f64>(), 0..4))
        .prop_map(|(a, values)| Inner { a, values });
    let other = || {
        (any::<i32>(), any::<u32>()).prop_map(|(sec, nanosec)| OtherInner {
            sec,
            nanosec,
            nothing: 0,
        })
    };
    let first = (
        any::<bool>(),
        any::<i8>(),
        prop::collection::vec(inner, 0..4),
        any::<f64>(),
        prop::collection::vec(any::<u8>(), 0..9),
        "[a-zäß]{0,9}",
    );
    let second = (
        any::<[i16; 3]>(),
        [other(), other()],
        any::<f32>(),
        any::<u64>(),
        prop::collection::vec("[a-z]{0,5}", 0..4),
        any::<u8>(),
    );
    (first, second).prop_map(|(a, b)| All {
        flag: a.0,
        small: a.1,
        inner: a.2,
        wide: a.3,
        bytes: a.4,
        text: a.5,
        triple: b.0,
        pair: b.1,
        narrow: b.2,
        big: b.3,
        names: b.4,
        last: b.5,
    })
}

/// The tree as it should come out; floats as their bits, so that NaN can be compared.
fn expected(all: &All) -> String {
    let floats = |values: &[f64]| -> Vec<u64> { values.iter().map(|v| v.to_bits()).collect() };
    let inner: Vec<_> = all.inner.iter().map(|i| (i.a, floats(&i.values))).collect();
    let pair = all.pair.clone().map(|o| (o.sec, o.nanosec));
    format!(
        "{} {} {inner:?} {} {:?} {:?} {:?} {pair:?} {} {} {:?} {}",
        all.flag,
        all.small,
        all.wide.to_bits(),
        all.bytes,
        all.text,
        all.triple,
        f64::from(all.narrow).to_bits(),
        all.big,
        all.names,
        all.last
    )
}

fn found(message: &MessageValue) -> String {
    let list = |value: &Value| match value {
        Value::List(list) => list.clone(),
        other => panic!("{other:?}"),
    };
    let field = |name: &str| message.get(name).unwrap().clone();
    let float = |value: &Value| value.as_f64().unwrap().to_bits();
    let inner: Vec<_> = list(&field("inner"))
        .iter()
        .map(|i| {
            let values: Vec<_> = list(i.get("values").unwrap()).iter().map(float).collect();
            (i.get("a").unwrap().as_u64().unwrap(), values)
        })
        .collect();
    let pair: Vec<_> = list(&field("pair"))
        .iter()
        .map(|o| {
            let part = |path: &str| o.get(path).unwrap().as_f64().unwrap() as i64;
            assert_eq!(o.get("nothing").unwrap().to_string(), "{}");
            (part("stamp.sec"), part("stamp.nanosec"))
        })
        .collect();
    let Value::Bytes(bytes) = field("bytes") else { panic!("bytes") };
    let names: Vec<_> =
        list(&field("names")).iter().map(|n| n.as_str().unwrap().to_owned()).collect();
    format!(
        "{} {} {inner:?} {} {bytes:?} {:?} {} {pair:?} {} {} {names:?} {}",
        field("flag"),
        field("small"),
        float(&field("wide")),
        field("text").as_str().unwrap(),
        field("triple"),
        float(&field("narrow")),
        field("big"),
        field("last"),
    )
}

proptest! {
    #[test]
    fn decoding_agrees_with_a_second_implementation_in_both_byte_orders(all in all()) {
        let schema = MessageSchema::parse("test_msgs/msg/All", ALL_TEXT).unwrap();
        let mut little = vec![0, 1, 0, 0];
        little.extend(cdr_encoding::to_vec::<_, LittleEndian>(&all).unwrap());
        let mut big = vec![0, 0, 0, 0];
        big.extend(cdr_encoding::to_vec::<_, BigEndian>(&all).unwrap());
        for data in [&little, &big] {
            let message = decode(&schema, data).unwrap();
            prop_assert_eq!(found(&message), expected(&all));
        }
        // Every shorter message is an error with an offset, not a wrong message.
        for length in 0..little.len() {
            prop_assert!(decode(&schema, &little[..length]).is_err());
        }
    }

    #[test]
    fn junk_is_an_error_or_a_message_and_never_a_panic(
        order in 0_u8..2,
        junk in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        let schema = MessageSchema::parse("test_msgs/msg/All", ALL_TEXT).unwrap();
        let mut data = vec![0, order, 0, 0];
        data.extend(junk);
        let _ = decode(&schema, &data);
    }

    #[test]
    fn junk_as_a_definition_is_an_error_or_a_definition(text in "([a-z0-9/\\[\\]<=# ]{0,12}[ \n]|MSG: a/b\n|===\n){0,12}") {
        if let Ok(schema) = MessageSchema::parse("a/msg/b", &text) {
            let _ = decode(&schema, &[0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
        }
    }
}

#[test]
fn a_message_that_does_not_fit_says_where() {
    let schema =
        MessageSchema::parse("a/msg/A", "uint32 a\nB[] list\n===\nMSG: a/B\nuint8 k\nfloat64 x\n");
    let schema = schema.unwrap();
    let check = |data: &[u8]| decode(&schema, data).unwrap_err();
    assert_eq!(check(&[0]), DecodeError::NoEncapsulation { length: 1 });
    assert_eq!(check(&[0, 2, 0, 0]), DecodeError::Encapsulation(2));
    let short = check(&[0, 1, 0, 0, 1, 0]).to_string();
    assert_eq!(short, "a: 4 bytes wanted at byte 4, 2 are left");
    // A length of two gigabytes in twelve bytes must not be allocated.
    let huge = check(&[0, 1, 0, 0, 1, 0, 0, 0, 255, 255, 255, 127]).to_string();
    assert!(huge.starts_with("list: 2147483647 elements cannot be"), "{huge}");
    let mut two = vec![0, 1, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0];
    two.extend([0; 20]);
    let inside = check(&two).to_string();
    assert!(inside.starts_with("list[1].x: 8 bytes wanted"), "{inside}");
    let mut long = vec![0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0];
    long.extend([0; 5]);
    assert_eq!(check(&long), DecodeError::LeftOver { count: 5 });
}

#[test]
fn a_definition_that_cannot_be_used_says_why() {
    let check = |text: &str| MessageSchema::parse("a/msg/A", text).unwrap_err().to_string();
    assert_eq!(
        check("uint8 a\nuint8\n"),
        "line 2: \"uint8\" is not a field; it should read: type name"
    );
    assert_eq!(check("uint8[x] a\n"), "line 1: \"uint8[x]\" is not a type");
    assert_eq!(check("uint8[0] a\n"), "line 1: \"uint8[0]\" is not a type");
    assert_eq!(check("uint8 a\nuint8 a\n"), "line 2: the field a is there twice");
    assert_eq!(check("A a\n"), "a/A contains itself");
    assert_eq!(check("b/B b\n"), "the definition of b/B, needed by a/A, is missing");
    let with_second = check("b/B b\n=====\nMSG: b/B\nuint8 x\nuint9 y\n");
    assert_eq!(with_second, "the definition of b/uint9, needed by b/B, is missing");
    let chain: String = (0..40).map(|i| format!("===\nMSG: a/T{i}\nT{} next\n", i + 1)).collect();
    let deep = MessageSchema::parse("a/msg/A", &format!("T0 first\n{chain}"));
    assert!(matches!(deep, Err(SchemaError::TooDeep { .. })), "{deep:?}");
}
