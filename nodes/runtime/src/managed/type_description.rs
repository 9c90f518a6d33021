//! `~/get_type_description`: what the types of a node are made of.
//!
//! For tools that have not built our messages. Knows every type that was compiled in;
//! the texts and hashes are made with the structs, in `cnc_msgs::schema`.

use crate::endpoints::error::NodeError;
use crate::endpoints::node::Handle;
use cnc_msgs::schema::{self, TypeInfo};
use cnc_msgs::wire::type_description_interfaces::msg as wire;
use cnc_msgs::wire::type_description_interfaces::srv;
use rosidl::schema_text::{self, SchemaPart};
use serde::Deserialize;
use std::future::ready;

/// Offers the service.
pub(crate) fn serve(node: &Handle) -> Result<(), NodeError> {
    node.service::<srv::GetTypeDescription, _, _>("~/get_type_description", |request, _| {
        ready(answer(&request).unwrap_or_else(|failure_reason| srv::GetTypeDescriptionResponse {
            failure_reason,
            ..Default::default()
        }))
    })
}

fn answer(
    request: &srv::GetTypeDescriptionRequest,
) -> Result<srv::GetTypeDescriptionResponse, String> {
    let srv::GetTypeDescriptionRequest { type_name, type_hash, include_type_sources } = request;
    let info = schema::lookup(type_name).ok_or(format!("no type \"{type_name}\" is known here"))?;
    if *type_hash != info.rihs01 {
        return Err(format!("{type_name} has the hash {} here, not \"{type_hash}\"", info.rihs01));
    }
    let type_sources = if *include_type_sources { sources(info) } else { Vec::new() };
    Ok(srv::GetTypeDescriptionResponse {
        successful: true,
        type_description: description(info)?,
        type_sources,
        ..Default::default()
    })
}

/// The text that is hashed, as it is written.
#[derive(Deserialize)]
struct Description {
    type_description: Individual,
    referenced_type_descriptions: Vec<Individual>,
}

#[derive(Deserialize)]
struct Individual {
    type_name: String,
    fields: Vec<Field>,
}

/// Without a default value, which is not part of the hash.
#[derive(Deserialize)]
struct Field {
    name: String,
    #[serde(rename = "type")]
    kind: wire::FieldType,
}

fn description(info: &TypeInfo) -> Result<wire::TypeDescription, String> {
    // JSON is YAML.
    let Description { type_description, referenced_type_descriptions } =
        serde_yaml::from_str(info.description).map_err(|error| error.to_string())?;
    Ok(wire::TypeDescription {
        type_description: individual(type_description),
        referenced_type_descriptions: referenced_type_descriptions
            .into_iter()
            .map(individual)
            .collect(),
    })
}

fn individual(Individual { type_name, fields }: Individual) -> wire::IndividualTypeDescription {
    let fields = fields.into_iter().map(|Field { name, kind }| wire::Field {
        name,
        type_: kind,
        default_value: String::new(),
    });
    wire::IndividualTypeDescription { type_name, fields: fields.collect() }
}

/// The files of a type and of those that it names, as they stand in its schema.
fn sources(info: &TypeInfo) -> Vec<wire::TypeSource> {
    let folder = info.name.split('/').nth(1).unwrap_or_default();
    let parts = schema_text::parts(info.name, info.schema_text).into_iter().enumerate();
    let source = |(index, part): (usize, SchemaPart<'_>)| {
        let (type_name, encoding) = match part.name.split_once('/') {
            Some((package, name)) if index > 0 => (format!("{package}/msg/{name}"), "msg"),
            _ => (part.name.to_owned(), folder),
        };
        let raw_file_contents = part.text.to_owned();
        wire::TypeSource { type_name, encoding: encoding.to_owned(), raw_file_contents }
    };
    parts.map(source).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(type_name: &str, type_hash: &str) -> Result<srv::GetTypeDescriptionResponse, String> {
        answer(&srv::GetTypeDescriptionRequest {
            type_name: type_name.into(),
            type_hash: type_hash.into(),
            include_type_sources: true,
        })
    }

    #[test]
    fn every_type_that_is_compiled_in_can_be_described() {
        for info in schema::all() {
            let answer = ask(info.name, info.rihs01).expect(info.name);
            assert!(answer.successful && answer.failure_reason.is_empty());
            assert_eq!(answer.type_description.type_description.type_name, info.name);
            assert_eq!(answer.type_sources[0].type_name, info.name);
        }
    }

    #[test]
    fn a_description_has_the_fields_and_the_types_that_they_need() {
        let info = TypeInfo::of::<cnc_msgs::wire::std_msgs::msg::Header>();
        let described = ask(info.name, info.rihs01).expect("known").type_description;
        let fields: Vec<_> = described.type_description.fields.iter().collect();
        assert_eq!((fields[0].name.as_str(), fields[0].type_.type_id), ("stamp", 1));
        assert_eq!(fields[0].type_.nested_type_name, "builtin_interfaces/msg/Time");
        let string = wire::FieldType::FIELD_TYPE_STRING;
        assert_eq!((fields[1].name.as_str(), fields[1].type_.type_id), ("frame_id", string));
        let needed = &described.referenced_type_descriptions;
        assert_eq!(needed.len(), 1);
        assert_eq!(needed[0].type_name, "builtin_interfaces/msg/Time");
    }

    #[test]
    fn another_type_or_another_version_of_it_is_refused_with_the_reason() {
        let reason = ask("gripper_msgs/msg/Grip", "").expect_err("unknown");
        assert!(reason.contains("gripper_msgs/msg/Grip"), "{reason}");
        let reason = ask("std_msgs/msg/Header", "RIHS01_0").expect_err("another");
        assert!(reason.contains("has the hash RIHS01_"), "{reason}");
    }
}
