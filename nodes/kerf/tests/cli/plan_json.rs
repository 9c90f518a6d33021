//! `kerf plan --json`: every key of the contract, and two worked programs number by number.

use super::said;
use super::support::{CONTOUR, Folder, TOOLS, kerf};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

const REPORT_KEYS: &[&str] =
    &["control", "accepted", "elements", "events", "findings", "certificates", "uncut"];
const ELEMENT_KEYS: &[&str] =
    &["kind", "start", "end", "rapid", "feed_mm_per_min", "role", "line", "block"];
const ARC_KEYS: &[&str] = &["center", "clockwise", "turns", "plane"];
const EVENT_KEYS: &[&str] = &["kind", "text", "line", "block", "at_element"];
const DIAGNOSTIC_KEYS: &[&str] = &[
    "severity",
    "code",
    "alarm",
    "line",
    "column",
    "length",
    "block",
    "other_line",
    "other_block",
    "position",
    "depth_mm",
    "needed_mm",
    "available_mm",
    "message",
    "help",
];
const ROLES: &[&str] = &["none", "lead_on", "contour", "corner", "lead_off", "link", "off_plane"];
const EVENTS: &[&str] =
    &["spindle", "coolant", "aux", "dwell", "tool", "stop_point", "program_end"];

fn sorted(keys: &[&str]) -> Vec<String> {
    let mut keys: Vec<String> = keys.iter().map(|key| (*key).to_owned()).collect();
    keys.sort();
    keys
}

fn with(keys: &[&str], more: &str) -> Vec<String> {
    sorted(&[keys, &[more]].concat())
}

fn keys(object: &Value) -> Vec<String> {
    let mut keys: Vec<String> = object.as_object().expect("an object").keys().cloned().collect();
    keys.sort();
    keys
}

fn check_point(point: &Value) -> [f64; 3] {
    let numbers: Vec<f64> = point
        .as_array()
        .expect("a point")
        .iter()
        .map(|number| number.as_f64().expect("a number"))
        .collect();
    numbers.try_into().expect("three coordinates")
}

/// Keys, types and roles of every element, and that each begins where the last ended.
fn check_elements(elements: &Value) {
    let mut at = [0.0; 3];
    for element in elements.as_array().expect("a list") {
        let is_arc = element["kind"] == "arc";
        let wanted = if is_arc { [ELEMENT_KEYS, ARC_KEYS].concat() } else { ELEMENT_KEYS.to_vec() };
        assert_eq!(keys(element), sorted(&wanted), "{element}");
        assert!(is_arc || element["kind"] == "line", "{element}");
        assert_eq!(check_point(&element["start"]), at, "{element}");
        at = check_point(&element["end"]);
        let is_rapid = element["rapid"].as_bool().expect("a bool");
        assert_eq!(element["feed_mm_per_min"].is_null(), is_rapid, "{element}");
        assert!(is_rapid || element["feed_mm_per_min"].is_number(), "{element}");
        let role = element["role"].as_str().expect("a word");
        assert!(ROLES.contains(&role), "{element}");
        assert!(element["line"].as_u64().is_some_and(|line| line >= 1), "{element}");
        assert!(element["block"].is_null() || element["block"].is_u64(), "{element}");
        if is_arc {
            check_point(&element["center"]);
            assert!(element["clockwise"].is_boolean() && element["turns"].is_u64(), "{element}");
            let plane = element["plane"].as_str().expect("a word");
            assert!(["xy", "zx", "yz"].contains(&plane), "{element}");
        }
    }
}

fn check_events(report: &Value) {
    let count = report["elements"].as_array().expect("a list").len() as u64;
    for event in report["events"].as_array().expect("a list") {
        assert_eq!(keys(event), sorted(EVENT_KEYS));
        assert!(EVENTS.contains(&event["kind"].as_str().expect("a word")), "{event}");
        assert!(event["text"].is_string() && event["line"].is_u64(), "{event}");
        assert!(event["at_element"].as_u64().is_some_and(|at| at <= count), "{event}");
    }
}

