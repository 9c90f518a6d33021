//! Scenarios as people write them, right and wrong.

use super::*;
use crate::fault::{Direction, FaultAction, Trigger};

const EXAMPLE: &str = include_str!("../../../../config/examples/shop_floor.yaml");
const README: &str = include_str!("../../README.md");

#[test]
fn the_example_is_one_and_has_all_keys() {
    let scenario = Scenario::from_yaml(EXAMPLE).unwrap();
    assert_eq!(scenario.firmware, Some(Firmware::GrblHal));
    let settings = scenario.settings().unwrap();
    assert_eq!((settings.get(110), settings.get(22)), (Some(3000.0), Some(1.0)));
    assert!(scenario.faults.iter().any(|fault| fault.action == FaultAction::LoseOk));
    assert!(scenario.faults.iter().any(|fault| matches!(fault.action, FaultAction::Vanish { .. })));
    // As a key or as a comment in the example, and in the table of the README.
    for key in [
        "firmware",
        "machine",
        "settings",
        "homing",
        "receive_buffer_bytes",
        "start_mm",
        "probe_z_mm",
        "line_numbers",
        "mist",
        "spindle_encoder",
        "echo",
        "baud",
        "time_factor",
        "fast_bytes",
        "resets_on_open",
        "seed",
        "faults",
    ] {
        assert!(EXAMPLE.contains(&format!("{key}:")), "{key} is not in the example");
        assert!(README.contains(&format!("| `{key}` |")), "{key} is not in the README");
    }
}

#[test]
fn a_mapping_says_the_same_as_a_text() {
    let read = |fault: &str| Scenario::from_yaml(&format!("faults: [{fault}]")).unwrap().faults;
    for (mapping, text) in [
        ("{action: lose-ok, line: 20}", "lose-ok@line=20"),
        ("{action: vanish, seconds: 3, byte: 100}", "vanish:3@byte=100"),
        ("{action: limit, axis: x, time: 1.5}", "limit:x@time=1.5"),
        ("{action: alarm, number: 3, line: 7}", "alarm:3@line=7"),
        ("{action: push, text: 'hot, {very}', line: 7}", "'push:hot, {very}@line=7'"),
        ("{action: rx-drop, rate: 0.001}", "rx-drop@rate=0.001"),
        ("{action: 'silent:2', line: 1}", "silent:2@line=1"),
    ] {
        assert_eq!(read(mapping), read(text), "{mapping}");
    }
    assert_eq!(
        read("{action: tx-delay, seconds: 0.25, line: 2}"),
        [Fault {
            action: FaultAction::Delay { direction: Direction::FromController, seconds: 0.25 },
            trigger: Trigger::Line(2),
        }]
    );
}

#[test]
fn settings_are_set_in_their_order() {
    let scenario = Scenario::from_yaml("settings: {$22: 1, $20: 1, 110: 1200}").unwrap();
    let settings = scenario.settings().unwrap();
    assert!(settings.soft_limits());
    let error = Scenario::from_yaml("settings: {$20: 1, $22: 1}").unwrap_err().to_string();
    assert_eq!(error, "settings: grbl rejects $20=1 (error:10)");
}

#[test]
fn an_empty_text_is_the_usual_controller() {
    for text in ["", "# nothing\n", "{}"] {
        assert_eq!(Scenario::from_yaml(text), Ok(Scenario::default()), "{text:?}");
    }
}

#[test]
fn an_error_names_its_place_and_the_allowed_values() {
    for (text, place, hint) in [
        ("firmware: marlin\n", "1:11: ", "use grbl, grblhal or fluidnc"),
        ("firmware: [grbl]\n", "1:11: ", "a name"),
        ("seed: 1\nmachine: lathe\n", "2:10: ", "use router or generic"),
        ("seeds: 1\n", "1:1: ", "expected one of `firmware`"),
        ("seed: -1\n", "1:7: ", "u64"),
        ("seed: \"1\n", "2:1: ", "end of stream"),
        ("receive_buffer_bytes: 3\n", "1:23: ", "from 16 to 65536"),
        ("receive_buffer_bytes: 100.5\n", "1:23: ", "from 16 to 65536"),
        ("time_factor: 0\n", "1:14: ", "from 0.001 to 10000"),
        ("time_factor: fast\n", "1:14: ", "from 0.001 to 10000"),
        ("start_mm: [1, 2]\n", "1:11: ", "array of length 3"),
        ("start_mm: [1, 2, .nan]\n", "1:18: ", "millimetres within 100000"),
        ("settings: {$1x: 1}\n", "1:12: ", "write $110 or 110"),
        ("settings: {70000: 1}\n", "1:12: ", "write $110 or 110"),
        ("settings: {$110: fast}\n", "1:18: ", "f64"),
        ("settings: [1]\n", "1:11: ", "such as $110: 5000"),
        ("faults:\n  - explode@line=1\n", "2:5: ", "vanish:SECONDS"),
        ("faults:\n  - lose-ok\n", "2:5: ", "@rate=P"),
        ("faults:\n  - {action: lose-ok}\n", "2:5: ", "one trigger"),
        ("faults:\n  - {action: lose-ok, line: 1, rate: 1}\n", "2:5: ", "one trigger"),
        ("faults:\n  - {action: cut, axis: x, number: 1, line: 1}\n", "2:5: ", "one of seconds"),
        ("faults:\n  - {when: 1}\n", "2:6: ", "expected one of `action`"),
        ("faults: 7\n", "1:9: ", "sequence"),
        ("settings: {$341: 1}\n", "settings: ", "$341=1 (error:3)"),
    ] {
        let error = Scenario::from_yaml(text).unwrap_err().to_string();
        assert!(error.starts_with(place) && error.contains(hint), "{text:?}: {error}");
        // The place occurs once; libyaml adds a second one, the start of the quotation.
        assert!(text.contains('"') || !error.contains(" at line "), "{error}");
    }
}
