//! Reads the text of a message, or of one section of a service or an action.
//!
//! Follows rosidl_adapter of Jazzy line by line, so that what is accepted here
//! is accepted by `colcon build`. Knows one text and no other; whether the
//! types that it names exist is for the registry to say.

use super::Refusal;
use super::model::{Base, Constant, Definition, Field, Primitive, Role, Shape};
use super::name::{self, TypeName};
use super::value;

/// A piece of a file.
#[derive(Debug, Clone, Copy)]
pub struct Section<'a> {
    /// Path of the file from the package folder.
    pub file: &'a str,
    /// Line of the file that `text` starts on, from 1.
    pub first_line: usize,
    pub text: &'a str,
}

/// Cuts a file at its `---` lines.
pub fn split<'a>(file: &'a str, text: &'a str) -> Vec<Section<'a>> {
    let mut sections = Vec::new();
    let (mut start, mut first_line, mut at) = (0, 1, 0);
    for (index, line) in text.split_inclusive('\n').enumerate() {
        if line.trim_end() == "---" {
            sections.push(Section { file, first_line, text: &text[start..at] });
            start = at + line.len();
            first_line = index + 2;
        }
        at += line.len();
    }
    sections.push(Section { file, first_line, text: &text[start..] });
    sections
}

/// Reads a section as the definition of `name`; all its faults at once.
pub fn parse(name: TypeName, section: Section<'_>) -> Result<Definition, Vec<Refusal>> {
    let mut reader = Reader::new(name, section);
    for (index, line) in section.text.lines().enumerate() {
        reader.read(section.first_line + index, line);
    }
    reader.finish()
}

/// What the last item was, for comments that follow it.
#[derive(Clone, Copy)]
enum Item {
    Field,
    Constant,
}

struct Reader<'a> {
    section: Section<'a>,
    definition: Definition,
    /// Comments that wait for the item below them.
    pending: Vec<String>,
    last: Option<Item>,
    refusals: Vec<Refusal>,
}

impl<'a> Reader<'a> {
    fn new(name: TypeName, section: Section<'a>) -> Self {
        let definition = Definition {
            name,
            role: Role::Message,
            doc: Vec::new(),
            fields: Vec::new(),
            constants: Vec::new(),
            text: section.text.into(),
            file: section.file.into(),
        };
        Self { section, definition, pending: Vec::new(), last: None, refusals: Vec::new() }
    }

    fn refuse(&mut self, line: usize, message: String) {
        self.refusals.push(Refusal { file: self.section.file.into(), line, message });
    }

    fn read(&mut self, number: usize, line: &str) {
        let line = line.replace('\t', " ");
        let line = line.trim_end();
        if line.is_empty() {
            return self.end_of_block();
        }
        let (code, comment) = match line.split_once('#') {
            Some((code, comment)) => (code, Some(comment.trim_start_matches('#'))),
            None => (line, None),
        };
        if let Some(comment) = comment {
            let comment = comment.strip_prefix(' ').unwrap_or(comment);
            if comment.len() >= 3 && comment.chars().all(|c| c == '=') {
                return self.refuse(number, "a comment of = alone splits the schema".into());
            }
            if !code.is_empty() && code.trim().is_empty() {
                return self.document_last(comment);
            }
            self.pending.push(comment.into());
        }
        let code = code.trim_end();
        if code.is_empty() {
            return;
        }
        if let Err(message) = self.read_item(number, code) {
            self.refuse(number, message);
        }
        self.pending.clear();
    }

    /// A blank line: comments above it speak of the file, if nothing came before.
    fn end_of_block(&mut self) {
        let pending = std::mem::take(&mut self.pending);
        if self.last.is_none() && self.definition.doc.is_empty() {
            self.definition.doc = pending;
        }
    }

    /// An indented comment goes on about the item above it.
    fn document_last(&mut self, comment: &str) {
        let doc = match self.last {
            Some(Item::Field) => self.definition.fields.last_mut().map(|field| &mut field.doc),
            Some(Item::Constant) => self.definition.constants.last_mut().map(|item| &mut item.doc),
            None => None,
        };
        if let Some(doc) = doc {
            doc.push(comment.into());
        }
    }

