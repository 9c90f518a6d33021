//! The driver's parameters and what they make of the driver.

use crate::driver::{CheckTravel, DriverConfig, OnCommanderLoss, OnPathDeviation, OnRosLoss};
use crate::encoder::EncoderConfig;
use crate::serial::{Reopen, SerialConfig};
use cnc_msgs::keep_out::KeepOut;
use runtime::parameters::{Declared, ParameterValue};
use std::path::Path;
use std::time::Duration;

/// First and longest pause between two tries to open the port.
const REOPEN: Reopen =
    Reopen::Backoff { first: Duration::from_millis(500), most: Duration::from_secs(5) };

/// `approach_z_mm` that nobody has given: no machine is as deep.
const NO_HEIGHT_MM: f64 = -100_000.0;

/// What is settled when the port is opened, or the node is made.
const AT_START: [&str; 7] =
    ["port", "baud", "dtr", "rts", "receive_buffer_bytes", "frame_prefix", "keep_out"];

/// All of them.
pub(crate) fn declared() -> Vec<Declared> {
    let config = DriverConfig::default();
    let encoder = EncoderConfig::default();
    let integer = |value: u32| i64::from(value);
    vec![
        Declared::new(
            "port",
            "",
            "serial port, best a name below /dev/serial/by-id, or tcp://host:23, ws://host:81, \
             rfc2217://host:4000; empty: none",
        ),
        Declared::new("baud", integer(config.baud), "bits a second of a serial line")
            .integer_within(1_200, 4_000_000),
        Declared::new("dtr", "leave", "level of DTR after opening: leave, set or clear")
            .one_of(&["leave", "set", "clear"]),
        Declared::new("rts", "leave", "level of RTS after opening: leave, set or clear")
            .one_of(&["leave", "set", "clear"]),
        Declared::new(
            "reset_on_connect",
            config.reset_on_connect,
            "whether a controller that stands still is reset when the port is opened",
        ),
        Declared::new(
            "hold_latency_ms_max",
            integer(config.hold_latency_ms_max),
            "the longest that a feed hold waits for bytes that are already on the wire, ms",
        )
        .integer_within(5, 1_000),
        Declared::new(
            "receive_buffer_bytes",
            0_i64,
            "override for controllers that report no receive buffer size or too large a one; 0: use the reported size, or 128",
        )
        .integer_within(0, 65_535),
        Declared::new(
            "poll_interval_ms",
            integer(config.poll_interval_ms),
            "time between two status requests, ms",
        )
        .integer_within(50, 1_000),
        Declared::new(
            "busy_poll_interval_ms",
            integer(config.busy_poll_interval_ms),
            "time between two status requests while lines are under way, ms; they take at most a \
             tenth of the serial line; 0: as poll_interval_ms",
        )
        .integer_within(0, 1_000),
        Declared::new(
            "line_check_interval_ms",
            integer(config.line_check_interval_ms),
            "time between two checks ($G) among the lines of a run, which find lost and doubled \
             lines and answers, ms; 0: none",
        )
        .integer_within(0, 10_000),
        Declared::new(
            "homing_s_max",
            integer(config.homing_s_max),
            "the longest that homing takes, s",
        )
        .integer_within(1, 3_600),
        Declared::new(
            "position_mm_max",
            encoder.position_mm_max,
            "the largest coordinate that is sent, either sign, mm",
        )
        .within(1.0, 100_000.0),
        Declared::new(
            "feed_mm_per_min_max",
            encoder.feed_mm_per_min_max,
            "the largest feed rate that is sent, mm/min",
        )
        .within(1.0, 1_000_000.0),
        Declared::new(
            "check_in_controller",
            config.check_in_controller,
            "whether a goal with check_only goes through the controller's check mode, which ends in a reset",
        ),
        Declared::new(
            "require_recording",
            config.require_recording,
            "whether a run begins only when the recorder has opened its bag, and holds when that misses something",
        ),
        Declared::new(
            "tool_change",
            "driver",
            "who waits at a tool change: driver (any firmware) or controller (M6 of grblHAL with \
             $341, or an automatic changer)",
        )
        .one_of(&["driver", "controller"]),
        Declared::new(
            "tool_change_return",
            config.tool_change_return,
            "whether the tool returns to where the run stopped when a tool change is confirmed \
             elsewhere (Z last if it is above); otherwise the confirmation is refused",
        ),
        Declared::new(
            "user_function_s_max",
            integer(config.user_function_s_max),
            "the longest that a function of the user (M100 to M199, service user_function) may take, s; 0: none is \
             called",
        )
        .integer_within(0, 86_400),
        Declared::new(
            "on_commander_loss",
            "hold",
            "what to do when commander_heartbeat stops during a run: continue, hold or \
             hold_then_abort",
        )
        .one_of(&OnCommanderLoss::WORDS.map(|(word, _)| word)),
        Declared::new(
            "commander_timeout_ms",
            integer(config.commander_timeout_ms),
            "time without commander_heartbeat after which a commander that sent it counts as \
             lost, ms",
        )
        .integer_within(100, 60_000),
        Declared::new(
            "rate_margin",
            config.rate_margin,
            "how many times faster than $110 to $112 an axis is believed to move; a position farther away is doubted",
        )
        .within(1.0, 100_000.0),
        Declared::new(
            "on_ros_loss",
            "as_commander",
            "what to do while the ROS side of the driver is restarted: as_commander, finish or \
             hold",
        )
        .one_of(&OnRosLoss::WORDS.map(|(word, _)| word)),
        Declared::new(
            "ros_loss_timeout_ms",
            integer(config.ros_loss_timeout_ms),
            "time without ROS after which the machine holds, with on_ros_loss: hold, ms",
        )
        .integer_within(100, 600_000),
        Declared::new(
            "on_path_deviation",
            "hold",
            "what to do when a report shows the tool where no line that was sent can have taken \
             it, or other words in force than were sent: hold, log or off; log or off where \
             kinematics are neither Cartesian nor CoreXY",
        )
        .one_of(&OnPathDeviation::WORDS.map(|(word, _)| word)),
        Declared::new(
            "check_travel",
            "refuse",
            "what to do when a program leaves the travel of the machine ($130 to $132), is longer \
             than it, or the travel cannot be read: refuse, warn or off",
        )
        .one_of(&CheckTravel::WORDS.map(|(word, _)| word)),
        Declared::new(
            "keep_out",
            "",
            "file with boxes that the tool must not touch (clamps, fixtures), YAML, millimetres; it \
             is read when the node starts; empty: none",
        ),
        Declared::new(
            "line_numbers",
            encoder.line_numbers,
            "whether lines carry N words, for controllers that report Ln; costs some 6 bytes a line",
        ),
        Declared::new(
            "approach",
            "none",
            "how the tool gets to the start of a run that begins in the middle: none (it has to \
             be there) or lift (by way of approach_z_mm)",
        )
        .one_of(&["none", "lift"]),
        Declared::new(
            "approach_z_mm",
            NO_HEIGHT_MM,
            "height in the machine frame at which the tool is clear of everything, mm; -100000: not \
             given, and approach: lift is refused",
        )
        .within(NO_HEIGHT_MM, 100_000.0),
        Declared::new("optional_stop", encoder.optional_stop, "whether M1 stops as M0 does"),
        Declared::new(
            "frame_prefix",
            "",
            "prefix of the frame names machine, work and tool0; empty: the namespace of the node \
             (cell/mill/); /: none",
        ),
    ]
    .into_iter()
    .map(|row| if AT_START.contains(&row.name.as_str()) { row.read_only() } else { row })
    .collect()
}

