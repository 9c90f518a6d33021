//! Message definitions as bags carry them: the `ros2msg` text of a schema record.
//!
//! Reads the text of a `.msg` file, followed by every definition it needs, and
//! lays out the fields in wire order, so that [`crate::decode`] can read
//! messages without their Rust type. The text may be junk: every error has its
//! line, and recursion is bounded.

use std::collections::BTreeMap;
use std::sync::Arc;

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

/// A type on the wire that is not a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Primitive {
    Bool,
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
    String,
    WideString,
}

impl Primitive {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "bool" => Self::Bool,
            "byte" | "char" | "uint8" => Self::U8,
            "int8" => Self::I8,
            "uint16" => Self::U16,
            "int16" => Self::I16,
            "uint32" => Self::U32,
            "int32" => Self::I32,
            "uint64" => Self::U64,
            "int64" => Self::I64,
            "float32" => Self::F32,
            "float64" => Self::F64,
            "string" => Self::String,
            "wstring" => Self::WideString,
            _ => return None,
        })
    }

    /// The fewest bytes one takes on the wire.
    pub(crate) fn size_min(self) -> usize {
        match self {
            Self::Bool | Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 | Self::String | Self::WideString => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }
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
}

/// How many elements a field has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arity {
    /// Just one.
    One,
    /// Always this many, without a count on the wire.
    Array(usize),
    /// A count and that many.
    Sequence,
}

/// One field of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    pub name: Arc<str>,
    pub field_type: FieldType,
    pub arity: Arity,
}

/// A constant; not on the wire.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Constant {
    pub name: String,
    /// As written.
    pub value: String,
}

/// The layout of one message type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MessageSchema {
    /// `package/msg/Type`, or as it was named in the text.
    pub type_name: Arc<str>,
    /// In wire order.
    pub fields: Vec<Field>,
    pub constants: Vec<Constant>,
    /// The fewest bytes one takes on the wire, at least 1.
    pub(crate) size_min: usize,
}

impl MessageSchema {
    /// Reads a definition as text; see [`MessageSchema::parse`].
    pub fn from_bytes(type_name: &str, text: &[u8]) -> Result<Arc<Self>, SchemaError> {
        let text = std::str::from_utf8(text).map_err(|_| SchemaError::NotText)?;
        Self::parse(type_name, text)
    }

    /// Reads a definition: the type's own text, then the types it needs, each after a line of
    /// equals signs and a line `MSG: package/Type`.
    pub fn parse(type_name: &str, text: &str) -> Result<Arc<Self>, SchemaError> {
        let mut definitions = split(type_name, text);
        for (name, fields) in BUILTIN {
            definitions.entry((*name).to_owned()).or_insert((1, (*fields).to_owned()));
        }
        let mut builder = Builder { definitions, done: BTreeMap::new() };
        builder.message(&short_name(type_name), type_name, &mut Vec::new())
    }

    /// The constants that begin with `prefix`, as value and name: for enumerations in reports.
    pub fn constant_named(&self, prefix: &str, value: &str) -> Option<&str> {
        self.constants
            .iter()
            .find(|constant| constant.name.starts_with(prefix) && constant.value == value)
            .map(|constant| constant.name.as_str())
    }
}

/// Types that some writers leave out of the text.
const BUILTIN: &[(&str, &str)] = &[
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n"),
];

/// `package/Type` of `package/msg/Type`.
fn short_name(name: &str) -> String {
    match name.split('/').collect::<Vec<_>>()[..] {
        [package, _, short] => format!("{package}/{short}"),
        _ => name.to_owned(),
    }
}

/// Cuts a text into definitions by short name, each with the number of its first line.
fn split(root: &str, text: &str) -> BTreeMap<String, (usize, String)> {
    let mut definitions = BTreeMap::new();
    let mut name = short_name(root);
    let mut first_line = 1;
    let mut body = String::new();
    let mut after_rule = false;
    for (index, line) in text.lines().enumerate() {
        let trimmed = line.trim();
        if trimmed.len() >= 3 && trimmed.bytes().all(|byte| byte == b'=') {
            after_rule = true;
            continue;
        }
        if after_rule && let Some(next) = trimmed.strip_prefix("MSG: ") {
            definitions
                .entry(std::mem::replace(&mut name, short_name(next.trim())))
                .or_insert((first_line, std::mem::take(&mut body)));
            first_line = index + 2;
            after_rule = false;
            continue;
        }
        after_rule = false;
        body.push_str(line);
        body.push('\n');
    }
    definitions.entry(name).or_insert((first_line, body));
    definitions
}

struct Builder {
    definitions: BTreeMap<String, (usize, String)>,
    done: BTreeMap<String, Arc<MessageSchema>>,
}

