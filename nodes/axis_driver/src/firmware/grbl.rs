//! grbl 1.1.

use super::{BUFFER, CodeRow, Traits, TravelRule};

pub(super) static TRAITS: Traits = Traits {
    name: "grbl",
    banner_beginning: "grbl ",
    // It has no message that names it.
    firmware_message: None,
    version_word: None,
    alarms: ALARMS,
    errors: ERRORS,
    settings: &[],
    settings_below: 200,
    axes: 3,
    travel: TravelRule::Whole { letter_of_zero_at_switches: 'Z' },
    may_have_jerk: false,
    may_thread: false,
    may_have_ports: false,
    has_nine_work_systems: false,
    bows_rapids: false,
    greets_each_session: false,
    unreported_planner_blocks: None,
    position_kept_after: &[],
    deaf_after: &[1, 2],
    reset_needed_after: &[1, 2],
    error_lasts: false,
    has_tool_change: false,
    has_full_report: false,
    homes_one_by_one: false,
    echoes_after_control_characters: false,
    prints_accessories_when_off: false,
    overrides_in_a_round: 1,
    report_fields: &[BUFFER],
    line_number_field: None,
    no_field_because: "",
};

/// What `ALARM:N` means besides the numbers that all share.
#[rustfmt::skip]
const ALARMS: &[CodeRow] = &[
    (10, "the second switch of a dual axis was not found after the first: check its wiring"),
];

/// What `error:N` means besides the numbers that all share.
#[rustfmt::skip]
const ERRORS: &[CodeRow] = &[
    (38, "the tool number is too high"),
];
