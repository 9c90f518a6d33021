//! One definition: a message, or one section of a service or an action, with its comments.
//!
//! Reads one text. The [`crate::registry`] checks that the types it names exist.

use crate::interface_error::InterfaceError;
use crate::interface_file::Section;
use crate::name::{TypeName, check_field};
use crate::syntax::{self, LineError, LineItem, SourceLine};
use crate::types::{Arity, Primitive, TypeBounds, WrittenType};

/// What one element of a field is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BaseType {
    Primitive(Primitive),
    Message(TypeName),
}

/// A field with everything that its definition says about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FieldDefinition {
    pub name: String,
    pub base: BaseType,
    pub arity: Arity,
    pub bounds: TypeBounds,
    /// What a new message holds, as written; empty where that is zero, false or empty.
    pub default: String,
    /// Comment lines.
    pub doc: Vec<String>,
    /// Line in the file, from 1.
    pub line: usize,
}

impl FieldDefinition {
    /// A single field of another type, as rosidl derives them.
    pub(crate) fn derived(name: &str, of: TypeName) -> Self {
        Self {
            name: name.into(),
            base: BaseType::Message(of),
            arity: Arity::One,
            bounds: TypeBounds::default(),
            default: String::new(),
            doc: Vec::new(),
            line: 0,
        }
    }
}

/// A named value; not on the wire.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Constant {
    /// As written: `uint8`.
    pub type_text: String,
    pub name: String,
    /// As written.
    pub value: String,
    /// Comment lines.
    pub doc: Vec<String>,
}

/// What a definition is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DefinitionRole {
    /// Travels on the wire.
    Message,
    /// What service introspection publishes. The hash of its service needs it.
    Event,
    /// A service as a whole: its fields name request, response and event.
    Service,
    /// An action as a whole: its fields name all that belongs to it.
    Action,
}

/// A type with everything known about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Definition {
    pub name: TypeName,
    pub role: DefinitionRole,
    /// Comment lines at the head of the file.
    pub doc: Vec<String>,
    /// Never empty: ROS gives an empty message a member of one byte.
    pub fields: Vec<FieldDefinition>,
    pub constants: Vec<Constant>,
    /// The text that it was read from, verbatim.
    pub text: String,
    /// Path of the file that it comes from, from the package folder.
    pub file: String,
}

impl Definition {
    /// Types of its fields, each as often as it is used.
    pub fn references(&self) -> impl Iterator<Item = (&FieldDefinition, &TypeName)> {
        self.fields.iter().filter_map(|field| match &field.base {
            BaseType::Message(name) => Some((field, name)),
            BaseType::Primitive(_) => None,
        })
    }
}

impl Section<'_> {
    /// Reads the section as the definition of `name`.
    ///
    /// # Errors
    /// All lines that are wrong.
    pub(crate) fn read(self, name: TypeName) -> Result<Definition, Vec<InterfaceError>> {
        let mut reader = DefinitionReader {
            definition: Definition {
                name,
                role: DefinitionRole::Message,
                doc: Vec::new(),
                fields: Vec::new(),
                constants: Vec::new(),
                text: self.text.into(),
                file: self.file.into(),
            },
            pending: Vec::new(),
            last: None,
        };
        let mut refusals = Vec::new();
        for line in syntax::lines(self.text) {
            let number = self.first_line + line.number - 1;
            if let Err(message) = reader.read(number, line) {
                refusals.push(InterfaceError { file: self.file.into(), line: number, message });
            }
        }
        if refusals.is_empty() { Ok(reader.finish()) } else { Err(refusals) }
    }
}

/// The kind of the last item, for comments that follow it.
#[derive(Clone, Copy)]
enum LastItem {
    Field,
    Constant,
}

struct DefinitionReader {
    definition: Definition,
    /// Comments that wait for the item below them.
    pending: Vec<String>,
    last: Option<LastItem>,
}

impl DefinitionReader {
    fn read(&mut self, number: usize, line: SourceLine<'_>) -> Result<(), String> {
        if let Some(comment) = line.comment {
            let comment = comment.replace('\t', " ");
            let comment = comment.strip_prefix(' ').unwrap_or(&comment).to_owned();
            if line.item.is_none() && !line.code.is_empty() {
                self.document_last(comment);
                return Ok(());
            }
            self.pending.push(comment);
        } else if line.item.is_none() {
            self.end_of_block();
        }
        let Some(item) = line.item else { return Ok(()) };
        let doc = std::mem::take(&mut self.pending);
        let item = item.map_err(|error| match error {
            LineError::NoName => error.to_string(),
            LineError::Name(name) => check_field(&name).err().unwrap_or_default(),
        })?;
        match item {
            LineItem::Field { type_text, name, default } => {
                let WrittenType { base, arity, bounds } =
                    WrittenType::parse(type_text).map_err(|error| error.to_string())?;
                let base = match Primitive::named(base) {
                    Some(primitive) => BaseType::Primitive(primitive),
                    None => BaseType::Message(TypeName::parse(base, &self.definition.name)?),
                };
                if self.definition.fields.iter().any(|other| other.name == name) {
                    return Err(format!("there is a field {name} already"));
                }
                let (name, default) = (name.into(), default.into());
                let field =
                    FieldDefinition { name, base, arity, bounds, default, doc, line: number };
                self.definition.fields.push(field);
                self.last = Some(LastItem::Field);
            }
            LineItem::Constant { type_text, name, value } => {
                let (type_text, name, value) = (type_text.into(), name.into(), value.into());
                self.definition.constants.push(Constant { type_text, name, value, doc });
                self.last = Some(LastItem::Constant);
            }
        }
        Ok(())
    }

    /// A blank line: comments above it describe the file, if no item came before.
    fn end_of_block(&mut self) {
        let pending = std::mem::take(&mut self.pending);
        if self.last.is_none() && self.definition.doc.is_empty() {
            self.definition.doc = pending;
        }
    }

    /// An indented comment continues the one of the item above it.
    fn document_last(&mut self, comment: String) {
        let doc = match self.last {
            Some(LastItem::Field) => self.definition.fields.last_mut().map(|field| &mut field.doc),
            Some(LastItem::Constant) => {
                self.definition.constants.last_mut().map(|constant| &mut constant.doc)
            }
            None => None,
        };
        if let Some(doc) = doc {
            doc.push(comment);
        }
    }

    fn finish(mut self) -> Definition {
        self.end_of_block();
        if self.definition.fields.is_empty() {
            self.definition.fields.push(FieldDefinition {
                name: "structure_needs_at_least_one_member".into(),
                base: BaseType::Primitive(Primitive::U8),
                arity: Arity::One,
                bounds: TypeBounds::default(),
                default: String::new(),
                doc: vec!["What ROS puts into an empty message; always 0.".into()],
                line: 0,
            });
        }
        self.definition
    }
}
