//! Writes the code: wire structs, the table of schemas, the list of messages.
//!
//! One struct per message, laid out as the definition is, so that serde meets
//! the fields in the order of CDR. Field names are those of ROS, except that a
//! Rust keyword gets an underscore after it.

use std::collections::BTreeMap;
use std::fmt::Write;

use rosidl::definition::{BaseType, Constant, Definition, DefinitionRole, FieldDefinition};
use rosidl::name::{InterfaceKind, TypeName};
use rosidl::registry::Registry;
use rosidl::types::{Arity, Primitive};
use rosidl::{InterfaceError, schema_text, type_hash};

use super::literal::{self, Literal, LiteralType};

/// Why reading a literal cannot fail: [`super::strict`] has read it before.
const CHECKED: &str = "all values were checked before any code is written";

/// The longest array for which serde and `Default` have implementations.
const LONGEST_ARRAY: usize = 32;

/// The modules of all packages with their structs.
///
/// # Errors
/// Definitions that have no Rust counterpart.
pub fn wire(registry: &Registry) -> Result<String, Vec<InterfaceError>> {
    let mut modules: BTreeMap<(&str, InterfaceKind), String> = BTreeMap::new();
    let mut refusals = Vec::new();
    for definition in registry.iter() {
        let name = &definition.name;
        let out = modules.entry((&name.package, name.kind)).or_default();
        match definition.role {
            DefinitionRole::Message => message(out, definition, &mut refusals),
            DefinitionRole::Service => marker(out, definition, "Service", &["Request", "Response"]),
            DefinitionRole::Action => {
                marker(out, definition, "Action", &["Goal", "Result", "Feedback"])
            }
            DefinitionRole::Event => {}
        }
    }
    if !refusals.is_empty() {
        return Err(refusals);
    }
    let mut text = String::new();
    let mut package = "";
    for ((of, kind), body) in &modules {
        if *of != package {
            text.push_str(if package.is_empty() { "" } else { "}\n" });
            line(&mut text, &format!("/// Package `{of}`.\npub mod {of} {{"));
            package = of;
        }
        let folder = kind.folder();
        line(&mut text, &format!("/// From `{of}/{folder}`.\npub mod {folder} {{\n{body}}}"));
    }
    text.push_str("}\n");
    Ok(text)
}

/// The rows of the table of schemas, sorted by name.
pub fn schemas(registry: &Registry) -> String {
    let mut text = String::from("&[\n");
    for definition in registry.iter() {
        let schema = schema_text::of(definition, registry);
        let hash = type_hash::rihs01(definition, registry);
        let description = type_hash::json(definition, registry);
        line(
            &mut text,
            &format!(
                "TypeInfo {{ name: {:?}, schema_text: {schema:?}, rihs01: {hash:?}, description: {description:?} }},",
                definition.name.to_string()
            ),
        );
    }
    text.push(']');
    text
}

/// A macro that passes the names and types of all messages to another macro.
pub fn every_message(registry: &Registry) -> String {
    let mut rows = String::new();
    for definition in
        registry.iter().filter(|definition| definition.role == DefinitionRole::Message)
    {
        let path = rust_path(&definition.name, "$crate");
        line(&mut rows, &format!("{:?} => {path},", definition.name.to_string()));
    }
    format!(
        "/// Calls `$callback!` once with `\"pkg/msg/Type\" => path::to::Type,` for every message.\n\
         #[macro_export]\nmacro_rules! for_every_message {{\n\
         ($callback:ident) => {{ $callback! {{\n{rows}}} }};\n}}\n"
    )
}

fn message(out: &mut String, definition: &Definition, refusals: &mut Vec<InterfaceError>) {
    let name = struct_name(&definition.name);
    let has_defaults = definition.fields.iter().any(|field| !field.default.is_empty());
    doc(out, &definition.doc, &format!("`{}`.", definition.name));
    let derived = if has_defaults { "" } else { "Default, " };
    line(
        out,
        &format!(
            "#[derive(Debug, Clone, PartialEq, {derived}::serde::Serialize, ::serde::Deserialize)]\npub struct {name} {{"
        ),
    );
    for field in &definition.fields {
        if let Arity::Array(count) = field.arity
            && count > LONGEST_ARRAY
        {
            refusals.push(InterfaceError {
                file: definition.file.clone(),
                line: field.line,
                message: format!(
                    "{}: arrays of more than {LONGEST_ARRAY} elements are not made; take a sequence [<={count}]",
                    field.name
                ),
            });
        }
        struct_field(out, field);
    }
    out.push_str("}\n");
    let fields: Vec<_> = definition.fields.iter().map(|field| field_name(&field.name).0).collect();
    line(out, &format!("crate::cdr_struct!({name} {{ {} }});", fields.join(", ")));
    if has_defaults {
        default(out, &name, &definition.fields);
    }
    if !definition.constants.is_empty() {
        line(out, &format!("impl {name} {{"));
        for item in &definition.constants {
            constant(out, item);
        }
        out.push_str("}\n");
    }
    line(
        out,
        &format!(
            "impl crate::interface::Message for {name} {{\nconst TYPE_NAME: &'static str = {:?};\n}}",
            definition.name.to_string()
        ),
    );
}

