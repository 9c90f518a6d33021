//! Every number of each firmware.

use super::*;
use std::collections::BTreeSet;
use std::ops::RangeInclusive;

/// All numbers of these ranges.
fn numbers(ranges: &[RangeInclusive<u16>]) -> BTreeSet<u16> {
    ranges.iter().cloned().flatten().collect()
}

/// The numbers that have a text on this firmware.
fn listed(firmware: Firmware, text: fn(Firmware, u16) -> Option<&'static str>) -> BTreeSet<u16> {
    (0..=u16::MAX).filter(|code| text(firmware, *code).is_some()).collect()
}

#[test]
fn shared_codes_read_the_same_on_every_firmware() {
    for firmware in Firmware::ALL {
        for code in (1..=17).chain(20..=37) {
            assert_eq!(error_text(firmware, code), error_text(Firmware::Grbl, code), "{code}");
            assert!(error_text(firmware, code).is_some(), "{code}");
        }
        for code in 1..=9 {
            assert_eq!(alarm_text(firmware, code), alarm_text(Firmware::Grbl, code), "{code}");
            assert!(alarm_text(firmware, code).is_some(), "{code}");
        }
    }
}

#[test]
fn every_error_that_a_firmware_has_is_listed_and_no_other() {
    let shared = [1..=17, 20..=37];
    let own = |ranges: &[RangeInclusive<u16>]| {
        let mut wanted = numbers(&shared);
        wanted.extend(numbers(ranges));
        wanted
    };
    assert_eq!(listed(Firmware::Grbl, error_text), own(&[38..=38]));
    assert_eq!(
        listed(Firmware::GrblHal, error_text),
        own(&[18..=19, 38..=58, 60..=66, 70..=92, 253..=253])
    );
    let fluid_nc = [
        18..=19,
        38..=40,
        60..=70,
        80..=83,
        90..=90,
        100..=101,
        110..=114,
        120..=120,
        130..=130,
        150..=152,
        160..=162,
        170..=181,
    ];
    assert_eq!(listed(Firmware::FluidNc, error_text), own(&fluid_nc));
}

#[test]
fn every_alarm_that_a_firmware_has_is_listed_and_no_other() {
    assert_eq!(listed(Firmware::Grbl, alarm_text), numbers(&[1..=10]));
    assert_eq!(listed(Firmware::GrblHal, alarm_text), numbers(&[1..=22]));
    assert_eq!(listed(Firmware::FluidNc, alarm_text), numbers(&[1..=18]));
}

#[test]
fn a_number_is_listed_once_in_its_place() {
    for firmware in Firmware::ALL {
        let traits = firmware.traits();
        for (shared, own) in [(errors::SHARED, traits.errors), (alarms::SHARED, traits.alarms)] {
            assert!(shared.is_sorted_by(|a, b| a.0 < b.0));
            assert!(own.is_sorted_by(|a, b| a.0 < b.0), "{firmware:?}");
            let is_shared = |code: u16| shared.iter().any(|row| row.0 == code);
            assert!(own.iter().all(|row| !is_shared(row.0)), "{firmware:?}");
        }
    }
}

#[test]
fn a_firmwares_own_number_is_not_read_with_anothers_column() {
    let alarm = |firmware| alarm_text(firmware, 10).unwrap();
    assert!(alarm(Firmware::Grbl).contains("dual axis"));
    assert!(alarm(Firmware::GrblHal).contains("emergency stop"));
    assert!(alarm(Firmware::FluidNc).contains("spindle"));
    assert!(error_text(Firmware::GrblHal, 64).unwrap().contains("no card"));
    assert!(error_text(Firmware::FluidNc, 64).unwrap().contains("empty"));
}

#[test]
fn a_number_that_nobody_lists_stays_a_number() {
    assert_eq!(describe_error(Firmware::Grbl, 18), "error:18");
    assert_eq!(describe_error(Firmware::GrblHal, 59), "error:59");
    assert_eq!(describe_alarm(Firmware::FluidNc, 22), "ALARM:22");
    assert_eq!(describe_error(Firmware::FluidNc, 22), "error:22 (no feed rate was given)");
}

#[test]
fn the_position_is_kept_only_where_an_alarm_is_known_to_leave_it() {
    for firmware in Firmware::ALL {
        let kept: Vec<u16> = (1..=30).filter(|alarm| !is_position_lost(firmware, *alarm)).collect();
        match firmware {
            Firmware::GrblHal => assert_eq!(kept, [2, 4, 5, 14]),
            _ => assert_eq!(kept, [2, 4, 5]),
        }
    }
}

#[test]
fn only_grbl_is_deaf_after_a_critical_alarm_and_all_want_a_reset() {
    let after = |test: fn(Firmware, u16) -> bool, firmware| -> Vec<u16> {
        (1..=30).filter(|alarm| test(firmware, *alarm)).collect()
    };
    assert_eq!(after(is_deaf, Firmware::Grbl), [1, 2]);
    assert!(after(is_deaf, Firmware::GrblHal).is_empty());
    assert!(after(is_deaf, Firmware::FluidNc).is_empty());
    assert_eq!(after(needs_reset, Firmware::Grbl), [1, 2]);
    assert_eq!(after(needs_reset, Firmware::GrblHal), [1, 2, 10, 17, 20]);
    assert_eq!(after(needs_reset, Firmware::FluidNc), [1, 2, 13, 16]);
}

#[test]
fn settings_have_the_firmwares_own_name_and_unit() {
    for firmware in Firmware::ALL {
        assert_eq!(setting_name(firmware, 110), Some(("X-axis maximum rate", "mm/min")));
        assert_eq!(setting_name(firmware, 122), Some(("Z-axis acceleration", "mm/s²")));
        assert_eq!(setting_name(firmware, 9999), None);
    }
    assert_eq!(setting_name(Firmware::Grbl, 32), Some(("laser mode", "boolean")));
    assert!(setting_name(Firmware::GrblHal, 32).unwrap().0.contains("lathe"));
    assert_eq!(setting_name(Firmware::Grbl, 113), None);
    assert_eq!(
        setting_name(Firmware::GrblHal, 113),
        Some(("A-axis maximum rate", "mm/min or deg/min"))
    );
}
