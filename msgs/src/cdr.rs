//! CDR, the form in which messages are sent and recorded.
//!
//! DDS and bags put four bytes of encapsulation before the body; checksums are
//! over the body alone.

use crate::interface::Message;
use byteorder::{BigEndian, LittleEndian};
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
pub fn body<T: Serialize>(value: &T) -> Vec<u8> {
    cdr_encoding::to_vec::<T, LittleEndian>(value)
        .expect("a struct of numbers, strings and sequences always has a CDR form")
}

/// Reads what [`body`] wrote, up to the last byte.
///
/// # Errors
/// The bytes are not a `T`, or more bytes follow it.
pub fn from_body<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, CdrError> {
    let type_name = std::any::type_name::<T>();
    let (value, used) = cdr_encoding::from_bytes::<T, LittleEndian>(bytes)
        .map_err(|error| CdrError::Body { type_name, reason: error.to_string() })?;
    match bytes.len().saturating_sub(used) {
        0 => Ok(value),
        count => Err(CdrError::LeftOver { type_name, count }),
    }
}

/// The message as a bag stores it: little-endian, with its encapsulation.
pub fn encapsulated<T: Serialize>(value: &T) -> Vec<u8> {
    let mut bytes = LITTLE_ENDIAN.to_vec();
    bytes.extend(body(value));
    bytes
}

/// Reads a message with its encapsulation, of either byte order.
pub fn decode<M: Message>(bytes: &[u8]) -> Result<M, CdrError> {
    let type_name = M::TYPE_NAME;
    let Some((head, body)) = bytes.split_at_checked(LITTLE_ENDIAN.len()) else {
        return Err(CdrError::Short { type_name, found: bytes.len() });
    };
    let decoded = match [head[0], head[1]] {
        [0, 1] => cdr_encoding::from_bytes::<M, LittleEndian>(body),
        [0, 0] => cdr_encoding::from_bytes::<M, BigEndian>(body),
        kind => return Err(CdrError::Encapsulation { type_name, kind }),
    };
    let (message, used) =
        decoded.map_err(|error| CdrError::Body { type_name, reason: error.to_string() })?;
    match body.len().saturating_sub(used) {
        0..=PADDING_MAX => Ok(message),
        count => Err(CdrError::LeftOver { type_name, count }),
    }
}
