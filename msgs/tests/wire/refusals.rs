//! What the generator says about wrong files: the build fails with these lines.

use std::fs;
use std::path::PathBuf;

use rosidl::interface_file::InterfaceFile;
use rosidl::name::{InterfaceKind, TypeName};

use crate::generator::{self, files};

fn refusals(files: &[(InterfaceKind, &str, &str)]) -> Vec<String> {
    let files: Vec<InterfaceFile> = files
        .iter()
        .map(|(kind, name, text)| InterfaceFile {
            name: TypeName::new("p", *kind, name),
            path: format!("{0}/{name}.{0}", kind.folder()),
            text: (*text).into(),
        })
        .collect();
    match generator::read(&files) {
        Ok(_) => Vec::new(),
        Err(refusals) => refusals.iter().map(ToString::to_string).collect(),
    }
}

#[test]
fn a_wrong_line_is_refused_with_file_line_and_reason() {
    for (text, expected) in [
        ("uint8", ":1: a line is a type, a space and a name"),
        ("\n\n  uint8 a", ":3: the line is indented; ROS wants the type in the first column"),
        (
            "uint8 Speed",
            ":1: field \"Speed\" is not named like_this: a to z first, no underscore at the end, none doubled",
        ),
        (
            "uint8 a__b",
            ":1: field \"a__b\" is not named like_this: a to z first, no underscore at the end, none doubled",
        ),
        (
            "uint8 type_",
            ":1: field \"type_\" is not named like_this: a to z first, no underscore at the end, none doubled",
        ),
        ("uint8 a\nbool a", ":2: there is a field a already"),
        ("uint8 idle=1", ":1: constant \"idle\" is not named LIKE_THIS"),
        ("uint8 IDLE_=1", ":1: constant \"IDLE_\" is not named LIKE_THIS"),
        ("uint8 A=1\nuint8 A=2", ":2: there is a constant A already"),
        ("uint8 A=256", ":1: constant A: 256 does not fit; 0 to 255 do"),
        ("int8 A=-129", ":1: constant A: -129 does not fit; -128 to 127 do"),
        ("uint8 A=", ":1: constant A: \"\" is not a whole number"),
        ("uint8 A=--1", ":1: constant A: \"--1\" is not a whole number"),
        ("bool A=yes", ":1: constant A: \"yes\" is neither true nor false"),
        ("float64 A=inf", ":1: constant A: \"inf\" is no finite number"),
        ("uint8[] A=[1]", ":1: constant A must be a number, a bool or a string"),
        ("Thing A=1", ":1: constant A must be a number, a bool or a string"),
        (
            "string A=\"no # end\"",
            ":1: constant A: \"no lacks the closing \"; ROS ends a line at #, even inside quotes",
        ),
        (
            "string A=\"",
            ":1: constant A: \" lacks the closing \"; ROS ends a line at #, even inside quotes",
        ),
        ("string A='it's'", ":1: constant A: 'it's' has a ' inside; write \\'"),
        (
            "string A=C:\\temp",
            ":1: constant A: C:\\temp has a backslash, which generators read differently",
        ),
        ("string A='\\n'", ":1: constant A: '\\n' has a backslash before something else than '"),
        ("string<=3 a 'four'", ":1: default of a: \"four\" is longer than 3 bytes"),
        ("uint8[2] a [1]", ":1: default of a: 2 elements are needed, 1 are there"),
        ("uint8[<=2] a [1, 2, 3]", ":1: default of a: at most 2 elements are allowed, 3 are there"),
        ("uint8[] a 1", ":1: default of a: 1 is no list; write [first, second]"),
        ("string[] a ['x]", ":1: default of a: ['x] has an open quote"),
        ("uint8[0] a", ":1: the size in uint8[0] is not a whole number above 0"),
        ("uint8[<=x] a", ":1: the size in uint8[<=x] is not a whole number above 0"),
        ("uint8] a", ":1: uint8] closes a bracket it never opened"),
        ("string<=0 a", ":1: the size in string<=0 is not a whole number above 0"),
        ("uint8<=3 a", ":1: only string can be bounded by <=, not uint8"),
        ("wstring a", ":1: wstring is unknown to most readers of bags; take string"),
        ("time a", ":1: time is of ROS 1; take a type of builtin_interfaces"),
        ("float a", ":1: type \"float\" is not named LikeThis"),
        ("Std_msgs/Header a", ":1: package \"Std_msgs\" is not named like_this"),
        ("a/b/c/D a", ":1: a/b/c/D is not a type; write package/Type"),
        ("a/topic/D a", ":1: topic is none of msg, srv, action"),
        ("Some_Thing a", ":1: Some_Thing has an underscore; types are named LikeThis"),
        ("std_msgs/Header header", ":1: header is a std_msgs/msg/Header, which no file defines"),
        ("uint8 a\nThing[] more", ":2: p/msg/Thing contains itself"),
        ("# a\n# ====\nuint8 a", ":2: a comment of = alone splits the schema"),
        ("uint8 a\n---\nuint8 b", ": a .msg file has 0 lines of ---, not 1"),
    ] {
        let said = refusals(&[(InterfaceKind::Msg, "Thing", text)]);
        assert_eq!(said, [format!("msg/Thing.msg{expected}")], "{text}");
    }
}

