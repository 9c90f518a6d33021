//! What is read from settings: the travel of each firmware, and what cannot be a machine.

use super::*;
use cnc_msgs::machine_file::SettingValue;
use std::collections::BTreeMap;

/// A router of 600 × 400 × 100 mm that homes, with these changes.
pub(crate) fn settings(
    firmware: Firmware,
    options: &str,
    changes: &[(u16, f64)],
) -> ControllerSettings {
    let mut values: BTreeMap<u16, f64> = [
        (11, 0.01),
        (12, 0.002),
        (20, 1.0),
        (21, 0.0),
        (22, 1.0),
        (23, 0.0),
        (27, 2.0),
        (30, 24_000.0),
        (31, 0.0),
        (32, 0.0),
        (110, 5_000.0),
        (111, 5_000.0),
        (112, 2_000.0),
        (120, 500.0),
        (121, 500.0),
        (122, 200.0),
        (130, 600.0),
        (131, 400.0),
        (132, 100.0),
    ]
    .into();
    values.extend(changes.iter().copied());
    ControllerSettings {
        firmware,
        options: options.into(),
        planner_blocks: 15,
        settings: values.iter().map(|(number, value)| (*number, value.to_string())).collect(),
        ..ControllerSettings::default()
    }
}

#[test]
fn each_firmware_has_its_zero_where_its_own_check_has_it() {
    let usual = ([-600.0, -400.0, -100.0], [0.0; 3]);
    for (firmware, options, changes, expected) in [
        (Firmware::Grbl, "V", &[][..], usual),
        // The direction alone moves nothing: the switch is where the travel ends, and reads so.
        (Firmware::Grbl, "V", &[(23, 3.0)], usual),
        (Firmware::Grbl, "VZ", &[(23, 3.0)], ([0.0, 0.0, -100.0], [600.0, 400.0, 0.0])),
        (Firmware::GrblHal, "", &[(23, 3.0)], usual),
        (
            Firmware::GrblHal,
            "",
            &[(22, 9.0), (23, 1.0)],
            ([0.0, -400.0, -100.0], [600.0, 0.0, 0.0]),
        ),
        // With hard and soft limits the pull-off is kept.
        (Firmware::GrblHal, "", &[(21, 1.0)], ([-598.0, -398.0, -98.0], [-2.0; 3])),
        (Firmware::GrblHal, "", &[(20, 0.0), (21, 1.0)], usual),
        (
            Firmware::GrblHal,
            "",
            &[(21, 1.0), (22, 9.0), (23, 1.0)],
            ([0.0, -398.0, -98.0], [598.0, 0.0, 0.0]),
        ),
    ] {
        let limits = MachineLimits::of(&settings(firmware, options, changes)).expect("a machine");
        let (min_mm, max_mm) = expected;
        let bounds_mm = std::array::from_fn(|axis| Some([min_mm[axis], max_mm[axis]]));
        let expected = MachineZero::Placed { bounds_mm };
        assert_eq!(limits.zero, expected, "{firmware:?} {options} {changes:?}");
        assert!(matches!(limits.not_homed().zero, MachineZero::Unknown { .. }));
    }
    for (firmware, changes, because) in [
        (Firmware::Grbl, &[(20, 0.0), (22, 0.0)][..], "$22=0"),
        (Firmware::FluidNc, &[], "mpos_mm"),
    ] {
        let limits = MachineLimits::of(&settings(firmware, "", changes)).expect("a machine");
        let (MachineZero::Unknown { because: said } | MachineZero::Unplaced { because: said }) =
            limits.zero
        else {
            panic!("{limits:?}")
        };
        assert!(said.contains(because), "{said}");
    }
}

#[test]
fn a_travel_that_nobody_has_entered_is_none() {
    let delivered = [(130, 200.0), (131, 200.0), (132, 200.0)];
    let of = |changes: &[(u16, f64)]| {
        MachineLimits::of(&settings(Firmware::Grbl, "V", changes)).expect("a machine").travel_mm
    };
    let off = [(20, 0.0)];
    assert_eq!(of(&[&delivered[..], &off].concat()), [None; 3]);
    // Each axis for itself.
    assert_eq!(of(&[(20, 0.0), (130, 200.0)]), [None, Some(400.0), Some(100.0)]);
    // Who switches soft limits on means it.
    assert_eq!(of(&delivered), [Some(200.0); 3]);
    assert_eq!(of(&[(131, 0.0)]), [Some(600.0), None, Some(100.0)]);
}

