//! Announces the type hash of each endpoint, as every middleware of ROS does, and matches no endpoint whose hash differs.
//!
//! The user data of an endpoint is `typehash=RIHS01_...;`. RustDDS can only read user data, and matches endpoints by
//! the name of the topic alone; our copy asks here. The report: docs/upstream/rustdds-user-data.md.

use crate::process::lock;
use crate::samples::gid::Gid;
use crate::samples::type_names::ros_type;
use cnc_msgs::schema;
use rustdds::discovery::TypesOfTopic;
use std::collections::BTreeSet;
use std::sync::Mutex;

/// From now on, in this process.
pub(crate) fn announce_and_compare() {
    rustdds::discovery::announce_user_data(user_data);
    rustdds::discovery::match_where(|types| match difference(types) {
        Some(difference) => {
            warn_once(types.remote.into(), &difference);
            false
        }
        None => true,
    });
}

/// Peers announce themselves again and again.
fn warn_once(remote: Gid, difference: &str) {
    static WARNED: Mutex<BTreeSet<Gid>> = Mutex::new(BTreeSet::new());
    const WARNED_MAX: usize = 1_000;
    let mut warned = lock(&WARNED);
    if warned.len() < WARNED_MAX && warned.insert(remote) {
        tracing::warn!("endpoint {remote} is not connected: {difference}");
    }
}

/// Why an endpoint of a peer does not speak of the same type as ours on its topic.
///
/// One without a hash, as of DDS without ROS, is compared by the name of its type.
fn difference(types: &TypesOfTopic<'_>) -> Option<String> {
    let TypesOfTopic { topic, local_type: Some(ours), remote_type: theirs, .. } = *types else {
        return None;
    };
    if ours != theirs {
        return Some(format!("on {topic} it has the type {theirs}, and this node {ours}"));
    }
    let our_hash = schema::lookup(&ros_type(ours))?.rihs01;
    let their_hash = type_hash(types.remote_user_data)?;
    (our_hash != their_hash).then(|| {
        format!(
            "on {topic} its {ours} has the type hash {their_hash}, and that of this node \
             {our_hash}: build both with the same definitions"
        )
    })
}

/// The hash in the user data of an endpoint, a list of `key=value;`.
pub(crate) fn type_hash(user_data: &[u8]) -> Option<&str> {
    let text = std::str::from_utf8(user_data).ok()?;
    let hash = text.split(';').find_map(|entry| entry.strip_prefix("typehash="))?;
    // One of another kind says nothing about ours.
    hash.starts_with("RIHS01_").then_some(hash)
}

/// The user data of an endpoint, by the DDS name of its type: for services that of the request or response, as
/// rmw_fastrtps_cpp has it.
fn user_data(dds_type: &str) -> Option<Vec<u8>> {
    let info = schema::lookup(&ros_type(dds_type))?;
    Some(format!("typehash={};", info.rihs01).into_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_type_has_its_own_hash() {
        let text = |name: &str| user_data(name).map(|it| String::from_utf8(it).expect("ASCII"));
        let hash_of =
            |name: &str| schema::lookup(name).map(|it| format!("typehash={};", it.rihs01));
        for (dds, ros) in [
            ("std_msgs::msg::dds_::String_", "std_msgs/msg/String"),
            ("std_srvs::srv::dds_::Trigger_Request_", "std_srvs/srv/Trigger_Request"),
            ("std_srvs::srv::dds_::Trigger_Response_", "std_srvs/srv/Trigger_Response"),
            (
                "cnc_msgs::action::dds_::Jog_SendGoal_Request_",
                "cnc_msgs/action/Jog_SendGoal_Request",
            ),
            ("cnc_msgs::action::dds_::Jog_FeedbackMessage_", "cnc_msgs/action/Jog_FeedbackMessage"),
        ] {
            assert!(hash_of(ros).is_some_and(|it| it.starts_with("typehash=RIHS01_")), "{ros}");
            assert_eq!(text(dds), hash_of(ros), "{dds}");
        }
        assert_eq!(text("odd"), None);
    }

    #[test]
    fn an_endpoint_of_another_type_is_not_matched() {
        const STRING: &str = "std_msgs::msg::dds_::String_";
        let difference = |ours, theirs: &str, user_data: &str| {
            super::difference(&TypesOfTopic {
                topic: "rt/said",
                local_type: ours,
                remote_type: theirs,
                remote_user_data: user_data.as_bytes(),
                remote: rustdds::GUID::GUID_UNKNOWN,
            })
        };
        let own = String::from_utf8(user_data(STRING).expect("built in")).expect("ASCII");
        for same in [own.as_str(), "", "odd", "\u{fffd}", &format!("enclave=/;{own}"), "typehash"] {
            assert_eq!(difference(Some(STRING), STRING, same), None, "{same}");
        }
        assert_eq!(difference(Some(STRING), STRING, "typehash=RIHS02_0;"), None);
        let other = own.replace("RIHS01_", "RIHS01_0");
        let text = difference(Some(STRING), STRING, &other).expect("another hash");
        assert!(text.contains("RIHS01_0") && text.contains("rt/said"), "{text}");
        let text =
            difference(Some(STRING), "std_msgs::msg::dds_::Bool_", "").expect("another type");
        assert!(text.contains("Bool_") && text.contains("String_"), "{text}");
        // Types that are not built in are compared by name. One of ours that goes hears nothing more.
        assert_eq!(difference(Some("odd"), "odd", &other), None);
        assert_eq!(difference(None, "odd", &other), None);
    }
}
