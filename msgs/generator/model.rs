//! What a definition consists of. No parsing, no output.

use super::name::TypeName;
use super::value::Value;

/// Types that ROS builds in, apart from text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Primitive {
    Bool,
    /// A byte without a meaning as a number.
    Byte,
    /// Eight bits, unsigned; rosidl makes `uint8` of it.
    Char,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Primitive {
    /// The primitive with this name in interface files.
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "bool" => Self::Bool,
            "byte" => Self::Byte,
            "char" => Self::Char,
            "int8" => Self::I8,
            "uint8" => Self::U8,
            "int16" => Self::I16,
            "uint16" => Self::U16,
            "int32" => Self::I32,
            "uint32" => Self::U32,
            "int64" => Self::I64,
            "uint64" => Self::U64,
            "float32" => Self::F32,
            "float64" => Self::F64,
            _ => return None,
        })
    }

    /// The Rust type that holds it.
    pub fn rust(self) -> &'static str {
        match self {
            Self::Bool => "bool",
            Self::Byte | Self::Char | Self::U8 => "u8",
            Self::I8 => "i8",
            Self::I16 => "i16",
            Self::U16 => "u16",
            Self::I32 => "i32",
            Self::U32 => "u32",
            Self::I64 => "i64",
            Self::U64 => "u64",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }
}

/// What one element of a field is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Base {
    Primitive(Primitive),
    /// `string`, or `string<=bound` with the bound in bytes.
    Text {
        bound: Option<usize>,
    },
    Message(TypeName),
}

/// How many elements a field has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    Single,
    /// `[n]`: always n.
    Array(usize),
    /// `[]` or `[<=bound]`.
    Sequence {
        bound: Option<usize>,
    },
}

/// A field of a message.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    pub name: String,
    pub base: Base,
    pub shape: Shape,
    /// What a new message holds, where that is not zero, false or empty.
    pub default: Option<Value>,
    /// Comment lines.
    pub doc: Vec<String>,
    /// Line in the file, from 1.
    pub line: usize,
}

impl Field {
    /// A single field of another type, as rosidl derives them.
    pub fn derived(name: &str, of: TypeName) -> Self {
        Self {
            name: name.into(),
            base: Base::Message(of),
            shape: Shape::Single,
            default: None,
            doc: Vec::new(),
            line: 0,
        }
    }
}

/// A named value beside the fields.
#[derive(Debug, Clone, PartialEq)]
pub struct Constant {
    pub name: String,
    pub base: Base,
    pub value: Value,
    pub doc: Vec<String>,
    pub line: usize,
}

/// What a definition is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Travels on the wire.
    Message,
    /// What service introspection publishes. Needed for the hash of its
    /// service; nothing here sends one, so no struct is made.
    Event,
    /// A service as a whole: its fields name request, response and event.
    Service,
    /// An action as a whole: its fields name all that belongs to it.
    Action,
}

/// A type with all that is known of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Definition {
    pub name: TypeName,
    pub role: Role,
    /// Comment lines at the head of the file.
    pub doc: Vec<String>,
    /// Never empty: ROS gives an empty message a member of one byte.
    pub fields: Vec<Field>,
    pub constants: Vec<Constant>,
    /// The text that it was read from, verbatim.
    pub text: String,
    /// Path of the file that it comes from, from the package folder.
    pub file: String,
}

impl Definition {
    /// Types of its fields, each as often as it is used.
    pub fn references(&self) -> impl Iterator<Item = (&Field, &TypeName)> {
        self.fields.iter().filter_map(|field| match &field.base {
            Base::Message(name) => Some((field, name)),
            _ => None,
        })
    }
}