#[test]
fn settings_that_no_machine_has_are_refused_with_their_number() {
    let of = |settings: &ControllerSettings| MachineLimits::of(settings).unwrap_err();
    for (changes, message) in [
        (
            &[(130, -600.0)][..],
            "$130 (X-axis maximum travel, mm) is -600; it must be a number of at least 0",
        ),
        (
            &[(112, 0.0)],
            "$112 (Z-axis maximum rate, mm/min) is 0; it must be a number of at least 0.001",
        ),
        (
            &[(120, f64::NAN)],
            "$120 (X-axis acceleration, mm/s²) is NaN; it must be a number of at least 0.001",
        ),
    ] {
        let problem = of(&settings(Firmware::Grbl, "V", changes));
        assert_eq!(problem.to_string(), message);
        assert_eq!(problem.place().last(), Some(&changes[0].0.to_string()));
    }
    let mut less = settings(Firmware::Grbl, "V", &[]);
    less.settings.retain(|(number, _)| *number != 132);
    assert_eq!(
        of(&less).to_string(),
        "$132 (Z-axis maximum travel, mm) is missing: these are not all settings of a grbl controller"
    );
    let mut odd = settings(Firmware::Grbl, "V", &[]);
    odd.offsets = vec![Offset {
        name: "G54".into(),
        position: [0.0, f64::INFINITY, 0.0],
        ..Offset::default()
    }];
    assert_eq!(of(&odd).to_string(), "Y of G54 is inf; it must be a finite number");
}

#[test]
fn a_file_of_another_board_is_named() {
    let file = |firmware: &str, number: u32| MachineFile {
        firmware: firmware.into(),
        version: String::new(),
        options: String::new(),
        planner_blocks: None,
        axes: String::new(),
        settings: [(number, SettingValue::Number(1.0))].into(),
        offsets_mm: BTreeMap::new(),
        spindle_sync: None,
        aux_io: None,
    };
    for (file, message) in [
        (file("marlin", 100), "firmware \"marlin\" is not known; known are grbl, grblHAL, FluidNC"),
        (
            file("grbl", 341),
            "a grbl controller has no setting $341: is this the file of another board?",
        ),
    ] {
        assert_eq!(settings_of_file(&file).unwrap_err().to_string(), message);
    }
    assert_eq!(
        settings_of_file(&file("grblhal", 341)).expect("its own").firmware,
        Firmware::GrblHal
    );
}

/// The same with more axes; their settings are 3600 a minute, 100 per s² and a travel of 360.
pub(crate) fn with_axes(mut of: ControllerSettings, axes: &str) -> ControllerSettings {
    axes.clone_into(&mut of.axes);
    for place in 3..axes.len() as u16 {
        let values = [(100, "50"), (110, "3600"), (120, "100"), (130, "360")];
        of.settings.extend(values.map(|(base, value)| (base + place, value.to_owned())));
    }
    of
}

#[test]
fn further_axes_have_the_settings_of_their_place_and_bounds_where_they_are_homed() {
    let of = |firmware, axes: &str, changes: &[(u16, f64)]| {
        let settings = with_axes(settings(firmware, "V", changes), axes);
        MachineLimits::of(&settings).expect("a machine")
    };
    let limits = of(Firmware::GrblHal, "XYZUA", &[]);
    let places = limits.further.map(|it| it.map(|it| it.place));
    assert_eq!(places, [Some(4), None, None, Some(3), None, None]);
    for (firmware, changes, x, a) in [
        // Without masks X, Y and Z are homed, and no other axis is.
        (Firmware::Grbl, &[][..], Some([-600.0, 0.0]), None),
        (Firmware::GrblHal, &[(44, 4.0), (45, 3.0)], Some([-600.0, 0.0]), None),
        (Firmware::GrblHal, &[(44, 4.0), (45, 11.0)], Some([-600.0, 0.0]), Some([-360.0, 0.0])),
        (Firmware::GrblHal, &[(44, 4.0), (45, 10.0)], None, Some([-360.0, 0.0])),
        (
            Firmware::GrblHal,
            &[(22, 9.0), (23, 8.0), (44, 15.0)],
            Some([-600.0, 0.0]),
            Some([0.0, 360.0]),
        ),
    ] {
        let limits = of(firmware, "XYZA", changes);
        let MachineZero::Placed { bounds_mm } = limits.zero else { panic!("{limits:?}") };
        let bounds = (bounds_mm[0], limits.further[0].expect("A").bounds);
        assert_eq!(bounds, (x, a), "{firmware:?} {changes:?}");
        assert_eq!(limits.not_homed().further[0].expect("A").bounds, None);
    }
    assert_eq!(of(Firmware::FluidNc, "XYZA", &[]).further[0].expect("A").bounds, None);
}

