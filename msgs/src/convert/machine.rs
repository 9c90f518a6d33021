//! The state of the machine.

use super::function::further_to_wire;
use crate::contour::{CutterSide, SpindleMode};
use crate::machine::{LinkWatch, MachineState, Mode};
use crate::units::{m_per_s_from_mm_per_min, point_from_position, rad_per_s_from_rpm};
use crate::wire::cnc_msgs::msg as wire;
use crate::wire::std_msgs::msg::Header;

/// The constant of a mode in `MachineState` and in the feedback of actions.
pub const fn mode_to_wire(mode: Mode) -> u8 {
    type W = wire::MachineState;
    match mode {
        Mode::Unknown => W::STATE_UNKNOWN,
        Mode::Disconnected => W::STATE_DISCONNECTED,
        Mode::Idle => W::STATE_IDLE,
        Mode::Run => W::STATE_RUN,
        Mode::Hold => W::STATE_HOLD,
        Mode::Jog => W::STATE_JOG,
        Mode::Alarm => W::STATE_ALARM,
        Mode::Door => W::STATE_DOOR,
        Mode::Check => W::STATE_CHECK,
        Mode::Home => W::STATE_HOME,
        Mode::Sleep => W::STATE_SLEEP,
        Mode::ToolChange => W::STATE_TOOL_CHANGE,
    }
}

/// The mode of a constant; [`Mode::Unknown`] for an unknown constant.
pub fn mode_from_wire(state: u8) -> Mode {
    const MODES: [Mode; 12] = [
        Mode::Unknown,
        Mode::Disconnected,
        Mode::Idle,
        Mode::Run,
        Mode::Hold,
        Mode::Jog,
        Mode::Alarm,
        Mode::Door,
        Mode::Check,
        Mode::Home,
        Mode::Sleep,
        Mode::ToolChange,
    ];
    MODES.into_iter().find(|&mode| mode_to_wire(mode) == state).unwrap_or_default()
}

/// The constant of a watch in `MachineState`.
pub const fn link_watch_to_wire(watch: LinkWatch) -> u8 {
    type W = wire::MachineState;
    match watch {
        LinkWatch::Unknown => W::LINK_WATCH_UNKNOWN,
        LinkWatch::Standstill => W::LINK_WATCH_STANDSTILL,
        LinkWatch::Buffer => W::LINK_WATCH_BUFFER,
        LinkWatch::Lines => W::LINK_WATCH_LINES,
        LinkWatch::LinesAndBuffer => W::LINK_WATCH_LINES_AND_BUFFER,
    }
}

/// The watch of a constant; [`LinkWatch::Unknown`] for an unknown constant.
pub fn link_watch_from_wire(watch: u8) -> LinkWatch {
    const WATCHES: [LinkWatch; 5] = [
        LinkWatch::Unknown,
        LinkWatch::Standstill,
        LinkWatch::Buffer,
        LinkWatch::Lines,
        LinkWatch::LinesAndBuffer,
    ];
    WATCHES.into_iter().find(|&known| link_watch_to_wire(known) == watch).unwrap_or_default()
}

/// The state as a message; the header has the time of its report and its frame.
pub fn machine_state_to_wire(header: Header, state: &MachineState) -> wire::MachineState {
    let further = state.further();
    let [feed, rapid, spindle] = state.overrides_percent.map(|percent| f64::from(percent) / 100.0);
    wire::MachineState {
        header,
        state: mode_to_wire(state.mode),
        reason: state.reason.clone(),
        motion_possible: state.motion_possible,
        needs_reset: state.needs_reset,
        position_known: state.machine_position.is_some() && state.work_position.is_some(),
        machine_position: point_from_position(state.machine_position.unwrap_or_default()),
        work_position: point_from_position(state.work_position.unwrap_or_default()),
        feed_rate: m_per_s_from_mm_per_min(state.feed_mm_per_min),
        spindle_speed: rad_per_s_from_rpm(state.spindle_rpm),
        spindle: match state.spindle {
            None => wire::MachineState::SPINDLE_UNKNOWN,
            Some(SpindleMode::Off) => wire::MachineState::SPINDLE_OFF,
            Some(SpindleMode::Clockwise) => wire::MachineState::SPINDLE_CLOCKWISE,
            Some(SpindleMode::CounterClockwise) => wire::MachineState::SPINDLE_COUNTER_CLOCKWISE,
        },
        flood: state.flood,
        mist: state.mist,
        work_system: state.work_system,
        program_id: state.program_id.clone(),
        path_revision: state.path_revision,
        settled_elements: state.settled_elements,
        line: state.line,
        tool_wanted: state.tool_wanted,
        alarm_code: state.alarm_code,
        is_homed: state.is_homed,
        cutter_radius_active_left: state.compensation == Some(CutterSide::Left),
        cutter_radius_active_right: state.compensation == Some(CutterSide::Right),
        link_age: state.link_age_s,
        link_watch: link_watch_to_wire(state.link_watch),
        feed_override: feed,
        rapid_override: rapid,
        spindle_override: spindle,
        pins: state.pins.clone(),
        further_axes: further.machine.or(further.work).bits(),
        further_machine_position: further_to_wire(further.machine),
        further_work_position: further_to_wire(further.work),
    }
}
