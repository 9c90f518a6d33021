//! What a bag says of a topic: its type, its definition, what was offered.

use crate::bag_writer::ChannelSpec;
use crate::qos::{QosProfile, QosTime};
use crate::schema::MessageSchema;
use runtime::DiscoveredPublisher;
use std::path::PathBuf;

/// The channel of a topic.
///
/// The definition is one of ours, else one of an ROS installation in
/// `AMENT_PREFIX_PATH`, else a comment that says it was not found: the bytes
/// are recorded all the same.
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

fn profile(offer: &DiscoveredPublisher) -> QosProfile {
    // Discovery does not tell the depth; what latches, latches one.
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

/// A definition and all that it needs, from an ROS installation.
fn installed(type_name: &str) -> Option<String> {
    let prefixes: Vec<PathBuf> =
        std::env::split_paths(&std::env::var_os("AMENT_PREFIX_PATH")?).collect();
    let read = |name: &str| {
        let (package, rest) = name.split_once('/')?;
        let name = rest.rsplit('/').next()?;
        prefixes.iter().find_map(|prefix| {
            std::fs::read_to_string(prefix.join(format!("share/{package}/msg/{name}.msg"))).ok()
        })
    };
    let mut text = read(type_name)?;
    let package = type_name.split('/').next()?;
    let mut seen = vec![type_name.to_owned()];
    let mut open = dependencies(package, &text);
    while let Some(name) = open.pop() {
        if seen.contains(&name) {
            continue;
        }
        let definition = read(&name)?;
        text += &format!("\n{}\nMSG: {name}\n{definition}", "=".repeat(80));
        open.extend(dependencies(name.split('/').next()?, &definition));
        seen.push(name);
    }
    MessageSchema::parse(type_name, &text).ok()?;
    Some(text)
}

/// The types that a definition names, as `package/Type`.
fn dependencies(package: &str, text: &str) -> Vec<String> {
    text.lines()
        .filter_map(|line| line.split('#').next()?.split_whitespace().next())
        .filter_map(|field| field.split(['[', '<']).next())
        .filter(|name| name.contains('/') || name.starts_with(|c: char| c.is_ascii_uppercase()))
        .map(|name| match name.split_once('/') {
            Some((package, rest)) => {
                format!("{package}/{}", rest.rsplit('/').next().unwrap_or(rest))
            }
            None if name == "Header" => "std_msgs/Header".to_owned(),
            None => format!("{package}/{name}"),
        })
        .collect()
}
