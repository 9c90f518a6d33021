//! Writes decoded messages back to CDR: the reverse of [`crate::decode`].
//!
//! Little-endian, with four bytes of encapsulation. A value has to fit its field:
//! nothing is rounded, cut or filled in.

use crate::field_path::{FieldPath, PathStep};
use crate::schema::{Field, FieldType, MessageSchema};
use crate::types::{Arity, Primitive};
use crate::value::{MessageValue, Value};

/// Plain CDR, little-endian.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// Why a message cannot be encoded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EncodeError {
    #[error("{path}: it is missing")]
    Missing { path: FieldPath },
    #[error("{path}: {found} does not fit where {wanted} belongs")]
    Misfit { path: FieldPath, wanted: String, found: String },
    #[error("{path}: {found} elements where {wanted} belong")]
    Count { path: FieldPath, wanted: usize, found: usize },
}

/// Encodes one message. Fields that the definition does not have are left out.
pub fn encode(schema: &MessageSchema, message: &MessageValue) -> Result<Vec<u8>, EncodeError> {
    let mut pen = MessageEncoder { body: Vec::new(), path: Vec::new() };
    pen.message(schema, message)?;
    let mut bytes = LITTLE_ENDIAN.to_vec();
    bytes.append(&mut pen.body);
    Ok(bytes)
}

struct MessageEncoder {
    body: Vec<u8>,
    path: Vec<PathStep>,
}

impl MessageEncoder {
    fn path(&self) -> FieldPath {
        FieldPath(self.path.clone())
    }

    fn message(
        &mut self,
        schema: &MessageSchema,
        message: &MessageValue,
    ) -> Result<(), EncodeError> {
        if schema.fields.is_empty() {
            // On the wire it has one byte without meaning.
            self.body.push(0);
        }
        for field in &schema.fields {
            self.path.push(PathStep::Field(field.name.clone()));
            let value = message.get(&field.name);
            self.field(field, value.ok_or_else(|| EncodeError::Missing { path: self.path() })?)?;
            self.path.pop();
        }
        Ok(())
    }

    fn field(&mut self, field: &Field, value: &Value) -> Result<(), EncodeError> {
        let found = match (field.arity, value) {
            (Arity::One, _) => return self.one(&field.field_type, value),
            (_, Value::List(list)) => list.len(),
            (_, Value::Bytes(bytes)) if field.field_type.is_uint8() => bytes.len(),
            _ => return Err(self.misfit("a list", value)),
        };
        match field.arity {
            Arity::Array(wanted) if wanted != found => {
                return Err(EncodeError::Count { path: self.path(), wanted, found });
            }
            Arity::Sequence => self.count(found)?,
            _ => {}
        }
        match value {
            Value::Bytes(bytes) => self.body.extend(bytes),
            Value::List(list) => {
                for (index, value) in list.iter().enumerate() {
                    self.path.push(PathStep::Index(index));
                    self.one(&field.field_type, value)?;
                    self.path.pop();
                }
            }
            _ => unreachable!("its elements were counted"),
        }
        Ok(())
    }

    fn one(&mut self, field_type: &FieldType, value: &Value) -> Result<(), EncodeError> {
        match (field_type, value) {
            (FieldType::Message(schema), Value::Message(message)) => self.message(schema, message),
            (FieldType::Message(schema), _) => Err(self.misfit(&schema.type_name, value)),
            (FieldType::Primitive(primitive), _) => self.primitive(*primitive, value),
        }
    }

    fn primitive(&mut self, primitive: Primitive, value: &Value) -> Result<(), EncodeError> {
        use Primitive as P;
        let misfit = || self.misfit(&format!("{primitive:?}").to_lowercase(), value);
        let whole = || match value {
            Value::Unsigned(value) => Ok(i128::from(*value)),
            Value::Signed(value) => Ok(i128::from(*value)),
            _ => Err(misfit()),
        };
        macro_rules! put {
            ($integer:ty) => {
                <$integer>::try_from(whole()?).map_err(|_| misfit())?.to_le_bytes().to_vec()
            };
        }
        let bytes = match primitive {
            P::Bool => match value {
                Value::Bool(value) => vec![u8::from(*value)],
                _ => return Err(misfit()),
            },
            P::U8 | P::Byte | P::Char => put!(u8),
            P::I8 => put!(i8),
            P::U16 => put!(u16),
            P::I16 => put!(i16),
            P::U32 => put!(u32),
            P::I32 => put!(i32),
            P::U64 => put!(u64),
            P::I64 => put!(i64),
            P::F32 => match value {
                Value::Float(wide) if wide.is_nan() || f64::from(*wide as f32) == *wide => {
                    (*wide as f32).to_le_bytes().to_vec()
                }
                _ => return Err(misfit()),
            },
            P::F64 => match value {
                Value::Float(value) => value.to_le_bytes().to_vec(),
                _ => return Err(misfit()),
            },
            P::String => {
                let text = match value {
                    Value::Text(text) => text.as_bytes(),
                    Value::Bytes(bytes) => bytes,
                    _ => return Err(misfit()),
                };
                // With its closing zero.
                self.count(text.len() + 1)?;
                self.body.extend(text);
                self.body.push(0);
                return Ok(());
            }
            P::WideString => return Err(misfit()),
        };
        self.aligned(&bytes);
        Ok(())
    }

