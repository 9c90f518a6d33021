//! The `ros2msg` text of a type with all that it needs, as rosbag2 writes it.
//!
//! The text of the type comes first, verbatim; then, depth first and each
//! once, the types that it names in the order of their two-part names, each
//! behind a line of 80 `=` and its name. Derived types, which rosbag2 cannot
//! find, are written in the same form.

use std::collections::{BTreeMap, BTreeSet};

use super::Refusal;
use super::model::{Definition, Role};
use super::name::TypeName;
use super::registry::{InterfaceFile, Registry};

const RULE: &str =
    "================================================================================";

/// The text for a bag.
pub fn text(definition: &Definition, registry: &Registry) -> String {
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
            text.push_str(&format!("\n{RULE}\nMSG: {two_part}\n"));
            append(registry.expect(&name), registry, seen, text);
        }
    }
}

/// The types that the text of a definition names, by their two-part names.
fn named_in_text(definition: &Definition, registry: &Registry) -> BTreeMap<String, TypeName> {
    let mut names = BTreeMap::new();
    for (field, name) in definition.references() {
        match definition.role {
            Role::Message | Role::Event => {
                names.insert(name.two_part(), name.clone());
            }
            // The text of a service holds the fields of its parts.
            Role::Service if field.name != "event_message" => {
                names.extend(named_in_text(registry.expect(name), registry));
            }
            Role::Action if ["goal", "result", "feedback"].contains(&field.name.as_str()) => {
                names.extend(named_in_text(registry.expect(name), registry));
            }
            Role::Service | Role::Action => {}
        }
    }
    names
}

/// Reads a schema text back, with nothing but the name of its root.
///
/// `protocol` holds the definitions that services and actions need without
/// naming them in their texts; those that the text has itself win.
pub fn parse(
    root: &TypeName,
    text: &str,
    protocol: &[InterfaceFile],
) -> Result<Registry, Vec<Refusal>> {
    let separator = format!("\n{RULE}\nMSG: ");
    let mut parts = text.split(separator.as_str());
    let own_text = parts.next().unwrap_or_default();
    let mut files = vec![file(root.clone(), own_text)];
    for part in parts {
        let (name, text) = part.split_once('\n').unwrap_or((part, ""));
        let name = TypeName::parse(name, root).map_err(|message| {
            vec![Refusal { file: format!("schema of {root}"), line: 0, message }]
        })?;
        files.push(file(name, text));
    }
    for known in protocol {
        if files.iter().all(|file| file.name != known.name) {
            files.push(known.clone());
        }
    }
    Registry::from_files(&files)
}

fn file(name: TypeName, text: &str) -> InterfaceFile {
    InterfaceFile { path: format!("schema:{name}"), name, text: text.into() }
}
