//! Literals: constants and defaults, within the bounds of their types.
//!
//! Stricter than rosidl where its generators disagree with each other: a
//! backslash only before a quote, no infinities.

use rosidl::definition::{BaseType, FieldDefinition};
use rosidl::types::{Arity, Primitive, TypeBounds, WrittenType};

/// A constant or a default.
#[derive(Debug, Clone, PartialEq)]
pub enum Literal {
    Bool(bool),
    Integer(i128),
    Float(f64),
    Text(String),
    List(Vec<Literal>),
}

/// The type that a literal must have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LiteralType {
    pub primitive: Primitive,
    pub arity: Arity,
    pub bounds: TypeBounds,
}

impl LiteralType {
    /// The type of a field's default; `None` for messages, which have no literals.
    pub fn of_field(field: &FieldDefinition) -> Option<Self> {
        let BaseType::Primitive(primitive) = field.base else { return None };
        Some(Self { primitive, arity: field.arity, bounds: field.bounds })
    }

    /// The type of the values of a written type; `None` for a message or an invalid type.
    pub fn parse(type_text: &str) -> Option<Self> {
        let WrittenType { base, arity, bounds } = WrittenType::parse(type_text).ok()?;
        Some(Self { primitive: Primitive::named(base)?, arity, bounds })
    }
}

/// Reads the value of a field or constant of this type.
pub fn parse(text: &str, of: LiteralType) -> Result<Literal, String> {
    let most = match of.arity {
        Arity::One => return parse_single(text, of),
        Arity::Array(count) => Some(count),
        Arity::Sequence => of.bounds.elements,
    };
    let inner = text.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
    let inner = inner.ok_or(format!("{text} is no list; write [first, second]"))?;
    let values = split_list(inner)?
        .into_iter()
        .map(|element| parse_single(element.trim(), of))
        .collect::<Result<Vec<_>, _>>()?;
    match (of.arity, most) {
        (Arity::Array(count), _) if values.len() != count => {
            Err(format!("{count} elements are needed, {} are there", values.len()))
        }
        (_, Some(bound)) if values.len() > bound => {
            Err(format!("at most {bound} elements are allowed, {} are there", values.len()))
        }
        _ => Ok(Literal::List(values)),
    }
}

fn parse_single(text: &str, of: LiteralType) -> Result<Literal, String> {
    match of.primitive {
        Primitive::Bool => match text.to_ascii_lowercase().as_str() {
            "true" | "1" => Ok(Literal::Bool(true)),
            "false" | "0" => Ok(Literal::Bool(false)),
            _ => Err(format!("{text:?} is neither true nor false")),
        },
        Primitive::F32 | Primitive::F64 => match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Literal::Float(value)),
            _ => Err(format!("{text:?} is no finite number")),
        },
        Primitive::String | Primitive::WideString => {
            let value = parse_text(text)?;
            match of.bounds.text {
                Some(bound) if value.len() > bound => {
                    Err(format!("{value:?} is longer than {bound} bytes"))
                }
                _ => Ok(Literal::Text(value)),
            }
        }
        primitive => {
            let value = parse_integer(text).ok_or(format!("{text:?} is not a whole number"))?;
            let (least, most) = integer_range(primitive);
            if value < least || value > most {
                return Err(format!("{value} does not fit; {least} to {most} do"));
            }
            Ok(Literal::Integer(value))
        }
    }
}

fn integer_range(primitive: Primitive) -> (i128, i128) {
    match primitive {
        Primitive::I8 => (i8::MIN.into(), i8::MAX.into()),
        Primitive::I16 => (i16::MIN.into(), i16::MAX.into()),
        Primitive::U16 => (0, u16::MAX.into()),
        Primitive::I32 => (i32::MIN.into(), i32::MAX.into()),
        Primitive::U32 => (0, u32::MAX.into()),
        Primitive::I64 => (i64::MIN.into(), i64::MAX.into()),
        Primitive::U64 => (0, u64::MAX.into()),
        _ => (0, u8::MAX.into()),
    }
}

fn parse_integer(text: &str) -> Option<i128> {
    let (negative, digits) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let (radix, digits) = match digits.get(..2) {
        Some("0x" | "0X") => (16, &digits[2..]),
        Some("0b" | "0B") => (2, &digits[2..]),
        Some("0o" | "0O") => (8, &digits[2..]),
        _ => (10, digits),
    };
    if !digits.starts_with(|c: char| c.is_ascii_hexdigit()) {
        return None;
    }
    let value = i128::from_str_radix(digits, radix).ok()?;
    Some(if negative { -value } else { value })
}

/// Text as it is, or in quotes of either sort with `\` before inner ones.
fn parse_text(text: &str) -> Result<String, String> {
    let Some(quote) = text.chars().next().filter(|c| matches!(c, '"' | '\'')) else {
        return match text.contains('\\') {
            true => Err(format!("{text} has a backslash, which generators read differently")),
            false => Ok(text.into()),
        };
    };
    let inner = text[1..].strip_suffix(quote).ok_or(format!(
        "{text} lacks the closing {quote}; ROS ends a line at #, even inside quotes"
    ))?;
    let mut value = String::new();
    let mut chars = inner.chars();
    while let Some(c) = chars.next() {
        match c {
            '\\' if chars.clone().next() == Some(quote) => value.extend(chars.next()),
            '\\' => {
                return Err(format!("{text} has a backslash before something else than {quote}"));
            }
            c if c == quote => return Err(format!("{text} has a {quote} inside; write \\{quote}")),
            c => value.push(c),
        }
    }
    Ok(value)
}

/// Splits at commas outside of quotes.
fn split_list(text: &str) -> Result<Vec<&str>, String> {
    if text.trim().is_empty() {
        return Ok(Vec::new());
    }
    let mut parts = Vec::new();
    let (mut start, mut quote, mut escaped) = (0, None, false);
    for (at, c) in text.char_indices() {
        match (quote, c) {
            _ if escaped => escaped = false,
            (Some(_), '\\') => escaped = true,
            (Some(open), c) if c == open => quote = None,
            (Some(_), _) => {}
            (None, '"' | '\'') => quote = Some(c),
            (None, ',') => {
                parts.push(&text[start..at]);
                start = at + 1;
            }
            (None, _) => {}
        }
    }
    if quote.is_some() {
        return Err(format!("[{text}] has an open quote"));
    }
    parts.push(&text[start..]);
    Ok(parts)
}
