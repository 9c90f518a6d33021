//! The virtual controller: built, set and positioned as the recorded one.
//!
//! From what the driver recorded about it after connecting. Pure: returns a controller.

use super::run::RunHistory;
use super::script::start_in_machine;
use cnc_msgs::convert::further_from_wire;
use cnc_msgs::further::FURTHER_LETTERS;
use cnc_msgs::units::position_from_point;
use cnc_msgs::wire::cnc_msgs::msg::{ControllerSettings, WorkOffset};
use replay::ReplayError;
use replay::recording::Recording;
use std::time::Duration;
use virtual_controller::{Build, Controller, Firmware, Settings};

/// The controller, and the points in which it differs from the recorded one.
#[derive(Debug)]
pub(super) struct Likeness {
    pub(super) controller: Controller,
    pub(super) notes: Vec<String>,
}

/// Receive buffers that a virtual controller may have, bytes.
const RECEIVE_BUFFER_BYTES: std::ops::RangeInclusive<usize> = 16..=65_536;
/// Shifts below this count as none, mm.
const NO_SHIFT_MM: f64 = 1e-6;
/// Time of the set-up lines on the controller's clock, before the driver's first bytes.
const ENTERED_AT: Duration = Duration::from_millis(1);

/// Builds the controller, positioned at the start of the run.
///
/// # Errors
/// The bag lacks the start position, or a shift was in force that a reset clears.
pub(super) fn likeness(
    recording: &Recording,
    run: &RunHistory<'_>,
) -> Result<Likeness, ReplayError> {
    let mut notes = Vec::new();
    let recorded = recording.settings.clone().unwrap_or_else(|| {
        notes.push(
            "the bag does not contain the controller's settings; those of a small router are used"
                .into(),
        );
        ControllerSettings::default()
    });
    let name = recorded.firmware.to_lowercase();
    let firmware = name.parse().unwrap_or_else(|_| {
        if !name.is_empty() {
            notes.push(format!("there is no virtual {}; grbl is used", recorded.firmware));
        }
        Firmware::Grbl
    });
    let axes = recorded.axes.parse().unwrap_or_default();
    let mut settings = Settings::small_router_of(firmware).with_axes(axes);
    let values: Vec<(u16, f64)> = recorded.settings.iter().filter_map(number_and_value).collect();
    // Some settings are accepted only after others.
    for _ in 0..2 {
        for &(number, value) in &values {
            // Rejected ones are reported below.
            let _ = settings.set(number, value);
        }
    }
    for &(number, value) in &values {
        if settings.get(number).is_none_or(|is| (is - value).abs() > 1e-3) {
            notes.push(format!("the virtual controller rejects ${number}={value}"));
        }
    }
    let bytes = usize::try_from(recorded.receive_buffer_size).unwrap_or(0);
    let homes = settings.homing_enabled();
    let build = Build {
        receive_buffer_bytes: Some(bytes).filter(|bytes| RECEIVE_BUFFER_BYTES.contains(bytes)),
        start_in_machine: Some(start_in_machine(run)?),
        has_mist: firmware == Firmware::Grbl && recorded.options.contains('M'),
        // No bag says it: a run with threads has begun only where there is one.
        has_spindle_encoder: true,
        has_line_numbers: firmware == Firmware::Grbl && recorded.options.contains('N'),
        ..Build::new(settings)
    };
    let mut controller = Controller::with_build(build);
    let mut lines = Vec::new();
    if homes {
        // It starts locked; the recorded one had been homed or unlocked.
        lines.push("$X".to_owned());
    }
    lines.extend(offset_lines(&recorded.offsets)?);
    let mut said = Vec::new();
    for line in lines {
        controller.receive(ENTERED_AT, format!("{line}\n").as_bytes());
        controller.transmit(&mut said);
    }
    let said = String::from_utf8_lossy(&said);
    if let Some(refused) = said.lines().find(|line| line.starts_with("error:")) {
        notes.push(format!("the virtual controller rejects some offsets ({refused})"));
    }
    Ok(Likeness { controller, notes })
}

fn number_and_value(
    setting: &cnc_msgs::wire::cnc_msgs::msg::ControllerSetting,
) -> Option<(u16, f64)> {
    let number = u16::try_from(setting.number).ok()?;
    Some((number, setting.value.trim().parse().ok()?))
}

/// The lines that set the work offsets.
fn offset_lines(offsets: &[WorkOffset]) -> Result<Vec<String>, ReplayError> {
    let mut lines = Vec::new();
    for WorkOffset { name, position, further_axes, further_position } in offsets {
        let position @ [x, y, z] = position_from_point(position);
        let further = further_from_wire("further_position", *further_axes, further_position);
        let further = further.unwrap_or_default();
        let mut values = position.into_iter().chain(further.iter().map(|it| it.1));
        if values.all(|value| value.abs() < NO_SHIFT_MM) {
            continue;
        }
        let words: String = further
            .iter()
            .map(|(axis, value)| format!("{}{value:.4}", FURTHER_LETTERS[axis]))
            .collect();
        let system = name.strip_prefix('G').and_then(|number| number.parse::<u8>().ok());
        match (name.as_str(), system) {
            (_, Some(system @ 54..=59)) => {
                let number = system - 53;
                lines.push(format!("G10L2P{number}X{x:.4}Y{y:.4}Z{z:.4}{words}"));
            }
            ("G92" | "TLO", _) => {
                return Err(ReplayError::Unplayable {
                    what: format!(
                        "a shift by {name} of X{x:.3} Y{y:.3} Z{z:.3}{}",
                        further.words()
                    ),
                });
            }
            // G28 and G30 do not matter: programs are sent without them.
            _ => {}
        }
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::units::point_from_position;

    fn offset(name: &str, position: [f64; 3]) -> WorkOffset {
        WorkOffset {
            name: name.into(),
            position: point_from_position(position),
            ..WorkOffset::default()
        }
    }

    #[test]
    fn work_offsets_are_entered_and_shifts_that_a_reset_forgets_are_refused() {
        let entered = offset_lines(&[
            offset("G54", [0.0; 3]),
            offset("G55", [1.0, -2.5, 0.0]),
            offset("G28", [5.0, 5.0, 5.0]),
            offset("TLO", [0.0; 3]),
        ]);
        assert_eq!(entered.unwrap(), ["G10L2P2X1.0000Y-2.5000Z0.0000"]);
        for name in ["G92", "TLO"] {
            let refused = offset_lines(&[offset(name, [0.0, 0.0, 3.0])]).unwrap_err();
            assert!(refused.to_string().contains(&format!("a shift by {name}")), "{refused}");
        }
    }
}