#[test]
fn lines_are_counted_through_all_sections_of_a_file() {
    let files = [(InterfaceKind::Srv, "Do", "uint8 a\n---\nbool b\nbool B\n")];
    assert_eq!(refusals(&files).len(), 1);
    assert!(refusals(&files)[0].starts_with("srv/Do.srv:4: field \"B\""));

    let files = [(InterfaceKind::Action, "Go", "---\nuint8 X=1\n---\n\nuint8 x y z\n")];
    assert!(refusals(&files)[0].starts_with("action/Go.action:5: default of x"));
}

#[test]
fn a_service_or_an_action_with_the_wrong_number_of_sections_is_refused() {
    assert_eq!(
        refusals(&[
            (InterfaceKind::Srv, "Do", "uint8 a\n"),
            (InterfaceKind::Action, "Go", "---\n")
        ]),
        [
            "srv/Do.srv: a .srv file has 1 lines of ---, not 0",
            "action/Go.action: a .action file has 2 lines of ---, not 1",
        ]
    );
}

#[test]
fn all_faults_of_all_files_are_reported_at_once() {
    let files =
        [(InterfaceKind::Msg, "A", "uint8 X\nfloat y\n"), (InterfaceKind::Msg, "B", "bool\n")];
    assert_eq!(refusals(&files).len(), 3);
}

#[test]
fn types_that_contain_each_other_are_refused() {
    let said = refusals(&[
        (InterfaceKind::Msg, "A", "B b\n"),
        (InterfaceKind::Msg, "B", "uint8 x\nA[] a\n"),
    ]);
    assert_eq!(
        said,
        ["msg/A.msg:1: p/msg/A contains itself", "msg/B.msg:2: p/msg/B contains itself"]
    );
}

#[test]
fn a_file_that_does_not_belong_in_its_folder_is_refused() {
    let root = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("stray_files");
    let _ = fs::remove_dir_all(&root);
    for (path, text) in [
        ("msg/Good.msg", "uint8 a\n"),
        ("msg/.hidden", ""),
        ("msg/bad_name.msg", "uint8 a\n"),
        ("msg/Note.txt", "text"),
        ("share/other_msgs/srv/Do.msg", "uint8 a\n"),
    ] {
        let path = root.join(path);
        fs::create_dir_all(path.parent().expect("has a folder")).expect("writable");
        fs::write(path, text).expect("writable");
    }
    let refusals = files::read_all(&root, "p").expect_err("three files do not belong");
    let said: Vec<String> = refusals.iter().map(ToString::to_string).collect();
    assert_eq!(
        said,
        [
            "msg/Note.txt: only .msg files belong here",
            "msg/bad_name.msg: type \"bad_name\" is not named LikeThis",
            "share/other_msgs/srv/Do.msg: only .srv files belong here",
        ]
    );
}
