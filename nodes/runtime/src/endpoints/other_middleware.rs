//! Whether another middleware of ROS 2 is in the domain, whose services do not reach ours.
//!
//! Pure: the DDS vendors of the other participants, and the service mapping of this one. Topics
//! work between all of them, so that nothing else shows the mismatch.

use crate::command_line::environment::ServiceMapping;

/// The middleware of ROS 2 that a DDS vendor stands for, and its service mapping.
///
/// The numbers are those of the OMG. Our own participants name none: they serve either.
fn of_vendor(vendor: [u8; 2]) -> Option<(&'static str, ServiceMapping)> {
    match vendor {
        [0x01, 0x0f] => Some(("rmw_fastrtps_cpp", ServiceMapping::Enhanced)),
        [0x01, 0x10] => Some(("rmw_cyclonedds_cpp", ServiceMapping::Cyclone)),
        _ => None,
    }
}

/// What to tell a user about participants that cannot call services here.
pub(crate) fn mismatch(
    mapping: ServiceMapping,
    vendors: impl IntoIterator<Item = [u8; 2]>,
) -> Option<String> {
    let here = match mapping {
        ServiceMapping::Cyclone => "rmw_cyclonedds_cpp",
        ServiceMapping::Enhanced => "rmw_fastrtps_cpp",
        // Nobody else is on Zenoh: DDS does not reach it.
        ServiceMapping::Queries => return None,
    };
    let others: Vec<&str> = vendors
        .into_iter()
        .filter_map(of_vendor)
        .filter(|(_, theirs)| *theirs != mapping)
        .map(|(name, _)| name)
        .collect();
    let name = others.first()?;
    let participants = match others.len() {
        1 => "1 participant of this ROS domain uses".to_owned(),
        count => format!("{count} participants of this ROS domain use"),
    };
    Some(format!(
        "{participants} {name}, and this node {here}: topics arrive, but services, actions and \
         parameters do not; set RMW_IMPLEMENTATION to the same value on both sides"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn participants_on_a_middleware_with_other_services_are_named() {
        const FAST: [u8; 2] = [0x01, 0x0f];
        const CYCLONE: [u8; 2] = [0x01, 0x10];
        const OURS: [u8; 2] = [0x01, 0x12];
        use ServiceMapping::{Cyclone, Enhanced};
        let table: [(ServiceMapping, &[[u8; 2]], &str); 7] = [
            (Enhanced, &[], ""),
            (Enhanced, &[OURS, FAST, FAST], ""),
            (Cyclone, &[OURS, CYCLONE], ""),
            // OpenDDS: no middleware of ROS 2 that we know.
            (Enhanced, &[[0x01, 0x03]], ""),
            (
                Enhanced,
                &[OURS, CYCLONE],
                "1 participant of this ROS domain uses rmw_cyclonedds_cpp, and this node rmw_fastrtps_cpp",
            ),
            (
                Cyclone,
                &[FAST, OURS, FAST],
                "2 participants of this ROS domain use rmw_fastrtps_cpp, and this node rmw_cyclonedds_cpp",
            ),
            (
                Enhanced,
                &[FAST, CYCLONE],
                "1 participant of this ROS domain uses rmw_cyclonedds_cpp",
            ),
        ];
        for (mapping, vendors, expected) in table {
            let found = mismatch(mapping, vendors.iter().copied());
            match (expected, found) {
                ("", None) => {}
                ("", Some(found)) => panic!("{mapping:?} {vendors:?}: {found}"),
                (_, found) => {
                    let found = found.unwrap_or_default();
                    assert!(found.starts_with(expected), "{mapping:?} {vendors:?}: {found}");
                }
            }
        }
    }
}