/// What an element should be: role, block, end in XY, and the centre of an arc in XY.
type Row = (&'static str, u64, [f64; 2], Option<[f64; 2]>);

fn check_path(report: &Value, rows: &[Row]) {
    assert_eq!(keys(report), with(REPORT_KEYS, "audit"));
    assert_eq!(report["accepted"], true);
    check_elements(&report["elements"]);
    check_events(report);
    let elements = report["elements"].as_array().expect("a list");
    assert_eq!(elements.len(), rows.len());
    for (element, (role, block, end, center)) in elements.iter().zip(rows) {
        let near = |point: &Value, wanted: [f64; 2]| {
            let [x, y, _] = check_point(point);
            (x - wanted[0]).hypot(y - wanted[1]) <= 1e-6
        };
        assert_eq!(element["role"], *role, "{element}");
        assert_eq!(element["block"], *block, "{element}");
        assert!(near(&element["end"], *end), "{element}: {end:?} is wanted");
        match center {
            None => assert_eq!(element["kind"], "line", "{element}"),
            Some(center) => {
                assert!(near(&element["center"], *center), "{element}: {center:?} is wanted");
                assert_eq!((&element["turns"], &element["plane"]), (&0.into(), &"xy".into()));
            }
        }
    }
}

#[test]
fn a6_as_json_is_the_path_of_the_840c() {
    let folder = Folder::new();
    let args = ["plan", CONTOUR, "--control", "sinumerik_840c", "--tools", TOOLS, "--json"];
    let ran = said(&folder, &args).expect(0);
    let report: Value = serde_json::from_str(&ran.out).expect("one JSON object");
    assert_eq!(report["control"], "sinumerik_840c");
    check_path(
        &report,
        &[
            ("none", 1, [15.0, 60.0], None),
            ("lead_on", 10, [25.527_864_045, 62.236_067_977], None),
            ("contour", 20, [35.527_864_045, 82.236_067_977], None),
            ("corner", 30, [40.0, 85.0], Some([40.0, 80.0])),
            ("contour", 30, [69.580_398_915, 60.0], Some([40.0, 55.0])),
            ("contour", 40, [90.635_083_269, 60.0], None),
            ("contour", 50, [110.0, 75.0], Some([110.0, 55.0])),
            ("corner", 60, [114.743_416_490, 68.418_861_170], Some([110.0, 70.0])),
            ("contour", 60, [110.203_845, 54.800_147], None),
            ("contour", 70, [114.850_713, 36.212_678], None),
            ("corner", 80, [110.0, 30.0], Some([110.0, 35.0])),
            ("contour", 80, [91.753_905, 30.0], None),
            ("contour", 90, [68.123_475, 11.095_656], None),
            ("corner", 100, [61.464_466, 11.464_466], Some([65.0, 15.0])),
            ("contour", 100, [36.464_466, 36.464_466], None),
            ("corner", 110, [35.527_864, 37.763_932], Some([40.0, 40.0])),
            ("contour", 110, [25.527_864, 57.763_932], None),
            ("lead_off", 120, [15.0, 60.0], None),
            ("none", 130, [15.0, 60.0], None),
        ],
    );
    assert_eq!(report["elements"][0]["rapid"], true);
    assert_eq!(report["elements"][1]["feed_mm_per_min"], 400.0);
    assert_eq!(report["findings"], serde_json::json!([]));
    let events: Vec<(&str, &str, u64)> = report["events"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|event| {
            (
                event["kind"].as_str().expect("a word"),
                event["text"].as_str().expect("a text"),
                event["at_element"].as_u64().expect("a number"),
            )
        })
        .collect();
    assert_eq!(events, [("spindle", "S80", 1), ("spindle", "M3", 1), ("program_end", "M30", 19)]);
}

#[test]
fn m12_as_json_is_the_path_of_the_masso() {
    let folder = Folder::new();
    folder.file(
        "m12.nc",
        "N10 T1 M06\nN20 G00 X-50 Y-25 Z25\nN30 G01 Z-5 F250\nN40 G41\nN50 X-25\nN60 X100\n\
         N70 Y-100\nN80 X25\nN90 Y25\nN100 G40\nN110 X25 Y50\nN120 G00 Z25\n",
    );
    for (wear, radius) in [(0.0, 5.0), (-0.5, 4.75)] {
        let tools = format!("tools:\n  1: {{diameter_mm: 10.0, wear_diameter_mm: {wear:.1}}}\n");
        folder.file("tools.yaml", tools);
        let args = ["plan", "m12.nc", "--control", "masso", "--tools", "tools.yaml", "--json"];
        let ran = said(&folder, &args).expect(0);
        let report: Value = serde_json::from_str(&ran.out).expect("one JSON object");
        let r = radius;
        check_path(
            &report,
            &[
                ("none", 20, [-50.0, -25.0], None),
                ("none", 30, [-50.0, -25.0], None),
                ("lead_on", 50, [-25.0, -25.0 + r], None),
                ("contour", 60, [100.0, -25.0 + r], None),
                ("corner", 70, [100.0 + r, -25.0], Some([100.0, -25.0])),
                ("contour", 70, [100.0 + r, -100.0], None),
                ("corner", 80, [100.0, -100.0 - r], Some([100.0, -100.0])),
                ("contour", 80, [25.0, -100.0 - r], None),
                ("corner", 90, [25.0 - r, -100.0], Some([25.0, -100.0])),
                ("contour", 90, [25.0 - r, 25.0], None),
                ("lead_off", 110, [25.0, 50.0], None),
                ("none", 120, [25.0, 50.0], None),
            ],
        );
        let found = report["findings"].as_array().expect("a list");
        assert!(found.iter().all(|row| row["severity"] == "warning"), "{found:?}");
    }
}

#[test]
fn a_refusal_has_its_loops_and_findings_with_numbers() {
    let folder = Folder::new();
    folder.file("big.yaml", "offsets:\n  1: {radius_mm: 25.0}\n");
    let args = ["plan", CONTOUR, "--control", "sinumerik_840c", "--tools", "big.yaml", "--json"];
    let ran = said(&folder, &args).expect(1);
    let report: Value = serde_json::from_str(&ran.out).expect("one JSON object");
    assert_eq!(report["accepted"], false);
    assert_eq!(report["elements"], serde_json::json!([]));
    assert_eq!(keys(&report), with(REPORT_KEYS, "refused_elements"));
    check_elements(&report["refused_elements"]);
    let found = report["findings"].as_array().expect("a list");
    let unreachable = found.iter().find(|row| row["code"] == "unreachable").expect("the finding");
    assert_eq!(keys(unreachable), sorted(DIAGNOSTIC_KEYS));
    assert_eq!(unreachable["severity"], "error");
    assert_eq!((&unreachable["line"], &unreachable["block"]), (&5.into(), &40.into()));
    assert!((unreachable["needed_mm"].as_f64().expect("a number") - 25.0).abs() < 1e-9);
    assert!((unreachable["available_mm"].as_f64().expect("a number") - 20.851449).abs() < 1e-5);
    check_point(&unreachable["position"]);
    assert!(unreachable["depth_mm"].is_null() || unreachable["depth_mm"].is_f64());
}

/// The names of all keys in it, but for those that are data themselves.
fn names(value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => {
            for (name, value) in object {
                found.insert(name.clone());
                if !["run", "compared"].contains(&name.as_str()) {
                    names(value, found);
                }
            }
        }
        Value::Array(values) => values.iter().for_each(|value| names(value, found)),
        _ => {}
    }
}

