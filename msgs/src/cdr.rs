//! CDR, the form in which messages are sent and recorded.
//!
//! DDS and bags put four bytes of encapsulation before the body; checksums are
//! over the body alone.

mod form;

pub use form::{Broken, Cdr, Reader, Writer};

use crate::interface::Message;
use byteorder::LittleEndian;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// The encapsulation of plain CDR, little-endian.
pub const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// Bytes that may follow the last field: padding to a multiple of four.
const PADDING_MAX: usize = 3;

/// Why bytes are not the expected message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CdrError {
    #[error("{type_name}: {found} bytes are too few for an encapsulation")]
    Short { type_name: &'static str, found: usize },
    #[error("{type_name}: encapsulation {kind:02x?} is not plain CDR")]
    Encapsulation { type_name: &'static str, kind: [u8; 2] },
    #[error("{type_name}: {reason}")]
    Body { type_name: &'static str, reason: String },
    #[error(
        "{type_name}: {count} bytes follow the last field; the message has a different version"
    )]
    LeftOver { type_name: &'static str, count: usize },
}

/// The body, little-endian, without encapsulation.
pub fn body<T: Cdr>(value: &T) -> Vec<u8> {
    let mut out = Writer::default();
    value.write(&mut out);
    out.into_bytes()
}

/// Reads what [`body`] wrote, up to the last byte.
///
/// # Errors
/// The bytes are not a `T`, or more bytes follow it.
pub fn from_body<T: Cdr>(bytes: &[u8]) -> Result<T, CdrError> {
    whole(std::any::type_name::<T>(), Reader::new(bytes, false), 0)
}

/// The message as a bag stores it: little-endian, with its encapsulation.
pub fn encapsulated<T: Cdr>(value: &T) -> Vec<u8> {
    let mut out = Writer::after(LITTLE_ENDIAN.to_vec());
    value.write(&mut out);
    out.into_bytes()
}

/// Reads a message with its encapsulation, of either byte order.
pub fn decode<M: Message>(bytes: &[u8]) -> Result<M, CdrError> {
    let type_name = M::TYPE_NAME;
    let Some((head, body)) = bytes.split_at_checked(LITTLE_ENDIAN.len()) else {
        return Err(CdrError::Short { type_name, found: bytes.len() });
    };
    let is_big_endian = match [head[0], head[1]] {
        [0, 1] => false,
        [0, 0] => true,
        kind => return Err(CdrError::Encapsulation { type_name, kind }),
    };
    whole(type_name, Reader::new(body, is_big_endian), PADDING_MAX)
}

fn whole<T: Cdr>(
    type_name: &'static str,
    mut from: Reader<'_>,
    padding_max: usize,
) -> Result<T, CdrError> {
    let value = T::read(&mut from);
    let value = value.map_err(|broken| CdrError::Body { type_name, reason: broken.to_string() })?;
    match from.left() {
        left if left <= padding_max => Ok(value),
        count => Err(CdrError::LeftOver { type_name, count }),
    }
}

/// What only processes of one build exchange or keep: any serde value, in CDR.
pub fn record<T: Serialize>(value: &T) -> Vec<u8> {
    cdr_encoding::to_vec::<T, LittleEndian>(value)
        .expect("a struct of numbers, strings and sequences always has a CDR form")
}

/// Reads what [`record`] wrote, up to the last byte.
///
/// # Errors
/// The bytes are not a `T`, or more bytes follow it.
pub fn from_record<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, CdrError> {
    let type_name = std::any::type_name::<T>();
    let (value, used) = cdr_encoding::from_bytes::<T, LittleEndian>(bytes)
        .map_err(|error| CdrError::Body { type_name, reason: error.to_string() })?;
    match bytes.len().saturating_sub(used) {
        0 => Ok(value),
        count => Err(CdrError::LeftOver { type_name, count }),
    }
}
