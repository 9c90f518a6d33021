//! grblHAL.

use super::{BUFFER, CodeRow, QUEUED_MAX, ReportField, SettingRow, Traits};

pub(super) static TRAITS: Traits = Traits {
    name: "grblHAL",
    banner_beginning: "grblhal ",
    firmware_message: Some("grblHAL"),
    version_word: None,
    alarms: ALARMS,
    errors: ERRORS,
    settings: SETTINGS,
    axes: 6,
    unreported_planner_blocks: None,
    // It waits for its spindle while nothing moves.
    position_kept_after: &[14],
    deaf_after: &[],
    reset_needed_after: &[1, 2, 10, 17, 20],
    error_lasts: true,
    has_tool_change: true,
    has_full_report: true,
    homes_one_by_one: false,
    echoes_after_control_characters: false,
    prints_accessories_when_off: true,
    overrides_in_a_round: QUEUED_MAX,
    report_fields: REPORT_FIELDS,
    line_number_field: Some(ReportField {
        bit: 2,
        gives: "Ln (line numbers): with line_numbers the controller says what it cuts",
    }),
    no_field_because: "",
};

/// Of the fastest of an axis. It refuses threads that are faster than that of Z, along whatever axes, and
/// falls behind the spindle where another axis is too slow.
pub(crate) const THREAD_SHARE: f64 = 0.9;
/// The longest that a thread waits for its spindle, s; then it is an alarm.
pub(crate) const THREAD_WAIT_S_MAX: f64 = 5.0;

/// How long a thread waits for its spindle, at the most: two turns, s.
pub(crate) fn thread_wait_s(rpm: f64) -> f64 {
    120.0 / rpm
}

/// What the driver uses of its reports; all are on as it is delivered.
const REPORT_FIELDS: &[ReportField] = &[
    BUFFER,
    ReportField { bit: 3, gives: "FS (feed and spindle): the actual feed rate is known" },
    ReportField { bit: 4, gives: "Pn (inputs): closed switches are known" },
    ReportField {
        bit: 5,
        gives: "WCO (offsets): both positions are known, machine and work frame",
    },
    ReportField { bit: 6, gives: "Ov (overrides): overrides, spindle and coolant are known" },
];

/// What `ALARM:N` means besides the numbers that all share.
#[rustfmt::skip]
const ALARMS: &[CodeRow] = &[
    (10, "the machine's emergency stop is active: release it, then reset"),
    (11, "the machine must be homed before anything else"),
    (12, "a limit switch is engaged: move the axis off it"),
    (13, "the probe was touched outside of probing: clear it"),
    (14, "the spindle did not reach its speed in time"),
    (15, "the second switch of an axis with two motors was not found: check travel, pull-off ($27) and wiring"),
    (16, "the controller failed its own test at power-up: switch it off and on"),
    (17, "a motor driver reports a fault: clear it, then reset and home"),
    (18, "homing is not configured as it must be: check $22 and $44 to $46"),
    (19, "a Modbus device did not answer as it should: check the spindle drive and its cable"),
    (20, "the controller lost its input and output expander: reset"),
    (21, "the memory for settings failed: check all settings"),
    (22, "more was sent than the controller could take"),
];

