//! Announces the type hash of each endpoint, as every middleware of ROS does.
//!
//! The user data of an endpoint is `typehash=RIHS01_...;`. RustDDS can only read user data; our copy
//! asks for what it announces. The report: docs/upstream/rustdds-user-data.md.

use crate::samples::type_names::ros_type;
use cnc_msgs::schema;

/// From now on, in this process.
pub(crate) fn announce() {
    rustdds::discovery::announce_user_data(user_data);
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
}
