//! What the generator makes of definitions, as a user of the structs sees it.

use cnc_msgs::interface::{Action, Message, Service};
use cnc_msgs::wire::cnc_msgs::action::{RunProgram, RunProgramGoal};
use cnc_msgs::wire::cnc_msgs::msg::MachineState;
use cnc_msgs::wire::cnc_msgs::srv::{LoadProgram, LoadProgramRequest};
use cnc_msgs::wire::geometry_msgs::msg::Quaternion;
use cnc_msgs::wire::rcl_interfaces::msg::ParameterValue;
use cnc_msgs::wire::std_srvs::srv::TriggerRequest;

use rosidl::InterfaceError;
use rosidl::interface_file::InterfaceFile;
use rosidl::name::{InterfaceKind, TypeName};

use crate::generator::{self, rust};

#[test]
fn a_new_message_holds_the_defaults_of_its_definition() {
    assert_eq!(Quaternion::default(), Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 });
    assert_eq!(MachineState::default().state, MachineState::STATE_UNKNOWN);
}

#[test]
fn an_empty_request_is_one_byte_on_the_wire() {
    let request = TriggerRequest { structure_needs_at_least_one_member: 0 };
    assert_eq!(cnc_msgs::cdr::body(&request), [0]);
}

#[test]
fn a_field_that_is_a_keyword_has_an_underscore_in_rust_alone() {
    let value = ParameterValue { type_: 3, ..ParameterValue::default() };
    assert_eq!(serde_json::to_value(value).expect("valid")["type"], 3);
}

#[test]
fn services_and_actions_name_their_parts() {
    fn request_of<S: Service>() -> &'static str {
        S::Request::TYPE_NAME
    }
    fn goal_of<A: Action>() -> &'static str {
        A::Goal::TYPE_NAME
    }
    assert_eq!(LoadProgram::TYPE_NAME, "cnc_msgs/srv/LoadProgram");
    assert_eq!(request_of::<LoadProgram>(), LoadProgramRequest::TYPE_NAME);
    assert_eq!(RunProgram::TYPE_NAME, "cnc_msgs/action/RunProgram");
    assert_eq!(goal_of::<RunProgram>(), RunProgramGoal::TYPE_NAME);
    assert_eq!(RunProgramGoal::TYPE_NAME, "cnc_msgs/action/RunProgram_Goal");
}

fn wire_of(text: &str) -> Result<String, Vec<InterfaceError>> {
    let file = InterfaceFile {
        name: TypeName::new("p", InterfaceKind::Msg, "Thing"),
        path: "msg/Thing.msg".into(),
        text: text.into(),
    };
    rust::wire(&generator::read(&[file])?)
}

#[test]
fn constants_keep_their_types_and_their_texts() {
    let code = wire_of(
        "int32 LOW=-5\nuint8 MASK=0x1F\nfloat32 HALF=0.5\nbool ON=true\nstring A=plain text\n\
         string B=\"quoted \\\" one \"\nbyte[] data\n",
    )
    .expect("valid");
    for line in [
        "pub const LOW: i32 = -5;",
        "pub const MASK: u8 = 31;",
        "pub const HALF: f32 = 0.5_f32;",
        "pub const ON: bool = true;",
        "pub const A: &'static str = \"plain text\";",
        "pub const B: &'static str = \"quoted \\\" one \";",
    ] {
        assert!(code.contains(line), "{line} is not in\n{code}");
    }
}

#[test]
fn defaults_of_every_shape_reach_the_struct() {
    let code = wire_of(
        "string<=9 s \"it's, so\"\nint8[3] a [1, -2, 0x3]\nfloat64[<=4] f [1, 2.5]\n\
         string[] t ['x, y', \"z\"]\nuint16 plain\n",
    )
    .expect("valid");
    for line in [
        "s: ::std::string::String::from(\"it's, so\"),",
        "a: [1, -2, 3],",
        "f: ::std::vec![1.0_f64, 2.5_f64],",
        "t: ::std::vec![::std::string::String::from(\"x, y\"), ::std::string::String::from(\"z\")],",
        "plain: ::std::default::Default::default(),",
        "/// At most 9 bytes.",
        "/// At most 4 elements.",
    ] {
        assert!(code.contains(line), "{line} is not in\n{code}");
    }
}

#[test]
fn comments_above_behind_and_below_a_field_become_its_documentation() {
    let code = wire_of(
        "# The thing\n# as such.\n\n# forgotten\n\n# above\nuint8 a # behind\n   # below\n# next\nuint8 b\n",
    )
    .expect("valid");
    assert!(code.contains("/// The thing\n/// as such.\n#[derive"), "{code}");
    assert!(code.contains("/// above\n/// behind\n/// below\npub a: u8,"), "{code}");
    assert!(code.contains("/// next\npub b: u8,"), "{code}");
    assert!(!code.contains("forgotten"), "{code}");
}

#[test]
fn a_long_array_is_refused_with_its_place() {
    let refusals = wire_of("uint8 a\nfloat64[36] covariance\n").expect_err("too long for serde");
    assert_eq!(
        refusals[0].to_string(),
        "msg/Thing.msg:2: covariance: arrays of more than 32 elements are not made; take a sequence [<=36]"
    );
}
