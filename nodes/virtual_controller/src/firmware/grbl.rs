//! grbl 1.1h.

use super::{
    AcceptedInput, Boot, BuildFacts, Feedback, Fields, Flush, Greeting, SettingNumbers, Traits,
    Vocabulary,
};
use crate::axes::AxisLetters;
use crate::codes::ErrorCode;
use crate::gcode::{ArcPrecision, Digits};
use crate::line::{LineEnds, LineRules, OverlongLine};
use crate::receive::realtime;
use crate::settings::Settings;
use std::time::Duration;

/// One pass of the main loop that reads a line and plans it, at 16 MHz.
const MAIN_LOOP: Duration = Duration::from_millis(2);

/// As on an Arduino Uno.
pub(super) static TRAITS: Traits = Traits {
    banner: "Grbl 1.1h ['$' for help]",
    greeting: Greeting { notices: &[], line: None },
    setting_numbers: SettingNumbers::Grbl,
    prints_rpm_decimals: false,
    boot: Boot { seconds: 0.0, chatter: &[] },
    blocks_max: 15,
    receive_buffer_bytes: 128,
    receive_buffer_spare: 0,
    reads_ahead: false,
    line: LineRules {
        characters_max: 79,
        counts_everything: false,
        beyond: OverlongLine::Refused,
        ends: LineEnds::Each,
        edits: false,
    },
    realtime,
    vocabulary: VOCABULARY,
    feedback,
    fields: Fields::classic,
    build_info,
    has_long_listings: false,
    reports_accessories_alone: false,
    override_pass: Some(MAIN_LOOP),
    reports_overrides_first: false,
    line_number_lingers: false,
    hold_shows_feed: false,
    errors_stick: false,
    unknown_command: ErrorCode::BadNumber,
    reset_answers: true,
    resume_feedback: None,
    locks_at_boot: Settings::homing_enabled,
    checks_limits: Settings::hard_limits,
    limit_alarm: None,
    critical_alarms: &[1, 2],
    critical_alarm_input: AcceptedInput::ResetOnly,
    sleep_input: AcceptedInput::Realtime,
    jog_cancel_flush: Flush::Never,
    announces_homing: false,
    reports_while_homing: |_| false,
    door_jog: 2,
    door_resuming: 3,
    may_sleep: |_| true,
};

pub(super) const VOCABULARY: Vocabulary = Vocabulary {
    axes: AxisLetters::XYZ,
    more_letters: &[],
    stray_letter: None,
    systems: 6,
    tool_max: 255.0,
    has_tool_change: false,
    has_optional_stop: false,
    has_mist: false,
    has_spindle_sync: false,
    ports: [0; 4],
    has_bare_circles: false,
    digits: Digits::All,
    arc_precision: ArcPrecision::Single,
};

pub(super) fn feedback(feedback: Feedback) -> &'static str {
    match feedback {
        Feedback::Nothing => "[MSG:]",
        Feedback::Unlock => "[MSG:'$H'|'$X' to unlock]",
        Feedback::Unlocked => "[MSG:Caution: Unlocked]",
        Feedback::ResetToContinue => "[MSG:Reset to continue]",
        Feedback::EmergencyStop => "[MSG:Emergency stop - clear, then reset to continue]",
        Feedback::HomingRequired => "[MSG:Homing cycle required]",
        Feedback::CheckDoor => "[MSG:Check Door]",
        Feedback::CheckLimits => "[MSG:Check Limits]",
        Feedback::ProgramEnd => "[MSG:Pgm End]",
        Feedback::CheckOn => "[MSG:Enabled]",
        Feedback::CheckOff => "[MSG:Disabled]",
        Feedback::Sleeping => "[MSG:Sleeping]",
        Feedback::RestoringDefaults => "[MSG:Restoring defaults]",
        Feedback::Stop => "[MSG:Stop]",
    }
}

fn build_info(facts: &BuildFacts<'_>) -> Vec<String> {
    let line_numbers = if facts.has_line_numbers { "N" } else { "" };
    let mist = if facts.has_mist { "M" } else { "" };
    vec![
        format!("[VER:1.1h.20190830:{}]", facts.note),
        format!("[OPT:V{line_numbers}{mist},{},{}]", facts.blocks_max, facts.receive_buffer_bytes),
    ]
}
