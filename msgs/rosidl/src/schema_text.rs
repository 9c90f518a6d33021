//! The `ros2msg` text of a type with all that it needs, as bags carry it.
//!
//! The definition of the type comes first; each type that it needs follows after a line of
//! equals signs and a line `MSG: package/Type`.

use std::collections::{BTreeMap, BTreeSet};

use crate::definition::{Definition, DefinitionRole};
use crate::interface_error::InterfaceError;
use crate::interface_file::InterfaceFile;
use crate::name::TypeName;
use crate::registry::Registry;
use crate::syntax::{self, LineItem};
use crate::types::{Primitive, WrittenType};

/// The line between two definitions, as rosbag2 writes it.
const RULE: &str =
    "================================================================================";

/// One definition of a schema text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SchemaPart<'a> {
    /// As the text names it: `package/Type` in most texts.
    pub name: &'a str,
    /// Line of the schema text that `text` begins on, from 1.
    pub first_line: usize,
    /// The definition, exactly as [`push_part`] wrote it.
    pub text: &'a str,
}

/// Cuts a schema text into its definitions; the first one is that of `root`.
///
/// A line of three equals signs is enough: some writers have shorter ones.
pub fn parts<'a>(root: &'a str, text: &'a str) -> Vec<SchemaPart<'a>> {
    let mut parts = Vec::new();
    let mut part = SchemaPart { name: root, first_line: 1, text: "" };
    let (mut start, mut at) = (0, 0);
    let mut rule_above = None;
    for (index, line) in text.split_inclusive('\n').enumerate() {
        match (rule_above, line.trim().strip_prefix("MSG: ")) {
            (Some(end), Some(name)) => {
                let body = &text[start..end];
                parts.push(SchemaPart { text: body.strip_suffix('\n').unwrap_or(body), ..part });
                part = SchemaPart { name: name.trim(), first_line: index + 2, text: "" };
                start = at + line.len();
                rule_above = None;
            }
            _ => rule_above = is_rule(line.trim()).then_some(at),
        }
        at += line.len();
    }
    parts.push(SchemaPart { text: &text[start..], ..part });
    parts
}

/// Adds the definition of a needed type to a schema text. `name` is its `package/Type`.
pub fn push_part(text: &mut String, name: &str, definition: &str) {
    for piece in ["\n", RULE, "\nMSG: ", name, "\n", definition] {
        text.push_str(piece);
    }
}

/// The schema text of a type, as rosbag2 writes it.
///
/// The types that it names follow depth first, each once, in the order of their two-part names.
/// Derived types, which rosbag2 cannot find, are written in the same form.
pub fn of(definition: &Definition, registry: &Registry) -> String {
    let mut text = String::new();
    append(definition, registry, &mut BTreeSet::new(), &mut text);
    text
}

fn append(
    definition: &Definition,
    registry: &Registry,
    seen: &mut BTreeSet<String>,
    text: &mut String,
) {
    text.push_str(&definition.text);
    for (two_part, name) in named_in_text(definition, registry) {
        if seen.insert(two_part.clone()) {
            push_part(text, &two_part, "");
            append(registry.expect(&name), registry, seen, text);
        }
    }
}

/// The types that the text of a definition names, by their two-part names.
fn named_in_text(definition: &Definition, registry: &Registry) -> BTreeMap<String, TypeName> {
    let mut names = BTreeMap::new();
    for (field, name) in definition.references() {
        match definition.role {
            DefinitionRole::Message | DefinitionRole::Event => {
                names.insert(name.two_part(), name.clone());
            }
            // The text of a service holds the fields of its parts.
            DefinitionRole::Service if field.name != "event_message" => {
                names.extend(named_in_text(registry.expect(name), registry));
            }
            DefinitionRole::Action
                if ["goal", "result", "feedback"].contains(&field.name.as_str()) =>
            {
                names.extend(named_in_text(registry.expect(name), registry));
            }
            DefinitionRole::Service | DefinitionRole::Action => {}
        }
    }
    names
}