    fn count(&mut self, count: usize) -> Result<(), EncodeError> {
        let wanted = u32::MAX as usize;
        let length = u32::try_from(count);
        let length =
            length.map_err(|_| EncodeError::Count { path: self.path(), wanted, found: count })?;
        self.aligned(&length.to_le_bytes());
        Ok(())
    }

    /// A number at a multiple of its size.
    fn aligned(&mut self, bytes: &[u8]) {
        self.body.resize(self.body.len().next_multiple_of(bytes.len()), 0);
        self.body.extend(bytes);
    }

    fn misfit(&self, wanted: &str, found: &Value) -> EncodeError {
        EncodeError::Misfit {
            path: self.path(),
            wanted: wanted.to_owned(),
            found: format!("{} {found:.80}", found.kind()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decode::decode;

    const TEXT: &str = "bool a\nuint8[] b\nint16 c\nfloat32 d\nfloat64[2] e\nstring f\na_msgs/B[] g\n\
                        uint64 h\na_msgs/Empty i\nint8 j\nuint8[3] k\n\
                        ================\nMSG: a_msgs/B\nstring x\nint64 y\n\
                        ================\nMSG: a_msgs/Empty\n";

    fn message(fields: &[(&str, Value)]) -> MessageValue {
        MessageValue {
            type_name: "a_msgs/A".into(),
            fields: fields.iter().map(|(name, value)| ((*name).into(), value.clone())).collect(),
        }
    }

    fn whole() -> MessageValue {
        let inner = |x: &str, y| {
            let mut inner = message(&[("x", Value::Text(x.into())), ("y", Value::Signed(y))]);
            inner.type_name = "a_msgs/B".into();
            Value::Message(inner)
        };
        let nothing = MessageValue { type_name: "a_msgs/Empty".into(), fields: Vec::new() };
        message(&[
            ("a", Value::Bool(true)),
            ("b", Value::Bytes(vec![1, 2, 3])),
            ("c", Value::Signed(-7)),
            ("d", Value::Float(0.5)),
            ("e", Value::List(vec![Value::Float(1.0), Value::Float(f64::INFINITY)])),
            ("f", Value::Text("über".into())),
            ("g", Value::List(vec![inner("", 1), inner("longer", i64::MIN)])),
            ("h", Value::Unsigned(u64::MAX)),
            ("i", Value::Message(nothing)),
            ("j", Value::Signed(-128)),
            ("k", Value::Bytes(vec![9, 8, 7])),
        ])
    }

    #[test]
    fn what_is_written_is_read_again() {
        let schema = MessageSchema::parse("a_msgs/msg/A", TEXT).unwrap();
        let bytes = encode(&schema, &whole()).unwrap();
        assert_eq!(decode(&schema, &bytes).unwrap(), whole());
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let schema = MessageSchema::parse("a_msgs/msg/A", TEXT).unwrap();
        let with = |name: &str, value: Value| {
            let mut message = whole();
            message.fields.iter_mut().find(|(field, _)| **field == *name).unwrap().1 = value;
            encode(&schema, &message).unwrap_err().to_string()
        };
        let cases = [
            ("a", Value::Unsigned(1), "a: integer 1 does not fit where bool belongs"),
            ("c", Value::Signed(40_000), "c: integer 40000 does not fit where i16 belongs"),
            ("d", Value::Float(0.1), "d: float 0.1 does not fit where f32 belongs"),
            ("e", Value::List(vec![]), "e: 0 elements where 2 belong"),
            ("h", Value::Signed(-1), "h: integer -1 does not fit where u64 belongs"),
            ("g", Value::List(vec![Value::Bool(true)]), "g[0]: bool true does not fit"),
            ("g", Value::Text("x".into()), "g: text \"x\" does not fit where a list belongs"),
        ];
        for (name, value, expected) in cases {
            let said = with(name, value);
            assert!(said.starts_with(expected), "{said}");
        }
        let mut short = whole();
        short.fields.pop();
        assert_eq!(encode(&schema, &short).unwrap_err().to_string(), "k: it is missing");
    }
}
