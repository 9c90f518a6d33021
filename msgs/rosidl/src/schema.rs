//! The layout of a message, from the schema text that a bag carries.
//!
//! Lists the fields in wire order, so that [`crate::decode`] can read messages without their
//! Rust type. The text may be junk: syntax errors state their line, and recursion is bounded.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::schema_text::{SchemaPart, is_rule, parts, short_name, two_part_name};
use crate::syntax::{self, LineItem};
use crate::types::{Arity, Primitive, WrittenType};

/// Messages nested deeper than this are refused.
const DEPTH_MAX: usize = 32;

/// Why a definition cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SchemaError {
    #[error("the definition is not UTF-8 text")]
    NotText,
    #[error("line {line}: \"{text}\" is not a field; it should read: type name")]
    Field { line: usize, text: String },
    #[error("line {line}: \"{text}\" is not a type")]
    Type { line: usize, text: String },
    #[error("line {line}: the field {name} is there twice")]
    FieldTwice { line: usize, name: String },
    #[error("the definition of {missing}, needed by {needed_by}, is missing")]
    Missing { missing: String, needed_by: String },
    #[error("{0} contains itself")]
    Recursive(String),
    #[error("{type_name} is nested deeper than {max} messages", max = DEPTH_MAX)]
    TooDeep { type_name: String },
}

/// What one element of a field is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FieldType {
    Primitive(Primitive),
    Message(Arc<MessageSchema>),
}

impl FieldType {
    pub(crate) fn size_min(&self) -> usize {
        match self {
            Self::Primitive(primitive) => primitive.size_min(),
            Self::Message(message) => message.size_min,
        }
    }

    /// Whether a list of them is a block of bytes.
    pub(crate) fn is_uint8(&self) -> bool {
        matches!(self, Self::Primitive(primitive) if primitive.on_the_wire() == Primitive::U8)
    }
}

/// One field of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    pub name: Arc<str>,
    pub field_type: FieldType,
    pub arity: Arity,
}

/// The layout of one message type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MessageSchema {
    /// `package/msg/Type`, or as it was named in the text.
    pub type_name: Arc<str>,
    /// In wire order.
    pub fields: Vec<Field>,
    /// The fewest bytes one takes on the wire, at least 1.
    pub(crate) size_min: usize,
}

impl MessageSchema {
    /// Reads a definition as text; see [`MessageSchema::parse`].
    pub fn from_bytes(type_name: &str, text: &[u8]) -> Result<Arc<Self>, SchemaError> {
        let text = std::str::from_utf8(text).map_err(|_| SchemaError::NotText)?;
        Self::parse(type_name, text)
    }

    /// Reads a schema text: the type's own definition, then those of the types it needs; see
    /// [`crate::schema_text`].
    pub fn parse(type_name: &str, text: &str) -> Result<Arc<Self>, SchemaError> {
        let mut definitions = BTreeMap::new();
        for part in parts(type_name, text) {
            definitions.entry(short_name(part.name)).or_insert(part);
        }
        for (name, text) in BUILTIN {
            let part = SchemaPart { name, first_line: 1, text };
            definitions.entry((*name).to_owned()).or_insert(part);
        }
        let mut builder = Builder { definitions, done: BTreeMap::new() };
        builder.message(&short_name(type_name), type_name, &mut Vec::new())
    }
}

/// Types that some writers leave out of the text.
const BUILTIN: &[(&str, &str)] = &[
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n"),
];

struct Builder<'a> {
    /// By short name. Those that nothing needs are not read.
    definitions: BTreeMap<String, SchemaPart<'a>>,
    done: BTreeMap<String, Arc<MessageSchema>>,
}

impl Builder<'_> {
    fn message(
        &mut self,
        short: &str,
        needed_by: &str,
        above: &mut Vec<String>,
    ) -> Result<Arc<MessageSchema>, SchemaError> {
        if let Some(done) = self.done.get(short) {
            return Ok(done.clone());
        }
        if above.iter().any(|name| name == short) {
            return Err(SchemaError::Recursive(short.to_owned()));
        }
        if above.len() >= DEPTH_MAX {
            return Err(SchemaError::TooDeep { type_name: short.to_owned() });
        }
        let Some(part) = self.definitions.get(short).copied() else {
            return Err(SchemaError::Missing {
                missing: short.to_owned(),
                needed_by: needed_by.to_owned(),
            });
        };
        above.push(short.to_owned());
        let mut fields: Vec<Field> = Vec::new();
        for written in syntax::lines(part.text).filter(|line| !is_rule(line.text)) {
            let line = part.first_line - 1 + written.number;
            let (type_text, name) = match written.item {
                None | Some(Ok(LineItem::Constant { .. })) => continue,
                Some(Ok(LineItem::Field { type_text, name, .. })) => (type_text, name),
                Some(Err(_)) => {
                    return Err(SchemaError::Field { line, text: shortened(written.text) });
                }
            };
            let WrittenType { base, arity, .. } = WrittenType::parse(type_text)
                .map_err(|_| SchemaError::Type { line, text: shortened(type_text) })?;
            if fields.iter().any(|field| *field.name == *name) {
                return Err(SchemaError::FieldTwice { line, name: name.to_owned() });
            }
            let field_type = match Primitive::named(base) {
                Some(primitive) => FieldType::Primitive(primitive.on_the_wire()),
                None => {
                    let package = short.split('/').next().unwrap_or_default();
                    let is_defined = |name: &str| self.definitions.contains_key(name);
                    let inner = two_part_name(base, package, is_defined);
                    FieldType::Message(self.message(&inner, short, above)?)
                }
            };
            fields.push(Field { name: name.into(), field_type, arity });
        }
        above.pop();
        let size_min = fields
            .iter()
            .map(|field| match field.arity {
                Arity::One => field.field_type.size_min(),
                Arity::Array(length) => field.field_type.size_min().saturating_mul(length),
                Arity::Sequence => 4,
            })
            .fold(0_usize, usize::saturating_add)
            .max(1);
        let message = Arc::new(MessageSchema { type_name: short.into(), fields, size_min });
        self.done.insert(short.to_owned(), message.clone());
        Ok(message)
    }
}

fn shortened(text: &str) -> String {
    text.chars().take(60).collect()
}