/// Reads a schema text back; needs nothing else but the name of its root.
///
/// `protocol` holds the definitions that services and actions need without
/// naming them in their texts; definitions in the text itself take precedence.
///
/// # Errors
/// All faults of the text.
pub fn read(
    root: &TypeName,
    text: &str,
    protocol: &[InterfaceFile],
) -> Result<Registry, Vec<InterfaceError>> {
    let mut files: Vec<InterfaceFile> = Vec::new();
    for (index, part) in parts("", text).into_iter().enumerate() {
        let name = match index {
            0 => root.clone(),
            _ => TypeName::parse(part.name, root).map_err(|message| {
                let file = format!("schema of {root}");
                vec![InterfaceError { file, line: part.first_line - 1, message }]
            })?,
        };
        files.push(InterfaceFile { path: format!("schema:{name}"), name, text: part.text.into() });
    }
    for known in protocol {
        if files.iter().all(|file| file.name != known.name) {
            files.push(known.clone());
        }
    }
    Registry::from_files(&files)
}

/// The messages that a definition of `package` needs, as `package/Type`, in its order.
pub fn needed(package: &str, definition: &str) -> Vec<String> {
    syntax::lines(definition)
        .filter_map(|line| match line.item?.ok()? {
            LineItem::Field { type_text, .. } => Some(WrittenType::parse(type_text).ok()?.base),
            LineItem::Constant { .. } => None,
        })
        .filter(|base| Primitive::named(base).is_none())
        .map(|base| two_part_name(base, package, |_| false))
        .collect()
}

/// The `package/Type` of a message that a field of a definition of `package` names.
pub(crate) fn two_part_name(
    base: &str,
    package: &str,
    is_defined: impl FnOnce(&str) -> bool,
) -> String {
    if base.contains('/') {
        return short_name(base);
    }
    let neighbour = format!("{package}/{base}");
    // `Header` alone means that of std_msgs by tradition, unless the package has its own.
    if base == "Header" && !is_defined(&neighbour) {
        return "std_msgs/Header".to_owned();
    }
    neighbour
}

/// `package/Type` of `package/msg/Type`.
pub(crate) fn short_name(name: &str) -> String {
    match name.split('/').collect::<Vec<_>>()[..] {
        [package, _, short] => format!("{package}/{short}"),
        _ => name.to_owned(),
    }
}

/// Whether a line, without the space around it, may stand before a `MSG:` line.
pub(crate) fn is_rule(line: &str) -> bool {
    line.len() >= 3 && line.bytes().all(|byte| byte == b'=')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_put_together_comes_apart_again() {
        let definitions = ["", "uint8 a", "uint8 a\n", "# a\n\nuint8 a\r\n\n"];
        for root in definitions {
            for second in definitions {
                let mut text = root.to_owned();
                push_part(&mut text, "a/B", second);
                push_part(&mut text, "a/C", root);
                let parts = parts("a/msg/A", &text);
                let found: Vec<_> = parts.iter().map(|part| (part.name, part.text)).collect();
                assert_eq!(found, [("a/msg/A", root), ("a/B", second), ("a/C", root)]);
                let line_of = |part: &SchemaPart<'_>| text.lines().nth(part.first_line - 2);
                assert_eq!(line_of(&parts[1]), Some("MSG: a/B"));
                assert_eq!(line_of(&parts[2]), Some("MSG: a/C"));
            }
        }
    }

    #[test]
    fn a_definition_names_what_it_needs() {
        let text = "Header header\nother_msgs/msg/Pose[<=2] p # b/C c\nb/C c 5\nB[] b\n\
                    uint8 A=1\nstring<=5 t\n";
        assert_eq!(needed("a", text), ["std_msgs/Header", "other_msgs/Pose", "b/C", "a/B"]);
    }
}
