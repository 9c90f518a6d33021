//! RIHS01: the hash by which ROS 2 peers know whether they mean the same type.
//!
//! It is the SHA-256 of a JSON text: the fields of the type and of all types
//! that it needs, with names and type numbers, without constants, defaults and
//! comments. Spaces and the order of keys are part of it. The numbers are
//! those of `type_description_interfaces/msg/FieldType`.

use std::collections::BTreeMap;
use std::fmt::Write;

use sha2::{Digest, Sha256};

use crate::definition::{BaseType, Definition, FieldDefinition};
use crate::registry::Registry;
use crate::types::{Arity, Primitive};

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

fn field(field: &FieldDefinition) -> String {
    let (offset, capacity) = match (field.arity, field.bounds.elements) {
        (Arity::One, _) => (0, 0),
        (Arity::Array(count), _) => (48, count),
        (Arity::Sequence, Some(bound)) => (96, bound),
        (Arity::Sequence, None) => (144, 0),
    };
    let (type_id, nested) = match &field.base {
        BaseType::Primitive(primitive) => {
            (primitive_id(*primitive, field.bounds.text.is_some()), String::new())
        }
        BaseType::Message(name) => (1, name.to_string()),
    };
    format!(
        r#"{{"name": "{}", "type": {{"type_id": {}, "capacity": {capacity}, "string_capacity": {}, "nested_type_name": "{nested}"}}}}"#,
        field.name,
        type_id + offset,
        field.bounds.text.unwrap_or(0)
    )
}

fn primitive_id(primitive: Primitive, is_bounded: bool) -> usize {
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
        Primitive::String if is_bounded => 21,
        Primitive::String => 17,
        Primitive::WideString if is_bounded => 22,
        Primitive::WideString => 18,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interface_file::InterfaceFile;
    use crate::name::{InterfaceKind, TypeName};

    #[test]
    fn the_text_that_is_hashed_has_no_defaults_and_sorts_what_it_needs() {
        let file = |name: &str, text: &str| InterfaceFile {
            name: TypeName::new("p", InterfaceKind::Msg, name),
            path: format!("{name}.msg"),
            text: text.into(),
        };
        let registry = Registry::from_files(&[
            file("B", "string<=5[<=2] s\n"),
            file("A", "uint8 X=1\nbool b true\n"),
            file("Root", "B[2] b\nA a\n"),
        ])
        .expect("valid");
        let root = registry.expect(&TypeName::new("p", InterfaceKind::Msg, "Root"));
        assert_eq!(
            json(root, &registry),
            concat!(
                r#"{"type_description": {"type_name": "p/msg/Root", "fields": ["#,
                r#"{"name": "b", "type": {"type_id": 49, "capacity": 2, "string_capacity": 0, "nested_type_name": "p/msg/B"}}, "#,
                r#"{"name": "a", "type": {"type_id": 1, "capacity": 0, "string_capacity": 0, "nested_type_name": "p/msg/A"}}]}, "#,
                r#""referenced_type_descriptions": [{"type_name": "p/msg/A", "fields": ["#,
                r#"{"name": "b", "type": {"type_id": 15, "capacity": 0, "string_capacity": 0, "nested_type_name": ""}}]}, "#,
                r#"{"type_name": "p/msg/B", "fields": ["#,
                r#"{"name": "s", "type": {"type_id": 117, "capacity": 2, "string_capacity": 5, "nested_type_name": ""}}]}]}"#,
            )
        );
    }
}
