//! One list of controls and one of firmwares: what else lists them says the same.

use kerf_tests::lists::{lists_in_source, partial_lists};
use kerf_tests::rows::IN_ORDER;
use kerf_tests::{files, root};
use settings::Control;
use std::collections::BTreeSet;

fn controls() -> BTreeSet<&'static str> {
    Control::ALL.map(Control::name).into()
}

#[test]
fn the_order_of_the_pages_has_every_control_once() {
    assert_eq!(IN_ORDER.map(Control::name).into_iter().collect::<BTreeSet<_>>(), controls());
}

#[test]
fn a_page_or_script_that_lists_controls_lists_all() {
    let mut wrong = Vec::new();
    for ending in [".md", ".py", ".sh", ".yaml", ".srv", ".msg"] {
        for path in files(ending) {
            let inside = path.strip_prefix(root()).expect("a file of the project");
            // Notes of earlier versions, rows of some controls, and what bags say of themselves.
            let passed_over = ["CHANGELOG.md", "tests", "bags"];
            if passed_over.iter().any(|it| inside.starts_with(it)) {
                continue;
            }
            let text = std::fs::read_to_string(&path).expect("pages are UTF-8");
            // A row about one key names the controls that it concerns.
            let is_of_key = |line: &&str| line.starts_with('|') && line.contains('`');
            let text: Vec<_> =
                text.lines().map(|line| if is_of_key(&line) { "" } else { line }).collect();
            let text = text.join("\n");
            for (line, missing) in partial_lists(&text, &Control::ALL.map(Control::name)) {
                wrong.push(format!("{}:{line} lacks {missing:?}", inside.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn every_control_is_on_the_pages_that_list_them() {
    for page in ["docs/commands.md", "docs/profiles.md", "docs/rules_by_control.md"] {
        let text = std::fs::read_to_string(root().join(page)).expect(page);
        let missing: Vec<_> = controls().into_iter().filter(|name| !text.contains(name)).collect();
        assert!(missing.is_empty(), "{page} lacks {missing:?}");
    }
}

#[test]
fn no_source_keeps_a_list_of_controls() {
    let mut wrong = Vec::new();
    for path in files(".rs") {
        let text = std::fs::read_to_string(&path).expect("sources are UTF-8");
        let lines = lists_in_source(&text, &Control::ALL.map(Control::name));
        wrong.extend(lines.iter().map(|line| format!("{}:{line}", path.display())));
    }
    assert!(wrong.is_empty(), "use settings::Control::ALL: {wrong:#?}");
}

#[test]
fn a_list_that_lacks_a_control_is_found() {
    let names = ["ant", "bee", "cat_1", "dog"];
    assert_eq!(partial_lists("ant\n\nant, bee, `cat_1`\n\nbee", &names), [(3, ["dog"].into())]);
    assert!(partial_lists("ant, bee, cat_1,\ndog\n\nant, bee, cat_12", &names).is_empty());
    assert_eq!(lists_in_source("x\n[\"ant\", \"bee\",\n\"dog\"]\ny", &names), [1, 2]);
    assert!(lists_in_source("\"ant\"\n\"bee\"\n\n\n\"dog\"", &names).is_empty());
}

#[test]
fn the_driver_and_the_virtual_controller_know_the_same_firmwares() {
    let driver = axis_driver::firmware::Firmware::ALL.map(|it| it.traits().name.to_lowercase());
    let controller = virtual_controller::Firmware::ALL.map(|it| it.name().to_owned());
    assert_eq!(driver.into_iter().collect::<BTreeSet<_>>(), controller.into_iter().collect());
}

#[test]
fn every_firmware_is_where_they_are_listed() {
    for place in [
        "nodes/kerf/src/up.rs",
        "nodes/virtual_controller/src/node/cli.rs",
        "nodes/virtual_controller/README.md",
        "config/examples/shop_floor.yaml",
    ] {
        let text = std::fs::read_to_string(root().join(place)).expect(place);
        let lacks = |firmware: &virtual_controller::Firmware| !text.contains(firmware.name());
        let missing: Vec<_> = virtual_controller::Firmware::ALL.into_iter().filter(lacks).collect();
        assert!(missing.is_empty(), "{place} lacks {missing:?}");
    }
}
