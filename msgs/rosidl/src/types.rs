//! Types as interface files write them: `uint8`, `string<=16[]`, `geometry_msgs/Point[<=3]`.
//!
//! Knows the primitives of ROS 2 and the form of a type. Does not know which messages exist.

/// A type that ROS builds in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Primitive {
    Bool,
    /// A byte without a meaning as a number; `uint8` on the wire.
    Byte,
    /// Eight bits, unsigned: rosidl makes `uint8` of it.
    Char,
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
    /// The primitive with this name in interface files.
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "bool" => Self::Bool,
            "byte" => Self::Byte,
            "char" => Self::Char,
            "uint8" => Self::U8,
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

    /// The primitive with the same bytes that is a number: `uint8` for `byte` and `char`.
    pub fn on_the_wire(self) -> Self {
        match self {
            Self::Byte | Self::Char => Self::U8,
            other => other,
        }
    }

    /// The fewest bytes that one takes on the wire.
    pub fn size_min(self) -> usize {
        match self {
            Self::Bool | Self::Byte | Self::Char | Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 | Self::String | Self::WideString => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
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
    /// A count, then that many elements.
    Sequence,
}

/// The largest sizes that a type allows. They are not on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TypeBounds {
    /// Bytes of a text: the 16 in `string<=16`.
    pub text: Option<usize>,
    /// Elements of a sequence: the 3 in `Point[<=3]`.
    pub elements: Option<usize>,
}

/// A type, taken apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WrittenType<'a> {
    /// The name of a primitive, or that of a message in up to three parts.
    pub base: &'a str,
    pub arity: Arity,
    pub bounds: TypeBounds,
}

/// Why a text is not a type.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TypeError {
    #[error("{0} closes a bracket it never opened")]
    Bracket(String),
    #[error("the size in {0} is not a whole number above 0")]
    Size(String),
    #[error("only string can be bounded by <=, not {0}")]
    Bound(String),
    #[error("{0} is not a type; write package/Type")]
    Name(String),
}

impl<'a> WrittenType<'a> {
    /// Takes `string<=16[<=5]` apart.
    pub fn parse(text: &'a str) -> Result<Self, TypeError> {
        let size = |digits: &str| match digits.parse::<u32>() {
            Ok(size) => Ok(size as usize),
            Err(_) => Err(TypeError::Size(text.to_owned())),
        };
        let mut bounds = TypeBounds::default();
        let (element, arity) = match text.strip_suffix(']') {
            None => (text, Arity::One),
            Some(open) => {
                let (element, length) =
                    open.rsplit_once('[').ok_or_else(|| TypeError::Bracket(text.to_owned()))?;
                let arity = if length.is_empty() {
                    Arity::Sequence
                } else if let Some(bound) = length.strip_prefix("<=") {
                    bounds.elements = Some(size(bound)?);
                    Arity::Sequence
                } else {
                    match size(length)? {
                        // ROS has no empty arrays, and they would take memory without any bytes.
                        0 => return Err(TypeError::Size(text.to_owned())),
                        length => Arity::Array(length),
                    }
                };
                (element, arity)
            }
        };
        let base = match element.split_once("<=") {
            Some((base @ ("string" | "wstring"), bound)) => {
                bounds.text = Some(size(bound)?);
                base
            }
            Some((other, _)) => return Err(TypeError::Bound(other.to_owned())),
            None => element,
        };
        let is_word = |part: &str| {
            !part.is_empty() && part.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
        };
        if base.split('/').count() > 3 || !base.split('/').all(is_word) {
            return Err(TypeError::Name(base.to_owned()));
        }
        Ok(Self { base, arity, bounds })
    }
}