fn struct_field(out: &mut String, field: &FieldDefinition) {
    let mut notes = field.doc.clone();
    if let Some(bound) = field.bounds.text {
        notes.push(format!("At most {bound} bytes."));
    }
    if let Some(bound) = field.bounds.elements {
        notes.push(format!("At most {bound} element{}.", if bound == 1 { "" } else { "s" }));
    }
    doc(out, &notes, "");
    let (name, is_renamed) = field_name(&field.name);
    if is_renamed {
        line(out, &format!("#[serde(rename = {:?})]", field.name));
    }
    let base = base_type(&field.base);
    let of = match field.arity {
        Arity::One => base,
        Arity::Array(count) => format!("[{base}; {count}]"),
        Arity::Sequence => {
            if base == "u8" {
                // One copy instead of a call per byte; the bytes are the same.
                line(out, "#[serde(with = \"::serde_bytes\")]");
            }
            format!("::std::vec::Vec<{base}>")
        }
    };
    line(out, &format!("pub {name}: {of},"));
}

fn default(out: &mut String, name: &str, fields: &[FieldDefinition]) {
    line(out, &format!("impl Default for {name} {{\nfn default() -> Self {{\nSelf {{"));
    for field in fields {
        let value = match field.default.as_str() {
            "" => "::std::default::Default::default()".into(),
            text => {
                let of = LiteralType::of_field(field).expect(CHECKED);
                let value = literal::parse(text, of).expect(CHECKED);
                rust_literal(&value, of)
            }
        };
        line(out, &format!("{}: {value},", field_name(&field.name).0));
    }
    out.push_str("}\n}\n}\n");
}

fn constant(out: &mut String, constant: &Constant) {
    doc(out, &constant.doc, "");
    let of = LiteralType::parse(&constant.type_text).expect(CHECKED);
    let (rust_type, value) = match literal::parse(&constant.value, of).expect(CHECKED) {
        Literal::Text(text) => ("&'static str", format!("{text:?}")),
        value => (rust_primitive(of.primitive), rust_literal(&value, of)),
    };
    line(out, &format!("pub const {}: {rust_type} = {value};", constant.name));
}

fn rust_literal(value: &Literal, of: LiteralType) -> String {
    match value {
        Literal::Bool(value) => value.to_string(),
        Literal::Integer(value) => value.to_string(),
        Literal::Float(value) if of.primitive == Primitive::F32 => format!("{value:?}_f32"),
        Literal::Float(value) => format!("{value:?}_f64"),
        Literal::Text(text) => format!("::std::string::String::from({text:?})"),
        Literal::List(values) => {
            let values: Vec<_> = values.iter().map(|value| rust_literal(value, of)).collect();
            let start = if matches!(of.arity, Arity::Array(_)) { "[" } else { "::std::vec![" };
            format!("{start}{}]", values.join(", "))
        }
    }
}

/// An empty type that stands for a service or an action.
fn marker(out: &mut String, definition: &Definition, of: &str, parts: &[&str]) {
    let name = struct_name(&definition.name);
    doc(out, &definition.doc, &format!("`{}`.", definition.name));
    line(
        out,
        &format!(
            "#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]\npub struct {name};\nimpl crate::interface::{of} for {name} {{"
        ),
    );
    for part in parts {
        line(out, &format!("type {part} = {name}{part};"));
    }
    line(out, &format!("const TYPE_NAME: &'static str = {:?};\n}}", definition.name.to_string()));
}

fn doc(out: &mut String, lines: &[String], otherwise: &str) {
    if lines.is_empty() && !otherwise.is_empty() {
        line(out, &format!("/// {otherwise}"));
    }
    for text in lines {
        line(out, &format!("/// {text}"));
    }
}

fn line(out: &mut String, text: &str) {
    writeln!(out, "{text}").expect("a String takes everything");
}

fn base_type(base: &BaseType) -> String {
    match base {
        BaseType::Primitive(primitive) => rust_primitive(*primitive).into(),
        BaseType::Message(name) => rust_path(name, "crate"),
    }
}

/// The Rust type of a field of this type.
fn rust_primitive(primitive: Primitive) -> &'static str {
    match primitive {
        Primitive::Bool => "bool",
        Primitive::Byte | Primitive::Char | Primitive::U8 => "u8",
        Primitive::I8 => "i8",
        Primitive::I16 => "i16",
        Primitive::U16 => "u16",
        Primitive::I32 => "i32",
        Primitive::U32 => "u32",
        Primitive::I64 => "i64",
        Primitive::U64 => "u64",
        Primitive::F32 => "f32",
        Primitive::F64 => "f64",
        Primitive::String | Primitive::WideString => "::std::string::String",
    }
}

fn rust_path(name: &TypeName, root: &str) -> String {
    format!("{root}::wire::{}::{}::{}", name.package, name.kind.folder(), struct_name(name))
}

/// `LoadProgram_Request` is `LoadProgramRequest`.
fn struct_name(name: &TypeName) -> String {
    name.name.replace('_', "")
}

/// The field's name in Rust, and whether it differs from the name in ROS.
fn field_name(name: &str) -> (String, bool) {
    const KEYWORDS: &[&str] = &[
        "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate",
        "do", "dyn", "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl",
        "in", "let", "loop", "macro", "match", "mod", "move", "mut", "override", "priv", "pub",
        "ref", "return", "self", "static", "struct", "super", "trait", "true", "try", "type",
        "typeof", "unsafe", "unsized", "use", "virtual", "where", "while", "yield",
    ];
    match KEYWORDS.contains(&name) {
        true => (format!("{name}_"), true),
        false => (name.into(), false),
    }
}
