//! Decodes messages by their definition, without a Rust type.
//!
//! CDR as ROS 2 sends it: four bytes of encapsulation, either byte order,
//! natural alignment up to 8. The bytes may be junk: nothing panics, and the
//! allocated memory is bounded by the size of the message.

use crate::field_path::{FieldPath, PathStep};
use crate::schema::{Field, FieldType, MessageSchema};
use crate::types::{Arity, Primitive};
use crate::value::{MessageValue, Value};

/// Bytes that may follow the last field: padding to a multiple of four.
const PADDING_MAX: usize = 3;

/// Why a message does not fit its definition.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DecodeError {
    #[error("the message has {length} bytes, fewer than its four of encapsulation")]
    NoEncapsulation { length: usize },
    #[error("the encapsulation {0:04x} is not plain CDR (0000 or 0001)")]
    Encapsulation(u16),
    #[error("{path}: {wanted} bytes wanted at byte {at}, {available} are left")]
    Short { path: FieldPath, at: usize, wanted: usize, available: usize },
    #[error("{path}: {count} elements cannot be in the {available} bytes left at byte {at}")]
    Count { path: FieldPath, at: usize, count: usize, available: usize },
    #[error("{path}: a boolean is {value} at byte {at}, neither 0 nor 1")]
    Bool { path: FieldPath, at: usize, value: u8 },
    #[error("{path}: wide text is not supported, its form differs between vendors")]
    WideString { path: FieldPath },
    #[error("{count} bytes follow the last field; the message has a different version")]
    LeftOver { count: usize },
}

/// Decodes one message.
pub fn decode(schema: &MessageSchema, data: &[u8]) -> Result<MessageValue, DecodeError> {
    let (head, body) =
        data.split_first_chunk::<4>().ok_or(DecodeError::NoEncapsulation { length: data.len() })?;
    let is_big_endian = match u16::from_be_bytes([head[0], head[1]]) {
        0 => true,
        1 => false,
        other => return Err(DecodeError::Encapsulation(other)),
    };
    let mut cursor = Cursor { body, at: 0, is_big_endian, path: Vec::new() };
    // For a message without fields some writers write nothing, others one byte.
    if schema.fields.is_empty() && body.is_empty() {
        return Ok(MessageValue { type_name: schema.type_name.clone(), fields: Vec::new() });
    }
    let message = cursor.message(schema)?;
    let count = cursor.available();
    if count > PADDING_MAX {
        return Err(DecodeError::LeftOver { count });
    }
    Ok(message)
}

struct Cursor<'a> {
    body: &'a [u8],
    at: usize,
    is_big_endian: bool,
    path: Vec<PathStep>,
}

impl Cursor<'_> {
    fn available(&self) -> usize {
        self.body.len() - self.at
    }

    fn path(&self) -> FieldPath {
        FieldPath(self.path.clone())
    }

    fn message(&mut self, schema: &MessageSchema) -> Result<MessageValue, DecodeError> {
        if schema.fields.is_empty() {
            // On the wire it has one byte without meaning.
            self.bytes::<1>()?;
        }
        let mut fields = Vec::with_capacity(schema.fields.len());
        for field in &schema.fields {
            self.path.push(PathStep::Field(field.name.clone()));
            fields.push((field.name.clone(), self.field(field)?));
            self.path.pop();
        }
        Ok(MessageValue { type_name: schema.type_name.clone(), fields })
    }

    fn field(&mut self, field: &Field) -> Result<Value, DecodeError> {
        let count = match field.arity {
            Arity::One => return self.one(&field.field_type),
            Arity::Array(length) => length,
            Arity::Sequence => self.count()?,
        };
        let size_min = field.field_type.size_min();
        if count.saturating_mul(size_min) > self.available() {
            return Err(DecodeError::Count {
                path: self.path(),
                at: self.at,
                count,
                available: self.available(),
            });
        }
        if field.field_type.is_uint8() {
            let bytes = self.body[self.at..self.at + count].to_vec();
            self.at += count;
            return Ok(Value::Bytes(bytes));
        }
        let mut list = Vec::with_capacity(count);
        for index in 0..count {
            self.path.push(PathStep::Index(index));
            list.push(self.one(&field.field_type)?);
            self.path.pop();
        }
        Ok(Value::List(list))
    }

    fn one(&mut self, field_type: &FieldType) -> Result<Value, DecodeError> {
        let primitive = match field_type {
            FieldType::Message(schema) => return Ok(Value::Message(self.message(schema)?)),
            FieldType::Primitive(primitive) => *primitive,
        };
        Ok(match primitive {
            Primitive::Bool => {
                let at = self.at;
                match self.bytes::<1>()? {
                    [0] => Value::Bool(false),
                    [1] => Value::Bool(true),
                    [value] => {
                        let path = self.path();
                        return Err(DecodeError::Bool { path, at, value });
                    }
                }
            }
            Primitive::U8 | Primitive::Byte | Primitive::Char => {
                Value::Unsigned(u8::from_be_bytes(self.bytes()?).into())
            }
            Primitive::I8 => Value::Signed(i8::from_be_bytes(self.bytes()?).into()),
            Primitive::U16 => Value::Unsigned(u16::from_be_bytes(self.bytes()?).into()),
            Primitive::I16 => Value::Signed(i16::from_be_bytes(self.bytes()?).into()),
            Primitive::U32 => Value::Unsigned(u32::from_be_bytes(self.bytes()?).into()),
            Primitive::I32 => Value::Signed(i32::from_be_bytes(self.bytes()?).into()),
            Primitive::U64 => Value::Unsigned(u64::from_be_bytes(self.bytes()?)),
            Primitive::I64 => Value::Signed(i64::from_be_bytes(self.bytes()?)),
            Primitive::F32 => Value::Float(f32::from_be_bytes(self.bytes()?).into()),
            Primitive::F64 => Value::Float(f64::from_be_bytes(self.bytes()?)),
            Primitive::String => self.string()?,
            Primitive::WideString => {
                return Err(DecodeError::WideString { path: self.path() });
            }
        })
    }

    fn count(&mut self) -> Result<usize, DecodeError> {
        Ok(u32::from_be_bytes(self.bytes()?) as usize)
    }

    fn string(&mut self) -> Result<Value, DecodeError> {
        let length = self.count()?;
        let Some(bytes) = self.body.get(self.at..self.at.saturating_add(length)) else {
            return Err(self.short(length));
        };
        self.at += length;
        // The count includes the closing zero; a few writers leave it out of empty text.
        let bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        Ok(match std::str::from_utf8(bytes) {
            Ok(text) => Value::Text(text.to_owned()),
            Err(_) => Value::Bytes(bytes.to_vec()),
        })
    }

    /// Takes `N` bytes at their alignment, the most significant first.
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], DecodeError> {
        let from = self.at.next_multiple_of(N);
        let Some(bytes) = self.body.get(from..).and_then(|rest| rest.first_chunk::<N>()) else {
            return Err(self.short(N));
        };
        self.at = from + N;
        let mut bytes = *bytes;
        if !self.is_big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    fn short(&self, wanted: usize) -> DecodeError {
        DecodeError::Short {
            path: self.path(),
            at: self.at + 4,
            wanted,
            available: self.available(),
        }
    }
}
