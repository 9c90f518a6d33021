//! grblHAL, core of August 2026, as its simulator is built.

use super::grbl::feedback;
use super::{
    AcceptedInput, Boot, BuildFacts, Fields, Flush, Greeting, SettingNumbers, Traits, Vocabulary,
};
use crate::axes::AxisLetters;
use crate::codes::ErrorCode;
use crate::gcode::{ArcPrecision, Digits};
use crate::line::{LineEnds, LineRules, OverlongLine};
use crate::receive::{Realtime, realtime as common};
use crate::settings::Settings;

/// Also said in each session of a network port, though nothing has restarted.
const BANNER: &str = "GrblHAL 1.1f ['$' or '$HELP' for help]";

pub(super) static TRAITS: Traits = Traits {
    banner: BANNER,
    greeting: Greeting { notices: &[], line: Some(BANNER) },
    setting_numbers: SettingNumbers::GrblHal,
    prints_rpm_decimals: true,
    boot: Boot { seconds: 0.0, chatter: &[] },
    blocks_max: 100,
    receive_buffer_bytes: 1024,
    receive_buffer_spare: 1,
    reads_ahead: false,
    line: LineRules {
        characters_max: 256,
        counts_everything: true,
        beyond: OverlongLine::Refused,
        ends: LineEnds::PairsUnlessWrong,
        edits: false,
    },
    realtime,
    vocabulary: Vocabulary {
        axes: AxisLetters::XYZ,
        more_letters: &['D', 'E', 'H', 'O', 'Q'],
        stray_letter: Some('$'),
        systems: 9,
        tool_max: 4_294_967_294.0,
        has_tool_change: true,
        has_optional_stop: true,
        has_mist: true,
        has_spindle_sync: true,
        ports: [u8::MAX; 4],
        has_bare_circles: true,
        digits: Digits::Significant,
        arc_precision: ArcPrecision::Double,
    },
    feedback,
    fields,
    build_info,
    has_long_listings: true,
    reports_accessories_alone: true,
    override_pass: None,
    reports_overrides_first: true,
    line_number_lingers: true,
    hold_shows_feed: true,
    errors_stick: true,
    unknown_command: ErrorCode::InvalidStatement,
    reset_answers: false,
    resume_feedback: Some(super::Feedback::Nothing),
    locks_at_boot: Settings::forces_initial_alarm,
    checks_limits: Settings::checks_limits_at_reset,
    limit_alarm: Some(crate::codes::Alarm::LIMITS_ENGAGED),
    critical_alarms: &[1, 2, 10, 17, 20],
    critical_alarm_input: AcceptedInput::Lines,
    sleep_input: AcceptedInput::Lines,
    jog_cancel_flush: Flush::Always,
    announces_homing: true,
    reports_while_homing: |settings| settings.report_mask() & (1 << 12) != 0,
    door_jog: 3,
    door_resuming: 4,
    may_sleep: Settings::sleep_enabled,
};

fn realtime(byte: u8) -> Option<Realtime> {
    Some(match byte {
        b'\n' | b'\r' => return None,
        0x03 | 0x18 => Realtime::SoftReset,
        0x05 | 0x80 => Realtime::StatusReport,
        0x19 => Realtime::Stop,
        0x81 => Realtime::CycleStart,
        0x82 => Realtime::FeedHold,
        0x83 => Realtime::ParserReport,
        0x87 => Realtime::FullReport,
        0x88 => Realtime::OptionalStopToggle,
        0x8C => Realtime::AutoReportToggle,
        0x00..0x20 => Realtime::Unknown,
        _ => return common(byte),
    })
}

/// The bits of `$10`.
fn fields(settings: &Settings, _: bool) -> Fields {
    let bit = |number: u32| settings.report_mask() & (1 << number) != 0;
    Fields {
        machine_position: bit(0),
        buffers: bit(1),
        line_number: bit(2),
        feed: bit(3),
        pins: bit(4),
        offsets: bit(5),
        overrides: bit(6),
        parser_state: bit(9),
        alarm_substate: bit(10),
        run_substate: bit(11),
        distance_to_go: bit(13),
    }
}

fn build_info(facts: &BuildFacts<'_>) -> Vec<String> {
    let parking = if facts.settings.parks() { "P" } else { "" };
    let single_axis = if facts.settings.homes_single_axes() { "H" } else { "" };
    let unlocked = if facts.settings.homing_required() { "" } else { "L" };
    let legacy = if facts.settings.legacy_realtime() { '+' } else { '-' };
    let homing = if facts.settings.homing_enabled() { "HOME," } else { "" };
    let sync = if facts.has_spindle_sync { "SS," } else { "" };
    let (blocks, bytes) = (facts.blocks_max, facts.receive_buffer_bytes);
    let letters: String = facts.settings.letters().all().iter().collect();
    let count = letters.len();
    let mut lines = vec![
        format!("[VER:1.1f.20260817:{}]", facts.note),
        format!("[OPT:VNM{parking}{single_axis}{unlocked}+,{blocks},{bytes},{count},0]"),
        format!("[AXS:{count}:{letters}]"),
        format!("[NEWOPT:ENUMS,RT{legacy},{homing}TC,{sync}SED]"),
        "[FIRMWARE:grblHAL]".into(),
        "[SIGNALS:D]".into(),
        "[NVS STORAGE:*EEPROM]".into(),
        "[DRIVER:Simulator]".into(),
        "[DRIVER VERSION:260324]".into(),
    ];
    let [digital_in, digital_out, analog_in, analog_out] = facts.ports;
    if facts.ports != [0; 4] {
        lines.push(format!("[AUX IO:{digital_in},{digital_out},{analog_in},{analog_out}]"));
    }
    lines
}
