//! Type hashes against golden values of another implementation and of ROS itself.
//!
//! `fixtures/hashes.txt` is written by `oracle.py` with `rosbags`.

use crate::generator::protocol;
use cnc_msgs::interface::Message;
use cnc_msgs::schema::{self, TypeInfo};
use cnc_msgs::wire;
use rosidl::interface_file::InterfaceFile;
use rosidl::name::{InterfaceKind, TypeName};
use rosidl::registry::Registry;
use rosidl::type_hash::rihs01;

#[test]
fn every_type_hashes_as_rosbags_does() {
    let golden: Vec<(&str, &str)> = include_str!("../fixtures/hashes.txt")
        .lines()
        .map(|line| line.split_once(' ').expect("name and hash"))
        .collect();
    let ours: Vec<(&str, &str)> =
        schema::all().iter().map(|info| (info.name, info.rihs01)).collect();
    for (ours, golden) in ours.iter().zip(&golden) {
        assert_eq!(ours, golden, "run msgs/tests/oracle.py --write after a change of a definition");
    }
    assert_eq!(ours.len(), golden.len());
}

#[test]
fn types_of_other_packages_hash_as_a_jazzy_installation_says() {
    // Seen in key expressions of rmw_zenoh and in the locked tables of other clients.
    for (name, hash) in [
        ("std_msgs/msg/String", "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"),
        (
            "rcl_interfaces/msg/Log",
            "e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac",
        ),
        (
            "std_srvs/srv/Trigger",
            "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
        ),
        (
            "action_msgs/srv/CancelGoal",
            "573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a",
        ),
        (
            "rcl_interfaces/srv/GetParameters",
            "bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc",
        ),
        (
            "rcl_interfaces/srv/GetParameterTypes",
            "da199c878688b3e530bdfe3ca8f74cb9fa0c303101e980a9e8f260e25e1c80ca",
        ),
        (
            "rcl_interfaces/srv/SetParameters",
            "56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0",
        ),
        (
            "rcl_interfaces/srv/SetParametersAtomically",
            "0e192ef259c07fc3c07a13191d27002222e65e00ccec653ca05e856f79285fcd",
        ),
        (
            "rcl_interfaces/srv/ListParameters",
            "3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d",
        ),
        (
            "rcl_interfaces/srv/DescribeParameters",
            "845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff",
        ),
    ] {
        let info = schema::lookup(name).expect(name);
        assert_eq!(info.rihs01, format!("RIHS01_{hash}"), "{name}");
    }
}

#[test]
fn an_action_and_all_that_ros_derives_from_it_hash_as_ros_says() {
    let mut files = protocol();
    files.push(InterfaceFile {
        name: TypeName::new("example_interfaces", InterfaceKind::Action, "Fibonacci"),
        path: "Fibonacci.action".into(),
        text: "int32 order\n---\nint32[] sequence\n---\nint32[] sequence\n".into(),
    });
    let registry = Registry::from_files(&files).expect("valid");
    for (suffix, hash) in [
        ("", "9508051da1ea4658de144b09bd0690ff3de52104683d847aed764d2915906f51"),
        ("_Goal", "226cb437e4355dcd3e914f930382a3b0cc1da81545bd319ed554e95a03255f51"),
        ("_Result", "fea81394f25aa4502217953f1a021fb750e79c10bbd43f13dd94632da6569649"),
        ("_Feedback", "2b12e37361da6f408d4c85bc24a18de64333f29082f2ca34b5ee33dc4c8b42a9"),
        ("_SendGoal", "d1a57fb2a4afe8c21e34fb10db206f16ce6729b28531141472df92277c55b557"),
        ("_SendGoal_Request", "3d088942b413247db536576f0286768c6be8fcd5d0c9a5d544f359fba090a238"),
        ("_SendGoal_Response", "d8c07bb3d5b766fe4b43159c9a5222af5214e2fcc29229b991d826166c512be1"),
        ("_GetResult", "1b0de0d5d29dc955d92f546706568428632771db13ec84c15ec1c1a59f424a57"),
        ("_GetResult_Request", "c8a4f5e7d13b81286ee1043e2ecd084281cecf1ff06aaa799464f5f15479f003"),
        ("_GetResult_Response", "6021dc98ab9b4bbe395e48aa4de81ee5f68eb570f88358affcc648146668b24f"),
        ("_FeedbackMessage", "c1de71afd52e49a89c53d8262366884185bc0a02f78ce051c4e46b0a7fe59bb2"),
    ] {
        let name = TypeName::new(
            "example_interfaces",
            InterfaceKind::Action,
            &format!("Fibonacci{suffix}"),
        );
        let definition = registry.get(&name).expect(suffix);
        assert_eq!(rihs01(definition, &registry), format!("RIHS01_{hash}"), "{name}");
    }
}

#[test]
fn a_service_hashes_as_ros_says() {
    let mut files = protocol();
    let name = TypeName::new("example_interfaces", InterfaceKind::Srv, "AddTwoInts");
    files.push(InterfaceFile {
        name: name.clone(),
        path: "AddTwoInts.srv".into(),
        text: "int64 a\nint64 b\n---\nint64 sum\n".into(),
    });
    let registry = Registry::from_files(&files).expect("valid");
    assert_eq!(
        rihs01(registry.expect(&name), &registry),
        "RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a"
    );
}

#[test]
fn a_type_is_found_by_its_name_and_by_its_struct() {
    let info = TypeInfo::of::<wire::cnc_msgs::msg::MachineState>();
    assert_eq!(info.name, "cnc_msgs/msg/MachineState");
    assert_eq!(schema::lookup("cnc_msgs/msg/MachineState"), Some(info));
    assert_eq!(schema::lookup("cnc_msgs/msg/NoSuchThing"), None);
    assert_eq!(wire::std_msgs::msg::Header::TYPE_NAME, "std_msgs/msg/Header");
    assert!(schema::all().is_sorted_by_key(|info| info.name));
}
