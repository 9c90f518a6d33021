//! `kerf status`: the state of the machine, as the driver reports it.

use crate::exit::CommandResult;
use crate::latched::{LATCHED_WITHIN, newest, newest_there};
use crate::local::over_ros_or_locally;
use crate::node_message::with_commands;
use crate::operate::no_answer;
use crate::plan_machine::duration;
use axis_driver::protocol::Wish;
use cnc_msgs::convert::{
    further_from_wire, link_watch_from_wire, machine_state_to_wire, mode_from_wire,
};
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes};
use cnc_msgs::machine::{LinkWatch, Mode};
use cnc_msgs::units::{mm_per_min_from_m_per_s, position_from_point, rpm_from_rad_per_s};
use cnc_msgs::wire::cnc_msgs::action::{RunProgram, RunProgramFeedback};
use cnc_msgs::wire::cnc_msgs::msg::{MachineState, Program, RunResult};
use cnc_msgs::wire::std_msgs::msg::Header;
use replay::run_result;
use runtime::{Handle, Qos, Subscription};
use std::time::Duration;
use tokio::time::timeout;

/// The driver gives feedback several times within this time while a program runs.
const FEEDBACK_WITHIN: Duration = Duration::from_millis(300);

/// `kerf status`
pub(crate) fn run(ros_args: &[String]) -> CommandResult {
    let over_ros = async |node: &Handle| {
        let mut states: Subscription<MachineState> =
            node.subscription("machine_state", Qos::LATCHED)?;
        let mut results: Subscription<RunResult> = node.subscription("run_result", Qos::LATCHED)?;
        // Whose keys do not let it read this sees the state all the same.
        let mut feedback = node.action_feedback::<RunProgram>("run_program").ok();
        let stamp = |state: &MachineState| (state.header.stamp.sec, state.header.stamp.nanosec);
        let mut programs: Subscription<Program> = node.subscription("program", Qos::LATCHED)?;
        let state = newest(&mut states, stamp)
            .await
            .ok_or_else(|| no_answer(states.topic(), LATCHED_WITHIN))?;
        let program = newest_there(&mut programs, |it| (it.stamp.sec, it.stamp.nanosec)).await;
        print!("{}", describe(&state, program.as_ref()));
        // The newest of those that came meanwhile.
        let mut progress = None;
        let is_running = !matches!(mode_from_wire(state.state), Mode::Idle | Mode::Disconnected);
        let mut wait = if is_running { FEEDBACK_WITHIN } else { Duration::ZERO };
        while let Some(feedback) = &mut feedback
            && let Ok(newer) = timeout(wait, feedback.next()).await
        {
            (progress, wait) = (Some(newer), Duration::ZERO);
        }
        if let Some(progress) = progress.filter(|_| is_running) {
            print!("{}", describe_progress(&progress));
        }
        // Late joiners get the last result; before the first run there is none.
        if let Some(result) =
            newest_there(&mut results, |it| (it.stamp.sec, it.stamp.nanosec)).await
        {
            println!("  last run {}", with_commands(&run_result::of_message(&result).to_string()));
        }
        if let Some(mismatch) = node.other_middleware() {
            println!("  {mismatch}");
        }
        Ok(())
    };
    over_ros_or_locally(ros_args, Wish::State, over_ros, |answer| {
        print!("{}", describe(&machine_state_to_wire(Header::default(), &answer.state), None));
        Ok(())
    })
}

/// How far a run is.
fn describe_progress(progress: &RunProgramFeedback) -> String {
    let left = &progress.time_left;
    let seconds = f64::from(left.sec) + f64::from(left.nanosec) * 1e-9;
    format!("  {:.0} % of the run done, {} left\n", 100.0 * progress.fraction, duration(seconds))
}

/// `, A90.000 degrees`: axes besides X, Y and Z.
pub(crate) fn further_text(named: u8, values: &[f64]) -> String {
    let axes = further_from_wire("further_position", named, values).unwrap_or_default();
    let words = axes.iter().map(|(axis, at)| {
        let unit = if FurtherAxes::is_rotary(axis) { "degrees" } else { "mm" };
        format!(", {}{at:.3} {unit}", FURTHER_LETTERS[axis])
    });
    words.collect()
}