/// What `error:N` means besides the numbers that all share.
#[rustfmt::skip]
const ERRORS: &[CodeRow] = &[
    (18, "a reset came first"),
    (19, "a value that must be above zero is not"),
    (38, "the tool number is too high, or no such tool is in the controller's table"),
    (39, "a value is out of range"),
    (40, "a tool change is pending: finish it first"),
    (41, "the spindle must turn before a motion that depends on it"),
    (42, "threads are cut in the ZX plane: select G18"),
    (43, "the feed rate is higher than the controller can go"),
    (44, "the spindle speed is out of range"),
    (45, "a limit switch is engaged: only homing is allowed"),
    (46, "the machine must be homed first"),
    (47, "the tool changer does not know which tool is in the spindle: set it with M61"),
    (48, "two words contradict each other"),
    (49, "the controller failed its own test at power-up: switch it off and on"),
    (50, "the machine's emergency stop is active: release it, then reset"),
    (51, "a motor driver reports a fault"),
    (52, "the value of the setting is out of range"),
    (53, "this board does not have the setting"),
    (54, "the retract height lies below the depth of the hole"),
    (55, "two axes with two motors each cannot be homed at once"),
    (56, "this work system is locked against changes"),
    (57, "a % where none belongs"),
    (58, "the input or output is taken by something else"),
    (60, "the card could not be mounted"),
    (61, "the file could not be read"),
    (62, "the folder could not be opened"),
    (63, "there is no such folder"),
    (64, "no card is mounted"),
    (65, "no file system is mounted"),
    (66, "the file system cannot be written to"),
    (70, "Bluetooth did not start"),
    (71, "an expression holds an unknown operation"),
    (72, "an expression divides by zero"),
    (73, "the argument of a function is too large or too small"),
    (74, "the argument does not suit the operation"),
    (75, "an expression cannot be read"),
    (76, "the result of an expression is not a number"),
    (77, "the controller asks for a password"),
    (78, "the password does not allow this"),
    (79, "a critical alarm is active: reset first"),
    (80, "flow words work in macros on the controller only"),
    (81, "an unknown flow word"),
    (82, "flow words are nested too deeply"),
    (83, "there is no memory left for flow words"),
    (84, "the file could not be opened"),
    (85, "the file system could not be formatted"),
    (86, "the input or output cannot be used for this"),
    (87, "there is a tool in the spindle"),
    (88, "there is no tool in the spindle"),
    (89, "the file could not be deleted"),
    (90, "the controller's own cutter compensation is already on"),
    (91, "this is not allowed while the controller compensates the cutter: cancel it with G40"),
    (92, "the controller cannot compensate the cutter on this move"),
    (253, "an error that the user's own code raised"),
];

/// Where its settings differ from those of grbl, and what it adds.
#[rustfmt::skip]
const SETTINGS: &[SettingRow] = &[
    (4, "step enable invert", "mask"),
    (5, "limit pins invert", "mask"),
    (6, "probe pin invert", "mask"),
    (9, "PWM spindle options", "mask"),
    (14, "control pins invert", "mask"),
    (15, "coolant pins invert", "mask"),
    (17, "control pins pull-up off", "mask"),
    (18, "limit pins pull-up off", "mask"),
    (19, "probe pin pull-up off", "mask"),
    (20, "soft limits", "mask"),
    (21, "hard limits", "mask"),
    (22, "homing cycle", "mask"),
    (28, "G73 retract distance", "mm"),
    (29, "step pulse delay", "µs"),
    (32, "mode of operation: 0 normal, 1 laser, 2 lathe", ""),
    (33, "spindle PWM frequency", "Hz"),
    (34, "spindle PWM off value", "%"),
    (35, "spindle PWM minimum value", "%"),
    (36, "spindle PWM maximum value", "%"),
    (37, "steppers that stay enabled", "mask"),
    (39, "printable real-time bytes", "boolean"),
    (40, "jogs limited to the travel", "boolean"),
    (41, "parking cycle", "mask"),
    (42, "parking axis", ""),
    (43, "homing passes", ""),
    (44, "axes homed first", "mask"),
    (45, "axes homed second", "mask"),
    (46, "axes homed third", "mask"),
    (56, "parking pull-out distance", "mm"),
    (57, "parking pull-out rate", "mm/min"),
    (58, "parking target", "mm"),
    (59, "parking fast rate", "mm/min"),
    (60, "overrides restored by a reset", "boolean"),
    (61, "safety door options", "mask"),
    (62, "sleep", "boolean"),
    (63, "feed hold actions", "mask"),
    (64, "locked at start", "boolean"),
    (65, "probing options", "mask"),
    (341, "tool change mode", ""),
    (342, "tool change probing distance", "mm"),
    (343, "tool change locate feed rate", "mm/min"),
    (344, "tool change search seek rate", "mm/min"),
    (345, "tool change probe pull-off rate", "mm/min"),
    (346, "tool change options", "mask"),
    (384, "G92 forgotten at power-off", "boolean"),
    (392, "spindle on delay when a door closes", "s"),
    (393, "coolant on delay when a door closes", "s"),
    (394, "spindle on delay", "s"),
    (398, "planner buffer blocks", ""),
    (481, "automatic report interval", "ms"),
    (485, "tool number kept at power-off", "boolean"),
    (486, "work systems locked against changes", "mask"),
    (539, "spindle off delay", "s"),
    (673, "coolant on delay", "s"),
    (676, "what a reset clears", "mask"),
    (680, "stepper enable delay", "ms"),
];
