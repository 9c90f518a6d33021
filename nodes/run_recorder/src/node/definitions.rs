//! The channel of a topic in a bag: its type, definition and offered QoS.

use super::inputs::is_fetched;
use crate::bag_writer::ChannelSpec;
use crate::qos::{QosProfile, QosTime};
use rosidl::schema::{FieldType, MessageSchema};
use rosidl::schema_text;
use rosidl::types::{Arity, Primitive};
use runtime::DiscoveredPublisher;
use std::path::PathBuf;

/// Samples of one topic that may wait unread; DDS keeps as many that were read.
const DEPTH: usize = 20_000;
/// The same for large samples that can be fetched again from their sender.
const DEPTH_FETCHED: usize = 1_000;
/// The same for samples that may be as large as images: three seconds of a camera.
const DEPTH_LARGE: usize = 100;

/// The channel of a topic.
///
/// The definition is one of ours, or one of a ROS installation in
/// `AMENT_PREFIX_PATH`, or a comment that says it was not found. The bytes
/// are recorded in any case.
pub(super) fn channel(
    topic: &str,
    type_name: &str,
    offers: &[&DiscoveredPublisher],
) -> ChannelSpec {
    let (schema_text, type_hash) = match cnc_msgs::schema::lookup(type_name) {
        Some(info) => (info.schema_text.to_owned(), info.rihs01.to_owned()),
        None => (
            installed(type_name).unwrap_or_else(|| {
                tracing::warn!(
                    "no definition of {type_name} ({topic}) was found: set AMENT_PREFIX_PATH"
                );
                format!("# the definition of {type_name} was not found when this was recorded\n")
            }),
            offers.iter().find_map(|offer| offer.type_hash.clone()).unwrap_or_default(),
        ),
    };
    ChannelSpec {
        topic: topic.to_owned(),
        type_name: type_name.to_owned(),
        schema_text,
        type_hash,
        qos: offers.iter().map(|offer| profile(offer)).collect(),
    }
}

/// How many samples of a topic may wait. To bound memory, few may wait if their type is
/// unknown or has lists without a bound.
pub(super) fn depth(spec: &ChannelSpec) -> usize {
    if is_fetched(&spec.type_name) {
        return DEPTH_FETCHED;
    }
    if cnc_msgs::schema::lookup(&spec.type_name).is_some() {
        return DEPTH;
    }
    match MessageSchema::parse(&spec.type_name, &spec.schema_text) {
        Ok(schema) if !schema.fields.is_empty() && !holds_bytes(&schema) => DEPTH,
        _ => DEPTH_LARGE,
    }
}

fn holds_bytes(schema: &MessageSchema) -> bool {
    schema.fields.iter().any(|field| match &field.field_type {
        FieldType::Primitive(Primitive::U8 | Primitive::I8) => field.arity == Arity::Sequence,
        FieldType::Primitive(_) => false,
        FieldType::Message(inner) => holds_bytes(inner),
    })
}

fn profile(offer: &DiscoveredPublisher) -> QosProfile {
    // Discovery does not carry the depth; latched topics keep one.
    let mut profile = match (offer.qos.reliable, offer.qos.transient_local) {
        (_, true) => QosProfile::latched(1),
        (true, false) => QosProfile::reliable(10),
        (false, false) => QosProfile::best_effort(10),
    };
    if let Some(deadline) = offer.deadline_ns {
        profile.deadline = time(deadline);
    }
    if let Some(lifespan) = offer.lifespan_ns {
        profile.lifespan = time(lifespan);
    }
    profile
}

fn time(ns: i64) -> QosTime {
    let ns = ns.unsigned_abs();
    QosTime { sec: ns / 1_000_000_000, nsec: ns % 1_000_000_000 }
}

/// Bytes of a file with the definition of a message; the longest of ROS has 20 kB.
const DEFINITION_BYTES_MAX: u64 = 256 << 10;

/// A definition and all that it needs, from an ROS installation.
fn installed(type_name: &str) -> Option<String> {
    let prefixes: Vec<PathBuf> =
        std::env::split_paths(&std::env::var_os("AMENT_PREFIX_PATH")?).collect();
    let read = |name: &str| {
        let (package, rest) = name.split_once('/')?;
        let name = rest.rsplit('/').next()?;
        // The publisher chooses the type name: it must not be a path to another file.
        let is_name =
            |part: &str| part.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
        if !is_name(package) || !is_name(name) {
            return None;
        }
        prefixes.iter().find_map(|prefix| {
            let path = prefix.join(format!("share/{package}/msg/{name}.msg"));
            String::from_utf8(intake::file::read(&path, DEFINITION_BYTES_MAX).ok()?).ok()
        })
    };
    let mut text = read(type_name)?;
    let package = type_name.split('/').next()?;
    let mut seen = vec![type_name.to_owned()];
    let mut open = schema_text::needed(package, &text);
    while let Some(name) = open.pop() {
        if seen.contains(&name) {
            continue;
        }
        let definition = read(&name)?;
        schema_text::push_part(&mut text, &name, &definition);
        open.extend(schema_text::needed(name.split('/').next()?, &definition));
        seen.push(name);
    }
    MessageSchema::parse(type_name, &text).ok()?;
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_samples_wait_where_they_may_be_large() {
        let camera = "uint32 height\nuint8[] data\n";
        let cloud = concat!(
            "cell_msgs/Block[] blocks\n",
            "================================================================================\n",
            "MSG: cell_msgs/Block\n",
            "float64 x\n",
            "int8[] cells\n",
        );
        let table = [
            ("cnc_msgs/msg/PathChunk", "", DEPTH_FETCHED),
            ("cnc_msgs/msg/MachineState", "", DEPTH),
            // It has a list of bytes, but is known to be small.
            ("rcl_interfaces/msg/ParameterEvent", "", DEPTH),
            ("cell_msgs/msg/Gripper", "float64[] force\nuint8[4] flags\nstring text\n", DEPTH),
            ("cell_msgs/msg/Camera", camera, DEPTH_LARGE),
            ("cell_msgs/msg/Cloud", cloud, DEPTH_LARGE),
            ("cell_msgs/msg/Unknown", "# the definition was not found\n", DEPTH_LARGE),
        ];
        for (type_name, schema_text, expected) in table {
            let spec = ChannelSpec {
                topic: "/a".into(),
                type_name: type_name.into(),
                schema_text: schema_text.into(),
                type_hash: String::new(),
                qos: Vec::new(),
            };
            assert_eq!(depth(&spec), expected, "{type_name}");
        }
    }
}
