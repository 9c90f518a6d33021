//! The ROS 2 package files of this folder agree with the interfaces in it.

use std::collections::BTreeSet;
use std::path::Path;

use rosidl::interface_file::InterfaceFile;
use rosidl::name::InterfaceKind;
use rosidl::registry::Registry;

use crate::generator::all_files;

const PACKAGE_XML: &str = include_str!("../../package.xml");
const CMAKE_LISTS: &str = include_str!("../../CMakeLists.txt");

fn own_files() -> Vec<InterfaceFile> {
    all_files().into_iter().filter(|file| file.name.package == "cnc_msgs").collect()
}

/// Packages that our definitions need, including those that rosidl adds for actions.
fn needed_packages() -> BTreeSet<String> {
    let registry = Registry::from_files(&all_files()).expect("built with them");
    let own = own_files();
    let mut packages: BTreeSet<String> = own
        .iter()
        .filter(|file| file.name.kind != InterfaceKind::Action)
        .flat_map(|file| ["", "_Request", "_Response"].map(|suffix| file.name.derived(suffix)))
        .chain(
            own.iter()
                .filter(|file| file.name.kind == InterfaceKind::Action)
                .flat_map(|file| ["_Goal", "_Result", "_Feedback"].map(|s| file.name.derived(s))),
        )
        .filter_map(|name| registry.get(&name))
        .flat_map(|definition| definition.references().map(|(_, name)| name.package.clone()))
        .filter(|package| package != "cnc_msgs")
        .collect();
    if own.iter().any(|file| file.name.kind == InterfaceKind::Action) {
        packages.insert("action_msgs".into());
    }
    packages
}

/// Contents of all elements of this name.
fn elements(xml: &str, tag: &str) -> BTreeSet<String> {
    let (open, close) = (format!("<{tag}>"), format!("</{tag}>"));
    xml.split(open.as_str())
        .skip(1)
        .map(|rest| rest.split_once(close.as_str()).expect("closed").0.to_string())
        .collect()
}

/// The arguments of `rosidl_generate_interfaces`.
fn generate_call() -> Vec<String> {
    let (_, rest) = CMAKE_LISTS.split_once("rosidl_generate_interfaces(").expect("the call");
    let (arguments, _) = rest.split_once(')').expect("closed");
    arguments.split_whitespace().map(|word| word.trim_matches('"').to_string()).collect()
}

#[test]
fn cmake_lists_every_interface_file_and_no_other() {
    let listed: Vec<String> =
        generate_call().into_iter().skip(1).take_while(|word| word != "DEPENDENCIES").collect();
    let files: Vec<String> = own_files().into_iter().map(|file| file.path).collect();
    assert_eq!(listed, files);
}

#[test]
fn cmake_and_the_manifest_depend_on_the_packages_that_are_used() {
    let needed = needed_packages();
    let given: BTreeSet<String> =
        generate_call().into_iter().skip_while(|word| word != "DEPENDENCIES").skip(1).collect();
    assert_eq!(given, needed, "CMakeLists.txt, DEPENDENCIES");
    assert_eq!(elements(PACKAGE_XML, "depend"), needed, "package.xml, depend");
    for package in &needed {
        let line = format!("find_package({package} REQUIRED)");
        assert!(CMAKE_LISTS.lines().any(|other| other == line), "CMakeLists.txt lacks {line}");
    }
}

#[test]
fn the_manifest_is_that_of_an_interface_package_of_this_version() {
    assert!(PACKAGE_XML.contains("<package format=\"3\">"));
    for (tag, value) in [
        ("name", env!("CARGO_PKG_NAME")),
        ("version", env!("CARGO_PKG_VERSION")),
        ("buildtool_depend", "ament_cmake"),
        ("build_depend", "rosidl_default_generators"),
        ("exec_depend", "rosidl_default_runtime"),
        ("member_of_group", "rosidl_interface_packages"),
        ("build_type", "ament_cmake"),
    ] {
        assert_eq!(elements(PACKAGE_XML, tag), [value.to_string()].into(), "{tag}");
    }
}

#[test]
fn fields_name_types_in_the_two_parts_that_rosidl_takes() {
    for file in own_files() {
        for (index, line) in file.text.lines().enumerate() {
            let of = line.split_whitespace().next().unwrap_or_default();
            let is_comment = of.starts_with('#');
            assert!(
                is_comment || of.matches('/').count() <= 1,
                "{}:{}: write package/Type",
                file.path,
                index + 1
            );
        }
    }
}

/// Words that cannot be the name of a field in Python or C++.
const KEYWORDS: &str = "and as assert async auto await bool break case catch char class const continue def default del \
    delete do double elif else enum except explicit export extern false finally float for friend from global goto if \
    import in inline int is lambda long mutable namespace new nonlocal not operator or pass private protected public \
    raise register return short signed sizeof static struct switch template this throw true try typedef typename \
    union unsigned using virtual void volatile while with yield";

#[test]
fn no_field_is_a_keyword_of_a_language_of_ros() {
    let keywords: Vec<&str> = KEYWORDS.split_whitespace().collect();
    let mut fields = 0;
    for folder in ["msg", "srv", "action"] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let file = entry.expect("an entry").path();
            let text = std::fs::read_to_string(&file).expect("a definition");
            let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default());
            for field in
                lines.filter(|it| !it.contains('=')).filter_map(|it| it.split_whitespace().nth(1))
            {
                fields += 1;
                assert!(!keywords.contains(&field), "{}: {field}", file.display());
            }
        }
    }
    assert!(fields > 100, "{fields} fields");
}