    fn read_item(&mut self, line: usize, code: &str) -> Result<(), String> {
        if code.starts_with(' ') {
            return Err("the line is indented; ROS wants the type in the first column".into());
        }
        let (type_text, rest) =
            code.split_once(' ').ok_or("a line is a type, a space and a name".to_string())?;
        let rest = rest.trim();
        let (base, shape) = parse_type(type_text, &self.definition.name)?;
        let doc = std::mem::take(&mut self.pending);
        if let Some((name, text)) = rest.split_once('=') {
            let name = name.trim_end().to_string();
            name::check_constant(&name)?;
            if shape != Shape::Single || matches!(base, Base::Message(_)) {
                return Err(format!("constant {name} must be a number, a bool or a string"));
            }
            if self.definition.constants.iter().any(|other| other.name == name) {
                return Err(format!("there is a constant {name} already"));
            }
            let value = value::parse(text.trim(), &base, shape)
                .map_err(|reason| format!("constant {name}: {reason}"))?;
            self.definition.constants.push(Constant { name, base, value, doc, line });
            self.last = Some(Item::Constant);
        } else {
            let (name, text) = rest.split_once(' ').unwrap_or((rest, ""));
            name::check_field(name)?;
            if self.definition.fields.iter().any(|other| other.name == name) {
                return Err(format!("there is a field {name} already"));
            }
            let default = match text.trim() {
                "" => None,
                text => Some(
                    value::parse(text, &base, shape)
                        .map_err(|reason| format!("default of {name}: {reason}"))?,
                ),
            };
            let name = name.to_string();
            self.definition.fields.push(Field { name, base, shape, default, doc, line });
            self.last = Some(Item::Field);
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Definition, Vec<Refusal>> {
        self.end_of_block();
        if self.definition.fields.is_empty() {
            self.definition.fields.push(Field {
                name: "structure_needs_at_least_one_member".into(),
                base: Base::Primitive(Primitive::U8),
                shape: Shape::Single,
                default: None,
                doc: vec!["What ROS puts into an empty message; always 0.".into()],
                line: 0,
            });
        }
        if self.refusals.is_empty() { Ok(self.definition) } else { Err(self.refusals) }
    }
}

/// Reads `uint8`, `string<=16[]`, `geometry_msgs/Point[<=3]`.
fn parse_type(text: &str, context: &TypeName) -> Result<(Base, Shape), String> {
    let (base, shape) = match text.strip_suffix(']') {
        None => (text, Shape::Single),
        Some(open) => {
            let (base, size) =
                open.rsplit_once('[').ok_or(format!("{text} closes a bracket it never opened"))?;
            let shape = match (size, size.strip_prefix("<=")) {
                ("", _) => Shape::Sequence { bound: None },
                (_, Some(bound)) => Shape::Sequence { bound: Some(parse_size(bound, text)?) },
                (count, None) => Shape::Array(parse_size(count, text)?),
            };
            (base, shape)
        }
    };
    let base = match base.split_once("<=") {
        Some(("string", bound)) => Base::Text { bound: Some(parse_size(bound, text)?) },
        Some((other, _)) => return Err(format!("only string can be bounded by <=, not {other}")),
        None => match (base, Primitive::named(base)) {
            (_, Some(primitive)) => Base::Primitive(primitive),
            ("string", _) => Base::Text { bound: None },
            ("wstring" | "wchar", _) => {
                return Err(format!("{base} is unknown to most readers of bags; take string"));
            }
            ("time" | "duration", _) => {
                return Err(format!("{base} is of ROS 1; take a type of builtin_interfaces"));
            }
            _ => Base::Message(TypeName::parse(base, context)?),
        },
    };
    Ok((base, shape))
}

fn parse_size(text: &str, whole: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(size) if size > 0 => Ok(size),
        _ => Err(format!("the size in {whole} is no whole number above 0")),
    }
}
