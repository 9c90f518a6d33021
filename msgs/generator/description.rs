//! RIHS01: the hash by which ROS 2 peers tell whether they mean the same type.
//!
//! It is the SHA-256 of a JSON text: the fields of the type and of all types
//! that it needs, with names and type numbers, without constants, defaults and
//! comments. Spaces and the order of keys are part of it. The numbers are
//! those of `type_description_interfaces/msg/FieldType`.

use std::collections::BTreeMap;
use std::fmt::Write;

use sha2::{Digest, Sha256};

use super::model::{Base, Definition, Field, Primitive, Shape};
use super::registry::Registry;

/// The hash as ROS writes it: `RIHS01_` and 64 hex digits.
pub fn rihs01(definition: &Definition, registry: &Registry) -> String {
    let mut text = String::from("RIHS01_");
    for byte in Sha256::digest(json(definition, registry)) {
        write!(text, "{byte:02x}").expect("a String takes everything");
    }
    text
}

/// The text that is hashed.
pub fn json(definition: &Definition, registry: &Registry) -> String {
    let mut needed = BTreeMap::new();
    collect(definition, registry, &mut needed);
    let needed: Vec<String> = needed.into_values().map(individual).collect();
    format!(
        r#"{{"type_description": {}, "referenced_type_descriptions": [{}]}}"#,
        individual(definition),
        needed.join(", ")
    )
}

/// All types that a definition needs, sorted by name, without itself.
fn collect<'a>(
    definition: &Definition,
    registry: &'a Registry,
    needed: &mut BTreeMap<String, &'a Definition>,
) {
    for (_, name) in definition.references() {
        let referenced = registry.expect(name);
        if needed.insert(name.to_string(), referenced).is_none() {
            collect(referenced, registry, needed);
        }
    }
}

fn individual(definition: &Definition) -> String {
    let fields: Vec<String> = definition.fields.iter().map(field).collect();
    format!(r#"{{"type_name": "{}", "fields": [{}]}}"#, definition.name, fields.join(", "))
}

fn field(field: &Field) -> String {
    let (offset, capacity) = match field.shape {
        Shape::Single => (0, 0),
        Shape::Array(count) => (48, count),
        Shape::Sequence { bound: Some(bound) } => (96, bound),
        Shape::Sequence { bound: None } => (144, 0),
    };
    let (base, text_capacity, nested) = match &field.base {
        Base::Primitive(primitive) => (primitive_id(*primitive), 0, String::new()),
        Base::Text { bound: None } => (17, 0, String::new()),
        Base::Text { bound: Some(bound) } => (21, *bound, String::new()),
        Base::Message(name) => (1, 0, name.to_string()),
    };
    format!(
        r#"{{"name": "{}", "type": {{"type_id": {}, "capacity": {capacity}, "string_capacity": {text_capacity}, "nested_type_name": "{nested}"}}}}"#,
        field.name,
        base + offset
    )
}

fn primitive_id(primitive: Primitive) -> usize {
    match primitive {
        Primitive::I8 => 2,
        // `char` has a number of its own, but rosidl hashes it as uint8.
        Primitive::U8 | Primitive::Char => 3,
        Primitive::I16 => 4,
        Primitive::U16 => 5,
        Primitive::I32 => 6,
        Primitive::U32 => 7,
        Primitive::I64 => 8,
        Primitive::U64 => 9,
        Primitive::F32 => 10,
        Primitive::F64 => 11,
        Primitive::Bool => 15,
        Primitive::Byte => 16,
    }
}