/// The boxes of the file that the parameter `keep_out` names; none without a name.
pub(crate) fn keep_out(
    get: impl Fn(&str) -> ParameterValue,
) -> Result<KeepOut, settings::KeepOutFileError> {
    match get("keep_out") {
        ParameterValue::String(path) if !path.is_empty() => {
            settings::load_keep_out(Path::new(&path))
        }
        _ => Ok(KeepOut::default()),
    }
}

/// Whether parameters fit each other: on some machines any height that is assumed is inside of the part.
///
/// # Errors
/// The tool is to be lifted, and no height is given.
pub(crate) fn check_approach(get: impl Fn(&str) -> ParameterValue) -> Result<(), String> {
    let lifts = get("approach") == ParameterValue::String("lift".into());
    match get("approach_z_mm") {
        ParameterValue::Double(height) if lifts && height <= NO_HEIGHT_MM => Err(
            "approach is lift, and approach_z_mm is not given: set approach_z_mm to a height in the machine \
             frame at which the tool is clear of everything, with or before approach"
                .into(),
        ),
        _ => Ok(()),
    }
}

/// The serial shell's configuration, from the node's parameters.
pub(crate) fn serial_config(get: impl Fn(&str) -> ParameterValue) -> SerialConfig {
    let level = |name| match get(name) {
        ParameterValue::String(word) if word == "set" => Some(true),
        ParameterValue::String(word) if word == "clear" => Some(false),
        _ => None,
    };
    SerialConfig {
        path: match get("port") {
            ParameterValue::String(path) => path,
            _ => String::new(),
        },
        dtr: level("dtr"),
        rts: level("rts"),
        reopen: REOPEN,
        driver: DriverConfig::from_parameters(&get),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tool_is_lifted_only_to_a_height_that_was_given() {
        for (approach, height, is_taken) in [
            ("none", None, true),
            ("lift", None, false),
            ("lift", Some(0.0), true),
            ("lift", Some(-2.0), true),
            ("none", Some(-2.0), true),
        ] {
            let get = |name: &str| match (name, height) {
                ("approach", _) => ParameterValue::String(approach.into()),
                ("approach_z_mm", Some(height)) => ParameterValue::Double(height),
                _ => {
                    let rows = declared();
                    let row = rows.iter().find(|row| row.name == name).expect("it is declared");
                    row.default.clone()
                }
            };
            assert_eq!(check_approach(get).is_ok(), is_taken, "{approach} {height:?}");
        }
    }
}
