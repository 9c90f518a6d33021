//! Names of types as they travel: those of DDS, which Zenoh has taken over.

/// `pkg::msg::dds_::Type_` of `pkg/msg/Type`; `suffix` goes before the last underscore.
pub(crate) fn dds_type(type_name: &str, suffix: &str) -> String {
    let mut parts = type_name.rsplitn(2, '/');
    let base = parts.next().unwrap_or_default();
    let path = parts.next().unwrap_or_default().replace('/', "::");
    format!("{path}::dds_::{base}{suffix}_")
}

/// `pkg/msg/Type` of `pkg::msg::dds_::Type_`, or the name as it is.
pub(crate) fn ros_type(dds_type: &str) -> String {
    match dds_type.rsplit_once("::dds_::") {
        Some((path, base)) => {
            format!("{}/{}", path.replace("::", "/"), base.strip_suffix('_').unwrap_or(base))
        }
        None => dds_type.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_types_go_to_dds_and_back() {
        assert_eq!(dds_type("std_msgs/msg/String", ""), "std_msgs::msg::dds_::String_");
        assert_eq!(
            dds_type("std_srvs/srv/Trigger", "_Request"),
            "std_srvs::srv::dds_::Trigger_Request_"
        );
        assert_eq!(ros_type("std_msgs::msg::dds_::String_"), "std_msgs/msg/String");
        assert_eq!(ros_type("odd"), "odd");
    }
}
