//! The texts that bags carry.

use std::collections::BTreeSet;

use cnc_msgs::schema::{self, TypeInfo};
use rosidl::name::{InterfaceKind, TypeName};
use rosidl::schema_text;
use rosidl::type_hash::rihs01;

use crate::generator::protocol;

fn name_of(info: &TypeInfo) -> TypeName {
    let nobody = TypeName::new("none", InterfaceKind::Msg, "None");
    TypeName::parse(info.name, &nobody).expect(info.name)
}

/// Names after `MSG:`, in order.
fn dependencies(text: &str) -> Vec<&str> {
    text.lines().filter_map(|line| line.strip_prefix("MSG: ")).collect()
}

#[test]
fn a_schema_text_alone_gives_the_hash_of_its_type() {
    for info in schema::all() {
        let name = name_of(info);
        // Services and actions need types that their texts do not name.
        let is_message = !info.schema_text.lines().any(|line| line == "---");
        let protocol = if is_message { Vec::new() } else { protocol() };
        let registry = match schema_text::read(&name, info.schema_text, &protocol) {
            Ok(registry) => registry,
            Err(refusals) => panic!("{}: {}", info.name, refusals[0]),
        };
        assert_eq!(rihs01(registry.expect(&name), &registry), info.rihs01, "{}", info.name);
    }
}

#[test]
fn a_schema_text_names_each_type_once() {
    for info in schema::all() {
        let names = dependencies(info.schema_text);
        let unique: BTreeSet<_> = names.iter().collect();
        assert_eq!(unique.len(), names.len(), "{}: {names:?}", info.name);
    }
}

#[test]
fn a_schema_text_is_laid_out_as_rosbag2_does() {
    let info = schema::lookup("nav_msgs/msg/Path").expect("in share");
    assert_eq!(
        dependencies(info.schema_text),
        [
            "geometry_msgs/PoseStamped",
            "geometry_msgs/Pose",
            "geometry_msgs/Point",
            "geometry_msgs/Quaternion",
            "std_msgs/Header",
            "builtin_interfaces/Time",
        ]
    );
    let rule = "=".repeat(80);
    assert_eq!(
        schema::lookup("rosgraph_msgs/msg/Clock").expect("in share").schema_text,
        format!(
            "# ROS time now.\n\nbuiltin_interfaces/Time clock\n\n{rule}\nMSG: builtin_interfaces/Time\n{}",
            include_str!("../../share/builtin_interfaces/msg/Time.msg")
        )
    );
}

#[test]
fn parts_of_services_and_actions_name_each_other_in_two_parts() {
    let feedback = schema::lookup("cnc_msgs/action/RunProgram_FeedbackMessage").expect("derived");
    assert!(
        feedback
            .schema_text
            .starts_with("unique_identifier_msgs/UUID goal_id\nRunProgram_Feedback feedback\n"),
        "{}",
        feedback.schema_text
    );
    assert!(dependencies(feedback.schema_text).contains(&"cnc_msgs/RunProgram_Feedback"));

    let request = schema::lookup("cnc_msgs/srv/LoadProgram_Request").expect("derived");
    let (before, _) =
        include_str!("../../srv/LoadProgram.srv").split_once("---\n").expect("a service");
    assert_eq!(request.schema_text, before);
}