/// `part.ngc, line 7`; the id of a program where the loader has another one.
fn program_and_line(state: &MachineState, loaded: Option<&Program>) -> String {
    let name = loaded.filter(|loaded| loaded.program_id == state.program_id);
    let name = name.map_or(&state.program_id, |loaded| &loaded.name);
    let place = match state.line {
        0 => "before its first line".to_owned(),
        line => format!("line {line}"),
    };
    format!("{}, {place}", intake::text::one_line(name))
}

/// The state for people: millimetres, without unknown values.
fn describe(state: &MachineState, loaded: Option<&Program>) -> String {
    let mode = mode_from_wire(state.state).name();
    let reason = with_commands(&intake::text::one_line(&state.reason));
    let mut text = match reason.as_str() {
        "" => format!("{mode}\n"),
        reason if reason.starts_with(mode) => format!("{reason}\n"),
        reason => format!("{mode}: {reason}\n"),
    };
    if state.position_known {
        for (frame, point, further) in [
            ("machine", &state.machine_position, &state.further_machine_position),
            ("work", &state.work_position, &state.further_work_position),
        ] {
            let [x, y, z] = position_from_point(point);
            let further = further_text(state.further_axes, further);
            text += &format!("  {frame:8} X{x:.3} Y{y:.3} Z{z:.3} mm{further}\n");
        }
    } else {
        text += "  position not known\n";
    }
    if state.needs_reset {
        text += "  blocked until `kerf reset`\n";
    }
    if state.motion_possible {
        text += "  the machine may be moving\n";
    }
    if !state.pins.is_empty() {
        text += &format!("  switches closed: {}\n", state.pins);
    }
    let spindle = match state.spindle {
        MachineState::SPINDLE_OFF => " off",
        MachineState::SPINDLE_CLOCKWISE => " clockwise",
        MachineState::SPINDLE_COUNTER_CLOCKWISE => " counter-clockwise",
        _ => "",
    };
    let coolant = match (state.flood, state.mist) {
        (true, true) => ", flood and mist",
        (true, false) => ", flood",
        (false, true) => ", mist",
        (false, false) => "",
    };
    let system = match state.work_system {
        0 => String::new(),
        system => format!(", G{}", u16::from(system) + 53),
    };
    text += &format!(
        "  feed {:.1} mm/min, spindle{spindle} {:.0} rev/min{coolant}{system}\n  \
         overrides: feed {:.0}, rapid {:.0}, spindle {:.0} %\n",
        mm_per_min_from_m_per_s(state.feed_rate),
        rpm_from_rad_per_s(state.spindle_speed),
        state.feed_override * 100.0,
        state.rapid_override * 100.0,
        state.spindle_override * 100.0,
    );
    if !state.program_id.is_empty() {
        let side = match (state.cutter_radius_active_left, state.cutter_radius_active_right) {
            (true, _) => ", cutter left of the contour",
            (_, true) => ", cutter right of the contour",
            _ => "",
        };
        text += &format!("  program {}{side}\n", program_and_line(state, loaded));
    }
    let report = match state.link_age {
        age if age.is_finite() => format!("last report {age:.1} s ago"),
        // Never, or none since the link was lost.
        _ => "no report on this connection".to_owned(),
    };
    let watch = match link_watch_from_wire(state.link_watch) {
        LinkWatch::Unknown => String::new(),
        watch => format!("  link: {}\n", watch.describe()),
    };
    text + &watch + &format!("  {}, {report}\n", if state.is_homed { "homed" } else { "not homed" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_shown_by_its_name_where_the_loader_has_it() {
        let program = |program_id: &str| Program {
            program_id: program_id.into(),
            name: "part.ngc".into(),
            ..Program::default()
        };
        for (loaded, line, expected) in [
            (Some(program("01aca5")), 0, "part.ngc, before its first line"),
            (Some(program("01aca5")), 7, "part.ngc, line 7"),
            (Some(program("ffffff")), 7, "01aca5, line 7"),
            (None, 0, "01aca5, before its first line"),
        ] {
            let state =
                MachineState { program_id: "01aca5".into(), line, ..MachineState::default() };
            assert_eq!(program_and_line(&state, loaded.as_ref()), expected);
        }
    }
}