#[test]
fn a_file_names_its_axes_and_has_a_value_for_each() {
    let file = |axes: &str, values: &[f64]| MachineFile {
        firmware: "grblhal".into(),
        version: String::new(),
        options: String::new(),
        planner_blocks: None,
        settings: BTreeMap::new(),
        axes: axes.into(),
        offsets_mm: [("G54".to_owned(), values.to_vec())].into(),
        spindle_sync: None,
        aux_io: None,
    };
    for (axes, values, further) in [
        ("", &[1.0, 2.0, 3.0][..], Ok("")),
        ("XYZUA", &[1.0, 2.0, 3.0], Ok("")),
        ("XYZUA", &[1.0, 2.0, 3.0, 4.0, 5.0], Ok(" A5 U4")),
        // A letter that is not known here.
        ("XYZMA", &[1.0, 2.0, 3.0, 4.0, 5.0], Ok(" A5")),
        (
            "XYZA",
            &[1.0, 2.0, 3.0, 4.0, 5.0],
            Err("G54 has 5 values; the machine has the 4 axes XYZA"),
        ),
        ("", &[1.0, 2.0], Err("G54 has 2 values; the machine has the 3 axes XYZ")),
        (
            "XYA",
            &[],
            Err("axes is \"XYA\"; it must be XYZ, and then the letters of the others, each once"),
        ),
        (
            "XYZX",
            &[],
            Err("axes is \"XYZX\"; it must be XYZ, and then the letters of the others, each once"),
        ),
        (
            "XYZAA",
            &[],
            Err("axes is \"XYZAA\"; it must be XYZ, and then the letters of the others, each once"),
        ),
    ] {
        match (settings_of_file(&file(axes, values)), further) {
            (Ok(read), Ok(further)) => assert_eq!(read.offsets[0].further.words(), further),
            (Err(problem), Err(text)) => assert_eq!(problem.to_string(), text),
            (read, _) => panic!("{axes} {values:?}: {read:?}"),
        }
    }
}

#[test]
fn the_time_is_in_doubt_where_grblhal_limits_jerk() {
    let jerk = [(800, 5_000.0), (801, 5_000.0), (802, 2_000.0)];
    for (firmware, changes, is_in_doubt) in [
        (Firmware::GrblHal, &jerk[..], true),
        (Firmware::GrblHal, &[], false),
        // No jerk is theirs, whatever they keep under these numbers.
        (Firmware::Grbl, &jerk, false),
        (Firmware::FluidNc, &jerk, false),
    ] {
        let limits = MachineLimits::of(&settings(firmware, "", changes)).expect("a machine");
        let doubts = limits.time_doubts(FurtherAxes::NONE);
        assert_eq!(!doubts.is_empty(), is_in_doubt, "{firmware:?} {changes:?}");
    }
}

#[test]
fn the_time_is_in_doubt_where_an_axis_that_moves_has_settings_that_are_not_reported() {
    let (rate, acceleration) = ((113, 3_600.0), (123, 100.0));
    let both = "the time of moves of A: $113 and $123 are not among";
    for (axes, changes, moved, expected) in [
        ("XYZA", &[][..], &[(0, 90.0)][..], &[both][..]),
        ("XYZA", &[rate], &[(0, 90.0)], &["of A: $123 is not among"]),
        ("XYZA", &[acceleration], &[(0, 90.0)], &["of A: $113 is not among"]),
        ("XYZA", &[rate, acceleration], &[(0, 90.0)], &[]),
        // It stands still, or the board has no such axis.
        ("XYZA", &[], &[], &[]),
        ("XYZA", &[], &[(1, 90.0)], &[]),
        ("XYZ", &[], &[(0, 90.0)], &[]),
        ("XYZAC", &[rate, acceleration], &[(0, 1.0), (2, 1.0)], &["of C: $114 and $124 are not"]),
        ("XYZUA", &[], &[(0, 1.0), (3, 1.0)], &["of A: $114", "of U: $113"]),
    ] {
        let settings =
            ControllerSettings { axes: axes.into(), ..settings(Firmware::GrblHal, "", changes) };
        let limits = MachineLimits::of(&settings).expect("a machine");
        let doubts = limits.time_doubts(moved.iter().copied().collect());
        assert_eq!(doubts.len(), expected.len(), "{axes} {changes:?}: {doubts:?}");
        for (doubt, part) in doubts.iter().zip(expected) {
            assert!(doubt.contains(part), "{axes} {changes:?}: {doubt}");
        }
    }
}