#[test]
fn the_page_on_json_names_all_that_is_printed() {
    let folder = Folder::new();
    folder.file("bad.ngc", "G99.7\n");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let bag = root.join("bags/rs274_older_definitions").display().to_string();
    let none = folder.path().join("none").display().to_string();
    let lists = [REPORT_KEYS, ELEMENT_KEYS, ARC_KEYS, EVENT_KEYS, DIAGNOSTIC_KEYS, ROLES, EVENTS];
    let mut found: BTreeSet<String> = lists.concat().into_iter().map(str::to_owned).collect();
    let part = [CONTOUR, "--control", "sinumerik_840c", "--tools", TOOLS, "--json"];
    for (arguments, status) in [
        ([&["plan"][..], &part].concat(), 0),
        (vec!["plan", "bad.ngc", "--json"], 1),
        (vec!["check", CONTOUR, "--tools", TOOLS, "--json"], 0),
        (vec!["replay", &bag, &none, "--json"], 2),
        (vec!["bag", "info", &bag, "--json"], 0),
    ] {
        let out = said(&folder, &arguments).expect(status).out;
        names(&serde_json::from_str(&out).expect("one JSON object"), &mut found);
    }
    let page = std::fs::read_to_string(root.join("docs/json.md")).expect("the page");
    let missing: Vec<_> =
        found.iter().filter(|name| !page.contains(&format!("`{name}`"))).collect();
    assert!(missing.is_empty(), "docs/json.md does not name {missing:?}");
}

#[test]
fn json_that_a_full_disk_cuts_off_ends_with_2() {
    let folder = Folder::new();
    let full = std::fs::File::options().write(true).open("/dev/full").expect("/dev/full");
    let ran = kerf()
        .current_dir(folder.path())
        .args(["plan", CONTOUR, "--control", "sinumerik_840c", "--tools", TOOLS, "--json"])
        .stdout(full)
        .output()
        .expect("kerf");
    let said = String::from_utf8_lossy(&ran.stderr).into_owned();
    assert_eq!(ran.status.code(), Some(2), "{said}");
    assert!(said.contains("cannot write to standard output: No space left"), "{said}");
}