impl Builder {
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
        let Some((first_line, body)) = self.definitions.get(short).cloned() else {
            return Err(SchemaError::Missing {
                missing: short.to_owned(),
                needed_by: needed_by.to_owned(),
            });
        };
        above.push(short.to_owned());
        let mut fields: Vec<Field> = Vec::new();
        let mut constants = Vec::new();
        for (index, raw) in body.lines().enumerate() {
            let line = first_line + index;
            match parse_line(raw, line)? {
                Line::Nothing => {}
                Line::Constant(constant) => constants.push(constant),
                Line::Field { base, arity, name } => {
                    if fields.iter().any(|field| *field.name == *name) {
                        return Err(SchemaError::FieldTwice { line, name });
                    }
                    let field_type = match Primitive::from_name(&base) {
                        Some(primitive) => FieldType::Primitive(primitive),
                        None => {
                            let inner = self.resolve(&base, short);
                            FieldType::Message(self.message(&inner, short, above)?)
                        }
                    };
                    fields.push(Field { name: name.into(), field_type, arity });
                }
            }
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
        let message =
            Arc::new(MessageSchema { type_name: short.into(), fields, constants, size_min });
        self.done.insert(short.to_owned(), message.clone());
        Ok(message)
    }

    /// The short name of a type as a field of `within` names it.
    fn resolve(&self, base: &str, within: &str) -> String {
        if base.contains('/') {
            return short_name(base);
        }
        let package = within.split('/').next().unwrap_or_default();
        let neighbour = format!("{package}/{base}");
        // `Header` alone is std_msgs' by tradition, unless the package has its own.
        if base == "Header" && !self.definitions.contains_key(&neighbour) {
            return "std_msgs/Header".to_owned();
        }
        neighbour
    }
}

enum Line {
    Nothing,
    Constant(Constant),
    Field { base: String, arity: Arity, name: String },
}

fn parse_line(raw: &str, line: usize) -> Result<Line, SchemaError> {
    let text = raw.trim();
    let without_comment = text.split('#').next().unwrap_or_default().trim();
    if without_comment.is_empty() {
        return Ok(Line::Nothing);
    }
    let not_a_field = || SchemaError::Field { line, text: shortened(text) };
    let (type_text, rest) =
        without_comment.split_once(char::is_whitespace).ok_or_else(not_a_field)?;
    let rest = rest.trim_start();
    let name_end =
        rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(rest.len());
    let (name, after) = rest.split_at(name_end);
    if name.is_empty() || name.starts_with(|c: char| c.is_ascii_digit()) {
        return Err(not_a_field());
    }
    if after.trim_start().starts_with('=') {
        // The value of a text constant may hold a number sign.
        let value = if type_text.starts_with("string") {
            text.split_once('=').map_or("", |(_, value)| value)
        } else {
            after.split_once('=').map_or("", |(_, value)| value)
        };
        return Ok(Line::Constant(Constant {
            name: name.to_owned(),
            value: value.trim().to_owned(),
        }));
    }
    // Anything else after the name and a space is a default value.
    if !after.is_empty() && !after.starts_with(char::is_whitespace) {
        return Err(not_a_field());
    }
    let (base, arity) = parse_type(type_text)
        .ok_or_else(|| SchemaError::Type { line, text: shortened(type_text) })?;
    Ok(Line::Field { base, arity, name: name.to_owned() })
}

/// Parses `string<=10[<=5]`. Bounds do not change the wire format.
fn parse_type(text: &str) -> Option<(String, Arity)> {
    let (element, arity) = match text.strip_suffix(']') {
        None => (text, Arity::One),
        Some(open) => {
            let (element, length) = open.rsplit_once('[')?;
            let arity = if length.is_empty() {
                Arity::Sequence
            } else if let Some(bound) = length.strip_prefix("<=") {
                bound.parse::<u32>().ok()?;
                Arity::Sequence
            } else {
                // ROS has no arrays without elements, and they would take memory without any bytes.
                Arity::Array(length.parse::<u32>().ok().filter(|&length| length > 0)? as usize)
            };
            (element, arity)
        }
    };
    let base = match element.split_once("<=") {
        Some((base @ ("string" | "wstring"), bound)) => {
            bound.parse::<u32>().ok()?;
            base
        }
        Some(_) => return None,
        None => element,
    };
    let is_word = |part: &str| {
        !part.is_empty() && part.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
    };
    let parts = base.split('/').count();
    (parts <= 3 && base.split('/').all(is_word)).then(|| (base.to_owned(), arity))
}

fn shortened(text: &str) -> String {
    text.chars().take(60).collect()
}
