//! FluidNC 4 on an ESP32. Source: its code and documents; it was not run.

use super::{
    AcceptedInput, Boot, BuildFacts, Feedback, Fields, Flush, Greeting, SettingNumbers, Traits,
    Vocabulary, grbl,
};
use crate::codes::ErrorCode;
use crate::line::{LineEnds, LineRules, OverlongLine};
use crate::receive::{Realtime, realtime as common};
use crate::settings::Settings;

pub(super) static TRAITS: Traits = Traits {
    banner: "Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help]",
    greeting: Greeting { notices: &["currentID:0", "CURRENT_ID:0"], line: None },
    setting_numbers: SettingNumbers::Grbl,
    prints_rpm_decimals: false,
    boot: Boot {
        seconds: 0.5,
        chatter: &[
            "rst:0x1 (POWERON_RESET),boot:0x13 (SPI_FAST_FLASH_BOOT)",
            "[MSG:INFO: FluidNC v4.0.5-pre2]",
            "[MSG:INFO: Local filesystem type is littlefs]",
            "[MSG:INFO: Machine Virtual]",
            "[MSG:INFO: Axis count 3]",
        ],
    },
    blocks_max: 16,
    receive_buffer_bytes: 256,
    receive_buffer_spare: 0,
    reads_ahead: true,
    line: LineRules {
        characters_max: 254,
        counts_everything: true,
        beyond: OverlongLine::CutOff,
        ends: LineEnds::Pairs,
        edits: true,
    },
    realtime,
    vocabulary: Vocabulary { has_mist: true, ..grbl::VOCABULARY },
    feedback,
    fields: Fields::classic,
    build_info,
    has_long_listings: false,
    reports_accessories_alone: false,
    override_pass: None,
    reports_overrides_first: false,
    line_number_lingers: false,
    hold_shows_feed: false,
    errors_stick: false,
    unknown_command: ErrorCode::InvalidStatement,
    reset_answers: false,
    resume_feedback: None,
    locks_at_boot: Settings::homing_enabled,
    checks_limits: Settings::hard_limits,
    limit_alarm: None,
    critical_alarms: &[1, 2, 13, 16],
    critical_alarm_input: AcceptedInput::RealtimeAndDiscard,
    sleep_input: AcceptedInput::Realtime,
    jog_cancel_flush: Flush::WhileJogging,
    announces_homing: false,
    reports_while_homing: |_| true,
    door_jog: 2,
    door_resuming: 3,
    may_sleep: |_| true,
};

fn realtime(byte: u8) -> Option<Realtime> {
    Some(match byte {
        0x87..=0x8A => Realtime::Macro(byte - 0x87),
        // XON and XOFF are flow control, which the crate does not use.
        0x11 | 0x13 => Realtime::Unknown,
        _ => return common(byte),
    })
}

fn feedback(feedback: Feedback) -> &'static str {
    match feedback {
        Feedback::Nothing => "[MSG:INFO: ]",
        Feedback::Unlock => "[MSG:INFO: '$H'|'$X' to unlock]",
        Feedback::Unlocked => "[MSG:INFO: Caution: Unlocked]",
        Feedback::ResetToContinue => "[MSG:INFO: Reset to continue]",
        Feedback::EmergencyStop => "[MSG:INFO: Hard stop]",
        Feedback::HomingRequired => "[MSG:INFO: Homing required]",
        Feedback::CheckDoor => "[MSG:INFO: Check door]",
        Feedback::CheckLimits => "[MSG:INFO: Check limits]",
        Feedback::ProgramEnd => "[MSG:INFO: Program End]",
        Feedback::CheckOn => "[MSG:INFO: Enabled]",
        Feedback::CheckOff => "[MSG:INFO: Disabled]",
        Feedback::Sleeping => "[MSG:INFO: Sleeping]",
        Feedback::RestoringDefaults => "[MSG:INFO: Restoring defaults]",
        Feedback::Stop => "[MSG:INFO: Stop]",
    }
}

fn build_info(facts: &BuildFacts<'_>) -> Vec<String> {
    vec![
        format!("[VER:4.0 FluidNC v4.0.5-pre2:{}]", facts.note),
        "[OPT:MPHS]".into(),
        "[MSG: Machine: Virtual]".into(),
    ]
}
